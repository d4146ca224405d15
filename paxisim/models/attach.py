"""Attach: put pads on a gripper and keep everything the gripper already has."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models import names
from paxisim.models.gel import Gel
from paxisim.models.grip import Grip
from paxisim.models.load import compile_spec, compile_whole, load_spec
from paxisim.models.mjcf import format_mjcf
from paxisim.models.mount import Mount, replaced_in_spec
from paxisim.models.pad import Pad
from paxisim.models.pads import Pads, find_pads
from paxisim.sensors import sensor as find_sensor

MIN_LEAN = 0.02
"""Smallest mean of the taxels' normals along y for which a pad counts as curved around one end, as fingertips are."""


@dataclass(frozen=True, eq=False)
class TactileGripper:
    """A gripper with pads, not yet compiled.

    Attributes:
        spec: Spec of the gripper with its pads; attach it to an arm, edit it or compile it.
        mounts: Mounts of the pads, in the order of the ``pads`` axis, which is the order of the pads' bodies.
        pad_names: Names of the pads in `spec`.
        gel: Gel that `bind` gives to the pads.
        layout: Taxels of the first pad, which all pads share unless they follow different surfaces.
        report: How the mounts were chosen, unless the caller gave them, and how far the taxels of pads that
            follow a surface are from the skin.
    """

    spec: mujoco.MjSpec
    mounts: tuple[Mount, ...]
    pad_names: tuple[str, ...]
    gel: Gel
    layout: TaxelLayout
    report: str = ""
    _found: tuple[Grip, ...] = ()

    def __repr__(self) -> str:
        """One line with the number and the names of the pads."""
        described = names.described_pads([mount.name for mount in self.mounts], self.layout.rows, self.layout.cols)
        return f"TactileGripper({described})"

    @cached_property
    def grips(self) -> tuple[Grip, ...]:
        """How each hand closes its pads; empty if nothing closes them. Computed on first use for mounts given by hand.

        Raises:
            InvalidValueError: MuJoCo cannot compile the gripper, or it is unstable when it is driven.
        """
        from paxisim.models.find_mounts import grips_of

        return self._found or grips_of(self.spec, self.mounts)

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
        return pads

    def to_xml(self, folder: str | Path | None = None) -> str:
        """Return the gripper as MJCF text.

        Args:
            folder: Folder where the text will be saved; paths of meshes and textures become relative to it.
                Default: absolute paths.

        Raises:
            InvalidValueError: MuJoCo cannot compile the gripper.
        """
        return format_mjcf(self.spec, "the gripper with pads", folder)


def attach(
    gripper: mujoco.MjSpec | str | Path,
    sensor: Pad | TaxelLayout | str | Sequence[Pad | TaxelLayout],
    mounts: Iterable[Mount] | None = None,
    *,
    fingers: Sequence[str] = (),
    close: Sequence[str] = (),
    under: str = "",
    conform: bool = False,
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
        sensor: Pad to build, a layout, or the name of a sensor in the catalogue. If pads follow different surfaces, a
            pad or layout for each mount, in the order of `mounts`; all have the same rows, columns and gel.
        mounts: Mounts of the pads, in any order; the pads are ordered by their bodies. Default: the known mounts if
            `gripper` is a file that robosuite ships, else the mounts that `find_mounts` proposes. The attribute
            `report` of the result says which.
        fingers: Names of the bodies that are the fingertips, for `find_mounts`.
        close: Names of the actuators or joints that close the hand, for `find_mounts`.
        under: Name of the body that carries the hand, for `find_mounts`.
        conform: Lay each pad onto the geoms that its mount replaces, if these are curved under it.

    Returns:
        The gripper with its pads, not compiled: call ``result.compile()`` and then ``result.bind(model)``.

    Raises:
        InvalidValueError: The gripper cannot be parsed, no mount was given or found, two pads share a name, one tensor
            cannot hold the pads, or a finger cannot carry a pad that should conform to it.
        UnknownNameError: The sensor is unknown, or a mount names a body or geom that the gripper does not have.
    """
    spec = load_spec(gripper)
    each = isinstance(sensor, Sequence) and not isinstance(sensor, str)
    pads = [_as_pad(one) for one in sensor] if each else [_as_pad(sensor)]  # type: ignore[arg-type]
    report, grips, chosen_here = "", (), mounts is None
    if mounts is not None and (fingers or close or under):
        raise InvalidValueError("fingers, close and under choose the mounts: leave them out, or the mounts")
    if mounts is None:
        from paxisim.models.find_mounts import choose_mounts

        is_file = isinstance(gripper, Path) or (isinstance(gripper, str) and not gripper.lstrip().startswith("<"))
        mounts, report, grips = choose_mounts(
            spec, str(gripper) if is_file else "", fingers=fingers, close=close, under=under
        )
        mounts = [_with_free_name(mount, spec, pads[0].name) for mount in mounts]
        # chosen mounts have y from the palm to the tip
        if not each and pads[0].layout.normals[:, 1].mean() < -MIN_LEAN:
            mounts = [replace(mount, quat=_turned(mount.quat)) for mount in mounts]
            report += "\nturned the pads by 180 degrees, so that the end around which their taxels curve is at the tip"
    chosen = (mounts,) if isinstance(mounts, Mount) else tuple(mounts)
    for mount in chosen:
        if not isinstance(mount, Mount):
            raise InvalidValueError(f"mounts must be paxisim.Mount, got {mount!r:.80}")
    if not chosen:
        raise InvalidValueError("expected at least one mount, got none")
    bodies = {body.name: body for body in spec.bodies}
    chosen = tuple(_without_doubled_word(mount, bodies, pads[0].name) for mount in chosen)
    replaced = []
    for mount in chosen:
        if mount.body not in bodies:
            raise UnknownNameError("body", mount.body, [name for name in bodies if name])
        replaced += replaced_in_spec(spec, mount)
    pads = pads if each else pads * len(chosen)
    _check_together(pads, chosen)
    if conform:
        pads = _laid_on_fingers(spec, pads, chosen)
    if all(pad.contype == Pad.contype and pad.conaffinity == Pad.conaffinity for pad in pads):
        pads = [replace(pad, **_bits(replaced)) for pad in pads]
    if conform or each or not all(pad.layout.is_grid for pad in pads):
        from paxisim.models.finger_surface import describe_distance

        lines = [describe_distance(spec, mount, pad.layout) for mount, pad in zip(chosen, pads, strict=True)]
        report = "\n".join([*filter(None, [report]), *lines])
    pad_names = tuple(f"{mount.name}_{pad.name}" for mount, pad in zip(chosen, pads, strict=True))
    taken = [name for name in pad_names if name in bodies or pad_names.count(name) > 1]
    if taken:
        raise InvalidValueError(f"there would be two bodies named {taken[0]!r}: give each mount its own name")
    _warn_of_touch(spec, {mount.body for mount in chosen} | {geom.parent.name for geom in replaced})
    _switch_off(spec, replaced)
    for mount, pad in zip(chosen, pads, strict=True):
        frame = bodies[mount.body].add_frame(pos=mount.pos, quat=mount.quat)
        frame.attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body(pad.name), f"{mount.name}_", "")
    _inherit_exclusions(spec, dict(zip(pad_names, (mount.body for mount in chosen), strict=True)))
    model = compile_spec(spec, "the gripper with pads")
    # `bind` and `find_pads` in a saved file must use the same order, or a policy could get its pads swapped
    order = sorted(range(len(chosen)), key=lambda i: model.body(pad_names[i]).id)
    mounts, pad_names = tuple(chosen[i] for i in order), tuple(pad_names[i] for i in order)
    hidden, bare = _warn_of_mounts(spec, pad_names, mounts)
    if chosen_here:
        report += f"\nnote: {bare}" if bare else ""
        report += "" if hidden else "\nnothing else stands in front of the pads or level with them"
    grips = tuple(grip.reordered(order) for grip in grips)
    first = pads[order[0]]
    return TactileGripper(spec, mounts, pad_names, first.gel, first.layout, report, grips)


def _warn_of_mounts(spec: mujoco.MjSpec, pad_names: tuple[str, ...], mounts: tuple[Mount, ...]) -> tuple[bool, str]:
    """Warn of implausible mounts.

    Returns:
        Whether something takes the load of a pad, and what of the fingers no longer collides.
    """
    from paxisim.models.mount_checks import HIDDEN, MIN_BARE, bare_lengths, doubts

    model = compile_whole(spec, "the gripper with pads")
    pads = find_pads(model, names=pad_names)
    bare = bare_lengths(model, pads, mounts)
    found = doubts(model, pads, mounts, bare)
    for doubt in found:
        warnings.warn(doubt, stacklevel=3)
    where = [
        f"{mount.body} {1e3 * length:.0f} mm" for mount, length in zip(mounts, bare, strict=True) if length > MIN_BARE
    ]
    return (
        any(doubt.startswith(HIDDEN) for doubt in found),
        f"beyond the edges of their pads, fingers no longer collide: {', '.join(where)}" if where else "",
    )


def _as_pad(sensor: Pad | TaxelLayout | str) -> Pad:
    if isinstance(sensor, Pad):
        return sensor
    if isinstance(sensor, TaxelLayout):
        return Pad(sensor)
    if not isinstance(sensor, str):
        raise InvalidValueError(f"expected a Pad, a TaxelLayout or the name of a sensor, got {type(sensor).__name__}")
    product = find_sensor(sensor)
    return Pad(product.layout, mass=product.mass)


def _with_free_name(mount: Mount, spec: mujoco.MjSpec, pad: str) -> Mount:
    """Return a chosen mount, under another name if the robot has a body of the pad's name already."""
    taken = {body.name for body in spec.bodies}
    return replace(mount, name=f"{mount.name}_tactile") if f"{mount.name}_{pad}" in taken else mount


def _without_doubled_word(mount: Mount, taken: Collection[str], pad: str) -> Mount:
    """Return a mount whose pad is not called ``right_pad_pad``, if it has the name of a body ``right_pad``."""
    stem = mount.name.removesuffix(pad)
    if mount.name != mount.body or stem == mount.name or not (stem == "" or stem.endswith("_")):
        return mount
    stem = stem.rstrip("_")
    free = stem and f"{stem}_{pad}" not in taken
    return replace(mount, name=stem if free else f"{stem}_tactile".lstrip("_"))


def _turned(quat: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return an orientation turned by 180 degrees about its own z."""
    w, x, y, z = quat
    return (-z, y, -x, w)


def _check_together(pads: list[Pad], mounts: tuple[Mount, ...]) -> None:
    """Check that there is a pad for each mount, and that one tensor and one gel hold for all."""
    if len(pads) != len(mounts):
        raise InvalidValueError(f"expected a pad for each of {len(mounts)} mounts, got {len(pads)}")
    for mount, pad in zip(mounts, pads, strict=True):
        if pad.layout.shape != pads[0].layout.shape or pad.layout.vendor_order != pads[0].layout.vendor_order:
            shapes = " and ".join(f"{p.layout.rows}x{p.layout.cols}" for p in (pads[0], pad))
            raise InvalidValueError(
                f"one tensor cannot hold pads of different taxels ({shapes} in the vendors' orders, the second on "
                f"{mount.name!r}): attach each kind by itself"
            )
        if pad.gel != pads[0].gel:
            raise InvalidValueError(f"all pads of one call must have the same gel, but that on {mount.name!r} differs")


def _laid_on_fingers(spec: mujoco.MjSpec, pads: list[Pad], mounts: tuple[Mount, ...]) -> list[Pad]:
    from paxisim.models.finger_surface import lay_on_finger

    laid, refused = [], []
    for mount, pad in zip(mounts, pads, strict=True):
        try:
            laid.append(replace(pad, layout=lay_on_finger(spec, mount, pad.layout)))
        except InvalidValueError as error:
            refused.append(f"{mount.name}: {error}")
    if refused:
        raise InvalidValueError(
            f"{len(refused)} of {len(mounts)} pads cannot be laid onto their fingers ({'; '.join(refused)}): use a "
            "smaller pad, another mount, or no conform"
        )
    return laid


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
