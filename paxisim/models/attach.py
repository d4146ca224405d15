"""Attach: put pads on a gripper and keep everything the gripper already has."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from lxml import etree

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models import names
from paxisim.models.gel import Gel
from paxisim.models.load import compile_spec, compile_whole, load_spec, one_line
from paxisim.models.mjcf import numbers
from paxisim.models.mount import Mount, replaced_in_spec
from paxisim.models.pad import Pad
from paxisim.models.pads import Pads, find_pads
from paxisim.sensors import sensor as find_sensor


@dataclass(frozen=True, eq=False)
class TactileGripper:
    """A gripper with pads, not yet compiled.

    Attributes:
        spec: Spec of the gripper with its pads; attach it to an arm, edit it or compile it.
        mounts: Mounts of the pads, in the order of the ``pads`` axis, which is the order of the pads' bodies.
        pad_names: Names of the pads in `spec`.
        gel: Gel that `bind` gives to the pads.
        layout: Taxels of each pad.
        report: How the mounts were chosen; empty if the caller gave them.
    """

    spec: mujoco.MjSpec
    mounts: tuple[Mount, ...]
    pad_names: tuple[str, ...]
    gel: Gel
    layout: TaxelLayout
    report: str = ""

    def compile(self) -> mujoco.MjModel:
        """Compile the gripper by itself.

        Raises:
            InvalidValueError: MuJoCo cannot compile it.
        """
        return compile_spec(self.spec, "the gripper with pads")

    def bind(self, model: mujoco.MjModel, prefix: str = "") -> Pads:
        """Find this gripper's pads in a compiled model and give them their gel.

        A warning names what would take the gel or the load away from the pads: the override flag, explicit contact
        pairs, taxels without friction, and objects whose contact bits (contype, conaffinity) let them pass through.

        Args:
            model: Model compiled from `spec`, or from an arm to which `spec` was attached. The contact parameters of
                its taxels are set (`Gel.apply`).
            prefix: Prefix that attaching put in front of the gripper's names.

        Returns:
            Handle of the pads, in the order of `mounts`.

        Raises:
            InvalidValueError: The model does not have these pads.
        """
        pads = find_pads(model, names=[prefix + name for name in self.pad_names])
        self.gel.apply(model, pads)
        # a compiled model does not store the vendor order
        order = self.layout.vendor_order
        return replace(pads, layouts=tuple(replace(layout, vendor_order=order) for layout in pads.layouts))

    def to_xml(self, folder: str | Path | None = None) -> str:
        """Return the gripper as MJCF text.

        Args:
            folder: Folder where the text will be saved; paths of meshes and textures become relative to it.
                Default: absolute paths.

        Raises:
            InvalidValueError: MuJoCo cannot compile the gripper.
        """
        spec = self.spec.copy()
        source = Path(spec.modelfiledir or ".").resolve()
        directories = {name: source / getattr(spec, name) for name in ("meshdir", "texturedir")}
        for name, directory in directories.items():
            setattr(spec, name, str(directory))
        try:
            model = spec.compile()
        except ValueError as error:
            raise InvalidValueError(f"MuJoCo cannot compile the gripper with pads: {one_line(error)}") from error
        root = etree.fromstring(spec.to_xml())
        _write_inertia(root, model)
        has_files = spec.meshes or spec.textures or spec.hfields or spec.skins
        for compiler in root.iter("compiler"):
            for name, directory in directories.items():
                compiler.attrib.pop(name, "")
                if has_files:
                    relative = folder is not None
                    compiler.set(
                        name, os.path.relpath(directory, Path(folder).resolve()) if relative else str(directory)
                    )
        return etree.tostring(root, pretty_print=True, encoding="unicode")


def attach(
    gripper: mujoco.MjSpec | str | Path,
    sensor: Pad | TaxelLayout | str,
    mounts: Iterable[Mount] | None = None,
) -> TactileGripper:
    """Put tactile pads on a gripper, an arm or a hand.

    The gripper keeps every name, actuator, sensor, default, tendon, equality and keyframe. Each pad becomes a child
    body of its mount's body, with its own mass. The collision geoms that a pad replaces are switched off, and explicit
    contact pairs that name them are removed. The pad takes over their contact bits, except those with which pads would
    collide with each other, and the contact exclusions of its body.

    MuJoCo's touch sensors count the contacts of one body, not those of a pad on it. They stay, but a warning names
    those on a body that gets a pad. Implausible mounts also give a warning: pads inside one another, larger than their
    finger, far from it, curved on a flat finger, or behind or level with geoms that take their load and that `replaces`
    should name.

    Args:
        gripper: A spec (left unchanged), an MJCF file or MJCF text.
        sensor: Pad to build, a layout, or the name of a sensor in the catalogue.
        mounts: Mounts of the pads, in any order; the pads are ordered by their bodies. Default: the known mounts if
            `gripper` is a file that robosuite ships, else the mounts that `find_mounts` proposes. The attribute
            `report` of the result says which.

    Returns:
        The gripper with its pads, not compiled: call ``result.compile()`` and then ``result.bind(model)``.

    Raises:
        InvalidValueError: The gripper cannot be parsed, no mount was given or found, or two pads share a name.
        UnknownNameError: The sensor is unknown, or a mount names a body or geom that the gripper does not have.
    """
    spec = load_spec(gripper)
    pad = _as_pad(sensor)
    report = ""
    if mounts is None:
        from paxisim.models.find_mounts import choose_mounts

        is_file = isinstance(gripper, Path) or (isinstance(gripper, str) and not gripper.lstrip().startswith("<"))
        mounts, report = choose_mounts(spec, str(gripper) if is_file else "")
    chosen = (mounts,) if isinstance(mounts, Mount) else tuple(mounts)
    for mount in chosen:
        if not isinstance(mount, Mount):
            raise InvalidValueError(f"mounts must be paxisim.Mount, got {mount!r:.80}")
    if not chosen:
        raise InvalidValueError("expected at least one mount, got none")
    bodies = {body.name: body for body in spec.bodies}
    replaced = []
    for mount in chosen:
        if mount.body not in bodies:
            raise UnknownNameError("body", mount.body, [name for name in bodies if name])
        replaced += replaced_in_spec(spec, mount)
    if pad.contype == Pad.contype and pad.conaffinity == Pad.conaffinity:
        pad = replace(pad, **_bits(replaced))
    pad_names = tuple(f"{mount.name}_{pad.name}" for mount in chosen)
    taken = [name for name in pad_names if name in bodies or pad_names.count(name) > 1]
    if taken:
        raise InvalidValueError(f"there would be two bodies named {taken[0]!r}: give each mount its own name")
    _warn_of_touch(spec, {mount.body for mount in chosen} | {geom.parent.name for geom in replaced})
    child = pad.to_xml()
    _switch_off(spec, replaced)
    for mount in chosen:
        frame = bodies[mount.body].add_frame(pos=mount.pos, quat=mount.quat)
        frame.attach_body(mujoco.MjSpec.from_string(child).body(pad.name), f"{mount.name}_", "")
    _inherit_exclusions(spec, dict(zip(pad_names, (mount.body for mount in chosen), strict=True)))
    model = compile_spec(spec, "the gripper with pads")
    # `bind` and `find_pads` in a saved file must use the same order, or a policy could get its pads swapped
    order = sorted(range(len(chosen)), key=lambda i: model.body(pad_names[i]).id)
    mounts, pad_names = tuple(chosen[i] for i in order), tuple(pad_names[i] for i in order)
    _warn_of_mounts(spec, pad_names, mounts)
    return TactileGripper(spec, mounts, pad_names, pad.gel, pad.layout, report)


def _warn_of_mounts(spec: mujoco.MjSpec, pad_names: tuple[str, ...], mounts: tuple[Mount, ...]) -> None:
    from paxisim.models.mount_checks import doubts

    model = compile_whole(spec, "the gripper with pads")
    for doubt in doubts(model, find_pads(model, names=pad_names), mounts):
        warnings.warn(doubt, stacklevel=3)


def _as_pad(sensor: Pad | TaxelLayout | str) -> Pad:
    if isinstance(sensor, Pad):
        return sensor
    if isinstance(sensor, TaxelLayout):
        return Pad(sensor)
    if not isinstance(sensor, str):
        raise InvalidValueError(f"expected a Pad, a TaxelLayout or the name of a sensor, got {type(sensor).__name__}")
    product = find_sensor(sensor)
    return Pad(product.layout, mass=product.mass)


def _bits(replaced: list[mujoco.MjsGeom]) -> dict[str, int]:
    """Return contact bits with which the pads collide like the replaced geoms, but not with each other."""
    conaffinity = int(np.bitwise_or.reduce([0, *(geom.conaffinity for geom in replaced)]))
    contype = int(np.bitwise_or.reduce([0, *(geom.contype for geom in replaced)])) & ~conaffinity
    if contype == conaffinity == 0:
        return {"contype": Pad.contype, "conaffinity": Pad.conaffinity}
    return {"contype": contype, "conaffinity": conaffinity}


def _switch_off(spec: mujoco.MjSpec, geoms: list[mujoco.MjsGeom]) -> None:
    for geom in geoms:
        geom.contype = geom.conaffinity = 0
    # contact bits do not affect explicit pairs
    switched_off = {geom.name for geom in geoms if geom.name}
    for pair in list(spec.pairs):
        if switched_off & {pair.geomname1, pair.geomname2}:
            spec.delete(pair)


def _warn_of_touch(spec: mujoco.MjSpec, bodies: set[str]) -> None:
    for sensor in spec.sensors:
        if int(sensor.type) != int(mujoco.mjtSensor.mjSENS_TOUCH):
            continue
        site = spec.site(sensor.objname)
        if site is not None and site.parent.name in bodies - {""}:
            warnings.warn(
                f"the touch sensor {sensor.name!r} on {site.parent.name!r} does not count contacts of the pad there: "
                "read the pad with paxisim.TactileReadout",
                stacklevel=3,
            )


def _write_inertia(root: etree._Element, model: mujoco.MjModel) -> None:
    """Write the inertia of each pad; MuJoCo before 4.0 omits it if the gripper has inertiafromgeom="true"."""
    for body in root.iter("body"):
        name = body.get("name", "")
        is_pad = any(site.get("name") == names.gel(name) for site in body.findall("site"))
        if is_pad and body.find("inertial") is None:
            compiled = model.body(name)
            values = {
                "pos": compiled.ipos,
                "quat": compiled.iquat,
                "mass": compiled.mass,
                "diaginertia": compiled.inertia,
            }
            body.insert(0, etree.Element("inertial", {key: numbers(value) for key, value in values.items()}))


def _inherit_exclusions(spec: mujoco.MjSpec, bodies_of_pads: dict[str, str]) -> None:
    """Give each pad the contact exclusions of its body, since MuJoCo excludes by body and a pad is a body of its own.

    A pad never collides with the body it is welded to, but excluding the two keeps ``fusestatic`` from merging them.
    """
    pairs = [(exclude.bodyname1, exclude.bodyname2) for exclude in spec.excludes]
    for pad, body in bodies_of_pads.items():
        spec.add_exclude(bodyname1=pad, bodyname2=body)
        for first, second in pairs:
            if body in (first, second):
                spec.add_exclude(bodyname1=pad, bodyname2=second if body == first else first)
