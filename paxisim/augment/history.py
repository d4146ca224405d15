"""History: the last k encoded frames, as a policy's input."""

from __future__ import annotations

import math
from typing import Any, Literal

from array_api_compat import device

from paxisim.augment.encodings import Encoding
from paxisim.augment.parameter_spec import namespace
from paxisim.errors import InvalidValueError


class History:
    """Ring buffer of the last `k` encoded frames of one environment or a batch, as the policy's input.

    A step writes one frame into the buffer. Reading copies the buffer once; the caller may keep the result. With k = 3
    and ``fill="first"`` (``"zeros"``)::

        reset(); append(a); read() -> a a a  (0 0 a)
                 append(b); read() -> a a b  (0 a b)
                 append(c); read() -> a b c  (a b c)
                 append(d); read() -> b c d  (b c d)

    In a batch, ``reset(mask)`` restarts the masked environments with the next frame. Only a step after a reset rewrites
    the whole buffer. No operation waits for the device.

    Attributes:
        encoding: Encoding applied to each frame.
        k: Number of frames.
        fill: How frames before the first one of an episode are filled.

    Example:
        ```python
        history = History(encoding("GCS", layout), k=20)
        history.append(chain(force))  # (*batch, pads, 3, rows, cols)
        observation = history.read()  # (*batch, 20 * 6, rows, cols)
        ```
    """

    def __init__(self, encoding: Encoding, k: int | None = None, *, fill: Literal["first", "zeros"] = "first") -> None:
        """Create an empty history.

        Args:
            encoding: Encoding to apply to each frame.
            k: Number of frames. Default: the paper's value for this encoding.
            fill: ``"first"`` repeats the first frame of an episode; ``"zeros"`` fills with zeros.

        Raises:
            InvalidValueError: `k` is not a whole number of at least 1, or `fill` is neither option.
        """
        k = encoding.paper_history if k is None else k
        if k < 1 or k % 1:
            raise InvalidValueError(f"History: k must be a whole number of at least 1, got {k!r}")
        if fill not in ("first", "zeros"):
            raise InvalidValueError(f"History: fill must be 'first' or 'zeros', got {fill!r}")
        self.encoding, self.k, self.fill = encoding, int(k), fill
        self._ring: Any = None  # (*batch, k, *frame)
        self._begin: Any = None  # mask of environments whose episode begins with the next frame
        self._newest = 0

    def reset(self, mask: Any = None) -> None:
        """Begin a new episode with the next frame.

        Args:
            mask: Boolean array of the batch's shape that selects the environments to restart. Default: all; the next
                frame may then have another batch shape, dtype or device.
        """
        if mask is None:
            self._ring = None
        elif self._ring is not None:
            mask = namespace(self._ring).asarray(mask, device=device(self._ring))
            self._begin = mask if self._begin is None else self._begin | mask

    def append(self, force: Any) -> None:
        """Encode the next frame, ``(*batch, pads, 3, rows, cols)`` newtons, and replace the oldest by it.

        Raises:
            InvalidValueError: As for `Encoding.encode`; or the shape differs from that of the earlier frames.
        """
        frame = self.encoding.encode(force)
        xp = namespace(frame)
        batch = force.ndim - 4
        if self._ring is None:
            shape = (*frame.shape[:batch], self.k, *frame.shape[batch:])
            self._ring = xp.zeros(shape, dtype=frame.dtype, device=device(frame))
            self._begin = xp.ones(shape[:batch], dtype=xp.bool, device=device(frame))
        at = (slice(None),) * batch
        if frame.shape != self._ring[(*at, 0)].shape:
            raise InvalidValueError(
                f"History: expected a frame that encodes to {tuple(self._ring[(*at, 0)].shape)}, got "
                f"{tuple(frame.shape)}; call reset() before changing the batch"
            )
        if self._begin is not None:
            begin = xp.reshape(self._begin, (*self._begin.shape, *[1] * (self._ring.ndim - self._begin.ndim)))
            first = frame[(*at, None)] if self.fill == "first" else xp.zeros_like(frame[(*at, None)])
            self._ring = xp.where(begin, first, self._ring)
            self._begin = None
        self._newest = (self._newest + 1) % self.k
        self._ring[(*at, self._newest)] = frame

    def begin(self, force: Any, mask: Any) -> None:
        """Begin a new episode of the masked environments with their newest frame; the others stay as they are.

        Use it where an episode's first frame belongs to the same step as the last one of the episode before.

        Args:
            force: First frames, ``(*batch, pads, 3, rows, cols)`` newtons; those of other environments are not used.
            mask: Boolean array of the batch's shape.

        Raises:
            InvalidValueError: There is no frame yet.
        """
        if self._ring is None:
            raise InvalidValueError("History: there is no frame yet: append one first")
        xp, batch = namespace(self._ring), force.ndim - 4
        at = (slice(None),) * batch
        frame = self.encoding.encode(force)
        chosen = xp.reshape(mask, (*mask.shape, *[1] * (self._ring.ndim - mask.ndim)))
        older = frame[(*at, None)] if self.fill == "first" else xp.zeros_like(frame[(*at, None)])
        self._ring = xp.where(chosen, older, self._ring)
        newest = (*at, self._newest)
        self._ring[newest] = xp.where(chosen[(*at, 0)], frame, self._ring[newest])

    def read(self) -> Any:
        """Policy input, oldest frame first: ``(*batch, k channels)`` or ``(*batch, k channels, rows, cols)``.

        Raises:
            InvalidValueError: There is no frame yet.
        """
        if self._ring is None:
            raise InvalidValueError("History: there is no frame yet: append one first")
        frame = len(self.encoding.shape())
        batch = self._ring.ndim - 1 - frame
        at, oldest = (slice(None),) * batch, self._newest + 1
        xp = namespace(self._ring)
        stack = xp.concat([self._ring[(*at, slice(oldest, None))], self._ring[(*at, slice(0, oldest))]], axis=batch)
        channels = math.prod(stack.shape[batch : batch + 2])
        return xp.reshape(stack, (*stack.shape[:batch], channels, *stack.shape[batch + 2 :]))
