"""Distribution of an object's force over the taxels."""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

INDENTERS = ("cylinder", "ellipsoid", "ring", "flat")


@dataclass
class Indenter:
    """An object that presses on the pads.

    Attributes:
        kind: one of INDENTERS.
        angle: rotation about z, rad.
        size: (2,) half lengths, in mean pitches.
        tilt: (2,) relative change of the pressure per pitch.
        growth: exponent of the contact size as a function of the force.
    """

    kind: str
    angle: float
    size: np.ndarray
    tilt: np.ndarray
    growth: float


def draw(rng):
    """Draw an object."""
    kind = str(rng.choice(INDENTERS))
    low, high = {"cylinder": (0.6, 2.6), "ellipsoid": (0.9, 2.0), "ring": (1.0, 1.8), "flat": (0.9, 2.2)}[kind]
    return Indenter(kind, rng.uniform(0, np.pi), rng.uniform(low, high, 2), rng.uniform(-0.3, 0.3, 2),
                    rng.choice([0.0, 1 / 3]))  # fmt: skip


def positions(rows, cols, pitch):
    """Return taxel positions (taxels, 2), m, x to the right and y down, relative to the middle."""
    y, x = np.meshgrid((np.arange(rows) - (rows - 1) / 2) * pitch[0], (np.arange(cols) - (cols - 1) / 2) * pitch[1],
                       indexing="ij")  # fmt: skip
    return np.stack([x.ravel(), y.ravel()], 1)


def pressure(indenter, apart, grown):
    """Return the unnormalised share of the force on each taxel.

    Args:
        indenter: the object.
        apart: (..., taxels, 2) offsets from the object's middle, in mean pitches.
        grown: (..., 1) relative size of the contact.
    """
    c, s = np.cos(indenter.angle), np.sin(indenter.angle)
    u = (c * apart[..., 0] + s * apart[..., 1]) / grown
    v = (c * apart[..., 1] - s * apart[..., 0]) / grown
    a, b = indenter.size
    if indenter.kind == "cylinder":
        a, b = max(a, b), min(a, b)
        return np.exp(-((v / (0.5 * b + 0.45)) ** 2)) * expit((a - np.abs(u)) / 0.3)
    if indenter.kind == "ellipsoid":
        return (1 + (u / a) ** 2 + (v / b) ** 2) ** -3.0
    if indenter.kind == "ring":
        return np.exp(-(((np.hypot(u, v) - a) / 0.6) ** 2))
    lean = np.maximum(1 + indenter.tilt[0] * u + indenter.tilt[1] * v, 0.05)
    return expit((a - np.abs(u)) / 0.2) * expit((b - np.abs(v)) / 0.2) * lean


def field(moves, indenters, where, pitch, shift=(0.0, 0.0)):
    """Return the forces (episodes, steps, pads, 3, taxels), N.

    Args:
        moves: the episodes.
        indenters: one object per episode.
        where: (taxels, 2) taxel positions, m.
        pitch: (row, column) pitch, m.
        shift: offset of the contact, m.
    """
    steps, pads = max(len(move.normal) for move in moves), moves[0].normal.shape[1]
    out = np.zeros((len(moves), steps, pads, 3, len(where)))
    unit = np.mean(pitch)
    half = np.ptp(where, axis=0) / 2
    for into, move, indenter in zip(out, moves, indenters, strict=True):
        peak = move.normal.max()
        if peak == 0:
            continue
        on = np.flatnonzero(move.normal.max(axis=1) > 0)
        on = slice(on[0], on[-1] + 1)
        force = move.normal[on]
        apart = (where - (move.centre[on] * half + np.asarray(shift))[:, :, None]) / unit
        grown = (0.55 + 0.45 * force / peak) ** indenter.growth
        share = pressure(indenter, apart, grown[..., None]) + 1e-12
        share /= share.sum(axis=-1, keepdims=True)
        into[on, :, 2] = force[..., None] * share
        around = (move.twist[on] * force)[..., None] * share / 1.5
        into[on, :, 0] = move.shear[on, :, :1] * share - around * apart[..., 1]
        into[on, :, 1] = move.shear[on, :, 1:] * share + around * apart[..., 0]
    return out
