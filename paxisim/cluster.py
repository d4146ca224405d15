"""RayCluster: runs one function over many jobs on the machines of a Ray cluster."""

from __future__ import annotations

import logging
import pickle
import platform
import secrets
import socket
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from paxisim.errors import InvalidValueError, MissingExtraError, PaxisimError

RETRIES = 10
"""How often a job whose worker or node died is started again before it counts as failed."""

_SECONDS = 10.0
"""Time for a cluster to accept a connection. Ray itself tries for two minutes and then ends the process."""

_START = "start one on this machine with: ray start --head --node-ip-address 127.0.0.1"

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


class RayCluster:
    """A running Ray cluster, on which each job takes one core of any node.

    Ray starts a job again, on another worker or node, if its own dies. Thus a job may run more than once and must bear
    that. The nodes need the same versions of Python, Ray and paxisim as this machine.
    """

    def __init__(self, address: str = "auto") -> None:
        """Connect to the cluster.

        Args:
            address: HOST:PORT of the cluster's head; ``"auto"`` for the cluster that this machine belongs to.

        Raises:
            MissingExtraError: Ray is not installed.
            InvalidValueError: The cluster cannot be reached, or runs other versions of Ray or Python.
        """
        try:
            import ray  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise MissingExtraError("ray", "ray", "--ray") from error
        if address != "auto":
            _reach(address)
        try:
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
        except ConnectionError as error:
            raise InvalidValueError(f"this machine belongs to no Ray cluster: {_START}") from error
        except (RuntimeError, ValueError) as error:
            raise InvalidValueError(f"cannot use the Ray cluster at {address}: {error}") from error
        self._ray: Any = ray

    @property
    def cores(self) -> int:
        """Number of cores that the cluster has now, which is the number of jobs at a time."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def run(
        self, function: Callable[[_Job], _Result], jobs: Iterable[_Job], shared: Iterable[Path]
    ) -> Iterator[tuple[_Job, _Result | PaxisimError]]:
        """Yield each job and its result, in the order in which they are done, and then leave the cluster.

        A job that fails stops no other. Its error takes the place of its result: the `PaxisimError` that the function
        raised, or one that names what else went wrong.

        Args:
            function: Function of a job. The nodes import it from its module.
            jobs: The jobs.
            shared: Existing files and folders that every node must see. A folder must be writable: while the jobs run,
                it holds an empty hidden file, which tells it from another folder with the same path.
        """
        seen = {_mark(path) if path.is_dir() else path: path for path in (path.resolve() for path in shared)}
        marks = [mark for mark, path in seen.items() if mark != path]
        try:
            for mark in marks:
                mark.touch()
            task = self._ray.remote(num_cpus=1, max_retries=RETRIES)(_on_node)
            # packed, so that a node looks for the paths before it imports modules that may lie there
            waiting = {task.remote(self._ray.cloudpickle.dumps((function, job)), seen): job for job in jobs}
            while waiting:
                (reference,), _ = self._ray.wait(list(waiting), num_returns=1)
                job = waiting.pop(reference)
                try:
                    found = self._ray.get(reference)
                except self._ray.exceptions.RayError as error:
                    cause = getattr(error, "cause", None)
                    deliberate = isinstance(cause, PaxisimError)
                    found = cause if deliberate else PaxisimError(f"failed on Ray: {_last_line(error)}")
                yield job, found
        finally:
            for mark in marks:
                mark.unlink(missing_ok=True)
            self._ray.shutdown()


def _mark(folder: Path) -> Path:
    return folder / f".paxisim-{secrets.token_hex(8)}"


def _on_node(packed: bytes, seen: dict[Path, Path]) -> Any:
    """Run a function, which is packed with its job, if this node sees all paths, given by what to look for in them."""
    for mark, path in seen.items():
        if not mark.exists():
            advice = "put it on a file system that all nodes share"
            raise InvalidValueError(f"the node {platform.node()} does not see {path}: {advice}")
    function, job = pickle.loads(packed)
    return function(job)


def _reach(address: str) -> None:
    host, _, port = address.rpartition(":")
    if not host or not port.isascii() or not port.isdecimal() or not 0 < int(port) < 65536:
        raise InvalidValueError(f"expected HOST:PORT as the address of a Ray cluster, got {address!r}")
    try:
        socket.create_connection((host, int(port)), timeout=_SECONDS).close()
    except OSError as error:
        raise InvalidValueError(f"no Ray cluster answers at {address} ({error}): {_START}") from error


def _last_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[-1]
