"""Scene: a hand that holds a peg above its base, independent of the engine that moves the hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arrays import library_of, like
from ..geometry import TABLE_HEIGHT
from ..reward import Insertion, insertion
from ..tasks import Parameters, Task
from .pads import ScenePads

HALF_OPEN = 0.02
"""Joint position (m) of each finger while the scene is measured."""

SIDES = np.array([1.0, -1.0])
"""The joints of the two fingers open in opposite directions."""

PINNED, FREE = 0.1, 0.2
"""Seconds in which the fingers close on a peg held in place, and then in which the peg is free."""

_OPEN = 0.5e-3  # m between handle and fingers before they close; bumps are up to 0.2 mm high


@dataclass(frozen=True)
class Grasp:
    """How the fingers hold the handle.

    Attributes:
        offset: ``(3,)`` offset of the middle between the fingers from the middle of the handle (m), along x, y and z
            of the world; the fingers close along y.
        lean: Rotation of the peg (rad) about y.
    """

    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lean: float = 0.0

    @classmethod
    def draw(cls, rng: np.random.Generator, parameters: Parameters) -> Grasp:
        """Draw a grasp within the ranges of the parameters."""
        x, y, z = rng.uniform(-1, 1, 3) * parameters.grasp_offset
        return cls((x, y, z), rng.uniform(-1, 1) * parameters.grasp_lean)


@dataclass(frozen=True)
class Placement:
    """Where hand and peg are when an episode begins; for a batch each value has the batch's leading dimensions.

    Attributes:
        grip: ``(..., 3)`` position of the fingertip (m, world).
        aside: ``(..., 2)`` joint positions of the fingers (m) where they meet in the middle of the handle, as closed.
        fingers: ``(..., 2)`` joint positions of the fingers (m) just before they close on the handle.
        peg: ``(..., 7)`` position (m, world) and quaternion of the peg.
    """

    grip: Any
    aside: Any
    fingers: Any
    peg: Any


CENTRED = Grasp()
"""Grasp with the handle upright in the middle of the fingers."""


class Scene:
    """A hand that holds a peg above its base. Each engine moves the hand in its own way.

    Attributes:
        task: The task.
        parameters: Geometry of the task.
        tactile: The pads.
        nominal: ``(3, 3)`` rotation of a fingertip that points straight down, with the fingers closing along y.
        grip_site: Index of the fingertip's site in MuJoCo's model.
        peg_body: Index of the peg's body.
        base_body: Index of the base's body.
        peg_qpos: Its place in ``qpos``.
        peg_dofs: Its place in ``qvel``.
        finger_qpos: ``(2,)`` places of the fingers in ``qpos``.
        finger_actuators: ``(2,)`` indices of the actuators that close the fingers.
        closed: Joint position (m) of each finger where the two meet.
    """

    task: Task
    parameters: Parameters
    tactile: ScenePads
    nominal: NDArray[np.floating]
    grip_site: int
    peg_body: int
    base_body: int
    peg_qpos: slice
    peg_dofs: slice
    finger_qpos: NDArray[np.integer]
    finger_actuators: NDArray[np.integer]
    closed: float

    @property
    def model_and_data(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """MuJoCo's model and data."""
        raise NotImplementedError

    def move(self, position: NDArray[np.floating]) -> None:
        """Simulate 50 ms with the fingertip pulled towards a position (m, world), pointing straight down."""
        raise NotImplementedError

    def tune(self, stiffness: float, friction: float) -> None:
        """Scale the controller's stiffness and the joints' friction until the next episode begins.

        Args:
            stiffness: Factor of the controller's stiffness; its damping ratio is unchanged.
            friction: Factor of the joints' dry friction.
        """
        raise NotImplementedError

    def _begin(self, grip: NDArray[np.floating]) -> None:
        """Reset the simulation with the fingertip at rest at a position (m, world)."""
        raise NotImplementedError

    def _settle(self, grip: NDArray[np.floating], seconds: float, pinned: bool) -> None:
        """Simulate a number of seconds with the fingertip pulled towards `grip`; a pinned peg stays in place."""
        raise NotImplementedError

    def place(
        self,
        bottom: NDArray[np.floating],
        grasp: Grasp = CENTRED,
        surface: NDArray[np.floating] | None = None,
    ) -> None:
        """Begin an episode: place the peg and close the fingers on it.

        Args:
            bottom: ``(3,)`` position of the middle of the peg's bottom relative to the middle of the hole's upper edge
                (m).
            grasp: How the fingers hold the handle.
            surface: ``(pads, rows, cols)`` heights of the taxels (m); default: unchanged.
        """
        if surface is not None:
            self.tactile.set_surface(surface)
        at = self.placement(np.asarray(bottom, dtype=float), np.asarray(grasp.offset), np.asarray(grasp.lean))
        self._begin(at.grip)
        self.tune(1.0, 1.0)
        model, data = self.model_and_data
        stiffness = -model.actuator_biasprm[self.finger_actuators, 1]
        model.actuator_biasprm[self.finger_actuators, 0] = stiffness * at.aside
        data.qpos[self.finger_qpos], data.qpos[self.peg_qpos] = at.fingers, at.peg
        data.qvel[:] = 0
        self._settle(at.grip, PINNED, pinned=True)
        self._settle(at.grip, FREE, pinned=False)

    def placement(self, bottom: Any, offset: Any, lean: Any) -> Placement:
        """Compute where hand and peg are placed for one or more episodes, with arrays of numpy or torch.

        Args:
            bottom: ``(..., 3)``, see `place`.
            offset: ``(..., 3)``, see `Grasp`.
            lean: ``(...)``, see `Grasp`.
        """
        xp = library_of(bottom)
        handle = self.parameters.peg_length + self.parameters.handle_height / 2
        zero, half = xp.zeros_like(lean), lean / 2
        peg = bottom + like(self.hole_top, bottom)
        middle = peg + handle * xp.stack([xp.sin(lean), zero, xp.cos(lean)], axis=-1)
        # the fingers meet in the middle of the handle, which may be off the middle of the hand
        aside = -offset[..., 1:2] * like(self._finger_directions, bottom)
        fingers = like((self.closed + self.parameters.handle_size / 2 + _OPEN) * SIDES, bottom) + aside
        turn = xp.stack([xp.cos(half), zero, xp.sin(half), zero], axis=-1)
        grip = middle + offset - like(self._tip_to_grip, bottom)
        return Placement(grip, aside, fingers, xp.concat([peg, turn], axis=-1))

    @property
    def fingertip(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Position (m) and rotation of robosuite's grip site in the world."""
        _, data = self.model_and_data
        return data.site_xpos[self.grip_site].copy(), data.site_xmat[self.grip_site].reshape(3, 3).copy()

    @property
    def peg(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Position (m) and rotation of the peg in the world."""
        _, data = self.model_and_data
        return data.xpos[self.peg_body].copy(), data.xmat[self.peg_body].reshape(3, 3).copy()

    @property
    def opening(self) -> float:
        """Distance (m) between the faces of the two fingers."""
        _, data = self.model_and_data
        return float(np.sum(data.qpos[self.finger_qpos] * SIDES)) - 2 * self.closed

    @property
    def base(self) -> NDArray[np.floating]:
        """Position (m) in the world of the base, at the middle of the hole's bottom; its axes are the world's."""
        return np.array([0.0, 0.0, TABLE_HEIGHT + self.parameters.floor])

    @property
    def hole_top(self) -> NDArray[np.floating]:
        """Position (m) of the middle of the hole's upper edge in the world."""
        return self.base + [0.0, 0.0, self.parameters.hole_depth]

    @property
    def insertion(self) -> Insertion:
        """Progress of the insertion."""
        position, rotation = self.peg
        return insertion(self.task, self.parameters, position - self.base, rotation)

    @property
    def contact_force(self) -> float:
        """Magnitude (N) of the force between the peg and its base, at the last physics step."""
        model, data = self.model_and_data
        touching = np.isin(model.geom_bodyid[data.contact.geom], (self.peg_body, self.base_body)).all(axis=1)
        total, one = np.zeros(3), np.zeros(6)
        for index in np.flatnonzero(touching):
            mujoco.mj_contactForce(model, data, index, one)
            # along the contact's axes, from its first geom to its second
            sign = 1.0 if model.geom_bodyid[data.contact.geom[index, 1]] == self.peg_body else -1.0
            total += sign * data.contact.frame[index].reshape(3, 3).T @ one[:3]
        return float(np.linalg.norm(total))

    def _find(self, grip_site: str, fingers: list[str]) -> None:
        """Look up the parts of the model by name."""
        model, _ = self.model_and_data
        # One contact per taxel on a round handle, as on a ball, is four times as fast as several contacts and gives the
        # same totals. Between boxes MuJoCo makes four either way. Older versions default to one and lack this bit.
        several = int(getattr(mujoco.mjtDisableBit, "mjDSBL_MULTICCD", 0))
        # testing all pairs of geoms finds the same contacts as the bodies' bounding volume trees, and is faster here
        trees = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
        model.opt.disableflags |= several | trees
        self.peg_body, self.base_body = model.body("peg").id, model.body("base").id
        joint = model.joint("peg")
        first, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        self.peg_qpos, self.peg_dofs = slice(first, first + 7), slice(dof, dof + 6)
        self.grip_site = model.site(grip_site).id
        self._finger_joints = np.array([model.joint(name).id for name in fingers])
        self.finger_qpos = model.jnt_qposadr[self._finger_joints]

    def _find_fingertips(self, faces: NDArray[np.floating], thickness: float = 0.0) -> None:
        """Find the vector from the grip site to where the fingers meet, and their joint position when closed.

        Args:
            faces: ``(2, 3)`` positions (m, world) of the fingers' faces while they are `HALF_OPEN`.
            thickness: Total distance (m) from these positions to the surfaces, for both fingers together.
        """
        _, data = self.model_and_data
        self._finger_directions = np.sign(data.xaxis[self._finger_joints, 1])
        position, rotation = self.fingertip
        apart = float(np.linalg.norm(faces[0] - faces[1])) - thickness
        self.closed = HALF_OPEN - apart / 2
        height = float((faces.mean(axis=0) - position) @ rotation[:, 2])
        self._tip_to_grip = self.nominal @ [0.0, 0.0, height]

    def _set_grip(self, actuators: Any) -> None:
        """Set the fingers' stiffness, as springs that pull them together, to hold the handle with the grip force."""
        model, _ = self.model_and_data
        self.finger_actuators = np.asarray(actuators)
        force = self.parameters.grip_force
        stiffness = force / (self.closed + self.parameters.handle_size / 2)
        model.actuator_gainprm[actuators, 0] = stiffness
        model.actuator_biasprm[actuators, 1] = -stiffness
        model.actuator_forcerange[actuators] = [-2 * force, 2 * force]
