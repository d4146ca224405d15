"""SkinDesign: a magnetic skin over a board of magnetometers, from ``paxisim/data/skins.toml``."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layer.layer import Layer
from paxisim.layout import TaxelLayout
from paxisim.reference.parameters import VACUUM
from paxisim.sensors import sensor

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]

FloatArray = NDArray[np.float64]
Point = tuple[float, ...]

ACROSS, DEEP = 4, 5
"""Dipoles along a side of a cell and over the depth, at Gauss points, that stand for a skin magnetised throughout. For
AnySkin, 6 and 8 change a reading by at most 0.3 % of the largest of a press; 3 and 4 are wrong by 14 %."""

MAX_CELLS = 400
"""Largest number of contact cells; memory and time grow with its square, and this many take 3 GB and a minute."""


@dataclass(frozen=True)
class SkinDesign:
    """Design of a magnetic skin, in SI units and the pad frame.

    Use `dataclasses.replace` for another unit, such as a thicker or more strongly magnetised skin.

    Attributes:
        cells: Contact cells on the face of the skin, a flat grid.
        layer: The skin, an elastic layer bonded to its base.
        gap: Distance from the base down to the chips (m).
        chips: x and y of each chip (m), in the order of the tensor's columns.
        turns: Angle from the pad's x to each chip's x about z, from x towards y (rad).
        remanence: Remanence (T) of the skin, or of its magnets; a positive value points along z, into the pad.
        magnets: x, y and depth of the centre of each discrete magnet (m). Default: none, and the whole skin below the
            cells is magnetised.
        magnet_volume: Volume of one discrete magnet (m^3).
        noise: Standard deviation of a reading along x, y and z of a chip (uT).
        step: One count of a reading along x, y and z of a chip (uT); 0 for none.
        sources: Source of each figure of a design that `named` returns; "assumption" marks what no public source
            states.

    Raises:
        InvalidValueError: A value is not finite or has the wrong sign, the cells are not a flat grid or more than
            `MAX_CELLS`, the layer is not a bonded `Layer`, a magnet is not inside the skin, or the numbers of chips and
            turns differ.
    """

    cells: TaxelLayout
    layer: Layer
    gap: float
    chips: tuple[Point, ...]
    turns: tuple[float, ...]
    remanence: float
    magnets: tuple[Point, ...] = ()
    magnet_volume: float = 0.0
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    step: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sources: Mapping[str, str] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check the values."""
        if not isinstance(self.cells, TaxelLayout) or not isinstance(self.layer, Layer):
            got = f"{type(self.cells).__name__} and {type(self.layer).__name__}"
            raise InvalidValueError(f"expected a TaxelLayout as cells and a paxisim.Layer as layer, got {got}")
        if not self.cells.is_grid:
            raise InvalidValueError("a magnetic skin needs a flat grid of cells: curved skins are not supported")
        if self.cells.taxels > MAX_CELLS:
            raise InvalidValueError(
                f"a magnetic skin has at most {MAX_CELLS} cells, got {self.cells.rows}x{self.cells.cols}: use a larger "
                "pitch"
            )
        if not self.layer.bonded:
            raise InvalidValueError("a magnetic skin needs a bonded layer: nothing holds another against a shear force")
        if not 0 < self.gap < np.inf:
            raise InvalidValueError(f"gap must be a positive length in m, got {self.gap!r}")
        if not math.isfinite(self.remanence):
            raise InvalidValueError(f"remanence must be finite, got {self.remanence!r}")
        for name, values, length in (("chips", self.chips, 2), ("magnets", self.magnets, 3)):
            if not all(len(point) == length and np.isfinite(point).all() for point in values):
                raise InvalidValueError(f"{name} must be points of {length} finite numbers (m), got {values!r}")
        if not self.chips or len(self.turns) != len(self.chips) or not np.isfinite(self.turns).all():
            raise InvalidValueError(
                f"a skin needs chips and a finite turn for each, got {len(self.chips)} chips and turns {self.turns!r}"
            )
        if not all(0 < depth < self.layer.thickness for *_, depth in self.magnets):
            raise InvalidValueError(f"magnets must lie inside the skin, 0 to {self.layer.thickness:g} m deep")
        if self.magnets and not 0 < self.magnet_volume < np.inf:
            raise InvalidValueError(f"magnet_volume must be positive, got {self.magnet_volume!r}")
        for name in ("noise", "step"):
            values = getattr(self, name)
            if len(values) != 3 or not all(0 <= value < np.inf for value in values):
                raise InvalidValueError(f"{name} must be three numbers of 0 or more (uT), got {values!r}")

    @classmethod
    def named(cls, name: str) -> SkinDesign:
        """Return the design of a product: ``"anyskin"``, ``"reskin"`` or ``"eflesh"``.

        Few of its figures are published; `sources` says which.

        Raises:
            UnknownNameError: There is no such skin.
        """
        entries = _entries()
        if name.lower() not in entries:
            raise UnknownNameError("magnetic skin", name, entries)
        entry = entries[name.lower()]
        return cls(
            cells=sensor(name).layout,
            layer=Layer(1e6 * entry["modulus_mpa"], entry["poisson"], 1e-3 * entry["thickness_mm"]),
            gap=1e-3 * entry["gap_mm"],
            chips=_metres(entry["chips_mm"]),
            turns=tuple(math.radians(turn) for turn in entry["turns_deg"]),
            remanence=1e-3 * entry["remanence_mt"],
            magnets=_metres(entry.get("magnets_mm", ())),
            magnet_volume=1e-9 * entry.get("magnet_mm3", 0.0),
            noise=tuple(entry["noise_ut"]),
            step=tuple(entry["step_ut"]),
            sources=entry["sources"],
        )

    def dipoles(self) -> tuple[FloatArray, FloatArray]:
        """Return the dipoles that stand for the magnets at rest.

        Returns:
            ``(M, 3)`` positions (m), z being the depth below the face, and ``(M,)`` moments along z (A m^2).
        """
        if self.magnets:
            moment = self.remanence * self.magnet_volume / VACUUM
            return np.array(self.magnets), np.full(len(self.magnets), moment)
        (height, width), thickness = self.cells.pitch, self.layer.thickness
        across, share = np.polynomial.legendre.leggauss(ACROSS)
        deep, layer_share = np.polynomial.legendre.leggauss(DEEP)
        z, y, x = np.meshgrid(thickness / 2 * (1 + deep), height / 2 * across, width / 2 * across, indexing="ij")
        inside = np.stack([x, y, z], axis=-1).reshape(-1, 1, 3)
        shares = (layer_share[:, None, None] * share[:, None] * share / 8).reshape(-1, 1)
        moments = self.remanence * height * width * thickness / VACUUM * shares
        places = inside + self.cells.positions
        return places.reshape(-1, 3), np.broadcast_to(moments, places.shape[:2]).reshape(-1)


def _metres(points: Any) -> tuple[Point, ...]:
    return tuple(tuple(1e-3 * value for value in point) for point in points)


@cache
def _entries() -> dict[str, dict[str, Any]]:
    return tomllib.loads(files("paxisim").joinpath("data/skins.toml").read_text(encoding="utf-8"))
