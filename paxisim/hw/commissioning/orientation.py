"""The eight orientations of a picture: turned by quarters, mirrored, or both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout


@dataclass(frozen=True)
class Orientation:
    """Correction of a picture's orientation: turn it, then mirror it.

    Attributes:
        quarters: Number of clockwise turns by 90 degrees.
        mirrored: Whether to exchange left and right afterwards.
        text: The correction in words.
    """

    quarters: int
    mirrored: bool
    text: str

    @property
    def is_identity(self) -> bool:
        """True if the picture needs no correction."""
        return self.quarters == 0 and not self.mirrored

    @property
    def exchanges(self) -> bool:
        """True if rows become columns."""
        return self.quarters % 2 == 1

    def of_picture(self, picture: NDArray[np.integer]) -> NDArray[np.integer]:
        """Return a ``(rows, cols)`` picture corrected; its shape is ``(cols, rows)`` if `exchanges` is True."""
        turned = np.rot90(picture, -self.quarters)
        return np.ascontiguousarray(turned[:, ::-1] if self.mirrored else turned)

    def of_points(self, layout: TaxelLayout) -> TaxelLayout:
        """Return the layout with corrected positions and normals, in the same order."""
        if self.is_identity:
            return layout
        # a quarter turn clockwise maps x to y, which points down, and y to -x
        quarter = np.array([[0, -1], [1, 0]])
        matrix = np.eye(3)
        matrix[:2, :2] = np.linalg.matrix_power(quarter, self.quarters)
        if self.mirrored:
            matrix[0] *= -1
        pitch = layout.pitch[::-1] if self.exchanges else layout.pitch
        return replace(layout, pitch=pitch, positions=layout.positions @ matrix.T, normals=layout.normals @ matrix.T)


ORIENTATIONS = (
    Orientation(0, False, "the picture is correct"),
    Orientation(1, False, "the picture must be turned by 90 degrees clockwise"),
    Orientation(2, False, "the picture must be turned by 180 degrees"),
    Orientation(3, False, "the picture must be turned by 90 degrees anticlockwise"),
    Orientation(0, True, "left and right must be exchanged"),
    Orientation(1, True, "rows and columns must be exchanged"),
    Orientation(2, True, "top and bottom must be exchanged"),
    Orientation(3, True, "rows and columns must be exchanged, and the picture turned by 180 degrees"),
)
"""All eight, the identity first."""
