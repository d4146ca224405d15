"""Grippers: mounts for the pads on the grippers that robosuite 1.5.2 ships.

`find_mounts` proposed the mounts, and pictures confirmed them. The mounts on bd's beak, Fourier's thumbs and the wiping
tool were chosen by hand, since `find_mounts` cannot or need not place them well. y points from the palm to the
fingertip, z into the finger; lengths in m.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

from paxisim.errors import MissingExtraError, UnknownNameError
from paxisim.models.mount import Mount

_Triple = tuple[float, float, float]
_Quat = tuple[float, float, float, float]


@dataclass(frozen=True)
class KnownGripper:
    """A gripper whose mounts are known.

    Attributes:
        file: Name of its file among robosuite's grippers.
        face_mm: Extent (mm) along y and along x of the largest pad that fits all of its faces.
        mounts: Mounts of the pads.
    """

    file: str
    face_mm: tuple[float, float]
    mounts: tuple[Mount, ...]


def known_grippers() -> tuple[str, ...]:
    """Return the names of the grippers that `mounts_for` knows."""
    return tuple(_KNOWN)


def known_gripper(name: str) -> KnownGripper:
    """Return the entry of a known gripper.

    Raises:
        UnknownNameError: There is no such gripper; the message suggests similar names.
    """
    if name not in _KNOWN:
        raise UnknownNameError("gripper", name, _KNOWN)
    return _KNOWN[name]


def mounts_for(name: str) -> tuple[Mount, ...]:
    """Return the mounts of a known gripper.

    Raises:
        UnknownNameError: There is no such gripper; the message suggests similar names.
    """
    return known_gripper(name).mounts


def mounts_for_file(path: str | Path) -> tuple[Mount, ...] | None:
    """Return the mounts of the known gripper whose file has the name of `path`, or None. Does not read the file."""
    file = Path(path).name
    return next((gripper.mounts for gripper in _KNOWN.values() if gripper.file == file), None)


def robosuite_gripper_path(name: str) -> Path:
    """Return the MJCF file of a known gripper in the installed robosuite, without importing robosuite.

    Raises:
        UnknownNameError: There is no such gripper; the message suggests similar names.
        MissingExtraError: robosuite is not installed.
    """
    gripper = known_gripper(name)
    robosuite = importlib.util.find_spec("robosuite")
    if robosuite is None or robosuite.origin is None:
        raise MissingExtraError("robosuite", "robosuite", f"the gripper {name!r}")
    return Path(robosuite.origin).parent / "models" / "assets" / "grippers" / gripper.file


def _finger(body: str, pos: _Triple, quat: _Quat, *replaces: str | int) -> Mount:
    return Mount(body, pos, quat, replaces)


def _link(body: str, pos: _Triple, quat: _Quat) -> Mount:
    """Return a mount on a link of a hand, whose only collision geom is named after it."""
    return Mount(body, pos, quat, (f"{body}_col",))


# on fingers that close along y of their bodies, the pads face -y or y, with rows along z
_LOOKS_ALONG_MINUS_Y: _Quat = (0.0, 0.0, 0.7071, 0.7071)
_LOOKS_ALONG_Y: _Quat = (0.7071, 0.7071, 0.0, 0.0)

_PANDA = KnownGripper(
    "panda_gripper.xml",
    (16.0, 16.0),
    (
        # the hull of the finger lies 0.5 mm behind its pad
        _finger(
            "finger_joint1_tip",
            (0.0, -0.009, -0.015),
            _LOOKS_ALONG_MINUS_Y,
            "finger1_pad_collision",
            "finger1_collision",
        ),
        _finger(
            "finger_joint2_tip",
            (0.0, 0.009, -0.015),
            _LOOKS_ALONG_Y,
            "finger2_pad_collision",
            "finger2_collision",
        ),
    ),
)

_RETHINK = KnownGripper(
    "rethink_gripper.xml",
    (33.0, 7.0),
    (
        _finger(
            "l_finger_tip",
            (0.0, -0.0087, -0.017),
            _LOOKS_ALONG_MINUS_Y,
            "l_fingertip_g0",
            "l_fingerpad_g0",
            "l_finger_g0",
        ),
        _finger(
            "r_finger_tip", (0.0, 0.0087, -0.017), _LOOKS_ALONG_Y, "r_fingertip_g0", "r_fingerpad_g0", "r_finger_g0"
        ),
    ),
)

_ROBOTIQ_85 = KnownGripper(
    "robotiq_gripper_85.xml",
    (33.5, 20.0),
    tuple(
        _finger(
            f"{side}_inner_finger",
            (0.0, -0.0255, 0.0324),
            _LOOKS_ALONG_MINUS_Y,
            f"{side}_fingertip_collision",
            f"{side}_fingerpad_collision",
            f"{side}_inner_finger_collision",
        )
        for side in ("left", "right")
    ),
)

_ROBOTIQ_140 = KnownGripper(
    "robotiq_gripper_140.xml",
    (66.0, 28.0),
    tuple(
        _finger(
            f"{side}_inner_finger",
            (0.0, 0.045, -0.032),
            (1.0, 0.0, 0.0, 0.0),
            f"{side}_fingertip_collision",
            f"{side}_fingerpad_collision",
        )
        for side in ("left", "right")
    ),
)

_ROBOTIQ_S = KnownGripper(
    "robotiq_gripper_s.xml",
    (22.0, 24.0),
    tuple(
        _finger(
            f"{finger}_link_3",
            (0.0165, 0.0199, 0.0),
            (0.6124, 0.3536, 0.6124, -0.3536),
            f"{short}_l3",
            f"{geom}_tip_collision",
            f"{geom}_pad_collision",
        )
        for finger, short, geom in (
            ("finger_1", "f1", "f1"),
            ("finger_2", "f2", "f2"),
            ("finger_middle", "f3", "finger_middle"),
        )
    ),
)

_XARM7 = KnownGripper(
    "xarm7_gripper.xml",
    (37.0, 30.0),
    (
        _finger("left_finger", (0.0, -0.026, 0.041), _LOOKS_ALONG_MINUS_Y, "left_finger_pad_1", "left_finger_pad_2"),
        _finger("right_finger", (0.0, 0.026, 0.041), _LOOKS_ALONG_Y, "right_finger_pad_1", "right_finger_pad_2"),
    ),
)

_JACO = KnownGripper(
    "jaco_three_finger_gripper.xml",
    (36.0, 16.0),
    tuple(
        _finger(
            f"{finger}_distal",
            pos,
            quat,
            f"{finger}_distal_collision",
            f"{finger}_tip_collision",
            f"{finger}_pad_collision",
        )
        for finger, pos, quat in (
            ("thumb", (0.0, 0.0025, 0.0233), (0.6088, 0.7934, 0.0, 0.0)),
            ("index", (0.0, -0.0025, 0.0233), (0.0, 0.0, 0.7934, 0.6088)),
            ("pinky", (0.0, -0.0025, 0.0233), (0.0, 0.0, 0.7934, 0.6088)),
        )
    ),
)

_INSPIRE_LEFT = KnownGripper(
    "inspire_left_hand.xml",
    (13.5, 8.0),
    (
        _link("l_thumb_distal", (0.0088, -0.0133, -0.006), (0.3658, -0.6051, -0.3657, -0.6052)),
        _link("l_index_distal", (-0.0048, -0.0195, -0.0047), (0.013, 0.72, -0.015, 0.694)),
        _link("l_middle_distal", (-0.0051, -0.0205, -0.0047), (0.023, 0.723, -0.018, 0.69)),
        _link("l_ring_distal", (-0.0048, -0.0195, -0.0047), (0.013, 0.72, -0.015, 0.694)),
        _link("l_pinky_distal", (-0.0041, -0.0158, -0.0052), (0.01, 0.696, -0.013, 0.718)),
    ),
)

_INSPIRE_RIGHT = KnownGripper(
    "inspire_right_hand.xml",
    (13.5, 8.0),
    (
        _link("r_thumb_distal", (0.0086, 0.0132, -0.006), (0.6053, 0.3654, 0.6055, -0.3653)),
        _link("r_index_distal", (-0.0048, 0.0196, -0.0053), (0.72, -0.015, 0.694, 0.016)),
        _link("r_middle_distal", (-0.0051, 0.0206, -0.0046), (0.692, -0.022, 0.722, 0.018)),
        _link("r_ring_distal", (-0.0048, 0.0196, -0.0053), (0.72, -0.015, 0.694, 0.016)),
        _link("r_pinky_distal", (-0.0041, 0.0159, -0.0048), (0.694, -0.009, 0.72, 0.014)),
    ),
)


def _fourier(side: str, file: str, thumb: tuple[_Triple, _Quat]) -> KnownGripper:
    ring: tuple[_Triple, _Quat] = ((0.0188, -0.0056, -0.0004), (0.493, -0.511, -0.475, -0.519))
    return KnownGripper(
        file,
        (14.0, 7.0),
        (
            _link(f"{side}_thumb_distal_link", *thumb),
            _link(f"{side}_index_intermediate_link", *ring),
            _link(f"{side}_middle_intermediate_link", (0.0268, -0.0047, -0.0003), (0.508, -0.489, -0.499, -0.503)),
            _link(f"{side}_ring_intermediate_link", *ring),
            _link(f"{side}_pinky_intermediate_link", (0.0155, -0.0065, 0.0), (0.463, -0.535, -0.463, -0.534)),
        ),
    )


_FOURIER_LEFT = _fourier("L", "fourier_left_hand.xml", ((0.0271, 0.0058, 0.001), (0.419, 0.581, 0.445, -0.537)))
_FOURIER_RIGHT = _fourier("R", "fourier_right_hand.xml", ((0.0268, 0.0065, 0.001), (0.427, 0.575, 0.452, -0.532)))

_BD = KnownGripper(
    "bd_gripper.xml",
    (24.0, 24.0),
    (
        # front of the lower jaw, with its tooth in the middle
        _finger("stator", (0.2185, 0.0, -0.0356), (0.0, 0.7071, 0.7071, 0.0), 3, 5),
        # hollow beak, from rim to rim; opposite and parallel to the jaw at arm_f1x = -0.4
        _finger("mover", (0.0864, 0.0, -0.0473), (0.6932, -0.1396, 0.1396, -0.6932), 3, 4, 6, 7),
    ),
)

_WIPING = KnownGripper(
    "wiping_gripper.xml",
    (50.0, 120.0),
    (
        Mount(
            "wiping_gripper",
            (0.0, 0.0, 0.015),
            (0.0, 1.0, 0.0, 0.0),
            (
                *(f"wiping_surface{side}{letter}" for side in (1, 2) for letter in "abcdefg"),
                *(f"wiping_surface{side}{letter}r" for side in (1, 2) for letter in "bcdef"),
                *(f"wiping_corner{corner}" for corner in (1, 2, 3, 4)),
            ),
        ),
    ),
)

_KNOWN = {
    "bd": _BD,
    "fourier_left": _FOURIER_LEFT,
    "fourier_right": _FOURIER_RIGHT,
    "inspire_left": _INSPIRE_LEFT,
    "inspire_right": _INSPIRE_RIGHT,
    "jaco_three_finger": _JACO,
    "panda": _PANDA,
    "rethink": _RETHINK,
    "robotiq_140": _ROBOTIQ_140,
    "robotiq_85": _ROBOTIQ_85,
    "robotiq_s": _ROBOTIQ_S,
    "wiping": _WIPING,
    "xarm7": _XARM7,
}
