"""Rewards and observed poses: states computed by hand, and numpy's results with torch's."""

import numpy as np
import pytest
import torch
from paxisim_insertion import TASKS, Parameters
from paxisim_insertion.arrays import like, rotation_vector
from paxisim_insertion.engines.native import NativeScene
from paxisim_insertion.observations import observed_poses
from paxisim_insertion.reward import WEIGHTS, insertion, reward_terms, weighted
from scipy.spatial.transform import Rotation

PARAMETERS = Parameters(peg_size=20e-3, peg_length=35e-3, hole_depth=20e-3, epsilon=0.1, success_depth=5e-3)
UPRIGHT = np.eye(3)
STILL = np.zeros(3)


def state(name, x, y, z, rotation=UPRIGHT):
    return insertion(TASKS[name], PARAMETERS, np.array([x, y, z]), rotation)


def leaning(angle, about="y"):
    return Rotation.from_euler(about, angle).as_matrix()


def test_above_the_hole():
    assert WEIGHTS == {"reach": 1.0, "engage": 50.0, "success": 200.0, "action": 0.1}, "the paper's"
    above = state("SQ-2mm", 3e-3, 4e-3, 32e-3)
    # all keypoints are offset by the same vector (3, 4, 32) mm
    assert above.distance == pytest.approx(np.sqrt(9 + 16 + 1024) * 1e-3)
    assert (above.engaged, above.success) == (False, False)
    terms = reward_terms(above, STILL, 0.1)
    assert terms == {"reach": pytest.approx(1 / (10 * above.distance + 0.1)), "engage": 0, "success": 0, "action": 0}
    costs = weighted(terms) - weighted(reward_terms(above, np.array([1.0, -0.5, 0.5]), 0.1))
    assert costs == pytest.approx(0.1 * 1.5), "an action costs a tenth of its square"


def test_engaged_and_then_inserted():
    engaged = state("SQ-2mm", 0, 0, 15e-3)
    assert (engaged.engaged, engaged.success) == (True, False)
    # d = h = 15 mm: 1 / 0.25 = 4 for both
    assert weighted(reward_terms(engaged, STILL, 0.1)) == pytest.approx(4 + 50 * 4)
    inserted = state("SQ-2mm", 0, 0, 4e-3)
    assert (inserted.engaged, inserted.success) == (True, True)
    assert weighted(reward_terms(inserted, STILL, 0.1)) == pytest.approx(51 / 0.14 + 200)
    bottom = weighted(reward_terms(state("SQ-2mm", 0, 0, -2e-5), STILL, 0.1))
    assert bottom == pytest.approx(51 / 0.1 + 200, rel=2e-3)


def test_where_a_peg_counts_as_engaged():
    for name, x, y, engaged in (
        ("SQ-2mm", 0, 0, True),
        ("SQ-2mm", 5e-3, 0, False),  # beside the hole and below its edge: off the base
        ("SQ-2mm", 0, -5e-3, False),
        ("SX-2mm", 30e-3, 0, True),  # anywhere along the groove
        ("SX-2mm", 0, 5e-3, False),
        ("SY-2mm", 0, 30e-3, True),
        ("SY-2mm", 5e-3, 0, False),
    ):
        assert state(name, x, y, 15e-3).engaged == engaged, (name, x, y)
        assert not state(name, x, y, 19.5e-3).engaged, "resting on the rim"
        assert not state(name, x, y, 25e-3).engaged
    for angle, engaged in ((0.16, True), (-0.16, True), (0.18, False), (-0.3, False)):
        for about in "xy":
            assert state("SQ-2mm", 0, 0, 15e-3, leaning(angle, about)).engaged == engaged, (angle, about)
    assert state("SQ-2mm", 0, 0, 15e-3, leaning(np.pi / 2, "z")).engaged, "a turn about its own axis is not a lean"


def test_distances():
    assert state("SX-2mm", 12e-3, 0, 0).distance == 0, "along a groove it does not count"
    assert state("SY-2mm", 0, 12e-3, 0).distance == 0
    assert state("SX-2mm", 12e-3, 5e-3, 0).distance == pytest.approx(5e-3)
    # a keypoint at r in the plane of the lean moves by 2 r sin(angle / 2); four at 10 mm, four at sqrt(100 + 35^2) mm
    expected = 2 * np.sin(0.1 / 2) * (10e-3 + np.hypot(10e-3, 35e-3)) / 2
    assert state("SQ-2mm", 0, 0, 0, leaning(0.1)).distance == pytest.approx(expected)


def test_rotation_vectors():
    for rotations in (
        Rotation.random(200, random_state=0),
        Rotation.from_rotvec(np.random.default_rng(0).normal(0, 1e-6, (20, 3))),
        Rotation.from_rotvec(3.14159 * np.eye(3)),
    ):
        matrices, expected = rotations.as_matrix(), rotations.as_rotvec()
        np.testing.assert_allclose(rotation_vector(matrices), expected, atol=1e-12)
        np.testing.assert_allclose(rotation_vector(torch.as_tensor(matrices)), expected, atol=1e-12)
    np.testing.assert_array_equal(rotation_vector(np.eye(3)), np.zeros(3))


@pytest.mark.parametrize("task", TASKS)
def test_rewards_observations_and_placements_of_tensors(task):
    rng = np.random.default_rng(1)
    scene = NativeScene(TASKS[task])
    position = scene.base + rng.uniform([-0.003, -0.003, -0.001], [0.003, 0.003, 0.03], (50, 3))
    rotation = Rotation.from_rotvec(rng.normal(0, 0.1, (50, 3))).as_matrix()
    action = rng.uniform(-1, 1, (50, len(TASKS[task].axes)))
    there = [torch.as_tensor(value) for value in (position, rotation, action)]
    many = insertion(TASKS[task], Parameters(), position - scene.base, rotation)
    same = insertion(TASKS[task], Parameters(), there[0] - like(scene.base, there[0]), there[1])
    assert 0 < many.engaged.sum() < 50
    expected, found = (reward_terms(s, a, 0.1) for s, a in ((many, action), (same, there[2])))
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-12, err_msg=name)
    poses = position + 0.1, rotation, position, rotation
    seen, felt = observed_poses(scene, *poses), observed_poses(scene, *map(torch.as_tensor, poses))
    for name, values in seen.items():
        np.testing.assert_array_equal(felt[name], values)
        assert felt[name].dtype == torch.float32
    starts = [np.array([0.01, -0.01, 0.02]), np.array([1e-3, 2e-3, -1e-3]), np.array(0.02)]
    one = scene.placement(*starts)
    two = scene.placement(*(torch.as_tensor(np.stack([value] * 2)) for value in starts))
    for name in ("grip", "aside", "fingers", "peg"):
        np.testing.assert_allclose(getattr(two, name)[1], getattr(one, name), atol=1e-15)
