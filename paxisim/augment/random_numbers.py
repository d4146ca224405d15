"""Counter-based random numbers, so that a chain is reproducible from its parameters alone.

A generator with hidden state would differ between numpy and torch, and could not be reset for one environment of a
batch. Here each number is a hash of (seed, stream, count, index): the seed, the purpose, the number of previous draws,
and the position within the draw. numpy and torch give the same numbers on any device, also under ``torch.compile`` and
``vmap``.

The hash is a bijection of 32 bits that spreads a change of one bit over all of them (C. Wellons, "Prospecting for Hash
Functions", 2018), applied twice to the index with 64 bits of key between. It suits simulation, not cryptography.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from paxisim.augment.parameter_spec import as_like, is_torch, namespace
from paxisim.errors import InvalidValueError

SEEDS = 2**32
"""Seeds are whole numbers from 0 to one less than this."""

_BITS = SEEDS - 1
# multipliers of magnitude below 2^31 keep products of 32-bit numbers within int64; only their value modulo 2^32 matters
_FACTORS = (0x7FEB352D, 0x846CA68B - SEEDS)
_STEP = 0x9E3779B9  # 2^32 over the golden ratio: unrelated to patterns in seeds and counts


def no_draws(x: Any) -> Any:
    """Return the initial count of draws for the streams of a batch.

    Args:
        x: Frames, ``(*batch, pads, 3, rows, cols)``.

    Returns:
        ``(*batch, 1, 1, 1, 1)`` zeros, int64.
    """
    xp = namespace(x)
    return xp.zeros_like(x[..., :1, :1, :1, :1], dtype=xp.int64)


def uniform(seed: Any, count: Any, x: Any, stream: int) -> Any:
    """Draw one number per environment, uniform in (0, 1).

    Args:
        seed: ``(*batch)`` whole numbers in [0, `SEEDS`). Environments with the same seed draw the same number. Where
            the seed has no batch dimension (or one of length 1), each environment draws its own.
        count: ``(*batch, 1, 1, 1, 1)`` number of previous draws, see `no_draws`.
        x: Frames, ``(*batch, pads, 3, rows, cols)``, which give the batch, array library, dtype and device.
        stream: Identifies the purpose of the numbers, to separate draws with the same seed.

    Returns:
        ``(*batch, 1, 1, 1, 1)`` of the dtype of `x`.
    """
    xp = namespace(x)
    numbers = _to_unit(_words(seed, count, x, 1, stream), xp)
    return xp.astype(numbers, x.dtype).reshape((*numbers.shape[:-1], 1, 1, 1, 1))


def normal(seed: Any, count: Any, x: Any, stream: int) -> Any:
    """Draw a frame of independent standard normal numbers, of magnitude at most 6.77.

    Args:
        seed: As for `uniform`.
        count: As for `uniform`.
        x: As for `uniform`.
        stream: As for `uniform`.

    Returns:
        ``(*batch, pads, 3, rows, cols)`` of the dtype of `x`.
    """
    xp = namespace(x)
    core = tuple(x.shape[-4:])
    size = math.prod(core)
    half = (size + 1) // 2
    numbers = _to_unit(_words(seed, count, x, 2 * half, stream), xp)
    # Box and Muller (1958): two numbers from one radius and angle
    radius = xp.sqrt(-2 * xp.log(numbers[..., :half]))
    angle = 2 * math.pi * numbers[..., half:]
    pairs = xp.concat([radius * xp.cos(angle), radius * xp.sin(angle)], axis=-1)
    return xp.astype(pairs[..., :size], x.dtype).reshape((*pairs.shape[:-1], *core))


def check_seed(owner: str, seed: Any) -> None:
    """Raise unless `seed` holds integers; floating point would round them.

    Raises:
        InvalidValueError: The seed is not an integer.
    """
    if is_torch(seed):
        integers = not (seed.dtype.is_floating_point or seed.dtype.is_complex)
    else:
        integers = np.asarray(seed).dtype.kind in "iub"
    if not integers:
        raise InvalidValueError(f"{owner}: seed must be integers, got {seed!r}")


def _words(seed: Any, count: Any, x: Any, size: int, stream: int) -> Any:
    """Return ``(*batch, size)`` random 32-bit numbers as int64."""
    xp = namespace(x)
    seed = as_like(seed, count)
    seed = seed.reshape((*seed.shape, 1))
    count = count.reshape((*count.shape[:-4], 1))
    start = seed ^ (stream * _STEP & _BITS)
    key = _mix(_mix(xp.concat([start, (start + _STEP) & _BITS], axis=-1)) ^ (count & _BITS))
    # environments with their own seeds need no separate index
    lengths = list(x.shape[:-4])
    for axis in range(1, min(len(lengths), seed.ndim - 1) + 1):
        if seed.shape[-1 - axis] != 1:
            lengths[-axis] = 1
    device = x.device if is_torch(x) else None
    index = xp.arange(math.prod(lengths) * size, dtype=xp.int64, device=device).reshape((*lengths, size))
    return _mix(_mix((index + key[..., :1]) & _BITS) ^ key[..., 1:])


def _mix(word: Any) -> Any:
    """Apply the bijection to 32-bit numbers, held in int64."""
    word = word ^ (word >> 16)
    word = (word * _FACTORS[0]) & _BITS
    word = word ^ (word >> 15)
    word = (word * _FACTORS[1]) & _BITS
    return word ^ (word >> 16)


def _to_unit(word: Any, xp: Any) -> Any:
    """Map 32-bit numbers to float64 strictly between 0 and 1."""
    return (xp.astype(word, xp.float64) + 0.5) * 2.0**-32
