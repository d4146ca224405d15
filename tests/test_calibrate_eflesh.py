"""A real sensor, if the data is available: cross-validation between two recordings of eFlesh."""

import os
from pathlib import Path

import numpy as np
import pytest

import paxisim

FOLDER = Path(os.environ.get("PAXISIM_EFLESH") or Path(paxisim.__file__).parents[2] / "shared" / "data" / "eflesh")
pytestmark = pytest.mark.skipif(not (FOLDER / "press_1.sensor.csv").exists(), reason="needs the eFlesh recordings")


@pytest.fixture(scope="module")
def presses():
    return [paxisim.Recording.load(FOLDER / f"press_{number}.sensor.csv", missing="drop") for number in (1, 2)]


def nrmse(measured, predicted):
    return np.sqrt(np.sum((measured - predicted) ** 2) / np.sum(np.square(measured, dtype=float)))


def cubic(fitted, judged):
    channels = fitted.measured.reshape(len(fitted), -1).astype(float)
    curves = [np.polyfit(fitted.covariates["load"], channel, 3) for channel in channels.T]
    return np.stack([np.polyval(c, judged.covariates["load"]) for c in curves], axis=1).reshape(judged.measured.shape)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["1 to 2", "2 to 1"])
def test_a_readout_of_degree_3_is_no_worse_than_a_cubic_for_each_channel(presses, order):
    fitted, judged = (presses[i] for i in order)
    readout = paxisim.calibrate_readout(fitted, "load", degree=3)
    error = nrmse(judged.measured, readout.to_channels(readout.apply(judged).simulated))
    assert error <= nrmse(judged.measured, cubic(fitted, judged))
    straight = paxisim.calibrate_readout(fitted, "load")
    assert error < 0.85 * nrmse(judged.measured, straight.to_channels(straight.apply(judged).simulated))


def test_the_load_comes_later_than_the_channels(presses):
    intervals = [paxisim.calibrate_readout(press, "load", degree=3).delay_interval for press in presses]
    assert all(low < high < 0 for low, high in intervals)
    assert max(low for low, _ in intervals) < min(high for _, high in intervals)  # the two recordings agree


def test_the_recording_is_cut_into_its_presses(presses):
    ready = paxisim.calibrate_readout(presses[0], "load").apply(presses[0])
    assert len(np.unique(ready.episode)) == 10
