"""Broken: streams that do not correspond, and the required response to each.

Criteria of success, fixed before the engine was run on these streams:

- noise in both, other episodes: the verdict is ``unrelated``, or the recording is refused.
- shifted: a warning that the clocks differ, with the shift to within 0.15 s, and no cause.
- other units: the recording is refused with a message that contains "newtons", or "paxisim calibrate" for microtesla.
- swapped pads: ``layout`` and nothing else.
- one stream frozen: the recording is refused, the verdict is ``unrelated``, or a warning or left-over line says that a
  stream does not change and nothing but `dead_taxels` is named.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from injected.cases import Base, Case, Source, tensor
from injected.effects import Floats
from paxisim.recording import Recording


def _noise(rng: np.random.Generator, base: Base, memory: float) -> Recording:
    """Independent noise in both streams, as strong as the forces; `memory` is its correlation from frame to frame."""

    def coloured() -> Floats:
        white, out = rng.normal(size=base.scene.force.shape), np.zeros(base.scene.force.shape)
        for i in range(1, len(out)):
            out[i] = memory * out[i - 1] + white[i]
        return out / out.std() * base.scene.peak / 2

    return replace(base.recording, measured=tensor(coloured()), simulated=tensor(coloured()))


def _white(rng: np.random.Generator, base: Base) -> Recording:
    return _noise(rng, base, 0.0)


def _coloured(rng: np.random.Generator, base: Base) -> Recording:
    return _noise(rng, base, 0.95)


def _shuffled(rng: np.random.Generator, base: Base) -> Recording:
    """Simulated episodes in another order, each aligned with the start of a measured one; none stays in its place."""
    recording = base.recording
    numbers = np.unique(recording.episode)
    order = rng.permutation(len(numbers))
    while np.any(order == np.arange(len(numbers))):
        order = rng.permutation(len(numbers))
    simulated = np.asarray(recording.simulated, dtype=float).copy()
    for number, other in enumerate(order):
        own, its = recording.episode == numbers[number], recording.episode == numbers[other]
        time, then = recording.time[own] - recording.time[own][0], recording.time[its] - recording.time[its][0]
        flat = np.asarray(recording.simulated, dtype=float)[its].reshape(its.sum(), -1)
        simulated[own] = np.stack([np.interp(time, then, c) for c in flat.T], axis=1).reshape(simulated[own].shape)
    return replace(recording, simulated=simulated.astype(np.float32))


def _other_motion(rng: np.random.Generator, base: Base) -> Recording:
    """Simulation of another run, whose presses start at other times and have other speeds."""
    recording, time = base.recording, base.recording.time
    run = np.cumsum(np.exp(rng.normal(0, 1.0, 60)))
    warped = np.interp(time, np.linspace(time[0], time[-1], 60), (run - run[0]) / (run[-1] - run[0]))
    then = time[0] + (1 - warped) * (time[-1] - time[0])  # time is warped and reversed
    flat = np.asarray(recording.simulated, dtype=float).reshape(len(time), -1)
    moved = np.stack([np.interp(then, time, c) for c in flat.T], axis=1)
    return replace(recording, simulated=moved.reshape(len(time), 1, 3, 1, 5).astype(np.float32))


def _late(recording: Recording, shift: float) -> Recording:
    """Measured stream delayed by `shift` seconds, as if by a clock of its own."""
    flat = np.asarray(recording.measured, dtype=float).reshape(len(recording), -1)
    moved = np.stack([np.interp(recording.time - shift, recording.time, c) for c in flat.T], axis=1)
    return replace(recording, measured=moved.reshape(len(recording), 1, 3, 1, 5).astype(np.float32))


def _scaled(factor: float) -> Callable[[np.random.Generator, Base], Recording]:
    def scaled(rng: np.random.Generator, base: Base) -> Recording:
        assert base.recording.measured is not None
        return replace(base.recording, measured=base.recording.measured * np.float32(factor))

    return scaled


def _swapped_pads(rng: np.random.Generator, base: Base) -> Recording:
    """Two pads, the second pressed in the later two thirds of each episode; the measured pads are swapped."""

    def second(values: Floats) -> Floats:
        out = values.copy()
        for number in np.unique(base.recording.episode):
            own = np.flatnonzero(base.recording.episode == number)
            late = np.clip(np.linspace(-0.75, 1.5, len(own)), 0, 1) * (len(own) - 1)
            flat = values[own].reshape(len(own), -1)
            moved = np.stack([np.interp(late, np.arange(len(own)), c) for c in flat.T], axis=1)
            out[own] = 0.6 * moved.reshape(values[own].shape)
        return out

    measured, simulated = (np.asarray(s, dtype=float) for s in (base.recording.measured, base.recording.simulated))
    return Recording(
        base.recording.time,
        np.concatenate([second(measured), measured], axis=1).astype(np.float32),
        np.concatenate([simulated, second(simulated)], axis=1).astype(np.float32),
        base.recording.covariates,
        base.recording.episode,
    )


def _frozen(stream: str, since: float) -> Callable[[np.random.Generator, Base], Recording]:
    def frozen(rng: np.random.Generator, base: Base) -> Recording:
        values = np.array(getattr(base.recording, stream))
        start = int(since * len(values))
        values[start:] = values[start]
        return replace(base.recording, **{stream: values})

    return frozen


def _microtesla(source: Source, unit: str) -> Recording:
    """Channels as recorded (microtesla), paired with their regression in newtons."""
    real = source.both[1]
    own = np.isin(real.press, np.arange(real.used.start, real.used.stop))
    simulated = tensor(source.simulated(1, "fine"))
    metadata = {"unit": unit} if unit else {}
    covariates = {**real.covariates, "load": real.load}
    return Recording(real.time, real.field, simulated, covariates, real.press, metadata=metadata)[own][::4]


SHIFTS = (0.8, 1.2, 5.0, -1.2)
BROKEN: dict[str, Callable[[np.random.Generator, Base], Recording]] = {
    "white noise in both": _white,
    "coloured noise in both": _coloured,
    "shuffled episodes": _shuffled,
    "another motion": _other_motion,
    "measured in millinewtons": _scaled(1000.0),
    "measured in kilonewtons": _scaled(0.001),
    "swapped pads": _swapped_pads,
    "measured frozen": _frozen("measured", 0.0),
    "simulated frozen": _frozen("simulated", 0.0),
    "measured frozen halfway": _frozen("measured", 0.5),
    "simulated frozen halfway": _frozen("simulated", 0.5),
}


UNITS = {"microtesla": "uT", "microtesla, unit not said": ""}
COUNT = len(BROKEN) + len(SHIFTS) + len(UNITS)


def broken(source: Source, seed: int, number: int) -> Case:
    """Return one of the `COUNT` broken streams: those of `BROKEN`, then the clock shifts and the units."""
    rng, name = np.random.default_rng([seed, 3, number]), f"broken:{number}"
    if number >= COUNT - len(UNITS):
        kind, unit = list(UNITS.items())[number - COUNT]
        return Case(name, "broken", kind, "press_2 as recorded", _microtesla(source, unit))
    base = source.base(rng)
    if number < len(BROKEN):
        kind, make = list(BROKEN.items())[number]
        return Case(name, "broken", kind, base.words, make(rng, base))
    shift = SHIFTS[number - len(BROKEN)]
    return Case(name, "broken", f"shifted by {shift:g} s", base.words, _late(base.recording, shift), shift=shift)
