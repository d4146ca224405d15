"""The guided check finds the order, axes and slots of any sensor from presses at known places, or refuses."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from person import careless_person, person, scan, scans

from paxisim.errors import InvalidValueError
from paxisim.hw.commissioning.check import CheckResult, Step, check_steps, conclude, feel, rest_of
from paxisim.hw.profiles.load import load_profile
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.layout import TaxelLayout

FRAMES = 12
WIRES = [(sx + x, sy + y, "+z") for sx in "+-" for sy in "+-" for x, y in ("xy", "yx")]


def recorded(true: Profile, believed: Profile, step: Step, newtons: float = 6.0, seed: int = 0) -> np.ndarray:
    """Frames of a step: felt by the true sensor, sent as counts, decoded with the believed profile."""
    rng = np.random.default_rng(seed)
    force = np.zeros((FRAMES, len(true.slots), *true.wire_layout.shape))
    if step.name != "free":
        held = np.sin(np.linspace(0.3, np.pi - 0.3, FRAMES))[:, None, None, None]
        force[:, step.pad] = held * person(true.wire_layout, step, newtons)
    force += rng.normal(0, 0.02, force.shape)
    wires = {slot.index: true.to_counts(force[:, i]) for i, slot in enumerate(true.slots)}
    counts = np.stack([wires[slot.index] for slot in believed.slots], axis=1)
    return believed.to_force(counts)


def check(
    true: Profile, believed: Profile, newtons: float = 6.0, instead: dict[str, Step] | None = None
) -> CheckResult:
    """Run the whole routine; `instead` maps a step's name to the step that the user does in its place."""
    steps = check_steps(believed)
    rest = rest_of(believed, recorded(true, believed, steps[0]))
    touches = {}
    for i, step in enumerate(steps[1:]):
        done = (instead or {}).get(step.name, step)
        touches[step.name] = feel(believed, step, recorded(true, believed, done, newtons, seed=i), rest)
    return conclude(believed, touches)


def sensor(layout: TaxelLayout, axes=("+x", "+y", "+z"), slots=((2, "left"), (5, "right")), pool=(1, 1)) -> Profile:
    return Profile("test", "control-box", layout, tuple(Slot(n, i) for i, n in slots), axes=axes, pool=pool)


@given(
    st.sampled_from([(12, 10), (6, 5), (8, 8), (5, 4), (4, 3), (3, 3)]).flatmap(
        lambda size: st.tuples(st.sampled_from(scans(size)), st.sampled_from(scans(size)))
    ),
    st.sampled_from(WIRES),
    st.sampled_from(WIRES),
    st.permutations([2, 5, 7]).map(lambda p: tuple(zip(p, ("a", "b", "c"), strict=True))),
    st.integers(1, 3),
    st.floats(3.0, 15.0),
)
@settings(max_examples=150, deadline=None)
def test_whatever_the_sensor_is_the_check_finds_it(layouts, axes, believed_axes, slots, pads, newtons):
    used = slots[:pads]
    believed = sensor(layouts[1], believed_axes, tuple(zip(sorted(i for i, _ in used), "abc", strict=False)))
    true = sensor(layouts[0], axes, used if pads > 1 else ((believed.slots[0].index, "a"),))
    result = check(true, believed, newtons)
    assert result.profile == true
    assert result.changed == (true != believed)


def test_every_scan_is_told_from_every_other():
    for true in scans((12, 10)):
        for believed in scans((12, 10)):
            one = ((0, "pad"),)
            assert check(sensor(true, slots=one), sensor(believed, slots=one)).profile.wire_layout == true


@pytest.mark.parametrize("size", [(12, 10), (6, 5), (4, 3)])
def test_a_careless_user_gets_the_right_profile_or_a_refusal(size):
    rng = np.random.default_rng(5)
    grids, right = scans(size), 0
    held = np.sin(np.linspace(0.3, np.pi - 0.3, FRAMES))[:, None, None, None]
    for _ in range(60):
        true, believed = (sensor(grids[rng.integers(16)], WIRES[rng.integers(8)]) for _ in range(2))
        rest = rest_of(believed, np.zeros((5, 2, *believed.wire_layout.shape)))
        touches = {}
        try:
            for step in check_steps(believed)[1:]:
                force = np.zeros((FRAMES, 2, *true.wire_layout.shape))
                force[:, step.pad] = held * careless_person(true.wire_layout, step, rng)
                felt = believed.to_force(true.to_counts(force, gate=2))
                touches[step.name] = feel(believed, step, felt, rest)
            result = conclude(believed, touches)
        except InvalidValueError:
            continue
        assert result.profile == true
        right += 1
    assert right >= 20


def test_what_is_right_stays_as_it_is_and_is_said_so():
    profile = replace(load_profile("gen2-box-120"), notes="mine")
    result = check(profile, profile)
    assert result.profile == profile
    assert not result.changed
    assert all(finding.clear for finding in result.findings)
    assert "order: the taxels match the profile" in str(result.findings[0])


def test_findings_are_plain_sentences():
    believed = sensor(scan(12, 10, False, True, False))
    true = sensor(scan(12, 10, False, True, True), ("-y", "+x", "+z"), ((5, "left"), (2, "right")))
    text = "\n".join(map(str, check(true, believed).findings))
    assert "left and right must be exchanged" in text
    assert "the pad's x is the wire's -y, not +x" in text
    assert "'left' is at 5 and 'right' is at 2" in text


def test_a_pad_that_lies_across_exchanges_rows_columns_and_pooling():
    believed = sensor(scan(12, 10, True, False, False), pool=(3, 2))
    true = sensor(scan(10, 12, True, False, False), pool=(2, 3))
    # both layouts send their bytes along rows, of 10 and of 12 taxels
    result = check(replace(true, pool=(1, 1)), replace(believed, pool=(1, 1)))
    assert result.profile.wire_layout == true.wire_layout
    turned = sensor(scan(10, 12, False, False, False))
    assert check(turned, replace(believed, pool=(1, 1))).profile.wire_layout == turned.wire_layout


def test_the_check_signs_what_it_checked():
    profile = load_profile("gen2-box-120")
    steps = check_steps(profile)
    rest = rest_of(profile, recorded(profile, profile, steps[0]))
    touches = {step.name: feel(profile, step, recorded(profile, profile, step), rest) for step in steps[1:]}
    signed = conclude(profile, touches, verified="me, today").profile
    assert signed.verified == "me, today"
    assert {key for key, text in signed.sources.items() if text == "me, today"} == {"layout", "axes", "slots"}
    assert signed.sources["baud"] == profile.sources["baud"]


def test_a_sensor_whose_normal_force_pulls_is_turned_round():
    believed = Profile("t", "hand-board", scan(4, 3, True, False, False), (Slot("a", 0),))
    steps = check_steps(believed)
    touches = {}
    rest = rest_of(believed, np.zeros((5, 1, 3, 4, 3)))
    for step in steps[1:]:
        force = person(believed.wire_layout, step) * np.array([1, 1, -1])[:, None, None]
        touches[step.name] = feel(believed, step, np.tile(force, (5, 1, 1, 1, 1)), rest)
    assert conclude(believed, touches).profile.axes == ("+x", "+y", "-z")


def test_of_a_row_without_positions_only_axes_and_pads_are_told():
    believed = load_profile("gen1-box-dp-s2716")
    assert [step.name for step in check_steps(believed)] == ["free", "press", "drag-right", "drag-down"]
    true = replace(believed, axes=("-y", "-x", "+z"))
    result = check(true, believed)
    assert result.profile == true
    assert "cannot be determined" in str(result.findings[0])


@pytest.mark.skipif(importlib.util.find_spec("paxini_sdk") is None, reason="needs paxini-sdk")
@pytest.mark.parametrize("part", ["dp-s2015", "ip-s1610", "cp-l5325", "dp-s3013"])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_curved_part_is_turned_as_its_positions_say(part, quarters, mirrored):
    believed = load_profile(f"gen3-serial-{part}")
    layout = believed.wire_layout
    angle = np.pi / 2 * quarters
    turn = np.round([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    if mirrored:
        turn[0] *= -1
    true = replace(layout, positions=layout.positions @ turn.T, normals=layout.normals @ turn.T)
    result = check(replace(believed, wire_layout=true, axes=("-x", "+y", "+z")), believed)
    assert result.profile.wire_layout.positions == pytest.approx(true.positions, abs=1e-12)
    assert result.profile.wire_layout.normals == pytest.approx(true.normals, abs=1e-12)
    assert result.profile.axes == ("-x", "+y", "+z")
    assert result.changed


# ---- refusals -----------------------------------------------------------------------------------------------------

PROFILE = sensor(scan(12, 10, False, True, False))
STEPS = {step.name: step for step in check_steps(PROFILE)}


def test_a_weak_press_is_refused():
    with pytest.raises(InvalidValueError, match=r"step touch-left: too weak, 0\.\d N .* at least 0\.\d N"):
        check(PROFILE, PROFILE, newtons=0.05)


def test_a_drag_without_shear_is_refused():
    with pytest.raises(InvalidValueError, match="step drag-right: too little shear"):
        check(PROFILE, PROFILE, instead={"drag-right": STEPS["touch-left"]})


def test_a_press_at_a_slant_is_no_drag():
    rest = rest_of(PROFILE, np.zeros((5, 2, 3, 12, 10)))
    force = np.zeros((5, 2, 3, 12, 10))
    force[:, 0] = person(PROFILE.wire_layout, STEPS["drag-right"], 20.0) * np.array([0.2, 1, 1])[:, None, None]
    with pytest.raises(InvalidValueError, match=r"where at least 3\.0 N is needed; drag until it slides"):
        feel(PROFILE, STEPS["drag-right"], force, rest)


def test_a_drag_that_goes_askew_is_refused():
    rest = rest_of(PROFILE, np.zeros((5, 2, 3, 12, 10)))
    force = np.zeros((5, 2, 3, 12, 10))
    force[:, 0] = person(PROFILE.wire_layout, STEPS["drag-right"]) + person(PROFILE.wire_layout, STEPS["drag-down"])
    with pytest.raises(InvalidValueError, match="askew"):
        feel(PROFILE, STEPS["drag-right"], force, rest)


def test_a_step_on_the_wrong_pad_is_refused():
    wrong = replace(STEPS["top-left"], pad=1)
    with pytest.raises(InvalidValueError, match="top-left was done on another pad than the one touched as 'left'"):
        check(PROFILE, PROFILE, instead={"top-left": wrong})


def test_two_pads_at_once_are_refused():
    rest = rest_of(PROFILE, np.zeros((5, 2, 3, 12, 10)))
    force = np.tile(person(PROFILE.wire_layout, STEPS["touch-left"]), (5, 2, 1, 1, 1))
    with pytest.raises(InvalidValueError, match="more than one pad"):
        feel(PROFILE, STEPS["touch-left"], force, rest)


def test_the_same_pad_for_two_is_a_contradiction():
    three = sensor(PROFILE.wire_layout, slots=((2, "a"), (5, "b"), (7, "c")))
    first = next(step for step in check_steps(three) if step.name == "touch-a")
    with pytest.raises(InvalidValueError, match="two different pads were felt as the same"):
        check(three, three, instead={"touch-b": first})


@pytest.mark.parametrize(
    ("step", "other"), [("top-right", "top-left"), ("bottom-left", "top-right"), ("top-left", "touch-left")]
)
def test_corners_that_contradict_one_another_are_refused(step, other):
    with pytest.raises(InvalidValueError, match="contradict one another"):
        check(PROFILE, PROFILE, instead={step: STEPS[other]})


def test_drags_along_the_same_axis_are_refused():
    with pytest.raises(InvalidValueError, match="along the same axis"):
        check(PROFILE, PROFILE, instead={"drag-down": STEPS["drag-right"]})


def test_a_pad_that_is_not_left_alone_is_refused():
    with pytest.raises(InvalidValueError, match="pad 'left' was not left alone"):
        rest_of(PROFILE, recorded(PROFILE, PROFILE, STEPS["touch-left"]))


def test_in_counts_the_noise_says_what_a_touch_is():
    profile = replace(load_profile("xela-uspa44"), slots=(Slot("a", 1),))
    rng = np.random.default_rng(0)
    still = rng.normal(0, 30, (50, 1, 3, 4, 4))
    rest = rest_of(profile, still)
    # a noise of 30 counts on each of 16 taxels is 120 counts in the total
    assert rest.least_press[0] == pytest.approx(8 * 120, rel=0.3)
    with pytest.raises(InvalidValueError, match=r"not left alone: its total changed by .* counts"):
        rest_of(profile, still + np.linspace(0, 2000, 50).reshape(-1, 1, 1, 1, 1))
    press = check_steps(profile)[1]
    with pytest.raises(InvalidValueError, match=r"too weak, .* counts of normal force"):
        feel(profile, press, 5 * person(profile.wire_layout, press) + still, rest)


def test_too_few_frames_and_other_shapes_are_refused():
    with pytest.raises(InvalidValueError, match="at least 3 frames"):
        rest_of(PROFILE, np.zeros((2, 2, 3, 12, 10)))
    with pytest.raises(InvalidValueError, match=r"\(\.\.\., 2, 3, 12, 10\)"):
        rest_of(PROFILE, np.zeros((9, 2, 3, 6, 5)))
    rest = rest_of(PROFILE, np.zeros((9, 2, 3, 12, 10)))
    short = np.zeros((9, 2, 3, 12, 10))
    short[4, 0] = person(PROFILE.wire_layout, STEPS["touch-left"])
    with pytest.raises(InvalidValueError, match="too short, 1 frames"):
        feel(PROFILE, STEPS["touch-left"], short, rest)


def test_an_incomplete_check_concludes_nothing():
    with pytest.raises(InvalidValueError, match="it lacks: touch-left, top-left"):
        conclude(PROFILE, {})


def test_a_resting_offset_is_no_press():
    true = sensor(scan(12, 10, True, False, False))
    steps = check_steps(PROFILE)
    offset = np.random.default_rng(0).normal(0, 0.5, (2, 3, 12, 10))
    rest = rest_of(PROFILE, recorded(true, PROFILE, steps[0]) + offset)
    touches = {s.name: feel(PROFILE, s, recorded(true, PROFILE, s) + offset, rest) for s in steps[1:]}
    assert conclude(PROFILE, touches).profile == true
