"""Memory: deformation of a gel with relaxation and internal friction under a changing load.

The gel is an elastic solid with its modulus at rest, in parallel with Maxwell arms (relaxing springs; with the solid, a
standard linear solid) and with one spring behind a friction slider (a Jenkin element). All have the same deformation::

    load = e + sum_m share_m (e - q_m) + friction (e - p)      time_m dq_m/dt = e - q_m      |e - p| <= slip

The gel is homogeneous and Poisson's ratio does not change with time. By the correspondence principle
(R. M. Christensen, Theory of Viscoelasticity, 1982), its deformation is therefore that of an elastic gel under another
load. `e` is this load: a gel without memory that carries it has the same deformation. It is a vector for each taxel.
The slider follows it when ``e - p`` becomes longer than the limit, in any direction.
"""

from __future__ import annotations

import math
from typing import Any

from paxisim.augment.parameter_spec import lift, namespace
from paxisim.reference.parameters import GelMemory

State = tuple[Any, Any, Any]
"""Deformation e (N), states q of the arms ``(*batch, M, pads, 3, rows, cols)`` and the slider p."""


def at_rest(memory: GelMemory, area: float, load: Any) -> State:
    """Return the state of a new gel that has carried a load until all arms have relaxed.

    Args:
        memory: Parameters of the gel's memory.
        area: Area of a taxel (m^2).
        load: ``(*batch, pads, 3, rows, cols)`` newtons; numpy or torch.
    """
    deformed, slider = _slide(memory, area, load, 1.0, load * 0)
    xp = namespace(load)
    arms = xp.broadcast_to(deformed[..., None, :, :, :, :], (*load.shape[:-4], len(memory.times), *load.shape[-4:]))
    return deformed, arms, slider


def step(memory: GelMemory, area: float, load: Any, state: State, dt: Any) -> tuple[Any, State]:
    """Return the deformation (N) under the load after a time `dt` (s), and the new state.

    The deformation is assumed to be linear in time between frames; for this, the arms are exact at any `dt`.
    """
    xp = namespace(load)
    before, arms, slider = state
    dt = dt if isinstance(dt, (int, float)) else lift(dt, "", load)
    stiffness, carried, parts = 1.0, load, []
    for arm, (share, time) in enumerate(zip(memory.shares, memory.times, strict=True)):
        left, mean = _decay(dt / time)
        # q = part + (1 - mean) e, with e still unknown
        part = left * arms[..., arm, :, :, :, :] + (mean - left) * before
        stiffness, carried = stiffness + share * mean, carried + share * part
        parts.append((part, mean))
    deformed, slider = _slide(memory, area, carried, stiffness, slider)
    if parts:
        arms = xp.stack([part + (1 - mean) * deformed for part, mean in parts], axis=-5)
    return deformed, (deformed, arms, slider)


def _decay(run: Any) -> tuple[Any, Any]:
    """Return the share of a deviation that is left after `run` relaxation times, and its mean over that time."""
    if isinstance(run, float):
        return math.exp(-run), -math.expm1(-run) / run if run else 1.0
    xp = namespace(run)
    one = xp.ones_like(run)
    return xp.exp(-run), xp.where(run > 0, -xp.expm1(-run) / xp.where(run > 0, run, one), one)


def _slide(memory: GelMemory, area: float, carried: Any, stiffness: Any, slider: Any) -> tuple[Any, Any]:
    """Solve ``carried = stiffness e + friction (e - p)`` for the deformation e and the slider p.

    Both e - p and the motion of the slider point along ``carried - stiffness p``, so only lengths are unknown.
    """
    xp, limit = namespace(carried), memory.slip * area
    pull = carried - stiffness * slider
    square = xp.sum(pull * pull, axis=-3, keepdims=True)
    some = square > 0
    length = xp.where(some, square, xp.ones_like(square)) ** 0.5
    direction = xp.where(some, pull / length, xp.zeros_like(pull))
    stuck = length / (stiffness + memory.friction)
    apart = xp.where(stuck > limit, (length - memory.friction * limit) / stiffness, stuck)
    deformed = slider + apart * direction
    return deformed, deformed - xp.where(stuck > limit, xp.full_like(apart, limit), apart) * direction
