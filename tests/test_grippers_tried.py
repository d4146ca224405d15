"""The command behind the table of grippers in the documentation."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import grippers_tried

_JAWS = """
<body name="{name}" pos="0 {side} 0.05">
  <joint name="slide_{name}" type="slide" axis="0 {towards} 0" range="0 0.03" damping="5"/>
  <geom type="box" size="0.01 0.004 0.023"/>
</body>"""
_ACTUATORS = '<actuator><position joint="slide_{}" kp="200" ctrlrange="0 0.03"/></actuator>'


def _gripper(actuated: bool) -> str:
    jaws = _JAWS.format(name="left", side=0.04, towards=-1) + _JAWS.format(name="right", side=-0.04, towards=1)
    actuators = "".join(_ACTUATORS.format(name) for name in ("left", "right")) if actuated else ""
    return (
        f'<mujoco><worldbody><body name="palm"><geom type="box" size="0.03 0.06 0.01"/>{jaws}</body></worldbody>'
        f"{actuators}</mujoco>"
    )


def test_only_models_are_tried_and_not_scenes_around_them(tmp_path):
    (tmp_path / "gripper.xml").write_text(_gripper(True))
    (tmp_path / "scene.xml").write_text('<mujoco><include file="gripper.xml"/><worldbody><light/></worldbody></mujoco>')
    (tmp_path / "table.xml").write_text('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')
    (tmp_path / "part.xml").write_text('<mujocoinclude><geom size="1"/></mujocoinclude>')
    (tmp_path / "broken.xml").write_text("<mujoco>")
    found = grippers_tried.models([*grippers_tried.files_in(tmp_path), tmp_path / "gripper.xml"])
    assert [path.name for path in found] == ["gripper.xml"]


@pytest.mark.parametrize(
    ("options", "actuated", "placed", "pads"),
    [
        ("", False, "refused", 0),
        ('close = ["slide_left", "slide_right"]', False, "`--close slide_left slide_right`", 2),
        pytest.param("", True, "by itself", 2, marks=pytest.mark.slow),
        ('mounts = ["left pos-mm=0,-4,0 quat=0,0,0.7071,0.7071 replaces=0"]', False, "by hand", 1),
    ],
)
def test_a_row_says_how_the_pads_were_placed(tmp_path, monkeypatch, options, actuated, placed, pads):
    table = tmp_path / "options.toml"
    table.write_text(f'["{tmp_path.name}/jaw*.xml"]\n{options}')
    monkeypatch.setattr(grippers_tried, "OPTIONS", table)
    (tmp_path / "jaws.xml").write_text(_gripper(actuated))
    row = grippers_tried.try_gripper(tmp_path / "jaws.xml", tmp_path / "pictures")
    assert (row.placed, row.pads) == (placed, pads)
    assert str(row).startswith(f"| {tmp_path.name}/jaws.xml | {placed} | {pads or '-'} | ")
    assert bool(row.notes) is (placed == "refused")
    assert len(list((tmp_path / "pictures").glob("*.png"))) == (pads > 0)
