"""Pads: handle of the pads of a compiled model, with ids in taxel order, and in-place changes of their surface."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models import names
from paxisim.models.surface import check_heights


@dataclass(frozen=True, eq=False)
class Pads:
    """The pads of one compiled model, in the order of a reading's ``pads`` axis.

    Attributes:
        names: ``(pads,)`` names, including any prefix.
        layouts: ``(pads,)`` layouts; all have the same numbers of rows and columns.
        thickness: ``(pads,)`` nominal thickness of the taxel cubes (m).
        bodies: ``(pads,)`` ids of the bodies whose frames are the pad frames.
        geoms: ``(pads, N)`` ids of the taxel geoms, row-major.

    Raises:
        InvalidValueError: The pads differ in rows or columns, so one tensor cannot hold them.
    """

    names: tuple[str, ...]
    layouts: tuple[TaxelLayout, ...]
    thickness: tuple[float, ...]
    bodies: NDArray[np.int64]
    geoms: NDArray[np.int64]

    def __post_init__(self) -> None:
        """Check that one tensor can hold the pads."""
        shapes = {(layout.rows, layout.cols) for layout in self.layouts}
        if len(shapes) > 1:
            found = ", ".join(f"{n} {a.rows}x{a.cols}" for n, a in zip(self.names, self.layouts, strict=True))
            raise InvalidValueError(f"pads of different shapes do not fit one tensor ({found}): name those wanted")

    @property
    def layout(self) -> TaxelLayout:
        """Layout of the first pad, which all pads share unless they conform to different surfaces."""
        return self.layouts[0]

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Shape of a reading, ``(pads, 3, rows, cols)``."""
        return (len(self.names), *self.layout.shape)

    def __repr__(self) -> str:
        """One line with the shape and the names."""
        return f"Pads({names.described_pads(self.names, self.layout.rows, self.layout.cols)})"

    def __len__(self) -> int:
        """Number of pads."""
        return len(self.names)


def check_pads(model: mujoco.MjModel, pads: Pads) -> None:
    """Check that the pads belong to this model; otherwise their ids would refer to other geoms.

    Raises:
        InvalidValueError: The pads do not belong to the model, or an argument has the wrong type.
    """
    if not isinstance(model, mujoco.MjModel):
        raise InvalidValueError(f"expected a compiled mujoco.MjModel, got {type(model).__name__}")
    if not isinstance(pads, Pads):
        raise InvalidValueError(f"expected the pads that find_pads or bind give, got {type(pads).__name__}")
    for name, geoms in zip(pads.names, pads.geoms, strict=True):
        ends = {int(geoms[0]): (0, 0), int(geoms[-1]): (pads.layout.rows - 1, pads.layout.cols - 1)}
        if any(geom >= model.ngeom or model.geom(geom).name != names.taxel(name, *ends[geom]) for geom in ends):
            raise InvalidValueError(f"the pad {name!r} is not one of this model: paxisim.find_pads(model) gives those")


def meets_pads(model: mujoco.MjModel, pads: Pads) -> NDArray[np.bool_]:
    """Tell which geoms and flexes each pad can touch according to their contact bits.

    Returns:
        ``(pads, ngeom + nflex)``; explicit pairs, exclusions and welds do not count.
    """
    contype = np.concatenate([model.geom_contype, model.flex_contype])
    conaffinity = np.concatenate([model.geom_conaffinity, model.flex_conaffinity])
    own_contype = np.bitwise_or.reduce(contype[pads.geoms], axis=1)[:, None]
    own_conaffinity = np.bitwise_or.reduce(conaffinity[pads.geoms], axis=1)[:, None]
    return (contype & own_conaffinity | conaffinity & own_contype) != 0


def highest_priority_met(model: mujoco.MjModel, pads: Pads) -> int:
    """Return the highest contact priority of the geoms and flexes that the pads can touch; at least 0."""
    priority = np.concatenate([model.geom_priority, model.flex_priority])
    priority[pads.geoms] = 0
    if not priority.any():
        return 0
    return int(priority[meets_pads(model, pads).any(axis=0)].max(initial=0))


def find_pads(model: mujoco.MjModel, *, prefix: str = "", names: tuple[str, ...] | list[str] | None = None) -> Pads:
    """Find the pads of a compiled model, including a model that was saved and loaded again.

    Args:
        model: The compiled model.
        prefix: Find only pads whose names begin with this prefix, as from ``MjSpec.attach(..., prefix=...)``.
        names: Find only these pads, in this order; names include the prefix. Default: all, in the order of their
            bodies.

    Returns:
        Handle of the pads.

    Raises:
        InvalidValueError: There are no such pads, a pad lacks taxels or its body, or the pads differ in shape.
    """
    found = _taxels_by_pad(model)
    selected = sorted((n for n in found if n.startswith(prefix)), key=lambda n: _body_of(model, found[n]))
    if isinstance(names, str):
        raise InvalidValueError(f"names must be a sequence of pads' names, got {names!r}")
    if names is not None:
        missing = [n for n in names if n not in selected]
        if missing:
            raise InvalidValueError(f"no pad {missing[0]!r} in the model; its pads: {', '.join(selected) or 'none'}")
        selected = list(names)
    if not selected:
        begins = f" whose name begins with {prefix!r}" if prefix else ""
        raise InvalidValueError(f"the model has no pads{begins}; make one with paxisim.attach or `paxisim attach`")
    parts = [_describe(model, name, found[name]) for name in selected]
    return Pads(
        names=tuple(selected),
        layouts=tuple(layout for layout, _, _ in parts),
        thickness=tuple(thickness for _, thickness, _ in parts),
        bodies=np.array([_body_of(model, found[name]) for name in selected]),
        geoms=_stack([geoms for _, _, geoms in parts], selected, [layout for layout, _, _ in parts]),
    )


def _stack(geoms: list[NDArray[np.int64]], names: list[str], layouts: list[TaxelLayout]) -> NDArray[np.int64]:
    # numpy's error would not name rows and columns
    if len({len(g) for g in geoms}) > 1:
        found = ", ".join(f"{n} {a.rows}x{a.cols}" for n, a in zip(names, layouts, strict=True))
        raise InvalidValueError(f"pads of different shapes do not fit one tensor ({found}): name those wanted")
    return np.stack(geoms)


def _taxels_by_pad(model: mujoco.MjModel) -> dict[str, dict[tuple[int, int], int]]:
    found: dict[str, dict[tuple[int, int], int]] = defaultdict(dict)
    for geom in range(model.ngeom):
        match = names.TAXEL.match(model.geom(geom).name)
        if match:
            found[match["pad"]][int(match["row"]), int(match["col"])] = geom
    return {pad: taxels for pad, taxels in found.items() if _site(model, pad) >= 0}


def _site(model: mujoco.MjModel, pad: str) -> int:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, names.gel(pad))


def _body_of(model: mujoco.MjModel, taxels: dict[tuple[int, int], int]) -> int:
    return int(model.geom_bodyid[next(iter(taxels.values()))])


def _describe(
    model: mujoco.MjModel, name: str, taxels: dict[tuple[int, int], int]
) -> tuple[TaxelLayout, float, NDArray[np.int64]]:
    if model.body(_body_of(model, taxels)).name != name:
        raise InvalidValueError(f"the body of pad {name!r} was merged with its parent: compile without fusestatic")
    rows, cols = (1 + max(cell[axis] for cell in taxels) for axis in (0, 1))
    cells = [(row, col) for row in range(rows) for col in range(cols)]
    missing = [cell for cell in cells if cell not in taxels]
    if missing:
        raise InvalidValueError(
            f"pad {name!r} has no taxel at row {missing[0][0]}, column {missing[0][1]} of {rows}x{cols}"
        )
    geoms = np.array([taxels[cell] for cell in cells])
    site = model.site_size[_site(model, name)]
    thickness = 2 * float(site[2])
    inward = inward_axes(model, geoms)
    backs = model.geom_pos[geoms] + inward * half_thickness(model, geoms)[:, None]
    positions = backs - inward * thickness
    width, height = 2 * site[:2] - np.ptp(positions[:, :2], axis=0)
    # MuJoCo writes six digits: snap to the original grid
    pitch = (round(float(height), 9), round(float(width), 9))
    grid = TaxelLayout(rows, cols, pitch, vendor_order=_vendor_order(model, geoms))
    if np.allclose(positions, grid.positions, atol=1e-6) and np.allclose(-inward, grid.normals, atol=1e-4):
        return grid, thickness, geoms
    return TaxelLayout(rows, cols, pitch, positions, -inward, grid.vendor_order), thickness, geoms


def _vendor_order(model: mujoco.MjModel, geoms: NDArray[np.int64]) -> tuple[int, ...] | None:
    """Return the vendor's order of the taxels, which `Pad` stores as a number from 1 with each geom."""
    if not model.nuser_geom or sorted(model.geom_user[geoms, 0]) != list(range(1, len(geoms) + 1)):
        return None
    return tuple(np.argsort(model.geom_user[geoms, 0]).tolist())


def half_thickness(model: mujoco.MjModel, geoms: NDArray[np.int64]) -> NDArray[np.floating]:
    """Return half the thickness of taxels (m), ``(N,)``; taxels are boxes or spheres."""
    return model.geom_size[geoms, np.where(are_spheres(model, geoms), 0, 2)]


def are_spheres(model: mujoco.MjModel, geoms: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which taxels are spheres, ``(N,)``; the others are boxes."""
    return model.geom_type[geoms] == int(mujoco.mjtGeom.mjGEOM_SPHERE)


def inward_axes(model: mujoco.MjModel, geoms: NDArray[np.int64]) -> NDArray[np.floating]:
    """Return the directions from the surface into the pad at taxels, ``(N, 3)``, in the pad frame."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(model.geom_quat[geoms][:, [1, 2, 3, 0]]).as_matrix()[:, :, 2]


def set_surface(model: mujoco.MjModel, pads: Pads, heights: NDArray[np.floating]) -> None:
    """Give the taxels new heights without recompiling; contacts and forces equal those of a fresh compile.

    MuJoCo's collision detection prunes with bounding boxes computed at compile time, of each geom (``geom_aabb``,
    ``geom_rbound``) and of each body's tree (``bvh_aabb``). This function updates them. Otherwise, a taxel raised above
    its compiled height would silently lose its contacts.

    Args:
        model: The compiled model; changed in place.
        pads: Pads of the model.
        heights: Thickness of the cubes (m), ``(pads, rows, cols)``, or ``(rows, cols)`` for all pads.

    Raises:
        InvalidValueError: The heights have the wrong shape or are not positive and finite, or the pads belong to
            another model.
    """
    check_pads(model, pads)
    heights = check_heights(heights, pads.layout)
    pads_shape = (len(pads), pads.layout.rows, pads.layout.cols)
    if heights.ndim > 2 and heights.shape != pads_shape:
        raise InvalidValueError(f"heights must have shape {pads_shape} or {pads_shape[1:]}, got {heights.shape}")
    half = np.broadcast_to(heights, pads_shape).reshape(len(pads), -1) / 2
    geoms = pads.geoms.reshape(-1)
    half = half.reshape(-1)
    model.geom_pos[geoms] += inward_axes(model, geoms) * (half_thickness(model, geoms) - half)[:, None]
    spheres = are_spheres(model, geoms)
    model.geom_size[geoms, np.where(spheres, 0, 2)] = half
    model.geom_aabb[geoms, 3:] = np.where(spheres[:, None], half[:, None], model.geom_size[geoms])
    model.geom_rbound[geoms] = np.where(spheres, half, np.linalg.norm(model.geom_size[geoms], axis=1))
    for body in pads.bodies:
        _refit_tree(model, int(body))


def _refit_tree(model: mujoco.MjModel, body: int) -> None:
    """Recompute the bounding boxes of a body's tree, which are in the frame of its inertia."""
    start, count = int(model.body_bvhadr[body]), int(model.body_bvhnum[body])
    if count == 0:
        return
    nodes = slice(start, start + count)
    geoms, depth, children = model.bvh_nodeid[nodes], model.bvh_depth[nodes], model.bvh_child[nodes]
    leaves = geoms >= 0
    rotation = _matrices(model.body_iquat[body])
    geom_rotation = rotation.T @ _matrices(model.geom_quat[geoms[leaves]])
    boxes = model.geom_aabb[geoms[leaves]]
    offset = model.geom_pos[geoms[leaves]] - model.body_ipos[body]
    centre = offset @ rotation + np.einsum("nij,nj->ni", geom_rotation, boxes[:, :3])
    extent = np.einsum("nij,nj->ni", np.abs(geom_rotation), boxes[:, 3:])
    low, high = np.empty((count, 3)), np.empty((count, 3))
    low[leaves], high[leaves] = centre - extent, centre + extent
    for level in range(int(depth.max()) - 1, -1, -1):
        parents = np.flatnonzero((depth == level) & ~leaves)
        first, second = children[parents].T
        low[parents] = np.minimum(low[first], low[second])
        high[parents] = np.maximum(high[first], high[second])
    model.bvh_aabb[nodes] = np.hstack([(low + high) / 2, (high - low) / 2])


def _matrices(quat: NDArray[np.floating]) -> NDArray[np.floating]:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(quat, -1, axis=-1)).as_matrix()
