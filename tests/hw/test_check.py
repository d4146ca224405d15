"""The guided check finds the order, axes and slots of any sensor from presses at known places, or refuses."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from person import careless_person, person, scan, scans

from paxisim import InvalidValueError, Profile, Slot, load_profile
from paxisim.hw.commissioning.check import check_steps, conclude, feel, rest_of

FRAMES = 12
HELD = np.sin(np.linspace(0.3, np.pi - 0.3, FRAMES))[:, None, None, None]
WIRES = [(sx + x, sy + y, "+z") for sx in "+-" for sy in "+-" for x, y in ("xy", "yx")]


def sensor(layout, axes=("+x", "+y", "+z"), slots=((2, "left"), (5, "right")), pool=(1, 1)):
    return Profile("test", "control-box", layout, tuple(Slot(n, i) for i, n in slots), axes=axes, pool=pool)


def recorded(true, believed, step, newtons=6.0, seed=0):
    """Frames of a step: felt by the true sensor, sent as counts, decoded with the believed profile."""
    rng = np.random.default_rng(seed)
    force = np.zeros((FRAMES, len(true.slots), *true.wire_layout.shape))
    if step.name != "free":
        force[:, step.pad] = HELD * person(true.wire_layout, step, newtons)
    force += rng.normal(0, 0.02, force.shape)
    wires = {slot.index: true.to_counts(force[:, i]) for i, slot in enumerate(true.slots)}
    return believed.to_force(np.stack([wires[slot.index] for slot in believed.slots], axis=1))


def check(true, believed, newtons=6.0, instead=None, offset=0.0, verified=""):
    """Run the whole routine; `instead` maps a step's name to the step that the user does in its place."""
    steps = check_steps(believed)
    rest = rest_of(believed, recorded(true, believed, steps[0]) + offset)
    touches = {}
    for i, step in enumerate(steps[1:]):
        done = (instead or {}).get(step.name, step)
        touches[step.name] = feel(believed, step, recorded(true, believed, done, newtons, seed=i) + offset, rest)
    return conclude(believed, touches, verified=verified) if verified else conclude(believed, touches)


# ---- what is found


@settings(max_examples=25, deadline=None)
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
def test_whatever_the_sensor_is_the_check_finds_it(layouts, axes, believed_axes, slots, pads, newtons):
    used = slots[:pads]
    believed = sensor(layouts[1], believed_axes, tuple(zip(sorted(i for i, _ in used), "abc", strict=False)))
    true = sensor(layouts[0], axes, used if pads > 1 else ((believed.slots[0].index, "a"),))
    result = check(true, believed, newtons)
    assert result.profile == true
    assert result.changed == (true != believed)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_every_scan_is_told_from_every_other(step):
    one = ((0, "pad"),)
    for i, true in enumerate(scans((12, 10))):
        for believed in scans((12, 10))[i % step :: step]:
            assert check(sensor(true, slots=one), sensor(believed, slots=one)).profile.wire_layout == true


@pytest.mark.parametrize("size", [(12, 10), pytest.param((6, 5), marks=pytest.mark.slow), (4, 3)])
def test_a_careless_user_gets_the_right_profile_or_a_refusal(size):
    rng, grids, right = np.random.default_rng(5), scans(size), 0
    for _ in range(60):
        true, believed = (sensor(grids[rng.integers(16)], WIRES[rng.integers(8)]) for _ in range(2))
        rest, touches = rest_of(believed, np.zeros((5, 2, *believed.wire_layout.shape))), {}
        try:
            for step in check_steps(believed)[1:]:
                force = np.zeros((FRAMES, 2, *true.wire_layout.shape))
                force[:, step.pad] = HELD * careless_person(true.wire_layout, step, rng)
                felt = believed.to_force(true.to_counts(force, gate=2))
                touches[step.name] = feel(believed, step, felt, rest)
            result = conclude(believed, touches)
        except InvalidValueError:
            continue
        assert result.profile == true
        right += 1
    assert right >= 20


def test_what_is_right_stays_as_it_is_is_said_so_and_signed():
    profile = replace(load_profile("gen2-box-120"), notes="mine")
    result = check(profile, profile)
    assert result.profile == profile
    assert not result.changed
    assert all(finding.clear for finding in result.findings)
    assert "order: the taxels match the profile" in str(result.findings[0])
    signed = check(profile, profile, verified="me, today").profile
    assert signed.verified == "me, today"
    assert {key for key, text in signed.sources.items() if text == "me, today"} == {"layout", "axes", "slots"}
    assert signed.sources["baud"] == profile.sources["baud"]


def test_findings_are_plain_sentences():
    believed = sensor(scan(12, 10, False, True, False))
    true = sensor(scan(12, 10, False, True, True), ("-y", "+x", "+z"), ((5, "left"), (2, "right")))
    text = "\n".join(map(str, check(true, believed).findings))
    assert "left and right must be exchanged" in text
    assert "the pad's x is the wire's -y, not +x" in text
    assert "'left' is at 5 and 'right' is at 2" in text


def test_a_pad_that_lies_across_exchanges_rows_and_columns_and_a_resting_offset_is_no_press():
    believed = sensor(scan(12, 10, True, False, False))
    offset = np.random.default_rng(0).normal(0, 0.5, (2, 3, 12, 10))
    for true in (sensor(scan(10, 12, True, False, False)), sensor(scan(10, 12, False, False, False))):
        assert check(true, believed, offset=offset).profile.wire_layout == true.wire_layout


def test_a_sensor_whose_normal_force_pulls_is_turned_round():
    believed = Profile("t", "hand-board", scan(4, 3, True, False, False), (Slot("a", 0),))
    rest, touches = rest_of(believed, np.zeros((5, 1, 3, 4, 3))), {}
    for step in check_steps(believed)[1:]:
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
def test_a_curved_part_is_turned_as_its_positions_say(part):
    believed = load_profile(f"gen3-serial-{part}")
    layout = believed.wire_layout
    for quarters, mirrored in ((0, False), (1, False), (2, True), (3, False), (3, True)):
        angle = np.pi / 2 * quarters
        turn = np.round([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        turn[0] *= -1 if mirrored else 1
        true = replace(layout, positions=layout.positions @ turn.T, normals=layout.normals @ turn.T)
        result = check(replace(believed, wire_layout=true, axes=("-x", "+y", "+z")), believed)
        found = result.profile.wire_layout
        assert found.positions == pytest.approx(true.positions, abs=1e-12), (quarters, mirrored)
        assert found.normals == pytest.approx(true.normals, abs=1e-12), (quarters, mirrored)
        assert result.profile.axes == ("-x", "+y", "+z")
        assert result.changed


# ---- refusals

PROFILE = sensor(scan(12, 10, False, True, False))
STEPS = {step.name: step for step in check_steps(PROFILE)}
THREE = sensor(PROFILE.wire_layout, slots=((2, "a"), (5, "b"), (7, "c")))
FIRST_OF_THREE = next(step for step in check_steps(THREE) if step.name == "touch-a")


@pytest.mark.parametrize(
    ("profile", "newtons", "instead", "says"),
    [
        (PROFILE, 0.05, {}, r"step touch-left: too weak, 0\.\d N .* at least 0\.\d N"),
        (PROFILE, 6.0, {"drag-right": STEPS["touch-left"]}, "step drag-right: too little shear"),
        (PROFILE, 6.0, {"drag-down": STEPS["drag-right"]}, "along the same axis"),
        (PROFILE, 6.0, {"top-left": replace(STEPS["top-left"], pad=1)}, "top-left was done on another pad .* 'left'"),
        (PROFILE, 6.0, {"top-right": STEPS["top-left"]}, "contradict one another"),
        (PROFILE, 6.0, {"bottom-left": STEPS["top-right"]}, "contradict one another"),
        (PROFILE, 6.0, {"top-left": STEPS["touch-left"]}, "contradict one another"),
        (THREE, 6.0, {"touch-b": FIRST_OF_THREE}, "two different pads were felt as the same"),
    ],
)
def test_what_a_user_does_wrong_is_refused(profile, newtons, instead, says):
    with pytest.raises(InvalidValueError, match=says):
        check(profile, profile, newtons, instead)


def on_left(step, newtons=6.0, scale=(1, 1, 1)):
    """Five frames of a press on the first pad alone."""
    force = np.zeros((5, 2, 3, 12, 10))
    force[:, 0] = person(PROFILE.wire_layout, STEPS[step], newtons) * np.array(scale)[:, None, None]
    return force


@pytest.mark.parametrize(
    ("step", "force", "says"),
    [
        ("drag-right", on_left("drag-right", 20.0, (0.2, 1, 1)), r"at least 3\.0 N is needed; drag until it slides"),
        ("drag-right", on_left("drag-right") + on_left("drag-down"), "askew"),
        ("touch-left", on_left("touch-left") + on_left("touch-left")[:, ::-1], "more than one pad"),
        ("touch-left", on_left("touch-left") * (np.arange(5) == 2)[:, None, None, None, None], "too short, 1 frames"),
    ],
    ids=["a slanted press", "a slanted drag", "two pads", "too short"],
)
def test_a_step_that_tells_nothing_is_refused(step, force, says):
    rest = rest_of(PROFILE, np.zeros((5, 2, 3, 12, 10)))
    with pytest.raises(InvalidValueError, match=says):
        feel(PROFILE, STEPS[step], force, rest)


def test_a_rest_that_is_none_and_an_incomplete_check_are_refused():
    with pytest.raises(InvalidValueError, match="pad 'left' was not left alone"):
        rest_of(PROFILE, recorded(PROFILE, PROFILE, STEPS["touch-left"]))
    with pytest.raises(InvalidValueError, match="at least 3 frames"):
        rest_of(PROFILE, np.zeros((2, 2, 3, 12, 10)))
    with pytest.raises(InvalidValueError, match=r"\(\.\.\., 2, 3, 12, 10\)"):
        rest_of(PROFILE, np.zeros((9, 2, 3, 6, 5)))
    with pytest.raises(InvalidValueError, match="it lacks: touch-left, top-left"):
        conclude(PROFILE, {})


def test_in_counts_the_noise_says_what_a_touch_is():
    profile = replace(load_profile("xela-uspa44"), slots=(Slot("a", 1),))
    still = np.random.default_rng(0).normal(0, 30, (50, 1, 3, 4, 4))
    rest = rest_of(profile, still)
    # a noise of 30 counts on each of 16 taxels is 120 counts in the total
    assert rest.least_press[0] == pytest.approx(8 * 120, rel=0.3)
    with pytest.raises(InvalidValueError, match=r"not left alone: its total changed by .* counts"):
        rest_of(profile, still + np.linspace(0, 2000, 50).reshape(-1, 1, 1, 1, 1))
    press = check_steps(profile)[1]
    with pytest.raises(InvalidValueError, match=r"too weak, .* counts of normal force"):
        feel(profile, press, 5 * person(profile.wire_layout, press) + still, rest)
