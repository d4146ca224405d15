"""Properties shared by all transforms with memory; the physics of each is tested in its own file."""

import dataclasses

import numpy as np
import pytest
from optional import needs_torch, torch
from responses import both, everywhere, respond, times
from transform_examples import FRAME

from paxisim.augment.creep import Creep
from paxisim.augment.drift import Drift
from paxisim.augment.hysteresis import Hysteresis
from paxisim.augment.latency import Latency
from paxisim.augment.low_pass import LowPass
from paxisim.augment.noise import RandomWalk, WhiteNoise
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.sample_and_hold import SampleAndHold

DETERMINISTIC = [
    LowPass(0.05),
    Creep((0.1, -0.05, 0.2), (0.02, 0.3, 5.0)),
    Hysteresis((0.2, 0.1, 0.3), (0.1, 0.5, 1.0)),
    Latency(0.037, capacity=12),
    SampleAndHold(33.0, 0.4),
    Drift(everywhere(0.3), everywhere(0.5), 0.4, 0.1),
]
ALL = [*DETERMINISTIC, Latency(0.02, 0.004, 5), WhiteNoise(everywhere(0.2), 5), RandomWalk(everywhere(0.5), 5)]
NAMES = [transform.name for transform in DETERMINISTIC]

deterministic = pytest.mark.parametrize("transform", DETERMINISTIC, ids=NAMES)
every = pytest.mark.parametrize("transform", ALL, ids=[*NAMES, "JitteryLatency", "WhiteNoise", "RandomWalk"])


@pytest.mark.parametrize(
    ("transform", "x", "y"),
    [
        (Creep((0.2,), (1.0,)), [0, 1, 1, 1], [0, 1.074, 1.153, 1.183]),
        (Hysteresis((0.5,), (0.2,)), [0, 1, 0.8, 0], [0, 0.9, 0.8, 0.1]),
        (Latency(1.5), [0, 1, 4, 9], [0, 0, 0.5, 2.5]),
        (SampleAndHold(0.4), [0, 1, 4, 9], [0, 0, 0, 6.5]),
        (Drift(everywhere(0.01), everywhere(0.1), 1.0), [0, 0, 0, 0], [0, 0.0732, 0.1065, 0.1250]),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_worked_example(transform, x, y):
    decimals = 4 if transform.name == "Drift" else 3
    np.testing.assert_allclose(respond(transform, x, np.arange(4.0)), y, rtol=0, atol=0.51 * 10.0**-decimals)


@deterministic
@both
def test_frames_in_between_change_nothing(transform, kind):
    """x is linear between frames, so ten times as many frames give the same readings."""
    time, x = times(kind, 1.0, 40, seed=5), np.random.default_rng(0).normal(size=40)
    if isinstance(transform, Latency):
        transform = dataclasses.replace(transform, capacity=400)
    if isinstance(transform, SampleAndHold):
        transform = SampleAndHold(33.3, 0.41)
    fine = np.unique(np.concatenate([np.interp(np.arange(0, 39, 0.1), np.arange(40), time), time]))
    y = respond(transform, np.interp(fine, time, x), fine)
    at = np.searchsorted(fine, time)
    tolerance = 1e-10 if not isinstance(transform, SampleAndHold) else 2e-2  # a tick is moved by up to 1e-4 periods
    np.testing.assert_allclose(y[at], respond(transform, x, time), atol=tolerance)


@deterministic
def test_a_frame_again_in_no_time_changes_nothing(transform):
    x, time = np.random.default_rng(0).normal(size=(20, *FRAME)), times("irregular", 1.0, 20)
    y = transform.run(np.repeat(x, 3, axis=0), np.repeat(time, 3))
    for i in range(3):
        np.testing.assert_allclose(y[i::3], transform.run(x, time), atol=1e-12)


@every
def test_each_environment_has_its_own_time(transform):
    rng = np.random.default_rng(0)
    x, time = rng.normal(size=(20, 3, *FRAME)), np.stack([times("irregular", 1.0 + i, 20, i) for i in range(3)], axis=1)
    if "seed" in parameters(transform):
        transform = dataclasses.replace(transform, seed=np.array([1, 2, 3]))
    state, y = transform.initial_state(x[0]), []
    for i, dt in enumerate(np.diff(time, axis=0, prepend=0.0)):
        frame, state = transform.step(x[i], state, dt)
        y.append(frame)
    for i in range(3):
        alone = transform
        if "seed" in parameters(transform):
            alone = dataclasses.replace(transform, seed=int(transform.seed[i]))
        np.testing.assert_allclose(np.stack(y)[:, i], alone.run(x[:, i], time[:, i]), atol=1e-12)


@every
def test_stepping_is_running(transform):
    x, time = np.random.default_rng(0).normal(size=(20, 3, *FRAME)), times("irregular", 1.0, 20)
    state = transform.initial_state(x[0])
    y = transform.run(x, time)
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        frame, state = transform.step(x[i], state, dt)
        np.testing.assert_allclose(frame, y[i], rtol=1e-12, atol=1e-13)


@every
def test_one_environment_of_a_batch_begins_anew(transform):
    x, time = np.random.default_rng(0).normal(size=(20, 3, *FRAME)), times("irregular", 1.0, 20)
    mask = np.array([False, True, False])
    y = transform.run(x, time)
    fresh = transform.run(x[10:], time[10:])
    state = transform.initial_state(x[0])
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        dts = np.full(3, dt)
        if i == 10:
            state = transform.reset(state, mask, x[i])
            dts[mask] = 0
        frame, state = transform.step(x[i], state, dts)
        np.testing.assert_allclose(frame[~mask], y[i][~mask], rtol=1e-12, atol=1e-13)
        if i >= 10:
            np.testing.assert_allclose(frame[mask], fresh[i - 10][mask], rtol=1e-12, atol=1e-13)


@every
def test_the_caller_may_use_its_memory_again(transform):
    x, time = np.random.default_rng(0).normal(size=(20, *FRAME)), times("irregular", 1.0, 20)
    expected = transform.run(x, time)
    place = x[0].copy()
    state = transform.initial_state(place)
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        place[...] = x[i]
        y, state = transform.step(place, state, dt)
        np.testing.assert_allclose(y, expected[i], rtol=1e-12, atol=1e-13)
        y[...] = np.nan


@every
@pytest.mark.parametrize("dt", [0.0, 1e-9, 1e3, 1e9])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_no_dt_makes_it_fail(transform, dt, dtype):
    x = np.random.default_rng(0).normal(size=(5, *FRAME)).astype(dtype)
    state = transform.initial_state(x[0])
    for frame in x:
        y, state = transform.step(frame, state, dt)
        assert y.dtype == dtype
        assert np.all(np.isfinite(y))


@deterministic
def test_time_constants_next_to_nothing(transform):
    x, time = np.random.default_rng(0).normal(size=(5, *FRAME)).astype(np.float32), np.arange(5) * 0.1
    for name, about in parameters(transform).items():
        if about.unit in ("s", "N") and not set(about.core) & set("pkrc"):
            for value in (0.0, 1e-300, 1e-42, 1e-30, 1e-12):
                shape = np.shape(getattr(transform, name))
                changed = dataclasses.replace(transform, **{name: np.full(shape, value)})
                assert np.all(np.isfinite(changed.run(x, time)))


@needs_torch
@every
def test_torch_gives_the_same(transform):
    x, time = np.random.default_rng(0).normal(size=(20, 3, *FRAME)), times("irregular", 1.0, 20)
    y = transform.run(torch.as_tensor(x), time)
    np.testing.assert_allclose(y, transform.run(x, time), rtol=0, atol=1e-12)


@needs_torch
@every
def test_compiled_whole(transform):
    x, time = np.random.default_rng(0).normal(size=(6, 3, *FRAME)), times("irregular", 0.3, 6)
    tensor, expected = torch.as_tensor(x), transform.run(x, time)
    torch.compiler.reset()
    step = torch.compile(lambda x, state, dt: transform.step(x, state, dt), fullgraph=True, backend="aot_eager")
    begin = torch.compile(lambda x: transform.initial_state(x), fullgraph=True, backend="aot_eager")
    reset = torch.compile(lambda state, mask, x: transform.reset(state, mask, x), fullgraph=True, backend="aot_eager")
    state = begin(tensor[0])
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        y, state = step(tensor[i], state, torch.full((3,), dt, dtype=torch.float64))
        np.testing.assert_allclose(y, expected[i], rtol=0, atol=1e-12)
    state = reset(state, torch.tensor([True, False, True]), tensor[0])
    y, _ = step(tensor[0], state, torch.zeros(3, dtype=torch.float64))
    np.testing.assert_allclose(y[[0, 2]], expected[0][[0, 2]], rtol=0, atol=1e-12)


@needs_torch
@every
def test_under_vmap(transform):
    x, time = torch.as_tensor(np.random.default_rng(0).normal(size=(6, 3, *FRAME))), times("irregular", 0.3, 6)
    has_seed = "seed" in parameters(transform)
    seeds = torch.tensor([4, 5, 6])

    def with_seed(seed):
        return dataclasses.replace(transform, seed=seed) if has_seed else transform

    state = torch.vmap(lambda x: transform.initial_state(x))(x[0])
    expected = with_seed(seeds).run(x, time)
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        dts = torch.full((3,), dt, dtype=torch.float64)
        y, state = torch.vmap(lambda seed, x, state, dt: with_seed(seed).step(x, state, dt))(seeds, x[i], state, dts)
        torch.testing.assert_close(y, expected[i], rtol=0, atol=1e-12)
