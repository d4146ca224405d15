"""Places: effects between axes and between taxels, failed or swapped taxels, and wrong zeros."""

from __future__ import annotations

import numpy as np

from injected.effect import Effect, Floats, Scene, between, either, signed

NAMES = "xyz"


def axis_coupling(rng: np.random.Generator, scene: Scene) -> Effect:
    """Axis coupling: a force on one axis is also read on another."""
    to, of = (int(k) for k in rng.choice(3, 2, replace=False))
    share = float(signed(rng, 0.08, 0.25, 1)[0])
    back = {to, of} == {0, 1}  # within the plane of the pad, one-way coupling would be half a rotation

    def apply(force: Floats) -> Floats:
        out = force.copy()
        out[:, to] += share * force[:, of]
        if back:
            out[:, of] += share * force[:, to]
        return out

    return Effect(f"{share:.2f} of {NAMES[of]} on {NAMES[to]}{' and back' if back else ''}", apply)


def rotation(rng: np.random.Generator, scene: Scene) -> Effect:
    """Rotation: the sensor is turned about its normal."""
    angle = float(signed(rng, 0.08, 0.3, 1)[0])
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return Effect(f"{angle:.2f} rad about z", lambda force: np.einsum("ij,tjc->tic", matrix, force))


def crosstalk(rng: np.random.Generator, scene: Scene) -> Effect:
    """Crosstalk: taxels read part of their neighbours' load."""
    form, loses = either(rng, "1/r^3", "next only", "exponential"), either(rng, "loses it", "keeps it")
    strength = between(rng, 0.05, 0.15) * (np.ones(3) if rng.random() < 0.5 else rng.uniform(0.5, 1.5, 3))
    apart = np.abs(np.arange(5)[:, None] - np.arange(5)[None, :]).astype(float)
    near = {"1/r^3": np.maximum(apart, 1) ** -3.0, "next only": 1.0 * (apart < 1.5), "exponential": np.exp(1 - apart)}
    kernel = np.where(apart == 0, 0.0, near[form])
    mixing = np.eye(5) + strength[:, None, None] * (
        kernel - (np.diag(kernel.sum(axis=0)) if loses == "loses it" else 0)
    )
    return Effect(
        f"{form}, {np.round(strength, 3).tolist()}, a taxel {loses}",
        lambda force: np.einsum("aij,taj->tai", mixing, force),
    )


def dead_taxel(rng: np.random.Generator, scene: Scene) -> Effect:
    """One or two taxels read a constant from the start."""
    return _dead(rng, scene, 0.0)


def dies_halfway(rng: np.random.Generator, scene: Scene) -> Effect:
    """One or two taxels get stuck at a constant during the recording."""
    return _dead(rng, scene, rng.uniform(0.35, 0.65))


def _dead(rng: np.random.Generator, scene: Scene, since: float) -> Effect:
    taxels = rng.choice(5, int(rng.integers(1, 3)), replace=False)
    form = either(rng, "0", "a level", "0 with noise")
    level = rng.uniform(-0.5, 2.0, (3, len(taxels))) if form == "a level" else np.zeros((3, len(taxels)))
    noise = rng.normal(size=(len(scene.time), 3, len(taxels))) * scene.noise[:, taxels] * (form == "0 with noise")
    start = int(since * len(scene.time))

    def apply(force: Floats) -> Floats:
        out = force.copy()
        out[start:, :, taxels] = (level + noise)[start:]
        return out

    when = f" from {since:.0%} on" if since else ""
    return Effect(f"taxels {taxels.tolist()} read {form}{when}", apply)


def swapped_taxels(rng: np.random.Generator, scene: Scene) -> Effect:
    """Two taxels are swapped."""
    order = np.arange(5)
    one, other = rng.choice(5, 2, replace=False)
    order[[one, other]] = order[[other, one]]
    return Effect(f"taxels {one} and {other}", lambda force: force[..., order])


def reversed_columns(rng: np.random.Generator, scene: Scene) -> Effect:
    """The taxels are read in reversed order."""
    return Effect("all columns", lambda force: force[..., ::-1].copy())


def axis_sign(rng: np.random.Generator, scene: Scene) -> Effect:
    """An axis is read with the opposite sign."""
    sign = np.ones(3)
    sign[int(rng.integers(3))] = -1
    return Effect(f"axes times {sign.tolist()}", lambda force: force * sign[:, None])


def offset(rng: np.random.Generator, scene: Scene) -> Effect:
    """Offset: readings at rest are not zero."""
    form, size = either(rng, "each channel", "one axis", "three channels"), between(rng, 0.15, 0.5)
    zero = size * rng.normal(size=(3, 5))
    if form == "one axis":
        zero[np.arange(3) != rng.integers(3)] = 0
    elif form == "three channels":
        zero = np.where(np.isin(np.arange(15), rng.choice(15, 3, replace=False)).reshape(3, 5), 2 * zero, 0)
    return Effect(f"{size:.2f} N, {form}", lambda force: force + zero)


def drift(rng: np.random.Generator, scene: Scene) -> Effect:
    """Drift: readings at rest change slowly."""
    form, size = either(rng, "straight", "root", "logarithm", "late rise"), between(rng, 0.3, 1.0)
    run = (scene.time - scene.time[0]) / (scene.time[-1] - scene.time[0])
    course = {
        "straight": run,
        "root": np.sqrt(run),
        "logarithm": np.log1p(20 * run) / np.log(21),
        "late rise": 1 / (1 + np.exp(-8 * (run - 0.5))) - 1 / (1 + np.exp(4)),
    }[form]
    amount = size * rng.normal(size=(3, 5))
    return Effect(f"{form}, {size:.2f} N in total", lambda force: force + course[:, None, None] * amount)


def interference(rng: np.random.Generator, scene: Scene) -> Effect:
    """Interference: a magnet that a joint carries past the taxels is read as a force."""
    form, size = either(rng, "dipole that passes by", "straight", "bent"), between(rng, 0.3, 1.2)
    amount = rng.normal(size=(3, 5))
    if form == "dipole that passes by":  # the magnet is nearest to each taxel at a different angle
        away = (scene.angle[:, None] - np.linspace(-0.6, 0.6, 5)) / 0.9
        field = amount * (1 + away**2)[:, None, :] ** -1.5
    elif form == "straight":
        field = amount * scene.angle[:, None, None]
    else:
        field = amount * np.sin(1.5 * scene.angle)[:, None, None]
    field *= size / np.sqrt(np.mean((field - field.mean(axis=0)) ** 2))
    if either(rng, "zeroed at the start", "not zeroed") == "zeroed at the start":
        field = field - field[0]
    return Effect(f"{form}, {size:.2f} N", lambda force: force + field)
