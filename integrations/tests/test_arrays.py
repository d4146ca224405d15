"""Formulas that the engines share: the same in numpy and torch, and against scipy's rotations."""

import numpy as np
import pytest
import torch
from paxisim_insertion import TASKS, Parameters
from paxisim_insertion.arrays import like
from paxisim_insertion.native_scene import NativeScene
from paxisim_insertion.poses import observed_poses, rotation_vector
from paxisim_insertion.reward import insertion, reward_terms
from scipy.spatial.transform import Rotation

ROTATIONS = [
    Rotation.random(200, random_state=0),
    Rotation.from_rotvec(np.random.default_rng(0).normal(0, 1e-6, (20, 3))),
    Rotation.from_rotvec(3.14159 * np.eye(3)),
]


@pytest.mark.parametrize("rotations", ROTATIONS, ids=["any", "small", "half a turn"])
def test_rotation_vectors(rotations):
    matrices, expected = rotations.as_matrix(), rotations.as_rotvec()
    np.testing.assert_allclose(rotation_vector(matrices), expected, atol=1e-12)
    np.testing.assert_allclose(rotation_vector(torch.as_tensor(matrices)), expected, atol=1e-12)
    single = rotation_vector(torch.as_tensor(matrices, dtype=torch.float32))
    np.testing.assert_allclose(single[:, :2], expected[:, :2], atol=2e-5)
    np.testing.assert_array_equal(rotation_vector(np.eye(3)), np.zeros(3))


@pytest.mark.parametrize("task", TASKS)
def test_rewards_observations_and_placements_of_tensors(task):
    rng = np.random.default_rng(1)
    scene = NativeScene(TASKS[task])
    position = scene.base + rng.uniform([-0.003, -0.003, -0.001], [0.003, 0.003, 0.03], (50, 3))
    rotation = Rotation.from_rotvec(rng.normal(0, 0.1, (50, 3))).as_matrix()
    action = rng.uniform(-1, 1, (50, len(TASKS[task].axes)))
    there = [torch.as_tensor(value) for value in (position, rotation, action)]
    state = insertion(TASKS[task], Parameters(), position - scene.base, rotation)
    same = insertion(TASKS[task], Parameters(), there[0] - like(scene.base, there[0]), there[1])
    assert 0 < state.engaged.sum() < 50
    expected, found = (reward_terms(s, a, 0.1) for s, a in ((state, action), (same, there[2])))
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-12, err_msg=name)
    poses = position + 0.1, rotation, position, rotation
    seen, felt = observed_poses(scene, *poses), observed_poses(scene, *map(torch.as_tensor, poses))
    for name, values in seen.items():
        np.testing.assert_array_equal(felt[name], values)
        assert felt[name].dtype == torch.float32
    starts = [np.array([0.01, -0.01, 0.02]), np.array([1e-3, 2e-3, -1e-3]), np.array(0.02)]
    one = scene.placement(*starts)
    many = scene.placement(*(torch.as_tensor(np.stack([value] * 2)) for value in starts))
    for name in ("grip", "aside", "fingers", "peg"):
        np.testing.assert_allclose(getattr(many, name)[1], getattr(one, name), atol=1e-15)
