"""Motions of a tactile gripper at 500 Hz: normal force, shear, contact position and gripper opening.

There are four families, which differ in the shapes of the ramps, the order of events and the indenters:
``development`` (to build a diagnosis), ``final`` (to evaluate it: linear ramps become smooth ones, sines become
triangles, and a ball becomes an edge or a flat punch), ``poor`` (one slow speed and one depth only, as a careless
user records), and ``broad``, see `broad`.
"""

from dataclasses import dataclass

import numpy as np

RATE = 500.0


@dataclass
class Motion:
    """One episode.

    Attributes:
        normal: (T, pads) total normal force, N.
        shear: (T, pads, 2) ratio of total shear to total normal force, x and y.
        centre: (T, pads, 2) position of the indenter's middle, m, x and y of the pad.
        opening: (T,) gripper opening, m.
        width: radius of the contact, m.
        indenter: "ball", "edge", "flat", "tilted", "egg" or "ring".
        angle: angle of the edge, rad.
        twist: shear around the middle of the contact, as a ratio to the normal force: a number or (T, 1, 1, 1).
    """

    normal: np.ndarray
    shear: np.ndarray
    centre: np.ndarray
    opening: np.ndarray
    width: float
    indenter: str
    angle: float
    twist: float | np.ndarray = 0.03


def path(points, shape):
    """Return a curve through (duration, value) pairs; `shape` is "linear" or "smooth" (continuous slope)."""
    pieces, value = [], points[0][1]
    for duration, target in points:
        count = max(1, round(duration * RATE))
        way = np.arange(1, count + 1) / count
        if shape == "smooth":
            way = way**3 * (10 - 15 * way + 6 * way**2)
        pieces.append(value + (target - value) * way)
        value = target
    return np.concatenate(pieces)


def fit(curve, length):
    return np.pad(curve, (0, max(0, length - len(curve))), mode="edge")[:length]


def _swing(length, rng, shape, slow=0.3, fast=1.5):
    """Return an oscillation of amplitude 1 with a frequency that rises from `slow` to `fast`, Hz."""
    t = np.arange(length) / RATE
    phase = 2 * np.pi * (slow * t + (fast - slow) * t**2 / (2 * max(t[-1], 1e-9))) + rng.uniform(0, 2 * np.pi)
    if shape == "linear":
        return np.sin(phase)
    return 2 / np.pi * np.arcsin(np.sin(phase))


def _press(rng, shape, peak, speeds=(0.05, 1.0)):
    """Return (duration, value) pairs of a press: free, up, hold, small swings under load, down, free."""
    up, down = np.exp(rng.uniform(*np.log(speeds), 2))
    low = rng.uniform(0.3, 0.6) * peak
    quick = np.exp(rng.uniform(np.log(0.08), np.log(0.5), 4))
    return [
        (rng.uniform(0.6, 1.2), 0.0), (up, peak), (rng.uniform(0.8, 2.0), peak),
        (quick[0], low), (quick[1], 0.85 * peak), (quick[2], 1.2 * low), (quick[3], 0.7 * peak),
        (rng.uniform(0.2, 0.8), 0.7 * peak), (down, 0.0), (rng.uniform(0.5, 1.0), 0.0),
    ]  # fmt: skip


def episode(kind, family, rng, size, pads=2, duration=9.0):
    """Draw an episode of `kind`: "press", "slide", "reverse", "taps", "gripper" or "slow".

    `size` is the (height, width) of a pad in m.
    """
    shape = "smooth" if family == "final" else "linear"
    length = round(duration * RATE)
    peak = np.exp(rng.uniform(np.log(6.0), np.log(25.0)))
    free = [(duration, 0.0)]
    if kind == "press":
        curve = path(_press(rng, shape, peak) + _press(rng, shape, peak * rng.uniform(0.4, 1.0)), shape)
    elif kind == "slide":
        curve = path([(0.7, 0.0), (0.4, 0.7 * peak), (duration - 2.8, 0.9 * peak), (0.6, 0.0), (1.1, 0.0)], shape)
    elif kind == "reverse":
        levels = peak * np.array([0.3, 0.9, 0.2, 0.75, 0.35, 0.6, 0.45, 1.0, 0.1, 0.5])
        times = np.exp(rng.uniform(np.log(0.15), np.log(0.9), len(levels)))
        curve = path([(0.7, 0.0), *zip(times, levels, strict=True), (0.5, 0.0), (1.0, 0.0)], shape)
    elif kind == "taps":
        taps = []
        for _ in range(9):
            taps += [(0.06, rng.uniform(0.5, 1) * peak), (rng.uniform(0.05, 0.3), peak * 0.6), (0.06, 0.0), (0.35, 0.0)]
        curve = path([(0.7, 0.0), *taps], shape)
    elif kind == "gripper":
        curve = path(free, shape)
    else:
        curve = path([(1.0, 0.0), (3.2, 12.0), (0.6, 12.0), (3.2, 0.0), (1.0, 0.0)], "linear")
    curve = fit(curve, length)

    contact = curve > 0
    sway = np.stack([_swing(length, rng, shape) for _ in range(2)], axis=-1)
    reach = {"slide": 0.45, "press": 0.15, "reverse": 0.1, "taps": 0.1}.get(kind, 0.0)
    drag = reach * rng.uniform(0.5, 1.0, 2) * sway * contact[:, None]
    if kind == "slow":
        drag = np.zeros((length, 2)) + [0.12, -0.08]
    mirror = np.array([[1.0, 1.0], [-1.0, 1.0]])[np.arange(pads) % 2]
    normal = curve[:, None] * (1 + np.array([0.0, rng.uniform(-0.1, 0.1)])[np.arange(pads) % 2])
    shear = drag[:, None] * mirror

    half = np.array([size[1], size[0]]) / 2
    middle = rng.uniform(-0.45, 0.45, (pads, 2)) * half
    if kind == "slow":
        middle = np.zeros((pads, 2)) + [0.0012, -0.0009]
    travel = 0.35 * half * sway[:, None] * (kind == "slide")
    centre = np.clip(middle + travel * mirror, -0.8 * half, 0.8 * half)

    opening = 0.02 + 0.012 * path([(0.5, 0.0), (0.4, 0.6), (0.5, -0.4), (0.4, 0.0)], shape)
    opening = fit(opening, length)
    opening = np.where(contact, opening[np.argmax(contact)] - 2e-5 * curve, opening)
    if kind == "gripper":
        opening = 0.04 * (0.5 + 0.5 * fit(_swing(length, rng, shape, 0.1, 0.4), length))
    elif kind == "slow":
        opening = np.full(length, 0.02)
    indenter = "ball" if family != "final" else ("edge", "flat")[rng.integers(2)]
    width = rng.uniform(4e-3, 9e-3)
    return Motion(normal, shear, centre, opening, width, indenter, rng.uniform(0, np.pi))


KINDS = {
    "development": ("press", "slide", "reverse", "press", "taps", "slide", "gripper", "reverse"),
    "final": ("reverse", "press", "taps", "slide", "press", "gripper", "slide", "press"),
    "poor": ("slow",) * 6,
    "broad": (),
}
