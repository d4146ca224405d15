"""Motions of the family "broad": each shape of force, its order and the objects are drawn anew for every recording.

They share no shape with the other families: loads that change all the time, centres of pressure that wander, strokes
that stick and slip, shear that is dragged and turned without a slide.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hidden.motions import RATE, Motion, fit, path

TRAVEL = 0.04  # travel of the gripper, m
OBJECTS = ("edge", "egg", "ring", "flat", "tilted")


def _steps(*points):
    """Return a smooth curve through (duration, value) pairs."""
    return path([(0.0, 0.0), *points], "smooth")


def sweep(rng, t):
    """A force that swings faster and faster."""
    low, high = rng.uniform(0.2, 0.5), rng.uniform(1.5, 3.5)
    phase = 2 * np.pi * low * t[-1] / np.log(high / low) * ((high / low) ** (t / t[-1]) - 1)
    return {"normal": 0.55 - 0.45 * np.cos(phase)}


def presses(rng, t):
    """Presses to several levels, each held for a while, with and without a release between them."""
    levels = [(rng.uniform(0.2, 0.6), rng.uniform(0.3, 1.0), rng.uniform(0.7, 2.0)) for _ in range(6)]
    points = [(d, v) for up, v, hold in levels for d, v in ((up, v), (hold, v), (0.3, rng.choice([0.0, 0.15])))]
    return {"normal": _steps(*points)}


def rocking(rng, t):
    """A firm grip whose centre of pressure wanders."""
    angle = 2 * np.pi * (rng.uniform(0.3, 1.2, 2) * t[:, None] + rng.random(2))
    return {"normal": 0.8 + 0.15 * np.sin(angle.sum(axis=1)), "centre": 0.45 * np.sin(angle)}


def strokes(rng, t):
    """Strokes along both axes that stick and slip."""
    stops = 0.5 * rng.permutation([[1, 0], [0, 1], [-1, 0], [0, -1]])[:3]
    each = [(t[-1] / 4, stop) for stop in (*stops, np.zeros(2))]
    centre = np.stack([fit(_steps(*[(d, stop[k]) for d, stop in each]), len(t)) for k in (0, 1)], axis=-1)
    speed = np.gradient(centre, axis=0) * RATE
    fast = np.linalg.norm(speed, axis=1)
    tooth = np.cumsum(fast) / RATE / rng.uniform(0.08, 0.25) % 1  # sticks, then slips in the last tenth of a length
    rub = np.where(tooth < 0.9, 0.6 + 0.4 * tooth / 0.9, 1 - 4 * (tooth - 0.9))
    return {"normal": np.full(len(t), 0.85), "centre": centre, "shear": (rub / (fast + 0.05))[:, None] * speed}


def double_taps(rng, t):
    """Quick taps in twos."""
    taps = [tap for _ in range(9) for level in [rng.uniform(0.4, 1.0)] for rest in (0.2, rng.uniform(0.4, 0.9))
            for tap in ((0.09, level), (0.02, level), (0.08, 0.0), (rest, 0.0))]  # fmt: skip
    return {"normal": _steps(*taps)}


def wander(rng, t):
    """A smooth random force in all directions."""
    low = butter(2, rng.uniform(0.6, 2.5), fs=RATE, output="sos")
    noise = sosfiltfilt(low, rng.standard_normal((len(t) + 2000, 3)), axis=0)[1000:-1000]
    noise /= noise.std(axis=0)
    return {"normal": np.clip(0.5 + 0.28 * noise[:, 0], 0.02, 1.1), "shear": 0.4 * np.clip(noise[:, 1:], -1.5, 1.5)}


def drags(rng, t):
    """A firm grip pulled along one axis, along the other, turned, and pulled along both, without a slide."""
    x, y, turn = rng.uniform(0.5, 0.9, 3) * rng.choice([-1, 1], 3)
    each = [
        (0, 0, 0),
        (x, 0, 0),
        (0, 0, 0),
        (0, y, 0),
        (0, 0, 0),
        (0, 0, turn),
        (0, 0, 0),
        (-x / 2, -y / 2, 0),
        (0, 0, 0),
    ]
    curves = [fit(_steps(*[(t[-1] / 9, value) for value in values]), len(t)) for values in zip(*each, strict=True)]
    return {"normal": np.ones(len(t)), "shear": np.stack(curves[:2], axis=-1), "twist": 0.3 * curves[2]}


CONTACT = (sweep, presses, rocking, strokes, double_taps, wander, drags)


def episodes(rng, size, pads, duration):
    """Draw all kinds of contact in any order, and two or three episodes of the free gripper among them."""
    kinds = [*CONTACT, *[None] * rng.integers(2, 4)]
    return [_episode(rng, kinds[i], size, pads, duration * rng.uniform(0.7, 1.0)) for i in rng.permutation(len(kinds))]


def _episode(rng, kind, size, pads, duration):
    """Draw an episode of a kind of contact, or of the gripper that moves freely."""
    length = round(duration * RATE)
    if kind is None:
        stops = [0.0, TRAVEL, *rng.uniform(0, TRAVEL, 2)]
        opening = fit(
            path([(0.0, stops[-1]), *[p for s in stops for p in ((duration / 6, s), (0.2, s))]], "smooth"), length
        )
        nothing = np.zeros((length, pads, 2))
        return Motion(nothing[..., 0], nothing, nothing, opening, 6e-3, "flat", 0.0)
    before, after = rng.uniform(0.4, 0.8, 2)
    t = np.arange(length - round((before + after) * RATE)) / RATE
    drawn = kind(rng, t)
    pressed = _steps((0.3, 1.0), (t[-1] - 0.6, 1.0), (0.3, 0.0))

    def whole(curve):
        """Lengthen a curve by the time before and after the contact."""
        curve = fit(curve, len(t))
        before_it = round(before * RATE)
        return np.pad(curve, [(before_it, length - before_it - len(t)), *[(0, 0)] * (curve.ndim - 1)])

    peak, friction, half = rng.uniform(6, 25), rng.uniform(0.3, 0.7), np.array([size[1], size[0]]) / 2
    turn = 2 * np.pi * (rng.uniform(0.1, 0.4) * t + rng.random())
    lean = rng.uniform(0.1, 0.5) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    shear = 0.1 * lean + drawn["shear"] if "shear" in drawn else lean
    shear = friction * shear / np.maximum(np.linalg.norm(shear, axis=1, keepdims=True), 1)
    mirror = np.array([[1.0, 1.0], [-1.0, 1.0]])[np.arange(pads) % 2]
    share = rng.permutation([1.0, *rng.uniform(0.5, 1.0, pads - 1)])
    middle = rng.uniform(-0.6, 0.6, 2) * (0.5 if "centre" in drawn else 1) + rng.uniform(-0.25, 0.25, (pads, 2))
    centre = middle + whole(drawn.get("centre", 0 * lean))[:, None] * mirror
    return Motion(
        normal=peak * whole(fit(drawn["normal"], len(t)) * fit(pressed, len(t)))[:, None] * share,
        shear=whole(shear)[:, None] * mirror * rng.uniform(0.7, 1.0, (pads, 1)),
        centre=np.clip(centre, -0.85, 0.85) * half,
        opening=np.full(length, rng.uniform(0.05, 0.95) * TRAVEL),
        width=rng.uniform(4e-3, 9e-3),
        indenter=OBJECTS[rng.integers(len(OBJECTS))],
        angle=rng.uniform(0, np.pi),
        twist=(0.03 + friction * whole(drawn.get("twist", 0 * t)))[:, None, None, None],
    )
