"""A simulated sensor under a six-axis load cell, independent of paxisim's own models."""

import numpy as np

from paxisim.recording import Recording

NAMES = ("Fx", "Fy", "Fz")
PADS, ROWS, COLS = 1, 1, 5
_CHANNELS = 3 * ROWS * COLS


def motion(seed, time):
    """``(T, 3)`` forces (N): presses of up to 11 N with shear that oscillates at two random frequencies."""
    rng = np.random.default_rng(1000 + seed)
    phase, speed = rng.uniform(0, 6, 3), rng.uniform(0.3, 1.2, 2)
    press = 8 * np.clip(np.sin(2 * np.pi * 0.3 * time + phase[0]), 0, None) ** 2 * (1 + 0.3 * np.sin(0.2 * time))
    drag = [0.3 * press * np.sin(2 * np.pi * speed[i] * time + phase[i + 1]) for i in range(2)]
    return np.stack([*drag, press], axis=1)


def rig(seed=0, delay=0.03, seconds=60.0, rate=80.0, noise=0.02, load_noise=0.02, move=motion):
    """Return a recording in microtesla with three loads, and the true gains ``(3, pads, 3, rows, cols)``.

    Args:
        seed: Random seed of the sensor, the motion and the noise.
        delay: Delay (s) of the channels behind the loads.
        seconds: Duration (s).
        rate: Sampling rate (Hz).
        noise: Noise of each channel, relative to its standard deviation.
        load_noise: Noise of each load (N).
        move: Function of seed and times that returns the loads.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / rate)
    gains = rng.normal(size=(3, _CHANNELS)) * np.array([20, 20, 10])[:, None]
    offset = 5 * rng.normal(size=_CHANNELS)
    clean = move(seed, time - delay) @ gains
    field = clean + noise * clean.std(axis=0) * rng.normal(size=clean.shape) + offset
    loads = move(seed, time)
    loads = loads + load_noise * rng.normal(size=loads.shape)
    covariates = {name: loads[:, i] for i, name in enumerate(NAMES)}
    return Recording(time, tensor(field), covariates=covariates, metadata={"unit": "uT"}), tensor(gains)


def tensor(channels):
    """Reshape ``(n, 15)`` to ``(n, pads, 3, rows, cols)``."""
    return np.moveaxis(channels.reshape(-1, COLS, 3), 1, 2)[:, None, :, None]
