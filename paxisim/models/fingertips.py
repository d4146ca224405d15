"""Fingertips: find the links of a closing gripper that would hold an object, and the pairs that oppose each other.

A link is a body with the bodies welded to it. Points and directions are in the frame of their link unless stated
otherwise; lengths in m. The argument ``frame`` is the index of a pose of the stroke, counted from open.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from paxisim.errors import InvalidValueError
from paxisim.models.closing import Stroke, ancestors, links_of
from paxisim.models.faces import Surface, surface_of

_MOVES = 0.25  # a fingertip moves at least this share of the largest motion of any link
_CLOSES = 0.1  # two fingertips oppose if their mean distance shrinks by at least this share
_SAME_WAY = 0.5  # two links move in the same direction above this cosine


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


class Fingers:
    """A gripper with its stroke: positions and motions of its links, and which links are fingertips."""

    def __init__(self, model: mujoco.MjModel, stroke: Stroke) -> None:
        """Compute the motion of the links.

        Args:
            model: Compiled model of the gripper.
            stroke: Result of `close_gripper`.
        """
        self.model, self.stroke = model, stroke
        self.data = mujoco.MjData(model)
        self.data.qpos[:] = stroke.qpos[0]
        mujoco.mj_kinematics(model, self.data)
        self.links = links_of(model)
        self._surfaces: dict[int, Surface] = {}
        self.centre = {k: self.local(k, 0, self.data.geom_xpos[list(g)].mean(axis=0)) for k, g in self.links.items()}
        self.moves = {k: self.world(k, -1, c) - self.world(k, 0, c) for k, c in self.centre.items()}

    def world(self, link: int, frame: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points of a link to the world frame at a pose."""
        return point @ self.stroke.rot[frame, link].T + self.stroke.pos[frame, link]

    def local(self, link: int, frame: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform world points to the frame of a link at a pose."""
        return (point - self.stroke.pos[frame, link]) @ self.stroke.rot[frame, link]

    def surface(self, link: int) -> Surface:
        """Return the collision surface of a link; computed once."""
        if link not in self._surfaces:
            cells = 80 if link else 150
            self._surfaces[link] = surface_of(self.model, self.data, self.links[link], link, cells)
        return self._surfaces[link]

    def cloud(self, link: int, count: int = 600) -> NDArray[np.float64]:
        """Return about `count` points spread over the surface of a link."""
        points = self.surface(link).points
        return points[:: max(1, len(points) // count)]

    def name(self, link: int) -> str:
        """Return the name of a link: that of its body with the most collision geoms."""
        bodies = [int(self.model.geom_bodyid[g]) for g in self.links[link]]
        return self.body_name(max(bodies, key=bodies.count))

    def body_name(self, body: int) -> str:
        """Return the name of a body, or its number if it has none."""
        return self.model.body(body).name or f"body {body}"

    def fingertips(self) -> list[int]:
        """Return the last links of all chains that move when the gripper closes; of a linkage, only the outer ones."""
        inner = {a for link in self.links for a in ancestors(self.model, link)}
        length = {k: float(np.linalg.norm(m)) for k, m in self.moves.items()}
        most = max(length.values())
        if most < 1e-4:
            raise InvalidValueError(
                f"driving the actuators ({self.stroke.summary}) moves nothing that can touch: give its mounts by hand"
            )
        tips = [k for k in self.links if k and k not in inner and length[k] >= _MOVES * most]
        linkage = _linkages(self.model)
        reach = {t: self._reach(t) for t in tips}

        def inside(t: int, other: int) -> bool:
            same = float(self.moves[t] @ self.moves[other]) > _SAME_WAY * length[t] * length[other]
            return linkage[t] == linkage[other] and same and reach[t] < 0.9 * reach[other]

        return [t for t in tips if not any(inside(t, other) for other in tips if other != t)]

    def _reach(self, link: int) -> float:
        """Return the largest distance of a link from the gripper's first body, when open."""
        return float(np.linalg.norm(self.world(link, 0, self.cloud(link)) - self._root(link), axis=1).max())

    def _root(self, link: int) -> NDArray[np.float64]:
        return self.stroke.pos[0, int(self.model.body_rootid[link])]

    def pairs(self, tips: list[int]) -> list[Pair]:
        """Return the pairs of fingertips that approach each other without moving in the same direction."""
        pairs = []
        for i, a in enumerate(tips):
            for b in tips[i + 1 :]:
                lengths = np.linalg.norm(self.moves[a]) * np.linalg.norm(self.moves[b])
                if float(self.moves[a] @ self.moves[b]) > _SAME_WAY * float(lengths):
                    continue
                gaps = np.array([self._distance(a, b, f) for f in range(len(self.stroke.qpos))])
                closed = gaps[0] - gaps.min()
                if closed >= max(_CLOSES * gaps[0], 1e-3):
                    frame = int(np.argmax(gaps <= gaps[0] - 0.9 * closed))
                    pairs.append(Pair(a, b, frame, float(gaps[frame])))
        return pairs

    def _distance(self, a: int, b: int, frame: int) -> float:
        """Return the mean distance from a point of one link to the nearest point of the other, over both links."""
        one, two = self.world(a, frame, self.cloud(a)), self.world(b, frame, self.cloud(b))
        return float(KDTree(one).query(two)[0].mean() + KDTree(two).query(one)[0].mean()) / 2

    def motion(self, link: int, frame: int) -> NDArray[np.float64]:
        """Return the mean direction of motion of a link up to `frame`, in its own frame."""
        path = np.stack([self.world(link, f, self.centre[link]) for f in range(max(frame, 1) + 1)])
        steps = np.einsum("fji,fj->fi", self.stroke.rot[: len(path) - 1, link], np.diff(path, axis=0))
        return unit(steps.sum(axis=0))

    def _hinge(self, link: int) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return anchor and axis of the link's own hinge in its frame, or None if it has no hinge."""
        model = self.model
        for joint in range(model.njnt):
            hinge = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)
            if hinge and int(model.body_weldid[model.jnt_bodyid[joint]]) == link != 0:
                axis = self.data.xaxis[joint] @ self.stroke.rot[0, link]
                return self.local(link, 0, self.data.xanchor[joint]), axis
        return None

    def base(self, link: int) -> NDArray[np.float64]:
        """Return the base of a finger in the link's frame: its hinge, or else the gripper's first body."""
        hinge = self._hinge(link)
        return self.local(link, 0, self._root(link)) if hinge is None else hinge[0]

    def across_hinge(self, link: int, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `direction` without its component along the link's hinge, since a finger flexes across its hinge.

        A direction mostly along the hinge is returned unchanged.
        """
        hinge = self._hinge(link)
        if hinge is None:
            return direction
        across = direction - (direction @ hinge[1]) * hinge[1]
        return across if np.linalg.norm(across) > 0.7 * np.linalg.norm(direction) else direction


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale a vector to unit length; zero stays zero."""
    return vector / max(float(np.linalg.norm(vector)), 1e-12)


def _linkages(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return a label for the link of each body, ``(nbody,)``; links coupled by tendons or equalities share one."""
    label = np.arange(model.nbody)

    def join(bodies: list[int]) -> None:
        old = {int(label[model.body_weldid[b]]) for b in bodies} - {0}
        if old:
            label[np.isin(label, list(old))] = min(old)

    joint = int(mujoco.mjtWrap.mjWRAP_JOINT)
    for t in range(model.ntendon):
        wraps = range(int(model.tendon_adr[t]), int(model.tendon_adr[t] + model.tendon_num[t]))
        join([int(model.jnt_bodyid[model.wrap_objid[w]]) for w in wraps if int(model.wrap_type[w]) == joint])
    for e in range(model.neq):
        kind, ids = int(model.eq_objtype[e]), (int(model.eq_obj1id[e]), int(model.eq_obj2id[e]))
        if kind == int(mujoco.mjtObj.mjOBJ_JOINT):
            join([int(model.jnt_bodyid[i]) for i in ids if i >= 0])
        elif kind == int(mujoco.mjtObj.mjOBJ_BODY):
            join([i for i in ids if i >= 0])
        elif kind == int(mujoco.mjtObj.mjOBJ_SITE):
            join([int(model.site_bodyid[i]) for i in ids if i >= 0])
    return label[model.body_weldid]
