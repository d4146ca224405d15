"""Recordings with known truth: one effect, several, none, or one outside the vocabulary of causes."""

from dataclasses import dataclass, field
from zlib import crc32

import numpy as np

from hidden.exam import contact, motions, nuisance
from hidden.exam.effects import EFFECTS
from hidden.exam.outsiders import NEEDS_TWO_PADS, NEEDS_WARMTH, OUTSIDERS
from hidden.exam.world import RATE, World

SHAPES = ((4, 4), (6, 5), (12, 10), (1, 15))
VISIBLE = {"effect": 0.02, "outsider": 0.3}
"""Minimum signal; weaker draws are repeated."""
ATTEMPTS = 6


@dataclass
class Case:
    """A recording and its hidden causes.

    Attributes:
        time: (T,) timestamps, s.
        measured, simulated: (T, pads, 3, rows, cols) forces, N.
        covariates: (T,) values by name.
        episode: (T,) episode numbers.
        pitch: (row, column) pitch, m.
        causes: names of the hidden causes, in the order of the chain.
        truth: true parameters by cause.
        signal: energy of the effects' changes to the reading over the energy of the noise.
        signals: the same by cause, for the change that it adds to the other effects.
        ideal: (T, pads, 3, rows, cols) N, the simulation with the true effects applied, or None.
    """

    time: np.ndarray
    measured: np.ndarray
    simulated: np.ndarray
    covariates: dict
    episode: np.ndarray
    pitch: tuple
    causes: tuple
    truth: dict = field(default_factory=dict)
    signal: float = 0.0
    signals: dict = field(default_factory=dict)
    seed: int = 0
    ideal: np.ndarray | None = None


def make(causes=(), *, seed, strength=None, ideal=False, shape=None, pads=None, rho=None, strong_noise=False,
         coarse=False):  # fmt: skip
    """Make a recording with hidden causes.

    Args:
        causes: names of EFFECTS or OUTSIDERS.
        seed: random seed; it determines the recording bit for bit.
        strength: 0 to 1 for all causes; default: drawn for each, and redrawn if a cause is not visible.
        ideal: whether to store the simulation with the true effects applied; not available for outsiders.
        shape: (rows, cols); default: drawn.
        pads: number of pads; default: drawn.
        rho: correlation of the noise; default: drawn.
        strong_noise: whether the noise is five times stronger.
        coarse: whether readings are always rounded to 0.1 N; otherwise half of the sensors round more finely.
    """
    known = {**EFFECTS, **OUTSIDERS}
    unknown = set(causes) - set(known)
    if unknown:
        raise ValueError(f"unknown causes {sorted(unknown)}")
    order = tuple(name for name in known if name in causes)
    options = {"rho": rho, "strong_noise": strong_noise, "coarse": coarse}
    for attempt in range(ATTEMPTS):
        case = _once(order, seed, attempt, strength, ideal, shape, pads, options)
        least = [VISIBLE["outsider" if name in OUTSIDERS else "effect"] for name in order]
        if strength is not None or all(case.signals[n] >= s for n, s in zip(order, least, strict=True)):
            break
    return case


def _once(order, seed, attempt, strength, ideal, shape, pads, options):
    """Make one attempt at a recording."""

    def source(name):
        return np.random.default_rng([seed, attempt, crc32(name.encode())])

    world, flaws, frames, force, simulated = _recorded(source, order, shape, pads, options)
    rng = source("strength")
    drawn = {name: rng.random() if strength is None else strength for name in order}
    effects = {name: {**EFFECTS, **OUTSIDERS}[name](source(name), world, drawn[name]) for name in order}
    chain = list(effects.values())

    plain = nuisance.in_range(frames.of(force, flaws.average))
    changed = _changed(chain, force)
    analogue = frames.of(changed, flaws.average)
    clean = _read(chain, analogue)
    step = None if "quantisation" in order else flaws.step
    reading = _read(chain, analogue + nuisance.noise(source("noise"), flaws, frames.episode), step)
    noise = len(plain) * float(np.sum(flaws.sigma**2) + flaws.sigma.size * flaws.step**2 / 12)
    signal = float(np.sum((clean - plain) ** 2)) / noise
    signals = dict.fromkeys(order, signal)
    for name in order if len(order) > 1 else ():
        rest = [effect for other, effect in effects.items() if other != name]
        without = _read(rest, frames.of(_changed(rest, force), flaws.average))
        signals[name] = float(np.sum((clean - without) ** 2)) / noise
    best = None
    if ideal and not set(order) & set(OUTSIDERS):
        best = _read(chain, frames.of(_changed(chain, simulated), exact=True))

    def grid(values):
        return values.reshape(*values.shape[:3], world.rows, world.cols).astype(np.float32)

    return Case(
        time=world.start[frames.episode] + frames.stamp,
        measured=grid(reading),
        simulated=grid(frames.of(simulated, exact=True)),
        covariates={
            "gripper_opening": frames.of(world.opening, exact=True),
            "temperature": frames.of(world.temperature, exact=True),
        },
        episode=frames.episode,
        pitch=world.pitch,
        causes=order,
        truth={name: {"strength": drawn[name], **effect.truth} for name, effect in effects.items()},
        signal=signal,
        signals=signals,
        seed=seed,
        ideal=None if best is None else grid(best),
    )


def _changed(chain, force):
    """Apply the effects that act on the fine clock to `force`."""
    for effect in chain:
        if not effect.on_frames:
            force = effect.apply(force)
    return force


def _read(chain, frames, step=None):
    """Return the sensor's reading: rounded to its own step, after effects on frames, clipped to its range."""
    out = np.round(frames / step) * step if step else frames
    for effect in chain:
        if effect.on_frames:
            out = effect.apply(out)
    return nuisance.in_range(out)


def _recorded(source, order, shape, pads, options):
    """Draw a sensor and its motions: the world, flaws and frames, and the true and simulated forces."""
    rng = source("sensor")
    drawn = SHAPES[int(rng.choice(len(SHAPES), p=[0.35, 0.4, 0.1, 0.15]))]
    rows, cols = shape or drawn
    two = 1 + int(rng.random() < 0.5 and rows * cols < 100)  # only one large pad, to save time
    pads = pads or (2 if set(order) & set(NEEDS_TWO_PADS) else two)
    pitch = (float(rng.uniform(3e-3, 5e-3)), float(rng.uniform(3e-3, 5e-3)))
    where = contact.positions(rows, cols, pitch)
    flaws = nuisance.draw(source("flaws"), (pads, 3, len(where)), **options)

    rng = source("motion")
    _, moves, start = motions.draw(rng, pads)
    indenters = [contact.draw(rng) for _ in moves]
    force = contact.field(moves, indenters, where, pitch)
    simulated = contact.field(moves, indenters, where, pitch, flaws.shift)
    steps = force.shape[1]
    opening = np.stack([np.concatenate([m.opening, np.full(steps - len(m.opening), m.opening[-1])]) for m in moves])
    frames = nuisance.frames(source("frames"), flaws, [len(move.normal) / RATE for move in moves])

    few = np.abs(force[:, ::8])
    most = few.max(axis=(2, 4)).reshape(-1, 3)
    peak = np.quantile(most, 0.995, axis=0)
    peak[:2] = peak[:2].max()
    world = World(rows, cols, pads, pitch, where, start, opening, _temperature(source("air"), start, steps, order),
                  peak, few[..., 2, :].max(axis=(0, 1)), flaws.step, frames.episode)  # fmt: skip
    return world, flaws, frames, force * flaws.gain, simulated


def _temperature(rng, start, steps, order):
    """Draw the temperature (episodes, steps), degC: nearly constant, or changing by several degrees in a fifth."""
    clock = start[:, None] + np.arange(steps) / RATE
    warm = rng.random() < 0.2 or "drift" in order or bool(set(order) & set(NEEDS_WARMTH))
    rise = rng.uniform(2, 8) * rng.choice([-1, 1], p=[0.2, 0.8])
    small = rng.uniform(-0.4, 0.4)
    tau, period, phase = rng.uniform(100, 500), rng.uniform(200, 600), rng.uniform(0, 2 * np.pi)
    curve = (rise if warm else small) * -np.expm1(-clock / tau)
    return rng.uniform(20, 28) + curve + 0.1 * np.sin(2 * np.pi * clock / period + phase)
