"""Recordings with known truth: one effect, several, none, or one that is outside the vocabulary."""

from dataclasses import dataclass, field

import numpy as np

from hidden import contact, motions, sensor
from hidden.effects import EFFECTS, Episode, Pad
from hidden.outsiders import OUTSIDERS


@dataclass
class Case:
    """A recording, and what is hidden in it.

    Attributes:
        time: (T,) s. measured, simulated: (T, pads, 3, rows, cols) N. covariates: (T,) by name. episode: (T,).
        pitch: (row, column) m.
        causes: names of what was hidden. truth: their figures.
        signal: energy of the effect over the energy of the noise, both of what was measured.
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
    seed: int = 0


def make(causes=(), *, seed, family="development", rows=6, cols=5, pads=2, strength=None, duration=9.0, rho=None,
         strong_noise=False, coarse=False):  # fmt: skip
    """A recording in which `causes` are hidden.

    Args:
        causes: names of EFFECTS or OUTSIDERS.
        seed: the recording, bit for bit.
        family: of motions and indenters, see `motions`.
        strength: 0 to 1 for all causes; default: drawn for each.
        duration: of an episode, s.
        rho: correlation of the noise; default: drawn.
        strong_noise: five times the noise.
        coarse: rounding to whole 0.1 N in any case; else half of the sensors round finer.
    """
    rng = np.random.default_rng(seed)
    pitch = (4.35e-3, 4.52e-3)
    where = contact.positions(rows, cols, pitch)
    size = (rows * pitch[0], cols * pitch[1])
    step = 0.1 if coarse or rng.random() < 0.5 else 0.01
    nuisance = sensor.draw(rng, pads, len(where), step, rho, strong_noise)

    moves = [motions.episode(kind, family, rng, size, pads, duration) for kind in motions.KINDS[family]]
    true = [contact.field(move, where) for move in moves]
    simulated = [contact.field(move, where, nuisance.pose_error) for move in moves]
    peak = float(np.quantile(np.concatenate([np.abs(f).max(axis=(1, 2, 3)) for f in true]), 0.995))

    pad = Pad(where, rows, cols, pads, peak)
    known = {**EFFECTS, **OUTSIDERS}
    order = [name for name in known if name in causes]
    if len(order) != len(set(causes)):
        raise ValueError(f"unknown cause among {causes}")
    effects, truth = [], {}
    for name in order:
        apply, truth[name] = known[name](rng, pad, rng.random() if strength is None else strength)
        effects.append(apply)
    own_step = nuisance.step
    if "quantisation" in truth:
        nuisance.step = truth["quantisation"]["step"]

    pauses = rng.uniform(20, 60, len(moves))
    starts = np.cumsum(pauses) + duration * np.arange(len(moves))
    warm = rng.uniform(-0.5, 0.5)
    parts, effect_energy, noise_energy = [], 0.0, 0.0
    for number, (move, force, wanted, start) in enumerate(zip(moves, true, simulated, starts, strict=True)):
        fine_time = start + np.arange(len(force)) / motions.RATE
        temperature = 25 + warm * (1 - np.exp(-fine_time / 300))
        changed = force
        for apply in effects:
            changed = apply(changed, Episode(start, move.opening, temperature))
        time, read = sensor.sample(changed, nuisance, rng, motions.RATE)
        at = np.minimum(np.round(time * motions.RATE).astype(int), len(force) - 1)
        coarser = (nuisance.step**2 - own_step**2) / 12  # energy of rounding to more than the device's own step
        effect_energy += float(np.sum((changed[at] - force[at]) ** 2) + len(at) * nuisance.noise.size * coarser)
        noise_energy += float(len(at) * np.sum(nuisance.noise**2 + own_step**2 / 12))
        covariates = {"gripper_opening": move.opening[at], "temperature": temperature[at]}
        parts.append((start + time, read, wanted[at], covariates, np.full(len(at), number)))

    def join(i):
        return np.concatenate([part[i] for part in parts])

    grid = (-1, pads, 3, rows, cols)
    return Case(
        time=join(0),
        measured=join(1).reshape(grid).astype(np.float32),
        simulated=join(2).reshape(grid).astype(np.float32),
        covariates={name: np.concatenate([part[3][name] for part in parts]) for name in parts[0][3]},
        episode=join(4),
        pitch=pitch,
        causes=tuple(order),
        truth=truth,
        signal=effect_energy / noise_energy,
        seed=seed,
    )
