"""Helpers that run transforms with memory at regular and irregular times."""

import numpy as np
import pytest

both = pytest.mark.parametrize("kind", ["regular", "irregular"])


def everywhere(value):
    """Return a parameter with the same value for every element."""
    return np.full((1, 1, 1, 1), value)


def respond(transform, values, time, dtype=np.float64):
    """Return the readings of one element whose input is `values`."""
    x = np.broadcast_to(np.reshape(values, (-1, 1, 1, 1, 1)), (len(time), 1, 3, 1, 1)).astype(dtype)
    return transform.run(x, time)[:, 0, 0, 0, 0]


def times(kind, end, count=400, seed=0):
    """Return times from 0 to `end`, evenly spaced or not."""
    if kind == "regular":
        return np.linspace(0, end, count)
    gaps = np.random.default_rng(seed).exponential(size=count - 1) ** 2
    return np.concatenate([[0], np.cumsum(gaps) / gaps.sum() * end])
