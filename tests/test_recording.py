"""Recording: its fields and their checks, parts of it, other rates and clocks, and its unit."""

from dataclasses import replace

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.hw.emulation.signals import from_recording
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

FORCE = np.arange(5 * 2 * 3 * 2 * 3, dtype=np.float32).reshape(5, 2, 3, 2, 3)
TIME = np.arange(5) * 0.1


def two_episodes(**changes) -> Recording:
    fields = {
        "time": [0.0, 0.1, 0.2, 0.0, 0.1],
        "measured": FORCE,
        "simulated": -FORCE,
        "covariates": {"opening": TIME, "resultant": FORCE.sum((3, 4))},
        "episode": [4, 4, 4, 2, 2],
        "pads": ("left", "right"),
        "metadata": {"sensor": "a", "start": 5.0},
    }
    return Recording(**{**fields, **changes})


def assert_same(a: Recording, b: Recording) -> None:
    for name in ("time", "measured", "episode"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.covariates.keys() == b.covariates.keys()
    for name, values in a.covariates.items():
        np.testing.assert_array_equal(values, b.covariates[name])
    assert (a.layout, a.pads, a.metadata) == (b.layout, b.pads, b.metadata)


# the fields


def test_defaults_and_conversions():
    recording = Recording(time=TIME, measured=FORCE)
    assert recording.layout == TaxelLayout(2, 3, (1e-3, 1e-3))
    assert recording.pads == ("pad0", "pad1")
    assert recording.episode.tolist() == [0] * 5
    assert recording.simulated is None
    assert np.shares_memory(recording.measured, FORCE)
    closed = {"closed": [True, False, True, True, False]}
    other = Recording([0, 1, 2, 3, 4], FORCE.astype(int), FORCE.astype(np.float64), closed, [0.0, 0.0, 1.0, 1.0, 1.0])
    assert (other.time.dtype, other.episode.dtype) == (np.float64, np.int64)
    assert other.measured.dtype == other.simulated.dtype == np.float32
    assert other.covariates["closed"].tolist() == [1, 0, 1, 1, 0]


def test_masked_values_are_unknown():
    force = np.ma.masked_greater(FORCE, 100)
    recording = Recording(TIME, force, covariates={"a": np.ma.masked_equal(np.arange(5), 3)})
    np.testing.assert_array_equal(np.isnan(recording.measured), force.mask)
    np.testing.assert_array_equal(recording.covariates["a"], [0, 1, 2, np.nan, 4])


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"measured": None}, "give measured, simulated or both"),
        ({"measured": FORCE[0]}, r"measured must have shape \(T, pads, 3, rows, cols\)"),
        ({"measured": FORCE[:, :, :2]}, "measured must have shape"),
        ({"measured": FORCE[:4]}, "measured has 4 samples, time has 5"),
        ({"measured": "abc"}, "measured must be an array of numbers"),
        ({"simulated": FORCE[..., :2]}, "must have one shape"),
        ({"layout": TaxelLayout(3, 3, (1e-3, 1e-3))}, "layout has 3x3 taxels, the tensors have 2x3"),
        ({"layout": "paper"}, "layout must be a TaxelLayout"),
        ({"pads": ("left",)}, "pads must be 2 different names"),
        ({"pads": ("left", "left")}, "pads must be 2 different names"),
        ({"pads": "lr"}, "pads must be a sequence of names"),
        ({"covariates": {"opening": np.zeros(4)}}, r"covariates\['opening'\]"),
        ({"covariates": {"opening": 1.0}}, r"covariates\['opening'\]"),
        ({"covariates": {"": np.zeros(5)}}, "covariates must have names"),
        ({"covariates": {"a": [1, 2, 3, np.inf, 5]}}, r"covariates\['a'\] holds .* infinite"),
        ({"episode": np.zeros(4)}, "episode must have shape"),
        ({"episode": [0, 0, 0.5, 1, 1]}, "whole numbers"),
        ({"episode": [0, 1, 0, 1, 1]}, "those of episode 0 are not"),
        ({"episode": np.ma.masked_equal([0, 0, 1, 1, 1], 1)}, "whole numbers"),
        ({"time": [0, 1, 3, 2, 4]}, "sample 3 is at 2 s, the one before at 3 s"),
        ({"time": [0, 1, np.nan, 3, 4]}, "time must be finite, sample 2 is not"),
        ({"time": np.ma.masked_equal([0, 1, 2, 3, 4], 2)}, "time must be finite, sample 2 is not"),
        ({"time": [2.0] * 8, "measured": np.zeros((8, 1, 3, 1, 1))}, "all 8 samples have one time, 2 s: time must"),
        ({"time": [], "measured": FORCE[:0]}, "at least one sample"),
        ({"measured": FORCE.astype(np.float64) * 1e39}, "infinite or too large for float32; use NaN"),
        ({"measured": np.full_like(FORCE, -np.inf)}, "measured holds a number that is infinite"),
        ({"metadata": {"layout": 3}}, "metadata must not hold 'layout'"),
    ],
)
def test_what_does_not_fit_is_named(fields, words):
    with pytest.raises(InvalidValueError, match=words):
        Recording(**{"time": TIME, "measured": FORCE, **fields})


def test_description():
    recording = Recording(time=TIME, measured=FORCE, simulated=FORCE, covariates={"opening": TIME})
    assert repr(recording) == (
        "Recording(2 pads of 2x3 taxels (pitch unknown), 5 samples, 0.4 s at 10.0 Hz, 1 episode, measured, simulated, "
        "covariates opening)"
    )
    assert "1 sample, 0.0 s, 1 episode, simulated" in repr(Recording(time=[1], simulated=FORCE[:1]))


# parts of it


def test_samples_of_all_streams_are_taken_together():
    recording = Recording(TIME, FORCE, -FORCE, {"pose": FORCE[:, 0, :, 0, 0]}, pads=("l", "r"))
    for samples in (slice(1, 4), np.array([1, 2, 3]), np.array([False, True, True, True, False])):
        part = recording[samples]
        assert part.time.tolist() == TIME[1:4].tolist()
        np.testing.assert_array_equal(part.measured, FORCE[1:4])
        np.testing.assert_array_equal(part.simulated, -FORCE[1:4])
        np.testing.assert_array_equal(part.covariates["pose"], FORCE[1:4, 0, :, 0, 0])
        assert part.pads == ("l", "r")
    assert np.shares_memory(recording[1:].measured, FORCE)
    for samples in (2, slice(9, 9), [], [9], [True], "a", [0.5]):
        with pytest.raises(InvalidValueError):
            recording[samples]


def test_time_may_start_anew_with_an_episode():
    recording = Recording(time=[5, 6, 0, 1, 2], measured=FORCE, episode=[7, 7, 3, 3, 3])
    assert recording.duration == 3
    assert recording.rate == 1
    assert [len(part) for part in recording.episodes()] == [2, 3]
    assert recording.select([3]).time.tolist() == [0, 1, 2]
    assert recording.select([3, 7]).episode.tolist() == [7, 7, 3, 3, 3]


def test_select_takes_episodes_pads_covariates_and_what_is_known():
    recording = two_episodes()
    part = recording.select([2], pads=["right"], covariates=["resultant"])
    np.testing.assert_array_equal(part.measured, FORCE[3:, 1:])
    np.testing.assert_array_equal(part.simulated, -FORCE[3:, 1:])
    np.testing.assert_array_equal(part.covariates["resultant"], FORCE.sum((3, 4))[3:, 1:])
    assert (part.pads, list(part.covariates)) == (("right",), ["resultant"])
    assert recording.select(pads="left").pads == ("left",)
    assert list(recording.select(covariates="opening").covariates) == ["opening"]
    assert_same(recording.select(), recording)
    holed = recording.with_covariate("opening", [0, np.nan, 2, 3, 4])
    assert holed.select(known=True).time.tolist() == [0.0, 0.2, 0.0, 0.1]
    assert_same(holed.select(covariates=[], known=True), holed.select(covariates=[]))


# with something else


def test_with_simulated_leaves_the_recording_as_it_was():
    recording = two_episodes()
    other = recording.with_simulated(2 * FORCE, scene="<mujoco/>")
    np.testing.assert_array_equal(other.simulated, 2 * FORCE)
    assert other.metadata == {"sensor": "a", "start": 5.0, "scene": "<mujoco/>"}
    assert np.shares_memory(other.measured, FORCE)
    np.testing.assert_array_equal(recording.simulated, -FORCE)
    assert "scene" not in recording.metadata


def test_with_covariate_of_another_clock():
    recording = Recording(time=TIME, measured=FORCE, metadata={"start": 100.0})
    later = np.arange(0.05, 0.4, 0.01)
    found = recording.with_covariate("joints", np.stack([later, -later], axis=1), later).covariates["joints"]
    assert np.isnan(found[[0, 4]]).all()  # before the first sample and after the last
    np.testing.assert_allclose(found[1:4], np.stack([TIME, -TIME], axis=1)[1:4], atol=1e-12)
    held = recording.with_covariate("command", [1, 2], [0.0, 0.25], align="previous", max_gap=1.0)
    np.testing.assert_array_equal(held.covariates["command"], [1, 1, 1, np.nan, np.nan])
    assert recording.covariates == {}
    assert held.with_covariate("command", np.arange(5)).covariates["command"].tolist() == [0, 1, 2, 3, 4]


def test_pooling_keeps_the_force():
    recording = two_episodes().pool(2, 3)
    assert recording.layout == TaxelLayout(1, 1, (2e-3, 3e-3))
    np.testing.assert_array_equal(recording.measured[..., 0, 0], FORCE.sum((3, 4)))
    np.testing.assert_array_equal(recording.simulated, -recording.measured)
    only_one = Recording(TIME, None, FORCE).pool(1, 3)
    assert only_one.measured is None
    assert only_one.simulated.shape == (5, 2, 3, 2, 1)


def test_resampling_interpolates_within_each_episode():
    time = np.concatenate([3 + np.arange(11) / 10, np.arange(6) / 10])
    force = np.broadcast_to(time[:, None, None, None, None], (17, 1, 3, 1, 2))
    recording = Recording(time, force, covariates={"command": np.arange(17)}, episode=[1] * 11 + [0] * 6)
    found = recording.resample(40, align={"command": "previous"})
    np.testing.assert_allclose(found.time, np.concatenate([3 + np.arange(41) / 40, np.arange(21) / 40]))
    assert found.episode.tolist() == [1] * 41 + [0] * 21
    np.testing.assert_allclose(found.measured[:, 0, 1, 0, 1], found.time, rtol=1e-6)
    assert found.covariates["command"][:9].tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 2]
    assert found.covariates["command"][-1] == 16
    assert_same(recording.resample(10), recording)
    assert recording.resample(3).time.tolist() == pytest.approx([3, 3 + 1 / 3, 3 + 2 / 3, 4, 0, 1 / 3])


def test_resampling_leaves_gaps_open():
    time = np.concatenate([np.arange(10), 30 + np.arange(10)]) / 10
    force = np.zeros((20, 1, 3, 1, 1), np.float32)
    force[3] = np.nan
    found = Recording(time, force).resample(20)
    unknown = found.time[np.isnan(found.measured).any((1, 2, 3, 4))]
    np.testing.assert_allclose(unknown, [0.25, 0.3, 0.35, *np.arange(0.95, 2.99, 0.05)], atol=1e-9)
    closed = Recording(time, force).resample(20, max_gap=3)
    assert not np.isnan(closed.measured[20:]).any()


# several recordings


def test_concatenating_the_episodes_gives_the_recording():
    recording = two_episodes()
    assert_same(Recording.concatenate(recording.episodes()), recording)
    twice = Recording.concatenate([recording, two_episodes(metadata={"sensor": "a", "start": 9.0, "operator": "b"})])
    assert twice.episode.tolist() == [0, 0, 0, 1, 1, 2, 2, 2, 3, 3]
    assert twice.metadata == {"sensor": "a", "start": 5.0}
    np.testing.assert_array_equal(twice.simulated, np.concatenate([-FORCE, -FORCE]))
    np.testing.assert_array_equal(twice.time, [*recording.time, *(recording.time + 4.0)])


def test_concatenating_keeps_the_clock_and_what_is_keyed_by_episode(tmp_path):
    def part(start, episodes, **metadata):
        at = np.sort(np.tile(TIME, len(episodes)) + np.repeat(np.arange(len(episodes)), 5))
        force = np.zeros((len(at), 1, 3, 1, 1))
        return Recording(at, force, episode=np.repeat(episodes, 5), metadata={"start": start, **metadata})

    replay = {"mode": "force", "closing": {"0": [0.1]}, "encoder_error": {"episode": 0, "newtons": 1.0, "peak": 2.0}}
    other = {**replay, "closing": {"0": [0.2], "1": [0.3, 0.4]}, "doubts": ["lost"], "in_doubt": 0.2}
    other["encoder_error"] = {"episode": 1, "newtons": 3.0, "peak": 2.0}
    first = part(1000.0, [0], task="pick", replay=replay)
    second = part(1010.0, [0, 1], tasks={"0": "place", "1": "turn"}, replay=other)
    both = Recording.concatenate([first, second])
    np.testing.assert_allclose(both.time[[0, 5, 10]], [0, 10, 11])
    assert both.metadata == {
        "start": 1000.0,
        "tasks": {"0": "pick", "1": "place", "2": "turn"},
        "replay": {
            "mode": "force",
            "closing": {"0": [0.1], "1": [0.2], "2": [0.3, 0.4]},
            "encoder_error": {"episode": 2, "newtons": 3.0, "peak": 2.0},
            "notes": [],
            "doubts": ["lost"],
            "in_doubt": 0.2,
        },
    }
    (tmp_path / "joint.csv").write_text("time,u\n" + "".join(f"{1000 + t},{t}\n" for t in range(13)))
    for episode, u in ((0, 0.0), (1, 10.0), (2, 11.0)):
        both.select([episode]).save(tmp_path / "part.npz")
        loaded = Recording.load(tmp_path / "part.npz", streams=tmp_path / "joint.csv")
        assert loaded.covariates["u"][0] == pytest.approx(u)
    unknown = Recording.concatenate([first, replace(second, metadata={})])
    assert "start" not in unknown.metadata
    unknown.save(tmp_path / "part.npz")
    with pytest.raises(InvalidValueError, match="clock, but that of the recording starts anew"):
        Recording.load(tmp_path / "part.npz", streams=tmp_path / "joint.csv")


OTHER_FIRST = {"covariates": {"opening": FORCE[:, 0, :, 0, 0], "resultant": FORCE.sum((3, 4))}}


@pytest.mark.parametrize(
    ("method", "arguments", "words"),
    [
        ("select", {"episodes": [2, 7]}, "no episode 7 in the recording; its episodes are 4, 2"),
        ("select", {"episodes": []}, "episodes must name at least one; its episodes are 4, 2"),
        ("select", {"pads": ["rigth"]}, "unknown pad 'rigth'; did you mean 'right'"),
        ("select", {"pads": ["left", "left"]}, "pads must name different pads"),
        ("select", {"pads": []}, "pads must name different pads, at least one"),
        ("select", {"covariates": ["openin"]}, "unknown covariate 'openin'; did you mean 'opening'"),
        ("resample", {"rate": 0}, "rate must be a number of samples a second, above 0"),
        ("resample", {"rate": -1}, "rate must be a number"),
        ("resample", {"rate": float("nan")}, "rate must be a number"),
        ("resample", {"rate": float("inf")}, "rate must be a number"),
        ("resample", {"rate": 10, "align": {"comand": "previous"}}, "unknown stream to align 'comand'"),
        ("with_covariate", {"name": "measured", "values": FORCE}, "'measured' is a tensor, not a covariate"),
        ("at", {"time": [100, 101]}, r"from 100 s to 101 s.* from 0 s to 0.2 s; subtract metadata\['start'\]"),
        ("at", {"time": [0, 1, 2]}, r"must be \(S, ...\) and their time \(S,\).*\(2,\) and \(3,\)"),
        ("at", {"time": [0.2, 0.1]}, "must be finite and not run back"),
        ("at", {"time": [0, 0.1], "max_gap": 0}, "max_gap must be a positive time"),
        ("at", {"time": [0, 0.1], "align": "cubic"}, "align must be one of"),
        ("with_covariate", {"time": [0, 0.1]}, r"starts anew in an episode.*concatenate"),
        ("concatenate", {"simulated": None}, "must have a simulated tensor, or none: number 1 .from 0. has none"),
        ("concatenate", {"pads": ("l", "r")}, r"different pads .*: the first has \('left', 'right'\)"),
        ("concatenate", {"layout": TaxelLayout(2, 3, (2e-3, 1e-3))}, "different layout"),
        (
            "concatenate",
            {"covariates": {"opening": TIME}},
            r"not share resultant; .* select\(covariates=\['opening'\]\)",
        ),
        (
            "concatenate",
            OTHER_FIRST,
            r"'opening' has samples of shape \(\) in the first recording and of \(3,\) in number 1",
        ),
        ("concatenate", {"metadata": {"unit": "uT"}}, "different units .* N, number 1 .* in uT"),
    ],
)
def test_what_cannot_be_done_is_named(method, arguments, words):
    recording = two_episodes()
    calls = {
        "concatenate": lambda **other: Recording.concatenate([recording, two_episodes(**other)]),
        "with_covariate": lambda **given: recording.with_covariate(**{"name": "joints", "values": [1, 2], **given}),
        "at": lambda **given: recording.select([4]).with_covariate("joints", [1, 2], **given),
    }
    call = calls.get(method) or getattr(recording, method)
    with pytest.raises((InvalidValueError, UnknownNameError), match=words):
        call(**arguments)


def test_without_a_sample_or_a_recording_there_is_none():
    unknown = two_episodes().with_covariate("a", np.full(5, np.nan))
    with pytest.raises(InvalidValueError, match="none at which all streams are known"):
        unknown.select(known=True)
    with pytest.raises(InvalidValueError, match="at least one recording"):
        Recording.concatenate([])


# its unit: newtons unless it says otherwise


@pytest.mark.parametrize("suffix", [".mcap", ".npz"])
def test_a_file_keeps_the_unit_and_info_prints_it(suffix, tmp_path, capsys):
    field = two_episodes(metadata={"unit": "uT"})
    assert (two_episodes().unit, field.unit) == ("N", "uT")
    assert "uT" in repr(field)
    assert "in N" not in repr(two_episodes())
    assert Recording.concatenate([field, field]).unit == "uT"
    path = tmp_path / f"field{suffix}"
    field.save(path)
    assert Recording.load(path).unit == "uT"
    assert main(["info", str(path)]) == 0
    assert "measured (uT a taxel)" in capsys.readouterr().out
    two_episodes(metadata={"unit": 3}).save(path)
    with pytest.raises(InvalidValueError, match="unit in its metadata must be a text"):
        Recording.load(path)


def test_a_field_is_not_felt_as_newtons_and_quality_prints_the_unit_of_its_frames():
    profile = paxisim.load_profile("gen1-box-ip-s2516")
    with pytest.raises(InvalidValueError, match=r"in uT, but profile 'gen1-box-ip-s2516' feels N"):
        from_recording(two_episodes(metadata={"unit": "uT"}), profile)
    noise = np.random.default_rng(0).normal(0, 1, (100, 1, 3, 1, 5)).astype(np.float32)
    frames = [paxisim.Frame(force, i / 100, i / 100, i, (0,), unit="uT") for i, force in enumerate(noise)]
    table = str(paxisim.measure_quality(frames, TaxelLayout(1, 5, (1e-2, 1e-2)), ("skin",)))
    assert " uT" in table
    assert "uT/min" in table
    assert " N " not in table
