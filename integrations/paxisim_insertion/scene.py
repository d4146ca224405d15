"""Scene: what a hand that holds a peg above its base is to a task, whatever engine moves the hand."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

from .geometry import base_pieces, contact_attributes, peg_pieces, to_mjcf
from .reward import Insertion, insertion
from .tasks import Parameters, Task

TABLE_HEIGHT = 0.8
TABLE_SIZE = (0.8, 0.8, 0.05)
HALF_OPEN = 0.02
"""Joint (m) of each finger while the scene is measured."""

SIDES = np.array([1.0, -1.0])
"""The joints of the two fingers open in opposite directions."""

_PINNED, _FREE = 0.1, 0.2  # seconds: the fingers close on a peg that is held in place, then it is let go
_OPEN = 0.5e-3  # m between handle and fingers before they close; a bump of the surface is up to 0.2 mm
_PEG_COLOUR, _BASE_COLOUR = "0.85 0.45 0.2 1", "0.3 0.45 0.65 1"


@dataclass(frozen=True)
class Grasp:
    """How the fingers hold the handle.

    Attributes:
        offset: ``(3,)`` of the fingers' middle from the middle of the handle (m), along x, y and z of the world; the
            fingers close along y.
        lean: Rotation of the peg (rad) about y.
    """

    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lean: float = 0.0

    @classmethod
    def draw(cls, rng: np.random.Generator, parameters: Parameters) -> Grasp:
        """A grasp within what the parameters allow."""
        x, y, z = rng.uniform(-1, 1, 3) * parameters.grasp_offset
        return cls((x, y, z), rng.uniform(-1, 1) * parameters.grasp_lean)


CENTRED = Grasp()
"""The handle upright in the middle of the fingers."""


class PadsInScene(Protocol):
    """The pads of a scene."""

    pads: paxisim.Pads

    def vary(self, ranges: paxisim.SceneRanges) -> paxisim.SceneVariation:
        """What draws friction, stiffness and mounts of the pads within ranges."""
        ...

    def set_surface(self, heights: NDArray[np.floating]) -> None:
        """Give the taxels new heights, ``(pads, rows, cols)`` m."""

    def read(self) -> NDArray[np.float32]:
        """``(pads, 3, rows, cols)`` float32 newtons: what the pads felt at the last physics step."""
        ...


class Scene:
    """A hand that holds a peg above its base. Each engine has its own way of moving the hand.

    Attributes:
        task: The task.
        parameters: Its geometry.
        tactile: The pads, None for a gripper without.
        nominal: ``(3, 3)`` rotation of the fingertip that points straight down, its fingers closing along y.
    """

    task: Task
    parameters: Parameters
    tactile: PadsInScene | None = None
    nominal: NDArray[np.floating]

    @property
    def model_and_data(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """MuJoCo's model and data."""
        raise NotImplementedError

    def move(self, position: NDArray[np.floating]) -> None:
        """Let 50 ms pass while the fingertip is drawn to a position (m, world), pointing straight down."""
        raise NotImplementedError

    def tune(self, stiffness: float, friction: float) -> None:
        """Multiply what controller and joints have by factors, until the next episode begins.

        Args:
            stiffness: Of the controller; its damping ratio stays.
            friction: Dry friction of the joints.
        """
        raise NotImplementedError

    def _begin(self, grip: NDArray[np.floating]) -> None:
        """Reset the simulation and put the fingertip to a position (m, world), at rest."""
        raise NotImplementedError

    def _settle(self, grip: NDArray[np.floating], seconds: float, pinned: bool) -> None:
        """Let time pass while the fingertip is drawn to `grip`; a pinned peg stays where it is."""
        raise NotImplementedError

    def place(
        self,
        bottom: NDArray[np.floating],
        grasp: Grasp = CENTRED,
        surface: NDArray[np.floating] | None = None,
    ) -> None:
        """Begin an episode: put the peg in its place and close the fingers on it.

        Args:
            bottom: ``(3,)`` the middle of the peg's bottom from the middle of the hole's upper edge (m).
            grasp: How the fingers hold the handle.
            surface: ``(pads, rows, cols)`` heights of the taxels (m); default: as they are.
        """
        if self.tactile is not None and surface is not None:
            self.tactile.set_surface(surface)
        peg = self.hole_top + bottom
        handle = self.parameters.peg_length + self.parameters.handle_height / 2
        half = grasp.lean / 2
        middle = peg + handle * np.array([np.sin(grasp.lean), 0.0, np.cos(grasp.lean)])
        grip = middle + grasp.offset - self._tip_to_grip
        self._begin(grip)
        self.tune(1.0, 1.0)
        model, data = self.model_and_data
        # the fingers meet in the middle of the handle, wherever that is to the hand
        aside = -grasp.offset[1] * self._finger_directions
        stiffness = -model.actuator_biasprm[self._grippers, 1]
        model.actuator_biasprm[self._grippers, 0] = stiffness * aside
        data.qpos[self._fingers] = (self._closed + self.parameters.handle_size / 2 + _OPEN) * SIDES + aside
        data.qpos[self._peg_qpos] = [*peg, np.cos(half), 0, np.sin(half), 0]
        data.qvel[:] = 0
        self._settle(grip, _PINNED, pinned=True)
        self._settle(grip, _FREE, pinned=False)

    @property
    def fingertip(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Position (m) and rotation of robosuite's grip site, in the world."""
        _, data = self.model_and_data
        return data.site_xpos[self._grip].copy(), data.site_xmat[self._grip].reshape(3, 3).copy()

    @property
    def peg(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Position (m) and rotation of the peg, in the world."""
        _, data = self.model_and_data
        return data.xpos[self._peg].copy(), data.xmat[self._peg].reshape(3, 3).copy()

    @property
    def opening(self) -> float:
        """Distance (m) between the two fingers' faces."""
        _, data = self.model_and_data
        return float(np.sum(data.qpos[self._fingers] * SIDES)) - 2 * self._closed

    @property
    def base(self) -> NDArray[np.floating]:
        """Position (m) of the base in the world, the middle of the hole's bottom; its axes are the world's."""
        return np.array([0.0, 0.0, TABLE_HEIGHT + self.parameters.floor])

    @property
    def hole_top(self) -> NDArray[np.floating]:
        """Position (m) of the middle of the hole's upper edge in the world."""
        return self.base + [0.0, 0.0, self.parameters.hole_depth]

    @property
    def insertion(self) -> Insertion:
        """How far the peg is in its hole."""
        position, rotation = self.peg
        return insertion(self.task, self.parameters, position - self.base, rotation)

    def _find(self, grip_site: str, fingers: list[str]) -> None:
        """Look up the parts of the model, by their names in it."""
        model, _ = self.model_and_data
        # one contact between a round handle and a taxel, as between a ball and it: four times as fast as several, and
        # the same totals. Between boxes MuJoCo makes four either way. Before it became a default there was no such bit
        several = int(getattr(mujoco.mjtDisableBit, "mjDSBL_MULTICCD", 0))
        # the trees of the bodies' geoms find the same contacts as testing all pairs, and here that is faster
        trees = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
        model.opt.disableflags |= several | trees
        self._peg = model.body("peg").id
        joint = model.joint("peg")
        first, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        self._peg_qpos, self._peg_dofs = slice(first, first + 7), slice(dof, dof + 6)
        self._grip = model.site(grip_site).id
        self._finger_joints = np.array([model.joint(name).id for name in fingers])
        self._fingers = model.jnt_qposadr[self._finger_joints]

    def _find_fingertips(self, faces: NDArray[np.floating], thickness: float = 0.0) -> None:
        """Where the fingers touch: the vector from the grip site to there, and their joints when they meet.

        Args:
            faces: ``(2, 3)`` positions (m, world) of the fingers' faces while they are `HALF_OPEN`.
            thickness: Of what there is between these positions and the surfaces, both together (m).
        """
        _, data = self.model_and_data
        self._finger_directions = np.sign(data.xaxis[self._finger_joints, 1])
        position, rotation = self.fingertip
        apart = float(np.linalg.norm(faces[0] - faces[1])) - thickness
        self._closed = HALF_OPEN - apart / 2
        height = float((faces.mean(axis=0) - position) @ rotation[:, 2])
        self._tip_to_grip = self.nominal @ [0.0, 0.0, height]

    def _set_grip(self, actuators: Any) -> None:
        """Let the fingers, which are springs drawn to where they meet, hold the handle with the force that is asked."""
        model, _ = self.model_and_data
        self._grippers = np.asarray(actuators)
        force = self.parameters.grip_force
        stiffness = force / (self._closed + self.parameters.handle_size / 2)
        model.actuator_gainprm[actuators, 0] = stiffness
        model.actuator_biasprm[actuators, 1] = -stiffness
        model.actuator_forcerange[actuators] = [-2 * force, 2 * force]


def add_objects(world: ET.Element, assets: ET.Element, task: Task, parameters: Parameters) -> None:
    """Add the base and the peg, a free body, to an MJCF."""
    touched = contact_attributes(parameters)
    at = np.array([0.0, 0.0, TABLE_HEIGHT + parameters.floor])
    base = ET.SubElement(world, "body", {"name": "base", "pos": text(at)})
    geoms, meshes = to_mjcf(base_pieces(task, parameters), "base", _BASE_COLOUR, **touched)
    base.extend(geoms)
    above = at + [0, 0, parameters.hole_depth + 0.1]
    peg = ET.SubElement(world, "body", {"name": "peg", "pos": text(above)})
    ET.SubElement(peg, "freejoint", {"name": "peg"})
    density = str(parameters.density)
    geoms, more = to_mjcf(peg_pieces(task, parameters), "peg", _PEG_COLOUR, density=density, **touched)
    peg.extend(geoms)
    assets.extend(meshes + more)


def text(values: Any) -> str:
    """Numbers as MJCF wants them."""
    return " ".join(f"{value:.9g}" for value in np.asarray(values, dtype=float))
