"""Catalogue of sensor products: layout, rate, mass and ranges, each figure with its source.

The figures are in ``paxisim/data/sensors.toml``, which is read on first use. The taxel positions of curved sensors
come from an optional package or the user's copy of the maker's models, which are needed only when their layout is
requested; listing the catalogue needs only numpy.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError, MissingExtraError, UnknownNameError, UnsupportedError
from paxisim.layout import TaxelLayout

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]


@dataclass(frozen=True)
class Sensor:
    """One sensor product. Figures that no public source states are None.

    Attributes:
        name: Name in the catalogue, lower case.
        maker: Manufacturer.
        model: The manufacturer's designation.
        rows: Number of rows of taxels; 1 for a curved sensor.
        cols: Number of columns of taxels; the number of taxels for a curved sensor.
        pitch: Size of a taxel (m) as (row pitch along y, column pitch along x); None for a curved sensor.
        coordinates: Source of a curved sensor's positions, ``"PACKAGE:PART"``; None for a flat grid. Only those of
            paxini-sdk can be read without a hand; for ``xela_models``, see `paxisim.sensor_modules`.
        profiles: Names of the device profiles that drive it, as for `paxisim.open_sensor`.
        rate: Readings per second (Hz).
        mass: Mass of one pad (kg).
        resolution: One count of a taxel's reading (N).
        shear_range: Lowest and highest x or y force (N) that one taxel can report.
        normal_range: Lowest and highest z force (N) that one taxel can report.
        notes: Remarks for users.
        sources: Source of each figure and what it states, by attribute (``taxels`` for rows and cols, ``positions``
            for coordinates).
    """

    name: str
    maker: str
    model: str
    rows: int
    cols: int
    pitch: tuple[float, float] | None = None
    coordinates: str | None = None
    profiles: tuple[str, ...] = ()
    rate: float | None = None
    mass: float | None = None
    resolution: float | None = None
    shear_range: tuple[float, float] | None = None
    normal_range: tuple[float, float] | None = None
    notes: str = ""
    sources: Mapping[str, str] = field(default_factory=dict, hash=False)

    @property
    def taxels(self) -> int:
        """Number of taxels; needs no I/O."""
        return self.rows * self.cols

    @cached_property
    def layout(self) -> TaxelLayout:
        """Layout of the taxels, created on first use; for a curved sensor this reads its coordinates.

        Raises:
            MissingExtraError: The optional package with the coordinates is not installed.
            UnsupportedError: That package does not have the coordinates that the catalogue expects.
        """
        if self.coordinates is not None:
            return surface_layout(_read_coordinates(self))
        if self.pitch is None:
            raise InvalidValueError(f"sensor {self.name!r} has neither a pitch nor coordinates")
        return TaxelLayout(self.rows, self.cols, self.pitch)


def sensor(name: str) -> Sensor:
    """Return the sensor product with the given name.

    Args:
        name: A name from `known_sensors`, in any case, e.g. ``"paxini-gen1-l4629"``.

    Raises:
        UnknownNameError: There is no such product; the message suggests close matches.
    """
    try:
        return _catalogue()[name.lower()]
    except KeyError:
        raise UnknownNameError("sensor", name, _catalogue(), "`paxisim sensors` lists them") from None


def known_sensors() -> tuple[Sensor, ...]:
    """Return all products, in the order of the data file; needs no optional package."""
    return tuple(_catalogue().values())


def format_table() -> str:
    """Return the catalogue as a plain text table, at most 80 columns wide, without a final newline."""
    rows: list[tuple[str, ...]] = [("name", "taxels", "pitch (mm)", "device profiles")]
    for item in known_sensors():
        flat = item.pitch is not None
        taxels = f"{item.rows}x{item.cols}" if flat else str(item.taxels)
        pitch = " x ".join(f"{1e3 * p:.4g}" for p in item.pitch) if item.pitch else "curved"
        first, *others = item.profiles or ("-",)
        rows += [(item.name, taxels, pitch, first), *(("", "", "", profile) for profile in others)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple("-" * width for width in widths))
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    needs = [
        "PaXini's curved sensors need paxini-sdk: pip install 'paxisim[paxini]'",
        "XELA's curved sensors need your copy of xela_models: attach it with --xacro FILE",
    ]
    return "\n".join([*lines, "", *needs])


def surface_layout(points: ArrayLike) -> TaxelLayout:
    """Return the layout of taxels on a convex curved surface, from a vendor's table of points.

    The table's frame is assumed to be right-handed with x across the finger, y from its root to its tip and z
    out of the surface, as in the tables of PaXini's fingertips. Rotated about x by 180 degrees, it has the axes of the
    pad frame, with the tip at the top. The origin is the middle of the extent along x and y, at the height of the
    outermost taxel, so no position has a negative z. The order of the table is kept.

    The tables contain no normals. Each normal is estimated from the sphere through the taxel that best fits its six
    nearest neighbours. The estimate is exact on planes and spheres; on an ellipsoid of a fingertip's size, the error is
    4 degrees on average and up to 17 at the rim. Normals point away from the middle of all points. The footprint is a
    square whose side is the median distance between nearest neighbours.

    Args:
        points: ``(N, 3)`` taxel positions (mm, the table's frame); N at least 7.

    Returns:
        Layout with one row and N columns.

    Raises:
        InvalidValueError: The points have the wrong shape, are too few or are not finite.
    """
    table = np.asarray(points, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 3 or len(table) < 7 or not np.all(np.isfinite(table)):
        raise InvalidValueError(f"expected at least 7 finite points of shape (N, 3), got {table.shape}")
    turned = 1e-3 * table * [1.0, -1.0, -1.0]
    low, high = turned.min(axis=0), turned.max(axis=0)
    positions = turned - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    squared = np.sum((positions[:, None] - positions[None]) ** 2, axis=-1)
    order = np.argsort(squared, axis=1)
    pitch = float(np.median(np.sqrt(np.take_along_axis(squared, order[:, 1:2], axis=1))))
    normals = _sphere_normals(positions, order[:, 1:7])
    inside = positions.mean(axis=0) + [0.0, 0.0, 0.1 * pitch]  # so that a flat table also has an inside
    normals[np.sum((positions - inside) * normals, axis=1) < 0] *= -1
    return TaxelLayout(1, len(positions), (pitch, pitch), positions, normals)


def _sphere_normals(positions: NDArray[np.float64], neighbours: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return unit normals, of either sign, of spheres through the positions: ``n . q = c |q|^2`` at neighbours q."""
    q = positions[neighbours] - positions[:, None]
    bulge = np.sum(q**2, axis=-1, keepdims=True)
    # eliminate the curvature c; the remainder is smallest along the normal
    q = q - bulge * np.sum(bulge * q, axis=1, keepdims=True) / np.sum(bulge**2, axis=1, keepdims=True)
    return np.linalg.eigh(np.swapaxes(q, 1, 2) @ q)[1][..., 0]


def _read_coordinates(item: Sensor) -> ArrayLike:
    """Read the table of points ``(N, 3)`` (mm) that `item` names."""
    package, _, part = str(item.coordinates).partition(":")
    if package == "xela_models":
        raise UnsupportedError(
            f"the taxels of sensor {item.name!r} are in XELA's own models of hands, of which paxisim has no copy: "
            "attach it with --xacro FILE, or with paxisim.sensor_modules in Python"
        )
    if package != "paxini-sdk":
        raise UnsupportedError(f"sensor {item.name!r} has coordinates of an unknown kind: {item.coordinates!r}")
    try:
        registry = importlib.import_module("paxini_sdk.sensor_registry")
    except ImportError as error:
        raise MissingExtraError(package, "paxini", f"the layout of sensor {item.name!r}") from error
    try:
        points = registry.load_points(part)
    except (KeyError, FileNotFoundError) as error:
        raise UnsupportedError(f"the installed {package} has no coordinates of {part}") from error
    if len(points) != item.taxels:
        raise UnsupportedError(f"expected {item.taxels} points of {part} from {package}, got {len(points)}")
    return points


@cache
def _catalogue() -> dict[str, Sensor]:
    text = files("paxisim").joinpath("data/sensors.toml").read_text(encoding="utf-8")
    return {name: _parse(name, entry) for name, entry in tomllib.loads(text).items()}


def _parse(name: str, entry: dict[str, Any]) -> Sensor:
    """Create a product from its table in the data file, in SI units."""
    mass = entry.pop("mass_g", None)
    pitch = entry.pop("pitch_mm", None)
    shear, normal = entry.pop("shear_n", None), entry.pop("normal_n", None)
    return Sensor(
        name=name,
        pitch=None if pitch is None else (1e-3 * pitch[0], 1e-3 * pitch[1]),
        profiles=tuple(entry.pop("profiles", ())),
        rate=entry.pop("rate_hz", None),
        mass=None if mass is None else 1e-3 * mass,
        resolution=entry.pop("resolution_n", None),
        shear_range=None if shear is None else (shear[0], shear[1]),
        normal_range=None if normal is None else (normal[0], normal[1]),
        notes=entry.pop("notes", "").strip(),
        sources={key: text.strip() for key, text in entry.pop("sources").items()},
        **entry,
    )
