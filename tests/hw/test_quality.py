"""Known rate, jitter, noise and drift are recovered; taxels that the firmware sets to zero are no fault."""

import re
from dataclasses import replace

import numpy as np
import pytest

from paxisim import Frame, InvalidValueError, SensorQuality, TaxelLayout, measure_quality, plot_quality
from paxisim.hw.commissioning.quality import MIN_FRAMES

LAYOUT = TaxelLayout(4, 3, (2e-3, 2e-3))
RATE = 100.0


def resting(count=3000, pads=2, noise=0.2, drift=0.0, jitter=1e-3, lost=0.0, seed=0) -> list[Frame]:
    """Frames of a resting sensor with a `drift` (N/s) of each taxel and a fraction `lost` of the frames missing."""
    rng = np.random.default_rng(seed)
    sequence = np.flatnonzero(rng.random(count) >= lost)
    sequence = np.union1d(sequence, [0, count - 1])
    time = 5.0 + sequence / RATE
    arrival = time + np.clip(rng.normal(5 * jitter, jitter, len(time)), 0, 10 * jitter)
    force = rng.normal(0, noise, (len(time), pads, *LAYOUT.shape)) + drift * time[:, None, None, None, None]
    return [
        Frame(f.astype(np.float32), t, a, int(s), (0,) * pads)
        for f, t, a, s in zip(force, time, arrival, sequence, strict=True)
    ]


def judge(frames: list[Frame], nominal=RATE) -> SensorQuality:
    return measure_quality(frames, LAYOUT, ("left", "right")[: frames[0].force.shape[0]], nominal)


def test_known_rate_jitter_and_noise_are_found():
    quality = judge(resting())
    assert quality.frames == 3000
    assert quality.lost == 0
    assert quality.rate == pytest.approx(RATE, rel=0.01)
    assert quality.mean_rate == pytest.approx(RATE, rel=1e-6)
    assert quality.jitter == pytest.approx(np.sqrt(2) * 1e-3, rel=0.05)
    assert quality.slow_interval == pytest.approx(10e-3 + 2.326 * np.sqrt(2) * 1e-3, rel=0.03)
    assert quality.noise.shape == (2, 3, 4, 3)
    assert quality.noise == pytest.approx(np.full((2, 3, 4, 3), 0.2), rel=0.1)
    assert quality.total_noise == pytest.approx(np.full((2, 3), 0.2 * np.sqrt(12)), rel=0.1)


def test_lost_frames_are_counted_and_do_not_lower_the_rate():
    quality = judge(resting(lost=0.1))
    assert quality.lost == 3000 - quality.frames
    assert 200 < quality.lost < 400
    assert quality.rate == pytest.approx(RATE, rel=0.01)
    assert quality.mean_rate == pytest.approx(0.9 * RATE, rel=0.03)


def test_drift_is_found_with_an_error_that_means_something():
    errors = []
    for seed in range(40):
        quality = judge(resting(count=600, noise=0.1, drift=0.002, seed=seed))
        errors.append((quality.drift - 0.002 * 12 * 60) / quality.drift_error)
    # errors divided by a correct standard error have a standard deviation of about 1
    assert 0.85 < np.std(errors) < 1.25
    assert abs(np.mean(errors)) < 0.2


def test_noise_is_that_from_frame_to_frame_even_when_it_drifts():
    quiet, drifting = judge(resting()), judge(resting(drift=0.5))
    assert drifting.noise == pytest.approx(quiet.noise, rel=0.02)
    assert drifting.touched.all()
    assert not quiet.touched.any()


def test_taxels_that_always_read_zero_are_no_fault_and_others_that_do_not_change_are_named():
    quality = judge([replace(f, force=np.zeros_like(f.force)) for f in resting(count=50)])
    assert quality.zero.all()
    assert not quality.constant.any()
    assert np.all(quality.noise == 0)
    assert np.all(quality.drift == 0)
    text = str(quality)
    assert "left: 12 of 12 taxels always read 0\n" in text
    assert "no fault in a pad at rest" in text
    assert "stuck" not in text
    frames = resting(count=50)
    for frame in frames:
        frame.force[1, :, 2, 1] = 1.5
        frame.force[1, :, 0, 0] = 0.0
    quality = judge(frames)
    assert np.argwhere(quality.constant).tolist() == [[1, 2, 1]]
    assert np.argwhere(quality.zero).tolist() == [[1, 0, 0]]
    assert "right: 1 of 12 taxels always read 0, 1 always the same, but not 0" in str(quality)
    assert "or is stuck" in str(quality)


def test_a_touch_is_noticed():
    frames = resting(count=200)
    for frame in frames[100:]:
        frame.force[0, 2] += 2.0
    quality = judge(frames)
    assert quality.touched.tolist() == [True, False]
    assert "left: its total changed by" in str(quality)


@pytest.mark.parametrize(("pads", "nominal"), [(1, None), (2, 83.0)])
def test_the_table_fits_and_says_what_is_known(pads, nominal):
    text = str(judge(resting(count=100, pads=pads, drift=30.0), nominal))
    assert max(map(len, text.splitlines())) <= 80
    assert ("nominally" in text) == (nominal is not None)
    assert text.count("N/min") == 3 * pads


def test_a_raw_reading_that_does_not_change_is_of_a_dead_taxel_and_columns_stay_apart():
    frames = [replace(frame, unit="uT", force=frame.force + np.float32(1e8)) for frame in resting(count=100)]
    for frame in frames:
        frame.force[0, :, 0, 0] = 0.0
    text = str(judge(frames))
    assert "one that does not change at all is of a dead taxel" in text
    assert "no fault" not in text
    rows = [line for line in text.splitlines() if line.endswith("uT/min")]
    assert all(len(re.findall(r"(?<!\S)[-+]?\d+\.?\d*(?= uT)", row)) == 4 for row in rows), rows


def test_too_little_and_nonsense_are_refused():
    frames = resting(count=100)
    with pytest.raises(InvalidValueError, match=f"at least {MIN_FRAMES} frames"):
        judge(frames[: MIN_FRAMES - 1])
    with pytest.raises(InvalidValueError, match="in the order"):
        judge(frames[::-1])
    with pytest.raises(InvalidValueError, match="in the order"):
        judge([*frames, frames[-1]])
    with pytest.raises(InvalidValueError, match=r"\(\.\.\., 1, 3, 4, 3\)"):
        measure_quality(frames, LAYOUT, ("left",))


@pytest.mark.parametrize("pads", [1, 2])
def test_the_picture_shows_intervals_totals_and_one_map_a_pad(pads):
    pytest.importorskip("matplotlib")
    from matplotlib.collections import PolyCollection

    quality = judge(resting(count=300, pads=pads, lost=0.05))
    figure = plot_quality(quality)
    figure.canvas.draw()
    maps = [
        c for ax in figure.axes for c in ax.collections if isinstance(c, PolyCollection) and len(c.get_paths()) == 12
    ]
    assert len(maps) == pads
    assert np.asarray(maps[0].get_array()) == pytest.approx(quality.noise[0].max(axis=0).ravel())
    bars = sum(patch.get_height() for patch in figure.axes[0].patches)
    assert bars == len(quality.intervals)
    assert [len(ax.lines) for ax in figure.axes[1:4]] == [pads] * 3
    still = [replace(f, force=np.zeros_like(f.force)) for f in resting(count=50)]
    plot_quality(judge(still)).canvas.draw()
