"""Resume: simulation of episodes one by one or in parallel, each saved to disk so that a second call can continue."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.recording import Recording
from paxisim.scene.cache import EpisodeCache, is_cache
from paxisim.scene.replay import Replay, SimulatedEpisode
from paxisim.scene.scene import Scene


def simulate_resumable(
    scene: Scene,
    recording: Recording,
    folder: Path,
    *,
    mean: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int, int], None] | None = None,
) -> Recording:
    """Simulate like `paxisim.Scene.simulate`, but without losing finished episodes if the program is killed.

    Args:
        scene: The scene.
        recording: The recording.
        folder: Folder for finished episodes; created if missing, and to be removed by the caller once the result is
            saved.
        mean: See `paxisim.Scene.simulate`.
        jobs: Number of episodes to simulate at the same time, each in its own process.
        progress: Callback with the number of finished episodes, the total number, and the number kept from before.

    Raises:
        InvalidValueError: See `paxisim.Scene.simulate`; or `jobs` is less than 1.
    """
    if jobs < 1:
        raise InvalidValueError(f"jobs must be 1 or more, got {jobs}")
    replay = scene.prepare(recording, mean=mean)
    if folder.exists() and not is_cache(folder):
        raise InvalidValueError(f"{folder} is not a folder of kept episodes: move it away")
    folder.mkdir(exist_ok=True)
    with _locked(folder):
        return _resumed(replay, scene, recording, EpisodeCache(folder), mean, jobs, progress)


def _resumed(
    replay: Replay,
    scene: Scene,
    recording: Recording,
    kept: EpisodeCache,
    mean: bool,
    jobs: int,
    progress: Callable[[int, int, int], None] | None,
) -> Recording:
    done = {number: episode for number in replay.episodes if (episode := kept.read(replay, number)) is not None}
    before = len(done)
    missing = [number for number in replay.episodes if number not in done]
    if progress is not None:
        progress(len(done), len(replay.episodes), before)
    for episode in _simulated(replay, scene, recording, mean, missing, jobs):
        kept.write(replay, episode)
        done[episode.number] = episode
        if progress is not None:
            progress(len(done), len(replay.episodes), before)
    return replay.paired([done[number] for number in replay.episodes])


def _simulated(
    replay: Replay, scene: Scene, recording: Recording, mean: bool, numbers: list[int], jobs: int
) -> Iterator[SimulatedEpisode]:
    """Yield the episodes as they finish."""
    if jobs == 1 or len(numbers) < 2:
        for number in numbers:
            yield replay.run(number)
        return
    # processes that are not forked share no locks with this one
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(numbers)), context, _begin, (scene, recording, mean))
    try:
        for future in as_completed([pool.submit(_run, number) for number in numbers]):
            yield future.result()
    except BrokenProcessPool as error:
        raise UnsupportedError(
            "a process that simulated an episode was killed, perhaps for lack of memory: call again with fewer jobs; "
            "finished episodes are kept"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


_replay: Replay | None = None  # set in each process of the pool


def _begin(scene: Scene, recording: Recording, mean: bool) -> None:
    global _replay
    begin_worker()
    _replay = scene.prepare(recording, mean=mean)


def begin_worker() -> None:
    """Make this process end with its parent process, and leave Ctrl-C to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(number: int) -> SimulatedEpisode:
    assert _replay is not None
    return _replay.run(number)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other programs out of a folder; the system ends this with the process."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise InvalidValueError(
            f"another program is simulating the same output, in {folder}: wait for it, or choose another output"
        ) from None
    except OSError:  # the file system has no locks
        pass
    try:
        yield
    finally:
        os.close(descriptor)
