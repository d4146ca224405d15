"""A problem reads like a sensor, runs episodes independently, and drops frames only where nothing is lost."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from paxisim import augment
from paxisim.diagnose.data import prepare as preparing
from paxisim.diagnose.data.noise import Noise, Tolerance, rate
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.problem import Problem, with_noise
from paxisim.diagnose.rules import FITTING
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording


def problem(step=0.1, dither=0.03, clips=True, frames=60, interval=0.01, cols=3):
    """Return a problem with three episodes of slow pushes."""
    time = np.concatenate([start + interval * np.arange(frames) for start in (0.0, 50.0, 100.0)])
    push = np.tile(np.sin(np.linspace(0, np.pi, frames)) ** 2, 3)
    force = push[:, None, None, None, None] * np.ones((1, 2, 3, 2, cols)) * np.array([0.3, -0.2, 1.0])[:, None, None]
    spans = tuple(slice(k * frames, (k + 1) * frames) for k in range(3))
    alive = np.ones(force.shape[1:], dtype=bool)
    return Problem(force, force, time, {}, spans, Noise(np.full_like(force, 0.03), step, dither, clips), alive, 1.0)


@pytest.mark.parametrize(("step", "dither"), [(0.1, 0.004), (0.1, 0.03), (0.01, 0.03)])
def test_what_is_read_is_the_mean_of_noisy_counts(step, dither):
    made = problem(step, dither)
    level = np.linspace(-0.3, 0.4, 29)
    force = np.broadcast_to(level[:, None, None, None, None], (29, 1, 3, 1, 1)).copy()
    noise = dither * np.random.default_rng(3).standard_normal((20_000, 29))
    counts = np.round((level + noise) / step) * step
    read = made.read(force)[:, 0, :, 0, 0]
    np.testing.assert_allclose(read[:, 0], counts.mean(axis=0), atol=6e-3)
    np.testing.assert_allclose(read[:, 2], np.maximum(counts, 0).mean(axis=0), atol=6e-3)
    pressed = np.linspace(0.02, 0.4, 12).reshape(1, 1, 3, 4) * np.ones((2, 3, 1, 1))
    if dither == 0.03:  # little noise hides the force between two steps
        np.testing.assert_allclose(made.noise.unread(made.read(pressed[None])[0]), pressed, atol=1e-3)


def test_what_is_left_of_readings_is_known():
    dither = 0.06
    counting = problem(0.1, dither, clips=False).noise
    rng = np.random.default_rng(2)
    force = rng.uniform(-0.05, 0.05, (50_000, 1, 3, 1, 1))
    counts = np.round((force + dither * rng.standard_normal(force.shape)) / 0.1) * 0.1
    assert counting.left == pytest.approx(np.mean((counts - counting.read(force)) ** 2), rel=0.02)


def test_episodes_that_are_sampled_alike_run_as_each_would_alone():
    made = problem()
    chain = augment.Chain([augment.Creep((0.2,), (0.3,)), augment.Hysteresis((0.1,), (0.05,)), augment.LowPass(0.02)])
    alone = [chain.run(made.simulated[span], made.time[span]) for span in made.episodes]
    np.testing.assert_allclose(made.run(chain, made.simulated), np.concatenate(alone), atol=1e-12)
    own = replace(made, time=np.concatenate([made.time[span] - made.time[span.start] for span in made.episodes]))
    np.testing.assert_allclose(own.run(chain, own.simulated), made.run(chain, made.simulated), atol=1e-12)
    shifted = replace(made, time=made.time + 1e-3 * np.sin(np.arange(len(made.time))))
    alone = [chain.run(shifted.simulated[span], shifted.time[span]) for span in shifted.episodes]
    np.testing.assert_allclose(shifted.run(chain, shifted.simulated), np.concatenate(alone), atol=1e-3)


@pytest.mark.parametrize(
    ("pause", "released", "remembered"), [(5.0, True, True), (40.0, True, False), (5.0, False, False)]
)
def test_a_press_is_remembered_over_a_short_pause_at_rest(pause, released, remembered):
    made = problem()
    time = made.time - (made.time // 50) * (50 - 0.6 - pause)
    force = made.simulated if released else made.simulated + 0.1
    made = replace(made, time=time, simulated=force)
    creep = augment.Creep((0.4,), (6.0,))
    through = creep.run(force, time)
    alone = np.concatenate([creep.run(force[span], time[span]) for span in made.episodes])
    assert np.abs(through - alone).max() > 1e-6
    np.testing.assert_allclose(made.run(creep, force), through if remembered else alone, atol=1e-9)
    assert made.runs_on is remembered


def test_a_long_recording_is_read_in_blocks_as_its_frames_are():
    long = problem(frames=8000, interval=0.005)
    for transform in (augment.DeadBand(width=(0.1, 0.2, 0.1), edge=0.3), augment.Crosstalk(strength=(0.05, 0.05, 0.1))):
        whole = transform.run(long.simulated, long.time, {})
        np.testing.assert_allclose(long.run(transform, long.simulated), whole, rtol=0, atol=1e-14)
    frames = slice(None, None, 997)
    read = np.concatenate([long.read(frame[None]) for frame in long.simulated[frames]])
    np.testing.assert_allclose(long.read(long.simulated)[frames], read, rtol=0, atol=1e-14)


def test_samples_of_one_time_have_one_rate():
    time, values = np.array([0.0, 1.0, 1.0, 3.0]), np.array([0.0, 2.0, 9.0, 6.0])
    np.testing.assert_allclose(rate(values, time), np.gradient([0.0, 2.0, 6.0], [0.0, 1.0, 3.0])[[0, 1, 1, 2]])
    np.testing.assert_array_equal(rate(values, np.sort(values)), np.gradient(values, np.sort(values)))
    np.testing.assert_array_equal(rate(values, np.ones(4)), 0)


@pytest.mark.parametrize(("share", "slow"), [(0.3, 0.0), (0.65, 0.8), (1.5, 0.8)])
def test_the_noise_of_coarse_counts_is_found_however_seldom_they_change(share, slow):
    made = problem(frames=300)
    pressed = np.tile(np.arange(300) >= 150, 3)
    force = made.simulated * pressed[:, None, None, None, None]
    fresh = np.random.default_rng(2).standard_normal(force.shape)
    noise = share * made.noise.step * lfilter([np.sqrt(1 - slow**2)], [1, -slow], fresh, axis=0)
    counted = made.noise.step * np.round((force + noise) / made.noise.step)
    read = with_noise(replace(made, measured=counted, simulated=force))
    fast = np.sqrt(1 - slow) if share > 1 else 1.0  # visible changes reveal only the fast part of the noise
    true = np.median(counted[~pressed][:, :, :2].std(axis=0))
    assert 0.7 * fast < np.median(read.noise.sigma[~pressed][:, :, :2]) / true < 1.4


def test_noise_that_is_not_finite_is_refused():
    made = problem()
    tolerant = replace(made, noise=replace(made.noise, tolerance=Tolerance(gain=np.inf)))
    with np.errstate(all="ignore"), pytest.raises(InvalidValueError, match="not finite"):
        with_noise(tolerant)


def test_frames_are_left_out_only_of_a_recording_that_has_many_and_runs_straight():
    assert problem().thinned.sampling.fitted == 1
    long = problem(frames=4000, cols=8, interval=0.005)
    assert long.samples > 2 * FITTING.values
    assert long.sampling.fitted > 1
    assert len(long.thinned.time) == sum(len(range(0, 4000, long.sampling.fitted)) for _ in long.episodes)
    shaking = 0.2 * np.random.default_rng(0).random((len(long.time), 1, 1, 1, 1))
    rough = replace(long, simulated=long.simulated + shaking)
    assert rough.sampling.fitted == 1


def test_a_recording_that_is_too_long_is_shortened_and_says_so(monkeypatch):
    monkeypatch.setattr(preparing, "MAX_VALUES", 20_000)
    made = problem(frames=400, cols=4)
    noise = 0.01 * np.random.default_rng(4).standard_normal(made.measured.shape)
    recording = Recording(made.time, made.measured + noise, made.simulated, {}, np.repeat(np.arange(3), 400))
    shortened, warnings = prepare(recording)
    assert any("the recording is long" in warning for warning in warnings)
    assert len(np.unique(shortened.episode)) == 3
    assert shortened.measured.size <= 2 * 20_000
