"""Curves: gains, nonlinearities and rounding, which act on each reading separately and without delay."""

from __future__ import annotations

import numpy as np

from injected.effect import Effect, Floats, Scene, between, either, signed


def axis_gain(rng: np.random.Generator, scene: Scene) -> Effect:
    """Axis gain: one, two or all axes read too high or too low."""
    gain = np.ones(3)
    axes = rng.choice(3, int(rng.integers(1, 4)), replace=False)
    gain[axes] += signed(rng, 0.08, 0.35, len(axes))
    return Effect(f"axes times {np.round(gain, 3).tolist()}", lambda force: force * gain[:, None])


def taxel_gain(rng: np.random.Generator, scene: Scene) -> Effect:
    """Taxel gain: all or two taxels read too high or too low, equally on all axes."""
    form = either(rng, "all", "two")
    gain = np.ones(5)
    taxels = np.arange(5) if form == "all" else rng.choice(5, 2, replace=False)
    gain[taxels] += signed(rng, 0.08, 0.3, len(taxels))
    return Effect(f"taxels times {np.round(gain, 3).tolist()}", lambda force: force * gain)


def stiffening(rng: np.random.Generator, scene: Scene) -> Effect:
    """Stiffening: the gain depends on the force, in the same way for all taxels."""
    form, right = either(rng, "power", "quadratic", "sinh"), either(rng, "at the peak", "at half", "at zero")
    joint = either(rng, "of the taxel's force", "of each axis")
    size = float(signed(rng, 0.15, 0.35, 1)[0])
    at = {"at the peak": 1.0, "at half": 0.5, "at zero": 0.02}[right]

    def gain(share: Floats) -> Floats:
        if form == "power":
            return np.maximum(share, 1e-3) ** size
        if form == "quadratic":
            return 1 + size * share**2
        stretched = 2.5 * np.sqrt(abs(size)) * np.maximum(share, 1e-6)
        curve = np.sinh(stretched) / stretched
        return curve if size > 0 else 1 / curve

    def apply(force: Floats) -> Floats:
        load = np.abs(force) if joint == "of each axis" else np.linalg.norm(force, axis=1, keepdims=True)
        return force * gain(load / scene.peak) / gain(np.array(at))

    return Effect(f"{form} {size:.2f} {joint}, reads correctly {right}", apply)


def saturation(rng: np.random.Generator, scene: Scene) -> Effect:
    """Saturation: large forces are read too low."""
    form, limits = either(rng, "hard", "knee", "tanh"), either(rng, "in newtons", "of each axis")
    share, right = rng.uniform(0.5, 0.8), either(rng, "at small forces", "at the peak")
    limit = share * (np.full((3, 1), scene.peak) if limits == "in newtons" else scene.axis_peaks)

    def cut(force: Floats) -> Floats:
        if form == "hard":
            return np.clip(force, -limit, limit)
        if form == "tanh":
            return 1.2 * limit * np.tanh(force / (1.2 * limit))
        return force / (1 + np.abs(force / limit) ** 4) ** 0.25

    # a sensor calibrated at the peak force reads the peak correctly on each axis
    gain = scene.axis_peaks / cut(scene.axis_peaks[None])[0] if right == "at the peak" else np.ones((3, 1))
    return Effect(
        f"{form} at {share:.2f} of the peak {limits}, reads correctly {right}", lambda force: gain * cut(force)
    )


def dead_band(rng: np.random.Generator, scene: Scene) -> Effect:
    """Dead band: small forces are not read."""
    form, width = either(rng, "shrinks", "jumps", "sets in"), between(rng, 0.25, 0.8)

    def apply(force: Floats) -> Floats:
        size = np.abs(force)
        if form == "shrinks":
            return np.sign(force) * np.maximum(size - width, 0)
        if form == "jumps":
            return np.where(size > width, force, 0.0)
        return force * size**3 / (size**3 + width**3)

    return Effect(f"{form} at {width:.2f} N", apply)


def quantisation(rng: np.random.Generator, scene: Scene) -> Effect:
    """Quantisation: readings are multiples of a step."""
    form, step = either(rng, "rounds", "truncates"), between(rng, 0.2, 0.6)

    def apply(force: Floats) -> Floats:
        return step * (np.round(force / step) if form == "rounds" else np.trunc(force / step))

    return Effect(f"{form} to {step:.2f} N", apply)
