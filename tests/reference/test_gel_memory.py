"""Gel memory: analytic solutions of the standard linear solid, rate-independent loops, and streams."""

import numpy as np
import pytest

import paxisim
from paxisim import GelMemory, MagneticSensor
from paxisim.reference.memory import at_rest, step

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
AREA = 20e-6
ARM = GelMemory(shares=(0.3,), times=(2.0,), friction=0.0)
RUBBING = GelMemory(shares=(), times=(), friction=0.5, slip=5e3)  # the slider slips from 0.1 N


def stream(memory, loads, time):
    """Return the ``(T, 3)`` deformation (N) of one taxel under ``(T, 3)`` loads (N)."""
    frames = np.asarray(loads, dtype=float)[:, None, :, None, None]
    state, found = at_rest(memory, AREA, frames[0]), []
    for frame, dt in zip(frames, np.diff(time, prepend=time[0]), strict=True):
        deformed, state = step(memory, AREA, frame, state, dt)
        found.append(deformed[0, :, 0, 0])
    return np.array(found)


def normal(values):
    values = np.asarray(values, dtype=float)
    return np.stack([np.zeros_like(values), np.zeros_like(values), values], axis=-1)


def test_a_held_load_creeps_as_the_standard_linear_solid_does():
    time = np.concatenate([[0.0, 0.0], np.linspace(0.01, 12, 1200)])
    deformed = stream(ARM, normal([0.0, *np.ones(1201)]), time)[1:, 2]
    share, tau = 0.3, 2.0
    analytic = 1 - share / (1 + share) * np.exp(-time[1:] / (tau * (1 + share)))
    np.testing.assert_allclose(deformed, analytic, atol=1e-4)


def test_a_deformation_that_is_held_relaxes_as_the_standard_linear_solid_does():
    """The analytically relaxing load, sampled at irregular times, keeps the deformation constant."""
    rng = np.random.default_rng(0)
    time = np.concatenate([[0.0, 0.0], np.cumsum(rng.uniform(0.005, 0.05, 400))])
    loads = np.concatenate([[0.0], 1 + 0.3 * np.exp(-time[1:] / 2.0)])
    np.testing.assert_allclose(stream(ARM, normal(loads), time)[1:, 2], 1.0, atol=2e-4)


def test_steps_of_any_length_end_in_the_same_deformation():
    ramp = [np.linspace(0, 3, count) for count in (10, 1000)]
    rng = np.random.default_rng(1)
    ramp.append(np.sort(np.concatenate([[0, 3], rng.uniform(0, 3, 200)])))
    memory = GelMemory(friction=0.0)
    ends = [stream(memory, normal(0.4 * time), time)[-1, 2] for time in ramp]
    np.testing.assert_allclose(ends, ends[1], rtol=2e-3)
    assert ends[1] < 0.99 * 1.2  # it is still creeping


@pytest.mark.parametrize("seconds", [1.0, 1e4])
def test_a_loop_stays_at_slow_rates_only_where_the_gel_rubs(seconds):
    phase = np.linspace(0, 4 * np.pi, 2001)
    loads, time = 0.5 * (1 - np.cos(phase)), seconds * phase / (2 * np.pi)
    second = slice(1000, 2001)

    def area(memory):
        deformed = stream(memory, normal(loads), time)[second, 2]
        mean = (deformed[1:] + deformed[:-1]) / 2
        return abs(np.sum(mean * np.diff(loads[second])))

    assert area(RUBBING) == pytest.approx(4 * 0.5 * 0.1 * (0.5 - 0.1 * 1.5), rel=0.05)
    assert (area(ARM) < 1e-3) == (seconds > 100)


def test_the_slider_follows_a_vector_in_any_direction():
    rng = np.random.default_rng(2)
    loads = np.cumsum(rng.normal(0, 0.1, (50, 3)), axis=0)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    time = np.arange(50) / 50
    memory = GelMemory()
    np.testing.assert_allclose(stream(memory, loads @ turn, time), stream(memory, loads, time) @ turn, atol=1e-12)


def test_a_rubbing_gel_is_stiffer_within_the_slip_and_shifted_beyond_it():
    small = stream(RUBBING, normal([0.0, 0.06]), [0.0, 1.0])[1, 2]
    assert small == pytest.approx(0.06 / 1.5)
    large = stream(RUBBING, normal([0.0, 2.0]), [0.0, 1.0])[1, 2]
    assert large == pytest.approx(2.0 - 0.5 * 0.1)


def test_a_sensor_with_memory_keeps_a_state_for_each_member_of_a_batch():
    sensor = MagneticSensor(LAYOUT, unit=7, memory=GelMemory())
    force = np.random.default_rng(3).uniform(0, 0.5, (6, 4, 2, 3, 6, 5))
    time = np.array([0.0, 0.02, 0.05, 1.0, 1.1, 4.0])
    assert paxisim.Chain([sensor, paxisim.augment.Firmware()]).has_memory
    with pytest.raises(paxisim.InvalidValueError, match="remembers earlier frames"):
        sensor(force[0])
    clocks = sensor.run(force, np.stack([time, time, time * 2, time], axis=1))
    np.testing.assert_allclose(clocks[:, 0], sensor.run(force[:, 0], time), atol=1e-9)
    np.testing.assert_allclose(clocks[:, 2], sensor.run(force[:, 2], time * 2), atol=1e-9)
    _, later = sensor.step(force[1], sensor.initial_state(force[0]), 0.5)
    mask = np.array([True, False, True, False])
    afresh = sensor.initial_state(force[2])
    for got, new, old in zip(sensor.reset(later, mask, force[2]), afresh, later, strict=True):
        np.testing.assert_array_equal(got[mask], new[mask])
        np.testing.assert_array_equal(got[~mask], old[~mask])
    # without friction, the reading of a gel at rest is that of a sensor without memory
    still = MagneticSensor(LAYOUT, unit=7, memory=GelMemory(friction=0.0)).run(force[:1], time[:1])
    np.testing.assert_allclose(still[0], MagneticSensor(LAYOUT, unit=7)(force[0]), atol=1e-9)


def test_torch_remembers_as_numpy_does():
    torch = pytest.importorskip("torch")
    sensor = MagneticSensor(LAYOUT, unit=7, memory=GelMemory())
    force = np.random.default_rng(4).uniform(-0.2, 0.5, (5, 3, 2, 3, 6, 5))
    force[1] = 0.0
    time = np.array([0.0, 0.02, 0.05, 1.0, 1.1])
    tensor = torch.as_tensor(force).requires_grad_()
    read = sensor.run(tensor, time)
    np.testing.assert_allclose(read.detach().numpy(), sensor.run(force, time), atol=1e-9)
    read.sum().backward()
    assert bool(torch.isfinite(tensor.grad).all())


def test_a_memory_that_cannot_be_is_refused():
    for wrong, said in (
        ({"shares": (0.1,), "times": (1.0, 2.0)}, "a time for each share"),
        ({"shares": (-0.1,), "times": (1.0,)}, "shares must be 0 or more"),
        ({"shares": (0.1,), "times": (0.0,)}, "times must be positive"),
        ({"friction": float("nan")}, "friction must be"),
        ({"slip": 0.0}, "slip must be positive"),
    ):
        with pytest.raises(paxisim.InvalidValueError, match=said):
            GelMemory(**wrong)
