"""The picture of a gripper with its pads."""

from importlib.resources import files

import numpy as np
import pytest
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import paxisim

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
ALWAYS_FLAT = "<mujoco><worldbody><body name='tool'><geom size='.02 .02 .01' type='box'/></body></worldbody></mujoco>"


def pads_drawn(ax):
    """Collections in front of the gripper: one a pad."""
    return [c for c in ax.collections if isinstance(c, Poly3DCollection) and c.get_zorder() == 2]


def test_every_view_shows_every_pad_and_its_number():
    gripper = paxisim.attach(GRIPPER, paxisim.TaxelLayout(4, 3, 0.005))
    figure = paxisim.plot_mounts(gripper)
    assert len(figure.axes) == 3
    for ax in figure.axes:
        assert len(pads_drawn(ax)) == 2
        assert [text.get_text() for text in ax.texts] == ["1", "2"]
    assert all(name in figure.get_suptitle() for name in gripper.pad_names)


def test_of_two_opposing_pads_one_shows_its_taxels_and_the_other_an_outline():
    figure = paxisim.plot_mounts(paxisim.attach(GRIPPER, paxisim.TaxelLayout(4, 3, 0.005)))
    faces = sorted(len(np.atleast_2d(c.get_facecolor())) for c in pads_drawn(figure.axes[0]))
    assert faces == [1, 12]


def test_a_tool_that_does_not_close_is_drawn_as_it_is():
    mount = paxisim.Mount("tool", pos=(0, 0, 0.01), quat=(0, 1, 0, 0), replaces=(0,))
    figure = paxisim.plot_mounts(paxisim.attach(ALWAYS_FLAT, paxisim.TaxelLayout(2, 2, 0.01), [mount]))
    assert len(pads_drawn(figure.axes[0])) == 1


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    gripper = paxisim.attach(GRIPPER, paxisim.TaxelLayout(4, 3, 0.005))
    with pytest.raises(paxisim.MissingExtraError, match=r"paxisim\[viz\]"):
        paxisim.plot_mounts(gripper)
