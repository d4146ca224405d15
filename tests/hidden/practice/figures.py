"""Figures of hidden effects which fitted parameters should have too."""

import numpy as np

from hidden.practice.experiments import read


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
    return read(case, name, np.zeros((1, *case.measured.shape[1:])), 0.02, start)[0]


def _offsets(case, fitted):
    """None beside a field or a drift, which have constants of their own."""
    if {"interference", "drift"} & set(case.causes):
        return {}
    return _places("value", _without_force(case, "offset", case.time[0]))


def _amplitudes(case, fitted):
    """With which a curve of the fitted time constant changes over the recording as the hidden one does."""
    if case.truth["drift"]["form"] != "curve_and_walk":
        return {}
    begin, end = case.time[[0, -1]]
    change = _without_force(case, "drift", end) - _without_force(case, "drift", begin)
    return _places("amplitude", change / -np.expm1(-(end - begin) / fitted["tau"][0]))


def _limit(case, fitted):
    """None with a gain beside it, or without a force at which it is reached."""
    truth = case.truth["saturation"]
    return {"limit": truth["limit"]} if truth["right_at"] == "small" and truth["form"] != "slow" else {}


def _width(case, fitted):
    """None if all of the force shrinks."""
    truth = case.truth["dead_band"]
    return {} if truth["form"] == "shrink" else {"width": truth["width"]}


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
    "saturation": _limit,
    "dead_band": _width,
}
"""By cause, the true figures of those fitted parameters that are one figure of the hidden effect too, of the case and
the fitted ones; empty for forms that have no such figure."""
