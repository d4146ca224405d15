"""What a cause must bring to be kept, on energies that are written down."""

from dataclasses import replace

import numpy as np
import pytest

from paxisim.diagnose.cause import cause
from paxisim.diagnose.fitting import Fit
from paxisim.diagnose.plan import Plan
from paxisim.diagnose.problem import Problem
from paxisim.diagnose.search import _Search
from paxisim.diagnose.worth import EACH, Thresholds, Worth

EPISODES, FRAMES = 8, 50
FORCE = 0.5 * np.ones((EPISODES * FRAMES, 2, 3, 3, 4))


@pytest.fixture
def problem():
    spans = tuple(slice(k * FRAMES, (k + 1) * FRAMES) for k in range(EPISODES))
    time = np.concatenate([60.0 * k + 0.05 * np.arange(FRAMES) for k in range(EPISODES)])
    opening = {"gripper_opening": np.linspace(0, 0.08, len(time))}
    alive = np.ones(FORCE.shape[1:], dtype=bool)
    return Problem(FORCE, FORCE, time, opening, spans, np.full_like(FORCE, 0.05), 1.0, alive, 0.01, 0.05)


@pytest.fixture
def search(problem):
    names = ("taxel_gain", "creep", "interference", "stiffening", "rotation", "low_pass", "latency")
    return _Search(problem, Plan([cause(name) for name in names], Thresholds()))


def fit_of(problem, energy, *names):
    """A fit that is known to leave so much in each episode."""
    return Fit({name: np.zeros(1) for name in names}, np.asarray(energy, dtype=float), problem, ())


@pytest.fixture
def in_place(monkeypatch):
    """As if no contact was beside its place: that is tested on recordings, in `test_displaced`."""
    monkeypatch.setattr(Worth, "_is_not_tolerated", lambda *args: True)


@pytest.mark.usefixtures("in_place")
def test_many_numbers_must_bring_something_without_the_best_episode(problem, search):
    enough = search._limits.material * problem.samples * cause("taxel_gain").costs
    before = fit_of(problem, np.full(EPISODES, 10 * enough))
    for gains, worth in (
        ([2 * enough] + [0.01 * enough] * 7, False),  # one episode is fitted
        ([0.3 * enough] * 8, True),
        ([2 * enough] + [0.12 * enough] * 7, True),
        ([9 * enough] + [0.12 * enough] * 7, False),  # of which the others know little
        ([0.05 * enough] * 8, False),  # too little in all
    ):
        after = fit_of(problem, before.energy - gains, "taxel_gain")
        assert search._worth.keeps(after, before, "taxel_gain") is worth, gains
    lone = [20 * enough, *[0.01 * enough] * 7]  # few numbers cannot fit one episode alone: it may show them alone
    assert search._worth.keeps(fit_of(problem, before.energy - lone, "rotation"), before, "rotation")


def test_what_a_field_leaves_is_counted_where_it_changes(problem, search):
    nothing = fit_of(problem, np.full(EPISODES, 1e5))
    field = np.zeros(EPISODES)
    field[6] = 1e4  # one episode opens the gripper
    with_field = fit_of(problem, nothing.energy - field, "interference")
    search.fits._made[frozenset()] = nothing
    left = EACH * cause("interference").form["stiffening"] * 1e4
    for gain_there, misfit in ((0.0, 0.0), (0.1 * left, 0.1 * left), (5 * left, left)):
        gain = np.full(EPISODES, 300.0)
        gain[6] = gain_there
        more = fit_of(problem, with_field.energy - gain, "interference", "stiffening")
        assert search._worth.misfit(with_field, "stiffening", more) == pytest.approx(misfit)


def test_what_a_form_may_leave_goes_with_what_its_cause_explains(problem, search):
    nothing = fit_of(problem, np.full(EPISODES, 1e5))
    search.fits._made[frozenset()] = nothing
    filtered = fit_of(problem, nothing.energy - 1e4, "low_pass")
    assert search._worth.misfit(filtered, "latency") == pytest.approx(
        cause("low_pass").form["latency"] * EPISODES * 1e4
    )
    assert search._worth.misfit(filtered, "rotation") == pytest.approx(cause("rotation").mistaken * EPISODES * 1e4)
    assert search._worth.misfit(nothing, "rotation") == 0


@pytest.mark.parametrize(
    ("delay", "ahead", "taken"),
    [
        (0.02, 0.5, "low_pass"),
        (0.02, 2.0, "latency"),
        (0.02, -1.0, "low_pass"),
        (0.01, 1.0, "latency"),  # the shorter, the less it differs from a filter anyway
        (0.04, 0.5, "latency"),  # of nearly a frame
    ],
)
def test_a_short_delay_hardly_better_than_a_filter_gives_way_to_it(problem, search, delay, ahead, taken):
    gain = 1e3 * np.arange(1, EPISODES + 1)
    nothing = fit_of(problem, np.full(EPISODES, 1e5))
    filtered = replace(fit_of(problem, nothing.energy - gain, "low_pass"), values={"low_pass": np.full(2, 0.01)})
    late = replace(
        fit_of(problem, nothing.energy - gain * (1 + 0.024 * ahead), "latency"), values={"latency": np.array([delay])}
    )
    contest = {"low_pass": filtered, "latency": late}
    best = min(contest, key=lambda name: contest[name].energy.sum())
    assert search._simplest(best, contest, nothing) == taken
    too_small = replace(filtered, values={"low_pass": np.full(2, 0.002)})
    assert search._simplest(best, {**contest, "low_pass": too_small}, nothing) == best


@pytest.mark.parametrize(
    ("name", "much", "worth"),
    [
        ("creep", 2.0, False),  # a press beside its place may look like it: test_displaced.py
        ("rotation", 2.0, True),  # nothing of a press looks like it
        ("interference", 2.0, False),  # the gripper may open in one episode only, but then nothing is pressed
    ],
)
def test_what_one_episode_alone_shows_may_be_of_its_press(problem, search, name, much, worth):
    least = search._limits.material * problem.samples
    before = fit_of(problem, np.full(EPISODES, 1e5))
    gain = [much * least, *[0.001 * least] * 7]
    assert search._worth.keeps(fit_of(problem, before.energy - gain, name), before, name) is worth


@pytest.mark.parametrize(("elsewhere", "worth"), [(2.0, False), (4.0, True)])
def test_what_others_show_stands_for_a_cause_however_much_one_episode_shows(problem, search, elsewhere, worth):
    least = search._limits.material * problem.samples
    before = fit_of(problem, np.full(EPISODES, 1e5))
    gain = [50 * least, elsewhere * least, *[0.001 * least] * 6]
    assert search._worth.keeps(fit_of(problem, before.energy - gain, "creep"), before, "creep") is worth


def test_a_second_look_asks_for_less(problem, search):
    closer = replace(search._limits, material=0.4 * search._limits.material)
    second = _Search(problem, Plan(search._causes, closer))
    before = fit_of(problem, np.full(EPISODES, 1e5))
    shown = fit_of(problem, before.energy - 0.06 * search._limits.material * problem.samples, "creep")
    assert second._worth.keeps(shown, before, "creep")
    assert not search._worth.keeps(shown, before, "creep")


@pytest.mark.parametrize(("angles", "beside", "tells"), [
    ((0.05, 0.0, 0.0), (), True),
    ((0.05, 0.0, 0.0), ("axis_coupling",), False),  # a tilt is a coupling, which is in
    ((0.05, 0.0, 0.05), ("axis_coupling",), True),
])  # fmt: skip
def test_a_rotation_is_told_from_a_coupling_by_the_turn_in_the_plane(problem, angles, beside, tells):
    assert (cause("rotation").size(angles, problem, beside) >= 1) is tells


@pytest.mark.usefixtures("in_place")
@pytest.mark.parametrize(("share", "worth"), [(0.05, False), (0.3, True)])
def test_what_a_form_may_leave_is_told_where_others_take_that_up(problem, share, worth):
    names = ("hysteresis", "stiffening", "axis_gain", "taxel_gain")
    search = _Search(problem, Plan([cause(name) for name in names], Thresholds()))
    enough = cause("taxel_gain").costs * search._limits.material * problem.samples / EPISODES
    gain = 100 * enough  # of the hysteresis, of which its form may leave 0.1 to the gains, and 0.02 beside the others

    def known(left, *found):
        search.fits._made[frozenset(found)] = fit_of(problem, np.full(EPISODES, left), *found)
        return search.fits._made[frozenset(found)]

    known(1e6, *())
    fewer, more = known(1e6 - gain, "hysteresis"), known(1e6 - 1.09 * gain, "hysteresis", "taxel_gain")
    known(1e6 - 1.05 * gain, "hysteresis", "stiffening", "axis_gain")
    known(1e6 - (1.05 + 0.1 * share) * gain, "hysteresis", "stiffening", "axis_gain", "taxel_gain")
    assert search._worth.keeps(more, fewer, "taxel_gain") is worth


@pytest.mark.parametrize(
    ("values", "matters"), [((0.002, 1.2, 0.0), True), ((0.002, 0.0, 0.0), False), ((0.0035, 0.0, 0.0), True)]
)
def test_crosstalk_matters_by_what_all_neighbours_get(problem, values, matters):
    assert (cause("crosstalk").size(values, problem) >= 1) is matters


@pytest.mark.parametrize(("against", "worth"), [(0.02, True), (0.2, False)])
def test_one_episode_is_enough_if_the_others_hardly_object(problem, search, against, worth):
    least = search._limits.material * problem.samples
    before = fit_of(problem, np.full(EPISODES, 1e5))
    gain = [2 * least, -against * 2 * least, *[0.0] * 6]
    assert search._worth.keeps(fit_of(problem, before.energy - gain, "rotation"), before, "rotation") is worth


def test_what_looks_like_a_cause_is_fitted_beside_it_whatever_it_promises(problem, search):
    search._gains[frozenset(["low_pass"])] = {"creep": 0.0, "latency": 0.0}
    search.fits._made[frozenset(["low_pass"])] = fit_of(problem, np.full(EPISODES, 1e5), "low_pass")
    search.fits._made[frozenset()] = fit_of(problem, np.full(EPISODES, 1e5))
    assert search._near(["low_pass"], 4) == ["latency"]


def test_only_what_is_worth_keeping_takes_the_place_of_a_cause(problem, search, monkeypatch):
    """Creep's form leaves more to a stiffening than that gains, so that a rotation which gains less must stay."""
    monkeypatch.setattr(search, "_near", lambda chosen, most: ["stiffening"])
    left = {(): 1e6, ("creep",): 1e5, ("rotation",): 1e6, ("creep", "rotation"): 97e3}
    left |= {("creep", "stiffening"): 96.6e3, ("rotation", "stiffening"): 1e6}
    for names, energy in left.items():
        found = fit_of(problem, np.full(EPISODES, energy), *names)
        if "stiffening" in names:
            found = replace(found, values={**found.values, "stiffening": np.array([0.8, 0.6])})
        search.fits._made[frozenset(names)] = found
    assert search._worth.keeps(search.fits.of(["creep", "rotation"]), search.fits.of(["creep"]), "rotation")
    assert not search._worth.keeps(search.fits.of(["creep", "stiffening"]), search.fits.of(["creep"]), "stiffening")
    assert search._exchanged(["creep", "rotation"]) == ["creep", "rotation"]


@pytest.mark.parametrize(
    ("gains", "size", "share"),
    [
        (np.full(EPISODES, 0.9 / EPISODES), 2.0, 0.9),
        (np.full(EPISODES, 0.9 / EPISODES), 0.8, 0.8),  # less than its size matters
        (np.tile([0.45, -0.2], EPISODES // 2) / EPISODES * 4, 2.0, 0.0),  # the episodes disagree
        ([0.9, *[1e-3] * (EPISODES - 1)], 2.0, 0.0),  # one alone
    ],
)
def test_how_nearly_a_cause_is_kept(problem, search, gains, size, share):
    free = cause("rotation").free(problem)
    values = [f.neutral + size * f.material if f is free[0] else f.neutral for f in free]
    least = search._worth._least(cause("rotation"))
    before = fit_of(problem, np.full(EPISODES, 1e5))
    search.fits._made[frozenset()] = before
    more = Fit({"rotation": np.array(values)}, before.energy - least * np.asarray(gains), problem, ())
    assert search._worth.nearly(more, before, "rotation") == pytest.approx(share, rel=1e-6)
