"""Pictures of a gripper with its pads: what a person must be able to tell from them."""

import io
import warnings
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import paxisim
from paxisim.viz.raster import render, triangles_of
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
    fronts, sides = close_ups[::2], close_ups[1::2]
    assert [ax.get_title() for ax in fronts] == [f"{i + 1} {name}" for i, name in enumerate(gripper.pad_names)]
    for front, side in zip(fronts, sides, strict=True):
        (pad,), (edge,) = pads_drawn(front), pads_drawn(side)
        assert faces(pad) == (12, 12)
        assert pad.get_facecolor()[:, :3].min(axis=1).tolist().count(1.0) == 1, "one taxel should be white"
        assert np.ptp(np.concatenate([path.vertices for path in edge.get_paths()]), axis=0) == pytest.approx(
            [1e-3, 0.02], rel=1e-6
        )  # a pad 1 mm thick and 20 mm high
        assert front.get_ylim() == pytest.approx(side.get_ylim()), "both close-ups should have the same scale"


def test_the_face_of_a_pad_is_drawn_as_its_tensor():
    gripper = paxisim.attach(GRIPPER, GRID)
    turned = [replace(m, quat=(-m.quat[3], m.quat[2], -m.quat[1], m.quat[0])) for m in gripper.mounts]
    for mounts, tip_is_below in ((gripper.mounts, True), (turned, False)):
        front, side = paxisim.plot_mounts(paxisim.attach(GRIPPER, GRID, mounts)).axes[1:3]
        (pad,) = pads_drawn(front)
        white = pad.get_facecolor()[:, :3].min(axis=1) == 1
        middles = np.array([path.vertices[:4].mean(axis=0) for path in pad.get_paths()])
        assert middles[white][0] == pytest.approx([middles[:, 0].min(), middles[:, 1].max()]), "row 0, column 0"
        at = {text.get_text(): text.get_position() for text in front.texts}
        assert at["row 0"][1] == pytest.approx(middles[white][0, 1])
        assert at["col 0"][0] == pytest.approx(middles[white][0, 0])
        assert (at["tip"][1] < at["palm"][1]) == tip_is_below
        at = {text.get_text(): text.get_position() for text in side.texts}
        assert (at["tip"][1] < at["palm"][1]) == tip_is_below


def test_a_finger_that_lies_across_its_pad_lies_in_both_close_ups():
    finger = """<mujoco><worldbody><body name="finger"><joint axis="0 1 0"/>
      <geom name="bone" type="box" size=".04 .01 .01" pos=".04 0 0"/>
    </body></worldbody></mujoco>"""
    gripper = paxisim.attach(finger, GRID, [paxisim.Mount("finger", (0.06, 0, 0.01), (0, 1, 0, 0), ("bone",))])
    for ax in paxisim.plot_mounts(gripper).axes[1:3]:
        at = {text.get_text(): text.get_position() for text in ax.texts if text.get_text()}
        assert at["tip"][0] > at["palm"][0]
        assert at["tip"][1] == pytest.approx(at["palm"][1])


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
    assert len(figure.axes) == 7
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
    assert len(texts) == 32
    boxes = [text.get_window_extent() for text in texts]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


@pytest.mark.parametrize("taxels", ["boxes", "spheres"])
def test_taxels_that_something_covers_are_hollow(taxels):
    lid = '<geom type="box" size=".02 .005 .002" pos="0 0 .02" contype="0" conaffinity="0"/>'
    hollow = []
    for xml in (TOOL, TOOL.replace("</body>", lid + "</body>")):
        # balls of 2.5 mm radius touch the face of the tool from within
        gripper = paxisim.attach(xml, paxisim.Pad(paxisim.TaxelLayout(6, 6, 5e-3), taxels=taxels), [ON_TOOL])
        (pad,) = pads_drawn(paxisim.plot_mounts(gripper).axes[1])
        hollow.append(36 - faces(pad)[1])
    assert hollow[0] == 0
    assert 6 <= hollow[1] <= 18


DRESSED = """<mujoco>
  <asset>
    <material name="black" rgba="0 0 0 1"/><material name="white"/>
    <mesh name="bone" vertex="0 0 0 .01 0 0 0 .01 0 0 0 .06"/>
  </asset>
  <worldbody><body>
    <geom type="mesh" mesh="bone" material="black" contype="0" conaffinity="0"/>
    <geom type="box" size=".02 .02 .02" {0}/>
  </body></worldbody>
</mujoco>"""


@pytest.mark.parametrize(
    ("attributes", "drawn"),
    [("", False), ('material="black"', False), ('material="white"', True), ('material="white" group="3"', False)],
)
def test_a_collision_geom_of_a_dressed_body_is_drawn_if_it_is_for_looks_too(attributes, drawn):
    model = mujoco.MjModel.from_xml_string(DRESSED.format(attributes))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert len(triangles_of(model, data, without=(), replaced=())) == 4 + 12 * drawn


def test_triangles_that_are_seen_edge_on_or_have_no_area_are_left_out_without_a_warning():
    upright = [[0, 0, 0], [0.5, 0, 0], [0.2, 0, 0.5]]
    point, line = [[0.5, 0.5, 0]] * 3, [[0, 0.5, 0], [0.1, 0.5, 0], [0.2, 0.5, 0]]
    face = [[-0.5, -0.5, 0], [0, -0.5, 0], [-0.5, 0, 0]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        together, alone = (
            render(np.array(some, dtype=float), np.eye(3), np.zeros(2), 1.0, 50)
            for some in ([upright, point, line, face], [face])
        )
    np.testing.assert_array_equal(together.depth, alone.depth)


def test_the_rubber_tips_of_a_leap_hand_are_in_the_picture():
    hand = Path(__file__).parents[2].parent / "shared" / "data" / "hands" / "leap_hand" / "right_hand.xml"
    if not hand.exists():
        pytest.skip("needs the hands of MuJoCo Menagerie")
    mount = paxisim.Mount("if_ds", (-0.0111, -0.0352, 0.0148), (0.0077, -0.7054, 0.0014, -0.7088), ("if_tip",))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        front = paxisim.plot_mounts(paxisim.attach(hand, GRID, [mount])).axes[-2]
    alpha = front.get_images()[0].get_array()[:, :, 3]
    middle = slice(3 * len(alpha) // 8, 5 * len(alpha) // 8)
    assert alpha[middle, middle].all(), "the tip should fill the picture behind the pad"


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
