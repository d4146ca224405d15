"""Profile: which part is connected, and how its bytes become the pad's tensor. Data, not code.

The profiles that ship with paxisim are in ``paxisim/data/profiles.toml``, which is read on first use. `load_profile`
also reads a user's own profile from a file (`paxisim.hw.profiles.load`).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.hw.families.table import FAMILIES
from paxisim.layout import TaxelLayout

_AXES = "xyz"
_TOO_LARGE = 2**31  # operating systems store the baud rate in 32 bits; the other fields never come near this


class UnverifiedProfileWarning(UserWarning):
    """A profile is in use that was never tried on a device."""


@dataclass(frozen=True)
class Slot:
    """Name of one pad and its place on the board.

    Attributes:
        name: Name of the pad, e.g. ``"left"``.
        index: Place of the pad on the board: the port (control box), block (hand board), id (serial converter), module
            (high-speed board) or sensor number (XELA server).
    """

    name: str
    index: int


@dataclass(frozen=True)
class Profile:
    """One kind of board with its pads, all of the same part.

    Attributes:
        name: Name of the profile in lower case, as passed to `open_sensor`.
        family: A key of `paxisim.hw.families.table.FAMILIES`.
        wire_layout: Taxels as they are on the wire; `vendor_order` lists them in the order of the bytes.
        slots: The pads, in the order of the tensor's first axis.
        axes: The wire axis, with its sign, of the pad's x, y and z, e.g. ``("-y", "+x", "+z")``.
        pool: Block of taxels summed to one, as (rows, cols).
        resolution: Newtons per count; if the sensor does not measure force, its own unit per count.
        baud: Baud rate (bits per second); unused behind a server.
        rate: Nominal rate (Hz) of readings of all pads; None if no source states it.
        settings: Further settings of the family's board, with the keys listed in its row. ``mode``: mode of the control
            box. ``address`` and ``resultant_address``: addresses of the taxels and of the block before them. ``scan``:
            also look for the sensor under other ids. ``part``: part code that the version must contain.
            ``palm_counts``: where the high-speed board keeps the counts of the palm's modules, ``"contiguous"`` or
            ``"0066"``. ``signed_normal``: the hand board sends the normal force as a signed byte. ``text``: the
            magnetometer board sends its numbers as text. ``model``: model name that the XELA server must report.
        verified: Who tried the profile, and on which device; empty if it was never tried.
        notes: What to know before using the profile.
        sources: Source of each figure.

    Raises:
        InvalidValueError: A field is invalid; the message names it.
    """

    name: str
    family: str
    wire_layout: TaxelLayout
    slots: tuple[Slot, ...]
    axes: tuple[str, str, str] = ("+x", "+y", "+z")
    pool: tuple[int, int] = (1, 1)
    resolution: float = 0.1
    baud: int = 460800
    rate: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    verified: str = ""
    notes: str = ""
    sources: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        """Check the fields."""
        if self.family not in FAMILIES:
            raise InvalidValueError(str(UnknownNameError("family", str(self.family), FAMILIES)))
        signed = [axis[:1] in ("+", "-") and len(axis) == 2 and axis[1] in _AXES for axis in self.axes]
        if len(signed) != 3 or not all(signed) or {axis[1] for axis in self.axes} != set(_AXES):
            raise InvalidValueError(
                f"axes must be x, y and z in some order, each with its sign, such as ['-y', '+x', '+z'], "
                f"got {list(self.axes)}"
            )
        if not self.slots:
            raise InvalidValueError("slots must list at least one pad")
        for kind in ("name", "index"):
            values = [getattr(slot, kind) for slot in self.slots]
            if len(set(values)) != len(values):
                raise InvalidValueError(f"two slots must not have the same {kind}, got {values}")
        if min(slot.index for slot in self.slots) < 0:
            raise InvalidValueError(f"a slot's index must not be negative, got {[slot.index for slot in self.slots]}")
        for kind in ("resolution", "baud", "rate"):
            value = getattr(self, kind)
            if value is not None and not 0 < value < _TOO_LARGE:
                raise InvalidValueError(f"{kind} must be a positive number below {_TOO_LARGE}, got {value!r}")
        known = FAMILIES[self.family].settings
        for key, value in self.settings.items():
            if key not in known:
                kind = f"setting of the family {self.family}"
                raise InvalidValueError(str(UnknownNameError(kind, str(key), known)))
            if type(value) is not known[key]:
                raise InvalidValueError(f"setting {key} must be of type {known[key].__name__}, got {value!r}")
        self.wire_layout.pool(*self.pool)

    @cached_property
    def layout(self) -> TaxelLayout:
        """Taxels of a pad after pooling: the layout of `Frame.force`."""
        return self.wire_layout if self.pool == (1, 1) else self.wire_layout.pool(*self.pool)

    @property
    def unit(self) -> str:
        """Unit of the tensor: ``"N"``, or ``"uT"`` (microtesla) or ``"counts"`` if it is not a force."""
        return FAMILIES[self.family].unit

    @property
    def has_positions(self) -> bool:
        """False if the taxels form one row in the order of the bytes because their positions are unknown."""
        return not (self.wire_layout.is_grid and 1 in (self.wire_layout.rows, self.wire_layout.cols))

    @cached_property
    def _signs(self) -> NDArray[np.int16]:
        return np.array([-1 if axis[0] == "-" else 1 for axis in self.axes], dtype=np.int16)

    @cached_property
    def _places(self) -> NDArray[np.intp]:
        """Index into the wire's counts for each value of the pad's tensor in row-major order, ``(3 * N,)``."""
        taxels = self.wire_layout.taxels
        order = self.wire_layout.vendor_order
        place = np.arange(taxels) if order is None else np.argsort(order)
        wire_axis = np.array([_AXES.index(axis[1]) for axis in self.axes])
        return (3 * place[None, :] + wire_axis[:, None]).reshape(-1)

    def to_force(self, counts: NDArray[np.number]) -> NDArray[np.float32]:
        """Convert ``(..., N, 3)`` counts from the wire to pooled ``(..., 3, rows, cols)`` float32 values in `unit`.

        Counts are pooled before scaling, so every value is the float32 nearest to a whole number of steps.

        Raises:
            InvalidValueError: `counts` has another shape.
        """
        counts = self._check_counts(counts)
        lead = counts.shape[:-2]
        taxels = counts.reshape((*lead, -1))[..., self._places].reshape((*lead, *self.wire_layout.shape))
        signed = taxels * self._signs[:, None, None]
        if self.pool != (1, 1):
            signed = self.wire_layout.pool_force(signed, *self.pool)
        return self._scaled(signed)

    def resultant_force(self, counts: NDArray[np.int16]) -> NDArray[np.float32]:
        """Convert ``(..., 3)`` counts of a pad's total, as reported, to ``(..., 3)`` float32 newtons, pad frame."""
        wire_axis = [_AXES.index(axis[1]) for axis in self.axes]
        return self._scaled(np.asarray(counts)[..., wire_axis] * self._signs)

    def to_counts(self, force: NDArray[np.floating], gate: int = 0, shear_floor: int = 0) -> NDArray[Any]:
        """Convert ``(..., 3, rows, cols)`` newtons of the **wire** layout to ``(..., N, 3)`` counts, as firmware does.

        Components below `gate` counts are set to 0. If the family's counts are whole numbers, the result is int16,
        rounded and clipped to the family's range; otherwise it is float32. Apart from that, this is the inverse of
        `to_force` without pooling. With a `shear_floor`, for whole numbers, a taxel whose z is 0 reads 0, and x and y
        of any other have at least this magnitude, with the sign of the force.

        Raises:
            InvalidValueError: `force` has another shape.
        """
        force = np.asarray(force, dtype=np.float64)
        self.wire_layout.check(force)
        lead = force.shape[:-3]
        signed = force / self.resolution * self._signs[:, None, None]
        counts = signed.reshape((*lead, -1))[..., np.argsort(self._places)].reshape((*lead, -1, 3))
        limits = FAMILIES[self.family].counts
        if limits is None:
            return np.where(np.abs(counts) < gate, 0, counts).astype(np.float32)
        unrounded, counts = counts, np.rint(counts)
        counts[np.abs(counts) < gate] = 0
        if shear_floor:
            shear, is_on = counts[..., :2], counts[..., 2:] > 0
            raised = np.where(unrounded[..., :2] < 0, -shear_floor, shear_floor)
            counts[..., :2] = np.where(is_on, np.where(np.abs(shear) < shear_floor, raised, shear), 0)
        return np.clip(counts, *limits).astype(np.int16)

    def warn_unverified(self) -> None:
        """Warn if this profile was never tried on a device.

        Warns:
            UnverifiedProfileWarning: `verified` is empty.
        """
        if not self.verified:
            warnings.warn(
                f"profile {self.name!r} was never tried on a device: order, axes and signs may be wrong; "
                "`paxisim device check` finds them and writes a profile",
                UnverifiedProfileWarning,
                stacklevel=3,
            )

    def _scaled(self, counts: NDArray[np.number]) -> NDArray[np.float32]:
        # double precision avoids rounding 0.1 N twice; row-major, whatever order the indexing left
        return np.multiply(counts, self.resolution, dtype=np.float64).astype(np.float32, order="C")

    def _check_counts(self, counts: NDArray[np.number]) -> NDArray[np.number]:
        counts = np.asarray(counts)
        if counts.shape[-2:] != (self.wire_layout.taxels, 3):
            raise InvalidValueError(f"expected counts of shape (..., {self.wire_layout.taxels}, 3), got {counts.shape}")
        return counts
