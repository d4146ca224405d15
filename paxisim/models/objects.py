"""Objects: where a box or a cylinder of a given thickness fits between the pads of a gripper, or in front of one pad.

The pads of a `Grip` that close against one another hold the object together. Where it would not lie in front of all of
them, as with a hand whose fingertips meet only in turn, each pad is pressed by its own finger on a fixed plate.

Lengths in m, world frame. "Outward" is the direction from a pad's surface to the object.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.grip import Grip
from paxisim.models.pads import Pads, half_thickness

CLEARANCE = 0.2e-3
"""Distance between the object and each pad at the start."""
SIZES = (0.8, 1.5)
"""Extents of the object across the closing direction, as factors of the pad's; most real objects are larger than it."""

_PLATE = 10e-3  # thickness of the plate on which a single pad is pressed
_THINNEST = 1e-3
_COS_PARALLEL = np.cos(np.radians(10))  # pads closer to parallel hold a box, others a cylinder


@dataclass(frozen=True, eq=False)
class Placed:
    """An object in front of pads.

    Attributes:
        pads: Indices of the pads on the ``pads`` axis.
        opening: Thickness as a share of the way from closed to open; of a plate, where on that way the pad meets it.
        shape: ``"box"``, ``"cylinder"`` or ``"plate"``, a fixed box.
        size: Half extents; of a cylinder its radius and half its length.
        pos: ``(3,)`` centre.
        axes: ``(3, 3)`` axes as columns; the last is the closing direction of a box, or the axis of a cylinder.
        frame: Frame of the closing at which the pads are about to touch it.
    """

    pads: tuple[int, ...]
    opening: float
    shape: str
    size: tuple[float, ...]
    pos: NDArray[np.float64]
    axes: NDArray[np.float64]
    frame: int

    @property
    def yields(self) -> NDArray[np.bool_]:
        """``(3,)`` True for the axes along which the pads press: one, or two of a cylinder between three or more."""
        if self.shape == "cylinder":
            return np.array([len(self.pads) > 2, True, False])
        return np.array([False, False, True])

    @property
    def title(self) -> str:
        """Shape and full size in mm, such as ``"box 16 x 12.8 x 9.6"``; the thickness comes first."""
        length = [2e3 * half for half in self.size]
        return f"{self.shape} {' x '.join(f'{n:.3g}' for n in (length if self.shape == 'cylinder' else length[::-1]))}"


def place_objects(
    model: mujoco.MjModel, pads: Pads, grip: Grip, qpos: NDArray[np.float64], openings: Sequence[float]
) -> tuple[Placed, ...]:
    """Return the objects for all pads of a grip: groups of pads that hold one together first.

    Args:
        model: Compiled model of the robot.
        pads: Its pads.
        grip: Closing of one of its end effectors.
        qpos: ``(frames, nq)`` poses from open to closed, close to one another.
        openings: Thicknesses of the objects, as shares of the way from closed to open.
    """
    faces = _Faces(model, pads, qpos)
    found: list[Placed] = []
    for group in _groups(grip):
        if len(group) > 1:
            found += [placed for share in openings for placed in faces.between(group, share)]
    held = {pad for placed in found for pad in placed.pads}
    alone = [pad for pad in grip.pads if pad not in held]
    return (*found, *(placed for pad in alone for share in openings for placed in faces.before(pad, share)))


def _groups(grip: Grip) -> list[tuple[int, ...]]:
    """Return the sets of pads that close against one another, directly or through others."""
    groups: list[set[int]] = []
    for pad, others in zip(grip.pads, grip.partners, strict=True):
        joined = {pad, *others}
        for group in [g for g in groups if g & joined]:
            groups.remove(group)
            joined |= group
        groups.append(joined)
    return [tuple(sorted(group)) for group in groups]


class _Faces:
    """Faces of the pads along a closing.

    Attributes:
        middle: ``(frames, pads, 3)`` middle of each pad, in the plane of its outermost taxels.
        axes: ``(frames, pads, 3, 3)`` axes of the pad frames as columns.
    """

    def __init__(self, model: mujoco.MjModel, pads: Pads, qpos: NDArray[np.float64]) -> None:
        self.layouts = pads.layouts
        data = mujoco.MjData(model)
        self.middle, self.axes = np.zeros((len(qpos), len(pads), 3)), np.zeros((len(qpos), len(pads), 3, 3))
        half = half_thickness(model, pads.geoms)[..., None]
        for frame, pose in enumerate(qpos):
            data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            axes = data.xmat[pads.bodies].reshape(-1, 3, 3)
            origin = data.xpos[pads.bodies]
            inward = data.geom_xmat[pads.geoms].reshape(*pads.geoms.shape, 3, 3)[..., 2]
            local = (data.geom_xpos[pads.geoms] - inward * half - origin[:, None]) @ axes
            middle = np.concatenate([local[..., :2].mean(axis=1), local[..., 2].min(axis=1)[:, None]], axis=1)
            self.middle[frame] = origin + np.einsum("pij,pj->pi", axes, middle)
            self.axes[frame] = axes

    def between(self, group: tuple[int, ...], opening: float) -> list[Placed]:
        """Return the objects that the pads of a group hold; none if these would not lie in front of all of them."""
        index = list(group)
        middle, outward = self.middle[:, index], -self.axes[:, index][..., 2]
        centre, radius = _inscribed(middle, outward)
        beside = np.linalg.norm(middle + radius[:, None, None] * outward - centre[:, None], axis=2).max(axis=1)
        fits = (beside <= max(max(self.layouts[pad].size) for pad in group) / 2) & (radius > 0)
        if not fits.any():
            return []
        width = np.where(fits, 2 * radius, -np.inf)
        widest = int(width.argmax())
        after = width[widest:][fits[widest:]]
        gap = float(after.min() + opening * (after.max() - after.min()))
        frame = widest + int(np.argmax(2 * radius[widest:] <= gap))
        thickness = 2 * (float(radius[frame]) - CLEARANCE)
        if thickness < _THINNEST or not fits[frame]:
            return []
        axes, outward = self.axes[frame, index], outward[frame]
        directions = np.linalg.svd(outward)[2]
        is_box = bool(np.all(np.abs(outward @ directions[0]) > _COS_PARALLEL))
        main = directions[0] if is_box else directions[2]
        placed_axes = _frame(main, axes[0, :, 1] if is_box else outward[0])
        # a box needs both extents across the closing direction, a cylinder that along its axis
        across = [placed_axes[:, 0], placed_axes[:, 1]] if is_box else [main]
        found = []
        for factor in SIZES:
            lengths = [self._lengths(group, axes, direction) for direction in across]
            half = [factor * (min(some) if factor < 1 else max(some)) / 2 for some in lengths]
            size = (*half, thickness / 2) if is_box else (thickness / 2, *half)
            shape = "box" if is_box else "cylinder"
            found.append(Placed(group, opening, shape, size, centre[frame], placed_axes, frame))
        return found

    def before(self, pad: int, opening: float) -> list[Placed]:
        """Return the plates on which one pad is pressed."""
        path = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.middle[:, pad], axis=0), axis=1)))
        frame = int(np.argmax(path >= (1 - opening) * path[-1]))
        axes = self.axes[frame, pad]
        pos = self.middle[frame, pad] - (CLEARANCE + _PLATE / 2) * axes[:, 2]
        height, width = self.layouts[pad].size
        sizes = [(factor * width / 2, factor * height / 2, _PLATE / 2) for factor in SIZES]
        return [Placed((pad,), opening, "plate", size, pos, axes, frame) for size in sizes]

    def _lengths(
        self, group: tuple[int, ...], axes: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> list[float]:
        """Return the length of each pad of a group along a direction."""
        sizes = [self.layouts[pad].size[::-1] for pad in group]
        return [float(np.abs(direction @ frame[:, :2]) @ size) for frame, size in zip(axes, sizes, strict=True)]


def _inscribed(
    middle: NDArray[np.float64], outward: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centres, ``(frames, 3)``, and radii of the spheres that best touch all faces at their middles.

    Least squares of ``middle + radius * outward - centre``. Of two parallel faces, the radius is half their distance.

    Args:
        middle: ``(frames, faces, 3)`` points.
        outward: ``(frames, faces, 3)`` unit normals.
    """
    mean, around = middle.mean(axis=1), outward.mean(axis=1)
    spread = outward - around[:, None]
    radius = -np.sum(middle * spread, axis=(1, 2)) / np.maximum(np.sum(spread**2, axis=(1, 2)), 1e-9)
    return mean + radius[:, None] * around, radius


def _frame(main: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return orthogonal axes as columns: z is `main`, and y is near `second`."""
    y = second - (second @ main) * main
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, main), y, main], axis=1)
