"""Effects between channels: the soft layer, coupled and rotated axes, and channels at the wrong place."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from .bench import Bench, Form, Run, between, either, mixed
from .presses import Array

# ---- the soft layer: matrices from the forces of all taxels to the channels of all taxels


def _apart(bench: Bench) -> tuple[Array, Array]:
    """Return ``(n, n, 2)`` vectors from each source (second index) to each reader (pitches), and their lengths."""
    way = bench.places[:, None] - bench.places[None]
    return way, np.linalg.norm(way, axis=-1)


def _matrix(blocks: Array) -> Array:
    """Return ``(3 n, 3 n)`` from ``(3, 3, n, n)`` blocks [read axis, loaded axis, reader, source]."""
    n = blocks.shape[-1]
    return np.moveaxis(blocks, 2, 1).reshape(3 * n, 3 * n)


def boussinesq(rng: Generator, bench: Bench, size: float) -> Run:
    """Shear away from a neighbour's normal force: displacement at depth h in an incompressible half-space (Boussinesq).

    The radial part is r h / (r^2 + h^2)^1.5, scaled to 2 to 15 % of the load at a distance of one pitch.
    """
    way, r = _apart(bench)
    depth = rng.uniform(0.4, 1.2)
    share = between(0.02, 0.15, size) * (1 + depth**2) ** 1.5 / depth
    blocks = np.zeros((3, 3, len(r), len(r)))
    blocks[:2, 2] = share * np.moveaxis(way, -1, 0) * depth / (r**2 + depth**2) ** 1.5
    matrix = np.eye(3 * len(r)) + _matrix(blocks)
    return lambda x: mixed(x, matrix)


def cubic(rng: Generator, bench: Bench, size: float) -> Run:
    """Crosstalk on each axis that falls with the third power of distance, as the far field of a magnet."""
    _, r = _apart(bench)
    kernel = between(0.01, 0.12, size) * np.where(r > 0, np.maximum(r, 0.5) ** -3.0, 0)
    blocks = np.zeros((3, 3, len(r), len(r)))
    for axis, weight in enumerate((rng.uniform(0.5, 1), rng.uniform(0.5, 1), 1.0)):
        blocks[axis, axis] = weight * kernel
    matrix = np.eye(3 * len(r)) + _matrix(blocks)
    return lambda x: mixed(x, matrix)


def unsigned(rng: Generator, bench: Bench, size: float) -> Run:
    """Crosstalk that falls exponentially, each weight random and of mixed sign (as fitted for a uSkin-like array).

    Shear to shear is twice as strong as normal to normal; shear to normal is in between.
    """
    _, r = _apart(bench)
    fall = np.where(r > 0, np.exp(-(r - 1) / rng.uniform(0.4, 0.9)), 0)
    strength = np.array([[1.0, 0.5, 0.6], [0.5, 1.0, 0.6], [0.8, 0.8, 0.5]])[:, :, None, None]
    lean = rng.normal(0, 0.6, (3, 3, 1, 1))  # the sign that prevails
    weights = lean + rng.normal(0, 0.6, (3, 3, *r.shape))
    matrix = np.eye(3 * len(r)) + between(0.01, 0.12, size) * _matrix(strength * weights * fall)
    return lambda x: mixed(x, matrix)


def dipoles(rng: Generator, bench: Bench, size: float) -> Run:
    """Each sensor also sees the neighbours' magnets: the tensor (3 n n^T - 1) / R^3 of a dipole at height h."""
    way, r = _apart(bench)
    full = np.concatenate([way, np.full((*r.shape, 1), rng.uniform(0.3, 0.7))], axis=-1)
    far = np.linalg.norm(full, axis=-1)
    n = full / far[..., None]
    tensor = (3 * n[..., :, None] * n[..., None, :] - np.eye(3)) / far[..., None, None] ** 3
    tensor *= (r > 0)[..., None, None]
    blocks = between(0.01, 0.1, size) * np.moveaxis(tensor, (0, 1), (2, 3)) * either(rng)
    matrix = np.eye(3 * len(r)) + _matrix(blocks)
    return lambda x: mixed(x, matrix)


def kelvin(rng: Generator, bench: Bench, size: float) -> Run:
    """Load spread by an incompressible solid (Kelvin): (1 + R R^T / R^2) / R, cut off by the layer's bottom."""
    way, r = _apart(bench)
    depth = rng.uniform(0.3, 0.8)
    full = np.concatenate([way, np.full((*r.shape, 1), depth)], axis=-1)
    far = np.linalg.norm(full, axis=-1)
    outer = full[..., :, None] * full[..., None, :] / far[..., None, None] ** 2
    tensor = (np.eye(3) + outer) / far[..., None, None] * np.exp(-r / rng.uniform(0.7, 1.5))[..., None, None]
    tensor *= (r > 0)[..., None, None]
    blocks = between(0.015, 0.15, size) * np.moveaxis(tensor, (0, 1), (2, 3))
    blocks[2, :2] *= 0.3  # a sheared layer hardly lifts
    matrix = np.eye(3 * len(r)) + _matrix(blocks)
    return lambda x: mixed(x, matrix)


# ---- axes


def dense(rng: Generator, bench: Bench, size: float) -> Run:
    """Every axis reads a little of the others; symmetric between x and y, so that it is no rotation."""
    off = rng.uniform(0.3, 1.0, (3, 3)) * rng.choice([-1, 1], (3, 3))
    off[1, 0], off[2, :2] = off[0, 1], 0.3 * off[2, :2]
    off[:2, 2] = rng.uniform(0.5, 1.0, 2) * rng.choice([-1, 1], 2)
    matrix = np.eye(3) + between(0.02, 0.2, size) * off * (1 - np.eye(3))
    return lambda x: np.einsum("ij,tpjrc->tpirc", matrix, x)


def tilting(rng: Generator, bench: Bench, size: float) -> Run:
    """Normal force reads as shear, more than in proportion, as a magnet that tilts on its way down."""
    share = between(0.02, 0.2, size) * rng.uniform(0.4, 1.0, 2) * rng.choice([-1, 1], 2)
    bend = rng.uniform(0.1, 0.6)

    def run(x: Array) -> Array:
        y, z = x.copy(), x[:, :, 2:]
        y[:, :, :2] += share[:, None, None] * z * (1 - bend + bend * np.abs(z) / bench.reach[2])
        return y

    return run


def scattered(rng: Generator, bench: Bench, size: float) -> Run:
    """Normal to shear coupling, the same on average and scattered by 30 % from taxel to taxel."""
    mean = between(0.02, 0.2, size) * rng.uniform(0.4, 1.0, 2) * rng.choice([-1, 1], 2)
    share = mean[:, None, None] * (1 + 0.3 * rng.normal(size=(bench.shape[0], 2, *bench.shape[1:])))

    def run(x: Array) -> Array:
        y = x.copy()
        y[:, :, :2] += share * x[:, :, 2:]
        return y

    return run


def _turned(x: Array, angles: Array) -> Array:
    """Return the forces rotated about z by ``(pads, rows, cols)`` angles (rad)."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([cos * x[:, :, 0] - sin * x[:, :, 1], sin * x[:, :, 0] + cos * x[:, :, 1], x[:, :, 2]], axis=2)


def rigid(rng: Generator, bench: Bench, size: float) -> Run:
    """The chips are turned about their normal by 2 to 20 degrees, and tilted by a few hundredths of that."""
    angle = np.radians(between(2, 20, size)) * either(rng)
    matrix = Rotation.from_rotvec(angle * np.array([*rng.uniform(-0.03, 0.03, 2), 1.0])).as_matrix()
    return lambda x: np.einsum("ij,tpjrc->tpirc", matrix, x)


def glued(rng: Generator, bench: Bench, size: float) -> Run:
    """Turned about the normal, by an angle that scatters by 15 % from taxel to taxel: chips soldered one by one."""
    angles = np.radians(between(2, 20, size)) * either(rng) * (1 + 0.15 * rng.normal(size=bench.shape))
    return lambda x: _turned(x, angles)


# ---- places


def mirrored(rng: Generator, bench: Bench, size: float) -> Run:
    """Rows or columns are read in reverse order; the axes stay."""
    axis = int(rng.choice([3, 4]))
    return lambda x: np.flip(x, axis=axis)


def half_turn(rng: Generator, bench: Bench, size: float) -> Run:
    """The pad is mounted the other way round: places and shear axes both turn by 180 degrees."""
    sign = np.array([-1.0, -1.0, 1.0])[:, None, None]
    return lambda x: sign * np.flip(x, axis=(3, 4))


def _permuted(bench: Bench, cycles: list[Array]) -> Run:
    """Return an effect that moves each taxel's reading to the next taxel of its cycle of flat indices."""
    count = int(np.prod(bench.shape))
    order = np.arange(count)
    for cycle in cycles:
        order[cycle] = np.roll(cycle, 1)

    def run(x: Array) -> Array:
        flat = np.moveaxis(x, 2, -1).reshape(len(x), count, 3)[:, order]
        return np.moveaxis(flat.reshape(len(x), *bench.shape, 3), -1, 2)

    return run


def _some_loaded(rng: Generator, bench: Bench, count: int) -> Array:
    """Return flat indices of taxels of one pad that are loaded."""
    flat = np.asarray(np.ravel_multi_index(tuple(bench.loaded(0.25).T), bench.shape))
    pads = flat // (bench.shape[1] * bench.shape[2])
    full = [p for p in range(bench.shape[0]) if np.sum(pads == p) >= count]
    if full:
        flat = flat[np.equal(pads, rng.choice(full))]
    return rng.permutation(flat)[:count]


def pair(rng: Generator, bench: Bench, size: float) -> Run:
    """Two taxels are exchanged."""
    return _permuted(bench, [_some_loaded(rng, bench, 2)])


def cycle(rng: Generator, bench: Bench, size: float) -> Run:
    """Three taxels are exchanged in a circle."""
    return _permuted(bench, [_some_loaded(rng, bench, 3)])


FORMS = (
    Form("gel_operator", "boussinesq", boussinesq),
    Form("gel_operator", "cubic", cubic),
    Form("gel_operator", "unsigned", unsigned),
    Form("gel_operator", "dipoles", dipoles),
    Form("gel_operator", "kelvin", kelvin),
    Form("axis_coupling", "dense", dense),
    Form("axis_coupling", "tilting", tilting),
    Form("axis_coupling", "scattered", scattered),
    Form("rotation", "rigid", rigid),
    Form("rotation", "glued", glued),
    Form("layout", "mirrored", mirrored, sized=False),
    Form("layout", "half_turn", half_turn, sized=False),
    Form("swapped_taxels", "pair", pair, sized=False),
    Form("swapped_taxels", "cycle", cycle, sized=False),
)
