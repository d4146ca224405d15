"""find_mounts: propose mounts for the pads on any robot that has a hand.

The search finds the robot's hands and closes them (`paxisim.models.hands`), chooses on each fingertip the face that
moves towards what the hand closes on (`paxisim.models.pad_faces`), and reports what it did. A hand with one jaw gets a
pad on that jaw and one on the part that it closes against. The palm of a hand gets none.

The proposed pad frame has z into the finger, y from the finger's base to its tip, so that row 0 is nearest the palm,
and x = y cross z. The sensing surface is the plane of the face. Lengths in m.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models.found_faces import FoundFace, describe, found_face
from paxisim.models.grip import Grip
from paxisim.models.grippers import mounts_for_file
from paxisim.models.hands import Hand, closes_on, fingers_on
from paxisim.models.links import Links, bodies_above
from paxisim.models.load import compile_whole, load_spec
from paxisim.models.mount import Mount, replaced_in_spec
from paxisim.models.names import listed
from paxisim.models.pad_faces import PadFace, Rejected, pad_faces

WAYS_OUT = (
    "name the fingers (--fingers), the actuators or joints that close (--close) or a part of the robot (--under), or "
    "give the mounts by hand (--mount)"
)

_SERVO = 20.0  # rad/s, natural frequency of the servo of a joint that has no actuator
_REASONS = 3  # at most so many are listed


@dataclass(frozen=True, eq=False)
class FoundMounts:
    """Result of `find_mounts`.

    Attributes:
        faces: Faces, one per fingertip.
        report: Readable account of the search and its result.
        model: Model of the robot that was searched, for drawing.
        open_qpos: ``(nq,)`` pose with all hands open.
        grasp_qpos: ``(nq,)`` pose in which the first fingertips meet or are nearest.
        grips: One entry per hand; the indices of its pads are those of `faces`. Empty if joints without an actuator
            close the robot.
    """

    faces: tuple[FoundFace, ...]
    report: str
    model: mujoco.MjModel
    open_qpos: NDArray[np.float64]
    grasp_qpos: NDArray[np.float64]
    grips: tuple[Grip, ...]

    def __repr__(self) -> str:
        """One line with the bodies that carry the faces."""
        return f"FoundMounts({len(self.faces)} faces: {listed([face.mount.body for face in self.faces])})"

    @property
    def mounts(self) -> tuple[Mount, ...]:
        """The proposed mounts."""
        return tuple(face.mount for face in self.faces)


def find_mounts(
    gripper: mujoco.MjSpec | str | Path,
    *,
    fingers: Sequence[str] = (),
    close: Sequence[str] = (),
    under: str = "",
) -> FoundMounts:
    """Propose a mount for every fingertip of a robot's hands, by closing them and finding the faces that meet.

    Without options, a proposal that fails a check is refused: a pad must face the way its fingertip moves when the hand
    closes, and it must face its partner or, in a hand, the space that the fingers close on. With `fingers`, such a
    proposal is made with a warning in the report.

    Args:
        gripper: A gripper, a hand or a whole robot: an MjSpec (left unchanged), the path of its MJCF or URDF file, or
            the MJCF text. Objects beside the robot do not matter.
        fingers: Names of the bodies that are the fingertips; a single fixed jaw is one of them.
        close: Names of the actuators, or of joints without one, that close the hand; all others are held.
        under: Name of a body: search only the part of the robot that it carries.

    Returns:
        The faces with their mounts, and a report.

    Raises:
        InvalidValueError: Nothing closes, no fingertips oppose each other, or a finger's body has no name; the message
            says what was found.
        UnknownNameError: There is no such body, actuator or joint.
    """
    spec = load_spec(gripper)
    of_robot = len(spec.actuators)
    actuated = _drive_joints(spec, close)
    model = compile_whole(spec, "the robot")
    if not np.any(model.geom_contype | model.geom_conaffinity):
        raise InvalidValueError("the robot has no geom that can touch anything (contype, conaffinity)")
    if not model.nu:
        raise InvalidValueError(f"the robot has no actuators, so nothing closes: {_joints_to_name(spec)}")
    for servo in range(of_robot, model.nu):
        _tune(model, servo)
    links = Links(model, fingers)
    found = _Search(links, fingers, actuated, under).result()
    # the controls of a grip are those of the robot, without the servos that only this search has
    return found if model.nu == of_robot else replace(found, grips=())


def choose_mounts(
    spec: mujoco.MjSpec,
    file: str = "",
    *,
    fingers: Sequence[str] = (),
    close: Sequence[str] = (),
    under: str = "",
) -> tuple[tuple[Mount, ...], str, tuple[Grip, ...]]:
    """Return the known mounts of a gripper file that robosuite ships, else those that `find_mounts` proposes.

    A file counts as known if its name is known, it has the bodies and geoms that the mounts need, and no option is
    given.

    Args:
        spec: The robot (left unchanged).
        file: Name of the file it came from, if any.
        fingers: As for `find_mounts`.
        close: As for `find_mounts`.
        under: As for `find_mounts`.

    Returns:
        The mounts, a readable account of how they were chosen, and how their hands close (empty for a known gripper).

    Raises:
        InvalidValueError: The gripper is not known, and `find_mounts` found no mounts.
    """
    known = None if fingers or close or under else mounts_for_file(file)
    if known is not None and _fits(spec, known):
        return known, f"{Path(file).name} is known: pads on {', '.join(m.body for m in known)}", ()
    found = find_mounts(spec, fingers=fingers, close=close, under=under)
    return found.mounts, found.report, found.grips


def grips_of(spec: mujoco.MjSpec, mounts: Sequence[Mount]) -> tuple[Grip, ...]:
    """Return how the hands close that carry the given mounts; empty if nothing closes them.

    Args:
        spec: The robot (left unchanged).
        mounts: Mounts of its pads.
    """
    model = compile_whole(spec, "the robot")
    bodies = [mount.body for mount in mounts]
    links = Links(model, bodies)
    search = _Search(links, bodies)
    on = [int(links.of_body[model.body(mount.body).id]) for mount in mounts]
    grips = []
    for hand in search.hands():
        if not len(hand.drive.actuators):
            continue
        search.take(hand)
        mine = [i for i, link in enumerate(on) if link == hand.palm or any(link in m for m in hand.members.values())]
        across = {i: tuple(j for j in mine if hand.finger(on[i]) != hand.finger(on[j])) for i in mine}
        grips.append(_grip(hand, tuple(mine), tuple(across[i] for i in mine)))
    return tuple(grips)


def _grip(hand: Hand, pads: tuple[int, ...], partners: tuple[tuple[int, ...], ...]) -> Grip:
    return Grip(
        pads=pads,
        actuators=tuple(hand.drive.actuators.tolist()),
        open_ctrl=hand.drive.control(hand.closing.open_ctrl),
        close_ctrl=hand.drive.control(hand.closing.close_ctrl),
        qpos=hand.stroke.qpos,
        partners=partners,
    )


def _fits(spec: mujoco.MjSpec, mounts: tuple[Mount, ...]) -> bool:
    try:
        for mount in mounts:
            replaced_in_spec(spec, mount)
    except (UnknownNameError, InvalidValueError):
        return False
    return {m.body for m in mounts} <= {body.name for body in spec.bodies}


def _drive_joints(spec: mujoco.MjSpec, close: Sequence[str]) -> list[int]:
    """Return the ids of the named actuators and of those of the named joints; a joint without one gets a servo."""
    actuators = list(spec.actuators)
    names = [actuator.name for actuator in actuators if actuator.name]
    joints = {joint.name: joint for joint in spec.joints if joint.name}
    ids: list[int] = []
    for name in close:
        found = [i for i, a in enumerate(actuators) if a.name == name]
        found = found or [i for i, a in enumerate(actuators) if a.target == name]
        if not found and name not in joints:
            raise UnknownNameError("actuator or joint", name, [*names, *joints])
        if not found:
            servo = spec.add_actuator(name=f"close_{name}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=1.0)
            servo.forcelimited = 0  # not what the file's defaults say
            if joints[name].range[0] < joints[name].range[1]:
                servo.ctrlrange, servo.ctrllimited = joints[name].range, 1
            found = [len(actuators)]
            actuators.append(servo)
        ids += found
    return ids


def _tune(model: mujoco.MjModel, servo: int) -> None:
    """Give the servo of a joint a stiffness that suits the joint's inertia, critically damped and without friction."""
    dof = int(model.jnt_dofadr[model.actuator_trnid[servo, 0]])
    model.dof_frictionloss[dof] = model.dof_damping[dof] = 0
    inertia = float(model.dof_M0[dof])
    stiffness, damping = inertia * _SERVO**2, 2 * inertia * _SERVO
    model.actuator_gainprm[servo, 0] = stiffness
    model.actuator_biasprm[servo, 1:3] = -stiffness, -damping


def _joints_to_name(spec: mujoco.MjSpec) -> str:
    """Return what to do with a robot without actuators: the joints that would close it, if some do."""
    kinds = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
    joints = [joint.name for joint in spec.joints if joint.name and int(joint.type) in kinds]
    if not joints:
        return "give the mounts by hand (--mount)"
    try:
        report = find_mounts(spec, close=joints).report
    except InvalidValueError:
        return "name the joints that close it (--close), or give the mounts by hand (--mount)"
    closing = [joint for joint in joints if f"  close_{joint}: from " in report]
    return f"name the joints that close it, such as --close {' '.join(closing)}, or give the mounts by hand (--mount)"


class _Search:
    """The search, with one method per step."""

    def __init__(self, links: Links, fingers: Sequence[str] = (), close: Sequence[int] = (), under: str = "") -> None:
        self.links, self.model = links, links.model
        self.wanted = {int(links.of_body[self._body(name)]) for name in fingers}
        self.close = list(close)
        self.under = self._body(under) if under else 0
        self.taken: set[int] = set()
        self.rejected: list[str] = []
        self.warnings: list[str] = []

    def _body(self, name: str) -> int:
        body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body < 0:
            raise UnknownNameError("body", name, [n for i in range(self.model.nbody) if (n := self.model.body(i).name)])
        return body

    def result(self) -> FoundMounts:
        hands: list[tuple[Hand, list[PadFace]]] = []
        for hand in self.hands():
            try:
                found, notes = pad_faces(hand, self.wanted)
            except Rejected as reason:
                self.rejected.append(str(reason))
                continue
            self.take(hand)
            self.warnings += notes
            hands.append((hand, found))
        missing = sorted(self.wanted - {face.link for _, found in hands for face in found})
        if hands and missing:
            self.rejected.append(f"nothing closes {self.links.names(missing)}")
        if missing or not hands:
            raise InvalidValueError(self._refusal())
        hands.sort(key=lambda pair: min(face.link for face in pair[1]))
        faces: list[FoundFace] = []
        grips: list[Grip] = []
        lines = ["Closed the robot's hands without gravity and contacts:"]
        for hand, found in hands:
            first = len(faces)
            index = {face.link: first + i for i, face in enumerate(found)}
            faces += [found_face(self.links, face) for face in found]
            partners = tuple(tuple(index[k] for k in face.partners if k in index) for face in found)
            grips.append(_grip(hand, tuple(index.values()), partners))
            lines += describe(hand, found, faces[first:])
        lines += [f"warning: {w}" for w in self.warnings]
        open_qpos = self._open([hand for hand, _ in hands])
        hand = hands[0][0]
        grasp = min((p.frame for p in hand.pairs), default=len(hand.stroke.qpos) - 1)
        return FoundMounts(tuple(faces), "\n".join(lines), self.model, open_qpos, hand.stroke.qpos[grasp], tuple(grips))

    def hands(self) -> Iterator[Hand]:
        """Yield the hands that may get pads, the most distal first; `take` one to leave its links out of the rest."""
        links = self.links
        depth = {k: len(links.ancestors(k)) for k in links.parent}
        inside = links.below(int(links.of_body[self.under]))
        for palm in sorted((k for k in links.parent if k in inside), key=lambda k: (-depth[k], k)):
            if palm == 0 and self.taken and not self.wanted and not self.close:
                return  # beside a robot with hands, what stands in the world is furniture: lifts, drawers, doors
            branches = [b for b in self._branches(palm) if self.under in (0, b, *bodies_above(self.model, b))]
            tries = [(branches, False)] if len(branches) > 1 else []
            tries += [([b], True) for b in branches if palm in links.geoms and self._is_jaw(palm, b)]
            for some, jaw in tries:
                if not links.below(some[0]) & self.taken:
                    yield Hand(links, palm, some, self.close, jaw)

    def take(self, hand: Hand) -> None:
        """Leave the links of a hand out of the further search."""
        self.taken |= {hand.palm}.union(*hand.members.values())

    def _branches(self, palm: int) -> list[int]:
        """Return the branches of a palm that may be fingers, or those asked for."""
        if not self.wanted and not self.close:
            return fingers_on(self.links, palm, self.taken)
        links = self.links
        branches = [b for b in links.children(palm) if not links.below(b) & self.taken]
        if self.wanted:
            named = [b for b in branches if links.below(b) & self.wanted]
            if palm in self.wanted or len(named) < 2:
                return named if palm in self.wanted else []
            return sorted({*named, *fingers_on(links, palm, self.taken)})  # the rest of a linkage moves with them
        for some in (fingers_on(links, palm, self.taken), branches):
            dofs = links.dofs(set().union(*(links.below(b) for b in some)))
            other = np.setdiff1d(np.arange(self.model.nv), dofs)
            drives = links.drives[self.close]
            if np.any(drives[:, dofs].any(axis=1) & ~drives[:, other].any(axis=1)):
                return some
        return []

    def _is_jaw(self, palm: int, branch: int) -> bool:
        if self.wanted:
            return palm in self.wanted
        if not closes_on(self.links, palm, branch):
            return False
        if palm == 0:
            name = self.links.name(branch)
            self.rejected.append(
                f"{name} closes on the world, as a jaw or as a lift over a table: if it is a jaw, name both "
                f"(--fingers world {name})"
            )
        return palm != 0

    def _refusal(self) -> str:
        reasons = list(dict.fromkeys(self.rejected))
        if reasons:
            more = f"; and {len(reasons) - _REASONS} other places" if len(reasons) > _REASONS else ""
            return f"no hand found: {'; '.join(reasons[:_REASONS])}{more}: {WAYS_OUT}"
        return f"no hand found: no fingers branch off a palm, and no jaw closes on the link that carries it: {WAYS_OUT}"

    def _open(self, hands: list[Hand]) -> NDArray[np.float64]:
        """Return the rest pose with each hand open."""
        qpos = self.links.data.qpos.copy()
        for hand in hands:
            opened = hand.stroke.qpos[0]
            moved = np.abs(opened - self.links.data.qpos) > 1e-9
            qpos[moved] = opened[moved]
        return qpos
