"""Grip: how one hand of a robot closes its pads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Grip:
    """One hand of a robot, with the pads on it and the motion that closes them.

    Attributes:
        pads: Indices of its pads on the ``pads`` axis.
        partners: For each of these pads, the pads that it closes against; empty if it closes on the palm.
        actuators: Ids of the actuators that close the hand.
        open_ctrl: ``(nu,)`` controls that open it, with the rest of the robot at rest.
        close_ctrl: ``(nu,)`` controls that close it.
        qpos: ``(frames, nq)`` poses of the robot from open to closed.
    """

    pads: tuple[int, ...]
    partners: tuple[tuple[int, ...], ...]
    actuators: tuple[int, ...]
    open_ctrl: NDArray[np.float64]
    close_ctrl: NDArray[np.float64]
    qpos: NDArray[np.float64]

    def reordered(self, order: Sequence[int]) -> Grip:
        """Return the grip after the pads were put in another order; ``order[i]`` is the old index of pad i."""
        new = {old: i for i, old in enumerate(order)}
        partners = tuple(tuple(new[p] for p in some) for some in self.partners)
        return replace(self, pads=tuple(new[p] for p in self.pads), partners=partners)
