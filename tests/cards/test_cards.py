"""Sensor cards: made of a diagnosis, saved, shared, and judged on recordings."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest

import paxisim
from paxisim.augment import AxisGain, Creep, Drift, Latency, Offset, read_recording
from paxisim.cards.card import Source
from paxisim.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the example's recording and its diagnosis."""
    where = tmp_path_factory.mktemp("card")
    assert main(["example", "recording", "-o", str(where / "paired.mcap")]) == 0
    found = paxisim.diagnose(paxisim.Recording.load(where / "paired.mcap"), ["axis_gain", "latency"])
    found.save(where / "diagnosis")
    return where


@pytest.fixture(scope="module")
def recording(folder):
    return paxisim.Recording.load(folder / "paired.mcap")


def rmse(measured, other):
    return float(np.sqrt(np.sum((measured - other) ** 2.0) / np.sum(measured**2.0)))


def test_a_card_says_what_it_is_of_and_survives_its_file(folder, recording, capsys):
    words = ["card", str(folder / "diagnosis" / "model.json"), "--product", "paxini-gen1-l4629", "--unit", "7 & <8>"]
    pytest.importorskip("jinja2")
    assert main([*words, "--recording", str(folder / "paired.mcap"), "-o", str(folder / "card")]) == 0
    assert "index.html: the card as a page" in capsys.readouterr().out
    card = paxisim.Card.load(folder / "card")
    found = paxisim.diagnose.Diagnosis.load(folder / "diagnosis")
    assert (card.product, card.unit, card.verdict) == ("paxini-gen1-l4629", "7 & <8>", found.verdict)
    assert card.source == Source.of(folder / "paired.mcap", recording)
    assert len(card.source.sha256) == 64
    assert card.model.to_json() == found.model.to_json()
    assert [cause.name for cause in card.causes] == [cause.name for cause in found.causes]
    assert card.held_out[:2] == (found.heldout.nrmse_before, found.heldout.nrmse_after)
    assert paxisim.Card.from_json(card.to_json()).to_json() == card.to_json()
    page = (folder / "card" / "index.html").read_text(encoding="utf-8")
    bare = re.sub(r'src="data:[^"]*"', "", page)
    assert not re.search(r"https?:|<script|@import|url\(", bare), "it loads nothing"
    assert "<8>" not in bare
    shown = html.unescape(bare)
    assert all(cause.name in shown and text in shown for cause in card.causes for text in cause.parameters.values())
    assert card.source.sha256 in shown
    assert page.count("<img") == 4, "a map of each axis, and the trace of the only episode"
    chains = [card.randomisation.sample(np.random.default_rng(seed)) for seed in (0, 1)]
    assert chains[0].names == chains[1].names == card.model.names
    assert chains[0].to_json() != chains[1].to_json()
    assert main([*words, "-o", str(folder / "card")]) == 2
    assert "card.json exists; --force overwrites it" in capsys.readouterr().err


def test_a_score_is_the_normalised_rmse_on_any_recording(folder, recording, capsys):
    model = paxisim.Chain.load(folder / "diagnosis" / "model.json")
    card = replace(paxisim.Card.of(paxisim.diagnose.Diagnosis.load(folder / "diagnosis"), "any"), notes=())
    score = card.judge(recording)
    read = read_recording(model, recording)
    assert score.simulation == pytest.approx(rmse(recording.measured, recording.simulated))
    assert score.model == pytest.approx(rmse(recording.measured, read.simulated))
    assert score.model < 0.4 * score.simulation
    assert set(score.pads) == {"left", "right"}
    offset = recording.with_simulated(recording.simulated)
    offset = replace(offset, measured=offset.measured + 0.5)
    moved = card.judge(offset)
    assert moved.model > score.model
    assert moved.zeroed_model * rmse(offset.measured, 0) == pytest.approx(
        score.zeroed_model * rmse(recording.measured, 0), rel=0.6
    )
    unknown = recording.simulated.copy()
    unknown[100:200] = np.nan
    assert card.judge(recording.with_simulated(unknown)).samples == len(recording) - 100
    pytest.importorskip("jinja2")
    assert main(["judge", str(folder / "diagnosis" / "model.json"), str(folder / "paired.mcap")]) == 0
    assert f"{score.simulation:.1%}" in capsys.readouterr().out


def test_a_recording_through_a_sensor_remembers_the_episode_before_unless_it_was_interrupted(recording):
    pressed = 500 + int(np.argmax(np.abs(recording.simulated[500:]).sum(axis=(1, 2, 3, 4))))
    episodes = replace(recording, episode=np.repeat([0, 1], [pressed, len(recording) - pressed]))
    assert np.array_equal(
        read_recording(AxisGain((1, 1, 2)), episodes).simulated[:, :, 2], 2 * recording.simulated[:, :, 2]
    )
    sensor = paxisim.Chain([Creep((0.3,), (1.0,)), Latency(0.1)])
    whole, split = (read_recording(sensor, one).simulated for one in (recording, episodes))
    np.testing.assert_array_equal(split, whole, "the episodes follow without a break")
    # after a break under load nobody knows what the sensor felt, so it begins settled
    broken = replace(episodes, time=recording.time + 2.0 * (np.arange(len(recording)) >= pressed))
    anew = read_recording(sensor, broken).simulated
    np.testing.assert_allclose(anew[:pressed], whole[:pressed], atol=1e-5)
    np.testing.assert_allclose(anew[pressed], 1.3 * recording.simulated[pressed], rtol=1e-5)
    assert np.abs(anew[pressed] - whole[pressed]).max() > 0.01
    # a pause at rest is remembered if it is short
    rest = 500 + int(np.flatnonzero(~recording.simulated[500:].any(axis=(1, 2, 3, 4)))[0]) + 1
    pauses = [2.0, 30.0]
    paused = [
        read_recording(
            paxisim.Chain([Creep((0.3,), (10.0,))]),
            replace(
                recording,
                episode=np.repeat([0, 1], [rest, len(recording) - rest]),
                time=recording.time + pause * (np.arange(len(recording)) >= rest),
            ),
        ).simulated[rest]
        for pause in pauses
    ]
    assert np.abs(paused[0]).max() > 0.001
    np.testing.assert_array_equal(paused[1], 0)
    drift = Drift(0.01 * np.ones((2, 3, 6, 5)), tau=1e9)
    drifted = read_recording(drift, episodes).simulated - recording.simulated
    assert drifted[500:].min() >= drifted[:500].max() - 1e-6
    with pytest.raises(paxisim.InvalidValueError, match="no simulated tensor"):
        read_recording(Offset(np.zeros((2, 3, 6, 5))), replace(recording, simulated=None))


def test_what_is_no_card(folder, recording, tmp_path, capsys):
    found = paxisim.diagnose.Diagnosis.load(folder / "diagnosis")
    with pytest.raises(paxisim.InvalidValueError, match="there is no model"):
        paxisim.Card.of(replace(found, model=paxisim.Chain()), "any")
    with pytest.raises(paxisim.InvalidValueError, match="expected the sensor's product"):
        paxisim.Card.of(found, " ")
    card = paxisim.Card.of(found, "any")
    for broken in ({}, {"format": "paxisim-card/2"}, {**json.loads(card.to_json()), "held_out": [1]}):
        with pytest.raises(paxisim.InvalidValueError):
            paxisim.Card.from_json(json.dumps(broken))
    with pytest.raises(paxisim.InvalidValueError, match="needs measured and simulated"):
        card.judge(replace(recording, measured=None))
    with pytest.raises(paxisim.InvalidValueError, match="is in uT"):
        card.judge(replace(recording, metadata={"unit": "uT"}))
    (tmp_path / "no.json").write_text("[1]")
    for words, said in (
        ([str(tmp_path / "no.json"), str(folder / "paired.mcap")], "no.json"),
        ([str(tmp_path), str(folder / "paired.mcap")], "no such file"),
        ([str(folder / "diagnosis" / "model.json")], "expected a recording"),
    ):
        assert main(["judge", *words]) == 2
        assert said in capsys.readouterr().err
