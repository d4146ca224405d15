"""Causes inside the scene: found by replays, told apart from sensor causes, and listed where not testable."""

from dataclasses import replace

import numpy as np
import pytest
from report_pages import drawn

import paxisim
from paxisim.cli import main
from paxisim.diagnose import Diagnosis, FoundCause, Interval
from paxisim.diagnose.causes.scene import SCENE_CAUSES
from paxisim.diagnose.result import InScene, Streams

LAYOUT = paxisim.TaxelLayout(3, 3, (5e-3, 5e-3))
EPISODES = 6
SOME = ("friction", "gel_stiffness", "joint_offset", "axis_gain", "latency", "grip_force")


def scene():
    """Return a scene with a ball on a stage that slides and presses."""
    text = """<mujoco><option timestep="0.002" cone="elliptic" impratio="10"/><worldbody><body name="bench"/>
    <body name="ball" pos="0 0 0.04"><joint name="x" type="slide" axis="1 0 0"/><joint name="depth" type="slide"
    axis="0 0 -1"/><geom name="ball" type="sphere" size="0.04" mass="0.1"/></body></worldbody></mujoco>"""
    pad = paxisim.Pad(LAYOUT, thickness=4e-3, taxels="spheres")
    made = paxisim.attach(text, pad, [paxisim.Mount("bench", quat=(0, 1, 0, 0), name="pad")])
    drives = tuple(paxisim.Drive(name, joint=name, unit="m", resolution=0.0) for name in ("x", "depth"))
    return paxisim.Scene(made.to_xml(), drives, closing="depth", gel=paxisim.Gel(modulus=300e3))


def motion(seed=0):
    """Return presses at two depths with slides, which differ in each episode."""
    rng = np.random.default_rng(seed)
    time = np.arange(200) / 50
    knots = [0, 0.3, 0.8, 1.1, 1.7, 1.9, 2.3, 2.6, 3.2, 3.4, 4]
    parts = []
    for number in range(EPISODES):
        first, second, way = rng.uniform(0.5e-3, 0.8e-3), rng.uniform(0.9e-3, 1.2e-3), rng.choice([-1, 1])
        down = np.interp(time, knots, [-2e-4, -2e-4, first, first, first, first, second, second, second, second, -2e-4])
        along = way * np.interp(time, knots, [0, 0, 0, 0, 4e-3, 4e-3, 4e-3, 4e-3, 0, 0, 0])
        parts.append((time + 5 * number, along, down, np.full(len(time), number)))
    t, x, depth, episode = (np.concatenate(column) for column in zip(*parts, strict=True))
    silent = np.zeros((len(t), 1, *LAYOUT.shape), np.float32)
    return paxisim.Recording(t, silent, covariates={"x": x, "depth": depth}, episode=episode, layout=LAYOUT)


def measured(sensor=(), seed=0, **values):
    """Return the readings of a sensor in a scene with the given values."""
    felt = scene().simulate(motion(seed), **values)
    chain = paxisim.Chain(list(sensor))
    parts = [chain.run(part.simulated.astype(float), part.time) for part in felt.episodes()]
    noise = np.random.default_rng(seed).normal(0, 0.01, felt.simulated.shape)
    return replace(motion(seed), measured=(np.concatenate(parts) + noise).astype(np.float32))


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Folder that caches replays of the scene for all tests."""
    return tmp_path_factory.mktemp("replays")


def value(found, name):
    """Return the interval of a fitted parameter."""
    return next(p.value for c in found.causes for p in c.parameters if p.name == name)


def test_a_wrong_friction_is_found_with_its_value_and_goes_into_the_scene(kept, tmp_path):
    found = paxisim.diagnose(measured(friction=0.7), SOME, scene=scene(), replays=kept)
    assert [cause.name for cause in found.causes] == ["friction"]
    assert value(found, "friction").low <= 0.7 <= value(found, "friction").high
    assert found.scene.gel.friction == pytest.approx(0.7, abs=0.03)
    assert found.heldout.nrmse_after < 0.5 * found.heldout.nrmse_before
    assert not list(found.model)  # nothing is wrong with the sensor
    assert "follows positions" in found.not_testable["grip_force"]
    found.save(tmp_path / "diagnosis")
    again = Diagnosis.load(tmp_path / "diagnosis")
    beside = tmp_path / "diagnosis" / "scene.toml"  # the user's own scene, in the same folder
    beside.write_text("mine")
    replace(found, scene=None).save(tmp_path / "diagnosis")
    assert beside.read_text() == "mine"
    assert not list((tmp_path / "diagnosis").glob("fitted_scene*"))
    assert again.scene_values == found.scene_values
    assert again.scene.gel == found.scene.gel
    page = (tmp_path / "diagnosis" / "report.html").read_text()
    assert "When sliding" in page
    assert 'paxisim.Scene.load("fitted_scene.toml")' in page
    assert "<code>model.json</code> holds an empty chain" in page
    assert "model.run(" not in page
    assert "friction" in str(found)


@pytest.mark.slow
def test_a_scene_cause_and_a_sensor_cause_are_both_found(kept):
    gain = paxisim.augment.AxisGain((1.0, 1.0, 0.8))
    found = paxisim.diagnose(measured([gain], friction=0.7), SOME, scene=scene(), replays=kept)
    assert {cause.name for cause in found.causes} == {"friction", "axis_gain"}
    assert value(found, "gain_z").value == pytest.approx(0.8, abs=0.03)
    # the sensor's model applies to the simulation with the fitted friction
    again = found.scene.simulate(motion()).simulated.astype(float)
    error = np.concatenate([found.model.run(part, np.arange(len(part)) / 50) for part in np.split(again, EPISODES)])
    recording = measured([gain], friction=0.7)
    assert np.sqrt(np.mean((recording.measured - error) ** 2)) < 0.03


@pytest.mark.slow
def test_a_value_far_beyond_the_first_replays_is_replayed_again(kept):
    """The first replays move the zero by 0.4 mm, and a larger ball shows the same force with another curvature."""
    names = ("joint_offset", "object_size", "stiffening", "axis_gain")
    found = paxisim.diagnose(measured(joint_offset_depth=5e-4), names, scene=scene(), replays=kept)
    assert len(found.causes) == 1
    assert {"joint_offset", "object_size"} <= {found.causes[0].name, *found.causes[0].rivals}
    moved = found.scene_values.get("joint_offset_depth", (found.scene_values.get("object_size", 1.0) - 1) * 0.04)
    assert moved == pytest.approx(5e-4, abs=1.5e-4)


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_wrong_and_causes_inside_a_scene_need_the_scene(kept):
    recording = measured(seed=0)
    found = paxisim.diagnose(recording, SOME, scene=scene(), replays=kept)
    assert not found.causes
    assert not found.scene_values
    with pytest.raises(ValueError, match="give diagnose the scene"):
        paxisim.diagnose(recording, ["friction"])
    with pytest.raises(ValueError, match=r"Scene\.load"):
        paxisim.diagnose(recording, scene="scene.toml")


@pytest.mark.slow
def test_in_the_shell_the_scene_is_a_file_and_a_better_one_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    measured(friction=0.7).save("recording.mcap")
    scene().save("scene.toml")
    words = ["diagnose", "recording.mcap", "--scene", "scene.toml", "--causes", "friction,axis_gain", "-o", "found"]
    assert main(words) == 0
    assert paxisim.Scene.load("found/fitted_scene.toml").gel.friction == pytest.approx(0.7, abs=0.03)
    out, err = capsys.readouterr()
    assert "fitted_scene.toml: the scene with the fitted values" in out
    assert "replaying" in err
    assert main([*words[:-1], "other", "--scene", "missing.toml"]) == 2
    assert main(["diagnose", "recording.mcap", "--causes", "friction", "-o", "third"]) == 2


def test_the_pictures_of_every_scene_cause():
    known, plain = scene().parameters(), scene().simulate(motion())
    for item in SCENE_CAUSES:
        if item.name not in ("grip_force", "base_pose", "hand_pose"):  # this scene has neither actuators nor an arm
            values = {name: each.nominal + 2 * each.step for name, each in known.items() if each.group == item.name}
            changed = scene().simulate(motion(), **values)
            inside = InScene(changed.simulated, {item.name: plain.simulated}, known, values)
            streams = Streams(
                plain.time, plain.episode, changed.simulated, plain.simulated, changed.simulated, plain.covariates,
                plain.pads, LAYOUT, in_scene=inside,
            )  # fmt: skip
            cause = FoundCause(item.name, (), Interval(0.5, 0.4, 0.6), (), "A sentence.")
            assert drawn((cause,), paxisim.Chain(), streams), item.name


@pytest.mark.slow
def test_without_contact_nothing_in_the_scene_can_be_told():
    lifted = motion()
    lifted = replace(lifted, covariates={**lifted.covariates, "depth": lifted.covariates["depth"] - 5e-3})
    silent = np.random.default_rng(0).normal(0, 0.01, lifted.tensor.shape).astype(np.float32)
    found = paxisim.diagnose(replace(lifted, measured=silent), ["friction", "surface"], scene=scene())
    assert "without contact" in found.not_testable["friction"]
    assert "without contact" in found.not_testable["surface"]


@pytest.mark.slow
def test_a_number_that_cannot_change_is_named_and_the_others_are_found():
    # the size of a mesh cannot change if another body uses it
    corners = " ".join(f"{x} {y} {z}" for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (0, 0.04))
    asset = f'<asset><mesh name="block" vertex="{corners}"/></asset><worldbody><geom type="mesh" mesh="block" '
    asset += 'pos="0.3 0 0"/>'
    mjcf = str(scene().mjcf).replace("<worldbody>", asset, 1)
    mjcf = mjcf.replace('<geom name="ball"', '<geom type="mesh" mesh="block" mass="0"/><geom name="ball"', 1)
    inside = replace(scene(), mjcf=mjcf)
    felt = inside.simulate(motion(), gel_stiffness=0.7)
    noise = np.random.default_rng(0).normal(0, 0.01, felt.simulated.shape)
    recording = replace(motion(), measured=(felt.simulated + noise).astype(np.float32))
    found = paxisim.diagnose(recording, ["gel_stiffness", "object_size"], scene=inside)
    assert [cause.name for cause in found.causes] == ["gel_stiffness"]
    assert "no replay shows" in found.not_testable["object_size"]
    assert any("'block'" in line for line in found.symptoms.warnings)
