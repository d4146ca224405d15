"""Replays of one recording with varied scene parameters, computed in parallel and cached."""

from __future__ import annotations

import multiprocessing
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import PaxisimError, UnsupportedError
from paxisim.recording import Recording
from paxisim.scene.cache import EpisodeCache
from paxisim.scene.changed import changed
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.resume import begin_worker
from paxisim.scene.scene import Scene

Values = Mapping[SceneParameter, float]
_Key = tuple[tuple[SceneParameter, float], ...]
_Force = NDArray[np.float32]


class Replays:
    """Simulates the motion of a recording with varied values of the scene's parameters.

    Processes are used because threads would wait for one another between physics steps. Replays are cached, so each is
    computed only once.

    Attributes:
        scene: The scene.
        recording: The recording.
    """

    def __init__(
        self,
        scene: Scene,
        recording: Recording,
        closings: Mapping[int, Sequence[float]] | None = None,
        *,
        jobs: int = 1,
        folder: Path | None = None,
    ) -> None:
        """Store the arguments; nothing is simulated yet.

        Args:
            scene: The scene.
            recording: Recording with the driving streams among its covariates.
            closings: Constants added to the closing stream in the grasps of each episode, as fitted by a mode.
            jobs: Number of processes.
            folder: Folder of an `EpisodeCache`, which other programs can share. None: no cache on disk.
        """
        self.scene, self.recording = scene, recording
        self._jobs = jobs
        self._maker = _Maker(scene, recording, dict(closings or {}), folder)
        self._kept: dict[tuple[_Key, int], _Force | PaxisimError] = {}
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Replays:
        """Return the object itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    @property
    def episodes(self) -> tuple[int, ...]:
        """Numbers of the recording's episodes."""
        return tuple(int(part.episode[0]) for part in self.recording.episodes())

    def run_sets(self, sets: Sequence[Mapping[int, Values]]) -> list[_Force | PaxisimError]:
        """Simulate the whole recording for each set of values.

        Args:
            sets: Parameter values by episode, one mapping per set; missing parameters keep their nominal values.

        Returns:
            For each set, the forces ``(T, pads, 3, rows, cols)`` (N), NaN where the driving streams are unknown; or an
            error if the scene cannot have the values or the simulation becomes unstable.
        """
        parts = [[(_key(values.get(number, {})), number) for number in self.episodes] for values in sets]
        missing: dict[_Key, list[int]] = {}
        for key, number in dict.fromkeys(part for own in parts for part in own):
            if (key, number) not in self._kept:
                missing.setdefault(key, []).append(number)
        tasks = [(key, tuple(numbers)) for key, numbers in missing.items()]
        for (key, numbers), made in zip(tasks, self._made(tasks), strict=True):
            for number, force in zip(numbers, made, strict=True):
                self._kept[key, number] = force
        return [self._whole(own) for own in parts]

    def run_each(self, values: Mapping[int, Values]) -> _Force:
        """Simulate the whole recording for one set of values; see `run_sets`.

        Raises:
            UnsupportedError: The simulation becomes unstable.
            InvalidValueError: The scene cannot have a value.
        """
        (whole,) = self.run_sets([values])
        if isinstance(whole, PaxisimError):
            raise whole
        return whole

    def _whole(self, parts: Sequence[tuple[_Key, int]]) -> _Force | PaxisimError:
        found = [self._kept[part] for part in parts]
        forces = []
        for one in found:
            if isinstance(one, PaxisimError):
                return one
            forces.append(one)
        return np.concatenate(forces)

    def _made(self, tasks: Sequence[tuple[_Key, tuple[int, ...]]]) -> list[list[_Force | PaxisimError]]:
        if self._jobs == 1 or len(tasks) < 2:
            return [self._maker(task) for task in tasks]
        if self._pool is None:
            context = multiprocessing.get_context("spawn")  # unlike forked ones, these share no locks with this process
            self._pool = ProcessPoolExecutor(self._jobs, context, _begin, (self._maker,))
        try:
            return list(self._pool.map(_run, tasks))
        except BrokenProcessPool as error:
            raise UnsupportedError(
                "a process that simulated an episode was killed, perhaps for lack of memory: call again with fewer jobs"
            ) from error


def _key(values: Values) -> _Key:
    moved = [(item, float(value)) for item, value in values.items() if value != item.nominal]
    return tuple(sorted(moved, key=lambda pair: pair[0].name))


class _Maker:
    """Computes replays, in this process or another."""

    def __init__(
        self, scene: Scene, recording: Recording, closings: dict[int, Sequence[float]], folder: Path | None
    ) -> None:
        self._scene, self._recording, self._closings = scene, recording, closings
        self._cache = None if folder is None else EpisodeCache(folder)

    def __call__(self, task: tuple[_Key, tuple[int, ...]]) -> list[_Force | PaxisimError]:
        """Return the forces of some episodes, or an error in place of each that failed."""
        key, numbers = task
        try:
            replay = changed(self._scene, dict(key)).prepare(self._recording)
        except PaxisimError as error:
            return [error] * len(numbers)
        run = replay.run if self._cache is None else partial(self._cache.run, replay)
        forces: list[_Force | PaxisimError] = []
        for number in numbers:
            try:
                forces.append(run(number, self._closings.get(number)).force)
            except PaxisimError as error:
                forces.append(error)
        return forces


_maker: _Maker | None = None  # set in each process of the pool


def _begin(maker: _Maker) -> None:
    global _maker
    begin_worker()
    _maker = maker


def _run(task: tuple[_Key, tuple[int, ...]]) -> list[_Force | PaxisimError]:
    assert _maker is not None
    return _maker(task)
