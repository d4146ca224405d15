"""The options for the taxels of a pad, shared by several commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout


@dataclass
class Taxels:
    """A product of the catalogue, or any grid of taxels."""

    sensor: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Name of a product in `paxisim sensors`, such as paxini-gen1-l4629."""
    pool: int = 1
    """Merge blocks of POOL x POOL taxels; 2 turns the paper's 12x10 taxels into its 6x5."""
    subdivide: int = 1
    """Divide each taxel of a grid into SUBDIVIDE x SUBDIVIDE cubes, for a scene to replay: objects' edges within a pad
    are then placed better, and replay sums the cubes to the taxels of the recording."""
    rows: Annotated[int | None, tyro.conf.arg(metavar="INT")] = None
    """Number of rows of a grid, along y of the pad."""
    cols: Annotated[int | None, tyro.conf.arg(metavar="INT")] = None
    """Number of columns of a grid, along x of the pad."""
    pitch_mm: Annotated[str | None, tyro.conf.arg(metavar="MM[,MM]")] = None
    """Pitch of a grid in mm, such as 4.35,4.52 (row, column), or one number."""

    def layout(self) -> TaxelLayout:
        """Return the layout of the taxels.

        Raises:
            UnknownNameError: There is no such sensor.
            InvalidValueError: A product and a grid are given, or neither, or a number is invalid.
        """
        grid = (self.rows, self.cols, self.pitch_mm)
        if (self.sensor is None) == (grid == (None, None, None)):
            raise InvalidValueError("expected either --sensor NAME or --rows R --cols C --pitch-mm P")
        if self.sensor is not None:
            from paxisim.sensors import sensor

            layout = sensor(self.sensor).layout
        elif self.rows is None or self.cols is None or self.pitch_mm is None:
            raise InvalidValueError("a grid needs all of --rows, --cols and --pitch-mm")
        else:
            layout = TaxelLayout(self.rows, self.cols, _pitch(self.pitch_mm))
        if self.pool != 1:
            layout = layout.pool(self.pool, self.pool)
        return layout if self.subdivide == 1 else layout.subdivide(self.subdivide, self.subdivide)

    @property
    def mass(self) -> float | None:
        """Mass of the product (kg); None for a grid, or if the catalogue does not state it."""
        from paxisim.sensors import sensor

        return None if self.sensor is None else sensor(self.sensor).mass


def _pitch(text: str) -> tuple[float, float]:
    from paxisim.models.pad import LENGTHS

    try:
        values = [float(part) * 1e-3 for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, 2):
        raise InvalidValueError(f"--pitch-mm must be one or two numbers, such as 4.35,4.52, got {text!r}")
    low, high = LENGTHS
    if not all(low <= value <= high for value in values):
        raise InvalidValueError(f"--pitch-mm must lie between {1e3 * low:g} and {1e3 * high:g}, got {text!r}")
    return (values[0], values[-1])
