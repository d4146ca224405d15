"""Linear mixing: permuted taxels, rotated axes, and crosstalk between taxels."""

import numpy as np
from scipy.spatial.transform import Rotation

from hidden.exam.world import Effect, size


def layout(rng, world, strength):
    """A wrong order of taxels or pads, or a wrong sign of an axis; independent of the strength."""
    kinds = ["columns", "sign_x", "sign_y"]
    kinds += ["rows"] if world.rows > 1 else []
    kinds += ["transposed"] if world.rows == world.cols else []
    kinds += ["pads"] if world.pads == 2 else []
    kind = str(rng.choice(kinds))
    order = np.arange(world.rows * world.cols).reshape(world.rows, world.cols)
    order = {"rows": order[::-1], "columns": order[:, ::-1], "transposed": order.T}.get(kind, order).ravel()
    signs = np.ones((3, 1))
    if kind.startswith("sign"):
        signs["xy".index(kind[-1])] = -1
    turn = slice(None, None, -1) if kind == "pads" else slice(None)
    return Effect({"kind": kind}, lambda force: force[:, :, turn][..., order] * signs)


def poisson(rng, world, strength):
    """Shear away from a load; its maximum is 2 to 15 % of the largest force under a round contact."""
    share = size(strength, 0.02, 0.15)
    form = str(rng.choice(["gaussian", "half_space", "screened"]))
    apart = world.distance
    r = np.linalg.norm(apart, axis=-1)
    reach = rng.uniform(0.8, 1.6)
    law = {
        "gaussian": lambda d: np.exp(-(d**2) / (2 * reach**2)),
        "half_space": lambda d: (d**2 + reach**2) ** -1.5,
        "screened": lambda d: np.exp(-d / reach) / np.maximum(d, 0.5),
    }[form]
    spread = apart * law(r)[..., None]  # (to, from, axis)
    middle = np.linalg.norm(world.where - world.where[len(world.where) // 2], axis=1) / np.mean(world.pitch)
    round_contact = np.exp(-(middle**2) / 3)
    spread *= share / np.linalg.norm(np.einsum("tfa,f->ta", spread, round_contact), axis=1).max()

    def apply(force):
        out = force.copy()
        for axis in (0, 1):
            out[:, :, :, axis] += force[:, :, :, 2] @ spread[..., axis].T
        return out

    return Effect({"share": share, "form": form}, apply)


def crosstalk(rng, world, strength):
    """Crosstalk to other taxels, with either sign, 1 to 12 % at the nearest one."""
    share = size(strength, 0.01, 0.12)
    form = str(rng.choice(["dipoles", "measured", "neighbours"]))
    taxels = len(world.where)
    apart = world.distance
    r = np.linalg.norm(apart, axis=-1) + np.eye(taxels)
    loses = rng.random() < 0.5
    if form == "dipoles":  # a magnet's field falls with distance cubed and changes sign beside its axis
        along = (3 * (apart / r[..., None]) ** 2 - 1) / 2
        unit = np.stack([along[..., 0], along[..., 1], np.ones_like(r)]) / r**3
    elif form == "measured":
        sign = np.where(rng.random((3, taxels, taxels)) < 0.7, 1, -1)
        unit = sign * np.exp(0.6 * rng.normal(size=(3, taxels, taxels)) - 0.18) / r**2.5
    else:
        near = r < 1.6
        unit = near * rng.uniform(0.4, 1.3, (3, taxels, taxels)) * rng.choice([-1, 1], (3, 1, 1), p=[0.3, 0.7])
        unit[:2] *= rng.choice([0.0, 1.0])
    mix = share * unit * (1 - np.eye(taxels))
    total = np.abs(mix).sum(axis=1).max()
    mix *= min(1, 0.6 / total)
    if loses:  # the loaded taxel loses what others receive
        mix = mix - np.stack([np.diag(m.sum(axis=0)) for m in mix])
    into = np.swapaxes(mix, 1, 2)

    def apply(force):
        return force + np.stack([force[:, :, :, axis] @ into[axis] for axis in range(3)], axis=3)

    return Effect({"share": share, "form": form, "loses": loses}, apply)


def turned(force, matrix):
    """Multiply each taxel's force by `matrix` (3, 3) or (pads, 3, 3, taxels)."""
    columns = [force[:, :, :, axis, None] for axis in range(3)]
    if matrix.ndim == 2:
        return sum(matrix[:, axis, None] * columns[axis] for axis in range(3))
    return sum(matrix[:, :, axis] * columns[axis] for axis in range(3))


def axis_coupling(rng, world, strength):
    """Coupling between axes, 2 to 20 %."""
    share = size(strength, 0.02, 0.2)
    form = str(rng.choice(["normal_to_shear", "shear_to_normal", "x_with_y", "all"]))
    matrix = np.zeros((3, 3))
    angle = rng.uniform(0, 2 * np.pi, 2)
    if form in ("normal_to_shear", "all"):
        matrix[:2, 2] = np.cos(angle[0]), np.sin(angle[0])
    if form in ("shear_to_normal", "all"):
        matrix[2, :2] = np.cos(angle[1]), np.sin(angle[1])
    if form in ("x_with_y", "all"):
        matrix[0, 1] = matrix[1, 0] = rng.choice([-1, 1]) * rng.uniform(0.5, 1)
    spread = rng.choice([0.0, 0.15])
    leak = share * matrix[:, :, None] * (1 + spread * rng.normal(size=(world.pads, 3, 3, len(world.where))))
    truth = {"share": share, "form": form, "matrix": (share * matrix).tolist(), "spread": spread}
    return Effect(truth, lambda force: force + turned(force, leak))


def rotation(rng, world, strength):
    """A mounting error: rotation by 2 to 20 degrees about z and a tilt of up to 0.5 to 5 degrees."""
    degrees = size(strength, 2, 20) * rng.choice([-1, 1])
    tilt = size(strength, 0.5, 5) * rng.uniform(0.2, 1)
    angle = rng.uniform(0, 2 * np.pi)
    about = np.deg2rad([tilt * np.cos(angle), tilt * np.sin(angle), degrees])
    matrix = Rotation.from_rotvec(about).as_matrix()
    return Effect({"degrees": degrees, "tilt": tilt}, lambda force: turned(force, matrix))
