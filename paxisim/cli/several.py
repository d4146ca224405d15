"""Several recordings for ``paxisim diagnose``: one process and one folder each, and a failing one stops no other."""

from __future__ import annotations

import contextlib
import io
import platform
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from pathlib import Path

from paxisim.cli.diagnosis_files import check_diagnosis_folder
from paxisim.cli.output import check_folder, check_no_file, printable, progress
from paxisim.cluster import RayCluster
from paxisim.errors import InvalidValueError, PaxisimError

UNRELATED = 1  # exit status of a diagnosis whose streams are not of the same motion

_Ended = tuple[int, str]  # exit status of a diagnosis, and its verdict or error


def diagnose_each(
    recordings: Sequence[Path],
    output: Path,
    options: Sequence[str],
    *,
    force: bool = False,
    jobs: int = 1,
    ray: str | None = None,
) -> None:
    """Diagnose recordings in processes of their own and print a line about each.

    Args:
        recordings: The recordings. Their names without suffix name their folders, so no two may be the same.
        output: Folder of the folders; created if missing.
        options: Further options of ``paxisim diagnose``, the same for each.
        force: Whether to overwrite existing diagnoses.
        jobs: Number of processes. Recordings that are fewer than that share them out.
        ray: Address of a Ray cluster to work on instead, see `RayCluster`. All its nodes must see the recordings and
            the output.

    Raises:
        InvalidValueError: Two recordings have the same name, the folder cannot be made, or the cluster cannot be used.
        MissingExtraError: A cluster is given, but Ray is not installed.
        PaxisimError: The diagnosis of a recording failed. It names all of them, after the others are done.
        SystemExit: None failed, but the streams of one are not of the same motion (status 1).
    """
    twice = [name for name, count in Counter(path.stem for path in recordings).items() if count > 1]
    if twice:
        raise InvalidValueError(f"two recordings are named {twice[0]}, and so would be their folders: rename one")
    check_no_file(output)
    check_folder(output)
    cluster = None
    if ray is not None:
        cluster = RayCluster(ray)
        recordings, output = [path.absolute() for path in recordings], output.absolute()  # as the nodes find them
    output.mkdir(exist_ok=True)
    ended = _ended(recordings, output, options, force, jobs, cluster)
    began, failed, unrelated = time.monotonic(), [], False
    for number, (path, (status, message)) in enumerate(ended, 1):
        print(printable(f"{path}: {message}"), flush=True)
        if status not in (0, UNRELATED):
            failed.append(path)
        unrelated |= status == UNRELATED
        left = (time.monotonic() - began) / number * (len(recordings) - number)
        progress(f"{number} of {len(recordings)} recordings, about {left / 60:.0f} min left")
    if failed:
        names = ", ".join(map(str, failed))
        raise PaxisimError(f"{len(failed)} of {len(recordings)} recordings could not be diagnosed: {names}")
    if unrelated:
        raise SystemExit(UNRELATED)


def _ended(
    recordings: Sequence[Path],
    output: Path,
    options: Sequence[str],
    force: bool,
    jobs: int,
    cluster: RayCluster | None,
) -> Iterator[tuple[Path, _Ended]]:
    """Yield each recording and how its diagnosis ended."""
    left = []
    for path in recordings:
        try:
            check_diagnosis_folder(output / path.stem, force)
            left.append(path)
        except PaxisimError as error:
            yield path, (2, f"failed: {error}")
    options = [*options, "--force"]  # a diagnosis that Ray starts again may find its own files
    if cluster is None:
        options += ["--jobs", str(max(1, jobs // len(recordings)))]
        yield from _here(partial(_diagnose, output=output, options=options), left, max(1, jobs))
        return
    for path, found in cluster.run(partial(_diagnose_on_node, output=output, options=options), left, [output]):
        yield path, (2, f"failed: {found}") if isinstance(found, PaxisimError) else found


def _here(work: Callable[[Path], _Ended], recordings: Sequence[Path], jobs: int) -> Iterator[tuple[Path, _Ended]]:
    pool = ThreadPoolExecutor(jobs)
    try:
        futures = {pool.submit(work, path): path for path in recordings}
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _diagnose(recording: Path, output: Path, options: Sequence[str]) -> _Ended:
    """Diagnose a recording in a process of its own."""
    command = [sys.executable, "-m", "paxisim", *_words(recording, output, options)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    return _ending(done.returncode, done.stdout, done.stderr, output / recording.stem)


def _diagnose_on_node(recording: Path, output: Path, options: Sequence[str]) -> _Ended:
    """Diagnose a recording in this process: a process of its own would outlive a killed worker, and write beside it."""
    from paxisim.cli import main  # which imports this module

    if not recording.exists():
        advice = "check its name, and that all nodes share its file system"
        raise InvalidValueError(f"the node {platform.node()} does not see {recording}: {advice}")
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(_words(recording, output, options))
    return _ending(status, out.getvalue(), err.getvalue(), output / recording.stem)


def _words(recording: Path, output: Path, options: Sequence[str]) -> list[str]:
    return ["diagnose", str(recording), "-o", str(output / recording.stem), *options]


def _ending(status: int, out: str, err: str, folder: Path) -> _Ended:
    """Return the exit status of a diagnosis, and its verdict or error."""
    if status in (0, UNRELATED) and out:
        verdict = out.splitlines()[0].removeprefix("Verdict: ")
        return status, f"{verdict}, see {folder}"
    error = [line.removeprefix("paxisim: error: ") for line in err.splitlines()] or ["it was killed"]
    return status or 2, f"failed: {error[-1]}"
