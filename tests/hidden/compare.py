"""Comparison of diagnosed effects with hidden ones, although the two have different parameters.

The same experiment runs on the hidden effect, at 500 Hz, and on the fitted one. The error is relative to the distance
of the hidden effect from no effect, which is stricter than an error relative to a value such as a gain. Quantities that
depend only on the force or time at which a sensor is calibrated are left out: loops, gains and readings are relative to
another reading, and fields and drifts are changes.
"""

import numpy as np

from hidden.effects import DT, Episode

PARTS = {"Poisson effect": "poisson", "crosstalk": "crosstalk"}
"""Hidden effects that a diagnosis reports as parts of the cause `gel_operator`."""
LITTLE = 0.02  # smallest headroom, relative to the floor, for which a share is computed


def named(diagnosis):
    """Return the named causes by the names of hidden effects, each with its cause, largest gain first.

    A part of a cause counts as a cause. A part that is no hidden effect keeps its own name.
    """
    return {
        name: cause
        for cause in diagnosis.causes
        for name in ([PARTS.get(part.name, part.name) for part in cause.parts] or [cause.name])
    }


def compare(name, case, run):
    """Return the error of a fitted effect, relative to the distance of the true reading from neutral.

    Args:
        name: name of the effect, which must be in the case and in the diagnosis.
        case: the recording.
        run: the fitted transform, ``run(x, time, covariates)`` on (T, pads, 3, rows, cols).
    """
    true, fitted, neutral = (np.asarray(v, dtype=float) for v in EXPERIMENTS[name](Bench(case, name, run)))
    return float(np.linalg.norm(fitted - true) / max(np.linalg.norm(true - neutral), 1e-9))


def headroom_share(case, before, after):
    """Return the share of the headroom that a model removes: the error energy above the floor of the true effects.

    Args:
        case: the recording, made with ``ideal=True``.
        before, after: root mean square errors of simulation and model, relative to that of the measured force.

    Returns:
        1 for a model as good as the true effects applied to the same simulation; None if there is hardly any headroom.
    """
    if case.ideal is None:
        return None
    measured = case.measured.astype(float)
    floor = np.sum((measured - case.ideal) ** 2) / np.sum(measured**2)
    room = before**2 - floor
    return float((before**2 - after**2) / room) if room > LITTLE * floor else None


class Bench:
    """A bench that applies the same forces to the hidden effect and to the fitted one."""

    def __init__(self, case, name, run):
        self.case, self._name, self._run = case, name, run
        self.pad = case.sensor.pad
        self.start = float(case.time[0])

    def true(self, x, opening=0.02, start=None):
        """Apply the hidden effect to `x` (T, pads, 3, rows, cols) at 500 Hz."""
        gap = np.broadcast_to(np.asarray(opening, dtype=float), (len(x),))
        episode = Episode(self.start if start is None else start, gap, np.full(len(x), 25.0))
        return self.case.sensor.effects[self._name](x.reshape(*x.shape[:3], -1), episode).reshape(x.shape)

    def fitted(self, x, opening=0.02, time=None):
        """Apply the fitted effect to `x`."""
        gap = np.broadcast_to(np.asarray(opening, dtype=float), (len(x),))
        time = self.start + DT * np.arange(len(x)) if time is None else time
        return np.asarray(self._run(x, time, {"gripper_opening": gap, "temperature": np.full(len(x), 25.0)}))

    def still(self, value):
        """Return two equal frames (2, pads, 3, rows, cols) from a frame or a number."""
        return np.zeros((2, *self.case.measured.shape[1:])) + value

    def line(self, forces):
        """Return normal forces on one taxel (T, 1, 3, 1, 1), sufficient for effects on single channels."""
        x = np.zeros((len(forces), 1, 3, 1, 1))
        x[:, 0, 2, 0, 0] = forces
        return x

    def both(self, x, read):
        """Evaluate `read` on both effects."""
        return read(self.true(x)), read(self.fitted(x))


def _taxel_gain(bench):
    load = np.sqrt(np.sum(bench.case.simulated[:, :, 2].astype(float) ** 2, axis=0))
    return (*bench.both(bench.still(1.0), lambda y: y[-1, :, 2] * load), load)


def _drift(bench):
    starts = bench.case.time[np.flatnonzero(np.diff(bench.case.episode, prepend=-1))]
    rest = np.zeros((25, *bench.case.measured.shape[1:]))
    true = np.stack([bench.true(rest, start=start).mean(axis=0) for start in starts])
    fitted = bench.fitted(np.zeros((len(starts), *rest.shape[1:])), time=starts)
    return true[1:] - true[0], fitted[1:] - fitted[0], 0.0


def _stiffening(bench):
    forces = bench.pad.peak * np.array([0.5, 0.1, 0.25, 0.75, 1.0])

    def relative(y):
        gain = y[:, 0, 2, 0, 0] / forces
        return gain[1:] / gain[0]

    return (*bench.both(bench.line(forces), relative), 1.0)


def _probe(bench):
    """Return a unit normal force on a middle taxel of each pad, and its row and column."""
    row, col = bench.pad.rows // 2, bench.pad.cols // 2
    x = bench.still(0.0)
    x[:, :, 2, row, col] = 1.0
    return x, row, col


def _poisson(bench):
    x, _, _ = _probe(bench)
    return (*bench.both(x, lambda y: np.abs(y[-1, 0, :2]).sum(axis=(1, 2))), 0.0)


def _crosstalk(bench):
    rows, cols = bench.pad.rows, bench.pad.cols
    x = np.zeros((rows * cols, *bench.case.measured.shape[1:]))
    x[:, :, 2] = np.eye(rows * cols).reshape(-1, 1, rows, cols)

    def share(y):
        z = y[:, :, 2].reshape(rows, cols, bench.pad.pads, rows, cols)  # row and column of the load, and of the reading
        i, j = np.arange(rows), np.arange(cols)
        own = z[i[:, None], j, :, i[:, None], j]
        to_rows = [z[a, :, :, a + d][j, :, j] / own[a] for d in (-1, 1) for a in i if 0 <= a + d < rows]
        to_cols = [z[:, b, :, :, b + d][i, :, i] / own[:, b] for d in (-1, 1) for b in j if 0 <= b + d < cols]
        return np.concatenate([np.ravel(shares) for shares in (*to_rows, *to_cols)]).mean()

    return (*bench.both(x, share), 0.0)


def _matrix(bench):
    def columns(of):
        return np.stack([of(bench.still(np.eye(3)[k][:, None, None]))[-1].mean(axis=(0, 2, 3)) for k in range(3)])

    return columns(bench.true), columns(bench.fitted), np.eye(3)


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
        return (y[1000 + level] - y[2000 - level]) / y[1500]

    return (*bench.both(bench.line(forces), width), 0.0)


def _lag(bench):
    t = np.arange(0, 4, DT)
    true = t - bench.true(bench.line(t))[:, 0, 2, 0, 0]
    slow = float(np.median(np.diff(bench.case.time)))  # a fitted delay works on frames of the recording's rate
    own = np.arange(0, 4, slow)
    fitted = own - bench.fitted(bench.line(own), time=bench.start + own)[:, 0, 2, 0, 0]
    return true[t > 3].mean(), fitted[own > 3].mean(), 0.0


def _dead_band(bench):
    forces = np.arange(0.001, 1.5, 0.001)

    def edge(y):
        return forces[np.argmax(y[:, 0, 2, 0, 0] > 0.5 * forces)]

    return (*bench.both(bench.line(forces), edge), 0.0)


def _quantisation(bench):
    read = bench.fitted(bench.line(np.arange(0, 5, 0.001)))[:, 0, 2, 0, 0]
    levels = np.unique(np.round(read, 6))
    return bench.case.truth["quantisation"]["step"], np.median(np.diff(levels)), 0.0


def _interference(bench):
    opening = bench.case.covariates["gripper_opening"]
    gaps = np.linspace(opening.min(), opening.max(), 9)
    x = np.zeros((9, *bench.case.measured.shape[1:]))
    true = bench.true(x, gaps)
    seen = np.ones(true.shape, bool)
    seen[:, :, 2] = true[:, :, 2] > 0  # a normal reading is never below 0, whatever the field

    def change(y):
        mean = (y * seen).sum(axis=0) / seen.sum(axis=0).clip(1)
        return ((y - mean) * seen).mean(axis=(3, 4))

    return change(true), change(bench.fitted(x, gaps)), 0.0


def _layout(bench):
    frame = np.random.default_rng(0).uniform(1, 2, bench.case.measured.shape[1:])
    return (*bench.both(bench.still(frame), lambda y: y[-1]), frame)


EXPERIMENTS = {
    # gain of each axis
    "axis_gain": lambda bench: (*bench.both(bench.still(1.0), lambda y: y[-1].mean(axis=(0, 2, 3))), np.ones(3)),
    "taxel_gain": _taxel_gain,  # gain of each taxel, weighted by its load
    "offset": lambda bench: (*bench.both(bench.still(0.0), lambda y: y[-1]), 0.0),  # reading without force
    "drift": _drift,  # change of that reading from the start of the recording to the start of each episode
    "stiffening": _stiffening,  # gain at 10, 25, 75 and 100 % of the peak, relative to that at 50 %
    "poisson": _poisson,  # total absolute shear, along x and along y, caused by a load on a middle taxel
    "crosstalk": _crosstalk,  # share of a taxel's load that each of its four neighbours reads, mean over the taxels
    "axis_coupling": _matrix,  # matrix from the force to the reading
    "rotation": _matrix,
    "layout": _layout,  # where each force is read
    "creep": _creep,  # increase of the reading 1 s and 10 s after a step, relative to the immediate reading
    "hysteresis": _hysteresis,  # width of the loop at 25, 50 and 75 % of the peak over the reading at the peak
    "low_pass": _lag,  # lag behind a ramp, mean over its last second
    "latency": _lag,
    "saturation": lambda bench: (  # reading at three times the peak, relative to that at a fifth of the peak
        *bench.both(bench.line(bench.pad.peak * np.array([0.2, 3.0])), lambda y: y[1, 0, 2] / y[0, 0, 2]),
        0.0,
    ),
    "dead_band": _dead_band,  # smallest force of which more than half is read
    "quantisation": _quantisation,  # step
    "dead_taxels": lambda bench: (  # taxels that do not respond
        *((of(bench.still(5.0)) - of(bench.still(0.0)))[-1, :, 2] < 2.5 for of in (bench.true, bench.fitted)),
        0.0,
    ),
    "interference": _interference,  # change of the field over the openings, mean of each pad
}
