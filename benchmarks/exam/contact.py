"""Contacts: the forces of a planned motion on the taxels, by formulas instead of a simulator.

Normal: the pressure under a ball (Hertz), a flat punch with soft edges, a bar, or three bumps, times the object's
force. Tangential: each taxel is an elastic bristle that sticks until Coulomb's limit and then slides, with friction
that falls with speed (Stribeck).
"""

from __future__ import annotations

import numpy as np

from .motion import FINE, Episode, Plan
from .presses import Array

INNER = 3  # points per taxel and axis at which the pressure is evaluated
STIFF = 1.2  # bristle stiffness (1/mm): shear per millimetre of travel, relative to the largest normal force
FADE = 5.0  # mm/s, speed at which friction has fallen from static to sliding


def press(plan: Plan, shift: Array) -> Array:
    """Return the forces (N) of the planned motion on all taxels.

    Args:
        plan: The motion.
        shift: ``(V, episodes, 2)`` displacements of the object (mm), for V variants of the motion.

    Returns:
        ``(V, T, pads, 3, rows, cols)`` forces at ``plan.time``, zero in the breaks. The largest normal force of the
        first variant is ``plan.peak``.
    """
    normal = [_normal(plan, e, shift[:, n]) for n, e in enumerate(plan.episodes)]
    largest = max(p[0].max() for p in normal)
    force = np.zeros((len(shift), len(plan.time), plan.pads, 3, plan.rows, plan.cols))
    steps = max(len(e.force) for e in plan.episodes)
    # all variants and episodes slide at once: (variants, episodes, S, pads, taxels)
    p = np.zeros((len(shift), len(normal), steps, plan.pads, plan.rows * plan.cols))
    for n, one in enumerate(normal):
        p[:, n, : one.shape[1]] = one / largest
    q = _shear(plan, p, _surface_travel(plan, steps))
    for n, e in enumerate(plan.episodes):
        first, length = round(e.start * FINE), len(e.force)
        shape = (len(shift), length, plan.pads, plan.rows, plan.cols)
        force[:, first : first + length, :, 2] = p[:, n, :length].reshape(shape)
        for axis in range(2):
            force[:, first : first + length, :, axis] = q[:, n, :length, ..., axis].reshape(shape)
    return plan.peak * force


def _taxels(plan: Plan) -> Array:
    """Return ``(taxels, 2)`` centres of the taxels (mm)."""
    y, x = np.meshgrid(np.arange(plan.rows), np.arange(plan.cols), indexing="ij")
    centres = np.stack([x - (plan.cols - 1) / 2, y - (plan.rows - 1) / 2], axis=-1)
    return plan.pitch * centres.reshape(-1, 2)


def _places(plan: Plan, episode: Episode) -> Array:
    """Return ``(pads, S, 2)`` places of the contact (mm): the second pad sees the other side of the object."""
    other = episode.place * (-1, 1) + 0.25 * plan.pitch
    return np.stack([episode.place, other][: plan.pads])


def _normal(plan: Plan, episode: Episode, shift: Array) -> Array:
    """Return ``(V, S, pads, taxels)`` normal forces, in arbitrary units."""
    inner = (np.arange(INNER) + 0.5) / INNER - 0.5
    fine = _taxels(plan)[:, None] + plan.pitch * np.stack(np.meshgrid(inner, inner), axis=-1).reshape(-1, 2)
    place = _places(plan, episode) + shift[:, None, None]  # (V, pads, S, 2)
    gap = (fine[None, None, None] - place[:, :, :, None, None]) / plan.pitch  # (V, pads, S, taxels, inner, 2)
    angle = episode.angle + episode.spin
    cos, sin = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    u, v = cos * gap[..., 0] + sin * gap[..., 1], cos * gap[..., 1] - sin * gap[..., 0]
    size, load = episode.size, np.clip(episode.force, 0, None)[:, None, None]
    if episode.shape == "ball":  # Hertz: the radius grows with the cube root of the force; the gel blurs the smallest
        square = 0.36 + size**2 * load ** (2 / 3)
        pressure = 1.5 * np.sqrt(np.clip(1 - (u**2 + v**2) / square, 0, None)) / square
    elif episode.shape == "flat":
        pressure = 0.25 / size**2 / ((1 + np.exp((np.abs(u) - size) / 0.15)) * (1 + np.exp((np.abs(v) - size) / 0.15)))
    elif episode.shape == "bar":
        pressure = np.exp(-((u / 0.6) ** 2) - (v / (2 * size)) ** 4)
    else:
        turn = np.arange(3) * 2 * np.pi / 3
        centres = size * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        heights = zip(centres, (1.0, 0.7, 0.5), strict=True)
        pressure = np.sum([w * np.exp(-((u - x) ** 2 + (v - y) ** 2) / 0.5) for (x, y), w in heights], axis=0)
    force = (load * pressure).mean(axis=-1)
    return np.moveaxis(force, 1, 2)


def _surface_travel(plan: Plan, steps: int) -> Array:
    """Return ``(episodes, S, pads, taxels, 2)`` travel of the object's surface over each taxel in one step (mm)."""
    taxels, out = _taxels(plan), np.zeros((len(plan.episodes), steps, plan.pads, plan.rows * plan.cols, 2))
    for n, e in enumerate(plan.episodes):
        mirrored = np.stack([e.travel, e.travel * (-1, 1)][: plan.pads], axis=1)
        step = np.diff(mirrored, axis=0, prepend=mirrored[:1])[:, :, None]
        arm = taxels - np.moveaxis(_places(plan, e), 0, 1)[:, :, None]  # (S, pads, taxels, 2)
        turn = np.diff(e.spin, prepend=e.spin[0])[:, None, None, None]
        out[n, : len(e.force)] = step + turn * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
    return out


def _shear(plan: Plan, p: Array, travel: Array) -> Array:
    """Return the shear of each taxel's bristle, ``(V, episodes, S, pads, taxels, 2)``, in units of the peak force.

    Args:
        plan: The motion.
        p: ``(V, episodes, S, pads, taxels)`` normal forces, in the same units.
        travel: ``(episodes, S, pads, taxels, 2)`` travel in each step (mm).
    """
    static, sliding = plan.friction
    speed = np.linalg.norm(travel, axis=-1) * FINE
    limit = p * (sliding + (static - sliding) * np.exp(-speed / FADE))
    out = np.zeros((*p.shape, 2))
    q = np.zeros((*p.shape[:2], *p.shape[3:], 2))
    for i in range(p.shape[2]):
        q += STIFF * travel[:, i] * (p[:, :, i] > 0)[..., None]
        most = limit[:, :, i]
        size = np.sqrt(np.einsum("...k,...k", q, q))
        q *= np.minimum(1, most / np.maximum(size, 1e-12))[..., None]
        out[:, :, i] = q
    return out
