"""Accuracy of the load estimated by a calibrated sensor: ``python benchmarks/eflesh_loads.py FOLDER``.

FOLDER holds two recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`). A linear and a quadratic
calibration are fitted to one recording and estimate the load of the other from all channels together.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import tyro

import paxisim
from paxisim.calibrate.loads import values_of


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Print the table.

    Args:
        folder: Folder with press_1 and press_2.
    """
    warnings.simplefilter("ignore")
    presses = [paxisim.Recording.load(folder / f"press_{n}.sensor.csv") for n in (1, 2)]
    print("fitted to  judged on  fit         held-out error on the first  error on the other")
    for first, other in ((0, 1), (1, 0)):
        for quadratic in (False, True):
            fitted = paxisim.calibrate_sensor(presses[first], "load", quadratic=quadratic)
            values = values_of(presses[other], fitted.model.loads)
            known = np.isfinite(values).all(axis=1)
            judged = presses[other][known]
            load = fitted.readout.earlier(judged, values[known])
            error = float(np.sqrt(np.mean((fitted.model(judged.measured) - load) ** 2)))
            kind = "quadratic" if quadratic else "linear"
            own = fitted.model.error[0]
            print(f"press_{first + 1}    press_{other + 1}    {kind:<9}  {own:>26.2f} N  {error:>16.2f} N")


if __name__ == "__main__":
    tyro.cli(main)
