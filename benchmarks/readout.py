"""Recovery of a readout, and its prediction of a real sensor: ``python benchmarks/readout.py [FOLDER]``.

The first table is for a synthetic sensor of 15 channels under three loads, with a delay of 30 ms (`tests/load_rig.py`):
how many of the delays and gains lie in their 95 % intervals. The others, printed if FOLDER is given, are for two
recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`). In the second, all models are fitted to
one and judged on the other, by the root of the error's summed squares divided by the summed squares of the readings. In
the third, a calibration of the sensor estimates the load of the other recording from all channels together, as applied
live, and so does plain ridge regression.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from load_rig import NAMES, rig

import paxisim

RIGS = {
    "as it is": {},
    "5 times the channels' noise": {"noise": 0.1},
    "5 times the load cell's noise": {"load_noise": 0.1},
    "no delay": {"delay": 0.0},
}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--seeds", type=int, default=40)
    arguments = parser.parse_args()
    print(f"{'rig':<32} {'delays':>7} {'gains':>7} {'delay off by (ms)':>18}")
    for name, how in RIGS.items():
        _recover(name, how, arguments.seeds)
    if arguments.folder is not None:
        _predict(arguments.folder)
        _loads(arguments.folder)


def _recover(name: str, how: dict, seeds: int) -> None:
    true_delay = how.get("delay", 0.03)
    delays, gains, errors = [], [], []
    for seed in range(seeds):
        recording, true = rig(seed, **how)
        readout = paxisim.calibrate_readout(recording, NAMES)
        low, high = readout.delay_interval
        delays.append(low <= true_delay <= high)
        gains.append(np.abs(readout.gain - true) <= readout.gain_error)
        errors.append(readout.delay - true_delay)
    print(
        f"{name:<32} {np.mean(delays):>7.0%} {np.mean(gains):>7.0%} {1e3 * np.sqrt(np.mean(np.square(errors))):>18.2f}"
    )


def _predict(folder: Path) -> None:
    presses = [paxisim.Recording.load(folder / f"press_{n}.sensor.csv", missing="drop") for n in (1, 2)]
    print(f"\n{'':<32} {'1 to 2':>8} {'2 to 1':>8} {'2 to 1, without the first 3 presses':>36}")
    ways = [(presses[0], presses[1]), (presses[1], presses[0])]
    rows = {"cubic for each channel, no delay": [_cubic(*way) for way in ways]}
    for degree in (1, 2, 3):
        rows[f"readout of degree {degree}"] = [_readout(*way, degree) for way in ways]
    cut = paxisim.find_presses(presses[0].time, presses[0].covariates["load"])
    settled = np.arange(len(presses[0])) >= cut.cuts[2]
    for name, (first, second) in rows.items():
        numbers = [_nrmse(presses[1], first), _nrmse(presses[0], second)]
        late = _nrmse(presses[0][settled], second[settled])
        print(f"{name:<32} {numbers[0]:>8.4f} {numbers[1]:>8.4f} {late:>36.4f}")


def _loads(folder: Path) -> None:
    from sklearn.linear_model import RidgeCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    presses = [paxisim.Recording.load(folder / f"press_{n}.sensor.csv", missing="drop") for n in (1, 2)]
    print("\nfitted to  judged on  fit          held-out error on the first  error on the other")
    for first, other in ((0, 1), (1, 0)):
        fitted, judged = presses[first], presses[other]
        rows = []
        for kind in ("linear", "quadratic", "best"):
            model = paxisim.calibrate_sensor(fitted, "load", kind=kind).model
            own = f"{model.error[0]:.2f} N"
            rows.append((kind, own, model(judged.measured)[:, 0]))
        plain = make_pipeline(StandardScaler(), RidgeCV(np.logspace(-3, 3, 7)))
        plain.fit(fitted.tensor.reshape(len(fitted), -1), fitted.covariates["load"])
        rows.append(("plain ridge", "", plain.predict(judged.tensor.reshape(len(judged), -1))))
        for name, own, predicted in rows:
            error = np.sqrt(np.mean((predicted - judged.covariates["load"]) ** 2))
            print(f"press_{first + 1}    press_{other + 1}    {name:<11}  {own:>26}  {error:>16.2f} N")


def _cubic(fitted: paxisim.Recording, judged: paxisim.Recording) -> np.ndarray:
    channels = fitted.tensor.reshape(len(fitted), -1).astype(float)
    curves = [np.polyfit(fitted.covariates["load"], channel, 3) for channel in channels.T]
    return np.stack([np.polyval(c, judged.covariates["load"]) for c in curves], axis=1).reshape(judged.tensor.shape)


def _readout(fitted: paxisim.Recording, judged: paxisim.Recording, degree: int) -> np.ndarray:
    readout = paxisim.calibrate_readout(fitted, "load", degree=degree)
    simulated = readout.apply(judged).simulated
    assert simulated is not None
    return readout.to_channels(simulated)


def _nrmse(judged: paxisim.Recording, predicted: np.ndarray) -> float:
    return float(np.sqrt(np.sum((judged.tensor - predicted) ** 2) / np.sum(np.square(judged.tensor, dtype=float))))


if __name__ == "__main__":
    main()
