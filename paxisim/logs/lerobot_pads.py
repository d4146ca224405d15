"""lerobot_pads: the pads in a LeRobotDataset, which has no feature type for tactile sensors.

| feature | holds |
|---|---|
| array with "tactile" in its name | a pad, or several if one of its axes is ``pads`` |
| vector with components named ``PREFIX.fK.pNN.fx`` (``fy``, ``fz``) | for each finger K a pad ``PREFIX.fK``, with its \
points in the order of their numbers; its other components are covariates. ``bx`` in place of ``fx`` is a field in \
microtesla, and ``cx`` is in counts |

The axes of an array come from the first of these that states them:

- The caller, in words of `paxisim.logs.axes.WORDS`. This also makes pads of a feature with any other name. A vector
  with two axes is split into them. Without ``xyz`` each taxel has one value, which becomes z; x and y are NaN, i.e.
  unknown.
- The names of the axes in the feature's ``names``, e.g. ``["row", "column", "axis"]``.
- Its shape, if exactly one of ``(N, 3)``, ``(3, N)``, ``(rows, cols, 3)``, ``(3, rows, cols)``,
  ``(pads, rows, cols, 3)`` and ``(pads, 3, rows, cols)`` fits.

Any other array with "tactile" in its name is refused, so that no axes are confused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.logs.axes import FORMS, OFFERED, Axes, are_axes, fits, given_axes, on_grid, tensor_of
from paxisim.logs.lerobot_features import PREFIXES
from paxisim.logs.lerobot_meta import INDICES, Meta, read_meta

_SYNONYMS = {
    "pads": "pad pads finger fingers",
    "xyz": "xyz axis axes component components channel channels",
    "rows": "row rows height",
    "cols": "col cols column columns width",
    "taxels": "taxel taxels point points",
}
_NAMES = {name: word for word, names in _SYNONYMS.items() for name in names.split()}
_UNITS = {"f": "N", "b": "uT", "c": "counts"}
_TAXEL = re.compile(r"(?:(.+)\.)?f(\d{1,9})\.p(\d{1,9})\.([fbc])([xyz])")


@dataclass(frozen=True)
class Pads:
    """Pads of a feature.

    Attributes:
        source: The feature, or the finger of whose points they consist; for messages.
        stream: ``"measured"`` or ``"simulated"``.
        pads: Names of the pads.
        tensor: ``(T, pads, 3, rows, cols)``.
        unit: Unit of the tensor, or None if the dataset does not state it.
        layout: Layout that the dataset states, or None.
    """

    source: str
    stream: str
    pads: tuple[str, ...]
    tensor: NDArray[np.float32]
    unit: str | None = None
    layout: TaxelLayout | None = None


def features_in_words(path: Path) -> str:
    """Return the numeric features of a dataset as text, for a message about the missing tactile feature."""
    meta = read_meta(path)
    listed = [f"{name} {meta.features[name]['shape']}" for name in meta.numeric if name not in INDICES]
    return ", ".join(listed[:8]) + (" ..." if len(listed) > 8 else "") or "nothing"


def tactile_arrays(
    meta: Meta, features: Sequence[str], given: Mapping[str, str], pads: Sequence[str] | None
) -> dict[str, Axes]:
    """Return the axes of each tactile array.

    Args:
        meta: Metadata of the dataset.
        features: Names of the numeric features.
        given: Axes by feature, as words with commas; they take precedence over names and shapes.
        pads: Names of the requested pads, or None for all. Arrays of none of them need no axes; if they have none, they
            are left out.

    Raises:
        InvalidValueError: The axes of an array are given wrongly, or cannot be told.
        UnknownNameError: There is no such numeric feature.
    """
    for name in given:
        if name not in features:
            raise UnknownNameError("feature", name, features)
    found = {name: given_axes(name, meta.features[name]["shape"], text) for name, text in given.items()}
    unclear = []
    for name in features:
        if name in found or not _is_tactile(meta, name):
            continue
        axes = _known_axes(meta, name)
        if axes is not None:
            found[name] = axes
        elif pads is None or any(pad.startswith(_pad_name(meta, name)) for pad in pads):
            unclear.append(name)
    if unclear:
        choices = {name: [",".join(axes) for axes in _choices(meta, name)] for name in unclear}
        listed = ", ".join(f"{name} {meta.features[name]['shape']} ({' or '.join(choices[name])})" for name in unclear)
        raise InvalidValueError(
            f"{meta.path}: names and shape do not tell the axes of {listed}; state them with axes (paxisim convert "
            f"--axes {unclear[0]}={choices[unclear[0]][0]}), or select other pads with pads"
        )
    return {name: found[name] for name in features if name in found}


def pads_of_array(meta: Meta, feature: str, values: NDArray[Any], axes: Axes, layout: TaxelLayout | None) -> Pads:
    """Return the pads of an array.

    Args:
        meta: Metadata of the dataset.
        feature: Name of the feature.
        values: ``(T, *shape)``.
        axes: Its axes, as from `tactile_arrays`.
        layout: Layout that the caller gives, or None. It gives an array with the axis ``taxels`` its grid.

    Raises:
        InvalidValueError: The feature's unit or layout is malformed.
    """
    info = _info(meta, feature)
    stated, unit = (info.get(name) for name in ("layout", "unit"))
    if not isinstance(unit, str | None):
        raise InvalidValueError(f"{meta.path}: the unit of {feature} must be a string such as N, got {unit!r:.80}")
    tensor, name = tensor_of(values, axes), _pad_name(meta, feature)
    pads = tuple(f"{name}{i}" for i in range(tensor.shape[1])) if "pads" in axes else (name,)
    try:
        stated = None if stated is None else _layout(stated, tensor.shape[-2:])
    except InvalidValueError as error:
        raise InvalidValueError(f"{meta.path}: the layout of {feature}: {error}") from error
    tensor = on_grid(tensor, layout) if "taxels" in axes else tensor
    return Pads(feature, _stream(meta, feature), pads, tensor, unit, stated)


def is_taxel(meta: Meta, feature: str, component: str) -> bool:
    """Return whether a component of a vector belongs to a taxel, by its name."""
    return _taxel(meta, feature, component) is not None


def pads_of_components(meta: Meta, features: Mapping[str, NDArray[Any]], layout: TaxelLayout | None) -> list[Pads]:
    """Return the pads whose points are components of vectors, in the order of their prefixes and fingers.

    Args:
        meta: Metadata of the dataset.
        features: Values ``(T, *shape)`` by feature.
        layout: Layout that the caller gives, or None. It gives the points their places in its grid.

    Raises:
        InvalidValueError: A component of a point is missing or there twice.
    """
    fingers: dict[tuple[str, int, str], dict[tuple[int, str], NDArray[Any]]] = {}
    for feature, values in features.items():
        for name, column in meta.components(feature, values).items():
            if taxel := _taxel(meta, feature, name):
                prefix, finger, point, letter, axis = taxel.groups("")
                points = fingers.setdefault((prefix, int(finger), letter), {})
                if (int(point), axis) in points:
                    raise InvalidValueError(f"{meta.path}: two components of its features are named {name}")
                points[int(point), axis] = column
    found = []
    for prefix, finger, letter in sorted(fingers):
        pad = f"{prefix}.f{finger}".removeprefix(".")
        tensor = tensor_of(_points(meta, pad, fingers[prefix, finger, letter], letter), ("taxels", "xyz"))
        found.append(Pads(pad, "measured", (pad,), on_grid(tensor, layout), _UNITS[letter]))
    return found


def _points(meta: Meta, pad: str, points: Mapping[tuple[int, str], NDArray[Any]], letter: str) -> NDArray[Any]:
    """Return ``(T, N * 3)`` values of the points of a finger, given by number and axis."""
    last = max(points)[0]
    wanted = [(point, axis) for point in range(min(last, len(points)) + 1) for axis in "xyz"]
    for point, axis in wanted:
        if (point, axis) not in points:
            raise InvalidValueError(
                f"{meta.path} has no component {pad}.p{point:02d}.{letter}{axis}: expected {letter}x, {letter}y and "
                f"{letter}z of every point from p00 to p{last:02d}, the last one"
            )
    return np.stack([points[at] for at in wanted], axis=1)


def _taxel(meta: Meta, feature: str, component: str) -> re.Match[str] | None:
    is_float = str(meta.features[feature].get("dtype")).startswith("float")
    return _TAXEL.fullmatch(component) if is_float else None


def _info(meta: Meta, feature: str) -> Mapping[str, Any]:
    info = meta.features[feature].get("info")
    return info if isinstance(info, dict) else {}


def _stream(meta: Meta, feature: str) -> str:
    stated = _info(meta, feature).get("stream")
    by_name = "simulated" if feature.startswith(f"{PREFIXES['simulated']}.") else "measured"
    return stated if stated in tuple(PREFIXES) else by_name


def _pad_name(meta: Meta, feature: str) -> str:
    """Return the name of the pad, or what the names of several pads begin with."""
    pad = _info(meta, feature).get("pad")
    if isinstance(pad, str):
        return pad
    name = "pad" if feature in PREFIXES.values() else feature
    return name.removeprefix(f"{PREFIXES[_stream(meta, feature)]}.").removeprefix("observation.")


def _is_tactile(meta: Meta, name: str) -> bool:
    is_named = "tactile" in name.lower() or name.startswith(f"{PREFIXES['simulated']}.")
    shape = meta.features[name]["shape"]
    has_components = len(shape) == 1 and len(meta.names(name)) == shape[0]
    return is_named and 1 <= len(shape) <= 4 and shape != [1] and not has_components


def _known_axes(meta: Meta, name: str) -> Axes | None:
    """Return the axes of an array that follow from its names or its shape, or None."""
    shape, names = meta.features[name]["shape"], tuple(_NAMES.get(word.lower(), "") for word in meta.names(name))
    if any(names):  # names that are understood in part might contradict what the shape suggests
        return names if are_axes(names) and "xyz" in names and fits(names, shape) else None
    possible = [axes for axes in FORMS if fits(axes, shape)]
    return possible[0] if len(possible) == 1 else None


def _choices(meta: Meta, name: str) -> list[Axes]:
    """Return the axes that an array may have, for a message."""
    shape = meta.features[name]["shape"]
    found = [axes for axes in (*FORMS, *OFFERED) if fits(axes, shape)]
    with_xyz = [axes for axes in found if "xyz" in axes]
    return with_xyz if with_xyz and len(shape) > 1 else found


def _layout(document: Any, grid: tuple[int, ...]) -> TaxelLayout:
    said = [document.get(name) for name in ("rows", "cols")] if isinstance(document, dict) else list(grid)
    if said != list(grid):  # checked before memory is allocated for the taxels
        raise InvalidValueError(f"it has rows and cols {said!r:.40}, the frames have {list(grid)}")
    return TaxelLayout.from_dict(document)
