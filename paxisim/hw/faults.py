"""Faults: what goes wrong on a real line, drawn at random from a seed, for the emulator to do on purpose."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from paxisim.errors import InvalidValueError, UnknownNameError

# seconds after which bytes leave -> bytes
Piece = tuple[float, bytes]

SPLIT_PAUSE = 2e-3
"""Seconds between the two parts of a split message."""

MERGE_WAIT = 50e-3
"""Seconds for which a message that is to leave together with the next one waits for it."""


@dataclass(frozen=True)
class Faults:
    """How often what goes wrong; the default is a clean line.

    Attributes:
        drop: Probability of each byte to get lost.
        flip: Probability of each byte to have one bit flipped.
        garble: Probability of each byte to be replaced by any other.
        split: Probability of each message to leave in two parts, cut anywhere.
        merge: Probability of each message to be held back and leave with the next one.
        stall: Probability of each message to be preceded by silence.
        stall_seconds: How long such a silence lasts (s).
        status: Probability of each message to carry an error byte where the board's protocol has one.
        noise: Random bytes that the board sends when it is opened for the first time after power-on.
        unplug_after: The port goes away after so many messages; None: never.

    Raises:
        InvalidValueError: A probability outside 0 to 1, or a count or time below 0.
    """

    drop: float = 0.0
    flip: float = 0.0
    garble: float = 0.0
    split: float = 0.0
    merge: float = 0.0
    stall: float = 0.0
    stall_seconds: float = 0.2
    status: float = 0.0
    noise: int = 0
    unplug_after: int | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("drop", "flip", "garble", "split", "merge", "stall", "status"):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise InvalidValueError(f"fault {name} must be a probability from 0 to 1, got {value!r}")
        if not (0 <= self.stall_seconds < np.inf):
            raise InvalidValueError(f"fault stall_seconds must be a time of at least 0 s, got {self.stall_seconds!r}")
        if self.noise < 0:
            raise InvalidValueError(f"fault noise must be a number of bytes of at least 0, got {self.noise!r}")
        if self.unplug_after is not None and self.unplug_after < 1:
            raise InvalidValueError(f"fault unplug_after must be a count of at least 1, got {self.unplug_after!r}")

    @classmethod
    def parse(cls, text: str) -> Faults:
        """Faults from words such as ``"drop=0.01,flip=0.001,unplug_after=500"``; empty text is a clean line.

        Raises:
            UnknownNameError: There is no such fault.
            InvalidValueError: Not NAME=NUMBER, or a number that the fault cannot have.
        """
        known = {field.name: int if field.name in ("noise", "unplug_after") else float for field in fields(cls)}
        values = {}
        for word in filter(None, (word.strip() for word in text.split(","))):
            name, _, number = (part.strip() for part in word.partition("="))
            name = name.replace("-", "_")
            if name not in known:
                raise UnknownNameError("fault", name, known)
            try:
                values[name] = known[name](number)
            except ValueError:
                kind = "a whole number" if known[name] is int else "a number"
                raise InvalidValueError(f"expected {name}={kind}, as in 'drop=0.01,flip=0.001', got {word!r}") from None
        return cls(**values)


class FaultyLine:
    """Does to messages what `Faults` say. The same seed does the same to the same messages. No I/O.

    Attributes:
        messages: Messages that went in.
        held: The message that waits for the next one, as it will leave; empty if none does.
    """

    def __init__(self, faults: Faults, seed: int = 0) -> None:
        """Start with nothing held back."""
        self._faults = faults
        self._rng = np.random.default_rng(seed)
        self.messages = 0
        self.held = b""

    def send(self, message: bytes) -> tuple[bytes, list[Piece]]:
        """What becomes of a message.

        Returns:
            Its own bytes as they will leave, and what leaves now: pieces, each so many seconds after the one before.
        """
        faults, rng = self._faults, self._rng
        self.messages += 1
        own = self._damaged(message)
        data, self.held = self.held + own, b""
        if faults.merge and len(data) == len(own) and rng.random() < faults.merge:
            self.held = data
            return own, []
        wait = faults.stall_seconds if faults.stall and rng.random() < faults.stall else 0.0
        if faults.split and len(data) > 1 and rng.random() < faults.split:
            cut = int(rng.integers(1, len(data)))
            return own, [(wait, data[:cut]), (SPLIT_PAUSE, data[cut:])]
        return own, [(wait, data)]

    def release(self) -> bytes:
        """What was held back, because no next message came in time."""
        data, self.held = self.held, b""
        return data

    def wrong_status(self) -> bool:
        """Whether the next message carries an error byte."""
        return bool(self._faults.status) and bool(self._rng.random() < self._faults.status)

    def noise(self) -> bytes:
        """The garbage of power-on."""
        return self._rng.bytes(self._faults.noise)

    def _damaged(self, message: bytes) -> bytes:
        faults, rng = self._faults, self._rng
        if not (faults.drop or faults.flip or faults.garble):
            return message
        data = np.frombuffer(message, np.uint8).copy()
        flipped = rng.random(len(data)) < faults.flip
        data[flipped] ^= np.uint8(1) << rng.integers(0, 8, int(flipped.sum()), dtype=np.uint8)
        garbled = rng.random(len(data)) < faults.garble
        data[garbled] += rng.integers(1, 256, int(garbled.sum()), dtype=np.uint8)
        return data[rng.random(len(data)) >= faults.drop].tobytes()
