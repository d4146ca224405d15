"""Advice names the motions that excite a cause or separate rivals."""

from recorded import diagnosed, make, motions_of, recording_of

from paxisim.diagnose.causes.vocabulary import CAUSES
from paxisim.diagnose.data.motions import MOTIONS, PROTOCOLS
from paxisim.diagnose.explain.advice import advice
from paxisim.protocols.ready import known_protocols, protocol

EXCITES = {item.name: item.excites for item in CAUSES}


def asked(rivals, missing=None, unexplained=False, episodes=8):
    return advice(rivals, missing or {}, EXCITES, unexplained=unexplained, episodes=episodes)


def test_every_cause_has_a_motion_and_every_motion_a_sentence_of_its_own():
    assert set(EXCITES.values()) <= set(MOTIONS)
    for name, text in MOTIONS.items():
        assert motions_of((text,)) == (name,)
    for name, motion in EXCITES.items():
        assert motion in motions_of(asked([], {name: "too weak"})), name
        other = "creep" if name != "creep" else "latency"
        assert set(motions_of(asked([(name, (other,))]))) == {motion, EXCITES[other]}, name


def test_motions_come_in_the_order_of_the_advice():
    missing = {"interference": "no covariate", "creep": "not asked for"}
    lines = asked([("latency", ("low_pass",))], missing, unexplained=True, episodes=2)
    assert motions_of(lines) == ("taps", "repeats", "varied", "gripper")
    assert any("8 episodes" in line for line in lines)
    assert motions_of(()) == ()
    assert motions_of(asked([("creep", ("mine",))], {"mine": "it is not excited"})) == ("holds", "varied")


def test_sentences_say_what_they_are_for():
    lines = asked([("hysteresis", ("creep",))], {"drift": "too short", "layout": "not asked for"}, episodes=2)
    assert lines[0].startswith("to separate hysteresis from creep: press and release in a triangle wave at three")
    assert any(line.startswith("to test for drift") for line in lines)
    assert not any("layout" in line for line in lines)


def test_a_motion_that_a_protocol_has_comes_with_its_command():
    provided = {n: {m for own in protocol(n).segments for m in own.motions} for n in known_protocols()}
    assert {name: set(motions.split()) for name, motions in PROTOCOLS.items()} == provided
    for cause, motion in EXCITES.items():
        (line,) = asked([], {cause: "too weak"})
        names = " or ".join(name for name, motions in provided.items() if motion in motions)
        assert line.endswith(f" (for a robot: paxisim protocol {names})" if names else MOTIONS[motion]), cause
    (line,) = asked([("rotation", ("creep",))])
    assert line.endswith("(for a robot: paxisim protocol press)"), "the protocol that has both motions"
    (line,) = asked([("gel_operator", ("creep",))])
    assert "paxisim protocol" not in line


def test_no_neighbours_are_asked_for_of_a_pad_of_one_taxel():
    found = diagnosed(recording_of(make((), seed=3, rows=1, cols=1, duration=5.0)), ("gel_operator", "axis_gain"))
    why = "a pad of a single taxel has no neighbours"
    assert found.not_testable["gel_operator"] == why
    assert not any("fine tip" in line for line in found.advice)
