"""Robots in MJCF for finding mounts: two fingers that close on each other, an arm that carries them, a bending hand."""

import numpy as np
from models.scenes import axes_of

BOX = '<geom type="box" size="0.005 0.01 0.03" mass="0.05"/>'


def box(x, y, z, dx, dy, dz) -> str:
    return f'<geom type="box" pos="{x} {y} {z}" size="{dx} {dy} {dz}" mass="0.01"/>'


def two_fingers(name="", left=BOX, right=BOX, *, reverse=False, hinge=False, pose="") -> tuple[str, str]:
    """Return the XML of a palm with two fingers that close along x, and their actuators.

    The inner faces of the fingers are 5 mm from their bodies' origins and 80 mm apart when open.

    Args:
        name: Prefix of all names.
        left: Geoms of the left finger, which is at -x.
        right: Geoms of the right finger.
        reverse: Whether the control that opens a finger is the larger one.
        hinge: Whether the fingers turn instead of sliding.
        pose: Attributes of the palm's body.
    """
    bodies, actuators = "", ""
    axis, reach = (-1 if reverse else 1), (0.6 if hinge else 0.04)
    for side, sign, geom in (("left", 1, left), ("right", -1, right)):
        joint, limits = f"{name}{side}", (f"0 {reach}" if sign * axis > 0 else f"{-reach} 0")
        if hinge:
            move, height = f'type="hinge" axis="0 {axis} 0"', 0
            geom = geom.replace("<geom", '<geom pos="0 0 0.05"', 1)
        else:
            move, height = f'type="slide" axis="{axis} 0 0"', 0.04
        bodies += f"""<body name="{joint}" pos="{-sign * 0.045} 0 {height}">
          <joint name="{joint}" {move} range="{limits}" damping="5"/>{geom}</body>"""
        actuators += f'<position name="{joint}" joint="{joint}" kp="200" ctrlrange="{limits}"/>'
    palm = f'<geom type="box" size="0.06 0.02 0.01" pos="0 0 -0.01" mass="0.3"/>{bodies}'
    return f'<body name="{name}palm" {pose}>{palm}</body>', actuators


def on_arm(hand: tuple[str, str], name="", at="0 0 0", joints=4) -> tuple[str, str]:
    """Return the XML of an arm of upright links that carries a hand, and the actuators of both."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "1 0 0", "0 1 0")
    inner, actuators = hand
    inner = f'<body name="{name}flange" pos="0 0 0.12">{inner}</body>' if inner else ""
    for i in reversed(range(joints)):
        joint = f"{name}j{i}"
        inner = (
            f'<body name="{name}link{i}" pos="{at if i == 0 else "0 0 0.12"}">'
            f'<joint name="{joint}" axis="{axes[i]}" range="-2 2" damping="1"/>'
            f'<geom type="capsule" fromto="0 0 0.02 0 0 0.1" size="0.02" mass="0.5"/>{inner}</body>'
        )
        actuators = f'<position name="{joint}" joint="{joint}" kp="100" ctrlrange="-2 2"/>{actuators}'
    return inner, actuators


def bending_hand(bend="0 1.4") -> tuple[str, str]:
    """Return a palm with two fingers of two joints that bend towards a thumb below them, like a human hand."""
    bodies, actuators = "", ""
    parts = [(f"f{i}", f"0.09 {0.03 * i} 0.01", "0 1 0", bend) for i in range(2)]
    parts.append(("thumb", "0.02 0.01 0.07", "0 -1 0", "0 1.2"))
    for name, place, axis, limits in parts:
        bodies += (
            f'<body name="{name}_1" pos="{place}"><joint name="{name}_1" axis="{axis}" range="{limits}" '
            f'damping="0.05"/><geom type="capsule" fromto="0 0 0 0.04 0 0" size="0.008" mass="0.02"/>'
            f'<body name="{name}_2" pos="0.045 0 0">'
            f'<joint name="{name}_2" axis="{axis}" range="{limits}" damping="0.05"/>'
            f'<geom type="capsule" fromto="0 0 0 0.03 0 0" size="0.008" mass="0.02"/></body></body>'
        )
        for k in (1, 2):
            actuators += f'<position name="{name}_{k}" joint="{name}_{k}" kp="1" ctrlrange="{limits}"/>'
    palm = '<geom type="box" size="0.05 0.03 0.01" pos="0.03 0.015 0" mass="0.3"/>'
    return f'<body name="palm">{palm}{bodies}</body>', actuators


def four_bars() -> tuple[str, str, str]:
    """Return a palm with two fingers that parallel cranks keep upright, their actuator, and their equalities.

    One actuator turns the left crank by 0 to 0.9 rad, and the right crank follows. The inner faces of the fingers are
    ``2 * (0.045 - 0.05 * sin(angle))`` m apart.
    """
    bodies, loops = "", ""
    for side, sign in (("left", 1), ("right", -1)):
        crank = f'axis="0 {sign} 0" damping="0.2"'
        rod = '<geom type="capsule" fromto="0 0 0 0 0 0.05" size="0.003" mass="0.01"/>'
        bodies += f"""<body name="{side}_crank" pos="{-sign * 0.05} 0 0">
            <joint name="{side}_crank" {crank} range="0 0.9"/>{rod}
            <body name="{side}" pos="0 0 0.05"><joint name="{side}_tip" {crank}/>
              <geom type="box" pos="0 0 0.02" size="0.005 0.012 0.025" mass="0.02"/></body></body>
          <body name="{side}_rocker" pos="{-sign * 0.075} 0 0">
            <joint name="{side}_rocker" {crank}/>{rod}</body>"""
        loops += f'<connect body1="{side}_rocker" body2="{side}" anchor="0 0 0.05" solref="0.004 1"/>'
    loops += '<joint joint1="right_crank" joint2="left_crank" solref="0.004 1"/>'
    palm = f'<body name="palm"><geom type="box" size="0.06 0.02 0.01" pos="0 0 -0.02" mass="0.3"/>{bodies}</body>'
    return palm, '<position name="close" joint="left_crank" kp="5" ctrlrange="0 0.9"/>', loops


def three_fingers() -> tuple[str, str]:
    """Return a palm with three fingers around it that bend towards its axis, and their actuators."""
    fingers = "".join(
        f"""<body name="arm{i}" euler="0 0 {np.radians(120 * i)}"><body name="finger{i}" pos="0.06 0 0">
          <joint name="finger{i}" axis="0 -1 0" range="-0.4 0.7" damping="0.05"/>
          <geom name="finger{i}" type="box" pos="0 0 0.04" size="0.004 0.008 0.03" mass="0.03"/></body></body>"""
        for i in range(3)
    )
    palm = f'<body name="palm"><geom type="cylinder" size="0.07 0.01" pos="0 0 -0.03"/>{fingers}</body>'
    return palm, "".join(f'<position joint="finger{i}" kp="2" ctrlrange="-0.4 0.7"/>' for i in range(3))


def one_jaw() -> tuple[str, str]:
    """Return a fixed jaw with one above it that turns towards it, and its actuator."""
    bodies = """<body name="base">
      <geom name="fixed" type="box" pos="0.05 0 0" size="0.05 0.01 0.004"/>
      <body name="jaw" pos="0 0 0.03">
        <joint name="jaw" axis="0 1 0" range="-1 0.3" damping="0.1"/>
        <geom name="jaw" type="box" pos="0.06 0 0" size="0.03 0.01 0.004" mass="0.05"/>
      </body></body>"""
    return bodies, '<position name="jaw" joint="jaw" kp="5" ctrlrange="-1 0.3"/>'


def robot(*parts: tuple[str, str], extra="", world="") -> str:
    """Return the MJCF text of bodies with their actuators."""
    bodies, actuators = "".join(p[0] for p in parts), "".join(p[1] for p in parts)
    return f"""<mujoco><compiler angle="radian"/><worldbody>{world}{bodies}</worldbody>
      <actuator>{actuators}</actuator>{extra}</mujoco>"""


def outward(found) -> dict[str, np.ndarray]:
    """Return the outward normal of the mount on each body, in the body's frame."""
    return {mount.body: -axes_of(mount.quat)[:, 2] for mount in found.mounts}


def check_two(found, x=0.005, size=(0.06, 0.02), centre=0.0, names=("left", "right"), atol=1e-4) -> None:
    """Check that the faces oppose each other along x, `x` from their bodies' origins, with rows along z."""
    assert [mount.body for mount in found.mounts] == list(names)
    for face, side in zip(found.faces, (1, -1), strict=True):
        np.testing.assert_allclose(face.mount.pos, (side * x, 0, centre), atol=atol)
        axes = axes_of(face.mount.quat)
        np.testing.assert_allclose(axes[:, 2], (-side, 0, 0), atol=0.03)
        np.testing.assert_allclose(axes[:, 1], (0, 0, 1), atol=0.03)
        np.testing.assert_allclose(face.size, size, atol=atol)
