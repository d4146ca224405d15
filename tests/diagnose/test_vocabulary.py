"""Causes known to a diagnosis: a plain tuple plus the causes added by the user."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from recorded import diagnosed, names, plain

from paxisim import augment
from paxisim.diagnose import Cause, FittedCause, Free, known_causes, register_cause
from paxisim.diagnose.causes import vocabulary
from paxisim.diagnose.causes.kinds import PICTURES
from paxisim.diagnose.causes.vocabulary import CAUSES
from paxisim.diagnose.data.motions import MOTIONS
from paxisim.errors import InvalidValueError, UnknownNameError

SCENE = {
    "friction", "gel_stiffness", "grip_force", "mount_offset", "mount_tilt", "surface", "object_size", "object_pose",
    "joint_offset", "base_pose", "hand_pose",
}  # fmt: skip
VOCABULARY = {
    "axis_gain", "taxel_gain", "offset", "drift", "stiffening", "gel_operator", "axis_coupling", "rotation",
    "layout", "creep", "hysteresis", "low_pass", "latency", "saturation", "dead_band", "quantisation", "dead_taxels",
    "interference", "channel_curve", "swapped_taxels",
} | SCENE  # fmt: skip


@pytest.fixture
def own(monkeypatch):
    """Drop added causes after the test."""
    monkeypatch.setattr(vocabulary, "_ADDED", [])


def pad_gain(name="pad_gain"):
    return FittedCause(
        name=name,
        order=62,
        make=lambda values, problem: augment.PadAxisGain([[v] * 3 for v in values]),
        free=lambda problem: tuple(Free(f"pad_{p}", "1", 1.0, 0.2, 5.0, 0.1, 0.03) for p in range(2)),
        starts=lambda problem: [(1.1, 1.0), (1.0, 1.1)],
    )


def test_the_causes_that_come_with_paxisim_are_a_tuple_in_the_order_of_the_chain():
    assert type(CAUSES) is tuple
    assert {item.name for item in CAUSES} == VOCABULARY
    assert len(CAUSES) == len(VOCABULARY)
    orders = {item.name: item.order for item in CAUSES}
    assert [orders[name] for name in known_causes()] == sorted(orders.values())
    for item in CAUSES:
        assert isinstance(item, Cause)


def test_a_cause_is_of_one_of_the_kinds(own):
    with pytest.raises(InvalidValueError, match=r"must be a FittedCause, .* got Cause"):
        register_cause(Cause(name="own", order=62))


def test_a_name_is_taken_once(own):
    with pytest.raises(InvalidValueError, match="there is a cause 'creep' already"):
        register_cause(pad_gain("creep"))
    register_cause(pad_gain())
    assert set(known_causes()) == VOCABULARY | {"pad_gain"}
    with pytest.raises(InvalidValueError, match="'pad_gain' already"):
        register_cause(pad_gain())
    assert len(CAUSES) == len(VOCABULARY)
    with pytest.raises(UnknownNameError, match="creep"):
        vocabulary.cause("crep")


@pytest.mark.parametrize(
    ("field", "given", "valid"),
    [("excites", "levels", "triangles, holds, taps"), ("picture", "curve", "curves, edges"), ("picture", "", "plain")],
)
def test_a_motion_or_picture_that_does_not_exist_is_refused_before_the_fit(own, field, given, valid):
    with pytest.raises(
        InvalidValueError, match=f"{field} of the cause 'pad_gain' must be one of .*{valid}.*, got '{given}'"
    ):
        register_cause(replace(pad_gain(), **{field: given}))
    assert "pad_gain" not in known_causes()


def test_the_page_on_causes_lists_the_motions_and_pictures():
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "add-a-cause.md").read_text(encoding="utf-8")
    for title, valid in (("### Motions", MOTIONS), ("### Pictures", PICTURES)):
        table = page.partition(title)[2].partition("\n#")[0]
        assert sorted(re.findall(r"^\| `(\w+)` \| \w", table, re.MULTILINE)[1:]) == sorted(valid)


@dataclass(frozen=True, eq=False)
class Summed(augment.Transform):
    """A transform that forgets to keep the shape of a frame."""

    def apply(self, x, covariates):
        return x.sum()


@dataclass(frozen=True, eq=False)
class Remembers(augment.StatefulTransform):
    """The same with memory."""

    def initial_state(self, x, covariates=None):
        return ()

    def advance(self, x, state, dt, covariates):
        return x[..., :1, :, :], state


def test_a_transform_that_changes_the_shape_is_refused(own):
    frame = np.ones((2, 3, 4, 5))
    with pytest.raises(InvalidValueError, match=r"Summed returned shape \(\) for a tensor of shape \(2, 3, 4, 5\)"):
        Summed()(frame)
    with pytest.raises(InvalidValueError, match=r"Remembers returned shape \(2, 1, 4, 5\)"):
        Remembers().step(frame, (), 0.1)
    cause = replace(pad_gain(), make=lambda values, problem: Summed())
    register_cause(cause)
    with pytest.raises(InvalidValueError, match="Summed returned shape"):
        diagnosed(plain(seed=2), ("pad_gain",))


def test_a_cause_of_ones_own_takes_part(own):
    register_cause(pad_gain())
    gains = np.array([1.3, 0.8]).reshape(2, 1, 1, 1)
    recording = plain(lambda force, time: gains * force, seed=2)
    found = diagnosed(recording, ("pad_gain", "axis_gain", "taxel_gain"))
    assert names(found) == ["pad_gain"]
    values = {p.name: p.value for p in found.causes[0].parameters}
    for name, true in (("pad_0", 1.3), ("pad_1", 0.8)):
        assert values[name].value == pytest.approx(true, abs=0.03)
        assert values[name].low < values[name].value < values[name].high
    vocabulary._ADDED[:] = [replace(pad_gain(), picture="taxel_map")]
    with pytest.warns(UserWarning, match="the picture 'taxel_map' does not suit 'pad_gain'"):
        report = found.report()
    assert "Measured force minus force in the model without pad_gain" in report
