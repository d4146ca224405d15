"""Diagnosis of a real sensor: ``python benchmarks/eflesh.py FOLDER``.

FOLDER holds two recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`). The linear readout of
the load cell and all other models are fitted to the first recording and judged on the second, in the channels' unit::

    NRMSE = sqrt(sum (measured - predicted)^2 / sum measured^2)    over all samples and channels of press_2

The last columns give the error relative to that of the linear readout, and the error without the first cycles of the
judged recording, in which the sensor had not settled. ``--reverse`` fits to the second recording and judges on the
first.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import numpy as np

import paxisim
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.repeats import settled

LAGS = (1, 2, 4, 8, 16, 32)  # samples that the black box looks back


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reverse", action="store_true", help="fit to press_2 and judge on press_1")
    arguments = parser.parse_args()
    numbers = (2, 1) if arguments.reverse else (1, 2)
    first, second = (paxisim.Recording.load(arguments.folder / f"press_{n}.sensor.csv") for n in numbers)
    known = np.isfinite(second.covariates["load"])
    first, second = first[np.isfinite(first.covariates["load"])], second[known]
    readout = paxisim.calibrate_readout(first, "load")
    fitted, held = readout.apply(first), readout.apply(second)
    start, settles = unsettled(fitted), unsettled(held)

    measured = second.measured.astype(np.float64)
    scale = np.sum(measured**2)

    def nrmse(predicted: np.ndarray) -> float:
        return float(np.sqrt(np.sum((measured - predicted) ** 2) / scale))

    def settled_only(predicted: np.ndarray) -> str:
        left = np.sum((measured - predicted)[settles:] ** 2) / np.sum(measured[settles:] ** 2)
        return f"{np.sqrt(left):.4f} on settled cycles"

    linear = nrmse(readout.to_channels(held.simulated))

    def row(name: str, predicted: np.ndarray, before: float | None = None) -> float:
        value = nrmse(predicted)
        step = settled_only(predicted) if before is None else f"{before**2 - value**2:9.5f} of the squares"
        print(f"{name:<46} {value:8.4f} {value / linear:7.3f} {step}", flush=True)
        return value

    def apart(model: Callable, start: int = 0) -> np.ndarray:
        """Predict each channel separately from the load."""
        load, later = first.covariates["load"], second.covariates["load"]
        flat = first.measured.reshape(len(first), -1).astype(np.float64)
        return np.stack([model(load[start:], c[start:], later) for c in flat.T], axis=1).reshape(measured.shape)

    print(f"{'':<46} {'NRMSE':>8} {'ratio':>7}")
    row("linear readout", readout.to_channels(held.simulated))
    row("cubic of the load for each channel", apart(lambda x, y, z: np.polyval(np.polyfit(x, y, 3), z)))
    row("the same, settled cycles only", apart(lambda x, y, z: np.polyval(np.polyfit(x, y, 3), z), start))
    row("black box (boosting on the load's past)", apart(lambda x, y, z: _boost(x, y, z, arguments.seed)))
    row("the same, settled cycles only", apart(lambda x, y, z: _boost(x, y, z, arguments.seed), start))
    begin = time.perf_counter()
    found = paxisim.diagnose(
        fitted, seed=arguments.seed, progress=lambda stage, share: print(f"{share:4.0%} {stage}", file=sys.stderr)
    )
    seconds = time.perf_counter() - begin
    last = row("extended model", readout.to_channels(found.model.run(held.simulated.astype(float), held.time)))
    print(
        f"\n{found}\n\nContributions to the gain, in the order of the causes, each set refitted to press_{numbers[0]}"
    )
    before = row("linear readout", readout.to_channels(held.simulated))
    before = row("+ settled cycles only", apart(lambda x, y, z: np.polyval(np.polyfit(x, y, 1), z), start), before)
    names = [cause.name for cause in found.causes]
    for count in range(1, len(names)):
        part = paxisim.diagnose(fitted, names[:count], seed=arguments.seed)
        model = part.model.run(held.simulated.astype(float), held.time)
        before = row(f"+ {names[count - 1]}", readout.to_channels(model), before)
    if names:
        print(f"{'+ ' + names[-1]:<46} {last:8.4f} {last / linear:7.3f} {before**2 - last**2:9.5f} of the squares")
    print(f"\ndiagnosed in {seconds:.0f} s")


def unsettled(recording: paxisim.Recording) -> int:
    """Return how many samples of a recording precede the sensor's settling."""
    cut = prepare(recording)[0]
    return len(cut) - len(settled(cut, np.ones(cut.measured.shape[1:], dtype=bool))[0])


def _boost(load: np.ndarray, channel: np.ndarray, later: np.ndarray, seed: int) -> np.ndarray:
    from sklearn.ensemble import HistGradientBoostingRegressor

    def past(x: np.ndarray) -> np.ndarray:
        return np.stack([x, *(x - np.concatenate([np.full(lag, x[0]), x[:-lag]]) for lag in LAGS)], axis=1)

    model = HistGradientBoostingRegressor(max_iter=150, max_leaf_nodes=24, min_samples_leaf=40, random_state=seed)
    return model.fit(past(load), channel).predict(past(later))


if __name__ == "__main__":
    main()
