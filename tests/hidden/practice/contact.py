"""Where a contact presses: the force on each taxel under an indenter."""

import numpy as np


def positions(rows, cols, pitch):
    """(rows * cols, 2) taxel centres, m, x to the right and y down, row by row."""
    y, x = np.meshgrid((np.arange(rows) - (rows - 1) / 2) * pitch[0], (np.arange(cols) - (cols - 1) / 2) * pitch[1])
    return np.stack([x.T.ravel(), y.T.ravel()], axis=-1)


def field(motion, where, pose_error=(0.0, 0.0)):
    """(T, pads, 3, N) newtons on each taxel, object on pad, compression positive.

    The pressure of a ball is Hertz's (a half ellipsoid), of a flat punch even with a soft rim, of an edge a ridge along
    `motion.angle`. Shear is spread like the pressure, with a swirl that a rolling contact has.
    """
    d = where[None, None] - (motion.centre[:, :, None] + np.asarray(pose_error))
    if motion.indenter == "edge":
        across = -np.sin(motion.angle) * d[..., 0] + np.cos(motion.angle) * d[..., 1]
        along = np.cos(motion.angle) * d[..., 0] + np.sin(motion.angle) * d[..., 1]
        r = np.sqrt((across / 0.6) ** 2 + (along / 2.0) ** 2)
    else:
        r = np.linalg.norm(d, axis=-1)
    if motion.indenter == "flat":
        pressure = 1 / (1 + np.exp((r - motion.width) / (0.12 * motion.width)))
    else:
        radius = motion.width * (0.6 + 0.4 * np.cbrt(np.maximum(motion.normal, 0) / 10))[..., None]
        pressure = np.sqrt(np.maximum(1 - (r / radius) ** 2, 0)) + 0.02 * np.exp(-((r / radius) ** 2))
    pressure /= pressure.sum(axis=-1, keepdims=True)
    normal = motion.normal[..., None] * pressure
    swirl = np.stack([-d[..., 1], d[..., 0]], axis=2) / motion.width * 0.03
    shear = normal[:, :, None] * (motion.shear[..., None] + swirl)
    return np.concatenate([shear, normal[:, :, None]], axis=2)
