"""True values of fitted parameters, computed from hidden effects."""

import numpy as np

from hidden.experiments import read


def _pressed_gains(case, fitted):
    """Return the gains of the pressed taxels, including the scatter that calibration has not removed."""
    load = np.sum(case.simulated[:, :, 2].astype(float) ** 2, axis=0)
    scatter = case.sensor.nuisance.scatter[:, 2].reshape(load.shape)
    gain = case.truth["taxel_gain"]["gain"][:, -1].reshape(load.shape) * scatter
    pressed = (load > 0.05 * load.max()).ravel()
    return {name: g for (name, g), told in zip(_places("gain", gain).items(), pressed, strict=True) if told}


def _axes(prefix, values):
    return {f"{prefix}{axis}": float(value) for axis, value in zip("xyz", values, strict=True)}


def _places(prefix, values):
    return {prefix + "".join(f"_{i}" for i in place): float(values[place]) for place in np.ndindex(values.shape)}


def _without_force(case, name, start):
    """Return the reading (pads, 3, rows, cols) of the hidden effect without force at a given time."""
    return read(case, name, np.zeros((1, *case.measured.shape[1:])), 0.02, start)[0]


def _offsets(case, fitted):
    """Return the offsets, unless a field or a drift with its own constants is present."""
    if {"interference", "drift"} & set(case.causes):
        return {}
    return _places("value", _without_force(case, "offset", case.time[0]))


def _amplitudes(case, fitted):
    """Return the amplitudes with which a curve of the fitted time constant matches the hidden change."""
    if case.truth["drift"]["form"] != "curve_and_walk":
        return {}
    begin, end = case.time[[0, -1]]
    change = _without_force(case, "drift", end) - _without_force(case, "drift", begin)
    return _places("amplitude", change / -np.expm1(-(end - begin) / fitted["tau"][0]))


def _limit(case, fitted):
    """Return the limit, unless there is a gain beside it or no force reaches it."""
    truth = case.truth["saturation"]
    return {"limit": truth["limit"]} if truth["right_at"] == "small" and truth["form"] in ("knee", "clip") else {}


def _width(case, fitted):
    """Return the width, unless it is taken off larger forces too."""
    truth = case.truth["dead_band"]
    return {} if truth["form"] in ("shrink", "gradual") else {"width": truth["width"]}


TRUE_PARAMETERS = {
    "axis_gain": lambda case, fitted: _axes("gain_", case.truth["axis_gain"]["gain"]),
    "taxel_gain": _pressed_gains,
    "offset": _offsets,
    "drift": _amplitudes,
    "axis_coupling": lambda case, fitted: {
        f"{'xyz'[j]}_to_{'xyz'[i]}": case.truth["axis_coupling"]["matrix"][i, j]
        for i, j in ((0, 2), (1, 2), (2, 0), (2, 1))
    },
    # rotation of the sensor, not of the force
    "rotation": lambda case, fitted: _axes("about_", -case.truth["rotation"]["vector"]),
    "latency": lambda case, fitted: {"delay": case.truth["latency"]["delay"]},
    "saturation": _limit,
    "dead_band": _width,
}
"""Functions by cause that return the true values of fitted parameters that the hidden effect has too, from the case and
the fitted values; the result is empty for forms without such parameters."""
