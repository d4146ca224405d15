"""A small recording with one cause, for tests of the command line."""

import numpy as np

from paxisim.recording import Recording


def pressed_recording():
    """Return four episodes of presses on one pad of 2x2, whose normal force the sensor reads by 20 % too high."""
    time = np.arange(0, 6, 0.05)
    rng = np.random.default_rng(0)
    shares = np.array([[0.4, 0.3], [0.2, 0.1]]) * np.array([0.2, -0.1, 1.0])[:, None, None]
    tensors = []
    for _ in range(4):
        depth = rng.uniform(4, 10) * np.maximum(0, np.sin(2 * np.pi * rng.uniform(0.2, 0.6) * (time - 1))) * (time > 1)
        tensors.append(depth[:, None, None, None, None] * shares)
    simulated = np.concatenate(tensors)
    measured = simulated * np.array([1, 1, 1.2])[:, None, None] + 0.02 * rng.standard_normal(simulated.shape)
    at = np.concatenate([time + 30 * i for i in range(4)])
    return Recording(at, measured, simulated, episode=np.repeat(np.arange(4), len(time)))
