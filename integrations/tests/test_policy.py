"""The asymmetric SAC policy: inputs of actor and critic, batch normalisation, and the replay buffer."""

import itertools

import numpy as np
import pytest
import torch
from gymnasium import spaces
from paxisim_insertion import METHODS, TASKS
from paxisim_insertion.learner import SHARE, Average
from paxisim_insertion.observations import PRIVILEGED, RAW
from paxisim_insertion.policy import AsymmetricPolicy
from paxisim_insertion.replay import FLUSHED, HistoryReplayBuffer, Redraw
from stable_baselines3.common.buffers import DictReplayBuffer

import paxisim

ACTIONS = spaces.Box(-1, 1, (2,), np.float32)
LAYOUT = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)


def space_of(method, task="SX-2mm"):
    history = METHODS[method].history(TASKS[task], LAYOUT)
    shape = history.encoding.shape(2, history.k)
    entries = {"p": (6,), PRIVILEGED: (12,)} | ({"tactile": shape} if shape[0] else {})
    if METHODS[method].gcs is not None:
        entries[RAW] = (2, 3, 6, 5)
    return spaces.Dict({name: spaces.Box(-10, 10, size, np.float32) for name, size in entries.items()})


def policy_of(method):
    torch.manual_seed(0)
    return AsymmetricPolicy(space_of(method), ACTIONS, lambda _: 3e-4)


def drawn(space, batch, seed=0):
    rng = np.random.default_rng(seed)
    return {name: rng.standard_normal((batch, *box.shape)).astype(np.float32) for name, box in space.spaces.items()}


def torched(observation):
    return {name: torch.as_tensor(value) for name, value in observation.items()}


@pytest.mark.parametrize("method", ["GCS", "TF", "NT"])
def test_nothing_privileged_reaches_the_actor_and_nothing_else_the_critic(method):
    policy = policy_of(method)
    policy.set_training_mode(False)
    observation = drawn(space_of(method), 4)
    other = {**observation, PRIVILEGED: observation[PRIVILEGED] + 1}
    np.testing.assert_array_equal(
        policy.predict(observation, deterministic=True)[0], policy.predict(other, deterministic=True)[0]
    )
    inputs = {name: value.requires_grad_() for name, value in torched(observation).items()}
    mean, log_std, _ = policy.actor.get_action_dist_params(inputs)
    (mean.sum() + log_std.sum()).backward()
    assert all(value.grad is None for name, value in inputs.items() if name in (PRIVILEGED, RAW))
    assert inputs["p"].grad.abs().max() > 0
    if "tactile" in inputs:
        assert inputs["tactile"].grad.abs().max() > 0
    inputs = {name: value.requires_grad_() for name, value in torched(observation).items()}
    sum(q.sum() for q in policy.critic(inputs, torch.zeros(4, 2))).backward()
    assert inputs[PRIVILEGED].grad.abs().max() > 0
    assert all(value.grad is None for name, value in inputs.items() if name != PRIVILEGED)


def test_the_layers_are_the_papers():
    policy = policy_of("GCS")
    kinds = [type(layer).__name__ for layer in policy.actor.features_extractor.tactile]
    assert kinds == ["Conv2d", "BatchNorm2d", "ReLU"] * 4 + ["Flatten", "Linear", "ReLU"]
    features = policy.actor.features_extractor
    assert [layer.out_features for layer in (features.tactile[-2], features.pose[0])] == [128, 128]
    for net in (policy.actor.latent_pi, policy.critic.q_networks[0][:4]):
        assert [layer.out_features for layer in net if isinstance(layer, torch.nn.Linear)] == [256, 256]
    assert not [m for m in policy.critic.modules() if isinstance(m, torch.nn.BatchNorm2d)]
    assert policy.critic.features_extractor is not policy.critic_target.features_extractor


def test_batch_normalisation_learns_from_the_update_with_gradient_alone():
    policy = policy_of("GCS")
    norm = policy.actor.features_extractor.tactile[1]
    observation = torched(drawn(space_of("GCS"), 8))
    policy.set_training_mode(True)
    before = norm.running_mean.clone()
    with torch.no_grad():
        policy.actor.action_log_prob(observation)
    assert torch.equal(norm.running_mean, before)
    assert policy.actor.training, "the training mode is restored"
    policy.actor.action_log_prob(observation)
    assert not torch.equal(norm.running_mean, before)
    # a target does not depend on the rest of its batch
    with torch.no_grad():
        in_training = policy.actor.get_action_dist_params(observation)[0]
        policy.actor.set_training_mode(False)
        alone = policy.actor.get_action_dist_params({k: v[:1] for k, v in observation.items()})[0]
        among = policy.actor.get_action_dist_params(observation)[0]
    torch.testing.assert_close(alone, among[:1])
    assert (in_training[:1] - alone).abs().max() > 1e-4, "in training mode it depends on the batch"


def transitions(space, k, count):
    """Yield transitions of two environments with random frames, in episodes of 7 steps and of 30."""
    rng = np.random.default_rng(0)
    channels, *size = space["tactile"].shape

    def frame():
        return rng.standard_normal((channels // k, *size)).astype(np.float32)

    def observed():
        other = drawn(space, 2, int(rng.integers(1 << 30)))
        return {**other, "tactile": np.stack([np.concatenate(history) for history in histories])}

    histories = [[frame()] * k for _ in range(2)]
    for step in range(1, count + 1):
        before = observed()
        histories = [[*history[1:], frame()] for history in histories]
        done = np.array([step % length == 0 for length in (7, 30)])
        action = rng.uniform(-1, 1, (2, 2)).astype(np.float32)
        yield before, observed(), action, rng.random(2), done, [{"TimeLimit.truncated": bool(step % 2)}] * 2
        histories = [[frame()] * k if ends else history for ends, history in zip(done, histories, strict=True)]


@pytest.mark.parametrize(("method", "count"), [("GCS", 60), ("GCS", 300), ("TF", 150)])
def test_the_replay_buffer_gives_back_what_was_added(method, count):
    space = space_of(method)
    k = METHODS[method].history(TASKS["SX-2mm"], LAYOUT).k
    lean = HistoryReplayBuffer(200, space, ACTIONS, "cpu", 2, history=k)
    plain = DictReplayBuffer(200, space, ACTIONS, "cpu", 2)
    for transition in transitions(space, k, count):
        lean.add(*transition)
        plain.add(*transition)
    oldest = (lean.pos + k - 1) if lean.full else 0
    inside = np.arange(oldest, oldest + 100 - k) % 100 if lean.full else np.arange(lean.pos)
    for seed in range(3):
        np.random.seed(seed)  # noqa: NPY002
        first = lean._get_samples(inside)
        np.random.seed(seed)  # noqa: NPY002
        second = plain._get_samples(inside)
        for name in ("observations", "next_observations"):
            for key in set(space.spaces) - {RAW}:
                assert torch.equal(getattr(first, name)[key], getattr(second, name)[key]), (name, key)
        for name in ("actions", "rewards", "dones"):
            assert torch.equal(getattr(first, name), getattr(second, name))
    sampled = lean.sample(64).observations["tactile"]
    known = {
        row.numpy().tobytes() for row in torch.as_tensor(plain.observations["tactile"]).reshape(-1, *sampled.shape[1:])
    }
    assert all(row.numpy().tobytes() in known for row in sampled)


def redrawing(gcs, count=40):
    """A redrawing buffer of one environment, and the raw frames added to it."""
    space = space_of("GCS")
    redraw = Redraw(gcs, paxisim.encoding("GCS", LAYOUT), LAYOUT, seed=1)
    buffer = HistoryReplayBuffer(200, space, ACTIONS, "cpu", 1, history=20, redraw=redraw)
    raw = np.abs(np.random.default_rng(0).standard_normal((count + 1, 2, 3, 6, 5))).astype(np.float32)
    fixed = drawn(space, 1, 0)
    for before, after in itertools.pairwise(raw[:, None]):
        buffer.add({**fixed, RAW: before}, {**fixed, RAW: after}, np.zeros((1, 2)), np.zeros(1), np.zeros(1), [{}])
    return buffer, raw


def test_without_randomisation_a_history_that_is_drawn_anew_is_what_was_read():
    with pytest.raises(paxisim.InvalidValueError, match="expected a multiple of 7 tactile channels, got 120"):
        HistoryReplayBuffer(10, space_of("GCS"), ACTIONS, history=7)
    buffer, raw = redrawing(paxisim.GCS(convolution=False, scaling=False))
    assert "tactile" not in buffer.observations
    found = buffer._get_samples(np.array([0, 5, 30]))
    for row, last in enumerate((0, 5, 30)):
        for values, newest in ((found.observations, last), (found.next_observations, last + 1)):
            frames = raw[np.maximum(np.arange(newest - 19, newest + 1), 0)]
            np.testing.assert_array_equal(values["tactile"][row].numpy(), frames.reshape(120, 6, 5))


def test_each_history_has_one_draw_and_each_sample_its_own():
    buffer, raw = redrawing(paxisim.GCS(convolution=False))
    found = buffer._get_samples(np.array([30, 30]))
    gains = found.observations["tactile"].numpy().reshape(2, 20, 2, 3, 6, 5) / raw[11:31]
    np.testing.assert_allclose(gains, np.broadcast_to(gains[:, :1], gains.shape), rtol=1e-4, atol=1e-6)
    assert np.abs(gains[0, 0] - gains[1, 0]).max() > 0.1
    after = found.next_observations["tactile"].numpy().reshape(2, 20, 2, 3, 6, 5) / raw[12:32]
    np.testing.assert_allclose(after[:, 0], gains[:, 0], rtol=1e-4, atol=1e-6)


def test_a_buffer_in_files_goes_on_from_where_it_was_flushed(tmp_path):
    space = space_of("TD")
    added = list(transitions(space, METHODS["TD"].history(TASKS["SX-2mm"], LAYOUT).k, 15))

    def opened(size=200):
        buffer = HistoryReplayBuffer(size, space, ACTIONS, "cpu", 2, history=1)
        buffer.keep_in(tmp_path)
        return buffer

    buffer = opened()
    for number, transition in enumerate(added):
        if number == 10:
            buffer.flush()
        buffer.add(*transition)
    again = opened()
    assert (again.pos, again.full) == (10, False)
    np.testing.assert_array_equal(again.observations["tactile"][:10], buffer.observations["tactile"][:10])
    with pytest.raises(paxisim.InvalidValueError, match="expected"):
        opened(300)
    (tmp_path / FLUSHED).write_text("{}")
    with pytest.raises(paxisim.InvalidValueError, match="mark of a replay buffer"):
        opened()


def test_the_average_of_actors():
    first, second = policy_of("GCS").actor, policy_of("GCS").actor
    with torch.no_grad():
        for value in second.state_dict().values():
            value += 1
    average = Average(first)
    average.add(second, 1)
    average.add(second, 2)
    share = 1 - (1 - SHARE) ** 3
    for name, value in average.actor.state_dict().items():
        start, end = first.state_dict()[name], second.state_dict()[name]
        expected = end if not value.is_floating_point() else start + share * (end - start)
        torch.testing.assert_close(value, expected, msg=name)
    assert not any(value.requires_grad for value in average.actor.parameters())
