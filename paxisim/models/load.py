"""Load: read a model from an MjSpec, a file or XML text as an editable copy, and compile it."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
from lxml import etree

from paxisim.errors import InvalidValueError


def load_spec(model: mujoco.MjSpec | str | Path) -> mujoco.MjSpec:
    """Return an editable copy of a model.

    Args:
        model: A spec (copied, so the original stays unchanged), the path of an MJCF or URDF file, or the text of an
            MJCF document.

    Returns:
        The spec. A spec from a file still finds its meshes when compiled.

    Raises:
        InvalidValueError: The type is wrong, there is no such file, or MuJoCo cannot parse it.
    """
    if not isinstance(model, (str, Path)):
        if not isinstance(model, mujoco.MjSpec):
            raise InvalidValueError(
                f"expected an MjSpec, the path of an MJCF file or its text, got {type(model).__name__}"
                + ("; pass the spec or file it was compiled from" if isinstance(model, mujoco.MjModel) else "")
            )
        return model.copy()
    if isinstance(model, str) and model.lstrip().startswith("<"):
        source, parse, argument = "the XML text", mujoco.MjSpec.from_string, model
    else:
        path = Path(model)
        check_model_file(path)
        with path.open("rb") as file:  # MuJoCo also makes models of lone meshes, and logs what it cannot decode
            if not file.read(4096).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                raise InvalidValueError(f"MuJoCo cannot parse {path}: expected MJCF or URDF, which begin with <")
        source, parse, argument = str(path), mujoco.MjSpec.from_file, str(path)
    try:
        return parse(argument)
    except ValueError as error:
        if "mujocoinclude" in str(error):
            raise InvalidValueError(
                f"{source} is a part that other models include, not a model: give the file that includes it"
            ) from error
        try:
            repaired, repairs = _repaired(source, parse is mujoco.MjSpec.from_file)
            spec = mujoco.MjSpec.from_string(repaired)
        except (ValueError, etree.XMLSyntaxError):
            raise InvalidValueError(f"MuJoCo cannot parse {source}: {one_line(error)}") from error
    warnings.warn(f"{Path(source).name} is not sound MJCF, read without {'; '.join(repairs)}", stacklevel=2)
    return spec


def check_model_file(path: Path) -> None:
    """Check that a model file exists.

    Raises:
        InvalidValueError: It does not.
    """
    if not path.is_file():
        raise InvalidValueError(f"no such model file: {path}")


def _repaired(path: str, is_file: bool) -> tuple[str, list[str]]:
    """Remove two faults from a file's text that robosuite tolerates and some of its grippers have.

    Raises:
        ValueError: The file has neither fault.
    """
    if not is_file:
        raise ValueError
    root = etree.parse(path, etree.XMLParser(remove_comments=True)).getroot()
    repairs, seen = [], set()
    for section in root.findall("asset"):
        for asset in section.findall("*"):
            key = (asset.tag, asset.get("name"))
            if key in seen and key[1]:
                repairs.append(f"the second {asset.tag} {key[1]!r}")
                section.remove(asset)
            seen.add(key)
    for default in root.iter("default"):
        for name in set(default.attrib) - {"class"}:
            repairs.append(f"the attribute {name!r} of default class {default.get('class')!r}")
            del default.attrib[name]
    if not repairs:
        raise ValueError
    compiler = root.find("compiler")
    if compiler is None:
        compiler = etree.SubElement(root, "compiler")
    for name in ("meshdir", "texturedir"):
        compiler.set(name, str(Path(path).resolve().parent / compiler.get(name, "")))
    return etree.tostring(root, encoding="unicode"), repairs


def compile_spec(spec: mujoco.MjSpec, what: str) -> mujoco.MjModel:
    """Compile a copy of a spec, with MuJoCo's error message in one line.

    Compiling the spec itself would make it lose its sites' materials when it is later attached to another spec
    (MuJoCo 3.5 and 3.9).

    Raises:
        InvalidValueError: MuJoCo cannot compile the model.
    """
    try:
        return spec.copy().compile()
    except (ValueError, RuntimeError, MemoryError) as error:
        raise InvalidValueError(f"MuJoCo cannot compile {what}: {one_line(error)}") from error


def compile_whole(spec: mujoco.MjSpec, what: str) -> mujoco.MjModel:
    """Compile a copy of a spec and keep all its bodies and geoms, so that their indices match the spec.

    Otherwise the gripper's settings may make MuJoCo drop geoms that touch nothing and merge bodies that do not move.

    Raises:
        InvalidValueError: MuJoCo cannot compile the model.
    """
    spec = spec.copy()
    spec.compiler.discardvisual = spec.compiler.fusestatic = False
    return compile_spec(spec, what)


def one_line(error: Exception) -> str:
    """Return the message of an error without line breaks and repeated spaces."""
    return " ".join(str(error).split())
