"""sensor_modules: where a sensor maker's own robot model puts its modules on a hand, as mounts and layouts.

Makers publish hands covered with sensors as URDF or xacro: a tree of links, on some of which sit modules whose taxels
are small links on a prismatic joint that can be pressed in. The hand is simulated from another file, an MJCF with other
names. Both are compared as trees of joints: each way to pair the branches is laid over the hand by the best rigid fit
of the joints' positions in the zero pose, and the one that fits is taken. Names decide nothing. Lengths in m.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, permutations, product
from pathlib import Path

import mujoco
import numpy as np
from lxml import etree
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models.gel import Gel
from paxisim.models.load import compile_whole, load_spec
from paxisim.models.mount import Mount
from paxisim.models.surfaces import planes, shape_of
from paxisim.models.xacro import read_robot

MAX_MISFIT = 5e-3
"""Largest root mean square distance of the two models' joints; sensor covers lengthen a finger by millimetres."""
MAX_TURN = 20.0
"""Largest angle (deg) between the axes of a joint in the two models."""
SAME_FRAME = 2.0
"""Largest angle (deg) by which a link's frame may differ from its body's if both models have the same frames."""
MAX_PAIRINGS = 50_000
"""Largest number of ways to pair the branches of two trees."""
_GRID_TOLERANCE = 2e-5
_Pose = tuple[NDArray[np.float64], NDArray[np.float64]]  # rotation (3, 3) and position (3,)


@dataclass(frozen=True, eq=False)
class SensorModule:
    """One sensor module of a hand.

    Attributes:
        name: Name of its link in the maker's model.
        mount: Where it goes on the simulated hand, under the name of the link.
        layout: Its taxels: a grid, or one row of positions and normals in the order of the maker's numbers.
    """

    name: str
    mount: Mount
    layout: TaxelLayout


@dataclass(eq=False)
class _Joint:
    """A joint of a tree in its zero pose; the first one of a tree stands for what the hand is fixed to."""

    part: str  # the link or body that it moves
    anchor: NDArray[np.float64]
    axis: NDArray[np.float64]
    children: list[_Joint] = field(default_factory=list)

    @property
    def shape(self) -> tuple:
        return tuple(sorted(child.shape for child in self.children))

    def all(self) -> Iterator[_Joint]:
        yield self
        for child in self.children:
            yield from child.all()


def sensor_modules(
    hand: mujoco.MjSpec | str | Path, model: str | Path, pairs: Mapping[str, str] | None = None
) -> tuple[SensorModule, ...]:
    """Return the sensor modules that a maker's robot model has on a hand, placed on the simulated hand.

    The positions come from the user's own copy of the model, such as XELA's ``xela_models``; paxisim has none of them.
    A module's frame has z into the finger, along the axis of its link that is nearest to the taxels' mean normal,
    and x along the link's x. A module replaces the collision geoms that reach into its gel (`Gel.thickness`), since
    they would carry load in its place.

    Example:
        ```python
        modules = paxisim.sensor_modules("right_hand.xml", "xela_models/urdf/allegro_hand_right_curved.xacro")
        tips = [module for module in modules if module.layout.taxels == 30]
        gripper = paxisim.attach("right_hand.xml", [tip.layout for tip in tips], [tip.mount for tip in tips])
        ```

    Args:
        hand: The hand in MuJoCo: a spec, an MJCF file or MJCF text. It may be on an arm.
        model: The maker's URDF or xacro file of the same hand, with its taxels.
        pairs: Links of `model` and the bodies of `hand` that they are, to decide between pairings that all fit.

    Returns:
        The modules, in the order of `model`.

    Raises:
        InvalidValueError: A file cannot be read, the model has no taxels, or the two hands do not fit each other or
            fit in several ways.
        UnknownNameError: `pairs` names a link or body that does not exist.
    """
    robot = _Robot(read_robot(model), str(model))
    compiled = compile_whole(load_spec(hand), "the hand")
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    root, owner = _joints_of(compiled, data)
    matched, rotation, shift = _fit(robot, root, dict(pairs or {}), compiled)
    found = []
    for name in robot.modules:
        theirs = robot.carrier[name]
        ours = matched[id(theirs)]
        position, turn, layout = _layout(robot, name)
        if theirs is robot.root:
            anchor = rotation @ theirs.anchor + shift
            link = robot.parent[theirs.children[0].part]
            body = int(compiled.body_parentid[compiled.body(matched[id(theirs.children[0])].part).id])
        else:  # a finger may be longer in one model than in the other, so each link is placed by its own joint
            anchor, link, body = ours.anchor, theirs.part, compiled.body(ours.part).id
        moved = rotation, anchor - rotation @ theirs.anchor
        moved = _of_frames(robot.pose[link], (data.xmat[body].reshape(3, 3), data.xpos[body]), moved)
        place = (moved[0] @ position + moved[1], moved[0] @ turn)
        group = [other for other in range(1, compiled.nbody) if owner[other] is ours]
        group.sort(key=lambda other: other != body)
        found.append(SensorModule(name, _mount(compiled, data, group, name, place, layout), layout))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Link:
    """A link of a URDF with the joint above it."""

    name: str
    parent: str
    kind: str
    xyz: NDArray[np.float64]
    rotation: NDArray[np.float64]
    axis: NDArray[np.float64]
    low: float
    high: float

    @property
    def slides(self) -> bool:
        return self.kind == "prismatic" and self.low < self.high


class _Robot:
    """A URDF in its zero pose: the tree of its joints, and the taxels of each module."""

    def __init__(self, robot: etree._Element, file: str) -> None:
        self.file = file
        links, below = self._read(robot)
        self.pose: dict[str, _Pose] = {}  # in the frame of the first link
        self.parent = {name: link.parent for name, link in links.items()}
        for name, link in links.items():
            turn, place = self.pose.get(link.parent, (np.eye(3), np.zeros(3)))
            self.pose[name] = (turn @ link.rotation, turn @ link.xyz + place)
        stalks: set[str] = set()  # links that move when a taxel is pressed
        self.modules: dict[str, list[tuple[str, NDArray[np.float64]]]] = {}  # taxels of a module, with outward normals
        for name, link in links.items():
            if link.slides and not below[name]:
                module = link
                while module.kind == "prismatic" and (module is link or len(below[module.name]) == 1):
                    stalks.add(module.name)
                    module = links[module.parent]
                outward = self.pose[name][0] @ link.axis * (1 if link.low < 0 else -1)
                self.modules.setdefault(module.name, []).append((name, outward))
        self.carrier: dict[str, _Joint] = {}  # the joint that moves each link
        for name, link in links.items():
            above = self.carrier.get(link.parent)
            if above is None or (name not in stalks and (link.kind in ("revolute", "continuous") or link.slides)):
                turn, place = self.pose[name]
                self.carrier[name] = _Joint(name, place, turn @ link.axis)
                if above is not None:
                    above.children.append(self.carrier[name])
            else:
                self.carrier[name] = above
        self.root = next(iter(self.carrier.values()))
        if not self.modules:
            raise InvalidValueError(
                f"{file} has no taxels, which are links on a prismatic joint that can be pressed in: XELA's models "
                'leave them out unless the macro of the hand is called with taxels="1"'
            )
        self.modules = {name: self._numbered(name) for name in self.modules}

    def _read(self, robot: etree._Element) -> tuple[dict[str, _Link], dict[str, list[str]]]:
        """Return the links, parents first, and the names of those below each."""
        below: dict[str, list[str]] = {link.get("name", ""): [] for link in robot.findall("link")}
        joined: dict[str, _Link] = {}
        for joint in robot.findall("joint"):
            parent, child = (self._get(joint, tag, "link", "") for tag in ("parent", "child"))
            if parent not in below or child not in below or child in joined:
                name = joint.get("name")
                raise InvalidValueError(f"joint {name!r} of {self.file} does not connect a link to a new one")
            xyz, rpy = (self._vector(joint, "origin", key, "0 0 0") for key in ("xyz", "rpy"))
            axis = self._vector(joint, "axis", "xyz", "1 0 0")
            axis /= max(float(np.linalg.norm(axis)), 1e-9)
            low, high = (float(self._vector(joint, "limit", key, "0", 1)[0]) for key in ("lower", "upper"))
            joined[child] = _Link(child, parent, joint.get("type", ""), xyz, _matrix(rpy), axis, low, high)
            below[parent].append(child)
        tops = [name for name in below if name not in joined]
        if len(tops) != 1:
            raise InvalidValueError(f"{self.file} must have one link without a parent, got {tops[:5]}")
        zero = np.zeros(3)
        links = {tops[0]: _Link(tops[0], "", "fixed", zero, np.eye(3), zero, 0.0, 0.0)}
        waiting = [tops[0]]
        while waiting:
            children = below[waiting.pop(0)]
            links.update((child, joined[child]) for child in children)
            waiting += children
        if len(links) < len(below):
            raise InvalidValueError(f"the joints of {self.file} form a loop")
        return links, below

    def _get(self, joint: etree._Element, tag: str, key: str, default: str) -> str:
        found = joint.find(tag)
        return default if found is None else found.get(key, default)

    def _vector(self, joint: etree._Element, tag: str, key: str, default: str, length: int = 3) -> NDArray[np.float64]:
        text = self._get(joint, tag, key, default)
        try:
            values = np.array([float(part) for part in text.split()])
        except ValueError:
            values = np.empty(0)
        if values.shape != (length,) or not np.all(np.isfinite(values)):
            raise InvalidValueError(f"{tag} {key} of joint {joint.get('name')!r} in {self.file} is {text!r:.80}")
        return values

    def _numbered(self, module: str) -> list[tuple[str, NDArray[np.float64]]]:
        """Return the taxels of a module by the last number in their names, which is the maker's order."""
        taxels = self.modules[module]
        numbers = [int((re.findall(r"\d+", name) or ["-1"])[-1]) for name, _ in taxels]
        if len(set(numbers)) < len(taxels):
            raise InvalidValueError(f"the taxels of {module} in {self.file} are not numbered: {taxels[0][0]!r}")
        return [taxels[i] for i in np.argsort(numbers)]


def _matrix(rpy: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", rpy).as_matrix()


def _joints_of(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[_Joint, list[_Joint]]:
    """Return the tree of a model's joints, and the joint that moves each body."""
    root = _Joint(model.body(0).name, np.zeros(3), np.zeros(3))
    owner = [root]
    for body in range(1, model.nbody):
        joint = owner[int(model.body_parentid[body])]
        for index in range(int(model.body_jntadr[body]), int(model.body_jntadr[body]) + int(model.body_jntnum[body])):
            if int(model.jnt_type[index]) == int(mujoco.mjtJoint.mjJNT_FREE):
                continue
            below = _Joint(model.body(body).name, data.xanchor[index].copy(), data.xaxis[index].copy())
            joint.children.append(below)
            joint = below
        owner.append(joint)
    return root, owner


def _pairings(theirs: _Joint, ours: _Joint) -> Iterator[list[tuple[_Joint, _Joint]]]:
    """Yield every way to pair two trees of the same shape, branch by branch."""
    for order in permutations(ours.children):
        both = list(zip(theirs.children, order, strict=True))
        if all(a.shape == b.shape for a, b in both):
            for parts in product(*(list(_pairings(a, b)) for a, b in both)):
                yield [(theirs, ours), *(pair for part in parts for pair in part)]


def _fit(
    robot: _Robot, root: _Joint, pairs: dict[str, str], model: mujoco.MjModel
) -> tuple[dict[int, _Joint], NDArray[np.float64], NDArray[np.float64]]:
    """Return our joint for each of theirs (by id), and the rotation and shift from their zero pose to ours."""
    for link, body in pairs.items():
        if link not in robot.carrier:
            raise UnknownNameError("link", link, robot.carrier)
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body) < 0:
            raise UnknownNameError("body", body, [model.body(i).name for i in range(1, model.nbody)])
    wanted = {id(robot.carrier[link]): body for link, body in pairs.items()}
    candidates = [joint for joint in root.all() if joint.children and joint.shape == robot.root.shape]
    if not robot.root.children or not candidates:
        raise InvalidValueError(
            f"no part of the hand has the joints of {robot.file}, which has {_describe(robot.root)}; the hand has "
            f"{_describe(root)}"
        )
    fits: list[tuple[float, dict[int, _Joint], NDArray[np.float64], NDArray[np.float64]]] = []
    nearest = np.inf
    for count, pairing in enumerate(chain.from_iterable(_pairings(robot.root, joint) for joint in candidates)):
        if count == MAX_PAIRINGS:
            raise InvalidValueError(f"there are more than {MAX_PAIRINGS} ways to pair the joints of {robot.file}")
        if any(b.part != wanted.get(id(a), b.part) for a, b in pairing):
            continue
        moved = pairing[1:]  # the first pair has no joint
        rotation, shift, misfit = _rigid(*(np.array([pair[i].anchor for pair in moved]) for i in (0, 1)))
        turns = np.abs([(rotation @ a.axis) @ b.axis for a, b in moved])
        nearest = min(nearest, misfit)
        if misfit <= MAX_MISFIT and turns.min() >= np.cos(np.radians(MAX_TURN)):
            fits.append((misfit, {id(a): b for a, b in pairing}, rotation, shift))
    if not fits:
        raise InvalidValueError(
            f"the joints of {robot.file} do not fit those of the hand in its zero pose: the best of the ways to pair "
            f"them leaves {1e3 * nearest:.1f} mm between them (at most {1e3 * MAX_MISFIT:g}) or turns their axes"
        )
    if len(fits) > 1:
        first, second = fits[0][1], fits[1][1]
        link = next(name for name, joint in robot.carrier.items() if first[id(joint)] is not second[id(joint)])
        bodies = " or ".join(fit[id(robot.carrier[link])].part for fit in (first, second))
        raise InvalidValueError(
            f"{robot.file} fits the hand in {len(fits)} ways: its link {link!r} may be {bodies}; say which (pairs in "
            "Python, --link LINK=BODY in the shell)"
        )
    return fits[0][1:]


def _of_frames(theirs: _Pose, ours: _Pose, fitted: _Pose) -> _Pose:
    """Return the rotation and shift between the frames of a link and of its body, if that is nearly the fitted one.

    Models of one hand mostly share these frames, which are then exact where the fit has the differences of all fingers.
    """
    rotation = ours[0] @ theirs[0].T
    shift = ours[1] - rotation @ theirs[1]
    angle = np.degrees(np.arccos(np.clip((np.trace(rotation @ fitted[0].T) - 1) / 2, -1, 1)))
    away = np.linalg.norm(ours[1] - fitted[0] @ theirs[1] - fitted[1])
    return (rotation, shift) if angle < SAME_FRAME and away < MAX_MISFIT else fitted


def _describe(root: _Joint) -> str:
    lengths = [sum(1 for _ in child.all()) for child in root.children]
    return f"branches of {', '.join(map(str, lengths))} joints" if lengths else "no joints"


def _rigid(
    theirs: NDArray[np.float64], ours: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return rotation, shift and root mean square misfit of the best rigid fit; infinite for points on a line."""
    middle, centre = theirs.mean(axis=0), ours.mean(axis=0)
    u, size, vt = np.linalg.svd((theirs - middle).T @ (ours - centre))
    sign = np.sign(np.linalg.det(u @ vt))
    rotation = (u * [1, 1, sign] @ vt).T
    misfit = float(np.sqrt(np.mean(np.sum(((theirs - middle) @ rotation.T - (ours - centre)) ** 2, axis=1))))
    on_a_line = size[1] < 1e-3 * size[0]
    return rotation, centre - rotation @ middle, np.inf if on_a_line else misfit


def _layout(robot: _Robot, module: str) -> tuple[NDArray[np.float64], NDArray[np.float64], TaxelLayout]:
    """Return position and rotation of a module's pad frame in the robot's frame, and its layout."""
    names, normals = zip(*robot.modules[module], strict=True)
    points, outward = np.array([robot.pose[name][1] for name in names]), np.array(normals)
    link = robot.pose[module][0]
    mean = link.T @ outward.mean(axis=0)
    along = int(np.abs(mean).argmax())
    z = -link[:, along] * np.sign(mean[along])
    x = link[:, 1 if along == 0 else 0]
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    points, outward = points @ turn, outward @ turn
    low, high = points.min(axis=0), points.max(axis=0)
    origin = np.append((low[:2] + high[:2]) / 2, low[2])
    points = points - origin
    return turn @ origin, turn, _grid(points, outward) or _scattered(points, outward)


def _grid(points: NDArray[np.float64], outward: NDArray[np.float64]) -> TaxelLayout | None:
    """Return the flat grid that the points are, or None."""
    x, y = (np.sort(points[:, axis]) for axis in (0, 1))
    cols, rows = (1 + int(np.sum(np.diff(values) > _GRID_TOLERANCE)) for values in (x, y))
    if rows * cols != len(points) or min(rows, cols) < 2 or outward[:, 2].max() > -1 + 1e-6:
        return None
    pitch = ((y[-1] - y[0]) / (rows - 1), (x[-1] - x[0]) / (cols - 1))
    layout = TaxelLayout(rows, cols, (round(pitch[0], 9), round(pitch[1], 9)))
    distance = np.linalg.norm(points[:, None] - layout.positions[None], axis=-1)
    order = distance.argmin(axis=1)
    if distance.min(axis=1).max() > _GRID_TOLERANCE or len(set(order.tolist())) < len(points):
        return None
    row_major = np.array_equal(order, np.arange(len(points)))
    return layout if row_major else replace(layout, vendor_order=tuple(order.tolist()))


def _scattered(points: NDArray[np.float64], outward: NDArray[np.float64]) -> TaxelLayout:
    """Return a layout of one row whose footprint is the median distance between nearest neighbours."""
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    pitch = float(np.median(distance.min(axis=1))) if len(points) > 1 else 4e-3
    return TaxelLayout(1, len(points), (pitch, pitch), points, outward)


def _mount(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    group: list[int],
    name: str,
    place: _Pose,
    layout: TaxelLayout,
) -> Mount:
    """Return a mount at a place in the world, on the first body of a group or that whose geoms reach into the gel."""
    position, turn = place
    backs = (layout.positions - Gel.thickness * layout.normals) @ turn.T + position
    reached: dict[int, list[int]] = {body: [] for body in group}
    for body in group:
        first = int(model.body_geomadr[body])
        for geom in range(first, first + int(model.body_geomnum[body])):
            shape = shape_of(model, geom) if model.geom_contype[geom] or model.geom_conaffinity[geom] else None
            if shape is not None and _any_inside(
                shape, (backs - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
            ):
                reached[body].append(geom)
    if not any(model.body(body).name for body in group):
        raise InvalidValueError(f"no body with a name could carry the module {name!r}: name the hand's bodies")
    body = max(group, key=lambda body: (len(reached[body]), bool(model.body(body).name)))
    replaces: list[str | int] = []
    for geom in (geom for geoms in reached.values() for geom in geoms):
        owner = int(model.geom_bodyid[geom])
        if label := model.geom(geom).name:
            replaces.append(label)
        elif owner == body:
            replaces.append(geom - int(model.body_geomadr[body]))
        else:
            warnings.warn(
                f"an unnamed geom of {model.body(owner).name!r} reaches into the gel of {name!r} and stays: name it, "
                "so that a mount can replace it",
                stacklevel=3,
            )
    axes = data.xmat[body].reshape(3, 3)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(axes.T @ turn).ravel())
    where = axes.T @ (position - data.xpos[body])
    return Mount(model.body(body).name, tuple(where.tolist()), tuple(quat.tolist()), tuple(replaces), name)


def _any_inside(shape: tuple[NDArray[np.float64], NDArray[np.int64]], points: NDArray[np.float64]) -> bool:
    """Tell whether any of ``(N, 3)`` points is inside a convex shape."""
    normals, offsets = planes(*shape)
    return bool(np.any(np.all(points @ normals.T <= offsets, axis=1)))
