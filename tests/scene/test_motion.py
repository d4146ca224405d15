"""Streams turned into smooth motions."""

import numpy as np
import pytest
from scene.rigs import ENCODER, path, steps_of
from scipy.spatial.transform import Rotation

from paxisim.logs.encoder_steps import resolution
from paxisim.scene.motion import Curve, PoseCurve, smooth_within

TIME = np.arange(800) / 100
TRUE = path(TIME, [0, 1, 2, 3, 4, 4.2, 4.4, 8], [0, 0, 4e-3, 4e-3, 1e-3, 1e-3, 2e-3, 2e-3])


def test_before_and_after_its_samples_a_motion_rests():
    curve = Curve(TIME, 1e-3 * TIME)
    position, velocity, acceleration = curve(np.array([-1.0, TIME[-1] + 1]))
    np.testing.assert_allclose(position, [0, 1e-3 * TIME[-1]], atol=1e-12)
    assert not velocity.any()
    assert not acceleration.any()
    assert Curve(TIME[:1], TRUE[:1])(TIME)[0].shape == TIME.shape


def test_turning_rates_are_in_the_frame_of_the_body():
    turns = Rotation.from_euler("xyz", np.column_stack([0.5 * TIME, 0.3 * np.sin(TIME), -0.2 * TIME]))
    poses = np.hstack([np.zeros((len(TIME), 3)), turns.as_quat()[:, [3, 0, 1, 2]]])
    at, dt = np.array([1.234, 5.678]), 1e-5
    pose, velocity, acceleration = PoseCurve(TIME, poses)(at)
    later, velocity_later, _ = PoseCurve(TIME, poses)(at + dt)
    turn = Rotation.from_quat(pose[:, [4, 5, 6, 3]]).inv() * Rotation.from_quat(later[:, [4, 5, 6, 3]])
    np.testing.assert_allclose(turn.as_rotvec() / dt, velocity[:, 3:], atol=1e-4)
    np.testing.assert_allclose((velocity_later - velocity)[:, 3:] / dt, acceleration[:, 3:], atol=1e-3)


def test_the_steps_of_an_encoder_are_found_and_a_stream_without_steps_has_none():
    for step in (ENCODER, 1.7e-4):
        for shift in (0.0, 3.21e-5):
            read = steps_of(TRUE, step) + shift
            assert resolution(read) == pytest.approx(step, rel=1e-6)
            assert resolution(read.astype(np.float32).astype(float)) == pytest.approx(step, rel=1e-3)
    assert resolution(TRUE) == 0  # it rests for half of the time, at values that are not multiples of a step
    assert resolution(np.ones(100)) == 0
    assert resolution(np.full(5, np.nan)) == 0


@pytest.mark.parametrize(("rate", "left"), [(30, 0.9), (100, 0.6), (500, 0.4)])
def test_smoothed_readings_stay_within_half_a_step_and_come_nearer_to_the_truth(rate, left):
    time = np.arange(8 * rate) / rate
    true = path(time, [0, 1, 2, 3, 4, 8], [0, 0, 4e-3, 4e-3, 1e-3, 2e-3])
    readings = steps_of(true)
    smooth = smooth_within(time, readings, ENCODER)
    assert np.abs(smooth - readings).max() < 0.55 * ENCODER
    moving = np.abs(np.gradient(true, time)) > 5e-4
    assert np.std((smooth - true)[moving]) < left * np.std((readings - true)[moving])
    roughness = [np.std(np.gradient(np.gradient(x - true, time), time)) for x in (smooth, readings)]
    assert roughness[0] < 0.2 * roughness[1]
