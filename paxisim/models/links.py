"""Links: the rigid parts of a robot, which of them its actuators move, and how they branch into arms and fingers.

A link is a body together with the bodies welded to it. Its id is that of its first body; the links that cannot move are
one per robot, and link 0 is the world. Objects that stand beside the robot, in trees without an actuator, are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from paxisim.models.surfaces import Surface, surface_of

_OUTER = 0.6  # the outer part of a jaw begins at this share of its reach
_HOME = "home"  # usual name of the keyframe in which a robot rests


class Links:
    """The links of a compiled robot at rest: in its keyframe ``home``, else its first keyframe, else ``qpos0``.

    Attributes:
        model: The robot.
        data: Its rest pose, with kinematics computed and controls that hold it.
        geoms: Ids of the collision geoms of each link that has any.
        of_body: ``(nbody,)`` link of each body.
        drives: ``(nu, nv)`` True where an actuator acts on a degree of freedom.
    """

    def __init__(self, model: mujoco.MjModel, named: Iterable[str] = ()) -> None:
        """Sort the bodies into links.

        Args:
            model: The compiled robot, possibly with objects beside it.
            named: Names of bodies that belong to the robot, even if no actuator moves anything in their trees.
        """
        self.model = model
        self.data = at_rest(model)
        weld, root = np.array(model.body_weldid), np.array(model.body_rootid)
        self.of_body = np.where(weld > 0, weld, root).astype(np.int64)
        self.drives = np.abs(moments(model, self.data)) > 1e-9
        moved = model.dof_bodyid[self.drives.any(axis=0)]
        robots = set((root[moved] if len(moved) else root).tolist())
        robots |= {int(root[body]) for body in range(model.nbody) if model.body(body).name in set(named)}
        self.geoms: dict[int, tuple[int, ...]] = {}
        collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        for link in np.unique(self.of_body[model.geom_bodyid[collides]]):
            if int(root[link]) in robots or link == 0:
                own = collides & (self.of_body[model.geom_bodyid] == link)
                self.geoms[int(link)] = tuple(np.flatnonzero(own).tolist())
        self._surfaces: dict[int, Surface] = {}

    @cached_property
    def parent(self) -> dict[int, int]:
        """The link that carries each link."""
        model = self.model
        return {int(k): int(self.of_body[model.body_parentid[k]]) if k else 0 for k in np.unique(self.of_body)}

    def ancestors(self, link: int) -> tuple[int, ...]:
        """Return the links between `link` and the world, nearest first, including the world (0)."""
        chain: list[int] = []
        while link:
            link = self.parent[link]
            chain.append(link)
        return tuple(chain)

    def below(self, link: int) -> set[int]:
        """Return the links that `link` carries, directly or not, and itself."""
        return {k for k in self.parent if k == link or link in self.ancestors(k)}

    def children(self, link: int) -> list[int]:
        """Return the links that `link` carries directly."""
        return [k for k, parent in self.parent.items() if parent == link != k]

    def dofs(self, links: set[int]) -> NDArray[np.int64]:
        """Return the degrees of freedom between `links` and the links that carry them."""
        return np.flatnonzero(np.isin(self.of_body[self.model.dof_bodyid], list(links)))

    @cached_property
    def linkage(self) -> dict[int, int]:
        """A label for each link; links coupled by tendons or equalities share one."""
        model = self.model
        label = {k: k for k in self.parent}

        def join(bodies: list[int]) -> None:
            old = {label[int(self.of_body[b])] for b in bodies if model.body_weldid[b]}
            if old:
                label.update({k: min(old) for k, own in label.items() if own in old})

        joint = int(mujoco.mjtWrap.mjWRAP_JOINT)
        of_tendon = []
        for t in range(model.ntendon):
            wraps = range(int(model.tendon_adr[t]), int(model.tendon_adr[t] + model.tendon_num[t]))
            of_tendon.append(
                [int(model.jnt_bodyid[model.wrap_objid[w]]) for w in wraps if int(model.wrap_type[w]) == joint]
            )
            join(of_tendon[-1])
        kinds, site = mujoco.mjtEq, int(mujoco.mjtObj.mjOBJ_SITE)
        for e in range(model.neq):
            kind, ids = int(model.eq_type[e]), [int(i) for i in (model.eq_obj1id[e], model.eq_obj2id[e]) if i >= 0]
            if kind == int(kinds.mjEQ_JOINT):
                join([int(model.jnt_bodyid[i]) for i in ids])
            elif kind == int(kinds.mjEQ_TENDON):
                join([body for i in ids for body in of_tendon[i]])
            elif kind in (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)):
                join([int(model.site_bodyid[i]) if int(model.eq_objtype[e]) == site else i for i in ids])
        return label

    def joints(self, link: int) -> list[int]:
        """Return the joints that move `link` on the link that carries it."""
        return np.flatnonzero(self.of_body[self.model.jnt_bodyid] == link).tolist()

    def surface(self, link: int) -> Surface:
        """Return the collision surface of a link in its frame; computed once."""
        if link not in self._surfaces:
            self._surfaces[link] = surface_of(self.model, self.data, self.geoms[link], link)
        return self._surfaces[link]

    def cloud(self, link: int, count: int = 600) -> NDArray[np.float64]:
        """Return about `count` points spread over the surface of a link, in its frame."""
        points = self.surface(link).points
        return points[:: max(1, len(points) // count)]

    def hinge(self, link: int) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return anchor and axis of the link's last hinge in its frame, or None if it has no hinge."""
        for joint in reversed(self.joints(link)):
            if int(self.model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE):
                axis = self.data.xaxis[joint] @ self.data.xmat[link].reshape(3, 3)
                return self.local(link, self.data.xanchor[joint]), axis
        return None

    def is_outer(self, link: int, points: NDArray[np.float64], hinge: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which points lie further from a hinge than `_OUTER` of the reach of the link."""
        reach = np.linalg.norm(self.surface(link).points - hinge, axis=1).max()
        return np.linalg.norm(points - hinge, axis=1) > _OUTER * reach

    def outer(self, link: int) -> NDArray[np.float64]:
        """Return the points of `cloud` on the outer part of a link that has a hinge; all if it has none."""
        points, hinge = self.cloud(link), self.hinge(link)
        return points if hinge is None else points[self.is_outer(link, points, hinge[0])]

    def jaw_gap(self, jaw: int, palm: int, pos: NDArray[np.float64], rot: NDArray[np.float64]) -> float:
        """Return the mean distance of the outer part of a jaw from its palm, with the bodies at ``pos`` and ``rot``."""
        world = self.outer(jaw) @ rot[jaw].T + pos[jaw]
        return float(KDTree(self.cloud(palm)).query((world - pos[palm]) @ rot[palm])[0].mean())

    def centre(self, link: int) -> NDArray[np.float64]:
        """Return the mean position of a link's collision geoms in its frame."""
        return self.local(link, self.data.geom_xpos[list(self.geoms[link])].mean(axis=0))

    def local(self, link: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform world points at rest to the frame of a link."""
        return (point - self.data.xpos[link]) @ self.data.xmat[link].reshape(3, 3)

    def name(self, link: int) -> str:
        """Return the name of a link: that of its body with the most collision geoms."""
        bodies = [int(self.model.geom_bodyid[g]) for g in self.geoms.get(link, ())]
        return self.body_name(max(bodies, key=bodies.count) if bodies else link)

    def body_name(self, body: int) -> str:
        """Return the name of a body, or its number if it has none."""
        return self.model.body(body).name or f"body {body}"

    def names(self, links: Sequence[int]) -> str:
        """Return the names of links as a list in a sentence."""
        return ", ".join(self.name(link) for link in links)


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """Return a model's rest pose: its keyframe ``home``, else its first keyframe, else ``qpos0``."""
    data = mujoco.MjData(model)
    if model.nkey:
        names = [model.key(k).name for k in range(model.nkey)]
        mujoco.mj_resetDataKeyframe(model, data, names.index(_HOME) if _HOME in names else 0)
    mujoco.mj_forward(model, data)
    return data


def moments(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    """Return the generalised force of one unit of each actuator's force, ``(nu, nv)``."""
    moment = np.zeros((model.nu, model.nv))
    if model.nu:
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind.reshape(-1)
        )
    return moment


def bodies_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the bodies between a body and the world, nearest first, without the world."""
    found = []
    while body := int(model.body_parentid[body]):
        found.append(body)
    return found


def common_body(model: mujoco.MjModel, bodies: Iterable[int]) -> int:
    """Return the lowest body that carries all of some bodies; the world (0) if there are none."""
    chains = [[*bodies_above(model, body), 0] for body in bodies]
    return next(body for body in chains[0] if all(body in chain for chain in chains)) if chains else 0
