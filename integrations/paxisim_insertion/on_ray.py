"""OnRay: the runner that works on the cells of a matrix on the machines of a Ray cluster."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import paxisim

from .cells import Cell
from .work import Done, work


class OnRay:
    """The runner that works on cells on a Ray cluster, each on one core of any node.

    Runs and results lie in folders that all nodes share. A cell whose worker or node dies is started again on another
    one and resumes the training there from its newest checkpoint.
    """

    def __init__(self, address: str = "auto") -> None:
        """Connect to a running cluster, see `paxisim.RayCluster`."""
        self._cluster = paxisim.RayCluster(address)

    @property
    def at_once(self) -> int:
        """Number of cells at a time: the number of cores that the cluster has now."""
        return self._cluster.cores

    def run(self, cells: list[Cell], runs: Path, out: Path) -> Iterator[Done]:
        """Work on cells and yield each when it is done, see `Runner`. Then leave the cluster."""
        runs, out = runs.resolve(), out.resolve()
        out.mkdir(parents=True, exist_ok=True)
        for cell, done in self._cluster.run(partial(work, runs=runs, out=out), cells, [runs, out]):
            yield Done(cell, str(done), 0.0) if isinstance(done, paxisim.PaxisimError) else done
