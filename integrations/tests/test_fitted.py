"""Training on a diagnosis: its model, drawn within its intervals, replaces GCS."""

import dataclasses

import numpy as np
import pytest
from paxisim_insertion import InsertionEnv
from paxisim_insertion.evaluate import evaluate
from paxisim_insertion.learner import make_model
from paxisim_insertion.results import Result
from paxisim_insertion.run import Run
from paxisim_insertion.shell import command
from paxisim_insertion.train import train

import paxisim

GAIN = np.array([1.0, 1.0, 0.8])


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """Folder of the diagnosis of a sensor that reads 20 % too little normal force."""
    rng = np.random.default_rng(0)
    time = np.arange(0, 24, 0.08)
    load = np.clip(6 * np.sin(1.3 * time) * np.sin(0.21 * time), 0, None)
    drag = np.stack([0.3 * np.sin(2.1 * time), 0.3 * np.cos(1.7 * time), np.ones_like(time)], axis=1)
    simulated = load[:, None, None, None, None] * drag[:, None, :, None, None] * rng.uniform(0.2, 1, (2, 1, 1, 2))
    measured = paxisim.Chain([paxisim.augment.AxisGain(tuple(GAIN))]).run(simulated, time)
    measured = measured + rng.normal(0, 0.03, measured.shape)
    found = paxisim.diagnose(paxisim.Recording(time=time, measured=measured, simulated=simulated))
    assert [cause.name for cause in found.causes] == ["axis_gain"]
    folder = tmp_path_factory.mktemp("diagnosis")
    found.save(folder)
    return folder


def gains(frames, raw):
    """Gain of each axis, from frames (..., pads, 3, rows, cols) and the raw frames."""
    return (frames * raw).sum(axis=(-4, -2, -1)) / (raw * raw).sum(axis=(-4, -2, -1))


def test_an_environment_draws_from_the_gcs_that_is_given(diagnosed):
    found = paxisim.diagnose.Diagnosis.load(diagnosed)
    gcs = paxisim.GCS.around(found.model, found.intervals)
    env = InsertionEnv("SX-2mm", "GCS", engine="native", gcs=gcs)
    low, high = found.intervals["axis_gain"]["gain"]
    drawn = []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        drawn.append(gains(env.reading, env.raw))
        assert np.all((drawn[-1] >= low - 1e-5) & (drawn[-1] <= high + 1e-5)), drawn[-1]
        heights = env.scene.model_and_data[0].geom_size[env.scene.tactile.pads.geoms, 0]
        assert np.ptp(heights) > 1e-5, "the surface is drawn as in GCS"
    np.testing.assert_allclose(drawn[0], GAIN, atol=0.02)
    assert np.abs(drawn[0] - drawn[1]).max() > 1e-5
    np.testing.assert_array_equal(drawn[0], drawn[2])


def test_chains_that_do_not_fit_are_refused_at_once():
    wide = paxisim.GCS.around(paxisim.Chain([paxisim.augment.TaxelGain(np.ones((2, 12, 10)))]), {})
    with pytest.raises(paxisim.InvalidValueError, match=r"gain of shape \(2, 12, 10\) does not fit a tensor of shape"):
        InsertionEnv("SX-2mm", "GCS", gcs=wide)
    warm = paxisim.Chain([paxisim.augment.TemperatureDrift(-0.001)])
    with pytest.raises(paxisim.InvalidValueError, match="needs the covariate 'temperature'"):
        InsertionEnv("SX-2mm", "GCS", gcs=paxisim.GCS.around(warm, {}))


def trained(model, out, steps):
    """Train a tiny policy on a diagnosis in the shell; return its exit status."""
    words = ["--envs", "1", "--buffer", "300", "--device", "cpu", "--updates", "1", "--steps", str(steps)]
    return command(train, ["--model", str(model), "--out", str(out), *words])


def test_a_policy_is_trained_on_a_diagnosis(diagnosed, tmp_path, capsys):
    folder = tmp_path / "run"
    assert trained(diagnosed, folder, 105) == 0
    assert "SX-2mm GCS fitted seed 0" in capsys.readouterr().out
    run = Run.open(folder)
    found = paxisim.diagnose.Diagnosis.load(diagnosed)
    assert run.diagnosis.model.to_json() == found.model.to_json()
    env = run.make_envs()
    model = make_model(run, env, "cpu")
    assert model.num_timesteps == 105
    assert model._n_updates > 0
    buffer = model.replay_buffer
    frames = buffer.sample(64).observations["tactile"].numpy().reshape(64, -1, 2, 3, 6, 5)[:, -1]
    raw = buffer.observations["raw"][:105, 0]
    # a sample is a raw frame of the buffer with its own draw
    low, high = found.intervals["axis_gain"]["gain"]
    closest = [min(np.abs(g - GAIN).max() for g in gains(frame, raw)) for frame in frames]
    assert max(closest) < np.abs([low - GAIN, high - GAIN]).max() + 1e-3
    evaluate(folder, trials=1, engine="native", out=tmp_path / "results")
    (path,) = (tmp_path / "results").iterdir()
    result = Result.load(path)
    assert (result.method, result.training["model"], result.training["steps"]) == ("GCS fitted", ["axis_gain"], 105)


def test_a_model_with_memory_is_not_drawn_anew_for_each_sample(diagnosed, tmp_path):
    found = paxisim.diagnose.Diagnosis.load(diagnosed)
    model = paxisim.Chain([paxisim.augment.Creep((0.3,), (1.0,))])
    dataclasses.replace(found, model=model, intervals={}).save(tmp_path / "creep")
    assert trained(tmp_path / "creep", tmp_path / "run", 3) == 0
    assert not Run.open(tmp_path / "run").redraw


def test_what_is_no_model_is_said_in_one_line(diagnosed, tmp_path, capsys):
    found = paxisim.diagnose.Diagnosis.load(diagnosed)
    nothing = dataclasses.replace(found, verdict="no_discrepancy", causes=(), model=paxisim.Chain(), intervals={})
    nothing.save(tmp_path / "nothing")
    wide = paxisim.Chain([paxisim.augment.TaxelGain(np.ones((2, 12, 10)))])
    dataclasses.replace(found, model=wide, intervals={}).save(tmp_path / "wide")
    for model, told in (
        (tmp_path / "nothing", "names no cause (its verdict is no_discrepancy)"),
        (diagnosed / "model.json", "expected the folder of a diagnosis, got the file"),
        (tmp_path / "none", "No such file"),
        (tmp_path / "wide", "does not fit a tensor of shape (2, 3, 6, 5)"),
    ):
        assert trained(model, tmp_path / "run", 1) == 2
        line = capsys.readouterr().err
        assert told in line
        assert line.count("\n") == 1
    assert not (tmp_path / "run").exists()


def found_in_scene(folder, found):
    """Save a diagnosis that also found a friction and the position of a gripper's second pad."""
    fingers = """<mujoco><worldbody><body name="fixed"/><body name="moves" pos="0 0 0.1"><joint name="z" type="slide"
    axis="0 0 1"/><geom type="box" size="0.02 0.02 0.01" mass="0.1"/></body></worldbody></mujoco>"""
    mounts = [
        paxisim.Mount("fixed", name="first"),
        paxisim.Mount("moves", (0.0, 0.0, 0.01), replaces=("moves/0",), name="second"),
    ]
    made = paxisim.attach(fingers, paxisim.TaxelLayout(6, 5, 4e-3), mounts)
    scene = paxisim.Scene(made.to_xml(), (paxisim.Drive("z", joint="z", unit="m"),))
    values = {"friction": 0.6, "mount_offset_x_second_pad": 1e-3}
    own = [("friction", "1", (0.6, 0.5, 0.7)), ("mount_offset_x_second_pad", "mm", (1.0, 1.0, 1.0))]
    causes = [
        paxisim.diagnose.FoundCause(
            name.split("_x")[0],
            (paxisim.diagnose.FittedParameter(name, unit, paxisim.diagnose.Interval(*ends)),),
            paxisim.diagnose.Interval(0.3),
            (),
            "seen",
        )
        for name, unit, ends in own
    ]
    scene = scene.with_parameters(**values)
    dataclasses.replace(found, causes=(*found.causes, *causes), scene=scene, scene_values=values).save(folder)


@pytest.mark.parametrize("engine", ["native", "robosuite"])
def test_what_a_diagnosis_found_in_the_scene_is_drawn_for_each_episode(diagnosed, tmp_path, engine):
    found_in_scene(tmp_path / "found", paxisim.diagnose.Diagnosis.load(diagnosed))
    assert trained(tmp_path / "found", tmp_path / "run", 3) == 0
    run = Run.open(tmp_path / "run")
    loaded = paxisim.diagnose.Diagnosis.load(tmp_path / "found")
    assert run.ranges == paxisim.SceneRanges.around(loaded.scene, loaded.scene_intervals)
    env = run.insertion_env(engine=engine)
    model, _ = env.scene.model_and_data
    pads = env.scene.tactile.pads
    before = model.body_pos[pads.bodies].copy()
    frictions = []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        frictions.append(float(model.geom_friction[pads.geoms, 0].mean()))
        moved = np.linalg.norm(model.body_pos[pads.bodies] - before, axis=1)
        np.testing.assert_allclose(moved, [0.0, 1e-3], atol=1e-9)
    assert 0.5 <= min(frictions) < max(frictions) <= 0.7
    assert frictions[0] == frictions[2] != frictions[1]
    for other in ({"sensor": paxisim.Chain([])}, {"gap": True}):
        env = run.insertion_env(engine="native", **other)
        model, _ = env.scene.model_and_data
        plain = model.geom_friction.copy()
        env.reset(seed=0)
        np.testing.assert_array_equal(model.geom_friction, plain, err_msg="a test of another sensor or robot has none")
