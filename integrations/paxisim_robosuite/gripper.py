"""Tactile versions of robosuite's grippers: `register` one by name, then ``gripper_types="PaxiPandaGripper"``."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, ClassVar

from robosuite.models.grippers import GRIPPER_MAPPING, GripperModel, register_gripper

import paxisim

DEFAULT_SENSOR = paxisim.Pad(paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2))
"""The paper's sensor, 12x10 taxels pooled to 6x5."""

KNOWN_MOUNTS = {
    "BDGripper": "bd",
    "FourierLeftHand": "fourier_left",
    "FourierRightHand": "fourier_right",
    "InspireLeftHand": "inspire_left",
    "InspireRightHand": "inspire_right",
    "JacoThreeFingerDexterousGripper": "jaco_three_finger",
    "JacoThreeFingerGripper": "jaco_three_finger",
    "PandaGripper": "panda",
    "RethinkGripper": "rethink",
    "Robotiq140Gripper": "robotiq_140",
    "Robotiq85Gripper": "robotiq_85",
    "RobotiqThreeFingerDexterousGripper": "robotiq_s",
    "RobotiqThreeFingerGripper": "robotiq_s",
    "WipingGripper": "wiping",
    "XArm7Gripper": "xarm7",
}
"""robosuite's grippers with mounts known to paxisim, and paxisim's names for them."""

READY_MADE = ("PandaGripper", "Robotiq85Gripper", "Robotiq140Gripper", "XArm7Gripper", "RethinkGripper")
"""Grippers that importing this package registers as ``"Paxi" + name``."""


class TactileGripper(GripperModel):
    """Mixin: a robosuite gripper whose fingers carry pads.

    The pads are added to robosuite's parsed file before robosuite prefixes the names, so it treats them like the rest
    of the gripper. Collision geoms that a pad replaces are switched off. Where robosuite looks for contact with one of
    them, as its grasp checks do, it finds the pad's taxels.

    Attributes:
        pad: The pad on each mount; the mount's name is prefixed to the pad's name.
        mounts: The mounts of the pads.
    """

    pad: ClassVar[paxisim.Pad]
    mounts: ClassVar[tuple[paxisim.Mount, ...]]

    def __init__(self, idn: int | str = 0) -> None:
        """Build the gripper.

        Args:
            idn: robosuite's ID of this gripper.
        """
        self._taxels: dict[str, list[str]] = {}
        super().__init__(idn=idn)  # type: ignore[call-arg] - of the gripper class
        taxels = [name for names in self._taxels.values() for name in names]
        # robosuite recognises collision geoms by their group, and the taxels are in the visual group
        self._contact_geoms = [*self._contact_geoms, *taxels]
        self._visual_geoms = [name for name in self._visual_geoms if name not in taxels]

    def resolve_asset_dependency(self) -> None:
        """Add the pads in the last step of robosuite's parsing, before names are prefixed."""
        super().resolve_asset_dependency()
        for mount in self.mounts:
            self._taxels[mount.name] = self._add_pad(mount)

    def _add_pad(self, mount: paxisim.Mount) -> list[str]:
        bodies = {body.get("name"): body for body in self.worldbody.iter("body")}
        if mount.body not in bodies:
            raise paxisim.UnknownNameError("body", mount.body, [name for name in bodies if name])
        geoms = [(str(body.get("name", "")), body.findall("geom")) for body in self.worldbody.iter("body")]
        replaced = mount.find_replaced((body, [geom.get("name", "") for geom in own]) for body, own in geoms)
        for geom in (geoms[body][1][index] for body, index in replaced):
            geom.set("contype", "0")
            geom.set("conaffinity", "0")
            # contact bits do not affect explicit pairs
            for pair in self.contact.findall("pair"):
                if geom.get("name") in (pair.get("geom1"), pair.get("geom2")):
                    self.contact.remove(pair)
        pad = replace(self.pad, name=f"{mount.name}_{self.pad.name}")
        document = ET.fromstring(pad.to_xml())
        body = document.find("worldbody/body")
        assert body is not None
        body.set("pos", _numbers(mount.pos))
        body.set("quat", _numbers(mount.quat))
        bodies[mount.body].append(body)
        self._inherit_exclusions(mount.body, pad.name)
        self.sensor.extend(document.findall("sensor/*"))
        return [str(geom.get("name")) for geom in body.findall("geom") if geom.get("condim")]

    def _inherit_exclusions(self, finger: str, pad: str) -> None:
        # MuJoCo excludes contacts by body, and a pad is a separate body
        for exclude in self.contact.findall("exclude"):
            pair = exclude.get("body1"), exclude.get("body2")
            if finger in pair:
                other = pair[1] if pair[0] == finger else pair[0]
                self.contact.append(ET.Element("exclude", {"body1": pad, "body2": str(other)}))

    @property
    def _important_geoms(self) -> dict[str, list[str]]:
        groups = {}
        for group, names in super()._important_geoms.items():
            pads = [m for m in self.mounts if set(m.replaces) & set(names)]
            groups[group] = [*names, *(taxel for mount in pads for taxel in self._taxels[mount.name])]
        return groups


def register(
    name: str,
    gripper: str,
    sensor: paxisim.Pad | paxisim.TaxelLayout | str = DEFAULT_SENSOR,
    mounts: Iterable[paxisim.Mount] | None = None,
) -> type[GripperModel]:
    """Register a tactile version of a gripper with robosuite under a new name.

    Args:
        name: The new name, for ``gripper_types=``. If it is registered already, the gripper is
            replaced, with a warning.
        gripper: Name of the gripper to put pads on, one of robosuite's or one registered with it.
        sensor: A pad, a layout, or the name of a sensor in paxisim's catalogue. Default: the paper's sensor.
        mounts: Mounts of the pads. Default: paxisim's mounts for robosuite's grippers.

    Returns:
        The registered class.

    Raises:
        UnknownNameError: There is no such gripper or sensor. A body or geom of a mount that the gripper lacks is
            reported when the gripper is built.
        InvalidValueError: `name` belongs to a gripper without pads; `mounts` is empty, missing for a gripper without
            known mounts, or has duplicate names; or the pad has touch_grid sensors, whose plugin robosuite drops.
    """
    if gripper not in GRIPPER_MAPPING:
        raise paxisim.UnknownNameError("gripper", gripper, [known for known in GRIPPER_MAPPING if known])
    taken = GRIPPER_MAPPING.get(name)
    if not name or (taken is not None and not issubclass(taken, TactileGripper)):
        raise paxisim.InvalidValueError(f"expected a new name for the tactile gripper, got {name!r}")
    if mounts is None:
        if gripper not in KNOWN_MOUNTS:
            raise paxisim.InvalidValueError(f"no mounts are known for {gripper}: give mounts=[paxisim.Mount(...), ...]")
        mounts = paxisim.mounts_for(KNOWN_MOUNTS[gripper])
    chosen = tuple(mounts)
    if not chosen:
        raise paxisim.InvalidValueError("expected at least one mount, got none")
    names = [mount.name for mount in chosen]
    twice = [mount for mount in names if names.count(mount) > 1]
    if twice:
        raise paxisim.InvalidValueError(f"two mounts are named {twice[0]!r}: give them different names")
    pad = _as_pad(sensor)
    if pad.sensors == "touch_grid":
        raise paxisim.InvalidValueError(
            "robosuite drops the plugin of touch_grid sensors when it assembles a scene: give a pad without "
            "sensors, which TactileWrapper reads, or with sensors='contact'"
        )
    if taken is not None:
        warnings.warn(f"{name} was registered before: this registration replaces it", stacklevel=2)
    fields: dict[str, Any] = {
        "__doc__": f"robosuite's {gripper} with a pad on each of {', '.join(mount.body for mount in chosen)}.",
        "__module__": __name__,
        "pad": pad,
        "mounts": chosen,
    }
    return register_gripper(type(name, (TactileGripper, GRIPPER_MAPPING[gripper]), fields))


def register_ready_made() -> None:
    """Register the grippers of `READY_MADE` with the paper's sensor."""
    for gripper in READY_MADE:
        register(f"Paxi{gripper}", gripper)


def _as_pad(sensor: paxisim.Pad | paxisim.TaxelLayout | str) -> paxisim.Pad:
    if isinstance(sensor, paxisim.Pad):
        return sensor
    if isinstance(sensor, paxisim.TaxelLayout):
        return paxisim.Pad(sensor)
    product = paxisim.sensor(sensor)
    return paxisim.Pad(product.layout, mass=product.mass)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
