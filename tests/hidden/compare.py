"""What a diagnosis says of an effect, against what was hidden, although the two have other parameters.

The same experiment is done on the hidden effect, at 500 Hz, and on the fitted one, and what it reads is compared:

| cause | what is read |
|---|---|
| axis_gain | gain of each axis |
| taxel_gain | gain of each taxel, as much as it was pressed |
| offset | reading without force, each channel |
| drift | change of that from the recording's begin to each episode's |
| stiffening | gain at 10, 25, 50, 75 and 100 % of the peak |
| poisson | all shear, along x and along y, that a load on a middle taxel makes |
| crosstalk | share of a load on a middle taxel that its four neighbours read |
| axis_coupling, rotation | matrix from the force to what is read |
| layout | where each force is read |
| creep | further reading 1 s and 10 s after a step, as a share of that at once |
| hysteresis | width of the loop at 25, 50 and 75 % of the peak, second round |
| low_pass, latency | lag behind a ramp |
| saturation | reading of three times the peak |
| dead_band | least force that is read by half |
| quantisation | step |
| dead_taxels | which taxels do not answer |
| interference | field over the opening's range, mean of each pad |

The error is relative to how far the hidden effect is from doing nothing, which is stricter than relative to a number
such as a gain. Intervals are those of parameters, so that they are checked only where a parameter is one figure of the
hidden effect: see `TRUE_PARAMETERS`.
"""

from dataclasses import dataclass

import numpy as np

from hidden.effects import DT, Episode

LITTLE = 0.02  # of the floor: where there is less headroom no share of it is given


@dataclass
class Compared:
    """How near a diagnosis came to an effect.

    Attributes:
        error: of what the experiment reads, over its distance from neutral.
        inside: how many of the intervals hold the truth. intervals: how many there are.
    """

    error: float
    inside: int = 0
    intervals: int = 0


def compare(name, case, run, parameters):
    """How near a diagnosis came to the effect `name` of a case.

    Args:
        name: of the effect; it must be in the case and in the diagnosis.
        case: the recording.
        run: the fitted transform, ``run(x, time, covariates)`` on (T, pads, 3, rows, cols).
        parameters: (value, low, high) by name; low and high may be None.
    """
    bench = _Bench(case, name, run)
    true, fitted, neutral = (np.asarray(v, dtype=float) for v in EXPERIMENTS[name](bench))
    error = float(np.linalg.norm(fitted - true) / max(np.linalg.norm(true - neutral), 1e-9))
    known = TRUE_PARAMETERS[name](case, parameters) if name in TRUE_PARAMETERS else {}
    asked = [(known[n], low, high) for n, (_, low, high) in parameters.items() if n in known and low is not None]
    return Compared(error, sum(low <= value <= high for value, low, high in asked), len(asked))


def headroom_share(case, before, after):
    """How much of the headroom above what the hidden effects themselves leave a model takes away, in energy.

    Args:
        case: made with ``ideal=True``.
        before, after: root mean square error of simulation and model over that of the measured force.

    Returns:
        1 for a model as good as the hidden effects put on the same simulation; None where there is next to no headroom.
    """
    if case.ideal is None:
        return None
    measured = case.measured.astype(float)
    floor = np.sum((measured - case.ideal) ** 2) / np.sum(measured**2)
    room = before**2 - floor
    return float((before**2 - after**2) / room) if room > LITTLE * floor else None


def _read(case, name, x, opening, start):
    """What a hidden effect makes of `x` (T, pads, 3, rows, cols) at 500 Hz."""
    gap = np.broadcast_to(np.asarray(opening, dtype=float), (len(x),))
    episode = Episode(start, gap, np.full(len(x), 25.0))
    return case.sensor.effects[name](x.reshape(*x.shape[:3], -1), episode).reshape(x.shape)


class _Bench:
    """The hidden effect and the fitted one, to put the same forces on."""

    def __init__(self, case, name, run):
        self.case, self._name, self._run = case, name, run
        self.pad = case.sensor.pad
        self.start = float(case.time[0])

    def true(self, x, opening=0.02, start=None):
        """What the hidden effect makes of `x` (T, pads, 3, rows, cols) at 500 Hz."""
        return _read(self.case, self._name, x, opening, self.start if start is None else start)

    def fitted(self, x, opening=0.02, time=None):
        """What the fitted effect makes of it."""
        gap = np.broadcast_to(np.asarray(opening, dtype=float), (len(x),))
        time = self.start + DT * np.arange(len(x)) if time is None else time
        return np.asarray(self._run(x, time, {"gripper_opening": gap, "temperature": np.full(len(x), 25.0)}))

    def still(self, value):
        """(2, pads, 3, rows, cols) of a frame, or of a number."""
        return np.zeros((2, *self.case.measured.shape[1:])) + value

    def line(self, forces):
        """(T, 1, 3, 1, 1) of one taxel's normal force: enough for what acts on each channel alone."""
        x = np.zeros((len(forces), 1, 3, 1, 1))
        x[:, 0, 2, 0, 0] = forces
        return x

    def both(self, x, read):
        """What `read` says of both."""
        return read(self.true(x)), read(self.fitted(x))


def _axis_gain(bench):
    return (*bench.both(bench.still(1.0), lambda y: y[-1].mean(axis=(0, 2, 3))), np.ones(3))


def _taxel_gain(bench):
    load = np.sqrt(np.sum(bench.case.simulated[:, :, 2].astype(float) ** 2, axis=0))
    return (*bench.both(bench.still(1.0), lambda y: y[-1, :, 2] * load), load)


def _offset(bench):
    return (*bench.both(bench.still(0.0), lambda y: y[-1]), 0.0)


def _drift(bench):
    starts = bench.case.time[np.flatnonzero(np.diff(bench.case.episode, prepend=-1))]
    rest = np.zeros((25, *bench.case.measured.shape[1:]))
    true = np.stack([bench.true(rest, start=start).mean(axis=0) for start in starts])
    fitted = bench.fitted(np.zeros((len(starts), *rest.shape[1:])), time=starts)
    return true[1:] - true[0], fitted[1:] - fitted[0], 0.0


def _stiffening(bench):
    forces = bench.pad.peak * np.array([0.1, 0.25, 0.5, 0.75, 1.0])
    return (*bench.both(bench.line(forces), lambda y: y[:, 0, 2, 0, 0] / forces), 1.0)


def _probe(bench):
    """A unit of normal force on a middle taxel of each pad, and where that is."""
    row, col = bench.pad.rows // 2, bench.pad.cols // 2
    x = bench.still(0.0)
    x[:, :, 2, row, col] = 1.0
    return x, row, col


def _poisson(bench):
    x, _, _ = _probe(bench)
    return (*bench.both(x, lambda y: np.abs(y[-1, 0, :2]).sum(axis=(1, 2))), 0.0)


def _crosstalk(bench):
    x, row, col = _probe(bench)

    def share(y):
        z = y[-1, 0, 2]
        return [z[row - 1, col], z[row + 1, col], z[row, col - 1], z[row, col + 1]] / z[row, col]

    true, fitted = bench.both(x, share)
    return np.mean(true), np.mean(fitted), 0.0


def _matrix(bench):
    def columns(of):
        return np.stack([of(bench.still(np.eye(3)[k][:, None, None]))[-1].mean(axis=(0, 2, 3)) for k in range(3)])

    return columns(bench.true), columns(bench.fitted), np.eye(3)


def _layout(bench):
    frame = np.random.default_rng(0).uniform(1, 2, bench.case.measured.shape[1:])
    return (*bench.both(bench.still(frame), lambda y: y[-1]), frame)


def _creep(bench):
    step = np.r_[np.zeros(50), np.full(round(10.1 / DT), 0.5 * bench.pad.peak)]

    def further(y):
        y = y[:, 0, 2, 0, 0]
        at_once = y[51]
        return [y[50 + round(t / DT)] / at_once - 1 for t in (1.0, 10.0)]

    return (*bench.both(bench.line(step), further), 0.0)


def _hysteresis(bench):
    way = np.linspace(0, 1, 501)
    forces = bench.pad.peak * np.r_[way, way[-2::-1], way[1:], way[-2::-1]]
    level = np.array([125, 250, 375])

    def width(y):
        y = y[:, 0, 2, 0, 0]
        return y[1000 + level] - y[2000 - level]

    return (*bench.both(bench.line(forces), width), 0.0)


def _lag(bench):
    t = np.arange(0, 4, DT)
    true = bench.true(bench.line(t))[-1, 0, 2, 0, 0]
    slow = float(np.median(np.diff(bench.case.time)))  # a fitted delay keeps only so many frames
    own = np.arange(0, 4, slow)
    fitted = bench.fitted(bench.line(own), time=bench.start + own)[-1, 0, 2, 0, 0]
    return t[-1] - true, own[-1] - fitted, 0.0


def _saturation(bench):
    return (*bench.both(bench.line(np.full(2, 3 * bench.pad.peak)), lambda y: y[-1, 0, 2, 0, 0]), 0.0)


def _dead_band(bench):
    forces = np.arange(0.001, 1.5, 0.001)

    def edge(y):
        return forces[np.argmax(y[:, 0, 2, 0, 0] > 0.5 * forces)]

    return (*bench.both(bench.line(forces), edge), 0.0)


def _quantisation(bench):
    read = bench.fitted(bench.line(np.arange(0, 5, 0.001)))[:, 0, 2, 0, 0]
    levels = np.unique(np.round(read, 6))
    return bench.case.truth["quantisation"]["step"], np.median(np.diff(levels)), 0.0


def _dead_taxels(bench):
    def dead(of):
        return (of(bench.still(5.0)) - of(bench.still(0.0)))[-1, :, 2] < 2.5

    return dead(bench.true), dead(bench.fitted), 0.0


def _interference(bench):
    opening = bench.case.covariates["gripper_opening"]
    gaps = np.linspace(opening.min(), opening.max(), 9)
    x = np.zeros((9, *bench.case.measured.shape[1:]))

    def field(y):
        change = y - y[4]
        change[:, :, 2] = np.maximum(change[:, :, 2], 0)  # a normal reading does not go below 0, whatever the field
        return change.mean(axis=(3, 4))

    return field(bench.true(x, gaps)), field(bench.fitted(x, gaps)), 0.0


EXPERIMENTS = {
    "axis_gain": _axis_gain,
    "taxel_gain": _taxel_gain,
    "offset": _offset,
    "drift": _drift,
    "stiffening": _stiffening,
    "poisson": _poisson,
    "crosstalk": _crosstalk,
    "axis_coupling": _matrix,
    "rotation": _matrix,
    "layout": _layout,
    "creep": _creep,
    "hysteresis": _hysteresis,
    "low_pass": _lag,
    "latency": _lag,
    "saturation": _saturation,
    "dead_band": _dead_band,
    "quantisation": _quantisation,
    "dead_taxels": _dead_taxels,
    "interference": _interference,
}


def _pressed_gains(case, fitted):
    """Of the taxels that were pressed, as the device has them: with what no calibration has removed."""
    load = np.sum(case.simulated[:, :, 2].astype(float) ** 2, axis=0)
    scatter = case.sensor.nuisance.scatter[:, 2].reshape(load.shape)
    gain = case.truth["taxel_gain"]["gain"][:, 0].reshape(load.shape) * scatter
    pressed = (load > 0.05 * load.max()).ravel()
    return {name: g for (name, g), told in zip(_places("gain", gain).items(), pressed, strict=True) if told}


def _axes(prefix, values):
    return {f"{prefix}{axis}": float(value) for axis, value in zip("xyz", values, strict=True)}


def _places(prefix, values):
    return {prefix + "".join(f"_{i}" for i in place): float(values[place]) for place in np.ndindex(values.shape)}


def _without_force(case, name, start):
    """(pads, 3, rows, cols) what the hidden effect reads at a time."""
    return _read(case, name, np.zeros((1, *case.measured.shape[1:])), 0.02, start)[0]


def _offsets(case, fitted):
    """Of the first sample, with what has drifted until then; none beside a field, which has a constant of its own."""
    if "interference" in case.causes:
        return {}
    return _places("value", sum(_without_force(case, n, case.time[0]) for n in ("offset", "drift") if n in case.causes))


def _amplitudes(case, fitted):
    """With which a curve of the fitted time constant changes over the recording as the hidden one does."""
    begin, end = case.time[[0, -1]]
    change = _without_force(case, "drift", end) - _without_force(case, "drift", begin)
    return _places("amplitude", change / -np.expm1(-(end - begin) / fitted["tau"][0]))


TRUE_PARAMETERS = {
    "axis_gain": lambda case, fitted: _axes("gain_", case.truth["axis_gain"]["gain"]),
    "taxel_gain": _pressed_gains,
    "offset": _offsets,
    "drift": _amplitudes,
    "axis_coupling": lambda case, fitted: {
        f"{'xyz'[j]}_to_{'xyz'[i]}": case.truth["axis_coupling"]["matrix"][i, j]
        for i, j in ((0, 2), (1, 2), (2, 0), (2, 1))
    },
    # of the sensor, not of the force
    "rotation": lambda case, fitted: _axes("about_", -case.truth["rotation"]["vector"]),
    "latency": lambda case, fitted: {"delay": case.truth["latency"]["delay"]},
    "saturation": lambda case, fitted: {"limit": case.truth["saturation"]["limit"]},
    "dead_band": lambda case, fitted: {"width": case.truth["dead_band"]["width"]},
}
"""By cause, the true figures of those fitted parameters that are one figure of the hidden effect too, of the case and
the fitted ones."""
