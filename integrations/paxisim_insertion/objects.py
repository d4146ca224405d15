"""The peg and its base on the table, in MJCF."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from .geometry import base_pieces, contact_attributes, numbers, peg_pieces, to_mjcf
from .scene import TABLE_HEIGHT
from .tasks import Parameters, Task

_PEG_COLOUR, _BASE_COLOUR = "0.85 0.45 0.2 1", "0.3 0.45 0.65 1"


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
