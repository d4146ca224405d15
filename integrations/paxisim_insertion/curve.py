"""Learning curves: success rate against training steps."""

from __future__ import annotations

import csv
from pathlib import Path

import paxisim

CURVE = "curve.csv"
"""File name of the curve of an exported actor."""

_STEPS, _SUCCESS = "time/total_timesteps", "rollout/success_rate"  # stable-baselines3's names
_POINTS = 200


def read_curve(folder: Path) -> list[tuple[int, float]]:
    """Read the steps of a training and the success rate of the last 100 episodes, with sampled actions, at each.

    Args:
        folder: Folder of a run, whose logs are read, or of an exported actor.

    Returns:
        Pairs of steps and success rate, ordered by steps; empty if nothing was logged.

    Raises:
        InvalidValueError: A file is not a training log.
    """
    points: dict[int, float] = {}
    logs = sorted(folder.glob("log_*/progress.csv"), key=lambda path: path.stat().st_mtime)
    for path in [folder / CURVE] if (folder / CURVE).exists() else logs:
        try:
            with path.open(encoding="utf-8", newline="") as lines:
                for row in csv.DictReader(lines):
                    if row.get(_SUCCESS):
                        points[int(row[_STEPS])] = float(row[_SUCCESS])
        except (ValueError, TypeError, KeyError, csv.Error) as error:
            raise paxisim.InvalidValueError(f"{path} is not the log of a training: {error!r}") from error
    return sorted(points.items())


def write_curve(folder: Path, points: list[tuple[int, float]]) -> None:
    """Write a curve, thinned to at most 200 points, for `read_curve`."""
    kept = points[:: -(-len(points) // _POINTS) or 1]
    with (folder / CURVE).open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow([_STEPS, _SUCCESS])
        writer.writerows(kept)
