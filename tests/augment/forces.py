"""Small force tensors for testing transforms."""

import numpy as np


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
