"""Memory: effects of the past, over time (creep, filters, delays) or over the loading path (hysteresis)."""

from __future__ import annotations

import numpy as np

from injected.effect import Effect, Floats, Scene, between, either

FINE = 8  # integration steps per frame


def creep(rng: np.random.Generator, scene: Scene) -> Effect:
    """Creep: the reading keeps changing under a held force."""
    form, right = (
        either(rng, "power of time", "logarithm of time", "stretched exponential"),
        either(rng, "at once", "held"),
    )
    size, tau = between(rng, 0.1, 0.3), between(rng, 0.5, 6.0)
    held = 20.0  # s after which a held reading counts as final
    since = np.maximum(scene.time[:, None] - scene.time[None, :], 0.0)

    def grown(seconds: Floats) -> Floats:
        if form == "power of time":
            return (1 + seconds / tau) ** 0.25 - 1
        if form == "logarithm of time":
            return np.log1p(seconds / tau)
        return -np.expm1(-((seconds / tau) ** 0.6))

    kernel = np.tril(size * grown(since) / grown(np.array(held)))

    def apply(force: Floats) -> Floats:
        changes = np.diff(force, axis=0, prepend=force[:1])
        crept = force + np.tensordot(kernel, changes, axes=(1, 0))
        return crept / (1 + size) if right == "held" else crept

    return Effect(f"{form}, {size:.2f} after {held:.0f} s, tau {tau:.1f} s, reads correctly {right}", apply)


def hysteresis(rng: np.random.Generator, scene: Scene) -> Effect:
    """Hysteresis: loading and unloading give different readings, at any speed."""
    form, right = either(rng, "slips", "Duhem", "Bouc-Wen"), either(rng, "in small swings", "at large forces")
    size, reach = between(rng, 0.08, 0.2), rng.uniform(0.1, 0.4)
    scale = scene.peaks if either(rng, "own", "common") == "own" else np.full((3, 5), scene.peak)

    def lag(force: Floats) -> Floats:
        """``(T, 3, 5)`` newtons, lagging part of the reading, about -1 to 1 times `reach` times the scale."""
        if form == "slips":  # many elements, each held by friction until its own spring pulls harder
            limits = scale * (reach * np.linspace(0.1, 2.0, 12))[:, None, None]
            held, out = np.zeros_like(limits), np.zeros_like(force)
            for i in range(1, len(force)):
                held = np.clip(held + force[i] - force[i - 1], -limits, limits)
                out[i] = held.mean(axis=0)
            return out
        state, out = np.zeros(force.shape[1:]), np.zeros_like(force)
        for i in range(1, len(force)):
            step = (force[i] - force[i - 1]) / (reach * scale) / FINE
            for _ in range(FINE):
                if form == "Duhem":
                    state = state + step * (1 - np.sign(step) * state)
                else:
                    state = state + step - np.abs(step) * np.abs(state) * state
            out[i] = state
        return out * reach * scale

    def apply(force: Floats) -> Floats:
        # the lagging part follows small swings of the force, and stays behind in large ones
        loop = lag(force)
        return force - size * (force - loop) if right == "in small swings" else force + size * loop

    return Effect(f"{form}, {size:.2f} within {reach:.2f} of the peak, reads correctly {right}", apply)


def latency(rng: np.random.Generator, scene: Scene) -> Effect:
    """Latency: readings are delayed."""
    form, delay = either(rng, "straight between frames", "holds the last frame"), between(rng, 0.06, 0.25)

    def apply(force: Floats) -> Floats:
        then = scene.time - delay
        if form == "holds the last frame":
            return force[np.maximum(np.searchsorted(scene.time, then, side="right") - 1, 0)]
        flat = force.reshape(len(force), -1)
        return np.stack([np.interp(then, scene.time, c) for c in flat.T], axis=1).reshape(force.shape)

    return Effect(f"{delay:.3f} s, {form}", apply)


def low_pass(rng: np.random.Generator, scene: Scene) -> Effect:
    """Low-pass: fast changes are smoothed."""
    form, tau = either(rng, "moving mean", "four poles", "one pole"), between(rng, 0.1, 0.4)
    fine = np.arange(scene.time[0], scene.time[-1] + 0.005, 0.005)

    def smooth(values: Floats) -> Floats:
        if form == "moving mean":
            count = max(2, round(2 * tau / 0.005))
            sums = np.cumsum(np.concatenate([np.full(count, values[0]), values]))
            return (sums[count:] - sums[:-count]) / count
        poles = 4 if form == "four poles" else 1
        for _ in range(poles):
            share, out = -np.expm1(-0.005 / (tau / poles)), np.empty_like(values)
            state = values[0]
            for i, value in enumerate(values):
                state += share * (value - state)
                out[i] = state
            values = out
        return values

    def apply(force: Floats) -> Floats:
        flat = force.reshape(len(force), -1)
        columns = [np.interp(scene.time, fine, smooth(np.interp(fine, scene.time, c))) for c in flat.T]
        return np.stack(columns, axis=1).reshape(force.shape)

    return Effect(f"{form}, {tau:.2f} s", apply)
