"""Effects with memory: creep, hysteresis, low-pass and latency."""

import numpy as np
from scipy.signal import bessel, fftconvolve, lfilter, sosfilt

from hidden.effects.common import DT, between, forms


@forms(
    "two_modes", "one_mode", "many_modes", further=("power_law",),
    rare=("logarithmic", "stretched", "grows_with_load", "slow_recovery", "by_axis"),
)  # fmt: skip
def creep(rng, pad, strength, form):
    """Creep, calibrated at once (`held` 0), under held loads (`held` 1), or in between."""
    total = between(0.02, 0.25, strength)
    tau = float(np.exp(rng.uniform(np.log(0.25), np.log(8.0))))
    spread = {"two_modes": [1 / 1.8, 1.8], "one_mode": [1.0], "many_modes": np.geomspace(1 / 6, 6, 9)}
    spread = np.asarray(spread.get(form, np.geomspace(0.02, 20, 11)))
    parts = np.full(len(spread), len(spread))
    held = (0.0, 1.0, rng.uniform(0.2, 0.8))[rng.integers(3)]
    if form == "power_law":  # of a fractional model, whose relaxation is the Mittag-Leffler function
        order = rng.uniform(0.4, 0.85)
        s = spread**-order
        weights = s / (s**2 + 2 * s * np.cos(order * np.pi) + 1)
        parts = weights.sum() / weights

    if form == "stretched":  # relaxation exp(-(t / tau)^0.5), as a sum of exponentials
        parts = 1 / (rates := np.exp(-(np.log(spread) ** 2) / 4)) * rates.sum()
    axes = np.array([1.6, 1.6, 0.7]) if form == "by_axis" else np.ones(3)

    def relax(f):
        relaxed = np.zeros_like(f)
        for t, part in zip(tau * spread, parts, strict=True):
            a = np.exp(-DT / t)
            relaxed += lfilter([1 - a], [1, -a], f, axis=0) / part
        return relaxed

    def apply(f, e):
        drive = f * np.sqrt(np.abs(f) / (0.5 * pad.peak)) if form == "grows_with_load" else f
        if form == "logarithmic":  # the compliance grows with log(1 + t / tau) up to 30 s
            ages = DT * np.arange(len(f))
            rise = np.log1p(ages / (0.1 * tau)) / np.log1p(30 / (0.1 * tau))
            relaxed = fftconvolve(np.diff(f, axis=0, prepend=0 * f[:1]), rise.reshape(-1, *[1] * (f.ndim - 1)), axes=0)
            relaxed = relaxed[: len(f)]
        elif form == "slow_recovery":
            relaxed = _one_way(f, tau, 3 * tau)
        else:
            relaxed = relax(drive)
        return f + total * axes[:, None] * (relaxed - held * drive)

    return apply, {"amount": total, "tau": tau, "held": held}


def _one_way(f, rising, falling):
    """Return `f` smoothed with one time constant while its size grows and with another while it falls."""
    q, out = np.zeros(f.shape[1:]), np.empty_like(f)
    fast, slow = 1 - np.exp(-DT / rising), 1 - np.exp(-DT / falling)
    for i in range(len(f)):
        q = q + np.where(np.abs(f[i]) > np.abs(q), fast, slow) * (f[i] - q)
        out[i] = q
    return out


@forms(
    "bouc_wen", "play", "return_curves", further=("preisach",),
    rare=("dahl", "signed_relays", "of_amplitude", "friction", "whole_pad", "unloading_power"),
)  # fmt: skip
def hysteresis(rng, pad, strength, form):
    """A loop of given width, with a gain that calibrates small signals, the full load or the middle of the loop.

    `play`: operators with a range of thresholds. `return_curves`: after each reversal, exponential curves towards an
    envelope that widens with the load.
    """
    width = between(0.02, 0.15, strength)
    scale = rng.uniform(0.15, 0.35) * pad.peak
    beta, n = rng.uniform(0.4, 0.6), rng.uniform(1.0, 1.6)
    thresholds = np.linspace(0.05, 2.0, 12) * scale
    weights = np.exp(-thresholds / rng.uniform(0.5, 1.5) / scale)
    right_at = ("small", "full", "middle")[rng.integers(3)]
    operators = (
        _bouc_wen, _play, _return_curves, _preisach, _dahl, _signed_relays, _of_amplitude, _friction, _whole_pad,
        _unloading_power,
    )  # fmt: skip
    state = {operator.__name__[1:]: operator for operator in operators}[form]

    def loop(f):
        return state(f, scale, beta, n, thresholds, weights, pad.peak)

    way = np.linspace(0, 1, 501)
    triangle = pad.peak * np.r_[way, way[-2::-1], way[1:], way[-2::-1]]
    triangle = loop(np.tile(triangle[:, None, None, None], (1, 1, 3, 1)))[:, 0, 2, 0]
    size = width * pad.peak / (triangle[1250] - triangle[1750])
    lag = {"small": triangle[1] * 500, "full": triangle[1500], "middle": triangle[1250] + triangle[1750]}[right_at]
    gain = 1 + size * lag / pad.peak
    return lambda f, e: gain * f - size * loop(f), {"width": width, "right_at": right_at, "gain": gain}


def _bouc_wen(f, scale, beta, n, thresholds, weights, peak):
    """Return a state that follows the direction of motion and saturates near 1."""
    z, out = np.zeros(f.shape[1:]), np.empty_like(f)
    step = np.diff(f, axis=0, prepend=f[:1]) / scale
    for i in range(len(f)):
        z = z + step[i] - np.abs(z) ** n * (beta * np.abs(step[i]) * np.sign(z) + (1 - beta) * step[i])
        out[i] = z
    return out


def _play(f, scale, beta, n, thresholds, weights, peak):
    """Return the mean lag of play operators with different thresholds."""
    r = thresholds.reshape(-1, *(1,) * (f.ndim - 1))
    w = (weights / weights.sum()).reshape(r.shape)
    at, out = np.zeros((len(thresholds), *f.shape[1:])), np.empty_like(f)
    for i in range(len(f)):
        at = np.clip(at, f[i] - r, f[i] + r)
        out[i] = f[i] - (w * at).sum(axis=0)
    return out


def _return_curves(f, scale, beta, n, thresholds, weights, peak):
    """Return a state that depends only on the path since the last reversal, not on the speed."""
    z, out = np.zeros(f.shape[1:]), np.empty_like(f)
    step = np.diff(f, axis=0, prepend=f[:1])
    left = np.exp(-np.abs(step) / scale)
    envelope = np.sign(step) * (0.4 + 0.6 * np.sqrt(np.abs(f) / peak))
    for i in range(len(f)):
        z = envelope[i] + (z - envelope[i]) * left[i]
        out[i] = z
    return out


def _preisach(f, scale, beta, n, thresholds, weights, peak):
    """Return the lag of relays with ramps: on as the force rises past one level, off as it falls below a lower one."""
    levels = np.arange(4) / 4
    up, down = (grid[np.tril_indices(4)].reshape(-1, *(1,) * (f.ndim - 1)) for grid in np.meshgrid(
        levels, levels, indexing="ij"))  # fmt: skip
    density = np.exp(-(((up - down) / 0.5) ** 2))
    density /= density.sum()
    on, out = np.zeros((len(up), *f.shape[1:])), np.empty_like(f)
    size = np.abs(f) / peak
    for i in range(len(f)):
        on = np.minimum(np.maximum(on, np.clip((size[i] - up) * 4, 0, 1)), np.maximum((size[i] - down) * 4, 0))
        out[i] = (density * on).sum(axis=0)
    return f / peak - np.sign(f) * out


def _dahl(f, scale, beta, n, thresholds, weights, peak):
    """Return Dahl's friction state, whose stiffness falls with the square of the distance from its limit."""
    z, out = np.zeros(f.shape[1:]), np.empty_like(f)
    for i, step in enumerate(np.diff(f, axis=0, prepend=f[:1]) / scale):
        z = np.clip(z + step * (1 - np.sign(step) * z) ** 2, -1, 1)
        out[i] = z
    return out


def _signed_relays(f, scale, beta, n, thresholds, weights, peak):
    """Return how far a Preisach plane over both signs lags behind the same plane without loops."""
    centre, half = np.meshgrid(np.linspace(-0.9, 0.9, 9), np.linspace(0.04, 0.4, 5))
    density = np.exp(-((centre / 0.6) ** 2) - ((half - 0.15) / 0.15) ** 2)
    centre, half, density = (v.reshape(-1, *(1,) * (f.ndim - 1)) for v in (centre, half, density / density.sum()))
    at, out, x = np.zeros((centre.size, *f.shape[1:])), np.empty_like(f), f / peak
    for i in range(len(f)):
        at = np.clip(at, x[i] - half, x[i] + half)
        out[i] = (density * (np.clip(x[i] - centre, -0.2, 0.2) - np.clip(at - centre, -0.2, 0.2))).sum(axis=0)
    return out


def _of_amplitude(f, scale, beta, n, thresholds, weights, peak):
    """Return the lag of plays whose thresholds are spread over three decades, so that loops of all sizes are alike."""
    thresholds = np.geomspace(2e-3, 2, 16) * peak
    return _play(f, scale, beta, n, thresholds, np.ones(16), peak)


def _friction(f, scale, beta, n, thresholds, weights, peak):
    """Return the lag of a contact with dry friction: the threshold of each taxel is a share of its normal force."""
    at, out = np.zeros(f.shape[1:]), np.empty_like(f)
    for i in range(len(f)):
        limit = (0.03 + 0.3 * np.abs(f[i, :, 2:])) * scale / peak / 0.25
        at = np.clip(at, f[i] - limit, f[i] + limit)
        out[i] = f[i] - at
    return out


def _whole_pad(f, scale, beta, n, thresholds, weights, peak):
    """Return a state of the whole layer, which follows the sum of its loads, times each taxel's own load."""
    total = np.abs(f[:, :, 2]).sum(axis=-1)[:, :, None, None]
    top = max(float(total.max()), 1e-9)
    return f / peak * _bouc_wen(total / top, 0.25, beta, n, thresholds, weights, peak)


def _unloading_power(f, scale, beta, n, thresholds, weights, peak):
    """Return the lag of unloading along a power of the share of the largest load since the last contact."""
    top, out = np.zeros(f.shape[1:]), np.empty_like(f)
    for i in range(len(f)):
        size = np.abs(f[i])
        top = np.where(size < 1e-3 * peak, 0.0, np.maximum(top, size))
        share = size / np.maximum(top, 1e-9)
        out[i] = np.sign(f[i]) * top * (share**1.0 - share**0.6)
    return out


@forms("two_poles", "one_pole", "moving_average", further=("bessel", "hann"))
def low_pass(rng, pad, strength, form):
    """Low-pass with 3 dB attenuation at the cut-off."""
    cutoff = between(15.0, 1.0, strength)
    poles = 2 if form == "two_poles" else 1
    a = np.exp(-2 * np.pi * cutoff * (1.55 if poles == 2 else 1.0) * DT)
    length = max(2, round((0.72 if form == "hann" else 0.443) / cutoff / DT))
    kernel = np.hanning(length + 2)[1:-1] if form == "hann" else np.ones(length)
    sections = bessel(3, cutoff, fs=1 / DT, norm="mag", output="sos")

    def apply(f, e):
        if form == "bessel":
            return f[:1] + sosfilt(sections, f - f[:1], axis=0)
        if form == "hann":
            return f[:1] + lfilter(kernel / kernel.sum(), [1], f - f[:1], axis=0)
        if form == "moving_average":
            return f[:1] + lfilter(np.full(length, 1 / length), [1], f - f[:1], axis=0)
        out = f - f[:1]
        for _ in range(poles):
            out = lfilter([1 - a], [1, -a], out, axis=0)
        return f[:1] + out

    lag = (length - 1) / 2 if form in ("moving_average", "hann") else poles * a / (1 - a)
    if form == "bessel":  # the delay at low frequencies
        ramp = np.arange(2000.0)
        lag = ramp[-1] - sosfilt(sections, ramp)[-1]
    return apply, {"cutoff": cutoff, "lag": lag * DT}


@forms("pure", "frames", "uneven")
def latency(rng, pad, strength, form):
    """Latency; `frames`: frames of the sensor's own clock, each held until the next; `uneven`: a varying delay."""
    delay = between(0.005, 0.120, strength)
    clock, period, phase = rng.choice([91.0, 176.0]), rng.choice([0.25, 0.5, 1.0]), rng.uniform(0, 2 * np.pi)
    clock = max(clock, 0.5 / delay)  # the mean delay is at least half a frame

    def apply(f, e):
        t = DT * np.arange(len(f))
        if form == "frames":
            t = np.floor((t - delay + 0.5 / clock) * clock) / clock
        elif form == "uneven":
            t = t - delay * (1 + 0.15 * np.sin(2 * np.pi * t / period + phase))
        else:
            t = t - delay
        late = t / DT
        low = np.clip(np.floor(late).astype(int), 0, len(f) - 1)
        high = np.clip(low + 1, 0, len(f) - 1)
        way = np.clip(late - low, 0, 1)[:, None, None, None]
        return f[low] * (1 - way) + f[high] * way

    return apply, {"delay": delay}
