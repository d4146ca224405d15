"""Pictures of a gripper with its pads."""

import io
from importlib.resources import files

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import paxisim

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
ALWAYS_FLAT = "<mujoco><worldbody><body name='tool'><geom size='.02 .02 .01' type='box'/></body></worldbody></mujoco>"


def pads_drawn(ax):
    """Return the collections drawn in front of the gripper, one per pad."""
    return [c for c in ax.collections if isinstance(c, PolyCollection) and c.get_zorder() == 2]


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


def drawn(ax):
    """Return the corners of everything drawn, including the lines."""
    paths = [path.vertices for c in ax.collections for path in c.get_paths()]
    return np.concatenate([*paths, *(line.get_xydata() for line in ax.lines)])


@pytest.mark.robosuite
@pytest.mark.filterwarnings("ignore:.*is not sound MJCF")
@pytest.mark.parametrize("name", ["inspire_right", "robotiq_s", "panda"])
def test_the_whole_hand_is_in_the_picture(name):
    gripper = paxisim.attach(paxisim.robosuite_gripper_path(name), paxisim.TaxelLayout(4, 3, 4e-3))
    figure = paxisim.plot_mounts(gripper)
    figure.savefig(io.BytesIO())  # computes the figure layout
    for ax in figure.axes:
        inside = ax.transAxes.inverted().transform(ax.transData.transform(drawn(ax)))
        assert inside.min() >= 0
        assert inside.max() <= 1
        assert np.ptp(inside, axis=0).max() > 0.8, "the hand should fill the picture"


def test_a_curved_pad_is_drawn_taxel_by_taxel():
    finger = """<mujoco><worldbody><body name="finger">
      <geom name="tip" type="cylinder" size="0.02 0.03" euler="90 0 0"/>
    </body></worldbody></mujoco>"""
    mount = paxisim.Mount("finger", (0, 0, 0.02), (0, 1, 0, 0), ("tip",))
    curved = paxisim.conform(paxisim.TaxelLayout(4, 6, (6e-3, 6e-3)), paxisim.finger_surface(finger, mount))
    as_list = paxisim.TaxelLayout(1, 24, (6e-3, 6e-3), curved.positions, curved.normals)  # like PaXini's fingertips
    for layout in (curved, as_list):
        (above,) = pads_drawn(paxisim.plot_mounts(paxisim.attach(finger, layout, [mount])).axes[2])
        heights = np.array([np.ptp(path.vertices, axis=0).min() for path in above.get_paths()])
        assert len(heights) == 24, "all taxels should face a viewer above"
        assert heights.max() > 1.3 * heights.min(), "taxels at the rim should appear foreshortened"


def test_spheres_are_drawn_as_large_as_they_are():
    pad = paxisim.Pad(paxisim.TaxelLayout(2, 2, 0.01), thickness=4e-3, taxels="spheres")
    mount = paxisim.Mount("tool", pos=(0, 0, 0.01), quat=(0, 1, 0, 0), replaces=(0,))
    (taxels,) = pads_drawn(paxisim.plot_mounts(paxisim.attach(ALWAYS_FLAT, pad, [mount])).axes[2])
    widths = [np.ptp(path.vertices[:, 0]) for path in taxels.get_paths()]
    assert widths == pytest.approx([4e-3] * 4, rel=0.02)
