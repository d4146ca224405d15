"""Pegs and bases of the tasks as convex pieces, made with trimesh and written as MJCF.

Boxes and cylinders are trimesh primitives, which MuJoCo collides exactly; all other pieces are convex meshes.
The frame of a peg lies in the middle of its bottom, z up; the frame of a base lies in the middle of the hole's bottom.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from .tasks import Parameters, Task

SEGMENTS = 24
"""Pieces around a round hole; their polygon circumscribes the circle, so no peg of the stated size is blocked."""

TABLE_HEIGHT = 0.8
TABLE_SIZE = (0.8, 0.8, 0.05)

_PEG_COLOUR, _BASE_COLOUR = "0.85 0.45 0.2 1", "0.3 0.45 0.65 1"

Pieces = list[trimesh.Trimesh]


def peg_pieces(task: Task, parameters: Parameters) -> Pieces:
    """Return the shaft and the handle of a peg, in the peg's frame."""
    return [
        _prism(task.peg == "round", parameters.peg_size, 0.0, parameters.peg_length),
        _prism(
            task.handle == "cylinder",
            parameters.handle_size,
            parameters.peg_length,
            parameters.peg_length + parameters.handle_height,
        ),
    ]


def base_pieces(task: Task, parameters: Parameters) -> Pieces:
    """Return the floor and walls of a base, in its frame. The hole is as wide as the peg plus the clearance."""
    width = parameters.peg_size + task.clearance
    half, depth = parameters.base_size / 2, parameters.hole_depth
    pieces: Pieces = [_box((-half, -half, -parameters.floor), (half, half, 0.0))]
    if task.hole == "round":
        return pieces + _ring(width / 2, half, depth)
    inner = width / 2
    if task.hole != "groove along y":
        pieces += [_box((-half, inner, 0.0), (half, half, depth)), _box((-half, -half, 0.0), (half, -inner, depth))]
    if task.hole != "groove along x":
        side = half if task.hole == "groove along y" else inner
        pieces += [_box((inner, -side, 0.0), (half, side, depth)), _box((-half, -side, 0.0), (-inner, side, depth))]
    return pieces


def keypoints(parameters: Parameters) -> NDArray[np.floating]:
    """Return the ``(8, 3)`` corners of the peg's bounding box (m): peg frame, or base frame when inserted."""
    half, top = parameters.peg_size / 2, parameters.peg_length
    return np.array([(x, y, z) for x in (-half, half) for y in (-half, half) for z in (0.0, top)])


def contact_attributes(parameters: Parameters) -> dict[str, str]:
    """Return geom attributes of printed plastic: a push of 20 N sinks in by less than a tenth of a millimetre."""
    return {"friction": f"{parameters.friction} 0.005 0.0001", "solref": "0.006 1", "solimp": "0.99 0.995 0.0005"}


def add_objects(world: ET.Element, assets: ET.Element, task: Task, parameters: Parameters) -> None:
    """Add the base and the peg, which is a free body, to an MJCF model."""
    touched = contact_attributes(parameters)
    at = np.array([0.0, 0.0, TABLE_HEIGHT + parameters.floor])
    base = ET.SubElement(world, "body", {"name": "base", "pos": numbers(at)})
    geoms, meshes = to_mjcf(base_pieces(task, parameters), "base", _BASE_COLOUR, **touched)
    base.extend(geoms)
    above = at + [0, 0, parameters.hole_depth + 0.1]
    peg = ET.SubElement(world, "body", {"name": "peg", "pos": numbers(above)})
    ET.SubElement(peg, "freejoint", {"name": "peg"})
    density = str(parameters.density)
    geoms, more = to_mjcf(peg_pieces(task, parameters), "peg", _PEG_COLOUR, density=density, **touched)
    peg.extend(geoms)
    assets.extend(meshes + more)


def to_mjcf(pieces: Pieces, name: str, rgba: str, **attributes: str) -> tuple[list[ET.Element], list[ET.Element]]:
    """Convert pieces to MJCF.

    Args:
        pieces: Convex pieces in the frame of the body they belong to.
        name: Prefix of the names of geoms and meshes.
        rgba: Colour of the geoms.
        **attributes: Further attributes of the geoms.

    Returns:
        Geoms for the body and meshes for the assets.
    """
    geoms, meshes = [], []
    for index, piece in enumerate(pieces):
        label = f"{name}_{index}"
        shape = {"name": label, "group": "1", "rgba": rgba, **attributes}
        if isinstance(piece, (trimesh.primitives.Box, trimesh.primitives.Cylinder)):
            shape["pos"] = numbers(np.asarray(piece.primitive.transform)[:3, 3])
        if isinstance(piece, trimesh.primitives.Box):
            shape |= {"type": "box", "size": numbers(np.asarray(piece.primitive.extents) / 2)}
        elif isinstance(piece, trimesh.primitives.Cylinder):
            size = np.array([piece.primitive.radius, piece.primitive.height], dtype=float) / [1, 2]
            shape |= {"type": "cylinder", "size": numbers(size)}
        else:
            # MuJoCo centres a mesh on its centre of mass and shifts the geom accordingly, so it needs no pos
            shape |= {"type": "mesh", "mesh": label}
            meshes.append(ET.Element("mesh", {"name": label, "vertex": numbers(piece.vertices.reshape(-1))}))
        geoms.append(ET.Element("geom", shape))
    return geoms, meshes


def _prism(is_round: bool, size: float, low: float, high: float) -> trimesh.Trimesh:
    half = size / 2
    if not is_round:
        return _box((-half, -half, low), (half, half, high))
    middle = trimesh.transformations.translation_matrix((0, 0, (low + high) / 2))
    return trimesh.primitives.Cylinder(radius=half, height=high - low, transform=middle)


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.primitives.Box(bounds=np.array([low, high]))


def _ring(radius: float, half: float, depth: float) -> Pieces:
    """Return the wedges between a round hole and the square around it."""
    angles = np.linspace(0, 2 * np.pi, SEGMENTS + 1)
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    inner = around * radius / np.cos(np.pi / SEGMENTS)
    outer = around * (half / np.abs(around).max(axis=1))[:, None]
    pieces: Pieces = []
    for first in range(SEGMENTS):
        corners = np.vstack([inner[first : first + 2], outer[first : first + 2]])
        both = [np.column_stack([corners, np.full(4, z)]) for z in (0.0, depth)]
        pieces.append(trimesh.convex.convex_hull(np.vstack(both)))
    return pieces


def numbers(values: Any) -> str:
    """Format numbers for MJCF."""
    return " ".join(f"{value:.9g}" for value in np.asarray(values, dtype=float))
