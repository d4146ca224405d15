"""Modules of a hand from its maker's model: found, paired with the bodies of an MJCF, attached and pressed."""

import re

import mujoco
import numpy as np
import pytest
from scenes import axes_of

import paxisim
from paxisim.cli import main

# a made-up hand of the form that makers publish: a palm with a 2x3 module, and on each finger a 2x2 and a round tip
TAXEL = """
<xacro:macro name="taxel" params="name parent x:=0 y:=0 z:=0 rx:=0 ry:=0">
  <joint name="${name}_joint" type="prismatic">
    <origin xyz="${x} ${y} ${z}" rpy="${radians(rx)} ${radians(ry)} 0"/>
    <parent link="${parent}"/><child link="${name}_link"/><axis xyz="0 0 1"/>
    <limit lower="-0.001" upper="0" effort="1" velocity="1"/>
  </joint>
  <link name="${name}_link"/>
</xacro:macro>
<xacro:macro name="module" params="name parent x:=0 y:=0 z:=0 rx:=0 ry:=0 rz:=0">
  <joint name="${name}_fixed" type="fixed">
    <origin xyz="${x} ${y} ${z}" rpy="${radians(rx)} ${radians(ry)} ${radians(rz)}"/>
    <parent link="${parent}"/><child link="${name}"/>
  </joint>
  <link name="${name}"/>
</xacro:macro>
"""
GRID_2X2 = "".join(
    f'<xacro:taxel name="${{name}}_g_{i + 1}" parent="${{name}}_g" x="{0.004 * (i % 2)}" y="{-0.005 * (i // 2)}"/>'
    for i in range(4)
)
# numbered column by column
GRID_2X3 = "".join(
    f'<xacro:taxel name="palm_g_{i + 1}" parent="palm_g" x="{0.006 * (i // 2)}" y="{-0.005 * (i % 2)}"/>'
    for i in range(6)
)
ROUND = "".join(
    f'<xacro:taxel name="${{name}}_t_{n}" parent="${{name}}_t" x="{0.009 * np.sin(np.radians(angle))}" y="{y}" '
    f'z="{0.009 * np.cos(np.radians(angle))}" ry="{angle}"/>'
    for n, (y, angle) in enumerate((y, angle) for y in (0, 0.006) for angle in (-40, 0, 40))
)
FINGER = f"""
<xacro:macro name="finger" params="name y roll:=0 length:=0.034">
  <joint name="${{name}}_1" type="revolute"><origin xyz="0 ${{y}} 0.02" rpy="${{radians(roll)}} 0 0"/>
    <parent link="palm"/><child link="${{name}}_low"/><axis xyz="0 1 0"/><limit lower="0" upper="1"/></joint>
  <link name="${{name}}_low"/>
  <joint name="${{name}}_2" type="revolute"><origin xyz="0 0 ${{length}}"/>
    <parent link="${{name}}_low"/><child link="${{name}}_high"/><axis xyz="0 1 0"/><limit lower="0" upper="1"/></joint>
  <link name="${{name}}_high"/>
  <xacro:module name="${{name}}_g" parent="${{name}}_low" x="0.0145" y="-0.002" z="0.015" ry="90"/>{GRID_2X2}
  <xacro:module name="${{name}}_t" parent="${{name}}_high" z="0.010" ry="90" rz="0"/>{ROUND}
</xacro:macro>
"""
THUMB = """
<joint name="thumb_1" type="revolute"><origin xyz="0.03 0.04 -0.01" rpy="0 0 0"/>
  <parent link="palm"/><child link="thumb_low"/><axis xyz="1 0 0"/><limit lower="0" upper="1"/></joint>
<link name="thumb_low"/>
<joint name="thumb_2" type="revolute"><origin xyz="0 0.03 0"/>
  <parent link="thumb_low"/><child link="thumb_high"/><axis xyz="1 0 0"/><limit lower="0" upper="1"/></joint>
<link name="thumb_high"/>
"""
URDF = f"""<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="hand">{TAXEL}{FINGER}
<link name="base"/><link name="palm"/>
<joint name="base_palm" type="fixed"><parent link="base"/><child link="palm"/></joint>
<xacro:module name="palm_g" parent="palm" x="0.012" ry="90"/>{GRID_2X3}
<xacro:finger name="f0" y="0.025" roll="-5"/><xacro:finger name="f1" y="-0.025"/>{THUMB}</robot>"""


def finger_xml(name, y, roll):
    """A finger of the MJCF, 4 mm shorter than in the URDF, with a tip of its own."""
    return f"""
    <body name="{name}_a" pos="0 {y} 0.02" euler="{roll} 0 0"><joint name="{name}1" axis="0 1 0"/>
      <geom type="box" size="0.008 0.008 0.012" pos="0 0 0.015" mass="0.01"/>
      <body name="{name}_b" pos="0 0 0.03"><joint name="{name}2" axis="0 1 0"/>
        <geom type="box" size="0.004 0.006 0.003" mass="0.01"/>
        <body name="{name}_c">
          <geom type="capsule" size="0.008 0.004" pos="0 0.003 0.010" euler="90 0 0" mass="0.01"/>
        </body>
      </body>
    </body>"""


# other names, another order of the fingers, and a palm that stands at another pose
HAND = f"""
<mujoco>
  <worldbody>
    <body name="hand" pos="0.1 0.2 0.3" euler="30 50 70">
      <geom type="box" size="0.004 0.03 0.02" mass="0.1"/>
      <body name="t_a" pos="0.03 0.04 -0.01"><joint axis="1 0 0"/><geom type="sphere" size="0.003" mass="0.01"/>
        <body name="t_b" pos="0 0.03 0"><joint axis="1 0 0"/><geom type="sphere" size="0.003" mass="0.01"/></body>
      </body>
      {finger_xml("right", -0.025, 0)}{finger_xml("left", 0.025, -5)}
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture
def urdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hand.xacro").write_text(URDF)
    (tmp_path / "hand.xml").write_text(HAND)
    return tmp_path / "hand.xacro"


def taxels_in_body(module):
    """Return the positions and normals of a module's taxels in the frame of its body."""
    turn = axes_of(module.mount.quat)
    return module.layout.positions @ turn.T + module.mount.pos, module.layout.normals @ turn.T


def test_modules_go_to_the_bodies_that_stand_where_their_links_do(urdf):
    modules = {module.name: module for module in paxisim.sensor_modules(HAND, urdf)}
    assert {name: module.mount.body for name, module in modules.items()} == {
        "palm_g": "hand",
        "f0_g": "left_a",
        "f0_t": "left_c",
        "f1_g": "right_a",
        "f1_t": "right_c",
    }
    # the tip's own capsule reaches to 1 mm below the taxels, and the box of the phalanx only to 6.5 mm
    assert {module.mount.replaces for name, module in modules.items() if name.endswith("_t")} == {(0,)}
    assert modules["f0_g"].mount.replaces == modules["palm_g"].mount.replaces == ()
    # taxels lie where the maker's model has them
    for finger in ("f0", "f1"):
        grid, round_ = modules[f"{finger}_g"], modules[f"{finger}_t"]
        assert grid.layout == paxisim.TaxelLayout(2, 2, (0.005, 0.004))
        points, normals = taxels_in_body(grid)
        # x of the module points down the finger: taxel 1 is nearest to the tip
        expected = [[0.0145, y, z] for y in (-0.002, -0.007) for z in (0.015, 0.011)]
        np.testing.assert_allclose(points, expected, atol=1e-9)
        np.testing.assert_allclose(normals, np.tile([1, 0, 0], (4, 1)), atol=1e-9)
        assert round_.layout.shape == (3, 1, 6)
        points, normals = taxels_in_body(round_)
        angle = np.radians([-40, 0, 40] * 2)
        outward = np.stack([np.cos(angle), np.zeros(6), -np.sin(angle)], axis=1)
        np.testing.assert_allclose(normals, outward, atol=1e-9)
        middles = np.repeat([[0, 0, 0.01], [0, 0.006, 0.01]], 3, axis=0)
        np.testing.assert_allclose(points, middles + 0.009 * outward, atol=1e-9)


def test_the_maker_s_numbers_are_kept(urdf):
    (palm,) = (module for module in paxisim.sensor_modules(HAND, urdf) if module.name == "palm_g")
    assert palm.layout == paxisim.TaxelLayout(2, 3, (0.005, 0.006), vendor_order=(0, 3, 1, 4, 2, 5))
    # in a file that lists them backwards, too
    joints = re.findall(r"<xacro:taxel name=\"palm_g.*?/>", URDF)
    urdf.write_text(URDF.replace("".join(joints), "".join(joints[::-1])))
    (again,) = (module for module in paxisim.sensor_modules(HAND, urdf) if module.name == "palm_g")
    assert again.layout == palm.layout
    urdf.write_text(URDF.replace('name="palm_g_2"', 'name="palm_g_two_1"'))
    with pytest.raises(paxisim.InvalidValueError, match=r"taxels of palm_g in .* are not numbered"):
        paxisim.sensor_modules(HAND, urdf)


def test_pads_come_in_the_order_of_the_bodies_one_kind_at_a_time_and_read_what_presses_on_them(urdf):
    modules = [module for module in paxisim.sensor_modules(HAND, urdf) if module.layout.taxels == 6]
    with pytest.raises(paxisim.InvalidValueError, match=r"different taxels \(2x3 and 1x6"):
        paxisim.attach(HAND, [module.layout for module in modules], [module.mount for module in modules])
    tips = [module for module in modules if module.layout.rows == 1]
    hand = paxisim.attach(HAND, [tip.layout for tip in tips], [tip.mount for tip in tips])
    assert re.search(r"pad f0_t on left_c: taxels within 1.0\.\.\d.\d mm of the skin, in place of geom 0", hand.report)
    assert [mount.name for mount in hand.mounts] == ["f1_t", "f0_t"]
    # a ball presses on one module with 0.5 N
    for joint in list(hand.spec.joints):
        hand.spec.delete(joint)
    hand.spec.option.gravity = [0, 0, 0]
    data = mujoco.MjData(model := hand.compile())
    mujoco.mj_kinematics(model, data)
    axes = data.body("left_b").xmat.reshape(3, 3)
    ball = hand.spec.worldbody.add_body(pos=data.body("left_b").xpos + axes @ [0.0195, 0.003, 0.010])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0, 0], mass=0.05)
    ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=-axes[:, 0], damping=2)
    model = hand.compile()
    pads = hand.bind(model)
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = 0.5
    mujoco.mj_step(model, data, 1500)
    force = paxisim.TactileReadout(model, pads).read(data)
    assert np.abs(data.qvel).max() < 1e-4
    assert force[0].sum() == 0
    assert force[1].sum(axis=(1, 2)) == pytest.approx([0, 0, 0.5], abs=0.01)


def test_hands_that_do_not_fit_are_refused(urdf):
    mirrored = HAND.replace('"0.03 0.04 -0.01"', '"0.03 -0.04 -0.01"').replace("0 0.03 0", "0 -0.03 0")
    turned = HAND.replace('name="left2" axis="0 1 0"', 'name="left2" axis="1 0 0"')
    for hand, message in (
        (mirrored, r"do not fit .* leaves \d+\.\d mm"),
        (HAND.replace('<joint name="left2" axis="0 1 0"/>', ""), "branches of 2, 2, 2 joints; .* branches of 2, 2, 1"),
        (turned, "or turns their axes"),
    ):
        with pytest.raises(paxisim.InvalidValueError, match=message):
            paxisim.sensor_modules(hand, urdf)
    urdf.write_text(re.sub("<xacro:taxel name=.*?/>", "", URDF))
    with pytest.raises(paxisim.InvalidValueError, match=r'has no taxels.*taxels="1"'):
        paxisim.sensor_modules(HAND, urdf)


def test_hands_on_arms_and_two_hands_that_need_a_pair(urdf):
    both = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body name='arm'><joint axis='0 0 1'/><geom size='0.05'/><body name='fore' pos='0 0 1'>"
        "<joint axis='1 0 0'/><geom size='0.05'/><site name='a'/></body></body><site name='b'/></worldbody></mujoco>"
    )
    both.attach(mujoco.MjSpec.from_string(HAND), site=both.site("a"), prefix="a/")
    for alone, module in zip(paxisim.sensor_modules(HAND, urdf), paxisim.sensor_modules(both, urdf), strict=True):
        assert module.mount.body == f"a/{alone.mount.body}"
        assert module.mount.pos == pytest.approx(alone.mount.pos, abs=1e-9)
    both.attach(mujoco.MjSpec.from_string(HAND), site=both.site("b"), prefix="b/")
    # a hand without a joint of its own shares the world: let it turn
    both.body("b/hand").add_joint(axis=[0, 0, 1])
    with pytest.raises(paxisim.InvalidValueError, match=r"in 2 ways.*fore or b/hand; say which.*--link LINK=BODY"):
        paxisim.sensor_modules(both, urdf)
    modules = paxisim.sensor_modules(both, urdf, {"f0_low": "b/left_a"})
    assert {module.mount.body.split("/")[0] for module in modules} == {"b"}
    for pair, message in (
        ({"f0_lo": "b/left_a"}, "unknown link 'f0_lo'; did you mean 'f0_low'"),
        ({"f0_low": "b/left"}, "unknown body 'b/left'"),
    ):
        with pytest.raises(paxisim.UnknownNameError, match=message):
            paxisim.sensor_modules(both, urdf, pair)


def test_attach_in_the_shell_takes_one_kind_at_a_time(urdf, capsys):
    words = ["attach", "hand.xml", "--xacro", "hand.xacro", "-o", "out.xml"]
    assert main(words) == 2
    assert "1 modules of 2x3 taxels, 2 modules of 2x2 taxels, 2 modules of 1x6 taxels" in capsys.readouterr().err
    assert main([*words, "--sensor", "xela-uspa44"]) == 2
    assert main([*words, "--pool", "2"]) == 2
    assert main([*words, "--link", "f0_low"]) == 2
    assert main(["attach", "hand.xml", "--sensor", "xela-uspa44", "--link", "a=b", "-o", "out.xml"]) == 2
    urdf.write_text(URDF.replace(GRID_2X3, "").replace(GRID_2X2, ""))
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert printed.count("of the skin") == 2
    assert "out.xml: 2 pads of 1x6 taxels" in printed
    pads = paxisim.find_pads(mujoco.MjModel.from_xml_path("out.xml"))
    assert pads.names == ("f1_t_pad", "f0_t_pad")
    assert pads.layout.positions == pytest.approx(paxisim.sensor_modules(HAND, urdf)[0].layout.positions, abs=1e-6)
