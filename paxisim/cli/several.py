"""Several recordings for ``paxisim diagnose``: one process and one folder each, and a failing one stops no other."""

from __future__ import annotations

import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from paxisim.cli.output import check_folder, check_no_file, printable, progress
from paxisim.errors import InvalidValueError, PaxisimError

UNRELATED = 1  # exit status of a diagnosis whose streams are not of the same motion


def diagnose_each(recordings: Sequence[Path], output: Path, options: Sequence[str], jobs: int) -> None:
    """Diagnose recordings in processes of their own and print a line about each.

    Args:
        recordings: The recordings. Their names without suffix name their folders, so no two may be the same.
        output: Folder of the folders; created if missing.
        options: Further options of ``paxisim diagnose``, the same for each.
        jobs: Number of processes. Recordings that are fewer than that share them out.

    Raises:
        InvalidValueError: Two recordings have the same name, or the folder cannot be made.
        PaxisimError: The diagnosis of a recording failed. It names all of them, after the others are done.
        SystemExit: None failed, but the streams of one are not of the same motion (status 1).
    """
    twice = [name for name, count in Counter(path.stem for path in recordings).items() if count > 1]
    if twice:
        raise InvalidValueError(f"two recordings are named {twice[0]}, and so would be their folders: rename one")
    check_no_file(output)
    check_folder(output)
    output.mkdir(exist_ok=True)
    each = [*options, "--jobs", str(max(1, jobs // len(recordings)))]
    began, failed, unrelated = time.monotonic(), [], False
    pool = ThreadPoolExecutor(max(1, jobs))
    try:
        futures = {pool.submit(_diagnose, path, output / path.stem, each): path for path in recordings}
        for number, future in enumerate(as_completed(futures), 1):
            path, (status, told) = futures[future], future.result()
            print(printable(f"{path}: {told}"), flush=True)
            if status not in (0, UNRELATED):
                failed.append(path)
            unrelated |= status == UNRELATED
            left = (time.monotonic() - began) / number * (len(recordings) - number)
            progress(f"{number} of {len(recordings)} recordings, about {left / 60:.0f} min left")
    finally:
        pool.shutdown(cancel_futures=True)
    if failed:
        names = ", ".join(map(str, failed))
        raise PaxisimError(f"{len(failed)} of {len(recordings)} recordings could not be diagnosed: {names}")
    if unrelated:
        raise SystemExit(UNRELATED)


def _diagnose(recording: Path, folder: Path, options: Sequence[str]) -> tuple[int, str]:
    """Return the exit status of a diagnosis, and its verdict or error."""
    words = ["diagnose", str(recording), "-o", str(folder), *options]
    done = subprocess.run([sys.executable, "-m", "paxisim", *words], capture_output=True, encoding="utf-8", check=False)
    if done.returncode in (0, UNRELATED) and done.stdout:
        verdict = done.stdout.splitlines()[0].removeprefix("Verdict: ")
        return done.returncode, f"{verdict}, see {folder}"
    error = [line.removeprefix("paxisim: error: ") for line in done.stderr.splitlines()] or ["it was killed"]
    return done.returncode or 2, f"failed: {error[-1]}"
