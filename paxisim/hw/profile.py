"""Profile: which part hangs on the line, and how its bytes become the pad's tensor. Data, not code.

The profiles that ship with paxisim live in ``paxisim/data/profiles.toml``, read on first use; `load_profile` reads a
user's own from a file as well (`paxisim.hw.profile_file`).
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.hw.families import FAMILIES
from paxisim.layout import TaxelLayout

_AXES = "xyz"
_TOO_LARGE = 2**31  # a system's baud rate is a number of 32 bits; for the others it is far beyond sense


class UnverifiedProfileWarning(UserWarning):
    """A profile is used that was never tried on a device."""


@dataclass(frozen=True)
class Slot:
    """Where one pad hangs.

    Attributes:
        name: The pad's name, e.g. ``"left"``.
        index: Its place on the board: the port (control box), block (hand board), id (serial converter), module
            (high-speed board) or the sensor's number (XELA server).
    """

    name: str
    index: int


@dataclass(frozen=True)
class Profile:
    """One kind of board with its pads, all of the same part.

    Attributes:
        name: Lower case, as `open_sensor` takes it.
        family: A key of `paxisim.hw.families.FAMILIES`.
        wire_layout: The taxels as they are on the wire; `vendor_order` lists them in the order of the bytes.
        slots: The pads, in the order of the tensor's first axis.
        axes: For the pad's x, y and z, which axis of the wire it is and with which sign, e.g. ``("-y", "+x", "+z")``.
        pool: Taxels summed to one, as (rows, cols).
        resolution: Newtons a count; of a sensor that does not measure forces, its unit.
        baud: Bits a second; of no use behind a server.
        rate: Readings of all pads a second (Hz), nominal; None where no source says.
        settings: What the family's board needs besides, of the keys that its row lists. ``mode``: the control box's.
            ``address`` and ``resultant_address``: of the taxels and of the block before them. ``scan``: look for the
            sensor under other ids, too. ``part``: the code that its version must name. ``palm_counts``: where the
            high-speed board keeps the counts of the palm's modules, ``"contiguous"`` or ``"0066"``.
            ``signed_normal``: the hand board sends the normal force as a signed byte. ``text``: the magnetometer board
            prints its numbers. ``model``: what the XELA server must call the sensor.
        verified: By whom and on what this was tried; empty means that it never was.
        notes: What to know before using it.
        sources: For each figure, where it comes from.

    Raises:
        InvalidValueError: A field that cannot be; the message names it.
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
                f"axes must be x, y and z in some order, each with its sign, as ['-y', '+x', '+z'], "
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
        """The pad's taxels after pooling: the layout of `Frame.force`."""
        return self.wire_layout if self.pool == (1, 1) else self.wire_layout.pool(*self.pool)

    @property
    def unit(self) -> str:
        """Unit of the tensor: ``"N"``; ``"uT"`` (microtesla) or ``"counts"`` where it is not a force."""
        return FAMILIES[self.family].unit

    @property
    def has_positions(self) -> bool:
        """False where the taxels are a row in the order of the bytes, because nobody says where they sit."""
        return not (self.wire_layout.is_grid and 1 in (self.wire_layout.rows, self.wire_layout.cols))

    @cached_property
    def _signs(self) -> NDArray[np.int16]:
        return np.array([-1 if axis[0] == "-" else 1 for axis in self.axes], dtype=np.int16)

    @cached_property
    def _places(self) -> NDArray[np.intp]:
        """``(3 * N,)``: for each value of the pad's tensor, row-major, its place among the counts of the wire."""
        taxels = self.wire_layout.taxels
        order = self.wire_layout.vendor_order
        place = np.arange(taxels) if order is None else np.argsort(order)
        wire_axis = np.array([_AXES.index(axis[1]) for axis in self.axes])
        return (3 * place[None, :] + wire_axis[:, None]).reshape(-1)

    def to_force(self, counts: NDArray[np.number]) -> NDArray[np.float32]:
        """``(..., N, 3)`` counts as they come on the wire -> ``(..., 3, rows, cols)`` float32 in `unit`, pooled.

        Counts are pooled before they become newtons, so every value is the float32 nearest to a whole number of steps.

        Raises:
            InvalidValueError: `counts` is not of that shape.
        """
        counts = self._check_counts(counts)
        lead = counts.shape[:-2]
        taxels = counts.reshape((*lead, -1))[..., self._places].reshape((*lead, *self.wire_layout.shape))
        signed = taxels * self._signs[:, None, None]
        if self.pool != (1, 1):
            signed = self.wire_layout.pool_force(signed, *self.pool)
        return self._scaled(signed)

    def resultant_force(self, counts: NDArray[np.int16]) -> NDArray[np.float32]:
        """``(..., 3)`` counts of a pad's total as the board reports it -> ``(..., 3)`` float32 newtons, pad frame."""
        wire_axis = [_AXES.index(axis[1]) for axis in self.axes]
        return self._scaled(np.asarray(counts)[..., wire_axis] * self._signs)

    def to_counts(self, force: NDArray[np.floating], gate: int = 0) -> NDArray[Any]:
        """``(..., 3, rows, cols)`` newtons of the **wire** layout -> ``(..., N, 3)`` counts, as firmware sends them.

        Components below `gate` counts are set to 0. Where the family's counts are whole numbers (int16), they are
        rounded and clipped to what it can express, else they are float32. The inverse of `to_force` up to that, where
        nothing is pooled.

        Raises:
            InvalidValueError: `force` is not of that shape.
        """
        force = np.asarray(force, dtype=np.float64)
        self.wire_layout.check(force)
        lead = force.shape[:-3]
        signed = force / self.resolution * self._signs[:, None, None]
        counts = signed.reshape((*lead, -1))[..., np.argsort(self._places)].reshape((*lead, -1, 3))
        limits = FAMILIES[self.family].counts
        if limits is None:
            return np.where(np.abs(counts) < gate, 0, counts).astype(np.float32)
        counts = np.rint(counts)
        counts[np.abs(counts) < gate] = 0
        return np.clip(counts, *limits).astype(np.int16)

    def warn_unverified(self) -> None:
        """Warn where nobody has tried this profile on a device.

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
        # in double precision, or 0.1 N would be rounded twice; row-major, whatever order the indexing left behind
        return np.multiply(counts, self.resolution, dtype=np.float64).astype(np.float32, order="C")

    def _check_counts(self, counts: NDArray[np.number]) -> NDArray[np.number]:
        counts = np.asarray(counts)
        if counts.shape[-2:] != (self.wire_layout.taxels, 3):
            raise InvalidValueError(f"expected counts of shape (..., {self.wire_layout.taxels}, 3), got {counts.shape}")
        return counts


def known_profiles() -> tuple[str, ...]:
    """The names of the profiles that ship with paxisim, aliases included. Needs no optional package."""
    from paxisim.hw import profile_file

    return profile_file.shipped_names()


def load_profile(name: str | os.PathLike[str]) -> Profile:
    """The profile of that name, or that of a TOML file.

    A profile file, with all keys it can have (`like` or both `family` and `layout` are needed, as are slots)::

        name = "my-gripper"               # default: the file's name
        like = "gen2-box-120"             # start from this known profile; what follows replaces its keys
        family = "control-box"            # a key of paxisim.hw.families.FAMILIES
        axes = ["-y", "+x", "+z"]         # the wire's axis, with sign, that is the pad's x, y, z
        pool = [2, 2]                     # rows and columns of taxels summed to one
        resolution = 0.1                  # N a count
        baud = 460800
        rate = 300                        # Hz
        verified = "A. User, 2025-03-01, DP-M2826 on connector 1"
        notes = "..."

        [layout]                          # the fields of TaxelLayout, in m
        rows = 12
        cols = 10
        pitch = [0.0022, 0.0022]
        vendor_order = [110, 100, ...]    # row-major place of each taxel in the order of the bytes
        positions = [[0.0, 0.0, 0.0], ...]  # with normals, for a curved part; or instead of all of these
        coordinates = "paxini-sdk:PXSR-STDDP03G"

        [[slots]]                         # one for each pad, in the tensor's order
        name = "left"
        index = 2                         # port, block, id or module, see Slot

        [settings]                        # see Profile.settings
        mode = 5

        [sources]                         # any figure and where it comes from
        rate = "measured with paxisim device quality"

    Args:
        name: A name from `known_profiles`, in any case, or the path of a file that ends in ``.toml`` and holds one
            profile.

    Raises:
        UnknownNameError: There is no such profile.
        InvalidValueError: The file is not a profile.
        OSError: The file cannot be read.
        MissingExtraError: It needs the coordinates of a curved part and paxini-sdk is not installed.
    """
    from paxisim.hw import profile_file

    name = os.fspath(name)
    if name.endswith(".toml"):
        return profile_file.read_profile(Path(name))
    return profile_file.shipped_profile(name)


def as_profile(profile: str | os.PathLike[str] | Profile) -> Profile:
    """The profile itself, or the one that `load_profile` finds by what is given."""
    return profile if isinstance(profile, Profile) else load_profile(profile)
