"""Recordings with known truth: one effect, several, none, or one outside the vocabulary of causes."""

from dataclasses import dataclass, field, replace

import numpy as np

from hidden import broad, contact, motions, sensor
from hidden.effects import EFFECTS, Episode, Pad
from hidden.outsiders import FURTHER, OUTSIDERS


@dataclass
class Sensor:
    """A sensor with its faults, which can be recorded again.

    Attributes:
        pad: taxels of the sensor.
        nuisance: noise, clock and tolerances.
        effects: function on forces of each effect, by name.
        own_step: newtons per count, before an effect coarsens it.
        warm: temperature rise, degC.
    """

    pad: Pad
    nuisance: sensor.Nuisance
    effects: dict
    own_step: float
    warm: float

    def apply(self, force, episode):
        """Apply all effects in order."""
        for effect in self.effects.values():
            force = effect(force, episode)
        return force


@dataclass
class Case:
    """A recording and its hidden causes.

    Attributes:
        time: (T,) timestamps, s.
        measured, simulated: (T, pads, 3, rows, cols) forces, N.
        covariates: (T,) values by name.
        episode: (T,) episode numbers.
        pitch: (row, column) pitch, m.
        causes: names of the hidden causes.
        truth: true parameters by cause.
        signal: energy of the effects over the energy of the noise, both in the measured reading.
        signals: the same by cause, for the change that it adds to the other effects; only if requested.
        sensor: the sensor, for another recording or an experiment.
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
    sensor: Sensor | None = None
    ideal: np.ndarray | None = None


def make(causes=(), *, seed, family="development", rows=6, cols=5, pads=2, strength=None, duration=9.0, rho=None,
         strong_noise=False, coarse=False, rate=None, ideal=False, more=(), forms=(), reverse=False, only_pad=None,
         since=0):  # fmt: skip
    """Make a recording with hidden causes.

    Args:
        causes: names of EFFECTS, OUTSIDERS or FURTHER.
        seed: random seed; it determines the recording bit for bit.
        family: family of motions and indenters, see `motions`. "broad" also draws the further forms of the effects,
            and other imperfections of the sensor.
        rows, cols, pads: numbers of rows, columns and pads.
        strength: 0 to 1 for all causes, or one for each; default: drawn for each.
        duration: duration of an episode, s.
        rho: correlation of the noise; default: drawn.
        strong_noise: whether the noise is five times stronger.
        coarse: whether readings are always rounded to 0.1 N; otherwise half of the sensors round more finely.
        rate: sampling rate, Hz; default: drawn.
        ideal: whether to store `signals` and the simulation with the true effects applied; not available for outsiders.
        more: kinds of episodes that follow those of the family.
        forms: form of each effect by name; default: drawn.
        reverse: whether the effects act in the reverse of their usual order.
        only_pad: the only pad that has the effects; default: all pads.
        since: the episode with which the effects begin.
    """
    rng = np.random.default_rng(seed)
    pitch = (4.35e-3, 4.52e-3)
    where = contact.positions(rows, cols, pitch)
    size = (rows * pitch[0], cols * pitch[1])
    step = 0.1 if coarse or rng.random() < 0.5 else 0.01
    nuisance = sensor.draw(rng, pads, len(where), step, rho, strong_noise)
    if family == "broad":
        nuisance = sensor.broad(rng, nuisance, rho)
    if rate is not None:
        nuisance.rate = float(rate)

    moves = broad.episodes(rng, size, pads, duration) if family == "broad" else []
    moves += [motions.episode(kind, family, rng, size, pads, duration) for kind in (*motions.KINDS[family], *more)]
    loads = np.concatenate([np.abs(contact.field(move, where)).max(axis=(1, 2, 3)) for move in moves])
    pad = Pad(where, rows, cols, pads, float(np.quantile(loads, 0.995)))
    known = {**EFFECTS, **OUTSIDERS, **FURTHER}
    order = [name for name in known if name in causes]
    if len(order) != len(set(causes)):
        raise ValueError(f"unknown cause among {causes}")
    effects, truth, forms = {}, {}, dict(forms)
    strengths = [strength] * len(order) if strength is None or np.isscalar(strength) else list(strength)
    for name, own_strength in zip(order, strengths, strict=True):
        if family == "broad" and name in EFFECTS:
            some = [form for form in EFFECTS[name].forms if form != "transposed" or rows == cols]
            forms = {name: some[rng.integers(len(some))], **forms}
        own = {"form": forms[name]} if name in forms else {}
        size = rng.random() if own_strength is None else own_strength
        effects[name], truth[name] = known[name](rng, pad, size, **own)
    if reverse:
        effects = dict(reversed(effects.items()))
    own_step = nuisance.step
    if "quantisation" in truth:
        nuisance.step, nuisance.rounding = truth["quantisation"]["step"], truth["quantisation"]["form"]
    pauses = rng.uniform(20, 60, len(moves))
    starts = np.cumsum(pauses) + duration * np.arange(len(moves))
    if only_pad is not None or since:
        effects = {name: _restricted(effect, only_pad, starts[since]) for name, effect in effects.items()}
    warm = rng.uniform(2, 8) * (-1) ** rng.integers(2) if family == "broad" else rng.uniform(-0.5, 0.5)
    device = Sensor(pad, nuisance, effects, own_step, warm)
    case = _recorded(device, moves, starts, rng, ideal and set(order) <= set(EFFECTS))
    return replace(case, pitch=pitch, causes=tuple(order), truth=truth, seed=seed)


def _restricted(effect, only_pad, begins):
    """Return an effect on one pad, or on all, in the episodes from `begins` (s) on."""

    def apply(force, episode):
        if episode.start < begins:
            return force
        pads, changed = slice(only_pad, None if only_pad is None else only_pad + 1), force.copy()
        changed[:, pads] = effect(force, episode)[:, pads]
        return changed

    return apply


def again(case, *, seed, family="development"):
    """Record the same sensor with the motions of a family, after the first recording and on the same clock."""
    rng = np.random.default_rng(seed)
    rows, cols = case.measured.shape[3:]
    size = (rows * case.pitch[0], cols * case.pitch[1])
    moves = [motions.episode(kind, family, rng, size, case.sensor.pad.pads) for kind in motions.KINDS[family]]
    lengths = np.array([len(move.normal) for move in moves]) / motions.RATE
    starts = case.time[-1] + np.cumsum(rng.uniform(20, 60, len(moves))) + np.cumsum(lengths) - lengths
    new = _recorded(case.sensor, moves, starts, rng, False)
    return replace(new, pitch=case.pitch, causes=case.causes, truth=case.truth, seed=seed)


def _recorded(device, moves, starts, rng, ideal):
    """Record `moves` that begin at `starts` with `device`, together with their simulation."""
    pad, nuisance = device.pad, device.nuisance
    parts, effect_energy, noise_energy = [], 0.0, 0.0
    each = dict.fromkeys(device.effects if ideal else (), 0.0)
    for number, (move, start) in enumerate(zip(moves, starts, strict=True)):
        force, wanted = contact.field(move, pad.where), contact.field(move, pad.where, nuisance.pose_error)
        fine_time = start + np.arange(len(force)) / motions.RATE
        temperature = 25 + device.warm * (1 - np.exp(-fine_time / 300))
        about = Episode(start, move.opening, temperature)
        changed = device.apply(force, about)
        time, read = sensor.sample(changed, nuisance, rng, motions.RATE)
        at = np.minimum(np.round(time * motions.RATE).astype(int), len(force) - 1)
        coarser = (nuisance.step**2 - device.own_step**2) / 12  # rounding energy beyond that of the device's step
        effect_energy += float(np.sum((changed[at] - force[at]) ** 2) + len(at) * nuisance.noise.size * coarser)
        for name in each:
            others = {other: effect for other, effect in device.effects.items() if other != name}
            without = replace(device, effects=others).apply(force, about)
            rounding = len(at) * nuisance.noise.size * coarser if name == "quantisation" else 0.0
            each[name] += float(np.sum((changed[at] - without[at]) ** 2) + rounding)
        noise_energy += float(len(at) * np.sum(nuisance.noise**2 + device.own_step**2 / 12))
        covariates = {"gripper_opening": move.opening[at], "temperature": temperature[at]}
        best = device.apply(wanted, about)[at] if ideal else wanted[:0]
        parts.append((start + time, read, wanted[at], covariates, np.full(len(at), number), best))

    def join(i):
        return np.concatenate([part[i] for part in parts])

    grid = (-1, pad.pads, 3, pad.rows, pad.cols)
    best = None
    if ideal:
        coarse = nuisance.step if nuisance.step > device.own_step else 0.0  # only then is rounding an effect
        best = sensor.in_range(sensor.rounded(join(5), coarse, nuisance.rounding) if coarse else join(5))
        best = best.reshape(grid).astype(np.float32)
    return Case(
        time=join(0),
        measured=join(1).reshape(grid).astype(np.float32),
        simulated=join(2).reshape(grid).astype(np.float32),
        covariates={name: np.concatenate([part[3][name] for part in parts]) for name in parts[0][3]},
        episode=join(4),
        pitch=(),
        causes=(),
        signal=effect_energy / noise_energy,
        signals={name: energy / noise_energy for name, energy in each.items()},
        sensor=device,
        ideal=best,
    )
