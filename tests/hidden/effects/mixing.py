"""Effects that mix taxels or axes: Poisson shear, crosstalk, axis coupling, rotation and the layout."""

import numpy as np
from scipy.spatial.transform import Rotation

from hidden.effects.common import between, forms, sign


@forms("push", "gradient", "bell", further=("half_space",))
def poisson(rng, pad, strength, form):
    """Poisson shear: a `push` away from the load, the `gradient` of the normal force, or the slope of a `bell`."""
    amount = between(0.02, 0.15, strength) * rng.uniform(0.8, 1.2, 2)
    r, d = pad.distance, pad.away
    if form == "push":
        push = d * (np.where(r > 0.5, np.exp(-(r**1.5) / 1.2), 0) / r.clip(0.5))[..., None]
    elif form == "bell":
        push = d * np.exp(-((r / rng.uniform(0.7, 1.3)) ** 2) / 2)[..., None]
    elif form == "half_space":
        push = d * ((r**2 + rng.uniform(0.8, 1.6) ** 2) ** -1.5)[..., None]
    else:
        unit = np.eye(len(pad.where)).reshape(-1, pad.rows, pad.cols)
        slopes = [np.gradient(unit, axis=axis) if unit.shape[axis] > 1 else 0 * unit for axis in (2, 1)]
        push = -np.stack([slope.reshape(len(unit), -1).T for slope in slopes], axis=-1)
    push /= np.abs(push).sum(axis=(1, 2)).max() / 2

    def apply(f, e):
        shear = np.einsum("tpj,ijk->tpki", f[:, :, 2], push) * amount[:, None]
        return np.concatenate([f[:, :, :2] + shear, f[:, :, 2:]], axis=2)

    return apply, {"amount": amount}


@forms("exponential", "inverse_square", "mixed_signs", further=("dipoles", "neighbours"))
def crosstalk(rng, pad, strength, form):
    """Crosstalk, with or without a loss of the loaded taxel equal to what its neighbours receive.

    `mixed_signs`: a separate size for each axis and pair of taxels, one in four with the opposite sign.
    `dipoles`: fields of magnets, which change their sign beside the axis. `neighbours`: nothing reaches further.
    """
    amount = between(0.01, 0.12, strength)
    r = pad.distance
    fall = np.exp(-r) if form == "exponential" else 1 / (1 + 2 * r**2) ** (1 if form == "inverse_square" else 1.5)
    kernel = np.broadcast_to(np.where(r > 0.5, fall, 0.0), (3, *r.shape))
    if form == "mixed_signs":
        size = np.exp(0.6 * rng.standard_normal(kernel.shape))
        kernel = kernel * size * np.where(rng.random(kernel.shape) < 0.25, -1.0, 1.0)
    elif form == "dipoles":
        far = r + np.eye(len(r))
        along = (3 * (pad.away / np.linalg.norm(pad.away, axis=-1).clip(1e-9)[..., None]) ** 2 - 1) / 2
        kernel = np.stack([along[..., 0], along[..., 1], np.ones_like(r)]) / far**3 * (r > 0.5)
    elif form == "neighbours":
        kernel = ((r > 0.5) & (r < 1.6)) * rng.uniform(0.4, 1.3, kernel.shape) * sign(rng, 3, 1, 1)
    kernel = kernel * (2 * amount / np.abs(kernel).sum(axis=-1).max())
    loses = bool(rng.integers(2))
    given = kernel.sum(axis=1)[:, :, None] * np.eye(len(r)) if loses else 0.0
    mix = np.eye(len(r)) + kernel - given
    return lambda f, e: np.einsum("kij,tpkj->tpki", mix, f), {"amount": amount, "kernel": kernel, "loses": loses}


@forms("both_ways", "normal_to_shear", "with_shear", further=("shear_to_normal", "x_with_y", "scattered"))
def axis_coupling(rng, pad, strength, form):
    """Axis coupling; `with_shear` also mixes x and y symmetrically, which no rotation does.

    `scattered`: its size differs from taxel to taxel by 15 %.
    """
    size = between(0.02, 0.20, strength)
    matrix = np.eye(3)
    matrix[:2, 2] = size * sign(rng, 2) * rng.uniform(0.5, 1.0, 2)
    if form != "normal_to_shear":
        matrix[2, :2] = 0.5 * size * sign(rng, 2) * rng.uniform(0.3, 1.0, 2)
    if form == "with_shear":
        matrix[0, 1] = matrix[1, 0] = 0.5 * size * sign(rng) * rng.uniform(0.5, 1.0)
    elif form == "shear_to_normal":
        matrix[:2, 2], matrix[2, :2] = 0.0, 2 * matrix[2, :2]
    elif form == "x_with_y":
        matrix = np.eye(3)
        matrix[0, 1] = matrix[1, 0] = size * sign(rng) * rng.uniform(0.5, 1.0)
    elif form == "scattered":
        scatter = 1 + 0.15 * rng.standard_normal((pad.pads, 3, 3, len(pad.where)))
        each = np.eye(3)[..., None] + (matrix - np.eye(3))[..., None] * scatter
        return lambda f, e: np.einsum("pkln,tpln->tpkn", each, f), {"matrix": matrix}
    return lambda f, e: np.einsum("kl,tpln->tpkn", matrix, f), {"matrix": matrix}


@forms("mixed", "about_normal", "tilted")
def rotation(rng, pad, strength, form):
    about_z = between(2.0, 20.0, strength) * sign(rng)
    if form == "tilted":
        tilt = between(0.5, 5.0, strength) * sign(rng, 2) * rng.uniform(0.7, 1.0, 2)
        about_z = 0.1 * about_z
    else:
        tilt = between(0.5, 3.0, strength) * sign(rng, 2) * (0.5 if form == "mixed" else 0.0)
    vector = np.deg2rad([*tilt, about_z])
    matrix = Rotation.from_rotvec(vector).as_matrix()
    return lambda f, e: np.einsum("kl,tpln->tpkn", matrix, f), {"vector": vector}


@forms("flip_rows", "flip_cols", "swap_pads", "axis_sign_x", "axis_sign_y", further=("transposed",))
def layout(rng, pad, strength, form):
    """A wrong order of taxels or pads, or a wrong sign; `transposed`: read column by column."""

    def apply(f, e):
        grid = f.reshape(*f.shape[:3], pad.rows, pad.cols)
        if form == "flip_rows":
            return grid[..., ::-1, :].reshape(f.shape)
        if form == "flip_cols":
            return grid[..., ::-1].reshape(f.shape)
        if form == "transposed":
            return grid.swapaxes(-1, -2).reshape(f.shape)
        if form == "swap_pads":
            return f[:, ::-1]
        axes = np.array([-1.0, 1.0, 1.0] if form == "axis_sign_x" else [1.0, -1.0, 1.0])
        return f * axes[:, None]

    return apply, {}
