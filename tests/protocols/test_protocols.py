"""Protocols: speed limits, excited causes, rehearsal, and the JSON format."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim import InvalidValueError, Protocol, UnknownNameError
from paxisim.protocols.protocol import peak_forces
from paxisim.protocols.segment import Segment
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(3, 3, (7e-3, 7e-3))
SCENES = {
    "indenter": ready.indenter(LAYOUT),
    "peg": ready.gripper(LAYOUT, peg=True),
    "gripper": ready.gripper(LAYOUT),
}


def part(protocol, episode, *names):
    """Return the protocol reduced to one episode, or to the named segments of it."""
    chosen = tuple(s for s in protocol.segments if s.episode == episode and (not names or s.name in names))
    return replace(protocol, segments=chosen)


@pytest.mark.parametrize("name", paxisim.known_protocols())
def test_a_protocol_keeps_its_limits_and_excites_each_cause_in_two_episodes(name, tmp_path):
    protocol = paxisim.protocol(name)
    time = np.arange(0, protocol.seconds, 1e-3)
    speed = np.abs(np.diff(protocol.positions(time), axis=0)).max() / 1e-3
    assert 0.5 * protocol.max_speed < speed <= 1.001 * protocol.max_speed
    episodes = {}
    for segment in protocol.segments:
        for cause in segment.excites:
            episodes.setdefault(cause, set()).add(segment.episode)
    assert {"press": 21, "regrasp": 14, "open-close": 3}[name] == len(episodes)
    assert min(map(len, episodes.values())) >= 2, "a cause of one episode could not be held out"
    assert len({segment.episode for segment in protocol.segments}) == 8
    assert protocol.seconds > 600, "drift needs ten minutes on one clock"
    protocol.save(tmp_path / "motion.json")
    assert Protocol.load(tmp_path / "motion.json") == protocol


def test_a_robot_s_own_program_reads_times_and_positions(tmp_path):
    protocol = paxisim.protocol("press", depth=1e-3, stop_force=12.0, pad=(0.02, 0.02))
    protocol.save(tmp_path / "press.json")
    document = json.loads((tmp_path / "press.json").read_text(encoding="utf-8"))
    assert document["columns"] == ["time", "x", "y", "depth"]
    assert document["stop_at_normal_force_on_a_pad"] == 12.0
    rows = [row for segment in document["segments"] for row in segment["waypoints"]]
    np.testing.assert_array_equal(rows, protocol.waypoints)
    assert max(row[3] for row in rows) == 1e-3
    assert max(abs(row[1]) for row in rows) <= 0.01, "within the pad"
    taps = next(segment for segment in document["segments"] if segment["name"] == "taps")
    assert set(taps["excites"]) == {"latency", "low_pass"}


def test_presses_are_rehearsed():
    protocol = part(paxisim.protocol("press"), 3)
    recording = protocol.rehearse(SCENES["indenter"])
    assert recording.measured is None
    assert set(recording.episode) == {3}
    assert recording.rate == pytest.approx(protocol.rate)
    np.testing.assert_allclose(recording.covariates["depth"], protocol.positions(recording.time)[:, 2])
    total = recording.simulated.sum(axis=(1, 3, 4))
    begin = protocol.segments[0].waypoints[-1][0]
    for segment in protocol.segments[1:]:
        inside = (recording.time > begin) & (recording.time <= segment.waypoints[-1][0])
        begin = segment.waypoints[-1][0]
        most = np.abs(total[inside]).max(axis=0)
        if segment.name == "free":
            assert not most.any()
        elif segment.name == "slides":
            assert min(most[:2]) > 0.3 * most[2], "past slip along both axes"
        else:
            assert most[2] > 0.02
    assert peak_forces(recording)["pad_pad"] == pytest.approx(total[:, 2].max())
    assert 1 < total[:, 2].max() < protocol.stop_force


@pytest.mark.xfail(
    int(mujoco.__version__.split(".")[0]) >= 4,
    reason="on MuJoCo 4.0 the peg slips, as in tests/scene: the pads' peaks differ by 8 %, for an unknown reason",
)
def test_a_peg_is_held_and_grasped_again_by_both_pads_alike():
    protocol = part(paxisim.protocol("regrasp"), 2, "approach", "taps", "staircase", "regrasp")
    recording = protocol.rehearse(SCENES["peg"])
    total = recording.simulated[:, :, 2].sum(axis=(2, 3))
    assert 5 < total.max() < protocol.stop_force
    np.testing.assert_allclose(total.max(axis=0), total.max(), rtol=0.05)
    touched = np.diff((total.sum(axis=1) > 0).astype(int)) > 0
    assert touched.sum() == 7, "three taps, a staircase, three grasps"


def test_nothing_is_touched_where_a_gripper_opens_and_closes():
    recording = part(paxisim.protocol("open-close"), 1, "open and close").rehearse(SCENES["gripper"])
    assert not recording.simulated.any()
    assert np.ptp(recording.covariates["opening"]) == pytest.approx(0.06, rel=1e-3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: part(paxisim.protocol("press"), 2, "taps").rehearse(SCENES["gripper"]), "unknown stream 'opening'"),
        (lambda: paxisim.protocol("pres"), "did you mean 'press'"),
        (lambda: paxisim.protocol("open-close", depth=1e-3), "unknown option of protocol 'open-close' 'depth'"),
        (lambda: paxisim.protocol("press", depth=1.5), "got 1500 mm"),
        (lambda: paxisim.protocol("press", stop_force=0.0), "stop_force"),
        (lambda: paxisim.protocol("press", pad=(0.0, 1e-2)), "a pad's size"),
        (lambda: replace(paxisim.protocol("press"), max_speed=0.01), "faster than"),
        (lambda: Segment("a", 0, "", ("tap",), ((0.0, 1.0),)), "unknown motion of segment 'a' 'tap'; did you mean"),
        (lambda: Segment("a", 0, "", (), ()), "segment 'a' of episode 0 needs a waypoint"),
    ],
)
def test_what_cannot_be_a_protocol_is_said(make, says):
    with pytest.raises((InvalidValueError, UnknownNameError), match=says):
        make()


BAD = {
    "not JSON": lambda text: text[:-5],
    "expected a protocol, a JSON object of format": lambda text: "[]",
    "expected a protocol.*got 'paxisim-protocol/2'": lambda text: text.replace("protocol/1", "protocol/2"),
    "max_speed must be a number, got 'fast'": lambda text: text.replace('"max_speed": 0.025', '"max_speed": "fast"'),
    "name must be a string, got None": lambda text: text.replace('"name": "press",', ""),
    "columns must be": lambda text: text.replace('["time",', '["t",'),
    "a waypoint must be a list of numbers": lambda text: text.replace("[0.0, 0.0, 0.0, -0.002]", '["now"]'),
    "a waypoint must be a time and a position of x, y, depth": lambda text: text.replace(
        "[0.0, 0.0, 0.0, -0.002]", "[0.0, 0.0]"
    ),
    "times of waypoints must increase": lambda text: text.replace("[0.0, 0.0, 0.0, -0.002]", "[9e9, 0, 0, 0]"),
    "episode must be a whole number": lambda text: text.replace('"episode": 0', '"episode": 0.5'),
    "in the order of their episodes": lambda text: text.replace('"episode": 0', '"episode": 9'),
}


def test_a_file_that_is_no_protocol_is_refused_in_one_line_that_names_it(tmp_path):
    path = tmp_path / "press.json"
    paxisim.protocol("press").save(path)
    text = path.read_text(encoding="utf-8")
    for says, spoil in BAD.items():
        path.write_text(spoil(text), encoding="utf-8")
        with pytest.raises(InvalidValueError, match=says) as caught:
            Protocol.load(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
