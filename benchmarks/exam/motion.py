"""Motions: what objects do on the pads, without any simulator.

A recording has 6 to 10 episodes. In each, an object presses one or two pads: its force, place, tangential travel and
spin are functions of time made of straight pieces, rounded by a Hann window. The pads rest before and after. Between
the episodes time goes on, unrecorded, so a sensor with memory remembers the episode before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from .presses import FINE, FORCES, MOVES, Array, Move, pieces, rounded

GRIDS = (((4, 3), 1), ((4, 3), 2), ((4, 4), 1), ((4, 4), 2), ((6, 5), 1), ((5, 2), 1), ((5, 2), 2))  # grid, pads
SHAPES = ("ball", "flat", "bar", "bumps")


@dataclass(frozen=True, eq=False)
class Episode:
    """What one object does in one episode; S samples at `FINE`.

    Attributes:
        start: Time of the first sample on the recording's clock (s).
        force: ``(S,)`` normal force, 0 to about 1.
        place: ``(S, 2)`` centre of the contact along x and y (mm from the middle of the pad).
        travel: ``(S, 2)`` tangential travel of the object's surface (mm); differs from `place` when it rolls.
        spin: ``(S,)`` rotation of the object about the normal (rad).
        opening: ``(S,)`` opening of the gripper (m).
        shape: One of `SHAPES`.
        size: Radius or half width of the object's contact (pitches).
        angle: Orientation of the shape (rad).
    """

    start: float
    force: Array
    place: Array
    travel: Array
    spin: Array
    opening: Array
    shape: str
    size: float
    angle: float


@dataclass(frozen=True, eq=False)
class Plan:
    """A recording before any force is known.

    Attributes:
        rows, cols, pads: The sensor.
        pitch: Distance of neighbouring taxels (mm).
        peak: Largest normal force on a taxel (N).
        rate: Recording rate (Hz).
        friction: Static and sliding coefficient of friction.
        time: ``(T,)`` continuous time at `FINE` (s), the breaks included.
        temperature: ``(T,)`` (degC).
        opening: ``(T,)`` (m); held in the breaks.
        episodes: The episodes.
        frames: ``(N,)`` times of the recorded frames (s).
        episode: ``(N,)`` number of the episode of each frame.
    """

    rows: int
    cols: int
    pads: int
    pitch: float
    peak: float
    rate: float
    friction: tuple[float, float]
    time: Array
    temperature: Array
    opening: Array
    episodes: tuple[Episode, ...]
    frames: Array
    episode: NDArray[np.int64]


def draw_plan(rng: Generator, poor: bool = False, pads: int | None = None) -> Plan:
    """Draw a recording's motion.

    Args:
        rng: Source of all draws.
        poor: Whether all episodes are the same slow ramp, of one speed and direction at one place.
        pads: Number of pads; by default one or two.
    """
    sensors = [sensor for sensor in GRIDS if pads in (None, sensor[1])]
    (rows, cols), pads = sensors[rng.integers(len(sensors))]
    rate, pitch = float(rng.uniform(30, 100)), float(rng.uniform(2.0, 4.0))
    room = 0.5 * pitch * (np.array([cols, rows]) - 1.0)
    makers = _poor_episodes(rng, room) if poor else _rich_episodes(rng, room)
    episodes, clock = [], 0.0
    for make in makers:
        episodes.append(make(clock))
        clock += len(episodes[-1].force) / FINE + float(np.exp(rng.uniform(np.log(2), np.log(12))))
    end = episodes[-1].start + len(episodes[-1].force) / FINE
    time = np.arange(round(end * FINE) + FINE // 2) / FINE
    known = np.concatenate([e.start + np.arange(len(e.force)) / FINE for e in episodes])
    opening = np.interp(time, known, np.concatenate([e.opening for e in episodes]))
    frames, number = [], []
    for n, e in enumerate(episodes):
        times = np.arange(e.start + 0.02, e.start + len(e.force) / FINE - 0.02, 1 / rate)
        frames.append(times + rng.uniform(-0.05, 0.05, len(times)) / rate)  # a real clock, and a recorded one
        number.append(np.full(len(times), n))
    return Plan(
        rows=rows,
        cols=cols,
        pads=pads,
        pitch=pitch,
        peak=float(np.exp(rng.uniform(np.log(2), np.log(10)))),
        rate=rate,
        friction=(float(rng.uniform(0.6, 1.0)), float(rng.uniform(0.4, 0.6))),
        time=time,
        temperature=_temperature(rng, time),
        opening=opening,
        episodes=tuple(episodes),
        frames=np.concatenate(frames),
        episode=np.concatenate(number).astype(np.int64),
    )


def _rich_episodes(rng: Generator, room: Array) -> list[Callable[[float], Episode]]:
    """Return makers of episodes that differ in force, place, shape, speed and direction."""
    count = int(rng.integers(6, 11))
    presses = [FORCES[i % len(FORCES)] for i in rng.permutation(max(count, len(FORCES)))[:count]]
    moves = [MOVES[i % len(MOVES)] for i in rng.permutation(max(count, len(MOVES)))[:count]]
    wide = float(rng.uniform(0.06, 0.09))

    def maker(press: Callable[[Generator, int], Array], move: Move) -> Callable[[float], Episode]:
        seconds, before, after = rng.uniform(5, 9), rng.uniform(0.9, 1.6), rng.uniform(0.9, 1.6)
        steps, first, last = round(seconds * FINE), round(before * FINE), round(after * FINE)
        active = steps - first - last
        level = np.exp(rng.uniform(np.log(0.35), 0))
        force = np.zeros(steps)
        force[first : first + active] = level * press(rng, active)
        middle = rng.uniform(-0.6, 0.6, 2) * room
        place, travel, spin = move(rng, active, room)
        held = [np.pad(v, [(first, last)] + [(0, 0)] * (v.ndim - 1), mode="edge") for v in (place, travel, spin)]
        closed = rng.uniform(0.01, 0.05)
        times = [0.2 * before, 0.8 * before, seconds - 0.8 * after, seconds - 0.2 * after]
        gap = rounded(pieces(steps, times, [wide, closed, closed, rng.uniform(closed, wide)]), 0.15)
        gap = gap - 1e-3 * force + 2e-4 * np.sin(np.arange(steps) / FINE * rng.uniform(1, 4))
        shape, size = SHAPES[rng.integers(len(SHAPES))], float(rng.uniform(0.8, 1.6))
        return lambda start: Episode(
            start, force, middle + held[0], held[1], held[2], gap, shape, size, float(rng.uniform(0, np.pi))
        )

    return [maker(press, move) for press, move in zip(presses, moves, strict=True)]


def _poor_episodes(rng: Generator, room: Array) -> list[Callable[[float], Episode]]:
    """Return makers of equal slow ramps up and down; the opening only creeps from episode to episode."""
    count, place = int(rng.integers(6, 9)), rng.uniform(-0.4, 0.4, 2) * room
    direction, size, closed = rng.uniform(0, 2 * np.pi), float(rng.uniform(1, 1.6)), rng.uniform(0.02, 0.04)
    steps = round(7 * FINE)
    ramp = rounded(pieces(steps, [0, 1, 3.5, 6], [0, 0, 1, 0]), 0.3)

    def maker(number: int) -> Callable[[float], Episode]:
        force = ramp * rng.uniform(0.97, 1.0)
        travel = 0.6 * ramp[:, None] * (np.cos(direction), np.sin(direction))
        gap = np.full(steps, closed + 0.002 * number)
        still = np.broadcast_to(place, (steps, 2))
        return lambda start: Episode(start, force, still, travel, np.zeros(steps), gap, "ball", size, 0.0)

    return [maker(number) for number in range(count)]


def _temperature(rng: Generator, time: Array) -> Array:
    """Return a warm-up of 1 to 6 K with a slow random wave (degC)."""
    rise, tau = rng.uniform(1, 6), rng.uniform(40, 200)
    wave = 0.4 * np.sin(2 * np.pi * time / rng.uniform(25, 60) + rng.uniform(0, 6))
    return rng.uniform(22, 28) + rise * (1 - np.exp(-time / tau)) + wave
