"""Starts: how the episodes of many worlds begin, drawn on a device or from the seeds of single environments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from gymnasium.utils import seeding

import paxisim

from .chains import convert_chain, stack_chains
from .scene import Grasp
from .tasks import Parameters


@dataclass(frozen=True)
class Starts:
    """How an episode begins in each world; tensors are float32 on the device.

    Attributes:
        bottom: ``(worlds, 3)`` position of the peg's bottom (m), see `Scene.place`.
        offset: ``(worlds, 3)`` offset of the fingers (m), see `Grasp`.
        lean: ``(worlds,)`` rotation of the peg (rad), see `Grasp`.
        heights: ``(worlds, pads, rows, cols)`` heights of the taxels (m), an array.
        chain: The chain through which the readings pass, with parameters for each world.
    """

    bottom: torch.Tensor
    offset: torch.Tensor
    lean: torch.Tensor
    heights: Any
    chain: paxisim.Chain

    @classmethod
    def draw(
        cls, rng: torch.Generator, worlds: int, parameters: Parameters, gcs: paxisim.GCS, pads: paxisim.Pads
    ) -> Starts:
        """Draw all worlds at once, on the generator's device."""

        def uniform(*shape: int) -> torch.Tensor:
            return torch.rand(worlds, *shape, generator=rng, device=rng.device)

        low, high = (torch.tensor(corner, device=rng.device) for corner in parameters.start)
        bottom = low + (high - low) * uniform(3)
        offset = (2 * uniform(3) - 1) * torch.tensor(parameters.grasp_offset, device=rng.device)
        lean = (2 * uniform() - 1) * parameters.grasp_lean
        heights = gcs.sample_surface(rng, (worlds,), layout=pads.layout, pads=len(pads))
        return cls(bottom, offset, lean, heights, gcs.sample(rng, (worlds,), layout=pads.layout, pads=len(pads)))

    @classmethod
    def of_seeds(
        cls,
        seeds: Sequence[int | None],
        parameters: Parameters,
        gcs: paxisim.GCS,
        pads: paxisim.Pads,
        device: torch.device,
    ) -> Starts:
        """Draw world by world on the host, each as `InsertionEnv.reset` does with this seed."""
        bottoms, grasps, heights, chains = [], [], [], []
        for seed in seeds:
            rng = seeding.np_random(seed)[0]
            bottoms.append(rng.uniform(*parameters.start))
            grasps.append(Grasp.draw(rng, parameters))
            heights.append(gcs.sample_surface(rng, layout=pads.layout, pads=len(pads)))
            chains.append(gcs.sample(rng, layout=pads.layout, pads=len(pads)))

        def put(values: Any) -> torch.Tensor:
            return torch.as_tensor(np.asarray(values), dtype=torch.float32, device=device)

        offset, lean = put([grasp.offset for grasp in grasps]), put([grasp.lean for grasp in grasps])
        return cls(put(bottoms), offset, lean, np.array(heights), convert_chain(stack_chains(chains), put))
