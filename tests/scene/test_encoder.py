"""Force error caused by encoder steps: a replay estimates it, and a diagnosis allows for it."""

import numpy as np
import pytest
from scene.rigs import LAYOUT, press, recording, steps_of

import paxisim
from paxisim.diagnose.data.problem import problem_of
from paxisim.scene import ready
from paxisim.scene.encoder import EncoderError

SCENE = ready.indenter(LAYOUT)


@pytest.fixture(scope="module")
def replays():
    """The same press, exact and read by encoders with steps of 0.05 mm, which measured the exact forces plus noise."""
    time, streams = press(seconds=4.0)
    exact = SCENE.simulate(recording(time, streams))
    noise = np.random.default_rng(0).normal(0, 0.003, exact.simulated.shape)
    read = recording(time, {n: steps_of(v) for n, v in streams.items()}, measured=exact.simulated + noise)
    return exact, SCENE.simulate(read)


def test_the_error_of_a_replay_is_what_it_says_and_no_more_than_twice_less(replays):
    exact, coarse = replays
    error = EncoderError.from_recording(coarse)
    assert error is not None
    off, force = (tensor.astype(float)[:, :, 2].sum(axis=(1, 2, 3)) for tensor in (
        coarse.simulated - exact.simulated, coarse.simulated
    ))  # fmt: skip
    for low, high in ((0.01, 0.1), (0.1, 0.5), (0.5, 1.0)):
        inside = (force > low * error.peak) & (force <= high * error.peak)
        told = np.sqrt(np.mean((np.interp(force[inside], error.forces, error.shares) * force[inside]) ** 2))
        assert 0.3 * told < np.sqrt(np.mean(off[inside] ** 2)) < 1.2 * told


def test_it_is_written_so_that_a_file_keeps_it(replays, tmp_path):
    replays[1].save(tmp_path / "paired.npz")
    loaded = paxisim.Recording.load(tmp_path / "paired.npz")
    assert EncoderError.from_recording(loaded) == EncoderError.from_recording(replays[1])


def test_what_says_nothing_of_encoders_is_no_error(replays):
    exact, _ = replays
    assert EncoderError.from_recording(exact) is None, "no steps"
    for said in (None, "much", {}, {"newtons": 1.0, "peak": 2.0, "episode": 0}, 3):
        metadata = {"replay": {"encoder_error": said}}
        assert (
            EncoderError.from_recording(paxisim.Recording(exact.time, simulated=exact.simulated, metadata=metadata))
            is None
        )
    assert EncoderError.from_recording(paxisim.Recording(exact.time, simulated=exact.simulated)) is None


def test_a_diagnosis_tolerates_as_much_as_the_steps_are_worth(replays):
    _, coarse = replays
    error = EncoderError.from_recording(coarse)
    with_steps = problem_of(coarse)
    without = problem_of(coarse.with_simulated(coarse.simulated, replay={}))
    more = with_steps.noise.sigma**2 - without.noise.sigma**2
    x = coarse.simulated.astype(float)
    np.testing.assert_allclose(more, error.variance(x), atol=1e-9)
    at_peak = int(np.argmax(x[:, :, 2].sum(axis=(1, 2, 3))))
    shared = np.sqrt(more[at_peak][np.abs(x[at_peak]) > 0.1]) / np.abs(x[at_peak][np.abs(x[at_peak]) > 0.1])
    np.testing.assert_allclose(shared, shared[0], rtol=1e-6)
    assert shared[0] > 0.05
    assert not more[~x.any(axis=(1, 2, 3, 4))].any(), "without contact nothing changes"
