"""Where a free object stands in each grasp, found from how its force is distributed over the taxels."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scene.test_grasps import carried, mjcf, scene  # noqa: F401

import paxisim
from paxisim import InvalidValueError, ObjectStart, Recording
from paxisim.augment import AxisGain, Chain, Latency
from paxisim.cli import main
from paxisim.diagnose.data.prepare import prepare

SHIFT, TURN = 6e-4, np.radians(0.7)  # along x, into the first pad is -x
STOOD = ObjectStart("box", (SHIFT, 0, 0.02), (np.cos(TURN / 2), 0, 0, np.sin(TURN / 2)))


@pytest.fixture(scope="module")
def aside(scene, carried):  # noqa: F811
    """What a sensor with a gain and a delay reads if the box stands elsewhere."""
    felt = replace(scene, start=(STOOD,)).prepare(carried).forces().astype(float)
    read = Chain([AxisGain((0.8,) * 3), Latency(0.04)]).run(felt, carried.time)
    noise = np.random.default_rng(0).normal(0, 0.003, read.shape)
    return replace(carried, measured=(read + noise).astype(np.float32))


def error(paired):
    """Return the error of the simulated distribution of the force while the box is held."""
    held = paired.measured[:, :, 2].sum(axis=(1, 2, 3)) > 2
    held &= np.isfinite(paired.simulated).all(axis=(1, 2, 3, 4))
    ours, theirs = (s[held] / s[held][:, :, 2].sum(axis=(1, 2, 3))[:, None, None, None, None] for s in streams(paired))
    return np.linalg.norm(ours - theirs) / np.linalg.norm(ours)


def said(capsys):
    return " ".join(capsys.readouterr().out.split())


def streams(paired):
    return paired.measured.astype(float), paired.simulated.astype(float)


def test_a_box_that_stands_elsewhere_is_found_through_a_gain_and_a_delay(scene, aside):  # noqa: F811
    found, placed, places = paxisim.place_objects(scene, aside)
    assert [item.episode for item in places] == [0, 1]
    assert abs(places[0].shift) == pytest.approx(SHIFT, abs=2e-4)
    assert abs(places[0].turn) == pytest.approx(TURN, abs=np.radians(0.25))
    assert places[0].after < 0.3 * places[0].before
    first = placed.covariates["box_start"][0]
    np.testing.assert_allclose(first[:2], [SHIFT, 0], atol=2e-4)
    assert np.sign(first[6]) == np.sign(TURN)
    assert placed.episode.max() == 1, "each grasp is an episode"
    assert np.isfinite(placed.measured).all()
    assert error(found.simulate(placed)) < 0.4 * error(scene.simulate(aside))


def test_the_shell_places_and_a_box_in_its_place_stays_there(scene, aside, carried, tmp_path, monkeypatch, capsys):  # noqa: F811
    monkeypatch.chdir(tmp_path)
    aside.save("aside.mcap")
    scene.save("scene.toml")
    assert main(["replay", "aside.mcap", "--scene", "scene.toml", "--place-objects", "-o", "paired.mcap"]) == 0
    assert re.search(
        r"grasp 0 placed by -0\.[4-8]\d mm, \+0\.\d\d deg: distribution of the force off by \d\d%, now 1\d%",
        said(capsys),
    )
    paired = Recording.load("paired.mcap")
    assert error(paired) < 0.4 * error(scene.simulate(aside))
    assert "box_start[0]" not in prepare(paired)[0].covariates, "nothing follows a pose at the start"
    again = paxisim.Scene.from_recording(paired).simulate(paired)
    np.testing.assert_allclose(again.simulated, paired.simulated, atol=1e-3)
    there = paxisim.place_objects(scene, carried)[2]
    assert abs(there[0].shift) < 1e-4


def test_what_cannot_be_placed_is_refused(scene, carried):  # noqa: F811
    with pytest.raises(InvalidValueError, match="needs measured forces in newtons"):
        paxisim.place_objects(scene, replace(carried, metadata={"unit": "uT"}))
    fixed = replace(scene, mjcf=re.sub('<joint type="free"[^>]*/>', "", str(scene.mjcf)), start=())
    with pytest.raises(InvalidValueError, match="one free object, got 0"):
        paxisim.place_objects(fixed, carried)
