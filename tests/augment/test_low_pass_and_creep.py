"""Low-pass and creep compared with their analytic responses."""

import numpy as np
import pytest
from responses import both, respond, times, with_jump
from transform_examples import FRAME

from paxisim.augment.creep import Creep
from paxisim.augment.hysteresis import Hysteresis
from paxisim.augment.low_pass import LowPass
from paxisim.errors import InvalidValueError


@both
def test_step_response(kind):
    time = times(kind, 10.0)
    x, t = with_jump(time)
    np.testing.assert_allclose(respond(LowPass(0.7), x, t)[1:], 1 - np.exp(-time / 0.7), atol=1e-12)
    amplitude, tau = np.array([0.1, 0.2, -0.05]), np.array([0.05, 1.5, 40.0])
    expected = 1 + (amplitude * -np.expm1(-time[:, None] / tau)).sum(1)
    np.testing.assert_allclose(respond(Creep(amplitude, tau), x, t)[1:], expected, atol=1e-12)


@both
def test_ramp_response(kind):
    time = times(kind, 10.0)
    amplitude, tau = np.array([0.1, 0.2, -0.05]), np.array([0.05, 1.5, 40.0])
    modes = time[:, None] + tau * np.expm1(-time[:, None] / tau)
    np.testing.assert_allclose(respond(LowPass(1.5), time, time), modes[:, 1], atol=1e-12)
    np.testing.assert_allclose(respond(Creep(amplitude, tau), time, time), time + modes @ amplitude, atol=1e-11)


def test_sine_response():
    """The steady state follows the transfer function; linear interpolation shrinks a sine by (w dt)^2 / 12."""
    time, omega = np.linspace(0, 40, 8001), 3.0
    phasor = np.exp(1j * omega * time)
    tau, amplitude = np.array([0.1, 0.5]), np.array([0.3, 0.1])
    for transform, gain in (
        (LowPass(0.5), 1 / (1 + 0.5j * omega)),
        (Creep(amplitude, tau), 1 + (amplitude / (1 + 1j * omega * tau)).sum()),
    ):
        y = respond(transform, np.sin(omega * time), time)
        np.testing.assert_allclose(y[2000:], (gain * phasor).imag[2000:], atol=1e-4)


def test_creep_that_is_over_and_gains():
    creep = Creep((0.1, 0.2), (0.5, 5.0))
    x = np.random.default_rng(0).normal(size=FRAME)
    y, state = creep.step(x, creep.initial_state(x), 0.0)
    np.testing.assert_allclose(y, 1.3 * x, rtol=1e-12)
    y, _ = creep.step(x, state, 1e3)
    np.testing.assert_allclose(y, 1.3 * x, rtol=1e-12)
    y, _ = creep.step(x + 1, state, 0.0)
    np.testing.assert_allclose(y, 1.3 * x + 1, rtol=1e-12)


def test_creep_without_time_constant_is_a_gain():
    x = np.random.default_rng(0).normal(size=(20, *FRAME))
    y = Creep((0.2,), (0.0,)).run(x, np.arange(20) * 0.1)
    np.testing.assert_allclose(y, 1.2 * x, rtol=1e-12)


def test_creep_is_a_sum_of_low_passes():
    x, time = np.random.default_rng(0).normal(size=(50, *FRAME)), times("irregular", 5.0, 50)
    y = Creep((0.1, 0.3), (0.2, 1.0)).run(x, time)
    np.testing.assert_allclose(y, x + 0.1 * LowPass(0.2).run(x, time) + 0.3 * LowPass(1.0).run(x, time), atol=1e-12)


def test_slow_creep_does_not_stall_in_float32():
    """At 100 Hz and a time constant of 60 s, each increment is tiny compared with the state."""
    time = np.arange(12_000) * 0.01
    x, t = with_jump(time)
    y = respond(Creep((0.25,), (60.0,)), 20 * x, t, np.float32)[1:]
    np.testing.assert_allclose(y, 20 * (1 + 0.25 * -np.expm1(-time / 60)), rtol=1e-4)


def test_one_of_the_parameters_may_serve_all_modes():
    x, time = np.random.default_rng(0).normal(size=(9, *FRAME)), times("irregular", 1.0, 9)
    for short, long in (
        (Creep((0.1,), (0.1, 0.2)), Creep((0.1, 0.1), (0.1, 0.2))),
        (Creep((0.1, 0.2), (0.1,)), Creep((0.1, 0.2), (0.1, 0.1))),
        (Hysteresis((0.1,), (0.1, 0.2)), Hysteresis((0.1, 0.1), (0.1, 0.2))),
        (Hysteresis((0.1, 0.2), (0.1,)), Hysteresis((0.1, 0.2), (0.1, 0.1))),
    ):
        np.testing.assert_array_equal(short.run(x, time), long.run(x, time))


@pytest.mark.parametrize(("kind", "names"), [(Creep, ("amplitude", "tau")), (Hysteresis, ("weight", "radius"))])
def test_modes_that_do_not_agree_are_refused(kind, names):
    with pytest.raises(InvalidValueError, match=rf"^{kind.__name__}: .* got 2 in {names[0]}, 3 in {names[1]}"):
        kind((0.1, 0.1), (0.1, 0.2, 0.3))
    with pytest.raises(InvalidValueError, match=f"^{kind.__name__}: .* 0 in {names[0]}"):
        kind((), (0.1,))
    with pytest.raises(InvalidValueError, match=rf"^{kind.__name__}: {names[0]} must have shape \(..., modes\)"):
        kind(0.1, (0.1,))


@pytest.mark.parametrize("frames", [1, 2, 3, 50, 101, 400])
@pytest.mark.parametrize("batch", [(), (60,)])  # frames small enough for parallel stretches, and larger ones
@pytest.mark.parametrize("transform", [LowPass(0.05), Creep((0.2, -0.1), (1e-4, 3.0)), LowPass(1e4)])
def test_a_long_sequence_runs_as_it_steps(transform, frames, batch):
    rng = np.random.default_rng(frames)
    x = rng.normal(size=(frames, *batch, *FRAME)).cumsum(axis=0)
    time = np.cumsum(np.where(rng.random(frames) < 0.1, 0.0, rng.uniform(0.001, 0.03, frames)))  # some times repeat
    y, state = transform.run(x, time), transform.initial_state(x[0])
    for frame, dt, ran in zip(x, np.diff(time, prepend=time[0]), y, strict=True):
        stepped, state = transform.step(frame, state, dt)
        np.testing.assert_allclose(ran, stepped, rtol=1e-11, atol=1e-12)
