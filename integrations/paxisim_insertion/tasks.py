"""The six blind insertion tasks, and what the paper leaves open about them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import paxisim


@dataclass(frozen=True)
class Task:
    """One of the paper's tasks (Section "Experiment Setup" and its appendix).

    Attributes:
        name: The paper's name.
        handle: Shape of what the fingers hold.
        peg: Cross section of the peg.
        hole: What it goes into. A groove is open at both ends.
        clearance: Width of the hole minus that of the peg (m): a peg in the middle has half of it on each side.
        action_scale: How far (m) an action of 1 moves the goal.
        frozen: The axis that the policy cannot move along.
        max_steps: Steps at 20 Hz until the episode is truncated.
    """

    name: str
    handle: Literal["cylinder", "cube"]
    peg: Literal["round", "square"]
    hole: Literal["round", "square", "groove along x", "groove along y"]
    clearance: float = 2e-3
    action_scale: float = 10e-3
    frozen: Literal["x", "y"] | None = None
    max_steps: int = 200

    @property
    def hole_is_hidden(self) -> bool:
        """Whether the policy does not see the hole's pose either, so that ``p_t`` is 0."""
        return self.frozen is not None

    @property
    def axes(self) -> tuple[int, ...]:
        """The axes of the world that the action moves along."""
        return tuple(axis for axis, name in enumerate("xyz") if name != self.frozen)


TASKS: dict[str, Task] = {
    task.name: task
    for task in (
        Task("RY-2mm", "cylinder", "round", "round"),
        Task("RU-2mm", "cube", "round", "round"),
        Task("SQ-2mm", "cube", "square", "square"),
        Task("SQ-1mm", "cube", "square", "square", clearance=1e-3, action_scale=5e-3),
        Task("SX-2mm", "cube", "square", "groove along x", frozen="x", max_steps=120),
        Task("SY-2mm", "cube", "square", "groove along y", frozen="y", max_steps=120),
    )
}
"""The paper's tasks by name."""


def find_task(name: str) -> Task:
    """The task of that name.

    Raises:
        UnknownNameError: There is no such task.
    """
    if name not in TASKS:
        raise paxisim.UnknownNameError("task", name, TASKS)
    return TASKS[name]


@dataclass(frozen=True)
class Parameters:
    """What the paper leaves open. Lengths in m; the defaults are ours.

    Attributes:
        handle_size: Width of the handle, or its diameter.
        handle_height: Height of the handle.
        peg_size: Width of the peg, or its diameter.
        peg_length: From the handle's lower face to the peg's bottom.
        density: Of handle and peg (kg/m^3), printed plastic.
        hole_depth: From the base's upper face to the bottom of the hole.
        base_size: Width of the square base.
        floor: Thickness of the base below the hole.
        friction: Sliding friction between peg and base. Between handle and pads it is the gel's.
        grasp_offset: Largest offset of the fingers from the middle of the handle, along their width (x), the way they
            close (y) and their length (z): the paper says "randomly placed". Coupled fingers, as the Panda's, centre
            a handle between them; what is left along y is how unevenly they are mounted.
        grasp_lean: How far (rad) the peg leans at most when it is grasped, about the axis along which the fingers
            close: flat fingers straighten it about the others. Leaning like this it takes up less than half of the
            smallest clearance, that of SQ-1mm, over the depth that counts as success.
        start: The box, from the middle of the hole's upper edge, in which the peg's bottom begins: lower and upper
            corner. Where the paper prints [1.5 cm, 1.5 cm] for y, [-1.5 cm, 1.5 cm] is meant.
        engage_depth: How far below the base's upper face the peg's bottom must be for the peg to count as engaged:
            resting on the rim is not enough.
        engage_lean: How far (rad) an engaged peg may lean at most. 2 mm of clearance let one in to 10 mm that leans by
            20 degrees, and no further: if that counted, to jam it would pay better than to look for the hole.
        success_depth: h_th, the insertion has succeeded when the peg's bottom is closer than this to the hole's.
        epsilon: The epsilon of the reaching and the engagement reward.
        kp: Stiffness of the controller (1/s^2), robosuite's default.
        grip_force: With which each finger would hold a handle that does not give way (N): what deoxys, the software
            of the paper's robot, asks of the hand. robosuite's own fingers hold 30 mm with 15.5 N, and a peg that is
            pushed along them turns.

    Raises:
        InvalidValueError: A length or other value that is not positive, a peg too long or too short for the hole, or
            a start box whose corners are not in order.
    """

    handle_size: float = 30e-3
    handle_height: float = 35e-3
    peg_size: float = 20e-3
    peg_length: float = 35e-3
    density: float = 1000.0
    hole_depth: float = 20e-3
    base_size: float = 100e-3
    floor: float = 10e-3
    friction: float = 0.3
    grasp_offset: tuple[float, float, float] = (3e-3, 1e-3, 3e-3)
    grasp_lean: float = 0.03
    start: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (-15e-3, -15e-3, 5e-3),
        (15e-3, 15e-3, 20e-3),
    )
    engage_depth: float = 1e-3
    engage_lean: float = 0.17
    success_depth: float = 5e-3
    epsilon: float = 0.1
    kp: float = 150.0
    grip_force: float = 30.0

    def __post_init__(self) -> None:
        """Check the values."""
        for item in fields(self):
            value = getattr(self, item.name)
            may_be_none = item.name in ("grasp_offset", "grasp_lean", "start")
            if not may_be_none and not 0 < value < float("inf"):
                raise paxisim.InvalidValueError(f"{item.name} must be positive and finite, got {value!r}")
        if len(self.grasp_offset) != 3 or not all(0 <= value < float("inf") for value in self.grasp_offset):
            raise paxisim.InvalidValueError(
                f"grasp_offset must be three lengths that are not negative, got {self.grasp_offset}"
            )
        if not 0 <= self.grasp_lean < float("inf"):
            raise paxisim.InvalidValueError(f"grasp_lean must not be negative, got {self.grasp_lean!r}")
        low, high = self.start
        if any(a > b for a, b in zip(low, high, strict=True)) or low[2] < 0:
            raise paxisim.InvalidValueError(
                f"start must be a lower and an upper corner above the base, got {self.start}"
            )
        if self.peg_length <= self.hole_depth or self.success_depth >= self.hole_depth:
            raise paxisim.InvalidValueError(
                f"the hole ({self.hole_depth:g} m) must be shallower than the peg ({self.peg_length:g} m) is long and "
                f"deeper than success_depth ({self.success_depth:g} m)"
            )
