"""find_mounts: propose mounts for the pads on a gripper that paxisim does not know.

The search closes the gripper's actuators (`paxisim.models.closing`), picks the fingertips that approach one another,
finds on each the face towards the others (`paxisim.models.faces`), and reports what it did. A gripper with one moving
jaw gets a pad on that jaw and one on the part it closes against.

The proposed pad frame has z into the finger, y from the finger's base to its tip, so that row 0 is nearest the palm,
and x = y cross z. The sensing surface is the plane of the face. Lengths in m.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.closing import close_gripper, links_of
from paxisim.models.faces import Face, find_face
from paxisim.models.fingertips import Fingers, Pair, unit
from paxisim.models.grippers import mounts_for_file
from paxisim.models.load import compile_whole, load_spec
from paxisim.models.mount import Mount


@dataclass(frozen=True)
class FoundFace:
    """A face that can carry a pad.

    Attributes:
        mount: Proposed mount.
        size: Extent of the face (m) along y and along x.
        flatness: Largest distance of the face behind its plane (m), at most about 1 mm.
        fill: Share of the rectangle that lies within 1 mm of the plane; below 0.7 the face is round or narrow.
        opposite: Names of the bodies that the face closes against.
        geoms: Names of the geoms that shadow a pad on the face, on its own and on other bodies.
    """

    mount: Mount
    size: tuple[float, float]
    flatness: float
    fill: float
    opposite: tuple[str, ...]
    geoms: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class FoundMounts:
    """Result of `find_mounts`.

    Attributes:
        faces: Faces, one per fingertip.
        report: Readable account of the search and its result.
        model: Model of the gripper that was searched, for drawing.
        open_qpos: ``(nq,)`` pose with the gripper open.
        grasp_qpos: ``(nq,)`` pose in which the first fingertips meet or are nearest.
    """

    faces: tuple[FoundFace, ...]
    report: str
    model: mujoco.MjModel
    open_qpos: NDArray[np.float64]
    grasp_qpos: NDArray[np.float64]

    @property
    def mounts(self) -> tuple[Mount, ...]:
        """The proposed mounts."""
        return tuple(face.mount for face in self.faces)


def find_mounts(gripper: mujoco.MjSpec | str | Path) -> FoundMounts:
    """Propose a mount for every fingertip of a gripper, by closing it and finding the faces that meet.

    Args:
        gripper: The gripper alone: an MjSpec (left unchanged), the path of its MJCF file, or the MJCF text.

    Returns:
        The faces with their mounts, and a report.

    Raises:
        InvalidValueError: Nothing closes, no fingertips oppose each other, or a finger's body has no name; the message
            says what was found.
    """
    spec = load_spec(gripper)
    for key in list(spec.keys):
        spec.delete(key)
    for joint in list(spec.joints):
        if int(joint.type) == int(mujoco.mjtJoint.mjJNT_FREE):
            spec.delete(joint)
    model = compile_whole(spec, "the gripper")
    if not links_of(model):
        raise InvalidValueError("the gripper has no geom that can touch anything (contype, conaffinity)")
    return _Search(Fingers(model, close_gripper(model))).result()


def choose_mounts(spec: mujoco.MjSpec, file: str = "") -> tuple[tuple[Mount, ...], str]:
    """Return the known mounts of a gripper file that robosuite ships, else those that `find_mounts` proposes.

    A file counts as known if its name is known and it has the bodies and geoms that the mounts need.

    Args:
        spec: The gripper (left unchanged).
        file: Name of the file it came from, if any.

    Returns:
        The mounts, and a readable account of how they were chosen.

    Raises:
        InvalidValueError: The gripper is not known, and `find_mounts` found no mounts.
    """
    known = mounts_for_file(file)
    if known is not None and _fits(spec, known):
        return known, f"{Path(file).name} is known: pads on {', '.join(m.body for m in known)}"
    found = find_mounts(spec)
    return found.mounts, found.report


def _fits(spec: mujoco.MjSpec, mounts: tuple[Mount, ...]) -> bool:
    names = {geom.name for geom in spec.geoms}
    sizes = {body.name: len(body.geoms) for body in spec.bodies}
    return all(
        m.body in sizes and all(g in names if isinstance(g, str) else g < sizes[m.body] for g in m.replaces)
        for m in mounts
    )


_Found = dict[int, tuple[Face, tuple[int, ...]]]  # link -> its face and the links it closes against


class _Search:
    """The search, with one method per step."""

    def __init__(self, fingers: Fingers) -> None:
        self.fingers = fingers
        self.model, self.stroke = fingers.model, fingers.stroke
        self.warnings: list[str] = []

    def result(self) -> FoundMounts:
        tips = self.fingers.fingertips()
        names = ", ".join(self.fingers.name(tip) for tip in tips)
        pairs = self.fingers.pairs(tips)
        found = self._opposing_tips(tips, pairs) if pairs else self._jaw_against_rest(tips)
        if not found:
            raise InvalidValueError(
                f"the gripper closes ({self.stroke.summary}), which moves {names}, but they do not approach one "
                "another or a face that could carry a pad: give its mounts by hand"
            )
        faces = tuple(self._found(link, face, others) for link, (face, others) in sorted(found.items()))
        grasp = min((p.frame for p in pairs), default=len(self.stroke.qpos) - 1)
        report = self._report(found, faces, pairs)
        return FoundMounts(faces, report, self.model, self.stroke.qpos[0], self.stroke.qpos[grasp])

    def _opposing_tips(self, tips: list[int], pairs: list[Pair]) -> _Found:
        found: _Found = {}
        for tip in tips:
            mine = [(p.b if p.a == tip else p.a, p) for p in pairs if tip in (p.a, p.b)]
            if not mine:
                self.warnings.append(f"{self.fingers.name(tip)} moves, but towards no other finger: no pad on it")
                continue
            towards = np.zeros(3)
            for other, p in mine:
                there = self.fingers.world(other, p.frame, self.fingers.centre[other])
                towards += unit(self.fingers.local(tip, p.frame, there) - self.fingers.centre[tip]) / (p.gap + 5e-3)
            direction = unit(towards) + self.fingers.motion(tip, max(p.frame for _, p in mine))
            face = find_face(
                self.fingers.surface(tip), self.fingers.across_hinge(tip, direction), self.fingers.base(tip)
            )
            if face is None:
                self.warnings.append(f"{self.fingers.name(tip)}: no face towards the other fingers: no pad on it")
            else:
                found[tip] = (face, tuple(other for other, _ in mine))
        return found

    def _jaw_against_rest(self, tips: list[int]) -> _Found:
        """Find the faces of jaws that close on a fixed part, which gets a pad opposite the first jaw."""
        found: _Found = {}
        last = len(self.stroke.qpos) - 1
        for tip in tips:
            face = find_face(self.fingers.surface(tip), self.fingers.motion(tip, last), self.fingers.base(tip))
            if face is None or 0 not in self.fingers.links:
                continue
            where = self.fingers.world(tip, last, face.center)
            ahead = -(self.stroke.rot[last, tip] @ face.frame[:, 2])
            radius = max(face.size) / 2
            rest = find_face(self.fingers.surface(0), -ahead, self.fingers.base(0), (where, radius))
            if rest is None:
                continue
            found[tip] = (face, (0,))
            found.setdefault(0, (rest, (tip,)))
        return found

    def _found(self, link: int, face: Face, others: tuple[int, ...]) -> FoundFace:
        """Express a face in the frame of the body that carries most of it."""
        model = self.model
        body = int(model.geom_bodyid[face.geoms[0]])
        if not model.body(body).name:
            parent = self.fingers.body_name(int(model.body_parentid[body]))
            raise InvalidValueError(
                f"a pad would go on {self.fingers.body_name(body)} (its parent is {parent}), which has no name: name "
                "it, since a mount refers to its body by name"
            )
        rot, pos = self.fingers.data.xmat[body].reshape(3, 3), self.fingers.data.xpos[body]
        world = self.stroke.rot[0, link]
        center = rot.T @ (self.fingers.world(link, 0, face.center) - pos)
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rot.T @ world @ face.frame).ravel())
        quat = np.round(quat, 6)
        quat = quat * np.sign(quat[np.flatnonzero(quat)[0]]) + 0.0
        replaces: list[str | int] = []
        for geom in sorted(face.geoms):
            name, owner = model.geom(geom).name, int(model.geom_bodyid[geom])
            if name:
                replaces.append(name)
            elif owner == body:
                replaces.append(geom - int(model.body_geomadr[body]))
            else:
                there, here = self.fingers.body_name(owner), self.fingers.body_name(body)
                self.warnings.append(
                    f"an unnamed geom of {there} shadows the pad on {here}: name it and add it to replaces"
                )
        mount = Mount(
            self.fingers.body_name(body),
            tuple((np.round(center, 6) + 0.0).tolist()),
            tuple(quat.tolist()),
            tuple(replaces),  # type: ignore[arg-type]
        )
        labels = tuple(self._geom_name(geom) for geom in face.geoms)
        return FoundFace(mount, face.size, face.flatness, face.fill, tuple(map(self.fingers.name, others)), labels)

    # report

    def _geom_name(self, geom: int) -> str:
        body = int(self.model.geom_bodyid[geom])
        number = geom - int(self.model.body_geomadr[body])
        return self.model.geom(geom).name or f"geom {number} of {self.fingers.body_name(body)}"

    def _report(
        self,
        found: _Found,
        faces: tuple[FoundFace, ...],
        pairs: list[Pair],
    ) -> str:
        lines = ["Closed the gripper without gravity and contacts:"]
        s = self.stroke
        for n, a, b, spread in zip(s.actuators, s.open_ctrl, s.close_ctrl, s.spread, strict=True):
            why = "only spreads fingers" if spread else "neither opens nor closes"
            lines.append(f"  {n}: {f'held at {a:.4g}, {why}' if a == b else f'from {a:.4g} to {b:.4g}'}")
        for p in pairs:
            if p.a in found and p.b in found:
                gaps = [self._gap(found, p, f) for f in range(len(s.qpos))]
                lines.append(
                    f"{self.fingers.name(p.a)} opposes {self.fingers.name(p.b)}: the faces' centres are "
                    f"{gaps[0] * 1e3:.1f} mm apart when open, {min(gaps) * 1e3:.1f} mm when nearest"
                )
        for (link, (face, others)), f in zip(sorted(found.items()), faces, strict=True):
            moved = float(np.linalg.norm(self.fingers.moves[link]))
            lines.append(
                f"{f.mount.body} (moves {moved * 1e3:.1f} mm) faces {', '.join(f.opposite)}: face of "
                f"{f.size[0] * 1e3:.1f} x {f.size[1] * 1e3:.1f} mm (y, x), flat to {f.flatness * 1e3:.2f} mm over "
                f"{f.fill:.0%}"
            )
            lines.append(f"  switches off {', '.join(f.geoms)}")
            lines += [f"  note: {note}" for note in self._notes(link, face, f, others)]
        return "\n".join([*lines, *(f"warning: {w}" for w in self.warnings)])

    def _gap(self, found: _Found, pair: Pair, frame: int) -> float:
        a, b = (self.fingers.world(k, frame, found[k][0].center) for k in (pair.a, pair.b))
        return float(np.linalg.norm(a - b))

    def _notes(self, link: int, face: Face, found: FoundFace, others: tuple[int, ...]) -> list[str]:
        notes = []
        if found.fill < 0.7:
            notes.append("the face is round or narrow: the edges of the pad stand out from it")
        corners = self.fingers.surface(link).triangles.reshape(-1, 3)
        mine = np.isin(np.repeat(self.fingers.surface(link).geoms, 3), face.geoms)
        local = (corners[mine] - face.center) @ face.frame
        beyond = float(np.max(np.abs(local[:, :2]) - np.array([face.size[1], face.size[0]]) / 2))
        if beyond > 2e-3:
            notes.append(
                f"the geoms switched off reach {beyond * 1e3:.0f} mm beyond the face: the finger has no contact there"
            )
        return notes
