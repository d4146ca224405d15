"""The grippers that robosuite ships: their mounts are known, and found; nothing but the pads carries the load."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scenes import axes_of

from paxisim import InvalidValueError, MissingExtraError, UnknownNameError, find_mounts, mounts_for
from paxisim.models.faces import shadowing
from paxisim.models.find_mounts import choose_mounts
from paxisim.models.grippers import known_gripper, known_grippers, mounts_for_file, robosuite_gripper_path
from paxisim.models.links import Links
from paxisim.models.load import load_spec
from paxisim.models.surfaces import surface_of

# two of robosuite's files are repaired when read
pytestmark = pytest.mark.filterwarnings("ignore:.*is not sound MJCF")
# parallel, four-bar, three fingers, five fingers, and a tool
OF_EACH_KIND = ("panda", "robotiq_85", "robotiq_s", "inspire_right", "wiping")


def each_of(*names):
    """Parametrise over these grippers; only one of each kind is tried by default."""
    return pytest.mark.parametrize(
        "name", [pytest.param(name, marks=[] if name in OF_EACH_KIND else pytest.mark.slow) for name in names]
    )


def gripper_table():
    """Import and return the benchmark module, which holds the scenes."""
    if "gripper_table" not in sys.modules:
        path = Path(__file__).parents[2] / "benchmarks" / "gripper_table.py"
        spec = importlib.util.spec_from_file_location("gripper_table", path)
        sys.modules["gripper_table"] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules["gripper_table"])
    return sys.modules["gripper_table"]


def test_every_gripper_that_robosuite_ships_is_known_by_its_name_and_that_of_its_file(monkeypatch):
    assert len(known_grippers()) == 13
    assert [len(mounts_for(name)) for name in ("panda", "robotiq_s", "inspire_left", "wiping")] == [2, 3, 5, 1]
    with pytest.raises(UnknownNameError, match="did you mean 'panda'"):
        mounts_for("pnada")
    assert mounts_for_file("anywhere/panda_gripper.xml") == mounts_for("panda")
    assert mounts_for_file(Path("robotiq_gripper_85.xml")) == mounts_for("robotiq_85")
    assert mounts_for_file("my_gripper.xml") is None
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"paxisim\[robosuite\]"):
        robosuite_gripper_path("panda")


@pytest.mark.robosuite
def test_files_are_there_and_robosuite_is_not_imported():
    imported = "robosuite" in sys.modules
    assert all(robosuite_gripper_path(name).is_file() for name in known_grippers())
    assert ("robosuite" in sys.modules) == imported


@pytest.mark.robosuite
@each_of(*known_grippers())
def test_nothing_in_front_of_the_pads_is_left_on(name):
    gripper = known_gripper(name)
    model = load_spec(robosuite_gripper_path(name)).compile()
    links = Links(model)
    for mount in gripper.mounts:
        body = model.body(mount.body).id
        first = int(model.body_geomadr[body])
        off = {model.geom(g).id if isinstance(g, str) else first + g for g in mount.replaces}
        assert all(model.geom_contype[g] | model.geom_conaffinity[g] for g in off)
        link = int(links.of_body[body])
        surface = surface_of(model, links.data, links.geoms[link], body)
        size = (gripper.face_mm[0] * 1e-3, gripper.face_mm[1] * 1e-3)
        assert set(shadowing(surface, np.array(mount.pos), axes_of(mount.quat), size)) <= off


@pytest.mark.robosuite
@each_of("panda", "rethink", "robotiq_85", "robotiq_140", "xarm7")
def test_opposing_pads_face_each_other_and_agree_on_their_rows(name):
    model = load_spec(robosuite_gripper_path(name)).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frames, centres = [], []
    for mount in mounts_for(name):
        body = data.body(mount.body)
        frames.append(body.xmat.reshape(3, 3) @ axes_of(mount.quat))
        centres.append(body.xpos + body.xmat.reshape(3, 3) @ mount.pos)
    left, right = frames
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=2e-3)
    np.testing.assert_allclose(left[:, 2], -right[:, 2], atol=2e-3)
    apart = centres[1] - centres[0]
    if np.linalg.norm(apart) > 5e-3:
        assert -left[:, 2] @ apart > 0.99 * np.linalg.norm(apart)


@pytest.mark.robosuite
@each_of("panda", "rethink", "robotiq_85", "robotiq_140", "robotiq_s", "xarm7")
def test_find_mounts_finds_the_known_ones(name):
    found = find_mounts(robosuite_gripper_path(name))
    known = mounts_for(name)
    assert {m.body for m in found.mounts} == {m.body for m in known}
    for mount in known:
        other = next(m for m in found.mounts if m.body == mount.body)
        distance, angle = gripper_table().difference(mount, other)
        assert distance < 3e-3
        assert angle < np.radians(10)
        assert set(mount.replaces) == set(other.replaces)
    if name == "robotiq_s":
        assert "finger_scissor: held still at 0: only spreads fingers" in found.report


@pytest.mark.robosuite
@pytest.mark.slow
def test_find_mounts_on_a_hand():
    found = find_mounts(robosuite_gripper_path("inspire_right"))
    assert {m.body for m in found.mounts} == {m.body for m in mounts_for("inspire_right")}
    assert found.faces[0].mount.body == "r_thumb_distal"
    assert len(found.faces[0].opposite) == 4
    assert all(face.off_course < np.radians(40) for face in found.faces)


@pytest.mark.robosuite
def test_choose_mounts_takes_the_known_ones_also_of_a_tool_that_cannot_close():
    for name in ("panda", "wiping"):
        path = robosuite_gripper_path(name)
        mounts, report, _ = choose_mounts(load_spec(path), path.name)
        assert mounts == mounts_for(name) == choose_mounts(load_spec(path), str(path))[0]
        assert f"{path.name} is known" in report
    with pytest.raises(InvalidValueError, match="no actuators"):
        find_mounts(robosuite_gripper_path("wiping"))


@pytest.mark.robosuite
@each_of(*known_grippers())
@pytest.mark.filterwarnings("ignore:the touch sensor .* on 'wiping_gripper'")
def test_taxels_carry_what_the_object_needs(name):
    balance = gripper_table().hold(name)
    assert balance.others == 0
    assert balance.speed < 5e-3
    assert np.all(balance.pressed > 0.1)
    assert balance.error < 0.01
