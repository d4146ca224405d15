"""Found faces: the faces that `find_mounts` proposes, as mounts and in words."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.closing import Stroke
from paxisim.models.hands import Hand
from paxisim.models.links import Links
from paxisim.models.mount import Mount, name_for_replaces
from paxisim.models.pad_faces import PadFace


@dataclass(frozen=True)
class FoundFace:
    """A face that can carry a pad.

    Attributes:
        mount: Proposed mount.
        size: Extent of the face (m) along y and along x.
        flatness: Largest distance of the face behind its plane (m): about 1 mm at most, 2.5 mm if it has steps.
        fill: Share of the rectangle that lies within 1 mm of the plane; below 0.7 the face is round or narrow.
        opposite: Names of the bodies that the face closes against.
        geoms: Names of the geoms that shadow a pad on the face, on its own and on other bodies.
        off_course: Angle (rad) between the outward normal and the way the face moves when its finger closes.
    """

    mount: Mount
    size: tuple[float, float]
    flatness: float
    fill: float
    opposite: tuple[str, ...]
    geoms: tuple[str, ...]
    off_course: float


def found_face(links: Links, pad: PadFace) -> FoundFace:
    """Express a face in the frame of the body that carries most of it."""
    model, face = links.model, pad.face
    body = int(model.geom_bodyid[face.geoms[0]])
    if not model.body(body).name:
        parent = links.body_name(int(model.body_parentid[body]))
        raise InvalidValueError(
            f"a pad would go on {links.body_name(body)} (its parent is {parent}), which has no name: name "
            "it, since a mount refers to its body by name"
        )
    data = links.data
    rot, pos = data.xmat[body].reshape(3, 3), data.xpos[body]
    link_rot = data.xmat[pad.link].reshape(3, 3)
    center = rot.T @ (data.xpos[pad.link] + link_rot @ face.center - pos)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rot.T @ link_rot @ face.frame).ravel())
    quat = np.round(quat, 6)
    quat = quat * np.sign(quat[np.flatnonzero(quat)[0]]) + 0.0
    replaces: list[str | int] = []
    for geom in sorted(face.geoms):
        own = int(model.geom_bodyid[geom]) == body and not model.geom(geom).name
        word = geom - int(model.body_geomadr[body]) if own else name_for_replaces(model, geom)
        replaces += [] if word == "" else [word]  # without any name it stays on, and `_notes` says so
    mount = Mount(
        links.body_name(body),
        tuple((np.round(center, 6) + 0.0).tolist()),
        tuple(quat.tolist()),
        tuple(replaces),  # type: ignore[arg-type]
    )
    return FoundFace(
        mount,
        face.size,
        face.flatness,
        face.fill,
        tuple(map(links.name, pad.partners)),
        tuple(name for geom in face.geoms if (name := name_for_replaces(model, geom))),
        pad.off_course,
    )


def describe(hand: Hand, found: list[PadFace], faces: list[FoundFace]) -> list[str]:
    """Return lines that say how a hand closes and where its pads are."""
    links, closing = hand.links, hand.closing
    lines = []
    for a, start, end, spreads in zip(
        hand.drive.actuators, closing.open_ctrl, closing.close_ctrl, closing.spreads, strict=True
    ):
        why = "only spreads fingers" if spreads else "does not move the fingers together"
        name = links.model.actuator(int(a)).name or f"actuator {a}"
        held = f"held still at {start:.4g}: {why}"
        lines.append(f"  {name}: {held if start == end else f'from {start:.4g} to {end:.4g}'}")
    by_link = {pad.link: pad.face.center for pad in found}
    for p in hand.pairs:
        if p.a in by_link and p.b in by_link:
            gaps = [_gap(hand.stroke, frame, p.a, p.b, by_link) for frame in range(len(hand.stroke.qpos))]
            lines.append(
                f"{links.name(p.a)} opposes {links.name(p.b)}: the faces' centres are "
                f"{gaps[0] * 1e3:.1f} mm apart when open, {min(gaps) * 1e3:.1f} mm when nearest"
            )
    for pad, f in zip(found, faces, strict=True):
        moved = float(np.linalg.norm(hand.moves.get(pad.link, np.zeros(3))))
        towards = ", ".join(f.opposite) if f.opposite else "the palm"
        lines.append(
            f"{f.mount.body} (moves {moved * 1e3:.1f} mm) faces {towards}: face of "
            f"{f.size[0] * 1e3:.1f} x {f.size[1] * 1e3:.1f} mm (y, x), flat to {f.flatness * 1e3:.2f} mm over "
            f"{f.fill:.0%}, its normal {np.degrees(f.off_course):.0f} deg off the way it closes"
        )
        lines.append(f"  switches off {', '.join(f.geoms)}")
        lines += [f"  note: {note}" for note in _notes(pad, f)]
    return lines


def _notes(pad: PadFace, found: FoundFace) -> list[str]:
    notes = []
    if found.fill < 0.7:
        notes.append("the face is round or narrow: the edges of the pad stand out from it")
    if len(found.geoms) < len(pad.face.geoms):
        notes.append("a geom that has no name, nor has its body, takes load from the pad: name it")
    return notes


def _gap(stroke: Stroke, frame: int, a: int, b: int, centres: dict[int, NDArray[np.float64]]) -> float:
    apart = stroke.world(a, frame, centres[a]) - stroke.world(b, frame, centres[b])
    return float(np.linalg.norm(apart))
