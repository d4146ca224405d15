"""Pegs and holes: a peg with the stated clearance fits, and a larger one does not."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from paxisim_insertion import TASKS, Parameters
from paxisim_insertion.engines.scene import Grasp
from paxisim_insertion.geometry import base_pieces, contact_attributes, keypoints, peg_pieces, to_mjcf

import paxisim

PARAMETERS = Parameters()


def pushed(task, peg_size, offset=(0.0, 0.0)):
    """Height (m) of the bottom of a peg above that of the hole after pressing it down from above with 2 kg."""
    root = ET.Element("mujoco")
    ET.SubElement(root, "option", timestep="0.002", cone="elliptic", impratio="20")
    assets, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    touched = contact_attributes(PARAMETERS)
    geoms, meshes = to_mjcf(base_pieces(task, PARAMETERS), "base", "1 1 1 1", **touched)
    world.extend(geoms)
    assets.extend(meshes)
    start = (*offset, PARAMETERS.hole_depth + 1e-4)
    peg = ET.SubElement(world, "body", name="peg", pos=" ".join(map(str, start)))
    ET.SubElement(peg, "inertial", pos="0 0 0", mass="2", diaginertia="1 1 1")
    for axis in ("1 0 0", "0 1 0", "0 0 1"):  # upright, as the gripper holds it
        ET.SubElement(peg, "joint", type="slide", axis=axis)
    pieces = peg_pieces(task, replace(PARAMETERS, peg_size=peg_size))
    geoms, _ = to_mjcf(pieces, "peg", "1 1 1 1", **touched)
    peg.extend(geoms)
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    return data.body("peg").xpos[2]


@pytest.mark.parametrize("name", TASKS)
def test_a_peg_with_the_stated_clearance_goes_in_and_one_without_does_not(name):
    task, size = TASKS[name], PARAMETERS.peg_size
    across = 0.45 * task.clearance * np.array([task.hole != "groove along x", task.hole == "groove along x"])
    assert abs(pushed(task, size)) < 1e-4
    assert abs(pushed(task, size, across)) < 1e-4, "0.45 of the clearance off the middle"
    assert abs(pushed(task, size + task.clearance - 1e-4)) < 1e-4
    # a round hole is a polygon around the circle, up to 1 % wider at the corners
    wider = 0.01 * size if task.hole == "round" else 0
    assert pushed(task, size + task.clearance + wider + 3e-4) > PARAMETERS.hole_depth - 1e-4


@pytest.mark.parametrize("name", TASKS)
def test_pieces_are_convex_closed_and_do_not_overlap(name):
    task = TASKS[name]
    base, peg = base_pieces(task, PARAMETERS), peg_pieces(task, PARAMETERS)
    for piece in [*base, *peg]:
        assert piece.is_watertight
        assert piece.is_convex
    width = PARAMETERS.peg_size + task.clearance
    section = {"round": np.pi * width**2 / 4, "square": width**2}.get(task.hole, width * PARAMETERS.base_size)
    block = PARAMETERS.base_size**2 * (PARAMETERS.floor + PARAMETERS.hole_depth)
    whole = block - section * PARAMETERS.hole_depth
    assert sum(piece.volume for piece in base) == pytest.approx(whole, rel=1e-3)
    corners = np.vstack([piece.vertices for piece in peg[:1]])
    np.testing.assert_allclose(corners.min(axis=0), keypoints(PARAMETERS).min(axis=0), atol=1e-4)
    np.testing.assert_allclose(corners.max(axis=0), keypoints(PARAMETERS).max(axis=0), atol=1e-4)


def test_the_tasks_are_the_papers():
    assert [*TASKS] == ["RY-2mm", "RU-2mm", "SQ-2mm", "SQ-1mm", "SX-2mm", "SY-2mm"]
    assert [task.clearance for task in TASKS.values()] == [2e-3, 2e-3, 2e-3, 1e-3, 2e-3, 2e-3]
    assert [task.action_scale for task in TASKS.values()] == [1e-2, 1e-2, 1e-2, 5e-3, 1e-2, 1e-2]
    assert [task.max_steps for task in TASKS.values()] == [200, 200, 200, 200, 120, 120]
    assert [task.axes for task in TASKS.values()] == [(0, 1, 2)] * 4 + [(1, 2), (0, 2)]


def test_parameters_that_make_no_task():
    for change, told in (
        ({"peg_size": 0.0}, "peg_size must be positive"),
        ({"friction": float("nan")}, "friction must be positive"),
        ({"grasp_offset": (-1e-3, 0.0, 0.0)}, "three non-negative lengths"),
        ({"grasp_offset": (1e-3, 0.0)}, "three non-negative lengths"),
        ({"grasp_lean": -0.1}, "grasp_lean must not be negative"),
        ({"start": ((0.0, 0.0, 0.02), (0.0, 0.0, 0.01))}, "start must be"),
        ({"start": ((0.0, 0.0, -0.01), (0.0, 0.0, 0.01))}, "start must be"),
        ({"peg_length": 0.01}, "shallower"),
        ({"success_depth": 0.02}, "deeper than success_depth"),
    ):
        with pytest.raises(paxisim.InvalidValueError, match=told):
            Parameters(**change)


def test_grasps_are_drawn_within_their_ranges():
    parameters, rng = Parameters(grasp_offset=(1e-3, 0.0, 2e-3), grasp_lean=0.02), np.random.default_rng(0)
    drawn = [Grasp.draw(rng, parameters) for _ in range(300)]
    offsets, leans = np.array([grasp.offset for grasp in drawn]), np.array([grasp.lean for grasp in drawn])
    np.testing.assert_allclose(np.abs(offsets).max(axis=0), [1e-3, 0, 2e-3], rtol=0.05)
    assert 0.019 < np.abs(leans).max() <= 0.02
    assert abs(leans.mean()) < 0.002
