"""Grasps, and the changes to robot and sensor in an evaluation; both are the same in both engines."""

import numpy as np
import pytest
from paxisim_insertion import InsertionEnv, Parameters
from paxisim_insertion.gap import Gap
from paxisim_insertion.scene import Grasp
from paxisim_insertion.transfer import sensors

import paxisim

START = np.array([0.004, -0.003, 0.012])
ENGINES = ("robosuite", "native")


@pytest.fixture(scope="module", params=ENGINES)
def env(request):
    made = InsertionEnv("SQ-2mm", "DT", engine=request.param)
    yield made
    made.close()


@pytest.mark.parametrize("grasp", [Grasp(), Grasp((2e-3, 1e-3, -3e-3), 0.03), Grasp((0, -2e-3, 1e-3), -0.05)])
def test_the_fingers_hold_the_handle_where_they_are_to(env, grasp):
    env.scene.place(START, grasp)
    peg, rotation = env.scene.peg
    tip, _ = env.scene.fingertip
    assert np.arctan2(rotation[0, 2], rotation[2, 2]) == pytest.approx(grasp.lean, abs=1e-3)
    np.testing.assert_allclose(peg, env.scene.hole_top + START, atol=2e-4)
    middle = peg + rotation @ [0, 0, env.parameters.peg_length + env.parameters.handle_height / 2]
    apart = tip - middle
    np.testing.assert_allclose(apart[:2], grasp.offset[:2], atol=2e-4)
    env.scene.place(START)
    unmoved = env.scene.fingertip[0] - env.scene.hole_top - START
    assert apart[2] - grasp.offset[2] == pytest.approx(unmoved[2] - 0.0525, abs=2e-4)
    normal = env.scene.tactile.read()[:, 2].sum(axis=(-2, -1))
    assert normal[0] == pytest.approx(normal[1], rel=1e-3), "both fingers push equally"


def test_grasps_are_drawn_within_their_ranges():
    parameters, rng = Parameters(grasp_offset=(1e-3, 0.0, 2e-3), grasp_lean=0.02), np.random.default_rng(0)
    drawn = [Grasp.draw(rng, parameters) for _ in range(300)]
    offsets, leans = np.array([grasp.offset for grasp in drawn]), np.array([grasp.lean for grasp in drawn])
    np.testing.assert_allclose(np.abs(offsets).max(axis=0), [1e-3, 0, 2e-3], rtol=0.05)
    assert 0.019 < np.abs(leans).max() <= 0.02
    assert abs(leans.mean()) < 0.002


def steady(env, push, **tuned):
    """Displacement of the fingertip between a downward and an upward push."""
    env.scene.place(START)
    env.scene.tune(**tuned)
    model, data = env.scene.model_and_data
    eef = next(index for index in range(model.nbody) if model.body(index).name.endswith("eef"))
    home, at = env.scene.fingertip[0], []
    for force in (-push, push):
        data.xfrc_applied[eef, 2] = force
        for _ in range(40):
            env.scene.move(home)
        at.append(env.scene.fingertip[0][2])
    data.xfrc_applied[:] = 0
    return at[1] - at[0]


def test_a_controller_that_is_off(env):
    plain = steady(env, 20.0, stiffness=1.0, friction=1.0)
    assert steady(env, 20.0, stiffness=0.5, friction=1.0) > 1.6 * plain
    assert steady(env, 20.0, stiffness=1.0, friction=20.0) < 0.7 * plain, "joints with friction yield less"
    env.scene.place(START)
    assert steady(env, 20.0, stiffness=1.0, friction=1.0) == pytest.approx(plain, rel=1e-6), "no change persists"


def test_poses_that_are_off():
    gap = Gap(pose_offset=(2e-3, 5e-3), pose_noise=(1e-4, 2e-4), stiffness=(1, 1), friction=(1, 1))
    off, plain = InsertionEnv("SQ-2mm", "DT", engine="native", gap=gap), InsertionEnv("SQ-2mm", "DT", engine="native")
    means = []
    for seed in range(6):
        (first, _), (same, _) = off.reset(seed=seed), plain.reset(seed=seed)
        np.testing.assert_array_equal(first["privileged"], same["privileged"])
        errors = []
        for _ in range(20):
            observation, *_ = off.step(np.zeros(3))
            errors.append(observation["p"] - observation["privileged"][6:])
        means.append(np.mean(errors, axis=0))
        assert 0.5e-4 < np.std(errors, axis=0)[:3].mean() < 2e-4
    means = np.abs(means)
    assert means[:, :3].max() < 2.2e-3
    assert means[:, :3].max() > 1e-3
    assert 2.5e-3 < means[:, 3:].max() < 5.5e-3
    hidden = InsertionEnv("SX-2mm", "DT", engine="native", gap=gap)
    assert not hidden.reset(seed=0)[0]["p"].any()


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"pose_offset": (-1e-3, 0.0)}, "pose_offset must be two non-negative numbers"),
        ({"pose_noise": (1e-3,)}, "pose_noise must be two non-negative numbers"),
        ({"stiffness": (1.3, 0.7)}, "stiffness must be a positive minimum and maximum"),
        ({"friction": (0.0, 1.0)}, "friction must be a positive minimum and maximum"),
    ],
)
def test_a_gap_that_is_none(values, told):
    with pytest.raises(paxisim.InvalidValueError, match=told):
        Gap(**values)


def test_sensors_of_a_transfer():
    env = InsertionEnv("SX-2mm", "DT", engine="native")
    turns = sensors(env.layout)
    kinds = [stand_in.kind for stand_in in turns]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "zeroed in the grasp": 10,
        "zeroed while open": 10,
        "magnetic pad": 5,
    }
    readings = []
    for stand_in in turns:
        env.sensor, env.surface = stand_in.chain, stand_in.surface
        env.reset(seed=0)
        readings.append(env.reading)
        heights = stand_in.surface.reshape(2, -1)
        np.testing.assert_allclose(heights.mean(axis=1), 1e-3)
        assert np.all((np.ptp(heights, axis=1) >= 0.1e-3 - 1e-9) & (np.ptp(heights, axis=1) <= 0.3e-3 + 1e-9))
        rows, columns = (np.abs(np.diff(stand_in.surface, axis=axis)).max() for axis in (1, 2))
        assert max(rows, columns) < 0.2e-3, "slow waves"
        lowest = env.scene.model_and_data[0].geom_size[env.scene.tactile.pads.geoms, 0]
        np.testing.assert_allclose(2 * lowest - 3e-3, heights, atol=1e-9)
    apart = [np.abs(a - b).max() for index, a in enumerate(readings) for b in readings[:index]]
    assert min(apart) > 0.05, "no two read alike"
