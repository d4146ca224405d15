"""Motions of the gripper: episodes of several kinds, without contact at the beginning and at the end."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hidden.exam.world import RATE

TRAVEL = 0.04
"""Travel of the gripper, m."""


@dataclass
class Move:
    """One episode on the fine clock.

    Attributes:
        normal: (steps, pads) normal force per pad, N.
        shear: (steps, pads, 2) shear force per pad, N.
        twist: (steps, pads) shear around the middle of the contact, as a share of the normal force.
        centre: (steps, pads, 2) middle of the contact, -1 to 1 from edge to edge.
        opening: (steps,) gripper opening, m.
    """

    normal: np.ndarray
    shear: np.ndarray
    twist: np.ndarray
    centre: np.ndarray
    opening: np.ndarray


@dataclass
class Plan:
    """A drawn motion, with forces relative to the peak and to the friction limit."""

    normal: np.ndarray
    shear: np.ndarray | None = None
    centre: np.ndarray | None = None
    twist: np.ndarray | None = None


def path(time, knots, values):
    """Return minimum-jerk moves from value to value, at rest at each knot."""
    knots, values = np.asarray(knots, float), np.asarray(values, float)
    i = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    u = np.clip((time - knots[i]) / np.maximum(knots[i + 1] - knots[i], 1e-9), 0, 1)
    ease = u**3 * (10 - 15 * u + 6 * u**2)
    if values.ndim == 2:
        ease = ease[:, None]
    return values[i] + ease * (values[i + 1] - values[i])


def window(rng, time):
    """Draw the first and last moment of contact."""
    return rng.uniform(0.4, 0.8), time[-1] - rng.uniform(0.5, 0.8)


def held(time, begin, end, rise=0.4):
    """Return a contact from `begin` to `end`."""
    return path(time, [0, begin, begin + rise, end - rise, end, time[-1] + 1], [0, 0, 1, 1, 0, 0])


def sweep(rng, time):
    """Sinusoidal force with rising frequency."""
    begin, end = window(rng, time)
    u = np.clip((time - begin) / (end - begin), 0, 1)
    low, high = rng.uniform(0.2, 0.5), rng.uniform(1.5, 3.5)
    phase = 2 * np.pi * low * (end - begin) / np.log(high / low) * ((high / low) ** u - 1)
    return Plan(held(time, begin, end, 0.2) * (0.55 - 0.45 * np.cos(phase)))


def presses(rng, time):
    """Presses to several levels, each held for 1 to 3 s."""
    begin, end = window(rng, time)
    knots, values, now = [0, begin], [0, 0], begin
    while now + 1.6 < end:
        rise, hold = rng.uniform(0.2, 0.6), rng.uniform(1, 3)
        hold = min(hold, end - now - rise - 0.3)
        level = rng.uniform(0.3, 1) if len(knots) > 2 else 1
        down = rng.choice([0.0, 0.15])
        knots += [now + rise, now + rise + hold, now + rise + hold + 0.3]
        values += [level, level, down]
        now = knots[-1]
    return Plan(path(time, [*knots, now + 0.3, time[-1] + 1], [*values, 0, 0]))


def rocking(rng, time):
    """A held peg with a moving centre of pressure."""
    begin, end = window(rng, time)
    hold = held(time, begin, end)
    f = rng.uniform(0.3, 1.2, 2)
    angle = 2 * np.pi * (f * (time - begin)[:, None] + rng.random(2))
    return Plan(hold * (0.8 + 0.15 * np.sin(angle[:, 0] + angle[:, 1])), centre=0.45 * np.sin(angle))


def slides(rng, time):
    """Strokes along both axes that stick and slip."""
    begin, end = window(rng, time)
    knots = np.linspace(begin + 0.5, end - 0.5, 5)
    corner = rng.permutation([[0.5, 0], [0, 0.5], [-0.5, 0], [0, -0.5]])
    stops = np.concatenate([np.zeros((1, 2)), corner[:3], np.zeros((1, 2))])
    centre = path(time, [0, *knots, time[-1] + 1], [stops[0], *stops, stops[-1]])
    speed = np.gradient(centre, axis=0) * RATE
    fast = np.linalg.norm(speed, axis=1)
    way = np.cumsum(fast) / RATE
    tooth = (way / rng.uniform(0.08, 0.25)) % 1  # sticks, then slips in the last tenth of each length
    rub = np.where(tooth < 0.9, 0.6 + 0.4 * tooth / 0.9, 1 - 4 * (tooth - 0.9))
    direction = speed / np.maximum(fast, 1e-6)[:, None]
    moving = fast / (fast + 0.05)
    return Plan(held(time, begin, end) * 0.85, shear=(rub * moving)[:, None] * direction, centre=centre)


def taps(rng, time):
    """Quick double taps."""
    begin, end = window(rng, time)
    normal, now = np.zeros_like(time), begin
    while now < end - 0.6:
        level = rng.uniform(0.4, 1)
        for lag in (0.0, rng.uniform(0.22, 0.35)):
            rise = rng.uniform(0.07, 0.12)
            knots = now + lag + np.array([-9, 0, rise, rise + 0.02, 1.8 * rise + 0.02, 99])
            normal = np.maximum(normal, level * path(time, knots, [0, 0, 1, 1, 0, 0]))
        now += rng.uniform(0.7, 1.3)
    return Plan(normal)


def staircase(rng, time):
    """Steps to the peak and back."""
    begin, end = window(rng, time)
    count = int(rng.integers(3, 6))
    levels = np.concatenate([np.arange(count + 1), np.arange(count)[::-1]]) / count
    edges = np.linspace(begin, end - 0.3, len(levels))
    knots, values = [0.0], [0.0]
    for edge, low, high in zip(edges[:-1], levels[:-1], levels[1:], strict=True):
        knots += [edge, edge + 0.2]
        values += [low, high]
    return Plan(path(time, [*knots, time[-1] + 1], [*values, 0]))


def wander(rng, time):
    """A smooth random force."""
    begin, end = window(rng, time)
    low = butter(2, rng.uniform(0.6, 2.5), fs=RATE, output="sos")
    noise = sosfiltfilt(low, rng.normal(size=(len(time) + 2000, 3)), axis=0)[1000:-1000]
    noise /= np.std(noise, axis=0)
    force = np.clip(0.5 + 0.28 * noise[:, 0], 0.02, 1.1)
    return Plan(held(time, begin, end) * force, shear=0.4 * np.clip(noise[:, 1:], -1.5, 1.5))


def drags(rng, time):
    """A firm grip pulled along one axis, then along the other, and twisted, without slip."""
    begin, end = window(rng, time)
    knots = np.linspace(begin + 0.4, end - 0.4, 9)
    a, b, c = rng.uniform(0.5, 0.9, 3) * rng.choice([-1, 1], 3)
    stops = np.array([[0, 0], [a, 0], [0, 0], [0, b], [0, 0], [0, 0], [0, 0], [-a / 2, -b / 2], [0, 0]])
    turns = np.array([0, 0, 0, 0, 0, c, 0, 0, 0]) * 0.3
    shear = path(time, [0, *knots, time[-1] + 1], [stops[0], *stops, stops[-1]])
    return Plan(held(time, begin, end), shear=shear, twist=path(time, [0, *knots, time[-1] + 1], [0, *turns, 0]))


CONTACT = {f.__name__: f for f in (sweep, presses, rocking, slides, taps, staircase, wander, drags)}


def gripper(rng, time, whole):
    """Return the opening (m) over time, without contact, over the whole travel or a part of it."""
    stops = [0, TRAVEL, rng.uniform(0, TRAVEL)] if whole else list(rng.uniform(0, TRAVEL, 4))
    stops = stops[::-1] if rng.random() < 0.5 else stops
    knots = np.linspace(rng.uniform(0.3, 0.8), time[-1] - 0.4, 2 * len(stops) - 1)
    return path(time, knots, np.repeat(stops, 2)[:-1])


def draw(rng, pads):
    """Draw the episodes of a recording: as many kinds of contact as fit, and the free gripper.

    Returns:
        The kinds, the moves, and the (episodes,) start times, s.
    """
    count = int(rng.integers(8, 13))
    free = int(rng.integers(2, 4))
    kinds = list(rng.permutation(list(CONTACT)))[: count - free]
    kinds += list(rng.choice(list(CONTACT), count - free - len(kinds)))
    kinds = [str(kind) for kind in rng.permutation([*kinds, *["gripper"] * free])]
    times = [np.arange(int(rng.uniform(6, 10) * RATE)) / RATE for _ in kinds]
    first = kinds.index("gripper")
    moves = [
        episode(rng, kind, time, pads, i == first) for i, (kind, time) in enumerate(zip(kinds, times, strict=True))
    ]
    pauses = rng.uniform(15, 60, count)
    lengths = np.array([time[-1] for time in times])
    return kinds, moves, np.cumsum(pauses) - pauses[0] + np.concatenate([[0], np.cumsum(lengths)[:-1]])


def episode(rng, kind, time, pads, whole):
    """Draw one episode of a kind."""
    steps = len(time)
    if kind == "gripper":
        nothing = np.zeros((steps, pads, 2))
        return Move(nothing[..., 0], nothing, nothing[..., 0], nothing, gripper(rng, time, whole))
    plan = CONTACT[kind](rng, time)
    peak, friction = rng.uniform(6, 25), rng.uniform(0.3, 0.7)
    turn = 2 * np.pi * (rng.uniform(0.1, 0.4) * time + rng.random())
    lean = rng.uniform(0.1, 0.5) * np.stack([np.cos(turn), np.sin(turn)], 1)
    shear = lean if plan.shear is None else plan.shear + 0.1 * lean
    shear = shear / np.maximum(np.linalg.norm(shear, axis=1, keepdims=True), 1)
    moving = np.zeros((steps, 2)) if plan.centre is None else plan.centre
    twist = np.zeros(steps) if plan.twist is None else plan.twist
    share = np.ones(pads)
    share[1:] = rng.uniform(0.5, 1, pads - 1)
    share = rng.permutation(share)
    mirror = np.ones((pads, 2))
    mirror[1:, 0] = -1  # the second pad faces the first
    middle = rng.uniform(-0.6, 0.6, 2) * (0.5 if plan.centre is not None else 1) + rng.uniform(-0.25, 0.25, (pads, 2))
    normal = peak * plan.normal[:, None] * share
    return Move(
        normal=normal,
        shear=friction * normal[..., None] * shear[:, None] * mirror * rng.uniform(0.7, 1, (pads, 1)),
        twist=twist[:, None] * np.ones(pads) * friction,
        centre=np.clip(middle + moving[:, None] * mirror, -0.85, 0.85),
        opening=np.full(steps, rng.uniform(0.05, 0.95) * TRAVEL),
    )
