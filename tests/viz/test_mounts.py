"""Pictures of a gripper with its pads: what a person must be able to tell from them."""

import io
from importlib.resources import files

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import paxisim
from paxisim.viz.scene_picture import plot_scene

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
GRID = paxisim.TaxelLayout(4, 3, 0.005)
TOOL = "<mujoco><worldbody><body name='tool'><geom size='.02 .02 .01' type='box'/></body></worldbody></mujoco>"
ON_TOOL = paxisim.Mount("tool", pos=(0, 0, 0.01), quat=(0, 1, 0, 0), replaces=(0,))


def pads_drawn(ax):
    """Return the collections drawn in front of the gripper, one per pad."""
    return [c for c in ax.collections if isinstance(c, PolyCollection) and c.get_zorder() == 2]


def faces(pad):
    """Return the number of polygons of a pad, and how many of them are filled."""
    colors = np.atleast_2d(pad.get_facecolor())
    return len(colors), int(np.count_nonzero(colors[:, 3]))


def texts_of(ax):
    return sorted(text.get_text() for text in ax.texts if text.get_text())


def test_one_picture_shows_all_pads_with_numbers_and_one_close_up_each_has_its_name():
    gripper = paxisim.attach(GRIPPER, GRID)
    overview, *close_ups = paxisim.plot_mounts(gripper).axes
    # of two opposing pads, one shows its taxels and the other an outline
    assert sorted(faces(pad) for pad in pads_drawn(overview)) == [(1, 0), (12, 12)]
    assert texts_of(overview) == ["1", "2"]
    assert [ax.get_title() for ax in close_ups] == [f"{i + 1} {name}" for i, name in enumerate(gripper.pad_names)]
    for ax in close_ups:
        (pad,) = pads_drawn(ax)
        assert faces(pad) == (12, 12)
        assert pad.get_facecolor()[:, :3].min(axis=1).tolist().count(1.0) == 1, "one taxel should be white"


ARM = """<body name="{name}_arm" pos="0 {y} 0">
  <geom type="capsule" size="0.05" fromto="0 0 0 0 0 0.6"/>
  <geom type="capsule" size="0.05" fromto="0 0 0.6 0.5 0 0.6"/>
  <body name="{name}_hand" pos="0.5 0 0.6">
    <geom name="{name}_tip" type="box" size="0.02 0.02 0.005" pos="0 0 -0.055"/>
  </body></body>"""


def test_the_hands_of_a_large_robot_get_pictures_of_their_own():
    arms = ARM.format(name="left", y=0.4) + ARM.format(name="right", y=-0.4)
    mounts = [paxisim.Mount(f"{s}_hand", pos=(0, 0, -0.06), replaces=(f"{s}_tip",)) for s in ("left", "right")]
    xml = f"<mujoco><worldbody>{arms}</worldbody></mujoco>"
    figure = paxisim.plot_mounts(paxisim.attach(xml, GRID, mounts))
    robot, *hands = figure.axes[:3]
    assert len(figure.axes) == 5
    assert np.ptp(robot.get_xlim()) > 0.8
    for ax, number in zip(hands, "12", strict=True):
        assert np.ptp(ax.get_xlim()) < 0.3
        assert texts_of(ax) == [number]


def test_numbers_do_not_overlap():
    fingers = "".join(
        f"""<body name="f{i}" pos="{0.02 * i} 0 0"><geom type="box" size="0.006 0.006 0.02"/></body>"""
        for i in range(8)
    )
    mounts = [paxisim.Mount(f"f{i}", (0, -0.006, 0), (2**-0.5, -(2**-0.5), 0, 0), (0,)) for i in range(8)]
    xml = f"<mujoco><worldbody>{fingers}</worldbody></mujoco>"
    figure = paxisim.plot_mounts(paxisim.attach(xml, paxisim.TaxelLayout(4, 3, 3e-3), mounts))
    figure.savefig(io.BytesIO())  # computes the figure layout
    texts = [text for ax in figure.axes for text in (*ax.texts, ax.title) if text.get_text()]
    assert len(texts) == 16
    boxes = [text.get_window_extent() for text in texts]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_taxels_that_something_covers_are_hollow():
    lid = '<geom type="box" size=".02 .005 .002" pos="0 0 .02" contype="0" conaffinity="0"/>'
    hollow = []
    for xml in (TOOL, TOOL.replace("</body>", lid + "</body>")):
        gripper = paxisim.attach(xml, paxisim.TaxelLayout(6, 6, 5e-3), [ON_TOOL])
        (pad,) = pads_drawn(paxisim.plot_mounts(gripper).axes[1])
        hollow.append(36 - faces(pad)[1])
    assert hollow[0] == 0
    assert 6 <= hollow[1] <= 18


@pytest.mark.robosuite
@pytest.mark.filterwarnings("ignore:.*is not sound MJCF")
@pytest.mark.parametrize(
    "name", ["panda", *(pytest.param(n, marks=pytest.mark.slow) for n in ("inspire_right", "robotiq_s"))]
)
def test_the_whole_hand_is_in_the_picture(name):
    gripper = paxisim.attach(paxisim.robosuite_gripper_path(name), paxisim.TaxelLayout(4, 3, 4e-3))
    alpha = paxisim.plot_mounts(gripper).axes[0].get_images()[0].get_array()[:, :, 3]
    assert not alpha[[0, -1]].any()
    assert not alpha[:, [0, -1]].any()
    rows, columns = (np.flatnonzero(alpha.any(axis=axis)) for axis in (1, 0))
    assert max(np.ptp(rows), np.ptp(columns)) > 0.7 * len(alpha), "the hand should fill the picture"


def test_a_curved_pad_is_drawn_taxel_by_taxel():
    finger = """<mujoco><worldbody><body name="finger">
      <geom name="tip" type="cylinder" size="0.02 0.03" euler="90 0 0"/>
    </body></worldbody></mujoco>"""
    mount = paxisim.Mount("finger", (0, 0, 0.02), (0, 1, 0, 0), ("tip",))
    curved = paxisim.conform(paxisim.TaxelLayout(4, 6, (6e-3, 6e-3)), paxisim.finger_surface(finger, mount))
    as_list = paxisim.TaxelLayout(1, 24, (6e-3, 6e-3), curved.positions, curved.normals)  # like PaXini's fingertips
    (above,) = pads_drawn(paxisim.plot_mounts(paxisim.attach(finger, as_list, [mount])).axes[1])
    heights = np.array([np.ptp(path.vertices, axis=0).min() for path in above.get_paths()])
    assert len(heights) == 24, "all taxels should face a viewer above"
    assert heights.max() > 1.3 * heights.min(), "taxels at the rim should appear foreshortened"


def test_spheres_are_drawn_as_large_as_they_are():
    pad = paxisim.Pad(paxisim.TaxelLayout(2, 2, 0.01), thickness=4e-3, taxels="spheres")
    (taxels,) = pads_drawn(paxisim.plot_mounts(paxisim.attach(TOOL, pad, [ON_TOOL])).axes[1])
    widths = [np.ptp(path.vertices[:, 0]) for path in taxels.get_paths()]
    assert widths == pytest.approx([4e-3] * 4, rel=0.02)


def test_a_scene_in_a_pose_shows_all_of_it_and_each_hand_from_close_by():
    gripper = paxisim.attach(GRIPPER, GRID)
    model = gripper.compile()
    figure = plot_scene(model, gripper.bind(model), model.qpos0, "the first contact")
    whole, hand = figure.axes
    assert (figure.get_suptitle(), texts_of(whole), texts_of(hand)) == ("the first contact", [], ["1", "2"])
    assert sorted(faces(pad) for pad in pads_drawn(hand)) == [(1, 0), (12, 12)]
    assert len(whole.lines[0].get_xdata()) == 2, "there should be a ring around each pad"
