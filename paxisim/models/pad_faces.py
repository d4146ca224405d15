"""Pad faces: choose the face of each fingertip of a hand that carries a pad, and check it.

A pad is right if its outward normal points the way its face moves when the finger closes, if it faces its partner or,
in a hand, the space that the fingers close on. Whatever of its own link lies in front of it is replaced, and
`paxisim.models.mount_checks` finds what else does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.models.faces import Face, find_face
from paxisim.models.hands import Hand
from paxisim.models.surfaces import unit

_CURLS = np.radians(45)  # largest angle between a normal and the way its face moves, for a finger that bends
_CLOSES = np.radians(50)  # and for one that closes as a whole, perhaps on an arc; also to the direction of its partners
_OPPOSITE = 0.5  # the normals of faces that close on each other have a cosine below minus this
_FACING = 0.6  # cosine between a bending finger's normal and the direction of what it bends towards

_SHIFT = 0.2  # faces out of line by less than this share of their half extent stay as they are
_BESIDE = 4e-3  # m; how far the face of a palm reaches beyond the jaw that closes on it


class Rejected(Exception):
    """A hand has no faces that pass the checks; the message says why."""


@dataclass(frozen=True, eq=False)
class PadFace:
    """The face of one fingertip.

    Attributes:
        link: The fingertip, or the palm of a jaw.
        face: The face, in the frame of the link.
        partners: The links that it closes against.
        off_course: Angle (rad) between its outward normal and the way it moves when the hand closes.
    """

    link: int
    face: Face
    partners: tuple[int, ...]
    off_course: float

    @property
    def half(self) -> NDArray[np.float64]:
        """Half the extent of the face along x, y and z."""
        return np.array([self.face.size[1] / 2, self.face.size[0] / 2, 0.0])


def pad_faces(hand: Hand, wanted: set[int]) -> tuple[list[PadFace], list[str]]:
    """Return the faces of a hand that carry pads, and warnings about fingertips that get none.

    Args:
        hand: The hand.
        wanted: Fingertips that must get a pad; a failed check is then a warning. Empty: those that pass all checks.

    Raises:
        Rejected: Fewer than two faces are left.
    """
    names = hand.links.names(hand.tips) or "nothing that can touch"
    if not hand.tips:
        raise Rejected(f"driving {_actuators(hand)} moves nothing that can touch")
    found, warnings = _jaw(hand) if hand.is_jaw else _fingers(hand)
    if hand.palm in wanted and not hand.is_jaw:
        found += _palm(hand)
    found = _in_line(hand, found)
    doubts = {pad.link: doubt for pad in found if (doubt := _doubt(hand, pad, found))}
    if wanted:
        found = [pad for pad in found if pad.link in wanted]
        asked = {hand.palm, *hand.tips} & wanted
        missing = sorted(asked - {pad.link for pad in found})
        if missing:
            raise Rejected("; ".join(warnings) or f"{hand.links.names(missing)}: no face that closes")
        return found, [*warnings, *doubts.values()]
    found = [pad for pad in found if pad.link not in doubts]
    if len(found) < 2:
        reasons = [*doubts.values(), *warnings]
        why = "; ".join(reasons) if reasons else "they do not approach one another"
        raise Rejected(f"{_actuators(hand)} moves {names}, but {why}")
    return found, [f"{reason}: no pad on it" for reason in (*warnings, *doubts.values())]


def _actuators(hand: Hand) -> str:
    model = hand.links.model
    names = [model.actuator(int(a)).name or f"actuator {a}" for a in hand.drive.actuators]
    more = f" and {len(names) - 3} more" if len(names) > 4 else ""
    return ", ".join(names[: 3 if more else 4]) + more if names else "no actuator"


def _fingers(hand: Hand) -> tuple[list[PadFace], list[str]]:
    found, warnings = [], []
    for tip in hand.tips:
        pairs = [(p.b if p.a == tip else p.a, p) for p in hand.pairs if tip in (p.a, p.b)]
        name = hand.links.name(tip)
        if not hand.curls(tip) and not pairs:
            warnings.append(f"{name} moves, but towards no other finger")
            continue
        frame = max((p.frame for _, p in pairs), default=len(hand.stroke.qpos) - 1)
        direction = hand.motion(tip, frame)
        if tip not in hand.closing.flexes:
            towards = np.zeros(3)
            for other, p in pairs:
                there = hand.stroke.world(other, p.frame, hand.links.centre(other))
                here = hand.links.centre(tip)
                towards += unit(hand.stroke.local(tip, p.frame, there) - here) / (p.gap + 5e-3)
            direction = hand.across_hinge(tip, unit(towards) + direction)
        face = find_face(hand.links.surface(tip), direction, hand.base(tip))
        if face is None:
            warnings.append(f"{name} has no face towards what it closes on")
            continue
        found.append(PadFace(tip, face, tuple(other for other, _ in pairs), _off_course(hand, tip, face, frame)))
    return found, warnings


def _jaw(hand: Hand) -> tuple[list[PadFace], list[str]]:
    """Find the face of a jaw and the one opposite to it on the palm."""
    tip, palm, last = hand.tips[0], hand.palm, len(hand.stroke.qpos) - 1
    surface, rest_surface = hand.links.surface(tip), hand.links.surface(palm)
    hinge = hand.links.hinge(tip)
    outer = np.ones(len(surface.points), dtype=bool)
    if hinge is not None:
        outer = hand.links.is_outer(tip, surface.points, hinge[0])
    face = find_face(surface, hand.motion(tip, last, surface.points[outer].mean(axis=0)), hand.base(tip), outer, True)
    if face is None:
        return [], [f"{hand.links.name(tip)} has no face in the direction in which it closes"]
    # the part of the palm behind the face of the jaw
    ahead = hand.stroke.rot[last, palm].T @ hand.stroke.rot[last, tip] @ -face.frame[:, 2]
    at_rest = hand.stroke.world(palm, last, rest_surface.points)
    local = (hand.stroke.local(tip, last, at_rest) - face.center) @ face.frame
    beside = np.all(np.abs(local[:, :2]) < np.array([face.size[1], face.size[0]]) / 2 + _BESIDE, axis=1)
    rest = find_face(rest_surface, -ahead, hand.base(palm), beside, True)
    if rest is None:
        return [], [f"{hand.links.name(palm)} has no face opposite to {hand.links.name(tip)}"]
    moving = hand.stroke.rot[last, palm].T @ hand.stroke.rot[last, tip] @ hand.motion(tip, last, face.center)
    off = float(np.arccos(np.clip(rest.frame[:, 2] @ moving, -1, 1)))
    return [
        PadFace(palm, rest, (tip,), off),
        PadFace(tip, face, (palm,), _off_course(hand, tip, face, last)),
    ], []


def _palm(hand: Hand) -> list[PadFace]:
    """Find the face of the palm towards the closed fingertips."""
    palm, last = hand.palm, len(hand.stroke.qpos) - 1
    if palm not in hand.links.geoms:
        return []
    tips = np.mean([hand.stroke.world(tip, last, hand.links.centre(tip)) for tip in hand.tips], axis=0)
    direction = hand.stroke.local(palm, last, tips) - hand.links.centre(palm)
    face = find_face(hand.links.surface(palm), direction, np.zeros(3))
    return [] if face is None else [PadFace(palm, face, tuple(hand.tips), 0.0)]


def _off_course(hand: Hand, tip: int, face: Face, frame: int) -> float:
    """Return the angle between a face's outward normal and the way it moves."""
    return float(np.arccos(np.clip(-face.frame[:, 2] @ hand.motion(tip, frame, face.center), -1, 1)))


def _doubt(hand: Hand, pad: PadFace, found: list[PadFace]) -> str:
    """Return what is wrong with a face, empty if nothing is."""
    name = hand.links.name(pad.link)
    if pad.off_course > (_CURLS if hand.curls(pad.link) else _CLOSES):
        return f"the face of {name} points {np.degrees(pad.off_course):.0f} deg off the way it moves"
    if pad.link == hand.palm and not hand.is_jaw:
        return ""
    if hand.curls(pad.link):
        return "" if _faces_the_hand(hand, pad) else f"{name} does not bend towards the palm or another finger"
    others = [other for other in found if other.link in pad.partners]
    if not others:
        return f"{name} closes on no other face"
    partners = hand.links.names([o.link for o in others])
    if not any(_opposite(hand, frame, pad, others) for frame in range(len(hand.stroke.qpos))):
        return f"the faces of {name} and {partners} do not face each other"
    if len(found) > 2:
        return ""
    frame = _meeting(hand, pad, others)
    aside = np.abs(_into(hand, frame, others[0], pad, np.zeros(3))[:2])
    if np.any(aside > (pad.half[:2] + max(others[0].half[:2])) / 2):
        return f"the faces of {name} and {partners} pass each other {np.linalg.norm(aside) * 1e3:.0f} mm apart"
    for at in (0, frame):
        apart = _into(hand, at, others[0], pad, np.zeros(3))
        near = np.linalg.norm(apart) < max(pad.face.size)
        if not near and not hand.is_jaw and -unit(apart)[2] < np.cos(_CLOSES):
            return f"the face of {name} does not point at {partners}"
    return ""


def _opposite(hand: Hand, frame: int, pad: PadFace, others: list[PadFace]) -> bool:
    """Tell whether the normal of a face is opposite to the mean normal of its partners in a pose of the stroke."""
    normal = -hand.stroke.rot[frame, pad.link] @ pad.face.frame[:, 2]
    facing = np.mean([-hand.stroke.rot[frame, o.link] @ o.face.frame[:, 2] for o in others], axis=0)
    return float(normal @ facing) < -_OPPOSITE * float(np.linalg.norm(facing))


def _meeting(hand: Hand, pad: PadFace, others: list[PadFace]) -> int:
    """Return the pose in which the centre of a face is nearest to those of its partners."""
    gaps = [
        np.linalg.norm(
            np.mean([hand.stroke.world(o.link, f, o.face.center) for o in others], axis=0)
            - hand.stroke.world(pad.link, f, pad.face.center)
        )
        for f in range(len(hand.stroke.qpos))
    ]
    return int(np.argmin(gaps))


def _in_line(hand: Hand, found: list[PadFace]) -> list[PadFace]:
    """Move the centres of two faces that close on each other to the middle of where they overlap.

    Faces that do not overlap stay as they are, and `_doubt` finds them.
    """
    placed = {pad.link: pad for pad in found}
    for pad in found:
        if hand.curls(pad.link) or len(pad.partners) != 1 or pad.partners[0] not in placed:
            continue
        other = next(o for o in found if o.link == pad.partners[0])
        frame = _meeting(hand, pad, [other])
        there, across = (_into(hand, frame, other, pad, v) for v in (np.zeros(3), np.eye(3)[:2] * other.half))
        half = np.abs(across - there).sum(axis=0)[:2]
        low = np.maximum(-pad.half[:2], there[:2] - half)
        high = np.minimum(pad.half[:2], there[:2] + half)
        smaller = np.minimum(pad.half[:2], half)
        if np.all(high - low > smaller) and np.any(np.abs(low + high) / 2 > _SHIFT * pad.half[:2]):
            center = pad.face.center + pad.face.frame[:, :2] @ (low + high) / 2
            placed[pad.link] = replace(pad, face=replace(pad.face, center=center))
    return list(placed.values())


def _into(hand: Hand, frame: int, one: PadFace, other: PadFace, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform points from the frame of one face to that of another, in a pose of the stroke."""
    world = hand.stroke.world(one.link, frame, one.face.center + points @ one.face.frame.T)
    return (hand.stroke.local(other.link, frame, world) - other.face.center) @ other.face.frame


def _faces_the_hand(hand: Hand, pad: PadFace) -> bool:
    """Tell whether a finger's face points at the palm or at another finger in some pose of the stroke."""
    links, stroke = hand.links, hand.stroke
    own = hand.members[hand.finger(pad.link)]
    others = [k for k in links.geoms if k == hand.palm or (k not in own and any(k in m for m in hand.members.values()))]
    for frame in range(0, len(stroke.qpos), 3):
        center = stroke.world(pad.link, frame, pad.face.center)
        normal = -stroke.rot[frame, pad.link] @ pad.face.frame[:, 2]
        for other in others:
            apart = stroke.world(other, frame, links.cloud(other)) - center
            if np.max(apart @ normal / np.maximum(np.linalg.norm(apart, axis=1), 1e-9)) > _FACING:
                return True
    return False
