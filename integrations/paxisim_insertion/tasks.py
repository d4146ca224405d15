"""The six blind insertion tasks and the parameters that the paper does not specify."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import paxisim


@dataclass(frozen=True)
class Task:
    """One of the paper's tasks (Section "Experiment Setup" and its appendix).

    Attributes:
        name: Name of the task in the paper.
        handle: Shape of the handle that the fingers hold.
        peg: Cross section of the peg.
        hole: Shape of the hole. A groove is open at both ends.
        clearance: Width of the hole minus width of the peg (m): a centred peg has half of it on each side.
        action_scale: Displacement of the goal (m) for an action of 1.
        frozen: Axis along which the policy cannot move.
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
        """Whether the hole's pose is hidden from the policy too, which makes ``p_t`` 0."""
        return self.frozen is not None

    @property
    def axes(self) -> tuple[int, ...]:
        """World axes along which the action moves the goal."""
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
    """Return a task by name.

    Raises:
        UnknownNameError: There is no such task.
    """
    if name not in TASKS:
        raise paxisim.UnknownNameError("task", name, TASKS)
    return TASKS[name]


@dataclass(frozen=True)
class Parameters:
    """Values that the paper does not specify. Lengths in m; the defaults are ours.

    Attributes:
        handle_size: Width or diameter of the handle.
        handle_height: Height of the handle.
        peg_size: Width or diameter of the peg.
        peg_length: Distance from the handle's lower face to the peg's bottom.
        density: Density of handle and peg (kg/m^3), that of printed plastic.
        hole_depth: Distance from the base's upper face to the bottom of the hole.
        base_size: Width of the square base.
        floor: Thickness of the base below the hole.
        friction: Sliding friction coefficient between peg and base. Between handle and pads it is the gel's.
        grasp_offset: Largest offset of the fingers from the middle of the handle, along the fingers' width (x), their
            closing direction (y) and their length (z); the paper says "randomly placed". Coupled fingers like the
            Panda's centre a handle between them, so the offset along y comes from uneven mounting.
        grasp_lean: Largest tilt (rad) of a grasped peg about the fingers' closing direction; flat fingers straighten it
            about the other axes. Over the depth that counts as success, this tilt takes up less than half of the
            smallest clearance, that of SQ-1mm.
        start: Lower and upper corner of the box in which the peg's bottom starts, relative to the middle of the hole's
            upper edge. The paper's [1.5 cm, 1.5 cm] for y is read as [-1.5 cm, 1.5 cm].
        engage_depth: Depth below the base's upper face that the peg's bottom must reach for the peg to count as
            engaged: resting on the rim is not enough.
        engage_lean: Largest tilt (rad) of an engaged peg. A clearance of 2 mm admits a peg tilted by 20 degrees to a
            depth of 10 mm and no further; if that counted, jamming the peg would pay more than finding the hole.
        success_depth: h_th: the insertion succeeds when the peg's bottom is closer than this to the hole's bottom.
        epsilon: Epsilon of the reaching and engagement rewards.
        kp: Stiffness of the controller (1/s^2), robosuite's default.
        armature: Armature (kg m^2) of the arm's first joint, robosuite's default; that of joint i is an i-th of it. The
            controller multiplies errors by the inertia at the fingertip, so it scales the stiffness too, and a push
            straight down also pushes along x: 0.54 times as strongly with 5, and 0.30 times with 0.1.
        grip_force: Force (N) with which each finger would hold a rigid handle: the force that deoxys, the software of
            the paper's robot, commands. robosuite's own fingers hold 30 mm with 15.5 N, and a peg that is pushed along
            them rotates.
        gel_modulus: Stiffness of the pads' gel (Pa), as a `paxisim.Gel` of 3.3 mm. With the default, a taxel has
            4.2 kN/m; one of `paxisim.Layer()` has 9.2 kN/m, those of the magnetic pads of a transfer 5.5 to 15 kN/m.

    Raises:
        InvalidValueError: A length or other value is not positive, the hole is too deep or too shallow for the peg or
            for success_depth, or the corners of the start box are not in order.
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
    armature: float = 5.0
    grip_force: float = 30.0
    gel_modulus: float = 0.7e6

    def __post_init__(self) -> None:
        """Check the values."""
        for item in fields(self):
            value = getattr(self, item.name)
            may_be_none = item.name in ("grasp_offset", "grasp_lean", "start")
            if not may_be_none and not 0 < value < float("inf"):
                raise paxisim.InvalidValueError(f"{item.name} must be positive and finite, got {value!r}")
        if len(self.grasp_offset) != 3 or not all(0 <= value < float("inf") for value in self.grasp_offset):
            raise paxisim.InvalidValueError(f"grasp_offset must be three non-negative lengths, got {self.grasp_offset}")
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


PARAMETERS = Parameters()
"""The default parameters."""
