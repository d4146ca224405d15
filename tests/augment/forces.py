"""Forces and times to test transforms with; `torch` is None where it is not installed."""

import numpy as np
import pytest

try:
    import torch
except ImportError:
    torch = None

needs_torch = pytest.mark.skipif(torch is None, reason="needs torch")
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


def frame(seed=0, *batch, pads=2, rows=6, cols=5):
    return np.random.default_rng(seed).normal(size=(*batch, pads, 3, rows, cols))


def taxel(*force):
    """Return one pad with one taxel under `force`."""
    return np.array(force, dtype=float).reshape(1, 3, 1, 1)


def press(row, col, rows=7, cols=7, newtons=1.0):
    """Return one pad with a normal force on one taxel."""
    x = np.zeros((1, 3, rows, cols))
    x[0, 2, row, col] = newtons
    return x
