"""Evaluations: their results, the sensors and robots of a transfer, and what the shipped policies do."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from paxisim_insertion import InsertionEnv, Parameters
from paxisim_insertion.evaluate import evaluate, play_episode, stand_in_of
from paxisim_insertion.on_sensor import SensedPolicy, on_ports, on_sensor
from paxisim_insertion.results import FIRST_SEED, Result, file_of, folder_of, versions
from paxisim_insertion.run import Run
from paxisim_insertion.surrogates import draw_surrogate
from paxisim_insertion.transfer import sensors
from paxisim_lab.rates import RESULTS
from scipy.stats import binom

import paxisim

POLICIES = Path(__file__).parents[1] / "policies"
SHIPPED = sorted(folder.name for folder in POLICIES.iterdir())


def test_results_of_a_run(trained_run, tmp_path, capsys):
    paxisim.Chain([paxisim.augment.Poisson(0.2, 0.2)]).save(tmp_path / "poisson.model")
    evaluate(trained_run, trials=1, out=tmp_path / "out")
    assert "SY-2mm GCS sim: " in capsys.readouterr().out
    evaluate(trained_run, trials=1, sensor=tmp_path / "poisson.model", engine="native", out=tmp_path / "out")
    evaluate(trained_run, trials=1, drawn=True, engine="native", out=tmp_path / "out")
    evaluate(trained_run, trials=3, transfer="pads", engine="native", out=tmp_path / "out")
    found = {path.name: Result.load(path) for path in (tmp_path / "out").iterdir()}
    assert {result.sensor: result.trials for result in found.values()} == {
        "sim": 1,
        "surrogate poisson, native": 1,
        "sim, drawn actions, native": 1,
        "transfer pads, native": 3,
    }
    result = found["SY-2mm_GCS_sim_0.json"]
    assert (result.task, result.method, result.seed, result.parts) == ("SY-2mm", "GCS", 0, {})
    assert result.versions == versions()
    assert (result.training["steps"], result.training["updates"], result.training["model"]) == (240, 35, [])
    assert (result.training["engine"], result.training["envs"], result.training["redraw"]) == ("native", 2, True)
    assert result.training["cpu_seconds"] > 0
    transfer = found["SY-2mm_GCS_transfer-pads-native_0.json"]
    kinds = {"zeroed in the grasp": 2, "zeroed while open": 1}
    assert {kind: total for kind, (_, total) in transfer.parts.items()} == kinds
    assert sum(solved for solved, _ in transfer.parts.values()) == 3 * transfer.success_rate
    run = Run.open(trained_run)
    env = run.insertion_env(engine="native")
    policy, (observation, _) = run.policy(env), env.reset(seed=1)
    likely = [policy.act(observation) for _ in range(2)]
    np.testing.assert_array_equal(*likely)
    assert np.abs(policy.act(observation, deterministic=False) - likely[0]).max() > 1e-3


def test_a_result_that_is_none(tmp_path):
    for text in ('{"task": "SX-2mm"}', "[]", "{"):
        (tmp_path / "x.json").write_text(text)
        with pytest.raises(paxisim.InvalidValueError, match="is not a result"):
            Result.load(tmp_path / "x.json")


@pytest.mark.parametrize("engine", ["native", "robosuite"])
def test_the_robot_of_a_transfer(engine):
    """The poses are off, by a constant and by noise; the controller and its joints differ between the episodes."""
    off, plain = (InsertionEnv("SQ-2mm", "DT", engine=engine, gap=gap) for gap in (True, False))
    model, _ = off.scene.model_and_data
    means, frictions = [], []
    for seed in range(6):
        (first, _), (same, _) = off.reset(seed=seed), plain.reset(seed=seed)
        np.testing.assert_array_equal(first["privileged"], same["privileged"])
        native = engine == "native"
        frictions.append(model.tendon_frictionloss[6] if native else model.dof_frictionloss[off.scene.arm_dofs[0]])
        errors = []
        for _ in range(20):
            observation, *_ = off.step(np.zeros(3))
            errors.append(observation["p"] - observation["privileged"][6:])
        means.append(np.abs(np.mean(errors, axis=0)))
        assert 1.5e-4 < np.std(errors, axis=0)[:3].mean() < 6e-4
    means = np.array(means)
    assert 0.7e-3 < means[:, :3].max() < 1.8e-3
    assert 2e-3 < means[:, 3:].max() < 4.8e-3
    assert 0.1 <= min(frictions) < 0.2 < max(frictions) <= 0.4
    hidden = InsertionEnv("SX-2mm", "DT", engine="native", gap=True)
    assert not hidden.reset(seed=0)[0]["p"].any()


def compliance(model, pads):
    """MuJoCo's regularisation of a contact on each pad, which is inverse to the stiffness of a taxel."""
    impedance = model.geom_solimp[pads.geoms[:, 0], 0]
    return (1 - impedance) / impedance * model.body_invweight0[pads.bodies, 0]


def test_the_sensors_of_a_transfer():
    """Both kinds are zeroed in two ways, uneven, and read differently; the pads are as stiff as their layers."""
    env = InsertionEnv("SX-2mm", "DT", engine="native", parameters=Parameters(gel_modulus=100e3))
    model, _ = env.scene.model_and_data
    soft = compliance(model, env.scene.tactile.pads)
    for transfer in ("pads", "surrogates"):
        turns = sensors(transfer, env.layout, 8)
        assert [one.kind for one in turns[:4]] == ["zeroed in the grasp", "zeroed while open"] * 2
        readings = []
        for stand_in in turns:
            env.stand_in = stand_in
            env.reset(seed=0)
            readings.append(env.reading)
            heights = stand_in.surface.reshape(2, -1)
            assert np.all((np.ptp(heights, axis=1) >= 0.08e-3) & (np.ptp(heights, axis=1) <= 0.35e-3))
            radii = model.geom_size[env.scene.tactile.pads.geoms, 0]
            np.testing.assert_allclose(2 * radii - 3e-3, heights, atol=1e-9)
            stiffer = soft / compliance(model, env.scene.tactile.pads)
            assert np.all(stiffer > 8 if transfer == "pads" else stiffer == pytest.approx(1))
        apart = [np.abs(a - b).max() for index, a in enumerate(readings) for b in readings[:index]]
        assert min(apart) > 0.05, "no two read alike"
    with pytest.raises(paxisim.UnknownNameError, match="unknown transfer"):
        sensors("robots", env.layout)


def test_gains_and_kernels_of_surrogates_are_outside_the_ranges_of_gcs():
    ranges = paxisim.augment.Ranges()
    for number in range(25):
        chain = draw_surrogate(number)
        gains = chain["pad_axis_gain"].gain
        assert np.all((gains < ranges.axis_gain[0]) | (gains > ranges.axis_gain[1]))
        assert min(chain["poisson"].cx, chain["poisson"].cy) > ranges.convolution[1]


def test_a_unit_comes_with_its_surface_and_its_layer(tmp_path):
    env = InsertionEnv("SX-2mm", "DT", engine="native", sensor=stand_in_of("reference:unit:1"))
    np.testing.assert_array_equal(env.stand_in.surface, paxisim.MagneticSensor(env.layout, 1).heights(2))
    layer = env.stand_in.gel.stiffness(env.layout)
    assert layer == pytest.approx(paxisim.Layer().stiffness(env.layout, "taxel"), rel=0.05)
    evaluate(POLICIES / "SX-2mm_GCS_0", trials=1, sensor="reference:unit:1", engine="native", out=tmp_path)
    (result,) = map(Result.load, tmp_path.iterdir())
    assert result.sensor == "surrogate reference-unit-1, native"
    assert 0.1 < result.mean_force < result.peak_force < 200


def test_the_force_between_peg_and_base():
    """A peg that is pushed down on the rim presses as hard as the fingers say; in the air it does not."""
    env = InsertionEnv("SX-2mm", "DT", engine="native")
    env.reset(seed=3)
    assert env.scene.contact_force == 0
    _, data = env.scene.model_and_data
    ups = data.xmat[env.scene.tactile.pads.bodies].reshape(-1, 3, 3)[:, 2]

    def lifted():
        """Vertical force (N) on the pads."""
        return float(np.einsum("paij,pa->", env.raw, ups))

    before = lifted()
    for _ in range(40):
        env.step(np.array([0.0, -0.5]))
    assert env.scene.contact_force > 3
    assert abs(lifted() - before) == pytest.approx(env.scene.contact_force, rel=0.35)


def test_surrogates_of_a_sensor():
    drawn, without = draw_surrogate(3), draw_surrogate(3, field=False)
    assert drawn.to_json() == draw_surrogate(3).to_json() != draw_surrogate(4).to_json()
    assert set(drawn.names) - set(without.names) == {"interference"}
    assert without["creep"].amplitude == pytest.approx(drawn["creep"].amplitude)
    made = InsertionEnv("SX-2mm", "DT", engine="native", sensor=drawn)
    made.reset(seed=0)
    assert 0 < made.parameters.handle_size - made.scene.opening < 4e-3, "a grip of 30 N indents both gels"
    assert np.abs(made.reading - made.raw).max() > 0.1
    np.testing.assert_allclose(made.reading / 0.1, np.round(made.reading / 0.1), atol=1e-4, err_msg="counts of 0.1 N")
    assert np.ptp(made.scene.model_and_data[0].geom_size[made.scene.tactile.pads.geoms, 0]) < 1e-9, "flat pads"


def test_a_reference_sensor_with_memory_and_its_neighbour():
    made = InsertionEnv("SX-2mm", "DT", engine="native", sensor=stand_in_of("reference:unit:7+memory+neighbour"))
    made.reset(seed=0)
    model, data = made.scene.model_and_data
    left, right = (data.xmat[model.body(name).id].reshape(3, 3) for name in made.scene.tactile.pads.bodies)
    # the neighbour's magnets are assumed to be rotated by 180 degrees about y
    np.testing.assert_allclose(left.T @ right, np.diag([-1.0, 1.0, -1.0]), atol=0.05)
    covariates = {"gripper_opening": made.scene.opening}
    alone, beside = (stand_in_of(f"reference:unit:7{with_}")(made.layout).chain for with_ in ("", "+neighbour"))
    assert np.abs(beside(made.raw, covariates) - alone(made.raw)).max() > 0.05
    before = made.reading
    for _ in range(3):
        made.step(np.zeros(2))
    assert np.isfinite(made.reading).all()
    assert np.abs(made.reading - before).max() < 1
    with pytest.raises(paxisim.InvalidValueError, match="is named unit:N"):
        stand_in_of("reference:unit:x")


def test_the_shipped_policies_have_results_of_as_many_steps():
    assert len(SHIPPED) == 51
    for name in SHIPPED:
        document = json.loads((POLICIES / name / "run.json").read_text())
        task, method, seed = (document[key] for key in ("task", "method", "seed"))
        assert name == folder_of(task, method, seed)
        found = torch.load(POLICIES / name / "actor.pt", weights_only=True)
        for sensor in ("sim", "transfer pads"):
            result = Result.load(RESULTS / file_of(task, method, sensor, seed))
            assert result.trials == 50, name
            assert (found["steps"], found["updates"]) == (result.training["steps"], result.training["updates"]), name


def solves_as_often(name, engine, trials):
    run = Run.open(POLICIES / name)
    result = Result.load(RESULTS / file_of(run.task, run.method, "sim", run.seed))
    env = run.insertion_env(engine=engine, terminate_on_success=True)
    trained = run.policy(env)
    solved = sum(play_episode(env, trained.act, FIRST_SEED + trial).success for trial in range(trials))
    env.close()
    # the first of the same 50 episodes; one may end differently on another processor
    low, high = binom.ppf([1e-4, 1 - 1e-4], trials, np.clip(result.success_rate, 0.02, 0.98))
    assert low <= solved <= high, f"{name}, {engine}: {solved} of {trials}, expected {result.success_rate:.2f}"


@pytest.mark.parametrize("name", ["SX-2mm_GCS_0", "SY-2mm_GCS_0"])
def test_policies_succeed_in_both_engines(name):
    solves_as_often(name, "robosuite", 5)
    solves_as_often(name, "native", 12)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_all_policies_do_what_their_results_say():
    for name in SHIPPED:
        if name.endswith(("GCS_0", "DT_0")):
            solves_as_often(name, "robosuite", 8)


@pytest.mark.slow
@pytest.mark.parametrize(("task", "most"), [("SX-2mm", 0.05), ("SY-2mm", 0.01)])
def test_the_grip_keeps_most_taxels_of_a_flat_handle_above_the_threshold_of_tb(task, most):
    """So TB knows hardly more than NT."""
    run = Run.open(POLICIES / f"{task}_TB_0")
    env = run.insertion_env(engine="native", terminate_on_success=True)
    trained, below = run.policy(env), []
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        assert observation["tactile"].all(), f"TB sees more than NT in the grasp on {task}, seed {seed}"
        terminated = truncated = False
        while not (terminated or truncated):
            below.append(np.mean(observation["tactile"][-1] == 0))
            observation, _, terminated, truncated, _ = env.step(trained.act(observation))
    assert 0 < np.mean(below) < most


@pytest.mark.real_time
def test_a_policy_acts_on_what_the_sensors_at_two_ports_read(capsys):
    run = Run.open(POLICIES / "SX-2mm_GCS_0")
    env = run.insertion_env(engine="native", sensor=paxisim.Chain())
    trained = run.policy(env)
    seen, _ = env.reset(seed=0)
    with on_ports(env) as sensor:
        policy = SensedPolicy(trained, env, sensor)
        time.sleep(0.1)
        action = policy.act({**seen, "tactile": np.full_like(seen["tactile"], np.nan), "raw": seen["raw"] + 50})
        np.testing.assert_allclose(policy.force, env.raw, atol=0.21)  # counts of 0.1 N on each of four taxels
        history = env.method.history(env.task, env.layout)
        history.append(policy.force)  # and nothing else: the simulator's own readings were replaced
        np.testing.assert_array_equal(action, trained.act({**seen, "tactile": history.read(), "raw": policy.force}))
    env.close()
    on_sensor(POLICIES / "SX-2mm_GCS_0", trials=1)
    printed = capsys.readouterr().out
    assert "SX-2mm GCS on 2 ports:" in printed
    assert "steps took longer than 50 ms" in printed
    with pytest.raises(paxisim.InvalidValueError, match="at least one trial"):
        on_sensor(POLICIES / "SX-2mm_GCS_0", trials=0)
