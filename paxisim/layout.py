"""TaxelLayout: positions of a sensor's taxels and the layout of the force tensor.

Shape conventions, used by every module of paxisim:

- A reading is ``(..., pads, 3, rows, cols)`` float32 in newtons, or ``(..., 3, rows, cols)`` for one pad.
- Axis order is x, y, z in the **pad frame**. Seen from outside, facing the sensing surface, row 0 is at the
  top and column 0 at the left; x points right (increasing column), y points down (increasing row), z points away
  from the viewer, into the pad. The frame is right-handed; its origin is the centre of the flat sensing surface.
- A value is the force that the object exerts on the pad: compression is positive z.
- ``N = rows * cols`` taxels are numbered in row-major order: taxel ``i`` is row ``i // cols``, column ``i % cols``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError

MAX_TAXELS = 1_000_000
"""Maximum number of taxels, far beyond any sensor, so that a typing error cannot exhaust the memory."""
MAX_PITCH = 1.0
"""Maximum pitch (m), far beyond any sensor; a larger value is probably in another unit."""


@dataclass(frozen=True, eq=False)
class TaxelLayout:
    """The taxels of one pad: a grid of `rows` x `cols`, or an arbitrary set of points as ``rows=1, cols=N``.

    Attributes:
        rows: Number of rows, along y.
        cols: Number of columns, along x.
        pitch: Size of a taxel (m) as (row pitch along y, column pitch along x). For explicit positions, the footprint
            of one taxel.
        positions: ``(N, 3)`` taxel centres on the sensing surface (m, pad frame), row-major. Default: the
            flat grid, centred, at z = 0.
        normals: ``(N, 3)`` unit normals pointing **out of** the pad (pad frame). Default: ``(0, 0, -1)``.
        vendor_order: Permutation of ``range(N)``: the row-major index of each taxel, in the order of the vendor's flat
            readings. Default: row-major.
        pitch_known: False if `pitch` is a stand-in, because a file states rows and columns only. Not compared.

    Raises:
        InvalidValueError: A count is below one, there are more than `MAX_TAXELS` taxels, the pitch is not positive,
            finite and at most `MAX_PITCH`, positions or normals have the wrong shape, a normal has zero length, or
            `vendor_order` is not a permutation.
    """

    rows: int
    cols: int
    pitch: tuple[float, float]
    positions: NDArray[np.floating] = field(default=None)  # type: ignore[assignment]
    normals: NDArray[np.floating] = field(default=None)  # type: ignore[assignment]
    vendor_order: tuple[int, ...] | None = None
    pitch_known: bool = True

    def __post_init__(self) -> None:
        """Check the fields and fill in the flat grid."""
        for name in ("rows", "cols"):
            value = getattr(self, name)
            is_number = isinstance(value, (int, float, np.integer, np.floating)) and np.isfinite(value)
            if not is_number or isinstance(value, bool) or value < 1 or int(value) != value:
                raise InvalidValueError(f"{name} must be a whole number of at least 1, got {value!r}")
            object.__setattr__(self, name, int(value))
        if self.taxels > MAX_TAXELS:
            raise InvalidValueError(f"a layout has at most {MAX_TAXELS} taxels, got {self.rows}x{self.cols}")
        try:
            pitch = tuple(float(p) for p in np.broadcast_to(np.asarray(self.pitch, dtype=float), (2,)))
        except (TypeError, ValueError):
            pitch = (np.nan, np.nan)
        if not all(np.isfinite(p) and p > 0 for p in pitch):
            raise InvalidValueError(f"pitch must be two positive finite lengths in m, got {self.pitch!r}")
        if max(pitch) > MAX_PITCH:
            raise InvalidValueError(
                f"pitch must be in m, got {self.pitch!r}: taxels of {max(pitch):g} m; were millimetres meant, "
                f"{tuple(float(f'{1e-3 * p:.6g}') for p in pitch)}?"
            )
        object.__setattr__(self, "pitch", pitch)
        positions = self.positions if self.positions is not None else self._grid_positions()
        normals = self.normals if self.normals is not None else np.tile([0.0, 0.0, -1.0], (self.taxels, 1))
        object.__setattr__(self, "positions", self._points("positions", positions))
        normals = self._points("normals", normals)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.any(length < 1e-9):
            raise InvalidValueError(f"normals must not have zero length, but that of taxel {int(length.argmin())} has")
        # unit normals are kept bit for bit, so that a copy compares equal
        normals = np.where(np.abs(length - 1) < 1e-12, normals, normals / length)
        normals.setflags(write=False)
        object.__setattr__(self, "normals", normals)
        if self.vendor_order is not None:
            order = tuple(int(i) for i in self.vendor_order)
            if sorted(order) != list(range(self.taxels)):
                raise InvalidValueError(f"vendor_order must be a permutation of 0..{self.taxels - 1}")
            object.__setattr__(self, "vendor_order", order)
        if not isinstance(self.pitch_known, bool):
            raise InvalidValueError(f"pitch_known must be true or false, got {self.pitch_known!r}")

    def _grid_positions(self) -> NDArray[np.floating]:
        y = (np.arange(self.rows) - (self.rows - 1) / 2) * self.pitch[0]
        x = (np.arange(self.cols) - (self.cols - 1) / 2) * self.pitch[1]
        grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
        return np.stack([grid_x, grid_y, np.zeros_like(grid_x)], axis=-1).reshape(-1, 3)

    def _points(self, name: str, value: ArrayLike) -> NDArray[np.floating]:
        try:
            points = np.array(value, dtype=np.float64) + 0.0  # no negative zeros, which equal zero but hash differently
        except (TypeError, ValueError) as error:
            raise InvalidValueError(f"{name} must be {self.taxels} points of three numbers") from error
        if points.shape != (self.taxels, 3):
            raise InvalidValueError(
                f"{name} must have shape ({self.taxels}, 3) for {self.rows}x{self.cols} taxels, got {points.shape}"
            )
        if not np.all(np.isfinite(points)):
            raise InvalidValueError(f"{name} must be finite")
        points.setflags(write=False)
        return points

    def __repr__(self) -> str:
        """One line without the coordinates."""
        height, width = (f"{1e3 * length:.4g}" for length in (self.pitch if self.is_grid else self.size))
        what = f"pitch {height} x {width} mm" if self.is_grid else f"positions of its own in {height} x {width} mm"
        order = ", vendor's order" if self.vendor_order is not None else ""
        return f"TaxelLayout({self.rows}x{self.cols}, {what}{order})"

    def __eq__(self, other: object) -> bool:
        """Whether all fields but `pitch_known` are equal, arrays included."""
        if not isinstance(other, TaxelLayout):
            return NotImplemented
        mine = (self.rows, self.cols, self.pitch, self.vendor_order)
        theirs = (other.rows, other.cols, other.pitch, other.vendor_order)
        return (
            mine == theirs
            and np.array_equal(self.positions, other.positions)
            and np.array_equal(self.normals, other.normals)
        )

    def __hash__(self) -> int:
        """Hash of the fields that equality compares."""
        return hash(
            (self.rows, self.cols, self.pitch, self.vendor_order, self.positions.tobytes(), self.normals.tobytes())
        )

    @property
    def taxels(self) -> int:
        """Number of taxels, rows x cols."""
        return self.rows * self.cols

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of one pad's reading, ``(3, rows, cols)``."""
        return (3, self.rows, self.cols)

    @property
    def is_grid(self) -> bool:
        """Whether the layout is the flat regular grid, without other positions or normals."""
        return np.array_equal(self.positions, self._grid_positions()) and bool(np.all(self.normals[:, 2] == -1))

    @property
    def size(self) -> tuple[float, float]:
        """Extent of the pad (m) as (height along y, width along x), including the footprints of the outer taxels."""
        span = np.ptp(self.positions[:, :2], axis=0)
        return (float(span[1] + self.pitch[0]), float(span[0] + self.pitch[1]))

    @property
    def frames(self) -> NDArray[np.floating]:
        """Taxel frames ``(N, 3, 3)``: columns are each taxel's x, y, z axes in the pad frame.

        z is the inward normal. x is the pad's x projected onto the surface, or, for a taxel that faces along x, chosen
        so that y is the projection of the pad's y.
        """
        z = -self.normals
        x = np.tile([1.0, 0.0, 0.0], (self.taxels, 1))
        x -= np.sum(x * z, axis=1, keepdims=True) * z
        length = np.linalg.norm(x, axis=1)
        steep = length < 0.1
        if np.any(steep):
            y = np.tile([0.0, 1.0, 0.0], (int(steep.sum()), 1))
            x[steep] = np.cross(y, z[steep])
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        return np.stack([x, np.cross(z, x), z], axis=-1)

    def pool(self, rows: int, cols: int) -> TaxelLayout:
        """Return the coarser layout in which each block of `rows` x `cols` taxels is one taxel.

        Args:
            rows: Taxels pooled along y; must divide `self.rows`.
            cols: Taxels pooled along x; must divide `self.cols`.

        Returns:
            The pooled layout; a block is placed at the mean of its taxels. The vendor's order is dropped.

        Raises:
            InvalidValueError: The block does not divide the grid.
        """
        out_rows, out_cols = self._pooled_shape(rows, cols)
        pitch = (self.pitch[0] * rows, self.pitch[1] * cols)
        if self.is_grid:
            return TaxelLayout(out_rows, out_cols, pitch, pitch_known=self.pitch_known)

        def mean(points: NDArray[np.floating]) -> NDArray[np.floating]:
            return points.reshape(out_rows, rows, out_cols, cols, 3).mean(axis=(1, 3)).reshape(-1, 3)

        places = mean(self.positions), mean(self.normals)
        return TaxelLayout(out_rows, out_cols, pitch, *places, pitch_known=self.pitch_known)

    def subdivide(self, rows: int, cols: int) -> TaxelLayout:
        """Return the finer grid in which each taxel is a block of `rows` x `cols` taxels, the inverse of `pool`.

        An object's edge that lies within a pad is where a simulated taxel ends. A finer pad places it better; replay
        sums its taxels to those of the recording.

        Args:
            rows: Number of taxels along y for each taxel.
            cols: Number of taxels along x for each taxel.

        Raises:
            InvalidValueError: A number is below 1, or the layout is not a flat grid.
        """
        if rows < 1 or cols < 1:
            raise InvalidValueError(f"cannot divide a taxel into {rows}x{cols} taxels")
        if not self.is_grid:
            raise InvalidValueError("only the taxels of a flat grid can be subdivided")
        pitch = (self.pitch[0] / rows, self.pitch[1] / cols)
        return TaxelLayout(self.rows * rows, self.cols * cols, pitch, pitch_known=self.pitch_known)

    def pool_force(self, force: Any, rows: int, cols: int) -> Any:
        """Sum a reading over blocks of `rows` x `cols` taxels; the total force is conserved.

        Args:
            force: ``(..., 3, self.rows, self.cols)`` forces (N), numpy or torch.
            rows: Taxels pooled along y.
            cols: Taxels pooled along x.

        Returns:
            ``(..., 3, self.rows / rows, self.cols / cols)`` forces (N), of the same array library and dtype, with the
            layout `self.pool(rows, cols)`.

        Raises:
            InvalidValueError: The block does not divide the grid, or `force` does not have this layout.
        """
        out_rows, out_cols = self._pooled_shape(rows, cols)
        self.check(force)
        blocks = force.reshape((*force.shape[:-2], out_rows, rows, out_cols, cols))
        return blocks.sum(-1).sum(-2)

    def _pooled_shape(self, rows: int, cols: int) -> tuple[int, int]:
        if rows < 1 or cols < 1 or self.rows % rows or self.cols % cols:
            raise InvalidValueError(f"cannot pool {self.rows}x{self.cols} taxels in blocks of {rows}x{cols}")
        return self.rows // rows, self.cols // cols

    def check(self, force: Any, pads: int | None = None) -> None:
        """Raise unless `force` ends in this layout's shape.

        Args:
            force: Any object with a ``shape``.
            pads: Expected number of pads before ``(3, rows, cols)``. Default: not checked.

        Raises:
            InvalidValueError: The shape does not fit.
        """
        expected = self.shape if pads is None else (pads, *self.shape)
        shape = tuple(force.shape)
        if shape[-len(expected) :] != expected:
            text = ", ".join(str(n) for n in expected)
            raise InvalidValueError(f"expected a tensor of shape (..., {text}), got {shape}")

    def to_dict(self) -> dict[str, Any]:
        """Return the layout as plain lists and numbers for JSON, which `from_dict` restores bit for bit."""
        document: dict[str, Any] = {"rows": self.rows, "cols": self.cols, "pitch": list(self.pitch)}
        if not self.is_grid:
            document |= {"positions": self.positions.tolist(), "normals": self.normals.tolist()}
        if self.vendor_order is not None:
            document["vendor_order"] = list(self.vendor_order)
        if not self.pitch_known:
            document["pitch_known"] = False
        return document

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> TaxelLayout:
        """Return the layout that `to_dict` wrote.

        Raises:
            InvalidValueError: A field is missing, unknown or not usable.
        """
        if not isinstance(document, dict):
            raise InvalidValueError(f"expected an object with the fields of a TaxelLayout, got {document!r}")
        try:
            return cls(**document)
        except InvalidValueError:
            raise
        except (TypeError, ValueError, OverflowError, RecursionError) as error:
            raise InvalidValueError(f"expected the fields of a TaxelLayout, got {sorted(document)}") from error

    def to_image(self, force: Any) -> Any:
        """Convert ``(..., 3, rows, cols)`` to a view ``(..., rows, cols, 3)``; numpy or torch."""
        self.check(force)
        return _move_axis(force, -3, -1)

    def from_image(self, image: Any) -> Any:
        """Convert ``(..., rows, cols, 3)`` to a view ``(..., 3, rows, cols)``; numpy or torch.

        Raises:
            InvalidValueError: The shape does not fit.
        """
        if tuple(image.shape[-3:]) != (self.rows, self.cols, 3):
            raise InvalidValueError(
                f"expected an array of shape (..., {self.rows}, {self.cols}, 3), got {tuple(image.shape)}"
            )
        return _move_axis(image, -1, -3)

    def to_policy(self, history: Any) -> Any:
        """Reshape a history of readings, oldest first, to a policy input.

        ``(..., history, pads, 3, rows, cols)`` becomes ``(..., history * pads * 3, rows, cols)``.
        """
        self.check(history)
        if len(history.shape) < 5:
            raise InvalidValueError(
                f"expected a tensor of shape (..., history, pads, 3, rows, cols), got {tuple(history.shape)}"
            )
        return history.reshape((*history.shape[:-5], -1, self.rows, self.cols))

    def from_policy(self, channels: Any, pads: int) -> Any:
        """Invert `to_policy`: ``(..., C, rows, cols)`` to ``(..., C / (3 pads), pads, 3, rows, cols)``.

        Raises:
            InvalidValueError: The shape does not fit, or C is not a multiple of ``3 * pads``.
        """
        shape = tuple(channels.shape)
        if pads < 1:
            raise InvalidValueError(f"expected at least one pad, got {pads}")
        if len(shape) < 3 or shape[-2:] != (self.rows, self.cols) or shape[-3] % (3 * pads):
            raise InvalidValueError(
                f"expected a tensor of shape (..., k * {3 * pads}, {self.rows}, {self.cols}), got {shape}"
            )
        return channels.reshape((*shape[:-3], -1, pads, *self.shape))

    def to_flat(self, force: Any) -> Any:
        """Convert ``(..., 3, rows, cols)`` to ``(..., 3 N)``: x, y, z of each taxel in the vendor's order."""
        self.check(force)
        lead = tuple(force.shape[:-3])
        taxels = _move_axis(force.reshape((*lead, 3, self.taxels)), -2, -1)
        if self.vendor_order is not None:
            taxels = taxels[..., np.asarray(self.vendor_order), :]
        return taxels.reshape((*lead, 3 * self.taxels))

    def from_flat(self, values: Any) -> Any:
        """Invert `to_flat`: ``(..., 3 N)`` in the vendor's order to ``(..., 3, rows, cols)``.

        Raises:
            InvalidValueError: The last axis does not have length 3 N.
        """
        shape = tuple(values.shape)
        if not shape or shape[-1] != 3 * self.taxels:
            raise InvalidValueError(f"expected flat values of shape (..., {3 * self.taxels}), got {shape}")
        taxels = values.reshape((*shape[:-1], self.taxels, 3))
        if self.vendor_order is not None:
            taxels = taxels[..., np.argsort(np.asarray(self.vendor_order)), :]
        return _move_axis(taxels, -1, -2).reshape((*shape[:-1], *self.shape))


def _move_axis(array: Any, source: int, target: int) -> Any:
    from array_api_compat import array_namespace

    return array_namespace(array).moveaxis(array, source, target)
