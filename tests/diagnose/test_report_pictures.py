"""The pictures of the report, for every cause and any layout."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")

from report_pages import check_pictures, drawn, pictures_of, recording

from paxisim import augment
from paxisim.diagnose import Diagnosis
from paxisim.diagnose.causes.kinds import PICTURES as KINDS
from paxisim.diagnose.causes.vocabulary import CAUSES, cause
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.report.effect import effects, run
from paxisim.diagnose.report.error import worst_episodes
from paxisim.diagnose.report.page import PICTURES
from paxisim.diagnose.report.style import binned, drawing, scattered
from paxisim.diagnose.result import FittedParameter, FoundCause, HeldOut, Interval, Streams, Symptoms
from paxisim.diagnose.scorer.model import in_order
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

READ = {  # causes without fitted parameters
    "layout": augment.LayoutFault(flip_rows=True, pad_order=(1, 0)),
    "swapped_taxels": augment.SwappedTaxels([(0, 1, 1, 2, 1)]),
    "offset": augment.Offset(np.full((2, 3, 4, 3), 0.2)),
    "drift": augment.Drift(amplitude=np.full((2, 3, 4, 3), 0.5), tau=120.0),
    "interference": augment.CovariateField(np.full((2, 2, 3, 4, 3), 0.1), ("gripper_opening",), (0.02,), ((100.0,),)),
    "quantisation": augment.Quantisation((0.3,) * 3),
    "dead_taxels": augment.DeadTaxels(np.eye(4, 3)[None] * np.ones((2, 1, 1))),
    "channel_curve": augment.ChannelCurve(np.linspace(0, 0.5, 9).reshape(9, 1, 1, 1, 1), 0.0, 8.0),
    "taxel_gain": augment.TaxelGain(np.linspace(0.8, 1.2, 24).reshape(2, 4, 3)),
}
CROSS = TaxelLayout(1, 5, (4e-3, 4e-3), positions=[[0, 0, 0], [8e-3, 0, 0], [-8e-3, 0, 0], [0, 8e-3, 0], [0, -8e-3, 0]])


def streams_of(given, extended=None):
    extended = given.simulated if extended is None else extended
    return Streams(
        given.time, given.episode, given.measured, given.simulated, extended, given.covariates, given.pads,
        given.layout, 0.1,
    )  # fmt: skip


def found_cause(name, parameters=()):
    return FoundCause(name, tuple(parameters), Interval(0.5, 0.4, 0.6), (), "A sentence.")


def member_of(name, problem, place):
    """Return a transform of the cause and its parameters as a diagnosis reports them."""
    if name in READ:
        return READ[name], [FittedParameter("step", "N", Interval(0.3, 0.2, 0.4))]
    about = cause(name)
    values = about.places(problem)[place]
    parameters = [
        FittedParameter(free.name, free.unit, Interval(value, value - 0.01, value + 0.01))
        for free, value in zip(about.parameters(problem), values, strict=True)
    ]
    return about.transform(values, problem), parameters


@pytest.fixture(scope="module")
def given():
    return recording(("hysteresis",), strength=0.8)


def test_every_cause_has_words_a_kind_of_picture_and_two_pictures(given):
    assert all(item.words.endswith(".") for item in CAUSES)
    assert {item.picture for item in CAUSES} == set(PICTURES) - {"plain"}
    assert sorted(KINDS) == sorted(PICTURES), "what register_cause accepts is what a report draws"
    assert not set(PICTURES) & {item.name for item in CAUSES}, "kinds of picture and causes must have different names"
    problem = problem_of(given)
    for item in CAUSES:
        if not item.in_scene:
            # the second place has a gauge, if the cause has one
            transform, parameters = member_of(item.name, problem, 1)
            chain = in_order([(item.name, transform)])
            made = drawn((found_cause(item.name, parameters),), chain, streams_of(given))
            assert len(made) == 2, item.name
            assert all("--paper" in svg for _, _, svg in made)


@dataclasses.dataclass(frozen=True, eq=False)
class Shaken(augment.Offset):
    """A user-defined transform."""


def test_a_failure_goes_on_from_one_episode_to_the_next(given):
    seconds = given.time - given.time[0]
    since = 0.4 * seconds[-1]
    chain = in_order([("dead_taxels", augment.FailingTaxels(np.ones((1, 1, 1)), since=since))])
    read = run(chain, streams_of(given))
    np.testing.assert_array_equal(read, np.where((seconds < since)[:, None, None, None, None], given.simulated, 0))
    assert drawn((found_cause("dead_taxels"),), chain, streams_of(given))[0][0] == "24 taxels do not respond"


def test_a_cause_of_the_users_own_has_the_plain_pictures_which_name_episodes_as_the_recording_does(given):
    renamed = streams_of(dataclasses.replace(given, episode=given.episode + 500))
    chain = augment.Chain([Shaken(np.linspace(0, 1, 72).reshape(2, 3, 4, 3))], ["shaken"])
    made = drawn((found_cause("shaken"),), chain, renamed)
    assert len(made) == 2
    assert made[0][0] == "Deviation without shaken, and effect of shaken"
    assert any("episode 50" in alt for _, alt, _ in made)
    with drawing():
        assert all(picture.title.startswith("Episode 50") for picture in worst_episodes(renamed))


@pytest.mark.parametrize(
    ("rows", "cols", "pads", "layout"),
    [(1, 5, 1, CROSS), *(pytest.param(*size, None, marks=pytest.mark.slow) for size in ((12, 10, 1), (8, 1, 5)))],
    ids=["a cross", "many taxels", "a column"],
)
def test_any_layout_can_be_drawn(rows, cols, pads, layout):
    rng = np.random.default_rng(0)
    time = np.arange(0, 12, 0.05)
    press = np.maximum(0, np.sin(time))[:, None, None, None, None]
    simulated = press * rng.uniform(0.1, 1, (pads, 3, rows, cols))
    measured = 1.1 * simulated + 0.02 * rng.standard_normal(simulated.shape)
    own = Recording(time, measured, simulated, episode=(time > 6).astype(int), layout=layout)
    transforms = {
        "gel_operator": augment.GelOperator(poisson=(0.2, 0.1), normal=(0.05, 0.0), layout=layout),
        "rotation": augment.Rotation(((0.1, 0.0, 0.2),)),
        "offset": augment.Offset(rng.normal(0, 0.1, simulated.shape[1:])),
    }
    chain = augment.Chain(transforms.values(), transforms)
    streams = streams_of(own, run(chain, streams_of(own)))
    heldout = HeldOut(0.2, 0.1, 0.05, "repeated motions", None, (0.5,))
    causes = tuple(found_cause(name) for name in transforms)
    found = Diagnosis("explained", causes, heldout, {}, {}, Symptoms(), (), chain, streams=streams)
    pictures = pictures_of(found.report())
    check_pictures(pictures)
    assert len(pictures) == 3 + 2 + 2 * 3 + 2


def test_effects_are_with_and_without_and_drift_goes_on(given):
    streams = streams_of(given)
    chain = augment.Chain([augment.AxisGain((1.0, 1.0, 1.5)), READ["drift"]], ["axis_gain", "drift"])
    first, second = effects((found_cause("drift"), found_cause("axis_gain")), chain, streams)
    time = streams.time - streams.time[0]
    curve = 0.5 * -np.expm1(-time / 120.0)
    np.testing.assert_allclose(first.model[:, 1, 0, 2, 2] - first.without[:, 1, 0, 2, 2], curve, atol=1e-4)
    effect = second.model[:, 0, 2] - second.without[:, 0, 2]
    np.testing.assert_allclose(effect, 0.5 * streams.simulated[:, 0, 2], atol=1e-4)
    assert second.channel[1] == 2


def test_thinning_keeps_the_ends():
    x = np.concatenate([np.zeros(5000), np.linspace(0, 1, 50)])
    thinned, same = scattered(x, x, points=300)
    assert len(thinned) <= 320
    np.testing.assert_array_equal(thinned, same)
    assert (thinned > 0.5).sum() >= 20
    middle, mean = binned(np.linspace(0, 1, 1000), np.linspace(0, 2, 1000), bins=10)
    np.testing.assert_allclose(mean, 2 * middle)
