"""Behaviour of the decoders on damaged byte streams: ``python benchmarks/damaged_streams.py``.

Each family and kind of damage gets ten million bytes. Every frame contains a unique number. Half of the frames are at
rest apart from that number; the others carry random counts. The kinds of damage are:

- noise: 1 to 300 random bytes between the frames;
- changed: two in a thousand bytes replaced by others;
- lost: 1 to 4 bytes missing, after 1000 bytes on average.

The table counts frames that were never sent (wrong) and undamaged frames that did not arrive (missed). Some of either
are impossible to detect and are counted separately:

- collisions: a frame with changed bytes whose check byte matches by chance, or that has no check byte;
- undecidable: the distinguishing bytes are missing. Either bytes were lost both at the end of a frame and in the head
  of the next one; or noise follows a frame that ends, alone or together with the first byte of the noise, in the two
  bytes that begin a head; or a round of the hand board, which has no check byte, contains these two bytes in its last
  block.

A burst of the magnetometer board has neither head nor check byte; it is recognised by the end of the previous burst
and by its own. Noise between bursts is therefore not tested, and a missed burst next to a damaged one counts as
undecidable. XELA's server is not included: it sends over TCP, which damages nothing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray

from paxisim.hw.families.control_box import wire as control_box
from paxisim.hw.families.hand_board import wire as hand_board
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.magnetometer_board import wire as magnetometer_board
from paxisim.hw.families.serial_converter import wire as serial_converter
from paxisim.hw.link.framing import Decoder, FrameDecoder

TAXELS = 52
PIECE = 4096
KINDS = ("noise", "changed", "lost")


def push(data: bytes) -> Any:
    """Make a push of the high-speed board."""
    return high_speed.Push(0, data)


def converter_reply(data: bytes) -> Any:
    """Make a reading of the serial converter."""
    return serial_converter.Reply(1, serial_converter.READ, 1008, len(data), 0, data)


def box_reply(data: bytes) -> Any:
    """Make a reading of the control box."""
    return control_box.Reply(*control_box.READ_REGISTERS, control_box.Region(1008, data).encode())


def hand_round(data: bytes) -> Any:
    """Make a round of the hand board; its undocumented bytes stay 0."""
    return hand_board.Round(tuple(hand_board.Block(data[i : i + 45]) for i in range(0, 180, 45)))


def burst(data: bytes) -> Any:
    """Make a burst of five chips, in multiples of a tenth of a microtesla."""
    return magnetometer_board.Burst((np.frombuffer(data, "<i2").reshape(5, 4) * 0.1).astype(np.float32))


@dataclass(frozen=True)
class Family:
    """How to make and decode a frame of a family's readings.

    Attributes:
        make: Function that makes a frame from data.
        size: Number of bytes of data.
        decoder: Function that makes the decoder.
        kinds: Kinds of damage to test.
        by_neighbours: Whether a frame is recognised by its neighbours.
    """

    make: Callable[[bytes], Any]
    size: int
    decoder: Callable[[], Decoder[Any]]
    kinds: tuple[str, ...] = KINDS
    by_neighbours: bool = False


FAMILIES = {
    "high-speed": Family(push, 6 + 3 * TAXELS, lambda: FrameDecoder(high_speed.push_parser({0, 6 + 3 * TAXELS}))),
    "serial-converter": Family(
        converter_reply,
        30 + 3 * TAXELS,
        lambda: FrameDecoder(serial_converter.reply_parser({0, 3, 100, 30 + 3 * TAXELS})),
    ),
    "control-box": Family(box_reply, 390, lambda: FrameDecoder(control_box.reply_parser({*range(129), 396}))),
    "hand-board": Family(hand_round, 180, hand_board.RoundDecoder),
    "magnetometer-board": Family(
        burst, 40, lambda: magnetometer_board.BurstDecoder(5), kinds=("changed", "lost"), by_neighbours=True
    ),
}


@dataclass(frozen=True)
class Result:
    """Result of decoding one stream; see the module."""

    bytes: int
    sent: int
    damaged: int
    wrong: int
    collisions: int
    undecidable: int
    missed: int
    missed_undecidable: int
    most_held: int
    seconds: float

    @property
    def faults(self) -> int:
        """Number of wrong and missed frames that were detectable."""
        return self.wrong - self.collisions - self.undecidable + self.missed - self.missed_undecidable


def make_frames(family: Family, rng: np.random.Generator, count: int) -> list[bytes]:
    """Make frames that are all different."""
    frames = []
    for number in range(count):
        data = bytearray(rng.bytes(family.size) if number % 2 else family.size)
        data[-6:-3] = number.to_bytes(3, "little")
        frames.append(family.make(bytes(data)).encode())
    return frames


def damage(
    frames: list[bytes], kind: str, rng: np.random.Generator
) -> tuple[list[bytes], NDArray[np.bool_], set[bytes], list[int]]:
    """Damage a stream of frames.

    Returns:
        The bytes left of each frame, which frames are undamaged, the contents of changed frames, and the numbers of the
        frames that lost bytes of their head.
    """
    whole = np.ones(len(frames), dtype=bool)
    if kind == "noise":
        return [frame + rng.bytes(int(rng.integers(1, 301))) for frame in frames], whole, set(), []
    ends = np.cumsum([len(frame) for frame in frames])
    stream = np.frombuffer(b"".join(frames), np.uint8).copy()
    places = np.flatnonzero(rng.random(len(stream)) < (0.002 if kind == "changed" else 0.001))
    keep = np.ones(len(stream), dtype=bool)
    if kind == "changed":
        stream[places] += rng.integers(1, 256, len(places), dtype=np.uint8)
        whole[np.searchsorted(ends, places, "right")] = False
    else:
        for place, length in zip(places.tolist(), rng.integers(1, 5, len(places)).tolist(), strict=True):
            keep[place : place + length] = False
        whole[np.searchsorted(ends, np.flatnonzero(~keep), "right")] = False
    parts = [
        stream[end - len(frame) : end][keep[end - len(frame) : end]].tobytes()
        for frame, end in zip(frames, ends.tolist(), strict=True)
    ]
    changed = {parts[i] for i in np.flatnonzero(~whole).tolist()} if kind == "changed" else set()
    starts = [end - len(frame) for frame, end in zip(frames, ends.tolist(), strict=True)]
    headless = [i for i, start in enumerate(starts) if not keep[start : start + 2].all()]
    return parts, whole, changed, headless


def measure(name: str, kind: str, size: int, seed: int = 0) -> Result:
    """Pass about `size` bytes of one family through its decoder.

    Args:
        name: Name of the family.
        kind: One of `KINDS`.
        size: Approximate number of bytes.
        seed: Random seed of frames and damage.
    """
    family, rng = FAMILIES[name], np.random.default_rng(seed)
    each = len(family.make(bytes(family.size)).encode()) + 150 * (kind == "noise")
    frames = make_frames(family, rng, size // each)
    parts, whole, changed, headless = damage(frames, kind, rng)
    stream, decoder, found, most = b"".join(parts), family.decoder(), [], 0
    start = time.process_time()
    for at in range(0, len(stream), PIECE):
        found += decoder.feed(stream[at : at + PIECE])
        most = max(most, decoder.pending)
    found += decoder.flush()
    seconds = time.process_time() - start
    came = [message.encode() for message in found]
    wrong, set_came = set(came) - set(frames), set(came)
    # the frame before a missing head, completed by the bytes after it
    joined = {(parts[i - 1] + parts[i])[: len(frames[i])] for i in headless if i}
    missed = [i for i in np.flatnonzero(whole).tolist() if frames[i] not in set_came]
    # the last bytes of a frame that may contain the beginning of another head
    last = 50 if name == "hand-board" else 2
    # the first frame has no predecessor
    beside = np.concatenate([[True], ~whole[:-1]]) | np.concatenate([~whole[1:], [False]])
    tails = [parts[i][len(frames[i]) - last : len(frames[i]) + 1] for i in missed]
    return Result(
        bytes=len(stream),
        sent=len(frames),
        damaged=int((~whole).sum()),
        wrong=len(wrong),
        collisions=len(wrong & changed),
        undecidable=len(wrong & joined),
        missed=len(missed),
        missed_undecidable=sum(beside[missed]) if family.by_neighbours else sum(frames[0][:2] in t for t in tails),
        most_held=most,
        seconds=seconds,
    )


def main(size: int = 10_000_000, seed: int = 0) -> int:
    """Print the table; return status 1 if any wrong or missed frame was detectable.

    Args:
        size: Number of bytes per family and kind of damage.
        seed: Random seed of frames and damage.
    """
    print("family             damage     frames  damaged  missed  wrong  collisions  undecidable  most held    MB/s")
    good = True
    for name, family in FAMILIES.items():
        for kind in family.kinds:
            r = measure(name, kind, size, seed)
            good &= r.faults == 0
            print(
                f"{name:<19}{kind:<8}{r.sent:>9}{r.damaged:>9}{r.missed:>8}{r.wrong:>7}{r.collisions:>12}"
                f"{r.undecidable + r.missed_undecidable:>13}{r.most_held:>9} B{r.bytes / 1e6 / r.seconds:>8.1f}",
                flush=True,
            )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
