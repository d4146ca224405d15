"""Reading a model to be changed: an MjSpec, a file or XML text, always as a copy of its own."""

from __future__ import annotations

from pathlib import Path

import mujoco

from paxisim.errors import InvalidValueError


def load_spec(model: mujoco.MjSpec | str | Path) -> mujoco.MjSpec:
    """An editable copy of a model.

    Args:
        model: A spec (copied, so the caller's stays as it is), the path of an MJCF or URDF file, or the text of
            an MJCF document.

    Returns:
        The spec. One from a file still finds its meshes when compiled.

    Raises:
        InvalidValueError: There is no such file, or MuJoCo cannot parse it.
    """
    if isinstance(model, mujoco.MjSpec):
        return model.copy()
    if isinstance(model, str) and model.lstrip().startswith("<"):
        source, parse, argument = "the XML text", mujoco.MjSpec.from_string, model
    else:
        path = Path(model)
        if not path.is_file():
            raise InvalidValueError(f"no such model file: {path}")
        source, parse, argument = str(path), mujoco.MjSpec.from_file, str(path)
    try:
        return parse(argument)
    except ValueError as error:
        raise InvalidValueError(f"MuJoCo cannot parse {source}: {one_line(error)}") from error


def compile_spec(spec: mujoco.MjSpec, what: str) -> mujoco.MjModel:
    """Compile, with MuJoCo's complaint in one line if it has one.

    Raises:
        InvalidValueError: MuJoCo cannot compile the model.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise InvalidValueError(f"MuJoCo cannot compile {what}: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """An error's message with its line breaks and repeated spaces removed."""
    return " ".join(str(error).split())
