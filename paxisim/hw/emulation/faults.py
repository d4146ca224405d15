"""Faults of a real line, drawn at random from a seed and injected by the emulator."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from paxisim.errors import InvalidValueError, UnknownNameError

# (delay in seconds after the piece before, bytes)
Piece = tuple[float, bytes]

SPLIT_PAUSE = 2e-3
"""Time (s) between the two parts of a split message."""

MERGE_WAIT = 50e-3
"""Maximum time (s) that a message held back for merging waits for the next one."""


@dataclass(frozen=True)
class Faults:
    """Rates of simulated line faults; the default is a fault-free line.

    Attributes:
        drop: Probability that a byte is lost.
        flip: Probability that a byte has one bit flipped.
        garble: Probability that a byte is replaced by any other value.
        split: Probability that a message leaves in two parts, cut anywhere.
        merge: Probability that a message is held back and leaves with the next one.
        stall: Probability that a message is preceded by silence.
        stall_seconds: Duration of such a silence (s).
        status: Probability that a message carries an error byte, if the board's protocol has one.
        noise: Number of random bytes that the board sends when it is first opened after power-on.
        unplug_after: Number of messages after which the port goes away; None: never.

    Raises:
        InvalidValueError: A probability is outside 0 to 1, a count or time is below 0, or `unplug_after` is below 1.
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
        """Parse faults from text such as ``"drop=0.01,flip=0.001,unplug_after=500"``; empty text is a fault-free line.

        Raises:
            UnknownNameError: There is no such fault.
            InvalidValueError: An item is not NAME=NUMBER, or the number is not valid for the fault.
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
    """Applies `Faults` to messages. The same seed and messages give the same faults. No I/O.

    Attributes:
        messages: Number of messages passed in.
        held: Bytes of the message held back for the next one, with faults applied; empty if there is none.
    """

    def __init__(self, faults: Faults, seed: int = 0) -> None:
        """Start with no message held back."""
        self._faults = faults
        self._rng = np.random.default_rng(seed)
        self.messages = 0
        self.held = b""

    def send(self, message: bytes) -> tuple[bytes, list[Piece]]:
        """Apply the faults to a message.

        Returns:
            The message's own bytes after the faults, and the pieces that leave now, each with its delay (s) after the
            piece before.
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
        """Return the message held back, for lack of a next one in time, and hold nothing."""
        data, self.held = self.held, b""
        return data

    def wrong_status(self) -> bool:
        """Draw whether the next message carries an error byte."""
        return bool(self._faults.status) and bool(self._rng.random() < self._faults.status)

    def noise(self) -> bytes:
        """Draw the random bytes sent after power-on."""
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
