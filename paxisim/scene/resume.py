"""Resume: simulation of episodes one by one or in parallel, each saved to disk so that a second call can continue."""

from __future__ import annotations

import contextlib
import hashlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np

from paxisim._version import __version__
from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.files import whole_file
from paxisim.recording import Recording
from paxisim.scene.replay import CLOSING_FITS, Replay, SimulatedEpisode
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
            saved. Episodes of another scene or recording are deleted.
        mean: See `paxisim.Scene.simulate`.
        jobs: Number of episodes to simulate at the same time, each in its own process.
        progress: Callback with the number of finished episodes, the total number, and the number kept from before.

    Raises:
        InvalidValueError: See `paxisim.Scene.simulate`; or `jobs` is less than 1.
    """
    if jobs < 1:
        raise InvalidValueError(f"jobs must be 1 or more, got {jobs}")
    replay = scene.prepare(recording, mean=mean)
    with _opened_folder(folder, _fingerprint(replay, scene, recording, mean)) as kept:
        return _resumed(replay, scene, recording, kept, mean, jobs, progress)


def _resumed(
    replay: Replay,
    scene: Scene,
    recording: Recording,
    kept: Path,
    mean: bool,
    jobs: int,
    progress: Callable[[int, int, int], None] | None,
) -> Recording:
    done = {number: episode for number in replay.episodes if (episode := _read(kept, number)) is not None}
    before = len(done)
    missing = [number for number in replay.episodes if number not in done]
    if progress is not None:
        progress(len(done), len(replay.episodes), before)
    for episode in _simulated(replay, scene, recording, mean, missing, jobs):
        _write(kept, episode)
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


def _fingerprint(replay: Replay, scene: Scene, recording: Recording, mean: bool) -> str:
    """Return a hash of everything that the simulated forces depend on."""
    import mujoco

    from paxisim.scene.toml import format_scene

    digest, grid = hashlib.sha256(), recording.tensor.shape[1:]
    for text in (__version__, mujoco.__version__, replay.rig.mjcf, format_scene(scene, ""), str(mean), str(grid)):
        digest.update(text.encode() + b"\0")
    arrays = {"time": recording.time, "episode": recording.episode, **recording.covariates}
    if scene.mode in CLOSING_FITS and recording.measured is not None:
        arrays["measured"] = recording.measured
    for name, array in arrays.items():
        digest.update(f"{name} {array.dtype} {array.shape}\0".encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


@contextlib.contextmanager
def _opened_folder(folder: Path, fingerprint: str) -> Iterator[Path]:
    """Yield the folder, created or with what belongs to the same replay; other kept episodes are deleted.

    Raises:
        InvalidValueError: The path exists but is not a folder of kept episodes, or another program works in it.
    """
    mark = folder / "replay"
    if folder.exists() and not mark.is_file():
        raise InvalidValueError(f"{folder} is not a folder of kept episodes: move it away")
    folder.mkdir(exist_ok=True)
    with _locked(folder):
        said = ""
        with contextlib.suppress(OSError, UnicodeDecodeError):
            said = mark.read_text(encoding="utf-8")
        if said != fingerprint:
            for path in folder.iterdir():
                path.unlink()
            mark.write_text(fingerprint, encoding="utf-8")
        yield folder


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


def _path(folder: Path, number: int) -> Path:
    return folder / f"episode_{number}.npz"


def _write(folder: Path, episode: SimulatedEpisode) -> None:
    with whole_file(_path(folder, episode.number)) as temporary, temporary.open("wb") as file:
        said = json.dumps({"closing": episode.closing, "notes": episode.notes})
        np.savez_compressed(file, force=episode.force, said=np.array(said))


def _read(folder: Path, number: int) -> SimulatedEpisode | None:
    """Return a kept episode; None if it is missing or damaged."""
    try:
        with np.load(_path(folder, number), allow_pickle=False) as kept:
            said = json.loads(str(kept["said"]))
            return SimulatedEpisode(number, kept["force"], float(said["closing"]), tuple(said["notes"]))
    except FileNotFoundError:
        return None
    except Exception:  # zipfile and numpy raise many kinds of errors for a damaged file
        return None
