"""``python -m paxisim_insertion.export --run runs/SX-2mm_GCS_0 --out policies/SX-2mm_GCS_0``: export a run's actor."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import paxisim

from .curve import read_curve, write_curve
from .run import Run
from .shell import command


def export(run: Path, *, out: Path, other_versions: bool = False) -> None:
    """Write the actor of a run, about a megabyte, and its learning curve to a folder that evaluate and play accept.

    Args:
        run: Folder of the run.
        out: Output folder; must not exist.
        other_versions: Accept a run made with other software versions.
    """
    this = Run.open(run, other_versions=other_versions)
    if out.exists():
        raise paxisim.OutputExistsError(f"{out} exists already: choose another folder")
    env = this.insertion_env()
    try:
        trained = this.policy(env)
    finally:
        env.close()
    out.mkdir(parents=True)
    shutil.copyfile(run / "run.json", out / "run.json")
    write_curve(out, read_curve(run))
    print(trained.save(out))


if __name__ == "__main__":
    sys.exit(command(export))
