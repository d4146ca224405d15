"""MJCF: numbers as its attributes hold them, and models as files that MuJoCo reads back as they are."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import mujoco
from lxml import etree

from paxisim.errors import InvalidValueError
from paxisim.models import names
from paxisim.models.load import one_line

_FILES = ["file", "fileup", "filedown", "fileleft", "fileright", "filefront", "fileback"]


def numbers(values: Iterable[float]) -> str:
    """Format numbers as MJCF text, with nine significant digits and without negative zero."""
    return " ".join(f"{float(value) + 0.0:.9g}" for value in values)


def format_mjcf(spec: mujoco.MjSpec, what: str, folder: str | Path | None = None) -> str:
    """Return a model as MJCF text, and add what MuJoCo leaves out.

    Args:
        spec: The model, left unchanged.
        what: Description of the model, for messages.
        folder: Folder where the text will be saved; paths of meshes and textures become relative to it. Default:
            absolute paths.

    Raises:
        InvalidValueError: MuJoCo cannot compile the model.
    """
    spec = spec.copy()
    with_absolute_files(spec)
    try:
        model = spec.compile()
    except (ValueError, RuntimeError, MemoryError) as error:
        raise InvalidValueError(f"MuJoCo cannot compile {what}: {one_line(error)}") from error
    root = etree.fromstring(spec.to_xml())
    _write_inertia(root, model)
    _write_main_class(root, spec)
    if folder is not None:
        _write_relative_files(root, Path(folder).resolve())
    return etree.tostring(root, pretty_print=True, encoding="unicode")


def with_absolute_files(spec: mujoco.MjSpec) -> None:
    """Make all paths of meshes, textures, height fields and skins absolute, in place.

    A spec writes one folder of meshes for all, also for those that came from another model.
    """
    source = Path(spec.modelfiledir or ".").resolve()
    for elements, directory in (
        (spec.meshes, spec.meshdir),
        (spec.hfields, spec.meshdir),
        (spec.skins, spec.meshdir),
        (spec.textures, spec.texturedir),
    ):
        for element in elements:
            if element.file and element.file not in spec.assets:
                element.file = str(source / directory / element.file)
    for texture in spec.textures:
        for side, file in enumerate(texture.cubefiles):
            if file and file not in spec.assets:
                texture.cubefiles[side] = str(source / spec.texturedir / file)
    spec.meshdir = spec.texturedir = ""


def _write_relative_files(root: etree._Element, folder: Path) -> None:
    for asset in root.iter("mesh", "texture", "hfield", "skin"):
        for name in _FILES:
            path = asset.get(name, "")
            if os.path.isabs(path):
                asset.set(name, Path(os.path.relpath(path, folder)).as_posix())


def _write_inertia(root: etree._Element, model: mujoco.MjModel) -> None:
    """Write the inertia of each pad; MuJoCo before 4.0 omits it if the gripper has inertiafromgeom="true"."""
    for body in root.iter("body"):
        name = body.get("name", "")
        is_pad = any(site.get("name") == names.gel(name) for site in body.findall("site"))
        if is_pad and body.find("inertial") is None:
            body.insert(0, inertial(model, model.body(name).id))


def _write_main_class(root: etree._Element, spec: mujoco.MjSpec) -> None:
    """Name the class of a body that has the defaults of the whole model inside a body that has others.

    MuJoCo leaves it out, so a saved pad would take the contact bits, margin and material of its finger's class.
    """
    bodies = root.find("worldbody").iter("body")  # type: ignore[union-attr]
    for body, element in zip(spec.bodies[1:], bodies, strict=True):
        outer = element.xpath("ancestor::*[@childclass][1]/@childclass")
        if body.childclass == "main" and outer and outer != ["main"]:
            element.set("childclass", "main")


def inertial(model: mujoco.MjModel, body: int) -> etree._Element:
    """Return the ``inertial`` element of a body of a model."""
    values = {
        "pos": model.body_ipos[body],
        "quat": model.body_iquat[body],
        "mass": model.body_mass[body : body + 1],
        "diaginertia": model.body_inertia[body],
    }
    return etree.Element("inertial", {key: numbers(value) for key, value in values.items()})
