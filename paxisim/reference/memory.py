"""Memory: how a gel that relaxes and rubs within itself is deformed by a load that changes.

The gel is an elastic solid of its modulus at rest, beside which act Maxwell arms (springs that relax, together a
standard linear solid) and one spring behind a friction slider (a Jenkin element). All of them feel the same
deformation::

    load = e + sum_m share_m (e - q_m) + friction (e - p)      time_m dq_m/dt = e - q_m      |e - p| <= slip

Every part of the gel is of the same kind and Poisson's ratio does not change with time, so that by the correspondence
principle (R. M. Christensen, Theory of Viscoelasticity, 1982) a deformation is that of an elastic gel under another
load. `e` is that load: what a gel without memory would have to carry, to be deformed as this one is. It is a vector for
each taxel, and the slider follows it when the vector is too long, in whatever direction.
"""

from __future__ import annotations

import math
from typing import Any

from paxisim.augment.parameter_spec import lift, namespace
from paxisim.reference.parameters import GelMemory

State = tuple[Any, Any, Any]
"""Deformation e (N), what the arms remember of it ``(*batch, M, pads, 3, rows, cols)`` and the slider p."""


def at_rest(memory: GelMemory, area: float, load: Any) -> State:
    """The state of a gel that was new when the load came, and has carried it until all has relaxed.

    Args:
        memory: What the gel remembers.
        area: Of a taxel (m^2).
        load: ``(*batch, pads, 3, rows, cols)`` newtons; numpy or torch.
    """
    deformed, slider = _slide(memory, area, load, 1.0, load * 0)
    xp = namespace(load)
    arms = xp.broadcast_to(deformed[..., None, :, :, :, :], (*load.shape[:-4], len(memory.times), *load.shape[-4:]))
    return deformed, arms, slider


def step(memory: GelMemory, area: float, load: Any, state: State, dt: Any) -> tuple[Any, State]:
    """The deformation (N) by the load that is there a time `dt` (s) later, and the new state.

    The deformation is taken to run straight from frame to frame, for which the arms are exact at any `dt`.
    """
    xp = namespace(load)
    before, arms, slider = state
    dt = dt if isinstance(dt, (int, float)) else lift(dt, "", load)
    stiffness, carried, parts = 1.0, load, []
    for arm, (share, time) in enumerate(zip(memory.shares, memory.times, strict=True)):
        left, mean = _decay(dt / time)
        # q = part + (1 - mean) e, of which e is not known yet
        part = left * arms[..., arm, :, :, :, :] + (mean - left) * before
        stiffness, carried = stiffness + share * mean, carried + share * part
        parts.append((part, mean))
    deformed, slider = _slide(memory, area, carried, stiffness, slider)
    if parts:
        arms = xp.stack([part + (1 - mean) * deformed for part, mean in parts], axis=-5)
    return deformed, (deformed, arms, slider)


def _decay(run: Any) -> tuple[Any, Any]:
    """What is left of a deviation after `run` relaxation times, and its mean until then."""
    if isinstance(run, float):
        return math.exp(-run), -math.expm1(-run) / run if run else 1.0
    xp = namespace(run)
    one = xp.ones_like(run)
    return xp.exp(-run), xp.where(run > 0, -xp.expm1(-run) / xp.where(run > 0, run, one), one)


def _slide(memory: GelMemory, area: float, carried: Any, stiffness: Any, slider: Any) -> tuple[Any, Any]:
    """Solve ``carried = stiffness e + friction (e - p)`` for the deformation e and the slider p.

    Both e - p and the slider's motion point along ``carried - stiffness p``, so that lengths are left to solve for.
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
