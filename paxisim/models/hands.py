"""Hands: find the parts of a robot that can hold an object, and close them.

A hand is a link, the palm, with fingers: branches of the robot that few actuators move and that approach one another,
or one jaw that closes on the palm itself. The search goes from the most distal links to the base, so a branch that
ends in a hand is an arm, which is never closed. Points and directions are in the frame of their link unless stated
otherwise; lengths in m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from paxisim.models.closing import Drive, Stroke
from paxisim.models.flexion import Closing, closing_of
from paxisim.models.links import Links, common_body
from paxisim.models.surfaces import unit

MAX_FINGER_ACTUATORS = 5
"""A branch with more actuators is an arm or a leg; Shadow's thumb has five."""
MAX_FINGER_LENGTH = 0.35
"""A longer branch (m) is an arm or a leg."""

_MOVES = 0.25  # a fingertip moves at least this share of the largest motion of any tip
_CLOSES = 0.1  # two fingertips oppose if their mean distance shrinks by at least this share
_SAME_WAY = 0.5  # two links move in the same direction above this cosine
_JAW_GAP = 0.35  # a closed jaw lies nearer to its palm than this share of its length


@dataclass(frozen=True)
class Pair:
    """Two fingertips that close on each other.

    Attributes:
        a: One link.
        b: The other.
        frame: Index of the first pose in which their distance has shrunk by 90 % of its total decrease.
        gap: Mean distance between them in that pose.
    """

    a: int
    b: int
    frame: int
    gap: float


class Hand:
    """A palm with fingers and the stroke that closes them.

    Attributes:
        links: The robot.
        palm: The link that carries the fingers.
        drive: Drives the actuators of the fingers.
        closing: What each of these actuators does.
        stroke: Poses from open to closed.
        tips: The last links of the fingers that move.
        pairs: Fingertips that close on each other; for a jaw, the jaw and the palm.
    """

    def __init__(
        self, links: Links, palm: int, branches: list[int], close: Sequence[int] = (), jaw: bool = False
    ) -> None:
        """Close the hand.

        Args:
            links: The robot.
            palm: The link that carries the fingers.
            branches: The first link of each finger.
            close: Ids of the actuators that close it; default: all that drive nothing else.
            jaw: The finger closes on the palm.
        """
        self.links, self.palm, self.is_jaw = links, palm, jaw
        self.members = {b: links.below(b) for b in branches}
        # on an arm, the origin of the palm's link may be an arm's length away
        self._root = common_body(links.model, branches)
        everything = set().union(*self.members.values())
        self.drive = Drive(links, links.dofs(everything), close)
        leaves = [k for k in sorted(everything & set(links.geoms)) if not self._carries(k)]
        self.closing: Closing = closing_of(links, self.drive, palm, leaves, sorted(everything & set(links.geoms)), jaw)
        self.stroke: Stroke = self.drive.stroke(self.closing.open_ctrl, self.closing.close_ctrl)
        self.moves = {
            k: self.stroke.world(k, -1, c) - self.stroke.world(k, 0, c) for k in leaves for c in [links.centre(k)]
        }
        self.tips = self._fingertips(leaves)
        self.pairs = self._jaw_pair() if jaw else self._pairs()

    def _carries(self, link: int) -> bool:
        return any(k != link and k in self.links.geoms for k in self.links.below(link))

    def finger(self, link: int) -> int:
        """Return the branch that a link belongs to; the palm belongs to none and is its own."""
        return next((branch for branch, members in self.members.items() if link in members), self.palm)

    def _fingertips(self, leaves: list[int]) -> list[int]:
        """Return the last links of all fingers that move; of a linkage, only the outer ones."""
        length = {k: float(np.linalg.norm(m)) for k, m in self.moves.items()}
        most = max(length.values(), default=0.0)
        self._upright: set[int] = set()
        if most < 1e-4:
            return []
        tips = [k for k in leaves if length[k] >= _MOVES * most or (k in self.closing.flexes and length[k] > 1e-4)]
        linkage = self.links.linkage
        reach = {t: self._reach(t) for t in tips}

        def inside(t: int, other: int) -> bool:
            same = float(self.moves[t] @ self.moves[other]) > _SAME_WAY * length[t] * length[other]
            return linkage[t] == linkage[other] and same and reach[t] < 0.9 * reach[other]

        # the outer tips of a linkage with several links are kept upright by it
        self._upright = {other for other in tips for t in tips if t != other and inside(t, other)}
        return [t for t in tips if not any(inside(t, other) for other in tips if other != t)]

    def _reach(self, link: int) -> float:
        """Return the largest distance of a link from the body that carries the fingers, when open."""
        return float(
            np.linalg.norm(
                self.stroke.world(link, 0, self.links.cloud(link)) - self.stroke.pos[0, self._root], axis=1
            ).max()
        )

    def _pairs(self) -> list[Pair]:
        """Return the pairs of fingertips that approach each other without moving in the same direction."""
        pairs = []
        for a, b in combinations(self.tips, 2):
            lengths = np.linalg.norm(self.moves[a]) * np.linalg.norm(self.moves[b])
            if self.finger(a) == self.finger(b) or float(self.moves[a] @ self.moves[b]) > _SAME_WAY * float(lengths):
                continue
            gaps = np.array([self._distance(a, b, f) for f in range(len(self.stroke.qpos))])
            closed = gaps[0] - gaps.min()
            if closed >= max(_CLOSES * gaps[0], 1e-3):
                frame = int(np.argmax(gaps <= gaps[0] - 0.9 * closed))
                pairs.append(Pair(a, b, frame, float(gaps[frame])))
        return pairs

    def _jaw_pair(self) -> list[Pair]:
        return [Pair(tip, self.palm, len(self.stroke.qpos) - 1, 0.0) for tip in self.tips[:1]]

    def _distance(self, a: int, b: int, frame: int) -> float:
        """Return the mean distance from a point of one link to the nearest point of the other, over both links."""
        one, two = (self.stroke.world(k, frame, self.links.cloud(k)) for k in (a, b))
        return float(KDTree(one).query(two)[0].mean() + KDTree(two).query(one)[0].mean()) / 2

    def motion(self, link: int, frame: int, point: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the direction in which a point of a fingertip moves when the hand closes, in the tip's frame.

        A finger that flexes moves its tip about the tip's own hinge. A jaw, a slide, or a linkage that keeps its tip
        upright moves it as a whole; then this is the mean direction up to `frame`.

        Args:
            link: The fingertip.
            frame: Pose up to which the hand closes.
            point: The point; default: the centre of the link.
        """
        point = self.links.centre(link) if point is None else point
        hinge = self.links.hinge(link)
        if hinge is not None and (turns := self._turns(link, hinge[1])):
            return unit(turns * np.cross(hinge[1], point - hinge[0]))
        path = np.stack([self.stroke.world(link, f, point) for f in range(max(frame, 1) + 1)])
        steps = np.einsum("fji,fj->fi", self.stroke.rot[: len(path) - 1, link], np.diff(path, axis=0))
        return unit(steps.sum(axis=0))

    def curls(self, link: int) -> bool:
        """Tell whether a fingertip bends with its finger, as in a hand, and does not close as a whole."""
        hinge = self.links.hinge(link)
        if link == self.palm or hinge is None or self.links.parent[link] == self.palm:
            return False
        return bool(self._turns(link, hinge[1]))

    def _turns(self, link: int, axis: NDArray[np.float64]) -> int:
        """Return the sense in which a tip flexes about its own hinge, or 0 if it does not flex with its finger."""
        if link in self.closing.flexes:
            return self.closing.flexes[link]
        if link in self._upright or not self._is_driven(link):
            return 0
        rot = self.stroke.rot
        whole = float(_rotation(rot[0, self.palm].T @ rot[0, link], rot[-1, self.palm].T @ rot[-1, link]) @ axis)
        parent = self.links.parent[link]
        own = float(_rotation(rot[0, parent].T @ rot[0, link], rot[-1, parent].T @ rot[-1, link]) @ axis)
        # a linkage that keeps its tip upright turns it about its own hinge, but hardly as a whole
        return int(np.sign(own)) if whole * np.sign(own) > 0.9 * abs(own) > 0.09 else 0

    def _is_driven(self, link: int) -> bool:
        """Tell whether an actuator moves the joints of a link, directly or through a coupling to another joint."""
        direct = bool(self.links.drives[:, self.links.dofs({link})].any())
        return direct or list(self.links.linkage.values()).count(self.links.linkage[link]) > 1

    def base(self, link: int) -> NDArray[np.float64]:
        """Return the base of a finger in the link's frame: its hinge, or else the origin of its palm."""
        if link == self.palm:  # a jaw's partner reaches from the jaw's hinge
            hinge = self.links.hinge(self.tips[0])
            if hinge is None:
                return np.zeros(3)
            return self.stroke.local(link, 0, self.stroke.world(self.tips[0], 0, hinge[0]))
        hinge = self.links.hinge(link)
        return self.links.local(link, self.links.data.xpos[self._root]) if hinge is None else hinge[0]

    def across_hinge(self, link: int, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `direction` without its component along the link's hinge, since a finger flexes across its hinge.

        A direction mostly along the hinge is returned unchanged.
        """
        hinge = self.links.hinge(link)
        if hinge is None:
            return direction
        across = direction - (direction @ hinge[1]) * hinge[1]
        return across if np.linalg.norm(across) > 0.7 * np.linalg.norm(direction) else direction


def fingers_on(links: Links, palm: int, taken: set[int]) -> list[int]:
    """Return the branches of `palm` that may be fingers: short, with few actuators, and without a hand of their own.

    Args:
        links: The robot.
        palm: The link whose branches are looked at.
        taken: Links of the hands that are known.
    """
    found = []
    for branch in links.children(palm):
        members = links.below(branch)
        dofs = links.dofs(members)
        if members & taken or not members & set(links.geoms) or not len(dofs):
            continue
        free = any(int(links.model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_FREE) for j in links.joints(branch))
        actuators = int(links.drives[:, dofs].any(axis=1).sum())
        if not free and actuators <= MAX_FINGER_ACTUATORS and _length(links, branch, members) <= MAX_FINGER_LENGTH:
            found.append(branch)
    return found


def _length(links: Links, branch: int, members: set[int]) -> float:
    """Return how far a branch reaches from its first body at rest."""
    geoms = [g for k in members for g in links.geoms.get(k, ())]
    apart = np.linalg.norm(links.data.geom_xpos[geoms] - links.data.xpos[branch], axis=1)
    return float((apart + links.model.geom_rbound[geoms]).max())


def closes_on(links: Links, palm: int, jaw: int) -> bool:
    """Tell whether a link with one joint can lie against the link that carries it, as a jaw does when it is closed."""
    model, data = links.model, mujoco.MjData(links.model)
    joints = links.joints(jaw)
    if jaw not in links.geoms or palm not in links.geoms or len(joints) != 1 or not model.jnt_limited[joints[0]]:
        return False
    dof = int(model.jnt_dofadr[joints[0]])
    if not links.drives[:, dof].any() or any(k in links.geoms for k in links.below(jaw) - {jaw}):
        return False
    anchor = links.local(jaw, links.data.xanchor[joints[0]])
    size = float(np.linalg.norm(links.outer(jaw) - anchor, axis=1).max())
    apart = []
    for end in model.jnt_range[joints[0]]:
        data.qpos[:] = links.data.qpos
        data.qpos[model.jnt_qposadr[joints[0]]] = end
        mujoco.mj_kinematics(model, data)
        apart.append(links.jaw_gap(jaw, palm, data.xpos, data.xmat.reshape(-1, 3, 3)))
    return min(apart) < _JAW_GAP * size and min(apart) < 0.5 * max(apart)


def _rotation(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation vector (rad) from one orientation to another, in the frame of the first."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(before.T @ after).as_rotvec()
