"""compose_scene: one model of an arm, the hand on it, a table and objects, from the files of the arm and the hand.

MuJoCo attaches one spec to another, but loses on the way, or when it writes the result: the folders of meshes, masses
that a compiler's settings decide, materials of sites and tendons, keyframes, and defaults that an outer body hides.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path

import mujoco
import numpy as np
from lxml import etree
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models.grip import below
from paxisim.models.links import at_rest
from paxisim.models.load import compile_whole, load_spec, one_line
from paxisim.models.mjcf import format_mjcf, inertial
from paxisim.models.tabletop import add_object, add_table, check_point, parse_object, place_on_table

_OVERLAP = 1e-3  # m; deeper contacts at the start are mistakes
_SHOWN = 4  # names listed at most
_GROUND = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


@dataclass(frozen=True, eq=False)
class ComposedScene:
    """A scene, not yet compiled.

    Attributes:
        spec: Spec of the scene: give it to `attach`, edit it or compile it.
        prefix: Prefix of the hand's names in the scene; empty if they are those of its file.
        report: What is in the scene, and what differs from the files.
    """

    spec: mujoco.MjSpec
    prefix: str
    report: str

    def to_xml(self, folder: str | Path | None = None) -> str:
        """Return the scene as MJCF text.

        Args:
            folder: Folder where the text will be saved; paths of meshes and textures become relative to it.
                Default: absolute paths.

        Raises:
            InvalidValueError: MuJoCo cannot compile the scene.
        """
        return format_mjcf(self.spec, "the scene", folder)


def compose_scene(
    arm: mujoco.MjSpec | str | Path | None = None,
    hand: mujoco.MjSpec | str | Path | None = None,
    *,
    at: str = "",
    table: Sequence[float] | None = None,
    objects: Sequence[str] = (),
) -> ComposedScene:
    """Compose a scene of an arm, a hand on it, a table and objects.

    The hand is on a new body of the arm, ``hand_mount``. It keeps its masses, materials and defaults; a floor and
    lights of its file are left out. All names stay as they are in the files, but if the arm and the hand share one, all
    names of the hand get a prefix. The options are the arm's, except where the hand has a smaller time step, an
    integrator that is not Euler's, the elliptic cone or a larger ``impratio``.

    Each keyframe of the arm stays, with the hand at rest; if the arm has none, each of the hand's stays, with the arm
    at rest. Objects are where they start.

    Args:
        arm: A spec (left unchanged), the path of an MJCF or URDF file, or MJCF text. It may have a hand already.
        hand: The same for a hand or a gripper, with or without pads. Without an arm, it is where its file puts it.
        at: Name of the body or site of the arm that carries the hand.
        table: ``(x, y, z)`` of the middle of the table's top (m). The table is 0.6 m x 0.6 m.
        objects: ``box:AxBxCmm:MASSkg``, ``cylinder:DIAMETERxHEIGHTmm:MASSkg``, ``ball:DIAMETERmm:MASSkg`` or
            ``mesh:FILE:MASSkg``. They stand in a row on the table, or have their centre, for a mesh that of its
            bounding box, where ``@X,Y,Z`` (m) behind this text says.

    Returns:
        The scene, not compiled.

    Raises:
        InvalidValueError: A file cannot be read or compiled, the options contradict one another, an object cannot be
            parsed or placed, or it would be inside something.
        UnknownNameError: The arm has no such body or site.
        FileNotFoundError: The mesh of an object does not exist.
    """
    if not isinstance(at, str):
        raise InvalidValueError(f"at must be the name of a body or site, got {at!r:.80}")
    if isinstance(objects, str) or not isinstance(objects, Sequence):
        raise InvalidValueError(f"objects must be a list of texts, got {objects!r:.80}")
    wanted = [parse_object(text) for text in objects]
    top = None if table is None else check_point(table, f"{table!r:.80}")
    centres = place_on_table(wanted, top)
    spec, poses, prefix, lines = _robot(arm, hand, at)
    kinds = (spec.bodies, spec.geoms, spec.joints, spec.meshes)
    taken = {element.name for elements in kinds for element in elements}
    # what is added touches whatever else touches anything
    bits = int(np.bitwise_or.reduce([1, *(geom.contype | geom.conaffinity for geom in spec.geoms)]))
    added: list[str] = []
    if top is not None:
        added.append(_free_name("table", taken))
        add_table(spec, added[-1], top, bits)
        lines.append(f"{added[-1]}: its top at {_point(top)} m")
    for one, centre in zip(wanted, centres, strict=True):
        added.append(_free_name(one.name, taken | set(added)))
        add_object(spec, added[-1], one, centre, bits)
        lines.append(f"{added[-1]} ({one.text.partition('@')[0]}): its centre at {_point(centre)} m")
        if one.mesh is not None:
            lines.append(f"{added[-1]}: {one.mesh.report}")
    start = compile_whole(spec, "the scene").qpos0
    for name, pose in poses.items():
        qpos = [*pose.qpos, *start[len(pose.qpos) :]]
        spec.add_key(name=name, qpos=qpos, ctrl=pose.ctrl, act=pose.act, mpos=pose.mpos, mquat=pose.mquat)
    _check_start(compile_whole(spec, "the scene"), added)
    return ComposedScene(spec, prefix, "\n".join(lines))


@dataclass(frozen=True, eq=False)
class _Pose:
    """Positions, controls, activations, and the places of mocap bodies."""

    qpos: NDArray[np.float64]
    ctrl: NDArray[np.float64]
    act: NDArray[np.float64]
    mpos: NDArray[np.float64]
    mquat: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Part:
    """The file of an arm or a hand.

    Attributes:
        title: How messages call it.
        root: Its MJCF, with explicit inertias and absolute paths, and without keyframes.
        assets: Files that it has in memory.
        model: The model, with its keyframes.
    """

    title: str
    root: etree._Element
    assets: dict[str, bytes]
    model: mujoco.MjModel

    @property
    def rest(self) -> _Pose:
        data = at_rest(self.model)
        return _Pose(data.qpos, data.ctrl, data.act, data.mocap_pos.reshape(-1), data.mocap_quat.reshape(-1))

    @property
    def poses(self) -> dict[str, _Pose]:
        """The pose of each keyframe."""
        model, fields = self.model, ("qpos", "ctrl", "act", "mpos", "mquat")
        return {
            model.key(k).name or f"key{k}": _Pose(*(getattr(model, f"key_{field}")[k] for field in fields))
            for k in range(model.nkey)
        }

    @property
    def names(self) -> set[tuple[str, str]]:
        """Kind and name of everything that has a name."""
        found = set()
        for section in self.root:
            kinds = section.tag in ("default", "asset", "worldbody", "deformable")
            for element in section.iter(etree.Element):
                name = element.get("class" if element.tag == "default" else "name")
                kind = element.tag.replace("freejoint", "joint") if kinds else section.tag
                if name:
                    found.add((kind, name))
        return found

    def spec(self) -> mujoco.MjSpec:
        """Return a new spec of it."""
        return mujoco.MjSpec.from_string(etree.tostring(self.root, encoding="unicode"), assets=self.assets)


def _load(source: mujoco.MjSpec | str | Path, what: str) -> _Part:
    """Load an arm or a hand.

    Raises:
        InvalidValueError: It cannot be read or compiled.
    """
    loaded = load_spec(source)
    is_file = isinstance(source, Path) or (isinstance(source, str) and not source.lstrip().startswith("<"))
    title = Path(source).name if is_file else f"the {what}"  # type: ignore[arg-type]
    loaded.compiler.fusestatic = loaded.compiler.discardvisual = 0
    try:
        model = loaded.compile()  # a copy would leave out what refers to something that is not there
    except (ValueError, RuntimeError, MemoryError) as error:
        raise InvalidValueError(f"MuJoCo cannot compile {title}: {one_line(error)}") from error
    root, assets = etree.fromstring(format_mjcf(loaded, title)), dict(loaded.assets)
    for index, body in enumerate(root.find("worldbody").iter("body"), 1):  # type: ignore[union-attr]
        for other in body.findall("inertial"):
            body.remove(other)
        body.insert(0, inertial(model, index))
    for keyframe in root.findall("keyframe"):
        root.remove(keyframe)
    return _Part(title, root, assets, model)


def _robot(
    arm: mujoco.MjSpec | str | Path | None, hand: mujoco.MjSpec | str | Path | None, at: str
) -> tuple[mujoco.MjSpec, dict[str, _Pose], str, list[str]]:
    """Return the spec of an arm, a hand or both, without keyframes; its poses, the hand's prefix, and a report."""
    if at and (arm is None or hand is None):
        raise InvalidValueError("at (--at) is where the arm carries the hand: expected an arm and a hand with it")
    if arm is None and hand is None:
        raise InvalidValueError("there is nothing that could touch an object: expected an arm, a hand, or both")
    parts = [_load(source, what) for source, what in ((arm, "arm"), (hand, "hand")) if source is not None]
    if not parts[-1].model.ngeom:
        raise InvalidValueError(f"{parts[-1].title} has no geoms, so it could not touch an object")
    if len(parts) == 1:
        return parts[0].spec(), parts[0].poses, "", [f"robot: {parts[0].title}"]
    one, two = parts
    spec = one.spec()
    body, pos, quat = _flange(spec, one, at)
    prefix, shared = _prefix(one, two)
    taken = {name for _, name in one.names | two.names}
    mount, main = _free_name("hand_mount", taken), _free_name("hand_main", taken)
    attached = _attach(spec, two, body.add_body(name=mount, pos=pos, quat=quat), prefix, main)
    lines = [f"robot: {one.title} with {two.title} on {at}"]
    if shared:
        more = f" and {len(shared) - _SHOWN} more" if len(shared) > _SHOWN else ""
        lines.append(
            f"names of {two.title} begin with {prefix!r} in the scene, since both files have: "
            f"{', '.join(shared[:_SHOWN])}{more}"
        )
    lines += attached
    model = compile_whole(spec, f"{one.title} with {two.title}")
    bodies = below(model, model.body(mount).id)
    of_hand = np.repeat(bodies[model.jnt_bodyid], np.diff(np.append(model.jnt_qposadr, model.nq)))

    def together(first: _Pose, second: _Pose) -> _Pose:
        qpos = np.zeros(model.nq)
        qpos[~of_hand], qpos[of_hand] = first.qpos, second.qpos
        ctrl, act = np.append(first.ctrl, second.ctrl), np.append(first.act, second.act)
        return replace(first, qpos=qpos, ctrl=ctrl, act=act)  # a hand on an arm has no mocap bodies

    data = mujoco.MjData(model)
    data.qpos[:] = together(one.rest, two.rest).qpos
    mujoco.mj_forward(model, data)
    for contact in data.contact:
        inner, outer = sorted(model.geom_bodyid[contact.geom], key=lambda body: not bodies[body])
        if contact.dist < -_OVERLAP and bodies[inner] and not bodies[outer]:
            warnings.warn(
                f"{model.body(inner).name} of {two.title} is {-1e3 * contact.dist:.0f} mm inside "
                f"{model.body(outer).name} of {one.title}: check the place and the orientation of {at}",
                stacklevel=3,
            )
            break
    poses = {name: together(pose, two.rest) for name, pose in one.poses.items()}
    poses = poses or {name: together(one.rest, pose) for name, pose in two.poses.items()}
    return spec, poses, prefix, lines


def _flange(
    spec: mujoco.MjSpec, arm: _Part, at: str
) -> tuple[mujoco.MjsBody, NDArray[np.float64], NDArray[np.float64]]:
    """Return the body of an arm that carries the hand, and the hand's position and orientation on it.

    Raises:
        InvalidValueError: No place is named, or it is a body and a site.
        UnknownNameError: There is no such body or site.
    """
    bodies = {body.name: body for body in spec.bodies[1:] if body.name}
    sites = {site.name: site.parent for site in spec.sites if site.name}
    if not at:
        raise InvalidValueError(
            f"expected at (--at), the body or site of {arm.title} that carries the hand, one of: "
            f"{', '.join([*bodies, *sites])}"
        )
    known = {f"body:{name}" for name in bodies} | {f"site:{name}" for name in sites}
    chosen = [place for place in (f"body:{at}", f"site:{at}", at) if place in known]
    if not chosen:
        raise UnknownNameError(f"body or site of {arm.title}", at, [*bodies, *sites])
    if len(chosen) > 1:
        raise InvalidValueError(f"{arm.title} has a body and a site {at!r}: name one, {' or '.join(chosen)}")
    kind, _, name = chosen[0].partition(":")
    if kind == "body":
        return bodies[name], np.zeros(3), np.array([1.0, 0, 0, 0])
    site = arm.model.site(name)
    return sites[name], site.pos, site.quat


def _prefix(arm: _Part, hand: _Part) -> tuple[str, list[str]]:
    """Return a prefix with which no name of a hand is one of the arm's, and the names that they share without it."""
    theirs, own = arm.names, hand.names
    shared = [f"{kind} {name}" for kind, name in sorted(theirs & own)]
    if not shared:
        return "", []
    prefixes = (f"hand{n}_" for n in chain([""], count(2)))
    return next(p for p in prefixes if not any((kind, p + name) in theirs for kind, name in own)), shared


def _attach(spec: mujoco.MjSpec, hand: _Part, mount: mujoco.MjsBody, prefix: str, main: str) -> list[str]:
    """Attach a hand to a body, and return what a reader should know about it.

    Args:
        spec: Spec of the arm.
        hand: The hand.
        mount: Body of the arm's spec.
        prefix: Prefix of the hand's names.
        main: Name, without the prefix, of the hand's outermost default class.

    Raises:
        InvalidValueError: The hand moves freely.
    """
    lines = []
    dressed = hand.spec()
    materials = [[e.material for e in elements] for elements in (dressed.sites, dressed.tendons, dressed.skins)]
    bare = deepcopy(hand.root)
    for element in bare.iter("site", "spatial", "tendon", "skin"):
        element.attrib.pop("material", "")  # MuJoCo's prefixing would lose it
    own = replace(hand, root=bare).spec()
    for body in own.worldbody.bodies:
        if body.mocap or any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in body.joints):
            raise InvalidValueError(
                f"{body.name or 'a body'} of {hand.title} moves freely (a free joint or mocap), so no arm can carry "
                "it: give a file of the hand alone, fixed to the world"
            )
    ground = [geom for geom in own.worldbody.geoms if int(geom.type) in _GROUND]
    if ground:
        lines.append(f"the floor of {hand.title} is left out")
    for element in [*ground, *own.worldbody.lights]:
        own.delete(element)
    lines += _set_options(spec, own, hand.title)
    own.default.name = main  # a file cannot hold a class without a name
    mount.childclass = "main"
    tendons, skins = list(own.tendons), list(own.skins)
    spec.attach(own, prefix=prefix, frame=mount.add_frame())
    for elements, old in zip((mount.find_all("site"), tendons, skins), materials, strict=True):
        for element, material in zip(elements, old, strict=True):
            if material:
                element.material = prefix + material
    return lines


def _set_options(spec: mujoco.MjSpec, hand: mujoco.MjSpec, title: str) -> list[str]:
    """Give an arm's spec the options that grasping with the hand needs, and return a line about them."""
    own, other, changed = spec.option, hand.option, []
    if other.timestep < own.timestep:
        own.timestep = other.timestep
        changed.append(f"time step {1e3 * own.timestep:g} ms")
    if int(own.integrator) == int(mujoco.mjtIntegrator.mjINT_EULER) != int(other.integrator):
        own.integrator = other.integrator
        changed.append("integrator")
    if other.cone > own.cone:
        own.cone = other.cone
        changed.append("elliptic cone")
    if other.impratio > own.impratio:
        own.impratio = other.impratio
        changed.append(f"impratio {own.impratio:g}")
    return [f"options as in {title}: {', '.join(changed)}"] if changed else []


def _point(point: Sequence[float]) -> str:
    return ", ".join(f"{round(value, 4) + 0.0:g}" for value in point)


def _free_name(name: str, taken: Collection[str]) -> str:
    return next(free for free in chain([name], (f"{name}{n}" for n in count(2))) if free not in taken)


def _check_start(model: mujoco.MjModel, added: Sequence[str]) -> None:
    """Check where the table and the objects are at the start.

    Raises:
        InvalidValueError: One of them is inside something.
    """
    data = at_rest(model)
    for contact in data.contact:
        one, two = (model.body(model.geom_bodyid[geom]).name for geom in contact.geom)
        if contact.dist < -_OVERLAP and {one, two} & set(added):
            raise InvalidValueError(
                f"{one} and {two} would overlap by {-1e3 * contact.dist:.0f} mm at the start: move the table, or give "
                "the object's centre as @X,Y,Z"
            )
    hit = np.zeros(1, dtype=np.int32)
    for name in added:
        body = model.body(name).id
        if model.body_jntnum[body] and mujoco.mj_ray(model, data, data.xpos[body], [0, 0, -1], None, 1, body, hit) < 0:
            warnings.warn(f"nothing is below {name}, so it falls", stacklevel=3)
