"""Zero drift with time and with temperature."""

import dataclasses

import numpy as np
import pytest
from responses import both, everywhere, respond, times
from transform_examples import FRAME

from paxisim.augment.drift import Drift
from paxisim.augment.temperature import TemperatureDrift


@both
@pytest.mark.parametrize("start", [0.0, 42.0])
def test_drift_curve(kind, start):
    time = times(kind, 500.0)
    t = start + time
    x = np.sin(time)
    y = respond(Drift(everywhere(1e-3), everywhere(-0.5), 100.0, start), x, time)
    np.testing.assert_allclose(y, x + 1e-3 * t + 0.5 * np.expm1(-t / 100), atol=1e-12)


def test_a_warm_up_without_time_constant_is_an_offset():
    time = times("irregular", 10.0, 20)
    np.testing.assert_allclose(respond(Drift(amplitude=everywhere(0.5), tau=0.0), time, time), time + 0.5)


def test_each_element_drifts_by_itself():
    rate = np.random.default_rng(0).normal(size=FRAME)
    x = np.zeros((3, *FRAME))
    np.testing.assert_allclose(Drift(rate).run(x, [0.0, 1.0, 3.0]), np.array([0, 1, 3]).reshape(-1, 1, 1, 1, 1) * rate)


def test_drift_does_not_lose_time_in_float32():
    drift = Drift(everywhere(1e-3))
    x = np.zeros(FRAME, np.float32)
    state = drift.initial_state(x)
    _, state = drift.step(x, state, 86_400.0)
    for _ in range(1000):
        y, state = drift.step(x, state, 0.001)
    np.testing.assert_allclose(state[0], 86_401.0, atol=1e-6)
    np.testing.assert_allclose(y, 86.401, rtol=1e-6)


def test_temperature():
    x, rng = np.random.default_rng(0).normal(size=(4, *FRAME)), np.random.default_rng(1)
    offset, temperature = rng.normal(size=FRAME), np.array([25.0, 26.0, 35.0, 5.0])
    drift = TemperatureDrift(-1e-3, offset, 25.0)
    expected = np.stack([x[i] * (1 - 1e-3 * t) + offset * t for i, t in enumerate(temperature - 25)])
    np.testing.assert_allclose(drift.run(x, np.arange(4), {"temperature": temperature}), expected, atol=1e-12)
    np.testing.assert_allclose(drift(x[1], {"temperature": 26.0}), expected[1], atol=1e-12)
    np.testing.assert_array_equal(drift(x[0], {"temperature": 25.0}), x[0])
    other = dataclasses.replace(drift, covariate="motor_temperature")
    assert other.covariate_names == ("motor_temperature",)
    np.testing.assert_array_equal(other(x, {"motor_temperature": temperature}), drift(x, {"temperature": temperature}))
