"""Varying readings without force: the magnetic field of the gripper, and drift."""

import numpy as np

from hidden.effects.common import COUNT, DT, between, forms, sign

TRAVEL = 0.04  # travel of the gripper, m


@forms("dipole", "two_dipoles", "quadratic", further=("passing",))
def interference(rng, pad, strength, form):
    """A field that depends on the opening, zeroed at one opening within the travel.

    `two_dipoles`: opposite dipoles at a larger distance, whose field varies strongly over the pad. `quadratic`: a
    polynomial in the opening for each pad and axis, with a gradient over the pad. `passing`: a magnet that passes
    behind the pad as the gripper opens.
    """
    size = between(0.2, 5.0, strength) * COUNT
    moment = rng.standard_normal(3)
    moment /= np.linalg.norm(moment)
    height = rng.uniform(0.02, 0.04)
    apart = rng.uniform(0.006, 0.012)
    powers = rng.standard_normal((2, pad.pads, 3, 1)) * np.array([1.0, 0.6])[:, None, None, None]
    slope = 0.4 * rng.standard_normal((2, pad.pads, 3, 2)) @ pad.unit.T
    at = rng.uniform(0.0, TRAVEL)

    def dipole(opening, further=0.0, aside=0.0):
        here = np.concatenate([pad.where, np.zeros((len(pad.where), 1))], axis=1)
        out = np.empty((len(opening), pad.pads, 3, len(here)))
        for p in range(pad.pads):
            side = 1.0 if p % 2 == 0 else -1.0  # every other pad faces the opposite direction
            across = 0.004 * side + aside + 0 * opening
            depth = height + further + opening
            if form == "passing":
                across, depth = across + side * (opening - TRAVEL / 2), height + 0 * opening
            away = np.stack([across, 0.003 + 0 * opening, -depth], axis=-1)
            r = here[None] - away[:, None]
            d = np.linalg.norm(r, axis=-1, keepdims=True)
            b = 3 * r * (r @ moment)[..., None] / d**5 - moment / d**3
            out[:, p] = np.moveaxis(b, -1, 1)
        return out

    def raw(opening):
        if form in ("dipole", "passing"):
            return dipole(opening)
        if form == "two_dipoles":
            return dipole(opening, 0.01, apart) - dipole(opening, 0.01, -apart)
        way = opening[:, None, None, None] / TRAVEL
        linear, square = powers * (1 + slope)
        return linear * way + square * way**2

    span, home = raw(np.linspace(0.0, TRAVEL, 9)), raw(np.array([at]))
    scale = size / np.abs(span - home).mean(axis=(1, 3)).max()
    return lambda f, e: f + scale * (raw(e.opening) - home), {"size": size, "zeroed_at": at}


@forms("curve_and_walk", "linear", "temperature", further=("logarithmic",))
def drift(rng, pad, strength, form):
    """Drift, zeroed at the start of the recording or minutes before.

    `temperature`: self-heating with quick and slow parts and an oscillating room temperature, which no covariate shows.
    """
    size = between(0.005, 0.10, strength) * pad.peak
    amount = size * sign(rng, pad.pads, 3, 1) * rng.uniform(0.5, 1.0, (pad.pads, 3, len(pad.where)))
    amount[:, 2] = np.abs(amount[:, 2])
    tau, quick, period = rng.uniform(150.0, 500.0), rng.uniform(40.0, 120.0), rng.uniform(250.0, 500.0)
    before = (0.0, rng.uniform(100.0, 300.0))[rng.integers(2)]
    seed = int(rng.integers(2**31))

    def course(t):
        if form == "linear":
            return t / 600
        if form == "logarithmic":
            return np.log1p(t / tau * 3)
        if form == "curve_and_walk":
            return -np.expm1(-t / tau)
        return -0.5 * np.expm1(-t / quick) - 0.5 * np.expm1(-t / 900) + 0.08 * (1 - np.cos(2 * np.pi * t / period))

    def apply(f, e):
        t = before + e.start + DT * np.arange(len(f))
        curve = course(t) / course(np.array(600.0))
        if form == "curve_and_walk":
            own = np.random.default_rng([seed, round(e.start)])
            curve = curve + own.standard_normal(len(f)).cumsum() * 0.02 * (DT / 9) ** 0.5
        return f + curve[:, None, None, None] * amount

    return apply, {"in_600_s": amount, "tau": tau, "zeroed_before": before}
