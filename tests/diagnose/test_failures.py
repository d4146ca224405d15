"""Taxels and single channels that fail during a recording are named with the moment of failure; others are not."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, make, names, plain, recording_of, small

from paxisim import augment
from paxisim.diagnose.diagnosis import Diagnosis

CLEAR = 0.6  # N, more than any dead band suppresses
LATE = 0.3  # s, tolerated delay of a reported moment
NEAR = ("dead_taxels", "swapped_taxels", "axis_gain", "taxel_gain", "offset")


def loaded(recording, rank):
    """Return pad, row and column of the taxel with the given load rank; rank 0 is the most loaded."""
    load = np.mean(np.square(recording.simulated[:, :, 2], dtype=float), axis=0)
    pad, row, col = np.unravel_index(np.argsort(-load.ravel())[rank], load.shape)
    return int(pad), int(row), int(col)


def failing(seed, kind, rank=0, share=0.5):
    """Make a recording, with the practice generator's noise, in which a taxel or its normal force fails.

    Args:
        seed: Random seed of the recording.
        kind: "frozen", "gone" (its noise remains), "zero", or "frozen z" for one channel.
        rank: Load rank of the taxel; 0 is the most loaded.
        share: Fraction of the recording after which the taxel fails.

    Returns:
        The recording, the taxel, and the time of failure in seconds after the first frame.
    """
    recording = small(seed=seed)
    pad, row, col = loaded(recording, rank)
    frame = int(share * len(recording))
    axes = slice(2, 3) if kind == "frozen z" else slice(0, 3)
    measured = recording.measured.copy()
    own = measured[frame:, pad, axes, row, col]
    if kind == "gone":
        rest = np.flatnonzero(np.abs(recording.simulated).max(axis=(1, 2, 3, 4)) == 0)
        own[:] = measured[np.random.default_rng(seed).choice(rest, len(own)), pad, axes, row, col]
    else:
        own[:] = 0.0 if kind == "zero" else own[0].copy()
    return replace(recording, measured=measured), (pad, row, col), recording.time[frame] - recording.time[0]


def told(found):
    """Return the single failed taxel, its failed axes and the moment of failure."""
    fault = found.model["dead_taxels"]
    fault = fault[0] if isinstance(fault, augment.Chain) else fault
    assert isinstance(fault, augment.FailingTaxels)
    (taxel,) = np.argwhere(np.asarray(fault.dead) + np.asarray(fault.stuck))
    pad, row, col = map(int, taxel)
    since = fault.since[pad, :, row, col]
    (moment,) = np.unique(since[np.isfinite(since)])
    return (pad, row, col), "".join(np.array(list("xyz"))[np.isfinite(since)]), float(moment)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [("gone", 42), ("frozen z", 42)]
    + [
        pytest.param(kind, seed, marks=pytest.mark.slow)
        for kind in ("frozen", "gone", "zero", "frozen z")
        for seed in (41, 43)
    ],
)
def test_what_fails_halfway_is_named_with_the_moment_and_nothing_else_is(kind, seed):
    recording, (pad, row, col), true = failing(seed, kind, rank=seed % 3, share=0.4 + 0.05 * (seed % 3))
    found = diagnosed(recording, NEAR)
    assert names(found) == ["dead_taxels"]
    assert found.verdict in ("explained", "partly_explained")
    place, axes, moment = told(found)
    assert place == (pad, row, col)
    assert axes == ("z" if kind == "frozen z" else "xyz")
    assert found.heldout.nrmse_after < 0.6 * found.heldout.nrmse_before
    # the moment is not late, and the taxel is not pressed between it and the failure
    assert moment < true + LATE
    seconds = recording.time - recording.time[0]
    between = (seconds > moment + LATE) & (seconds < true)
    assert np.all(np.abs(recording.simulated[between, pad, 2, row, col]) < CLEAR)
    words = f"({row}, {col}){' z' if kind == 'frozen z' else ''} since {moment:.1f} s"
    for each in (found, Diagnosis.from_json(found.to_json())):
        assert words in " ".join(str(each).split())
    # the model reads as the sensor does before and after
    axis = 2
    read = found.model.run(recording.simulated.astype(float), recording.time)[:, pad, axis, row, col]
    np.testing.assert_array_equal(read[seconds < moment], recording.simulated[seconds < moment, pad, axis, row, col])
    if kind != "gone":
        after = seconds > true + LATE
        np.testing.assert_allclose(read[after], recording.measured[after, pad, axis, row, col], atol=0.01)


@pytest.mark.parametrize(("chips", "begin"), [([0], 0.0), ([0, 1], 0.0), ([0, 1, 2, 3], 0.0), ([0, 1, 2, 3], 0.5)])
def test_chips_that_carry_most_of_the_signal_are_named_when_they_are_dead(chips, begin):
    """A board of five chips, whose dead ones are no reason to refuse the recording or to turn the board."""
    recording = plain(seed=5, rows=1, cols=5)
    recording = recording.select(pads=recording.pads[:1])
    order = np.argsort(-np.sum(np.square(recording.simulated[:, 0]), axis=(0, 1, 2)))
    dead = order[chips]
    recording.measured[int(begin * len(recording)) :, 0, :, 0, dead] = 0.0
    found = diagnosed(recording, (*NEAR, "layout", "interference", "drift"))
    assert found.verdict == "explained"
    assert names(found) == ["dead_taxels"]
    fault = found.model["dead_taxels"]
    assert set(np.flatnonzero(np.asarray(fault.dead)[0, 0])) == set(dead)


@pytest.mark.parametrize("level", [None, 0.0, 1.2])
def test_a_chip_that_freezes_is_named_although_nothing_presses_it_afterwards(level):
    recording = plain(seed=5)
    frame = len(recording) // 2 + 20  # within an episode
    free = np.abs(recording.simulated[frame:, :, 2]).max(axis=0) < 0.1
    pad, row, col = np.argwhere(free)[0]
    chip = recording.measured[frame:, pad, :, row, col]
    chip[:] = chip[0].copy() if level is None else level
    found = diagnosed(recording, (*NEAR, "drift"))
    assert names(found) == ["dead_taxels"]
    place, axes, moment = told(found)
    assert (place, axes) == ((pad, row, col), "xyz")
    assert moment == pytest.approx(recording.time[frame] - recording.time[0], abs=LATE)


def test_a_gain_is_named_beside_it():
    gains = np.reshape([1.0, 1.0, 1.2], (3, 1, 1))
    recording = plain(lambda force, time: gains * force, seed=4)
    pad, row, col = loaded(recording, 0)
    recording.measured[len(recording) // 2 :, pad, :, row, col] = 0.0
    found = diagnosed(recording, NEAR)
    assert sorted(names(found)) == ["axis_gain", "dead_taxels"]
    assert told(found)[0] == (pad, row, col)


OTHERS = {
    "held": lambda force, time: augment.SampleAndHold(5.0).run(force, time),
    "clipped": lambda force, time: np.clip(force, -0.3, 1.0),
    "gated": lambda force, time: np.where(np.abs(force) < 0.6, 0.0, force),
    "counted": lambda force, time: np.round(force / 0.6) * 0.6,
    "crept": lambda force, time: augment.Creep((0.25,), (8.0,)).run(force, time),
    "slow": lambda force, time: augment.LowPass(0.3).run(force, time),
    "drifting": lambda force, time: force + 0.01 * time[:, None, None, None, None],
}


@pytest.mark.parametrize(
    ("effect", "seed"),
    [(effect, 51) for effect in OTHERS]
    # recordings that end while a reading lags or is clipped
    + [pytest.param(effect, seed, marks=pytest.mark.slow) for effect, seed in (("clipped", 8106), ("held", 8108))]
    + [("held", 8112)],
)
def test_what_else_a_sensor_does_is_no_failure(effect, seed):
    assert names(diagnosed(plain(OTHERS[effect], seed=seed), ("dead_taxels",))) == []


@pytest.mark.parametrize("options", [{"rho": 0.95}, {"coarse": True}, {"strong_noise": True}, {"family": "poor"}])
def test_noise_is_no_failure(options):
    assert names(diagnosed(small(seed=53, **options), ("dead_taxels", "swapped_taxels"))) == []


@pytest.mark.parametrize(
    ("hidden", "seed"),
    [
        (("axis_coupling", "dead_band"), 9_000_020_010),  # the coupling cancels shear near the dead band
        (("hysteresis", "stiffening", "rotation"), 9_000_050_004),  # a loop wider than shear of one count
    ],
)
def test_shear_that_a_working_channel_does_not_read_is_no_failure(hidden, seed):
    case = make(hidden, seed=seed, family="development")
    assert names(diagnosed(recording_of(case), ("dead_taxels",))) == []


def test_a_taxel_that_the_last_episodes_do_not_press_has_not_failed():
    recording = plain(seed=54)
    pad, row, col = loaded(recording, 0)
    last = recording.episode >= 4
    recording.measured[last, pad, :, row, col] -= recording.simulated[last, pad, :, row, col]
    recording.simulated[last, pad, :, row, col] = 0.0
    assert names(diagnosed(recording, ("dead_taxels",))) == []


@pytest.mark.parametrize(("axis", "seed"), [(3, 4), pytest.param(4, 7, marks=pytest.mark.slow)])
def test_a_contact_that_is_not_where_it_is_simulated_is_no_failure(axis, seed):
    recording = plain(seed=8100 + seed)
    last = recording.episode >= 5
    force = recording.simulated[last]
    recording.measured[last] += np.roll(force, 1, axis=axis) - force
    assert names(diagnosed(recording, ("dead_taxels",))) == []


def test_clocks_that_begin_anew_in_each_episode_tell_no_moment():
    recording, *_ = failing(44, "zero")
    starts = np.array([recording.time[recording.episode == number][0] for number in np.unique(recording.episode)])
    found = diagnosed(replace(recording, time=recording.time - starts[recording.episode]), ("dead_taxels",))
    assert names(found) == []
