"""Processing long arrays in blocks gives the same result as processing them whole."""

import numpy as np
import pytest

from paxisim import augment
from paxisim.diagnose.blocks import BLOCK_VALUES, in_blocks
from paxisim.diagnose.problem import Problem

SHAPE = (2, 3, 6, 5)
FRAMES = 3 * BLOCK_VALUES // 180 + 7  # three blocks and a remainder


@pytest.fixture
def problem():
    rng = np.random.default_rng(5)
    force = rng.normal(0, 1.5, (FRAMES, *SHAPE))
    time = 0.01 * np.arange(FRAMES)
    opening = {"gripper_opening": rng.uniform(0, 0.08, FRAMES)}
    alive = np.ones(SHAPE, dtype=bool)
    return Problem(force, force, time, opening, (slice(0, FRAMES),), np.full_like(force, 0.05), 2.0, alive, 0.1, 0.03)


@pytest.mark.parametrize("frames", [0, 1, BLOCK_VALUES // 180, BLOCK_VALUES // 180 + 1, FRAMES])
def test_every_frame_is_gone_through_once(frames):
    values = np.random.default_rng(frames).normal(size=(frames, *SHAPE))
    seen = []

    def function(part):
        seen.extend(range(frames)[part])
        return 2 * values[part]

    np.testing.assert_array_equal(in_blocks(values, function), 2 * values)
    assert seen == list(range(frames))


def test_a_frame_larger_than_a_block_is_gone_through_alone():
    values = np.ones((3, BLOCK_VALUES + 1))
    np.testing.assert_array_equal(in_blocks(values, lambda part: values[part] + 1), values + 1)


@pytest.mark.parametrize(
    "transform",
    [
        augment.DeadBand(width=(0.1, 0.2, 0.1), edge=0.3),
        augment.Interference(linear=((3.0, -2.0, 1.0),), quadratic=((40.0, 0.0, 9.0),)),
        augment.Crosstalk(strength=(0.05, 0.05, 0.1)),
    ],
)
def test_a_transform_without_memory_runs_as_on_the_whole(problem, transform):
    whole = transform.run(problem.simulated, problem.time, problem.covariates)
    np.testing.assert_allclose(problem.run(transform, problem.simulated), whole, rtol=0, atol=1e-14)


def test_a_sensor_reads_a_block_as_it_reads_the_whole(problem):
    read = problem.read(problem.simulated)
    assert not np.array_equal(read, problem.simulated)
    one_by_one = np.concatenate([problem.read(frame[None]) for frame in problem.simulated[:: FRAMES // 5]])
    np.testing.assert_allclose(read[:: FRAMES // 5], one_by_one, rtol=0, atol=1e-14)
