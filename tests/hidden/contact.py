"""Contacts: the force on each taxel under an indenter."""

import numpy as np


def positions(rows, cols, pitch):
    """Return the (rows * cols, 2) taxel centres, m, x to the right and y down, row by row."""
    y, x = np.meshgrid((np.arange(rows) - (rows - 1) / 2) * pitch[0], (np.arange(cols) - (cols - 1) / 2) * pitch[1])
    return np.stack([x.T.ravel(), y.T.ravel()], axis=-1)


def field(motion, where, pose_error=(0.0, 0.0)):
    """Return the forces (T, pads, 3, N) of the object on each taxel, N, compression positive.

    The pressure is Hertz's half ellipsoid under a ball, uniform with a soft rim under a flat punch, a ridge along
    `motion.angle` under an edge, a soft hill under an egg, and a circle under a ring; a tilted punch presses more on
    one side. Shear is distributed like the pressure, plus the swirl of a rolling or turning contact.
    """
    d = where[None, None] - (motion.centre[:, :, None] + np.asarray(pose_error))
    across = -np.sin(motion.angle) * d[..., 0] + np.cos(motion.angle) * d[..., 1]
    along = np.cos(motion.angle) * d[..., 0] + np.sin(motion.angle) * d[..., 1]
    r = np.linalg.norm(d, axis=-1)
    if motion.indenter == "edge":
        r = np.sqrt((across / 0.6) ** 2 + (along / 2.0) ** 2)
    if motion.indenter in ("flat", "tilted"):
        pressure = 1 / (1 + np.exp((r - motion.width) / (0.12 * motion.width)))
        if motion.indenter == "tilted":
            pressure *= np.maximum(1 + 0.8 * along / motion.width, 0.05)
    elif motion.indenter == "egg":
        pressure = (1 + (1.4 * along / motion.width) ** 2 + (2 * across / motion.width) ** 2) ** -3.0
    elif motion.indenter == "ring":
        pressure = np.exp(-((r / motion.width - 0.8) ** 2) / 0.15) + 1e-9
    else:
        radius = motion.width * (0.6 + 0.4 * np.cbrt(np.maximum(motion.normal, 0) / 10))[..., None]
        pressure = np.sqrt(np.maximum(1 - (r / radius) ** 2, 0)) + 0.02 * np.exp(-((r / radius) ** 2))
    pressure /= pressure.sum(axis=-1, keepdims=True)
    normal = motion.normal[..., None] * pressure
    swirl = np.stack([-d[..., 1], d[..., 0]], axis=2) / motion.width * motion.twist
    shear = normal[:, :, None] * (motion.shear[..., None] + swirl)
    return np.concatenate([shear, normal[:, :, None]], axis=2)
