"""Pictures of presses and of a calibration."""

import numpy as np
import pytest
from load_rig import NAMES, rig

import paxisim

RED = "#c2030f"


def test_presses_are_drawn_with_their_cuts_and_thresholds():
    recording, _ = rig(seconds=20)
    presses = paxisim.find_presses(recording.time, recording.covariates["Fz"])
    axes = paxisim.plot_presses(presses).axes
    for ax in axes:
        cuts = [line.get_xdata()[0] for line in ax.lines if line.get_color() == RED and len(line.get_xdata()) == 2]
        np.testing.assert_allclose(sorted(cuts), recording.time[list(presses.cuts)])
        shaded = [ax.transData.inverted().transform(patch.get_window_extent())[:, 0] for patch in ax.patches]
        expected = [(recording.time[span.start], recording.time[span.stop - 1]) for span in presses.spans]
        np.testing.assert_allclose(shaded, expected, atol=1e-6)
    assert axes[1].get_ylim()[1] < 0.5 * presses.load.max()  # magnifies the signal at rest


def test_a_calibration_shows_the_error_of_each_channel_and_marks_the_unused():
    recording, _ = rig(seconds=20)
    recording.measured[:, 0, 1, 0, 2] = np.random.default_rng(0).normal(size=len(recording))
    # episodes whose clocks begin anew are drawn one after another
    half = len(recording) // 2
    time, episode = np.concatenate([recording.time[:half]] * 2), np.repeat([0, 1], half)
    recording = paxisim.Recording(time, recording.measured, None, recording.covariates, episode)
    readout = paxisim.calibrate_readout(recording, NAMES)
    figure = paxisim.plot_calibration(readout, recording)
    errors = next(ax for ax in figure.axes if "do not explain" in ax.get_title("left"))
    heights = sorted(bar.get_height() for bar in errors.patches)
    np.testing.assert_allclose(heights, np.sort(1 - readout.explained[readout.used]))
    assert "set to zero (1)" in errors.get_title("left")
    titles = [ax.get_title("left") for ax in figure.axes]
    for what, share in (("least", readout.explained[readout.used].min()), ("best", readout.explained.max())):
        assert any(title.startswith(f"the {what} explained") and f"({share:.2%})" in title for title in titles)
    assert f"14 channels from Fx, Fy, Fz, delay {1e3 * readout.delay:.1f} ms" in figure.get_suptitle()
    assert figure.axes[0].get_xlim()[1] == pytest.approx(20, abs=0.1)
