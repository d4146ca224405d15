"""Magnetometer bursts that the boards of AnySkin, ReSkin and eFlesh stream unprompted. No I/O.

A burst holds four little-endian float32 for each chip, in the order of the board's bus: temperature (degC) and flux x,
y, z (uT). It ends with CR LF: ``16 chips + 2`` bytes, 82 for five chips. A second sketch by the same authors prints the
numbers as text with two decimals, one burst per line. Sources: the sketches ``5X_binary_burst_stream`` and
``5X_burst_stream`` of github.com/raunaqbhirangi/anyskin; the MIT package ``anyskin`` 1.0.0 reads the former.

There is **no header, no checksum and no counter**, and CR LF may occur inside floats. A burst is therefore accepted
only if CR LF precedes and ends it, exactly one burst apart, and if each number is one that a chip can give. If a burst
also contains CR LF, the decoder waits for the CR LF of the next burst. Undetectable: a changed byte that leaves a
number plausible, and the loss of whole bursts. Detected, at the cost of the affected burst: lost bytes. If the CR or LF
is lost, the next burst is lost too, since its beginning is unknown. In text, a lost digit yields a different number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.link.framing import Decoder

LINE_END = b"\r\n"
BYTES_PER_CHIP = 16
MAX_CHIPS = 16
"""Largest number of magnetometers to try if the number is unknown."""
MIN_ABSOLUTE, MAX_ABSOLUTE = 1e-6, 1e6
"""Bounds on the absolute value of a nonzero temperature or flux. A chip's steps are larger than a tenth of a
microtesla, and its range ends below 0.1 T; misaligned bytes soon give values outside these bounds."""
_NUMBER = re.compile(rb"-?\d{1,7}\.\d\d")
_LONGEST_NUMBER = 12  # characters, including the separator


@dataclass(frozen=True, eq=False)
class Burst:
    """One reading of all chips.

    Attributes:
        values: ``(chips, 4)`` float32: temperature (degC) and flux x, y, z (uT) of each chip.
    """

    values: NDArray[np.float32]

    def encode(self) -> bytes:
        """Encode the burst as the binary sketch sends it."""
        return np.ascontiguousarray(self.values, dtype="<f4").tobytes() + LINE_END

    def encode_text(self) -> bytes:
        """Encode the burst as the text sketch prints it: no tab between a chip's z and the next chip's temperature."""
        return b"".join(b"\t".join(b"%.2f" % value for value in chip) for chip in self.values.tolist()) + LINE_END


class BurstDecoder(Decoder[Burst]):
    """A `Decoder` of binary bursts with a known number of chips."""

    def __init__(self, chips: int) -> None:
        """Start with an empty buffer, searching for the first burst.

        Args:
            chips: Number of chips in a burst.
        """
        super().__init__()
        self._floats = BYTES_PER_CHIP * chips
        self._stride = self._floats + len(LINE_END)
        self._in_step = False

    def clear(self) -> None:
        """See `Decoder.clear`."""
        super().clear()
        self._in_step = False

    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Burst | None]:
        while True:
            begin = at if self._in_step else self._search(buffer, at)
            if begin < 0:
                return -begin - 1, -begin - 1, None
            burst = self._read(buffer, begin)
            if burst is None and len(buffer) < begin + self._stride:
                return begin, begin, None
            stands = None if burst is None else self._stands(buffer, begin, silent)
            if burst is not None and stands is None:
                return begin, begin, None
            self._in_step = bool(stands)
            if burst is not None and stands:
                return begin, begin + self._stride, burst
            at = begin

    def _search(self, buffer: bytes, at: int) -> int:
        """Return the start of the first burst between two CR LF, or ``-1 - place``: none yet, keep from `place` on."""
        place = buffer.find(LINE_END, at)
        while place >= 0:
            begin = place + len(LINE_END)
            if len(buffer) < begin + self._stride:
                return -1 - place
            if self._read(buffer, begin) is not None and self._stands(buffer, begin, True):
                return begin
            place = buffer.find(LINE_END, place + 1)
        keep = len(buffer) - buffer.endswith(LINE_END[:1])
        return -1 - max(keep, at)

    def _read(self, buffer: bytes, begin: int) -> Burst | None:
        """Return the burst at `begin` if it is complete, ends in CR LF and holds plausible numbers; otherwise None."""
        floats = buffer[begin : begin + self._floats]
        if buffer[begin + self._floats : begin + self._stride] != LINE_END:
            return None
        values = np.frombuffer(floats, dtype="<f4").astype(np.float32).reshape(-1, 4)
        return Burst(values) if _plausible(values) else None

    def _stands(self, buffer: bytes, begin: int, silent: bool) -> bool | None:
        """Whether the burst is valid, given that it may contain CR LF; None if the next burst is needed to tell."""
        if buffer.find(LINE_END, begin, begin + self._floats) < 0:
            return True
        behind = begin + 2 * self._stride
        if len(buffer) < behind:
            return True if silent else None
        return buffer[behind - len(LINE_END) : behind] == LINE_END


class TextDecoder(Decoder[Burst]):
    """A `Decoder` of bursts as lines of text, with a known number of chips.

    The first line is ignored, since it may be cut off.
    """

    def __init__(self, chips: int) -> None:
        """Start with an empty buffer.

        Args:
            chips: Number of chips in a burst.
        """
        super().__init__()
        self._chips = chips
        self._in_step = False

    def clear(self) -> None:
        """See `Decoder.clear`."""
        super().clear()
        self._in_step = False

    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Burst | None]:
        while (end := buffer.find(b"\n", at)) >= 0:
            line = buffer[at : end + 1]
            burst = self._parse(line) if self._in_step else None
            self._in_step = True
            if burst is not None:
                return at, end + 1, burst
            at = end + 1
        if len(buffer) - at > 4 * self._chips * _LONGEST_NUMBER:
            self._in_step = False
            return len(buffer), len(buffer), None
        return at, at, None

    def _parse(self, line: bytes) -> Burst | None:
        numbers = _NUMBER.findall(line)
        if len(numbers) != 4 * self._chips or _NUMBER.sub(b"", line).strip():
            return None
        values = np.array([float(number) for number in numbers], dtype=np.float32).reshape(-1, 4)
        return Burst(values) if _plausible(values) else None


def _plausible(values: NDArray[np.float32]) -> bool:
    size = np.abs(values)
    return bool(np.all((size == 0) | ((size >= MIN_ABSOLUTE) & (size <= MAX_ABSOLUTE))))
