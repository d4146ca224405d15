"""What all transforms with memory share beyond the contract, and the examples in their documentation."""

import dataclasses

import numpy as np
import pytest
from responses import both, everywhere, respond, times
from transform_examples import FRAME

from paxisim import augment
from paxisim.augment import Creep, Drift, FailingTaxels, Hysteresis, Latency, LowPass, SampleAndHold

DETERMINISTIC = [
    LowPass(0.05),
    Creep((0.1, -0.05, 0.2), (0.02, 0.3, 5.0)),
    Hysteresis((0.2, 0.1, 0.3), (0.1, 0.5, 1.0)),
    Latency(0.037, capacity=400),
    SampleAndHold(33.3, 0.41),
    Drift(everywhere(0.3), everywhere(0.5), 0.4, 0.1),
]


@pytest.mark.parametrize(
    ("transform", "x", "y"),
    [
        (Creep((0.2,), (1.0,)), [0, 1, 1, 1], [0, 1.074, 1.153, 1.183]),
        (Hysteresis((0.5,), (0.2,)), [0, 1, 0.8, 0], [0, 0.9, 0.8, 0.1]),
        (Latency(1.5), [0, 1, 4, 9], [0, 0, 0.5, 2.5]),
        (SampleAndHold(0.4), [0, 1, 4, 9], [0, 0, 0, 6.5]),
        (Drift(everywhere(0.01), everywhere(0.1), 1.0), [0, 0, 0, 0], [0, 0.0732, 0.1065, 0.125]),
        (FailingTaxels(stuck=[[[1.0]]], value=everywhere(0.5), since=2.0), [0, 3, 4, 0], [0, 3, 0.5, 0.5]),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_the_worked_examples(transform, x, y):
    np.testing.assert_allclose(respond(transform, x, np.arange(4.0)), y, rtol=0, atol=0.51e-3)


@pytest.mark.parametrize("transform", DETERMINISTIC, ids=lambda transform: transform.name)
@both
def test_frames_in_between_change_nothing(transform, kind):
    """x is linear between frames, so ten times as many frames, or the same frame again, give the same readings."""
    time, x = times(kind, 1.0, 40, seed=5), np.random.default_rng(0).normal(size=40)
    fine = np.unique(np.concatenate([np.interp(np.arange(0, 39, 0.1), np.arange(40), time), time]))
    y = respond(transform, np.interp(fine, time, x), fine)
    tolerance = 1e-10 if not isinstance(transform, SampleAndHold) else 2e-2  # a tick is moved by up to 1e-4 periods
    expected = respond(transform, x, time)
    np.testing.assert_allclose(y[np.searchsorted(fine, time)], expected, atol=tolerance)
    again = respond(transform, np.repeat(x, 3), np.repeat(time, 3))
    np.testing.assert_allclose(again.reshape(40, 3), np.stack([expected] * 3, axis=1), atol=1e-12)


# drift


@both
@pytest.mark.parametrize("start", [0.0, 42.0])
def test_drift_curve(kind, start):
    time = times(kind, 500.0)
    t = start + time
    x = np.sin(time)
    y = respond(Drift(everywhere(1e-3), everywhere(-0.5), 100.0, start), x, time)
    np.testing.assert_allclose(y, x + 1e-3 * t + 0.5 * np.expm1(-t / 100), atol=1e-12)
    at_once = Drift(amplitude=everywhere(0.5), tau=0.0, start=start)
    np.testing.assert_allclose(respond(at_once, x, time), x + 0.5, err_msg="without time constant: an offset")


def test_time_is_kept_over_a_day_in_float32():
    drift, fails = Drift(everywhere(1e-3)), FailingTaxels(dead=np.ones((1, 1, 1)), since=86_400.5)
    x = np.ones(FRAME, np.float32)
    drifted, failed = drift.initial_state(x), fails.initial_state(x)
    _, drifted = drift.step(x, drifted, 86_400.0)
    y, failed = fails.step(x, failed, 86_400.0)
    np.testing.assert_array_equal(y, x)
    for _ in range(1000):
        z, drifted = drift.step(x, drifted, 0.001)
        y, failed = fails.step(x, failed, 0.001)
    np.testing.assert_allclose(drifted[0], 86_401.0, atol=1e-6)
    np.testing.assert_allclose(z - x, 86.401, rtol=1e-6)
    assert not y.any()


def test_temperature():
    x, rng = np.random.default_rng(0).normal(size=(4, *FRAME)), np.random.default_rng(1)
    offset, temperature = rng.normal(size=FRAME), np.array([25.0, 26.0, 35.0, 5.0])
    drift = augment.TemperatureDrift(-1e-3, offset, 25.0)
    expected = np.stack([x[i] * (1 - 1e-3 * t) + offset * t for i, t in enumerate(temperature - 25)])
    np.testing.assert_allclose(drift.run(x, np.arange(4), {"temperature": temperature}), expected, atol=1e-12)
    other = dataclasses.replace(drift, covariate="motor_temperature")
    assert other.covariate_names == ("motor_temperature",)
    np.testing.assert_allclose(other(x, {"motor_temperature": temperature}), expected, atol=1e-12)


# taxels that fail at some time


def test_failing_taxels_fail_each_at_its_own_moment_as_dead_taxels_do():
    rng = np.random.default_rng(1)
    faults = (rng.random((2, 6, 5)) < 0.3, rng.random((2, 6, 5)) < 0.3, rng.normal(size=FRAME))
    x, time = rng.normal(size=(5, *FRAME)), np.arange(5.0)
    np.testing.assert_array_equal(FailingTaxels(*faults, since=-1.0).run(x, time), augment.DeadTaxels(*faults)(x))
    since = np.reshape([1.0, np.inf, 3.0], (1, 3, 1, 1))
    y = FailingTaxels(dead=np.ones((1, 1, 1)), since=since).run(x, time)
    gone = time[:, None] >= since.ravel()
    np.testing.assert_array_equal(y, np.where(gone[:, None, :, None, None], 0, x))
