"""Rounds of the older GEN1 hand board, which streams them unprompted. No I/O.

A round has 200 bytes: four blocks of 50, always in this order::

    offset   0          50         100        150
    tag      AA EE      CC EE      AA FF      CC FF       AA pulp, CC tip; EE, FF the two groups of fingers

    a block  tag(2)  state(1)  15 taxels x 3 (45)  undocumented(2)        state 01: valid

There is **no checksum**. Undetectable: a flipped byte outside the tags, which changes one count, a state or an
undocumented byte; the loss of 200 contiguous bytes, or a multiple, which joins two rounds; the loss of the end of a
round together with the beginning of the next; a byte added to the last block, which shifts the taxels after it.
Detected, at the cost of the affected rounds: a damaged tag, any other loss of bytes, a wrong start.

A tag has only two bytes and also occurs inside data, so the decoder requires the four tags of a whole round. Even
these may match at two places, for example if the same pattern of forces is held in all four blocks. The decoder then
decides as follows:

- A round that begins where the last one ended is returned at once. Only if a tag inside it could also be the beginning
  of the next round, because a few bytes were lost, does the decoder wait for the two bytes after the round. Unless
  these are that tag, the round is discarded.
- While the decoder is searching, a round may have a rival: another place inside its 200 bytes where all tags received
  so far match. The decoder then waits until the tags in the bytes that follow refute one of the two, usually after 50
  and at most 400 more bytes, because data change and tags do not. If neither is refuted by then, the candidate with
  more states 01 wins, then the earlier one. If that choice is wrong, the decoder drops it as soon as the data change.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from paxisim.errors import InvalidValueError
from paxisim.hw.link.framing import Decoder

TAGS = tuple(bytes.fromhex(tag) for tag in ("AAEE", "CCEE", "AAFF", "CCFF"))
BLOCKS_PER_ROUND = 4
TAXELS_PER_BLOCK = 15
BLOCK_BYTES = 50
ROUND_BYTES = 200
LAST_DATA = 3 * BLOCK_BYTES + 2  # offset of the data after the last tag
VALID = 0x01
DECISION_BYTES = 3 * ROUND_BYTES
"""Number of bytes from the beginning of a round that suffice to accept or reject it."""


@dataclass(frozen=True)
class Block:
    """The taxels of one pad.

    Attributes:
        taxels: 45 bytes, x y z of 15 taxels.
        state: `VALID`, or another value for an invalid block.
        rest: The two undocumented bytes.
    """

    taxels: bytes
    state: int = VALID
    rest: bytes = b"\0\0"


@dataclass(frozen=True)
class Round:
    """Four blocks, in the order of `TAGS`."""

    blocks: tuple[Block, ...]

    def encode(self) -> bytes:
        """Encode the round as 200 bytes.

        Raises:
            InvalidValueError: There are not exactly four blocks, or one does not have exactly 50 bytes.
        """
        if len(self.blocks) != BLOCKS_PER_ROUND:
            raise InvalidValueError(f"a round has {BLOCKS_PER_ROUND} blocks, got {len(self.blocks)}")
        data = [tag + bytes([b.state]) + b.taxels + b.rest for tag, b in zip(TAGS, self.blocks, strict=True)]
        for i, block in enumerate(data):
            if len(block) != BLOCK_BYTES:
                raise InvalidValueError(f"block {i} must hold 45 bytes of taxels and 2 more, got {len(block) - 3}")
        return b"".join(data)


class RoundDecoder(Decoder[Round]):
    """A `Decoder` of rounds, which relies on the tags in and after a round instead of a check byte.

    It holds back fewer than `DECISION_BYTES` bytes.
    """

    def __init__(self) -> None:
        """Start with an empty buffer, searching for the first round."""
        super().__init__()
        self._in_step = False

    def clear(self) -> None:
        """See `Decoder.clear`."""
        super().clear()
        self._in_step = False

    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Round | None]:
        place = next((p for p in _places(buffer, at, len(buffer)) if not _cut_short(buffer, p)), len(buffer))
        begin = self._choose(buffer, place, at, silent)
        if begin is None:
            self._in_step &= place == at
            return place, place, None
        self._in_step = True
        return begin, begin + ROUND_BYTES, _parse(buffer[begin : begin + ROUND_BYTES])

    def _choose(self, buffer: bytes, at: int, expected: int, silent: bool) -> int | None:
        """Return the start of the round whose first candidate is `at`; None if more bytes are needed to tell."""
        if len(buffer) < at + ROUND_BYTES:
            return None
        in_step = self._in_step and at == expected
        # in step, only a round with a truncated last block can be mistaken for a complete one
        rivals = list(_places(buffer, at + (LAST_DATA if in_step else 1), at + ROUND_BYTES))
        if not rivals:
            return at
        if in_step:
            return at if silent or len(buffer) >= at + ROUND_BYTES + 2 else None
        standing = [place for place in (at, *rivals) if not _refuted(buffer, place)]
        whole = [place for place in standing or (at, *rivals) if len(buffer) >= place + ROUND_BYTES]
        if (len(standing) > 1 or not whole) and not silent and len(buffer) < at + DECISION_BYTES:
            return None
        return max(whole, key=lambda place: _valid_states(buffer, place), default=None)


def _parse(data: bytes) -> Round:
    blocks = (data[i : i + BLOCK_BYTES] for i in range(0, ROUND_BYTES, BLOCK_BYTES))
    return Round(tuple(Block(b[3 : 3 + 3 * TAXELS_PER_BLOCK], b[2], b[3 + 3 * TAXELS_PER_BLOCK :]) for b in blocks))


def _tags(buffer: bytes, at: int) -> tuple[int, bool]:
    """Return how many consecutive tags match a round that begins at `at`, and whether the next one mismatches."""
    for k in range(DECISION_BYTES // BLOCK_BYTES):
        place = at + k * BLOCK_BYTES
        seen = buffer[place : place + 2]
        if not TAGS[k % BLOCKS_PER_ROUND].startswith(seen):
            return k, True
        if len(seen) < 2:
            return k, False
    return DECISION_BYTES // BLOCK_BYTES, False


def _refuted(buffer: bytes, at: int) -> bool:
    return _tags(buffer, at)[1]


def _places(buffer: bytes, start: int, stop: int) -> Iterator[int]:
    """Yield the places in ``[start, stop)`` where a round may begin: all its tags received so far match."""
    at = buffer.find(TAGS[0][:1], start, stop)
    while at >= 0:
        fitting, wrong = _tags(buffer, at)
        if fitting >= BLOCKS_PER_ROUND or not wrong:
            yield at
        at = buffer.find(TAGS[0][:1], at + 1, stop)


def _cut_short(buffer: bytes, at: int) -> bool:
    """Whether the first tag of the next round is inside the last block instead of after it."""
    behind = buffer[at + ROUND_BYTES : at + ROUND_BYTES + 2]
    return not TAGS[0].startswith(behind) and buffer.find(TAGS[0], at + LAST_DATA, at + ROUND_BYTES + 1) >= 0


def _valid_states(buffer: bytes, at: int) -> int:
    return sum(buffer[at + k * BLOCK_BYTES + 2] == VALID for k in range(BLOCKS_PER_ROUND))
