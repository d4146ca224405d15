"""OnRay: the runner that works on the cells of a matrix on the machines of a Ray cluster."""

from __future__ import annotations

import logging
import platform
import secrets
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import paxisim

from .cells import Cell
from .work import Done, work

RETRIES = 10
"""How often a cell whose worker or node died is started again before it counts as failed."""

_SECONDS = 10.0
"""Time for a cluster to accept a connection. Ray itself tries for two minutes and then ends the process."""

_START = "start one with: ray start --head"


class OnRay:
    """The runner that works on cells on a Ray cluster, each on one core of any node.

    Runs and results lie in folders that all nodes share. A cell whose worker or node dies is started again on another
    one and resumes the training there from its newest checkpoint.
    """

    def __init__(self, address: str = "auto") -> None:
        """Connect to a running cluster.

        Args:
            address: HOST:PORT of the cluster's head; ``"auto"`` for the one that this machine belongs to.

        Raises:
            MissingExtraError: Ray is not installed.
            InvalidValueError: The cluster cannot be reached, or runs other versions of Ray or Python.
        """
        try:
            import ray  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise paxisim.MissingExtraError("ray", "ray", "--ray") from error
        if address != "auto":
            _reach(address)
        try:
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
        except ConnectionError as error:
            raise paxisim.InvalidValueError(f"this machine belongs to no Ray cluster: {_START}") from error
        except (RuntimeError, ValueError) as error:
            raise paxisim.InvalidValueError(f"cannot use the Ray cluster at {address}: {error}") from error
        self._ray: Any = ray

    @property
    def at_once(self) -> int:
        """Number of cells at a time: that of the cores that the cluster has now."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def run(self, cells: list[Cell], runs: Path, out: Path) -> Iterator[Done]:
        """Work on cells and yield each when it is done, see `Runner`. Then leave the cluster."""
        runs, out = runs.resolve(), out.resolve()
        out.mkdir(parents=True, exist_ok=True)
        marks = [folder / f".matrix-{secrets.token_hex(8)}" for folder in (runs, out)]
        try:
            for mark in marks:
                mark.touch()
            task = self._ray.remote(num_cpus=1, max_retries=RETRIES)(_work_on_node)
            waiting = {task.remote(cell, runs, out, marks): cell for cell in cells}
            while waiting:
                (reference,), _ = self._ray.wait(list(waiting), num_returns=1)
                cell = waiting.pop(reference)
                try:
                    yield self._ray.get(reference)
                except self._ray.exceptions.RayError as error:
                    yield Done(cell, f"failed on Ray: {_last_line(error)}", 0.0)
        finally:
            for mark in marks:
                mark.unlink(missing_ok=True)
            self._ray.shutdown()


def _work_on_node(cell: Cell, runs: Path, out: Path, marks: list[Path]) -> Done:
    unseen = [mark.parent for mark in marks if not mark.exists()]
    if unseen:
        advice = "put --runs and --out on a file system that all nodes share"
        return Done(cell, f"the node {platform.node()} does not see {unseen[0]}: {advice}", 0.0)
    return work(cell, runs, out)


def _reach(address: str) -> None:
    host, _, port = address.rpartition(":")
    if not host or not port.isascii() or not port.isdecimal() or not 0 < int(port) < 65536:
        raise paxisim.InvalidValueError(f"expected HOST:PORT as the address of a Ray cluster, got {address!r}")
    try:
        socket.create_connection((host, int(port)), timeout=_SECONDS).close()
    except OSError as error:
        raise paxisim.InvalidValueError(f"no Ray cluster answers at {address} ({error}): {_START}") from error


def _last_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[-1]
