"""Replays with other values: the same in parallel as alone, cached by content, and failures are reported."""

from dataclasses import replace

import numpy as np
import pytest
from rigs import LAYOUT, recording, steps_of

from paxisim.errors import PaxisimError
from paxisim.scene import ready
from paxisim.scene.replays import Replays
from paxisim.scene.resume import simulate_resumable

SCENE = ready.indenter(LAYOUT)


def motion():
    time = np.arange(60) / 50
    depth = -5e-4 + 1.5e-3 * np.clip(time / 0.6, 0, 1)
    return recording(time, {"x": 0 * time, "y": 0 * time, "depth": depth}, episode=np.repeat([0, 1], 30))


def stop_after_one(done, count, before):
    if done > before:
        raise KeyboardInterrupt


def test_processes_give_what_one_gives_and_the_scene_itself_and_each_episode_its_own_values():
    stiffness = SCENE.parameters()["gel_stiffness"]
    sets = [{number: {stiffness: value} for number in (0, 1)} for value in (1.0, 1.2)]
    with Replays(SCENE, motion(), jobs=2) as several, Replays(SCENE, motion()) as one:
        alone = one.run_sets(sets)
        for a, b, value in zip(several.run_sets(sets), alone, (1.0, 1.2), strict=True):
            np.testing.assert_array_equal(a, b)
            np.testing.assert_allclose(a, SCENE.simulate(motion(), gel_stiffness=value).simulated, atol=1e-3)
            assert a.any()
        mixed = one.run_each({1: {stiffness: 1.2}})
    np.testing.assert_array_equal(mixed[:30], alone[0][:30])
    np.testing.assert_array_equal(mixed[30:], alone[1][30:])
    assert not np.array_equal(alone[0][30:], alone[1][30:])


def test_replays_are_kept_by_what_they_depend_on(tmp_path):
    known = SCENE.parameters()
    with Replays(SCENE, motion(), folder=tmp_path) as replays:
        first = replays.run_each({})
    files = sorted(tmp_path.iterdir())
    assert len(files) == 2  # one per episode
    with np.load(files[0]) as kept:
        np.savez(files[0], **{**kept, "force": kept["force"] + 1})
    files[1].write_bytes(b"damaged")
    with Replays(SCENE, motion(), folder=tmp_path) as replays:
        again = replays.run_each({})
        replays.run_each({0: {known["friction"]: 0.5}})
    assert sorted(np.abs(again - first).max(axis=(1, 2, 3, 4)).round(6).tolist())[::59] == [0.0, 1.0]
    assert len(list(tmp_path.iterdir())) == 3
    with Replays(SCENE.with_parameters(friction=0.7), motion(), folder=tmp_path) as replays:
        replays.run_each({})
    assert len(list(tmp_path.iterdir())) == 5


def test_kept_replays_depend_on_the_grid_and_the_encoder_steps_of_the_whole_recording(tmp_path):
    whole = motion()
    depth = steps_of(whole.covariates["depth"], np.where(whole.episode == 0, 1e-4, 5e-5))
    whole = replace(whole, covariates={**whole.covariates, "depth": depth})
    for used in (whole, whole.select([0]), whole.pool(2, 1)):
        with Replays(SCENE, used, folder=tmp_path) as kept, Replays(SCENE, used) as fresh:
            np.testing.assert_array_equal(kept.run_each({}), fresh.run_each({}))
    for used in (whole, whole.pool(2, 1)):
        with pytest.raises(KeyboardInterrupt):
            simulate_resumable(SCENE, used, tmp_path / "resume", progress=stop_after_one)
    simulate_resumable(SCENE, whole, tmp_path / "resume")


def test_a_file_that_the_scene_includes_counts(tmp_path):
    model, _, rest = SCENE.mjcf.partition("<worldbody>")
    world, _, end = rest.rpartition("</worldbody>")
    (tmp_path / "world.xml").write_text(f"<mujoco><worldbody>{world}</worldbody></mujoco>")
    (tmp_path / "scene.xml").write_text(f'{model}<include file="world.xml"/>{end}')
    scene = replace(SCENE, mjcf=tmp_path / "scene.xml")
    peaks = []
    for _ in range(2):
        with Replays(scene, motion(), folder=tmp_path / "kept") as replays:
            peaks.append(replays.run_each({}).max())
        peaks.append(simulate_resumable(scene, motion(), tmp_path / "resume").simulated.max())
        away = world.replace('<body name="bench">', '<body name="bench" pos="0 0 -0.1">')
        (tmp_path / "world.xml").write_text(f"<mujoco><worldbody>{away}</worldbody></mujoco>")
    assert min(peaks[:2]) > 0
    assert peaks[2:] == [0, 0]


def test_two_replays_to_one_output_are_told_at_the_start(tmp_path):
    def again(done, count, before):
        with pytest.raises(PaxisimError, match="another program is simulating the same output"):
            simulate_resumable(SCENE, motion(), tmp_path / "resume")

    simulate_resumable(SCENE, motion(), tmp_path / "resume", progress=again)
    simulate_resumable(SCENE, motion(), tmp_path / "resume")


def test_values_that_cannot_be_simulated_are_said_and_lose_nothing():
    known = SCENE.parameters()
    deep = {number: {known["joint_offset_depth"]: -5e-3} for number in (0, 1)}
    with Replays(SCENE, motion()) as replays:
        fine, bad = replays.run_sets([{}, {n: {known["object_size"]: float("nan")} for n in (0, 1)}])
        assert not isinstance(fine, PaxisimError)
        assert isinstance(bad, PaxisimError)
        with pytest.raises(PaxisimError):
            replays.run_each({0: {known["object_size"]: float("nan")}})
        assert not replays.run_each(deep).any()  # lifted off the pad
