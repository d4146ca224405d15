"""Trainings: resumed where they ended, with their settings; error messages; and that they learn."""

import base64
import copy
import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import cloudpickle
import numpy as np
import pytest
import torch
from paxisim_insertion import InsertionEnv, Parameters, learner
from paxisim_insertion.evaluate import evaluate
from paxisim_insertion.learner import make_model
from paxisim_insertion.results import Result
from paxisim_insertion.run import Run
from paxisim_insertion.shell import command
from paxisim_insertion.train import train
from stable_baselines3 import SAC
from stable_baselines3.common.logger import configure

import paxisim


@pytest.fixture
def copied(trained_run, tmp_path):
    return Path(shutil.copytree(trained_run, tmp_path / "copied"))


def test_a_run_goes_on_with_all_that_it_had(copied, trained_run, capsys):
    run = Run.open(copied)
    assert (run.task, run.method, run.seed, run.envs, run.buffer, run.steps) == ("SY-2mm", "GCS", 0, 2, 3000, 240)
    env = run.make_envs()
    model = make_model(run, env, "cpu")
    assert (model.num_timesteps, model.replay_buffer.pos) == (240, 120)
    assert model._n_updates == 35, "an update for two steps of both environments, once there are 100 steps"
    assert (model.train_freq.frequency, model.gradient_steps, model.batch_size) == (2, 1, 128)
    new = make_model(replace(run, folder=copied / "none"), env, "cpu")
    raw = np.ones((1, 4, 2, 3, 6, 5), np.float32)
    assert not np.array_equal(new.replay_buffer._redraw(raw), model.replay_buffer._redraw(raw)), "draws go on, not anew"
    assert torch.isfinite(model.replay_buffer.sample(32).observations["tactile"]).all()
    alpha = model.log_ent_coef.item()
    assert alpha != new.log_ent_coef.item(), "the temperature of SAC goes on as well"
    train(out=copied, resume=True, steps=280, save_every=0, device="cpu")
    shown = capsys.readouterr().out
    assert "SY-2mm GCS seed 0: 240 of 280 steps done" in shown
    assert "280 steps, " in shown
    again = make_model(run, env, "cpu")
    env.close()
    assert (again.num_timesteps, again.replay_buffer.pos, again._n_updates) == (280, 140, 45)
    before, after = model.policy.state_dict(), again.policy.state_dict()
    assert any(not torch.equal(before[name], after[name]) for name in before), "it learns"
    first, second = (torch.load(folder / "actor.pt", weights_only=True) for folder in (trained_run, copied))
    assert (second["steps"], second["updates"]) == (280, 45)
    assert 0 < first["seconds"] < second["seconds"]
    mean, newest = second["actor"]["latent_pi.0.weight"], after["actor.latent_pi.0.weight"]
    assert not torch.equal(mean, newest), "the saved actor is a running mean"


def test_what_the_paper_leaves_open_is_an_option(tmp_path, capsys):
    words = ["--method", "DT", "--steps", "0", "--envs", "1", "--buffer", "100", "--out", str(tmp_path / "run")]
    assert command(train, [*words, "--parameters.grip-force", "20", "--device", "cpu"]) == 0
    run = Run.open(tmp_path / "run")
    assert run.parameters == Parameters(grip_force=20)
    assert not run.redraw, "there is nothing to draw for DT"
    capsys.readouterr()
    assert command(train, ["--resume", "--out", str(tmp_path / "run"), "--device", "cpu"]) == 0
    assert "0 of 0 steps done" in capsys.readouterr().out, "it keeps its number of steps"
    evaluate(tmp_path / "run", trials=1, out=tmp_path)
    (path,) = tmp_path.glob("*.json")
    assert Result.load(path).training["parameters"]["grip_force"] == 20
    words = ["--steps", "0", "--envs", "1", "--buffer", "100", "--per-episode", "--out", str(tmp_path / "paper")]
    assert command(train, words) == 0
    assert not Run.open(tmp_path / "paper").redraw


def test_a_training_ends_at_a_success_rate_and_goes_on_to_a_larger_one(tmp_path, capsys, monkeypatch):
    """On a hole that is hard to miss, random actions succeed in a quarter of the episodes."""
    monkeypatch.setattr(learner, "WINDOW", 20)
    easy = Parameters(success_depth=18.9e-3, start=((-1e-3, -1e-3, 5e-3), (1e-3, 1e-3, 6e-3)))
    run = tmp_path / "run"
    train("SX-2mm", "DT", until=0.05, parameters=easy, out=run, steps=4000, updates=0.005, buffer=2000, device="cpu")
    steps = torch.load(run / "actor.pt", weights_only=True)["steps"]
    assert 2400 <= steps <= 2420, "twenty episodes of 120 steps"
    assert "ended; success 0." in capsys.readouterr().out.splitlines()[-1]
    train(out=run, resume=True, device="cpu")
    assert "ended at a success of 0.05: pass a larger --until" in capsys.readouterr().out
    evaluate(run, trials=1, engine="native", out=tmp_path / "out")
    (result,) = map(Result.load, (tmp_path / "out").iterdir())
    assert result.has_ended
    assert 0.05 <= result.training["success"] < 0.6
    train(out=run, resume=True, until=1.0, device="cpu")
    assert torch.load(run / "actor.pt", weights_only=True)["steps"] >= 4000


def test_the_update_is_that_of_sac(trained_run):
    """From the same weights, draws and transitions, the weights after an update are those of stable-baselines3."""
    run = Run.open(trained_run)
    envs = run.make_envs()
    own, usual = make_model(run, envs, "cpu"), make_model(run, envs, "cpu")
    usual.__class__ = SAC
    batch = own.replay_buffer.sample(64)
    for model in (own, usual):
        model.set_logger(configure(None, []))
        model.replay_buffer.sample = lambda *_, **__: batch
    before = copy.deepcopy(own.policy.state_dict())
    for model, order in ((own, (1, 0)), (usual, (0, 1))):
        noise = [torch.randn(64, 1, generator=torch.Generator().manual_seed(seed)) for seed in order]
        draws = iter(noise)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(torch, "randn_like", lambda _, draws=draws: next(draws))
            model.train(1, 64)
    after, expected = own.policy.state_dict(), usual.policy.state_dict()
    moved = {name for name in after if not torch.equal(after[name], before[name])}
    assert any(name.startswith("actor") for name in moved)
    assert any(name.startswith("critic_target") for name in moved)
    for name, value in after.items():
        torch.testing.assert_close(value, expected[name], msg=name)
    assert own.log_ent_coef.item() == pytest.approx(usual.log_ent_coef.item(), abs=1e-6)
    envs.close()


class Harmful:
    """An object that runs code when it is unpickled."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_a_folder_from_elsewhere_runs_no_code(copied, trained_run, tmp_path):
    """Neither the objects beside the weights of a model.zip nor a pickled actor.pt run code."""
    mark = tmp_path / "ran"
    with zipfile.ZipFile(trained_run / "model.zip") as whole, zipfile.ZipFile(copied / "model.zip", "w") as changed:
        for name in whole.namelist():
            data = whole.read(name)
            if name == "data":
                document = json.loads(data)
                pickled = base64.b64encode(cloudpickle.dumps(Harmful(mark))).decode()
                for value in document.values():
                    if isinstance(value, dict) and ":serialized:" in value:
                        value[":serialized:"] = pickled
                data = json.dumps(document)
            changed.writestr(name, data)
    run = Run.open(copied)
    envs = run.make_envs()
    make_model(run, envs, "cpu")
    torch.save(Harmful(mark), copied / "actor.pt")
    with pytest.raises(paxisim.InvalidValueError, match=r"actor\.pt is not an actor"):
        run.policy(envs.envs[0])
    assert not mark.exists()
    envs.close()


def test_what_is_wrong_is_said_in_one_line(trained_run, tmp_path, capsys):
    run, out, none = str(trained_run), str(tmp_path / "a"), str(tmp_path)
    for function, words, told in (
        (train, ["--task", "SX-3mm", "--out", out], "unknown task 'SX-3mm'"),
        (train, ["--method", "DTT", "--out", out], "unknown method 'DTT'"),
        (train, ["--updates", "0", "--out", out], "updates must be positive"),
        (train, ["--temperature", "inf", "--out", out], "temperature must be positive and finite"),
        (train, ["--batch", "0", "--out", out], "batch must be at least 1"),
        (train, ["--seed", "one", "--out", out], "--seed: invalid literal for int"),
        (train, ["--sede", "1"], "Unrecognized options: --sede, 1; see python -m paxisim_insertion.train --help"),
        (train, ["--parameters.density", "-5", "--out", out], "density must be positive"),
        (train, ["--out", run], "has a run already"),
        (train, ["--resume", "--out", none], "has no run"),
        (evaluate, ["--run", none], "has no run"),
        (evaluate, ["--run", run, "--trials", "0"], "at least one trial"),
        (evaluate, ["--run", run, "--drawn", "--transfer", "pads"], "one of --sensor, --transfer and --drawn"),
        (evaluate, ["--run", run, "--engine", "warp", "--drawn"], "--engine warp without"),
        (evaluate, ["--run", run, "--sensor", str(tmp_path / "none.json")], "No such file"),
    ):
        assert command(function, words) == 2, words
        line = capsys.readouterr().err
        assert told in line, words
        assert line.count("\n") == 1, words
    assert not (tmp_path / "a").exists()


def test_a_run_of_other_versions_or_of_another_layout(copied, capsys):
    document = json.loads((copied / "run.json").read_text())
    document["versions"]["mujoco"] = "3.0.0"
    (copied / "run.json").write_text(json.dumps(document))
    with pytest.raises(paxisim.InvalidValueError, match=r"made with mujoco 3\.0\.0 \(here .*resume it with those"):
        train(resume=True, out=copied)
    run = Run.open(copied)
    assert "made with mujoco 3.0.0 (here" in capsys.readouterr().err
    other = InsertionEnv("SX-2mm", "TF", engine="native")
    with pytest.raises(paxisim.InvalidValueError, match="perhaps its layout, k or task differ"):
        run.policy(other)
    (copied / "actor.pt").unlink()
    with pytest.raises(paxisim.InvalidValueError, match="has no actor yet"):
        run.policy(other)
    (copied / "run.json").write_text("{}")
    with pytest.raises(paxisim.InvalidValueError, match="not a run of this version"):
        Run.open(copied)


def test_no_two_runs_and_resumptions_have_an_environment_in_common(tmp_path):
    starts = [Run(tmp_path, "SX-2mm", "GCS", seed).seed_after(done) for seed in range(5) for done in (0, 1, 4, 1000)]
    assert min(np.diff(sorted(starts))) > 100, "environments use consecutive seeds"


@pytest.mark.slow
def test_a_short_training_is_better_than_chance(tmp_path):
    """It learns, blind and in the native engine, to push a peg above the hole down gently in robosuite's engine."""
    above = Parameters(start=((0, -5e-4, 2e-3), (0, 5e-4, 4e-3)), grasp_offset=(0, 0, 0), grasp_lean=0)
    run = Run(tmp_path, "SX-2mm", "NT", envs=2, buffer=3000, updates=0.5, parameters=above)
    run.create()
    envs = run.make_envs()
    env = InsertionEnv("SX-2mm", "NT", parameters=above)

    def mean_return(act):
        total = 0.0
        for seed in range(4):
            observation, _ = env.reset(seed=seed)
            truncated = False
            while not truncated:
                observation, reward, _, truncated, _ = env.step(act(observation))
                total += reward / 4
        return total

    model = make_model(run, envs, "cpu")
    model.set_logger(configure(None, []))
    env.action_space.seed(0)
    by_chance = mean_return(lambda observation: env.action_space.sample())
    model.learn(1600)
    trained = mean_return(lambda observation: model.predict(observation, deterministic=True)[0])
    envs.close()
    env.close()
    assert trained > 1.5 * by_chance, f"seed {run.seed}: {by_chance:.0f} by chance, {trained:.0f} trained"
