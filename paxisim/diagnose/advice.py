"""Advice: what to record next, to tell rivals apart and to show what this recording could not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

NOT_ASKED = "not asked for"
"""Why a cause was not looked for that was left out on purpose."""

MOTIONS: Mapping[str, str] = {
    "triangles": (
        "press and release in one triangle at three speeds over two decades, and hold for 30 s on the way up and "
        "on the way down: a loop that stays when slow is hysteresis"
    ),
    "holds": "hold a press for 30 s, and leave the pad free for 60 s after it",
    "taps": (
        "tap quickly, and swing with a rising frequency: a delay keeps the height of the swings, a filter lowers it"
    ),
    "gripper": "open and close the gripper without contact, and record its opening as gripper_opening",
    "staircase": "press in a staircase of at least six levels up to over-range, on several places of the pad",
    "free": "leave the pads free for 60 s before and after the presses",
    "slides": "slide along one axis and then along the other, both ways",
    "loads": "slide past slip at two loads, along both axes",
    "probe": "press single taxels with a fine tip, and then all with a flat plate",
    "light": "press very lightly and slowly, so that the readings pass through all counts",
    "places": "press on several places of the pad, so that each taxel is loaded",
    "corners": "press off the middle of one pad at a time, and slide along each axis",
    "sessions": "record at least four episodes over ten minutes on one clock, with the pads free before and after each",
    "repeats": "repeat one press ten times with a fresh start, at two speeds, and look at whether the first differs",
    "varied": "record at least 8 episodes of different motions",
}
"""What a motion is to be like, by its name."""

TELL_APART: Mapping[frozenset[str], str] = {
    frozenset({"hysteresis", "creep"}): "triangles",
    frozenset({"latency", "low_pass"}): "taps",
    frozenset({"interference", "offset"}): "gripper",
    frozenset({"axis_gain", "stiffening", "saturation", "taxel_gain"}): "staircase",
    frozenset({"drift", "creep"}): "free",
    frozenset({"rotation", "drift", "axis_coupling"}): "slides",
    frozenset({"crosstalk", "poisson"}): "probe",
    frozenset({"axis_gain", "axis_coupling"}): "loads",
}
"""Names of motions by the causes that they tell apart."""

EXCITES: Mapping[str, str] = {
    "creep": "holds",
    "hysteresis": "triangles",
    "low_pass": "taps",
    "latency": "taps",
    "interference": "gripper",
    "drift": "sessions",
    "rotation": "slides",
    "axis_coupling": "slides",
    "poisson": "probe",
    "crosstalk": "probe",
    "saturation": "staircase",
    "stiffening": "staircase",
    "channel_curve": "staircase",
    "dead_band": "light",
    "taxel_gain": "places",
    "axis_gain": "loads",
    "offset": "free",
    "dead_taxels": "places",
    "layout": "corners",
    "quantisation": "light",
}
"""Names of motions by the cause that they excite."""


def advice(
    rivals: Sequence[tuple[str, Sequence[str]]], not_testable: Mapping[str, str], *, unexplained: bool, episodes: int
) -> tuple[str, ...]:
    """What to record next, most useful first.

    Args:
        rivals: The causes with their rivals.
        not_testable: Causes that the recording cannot show, and why.
        unexplained: Whether something is left that no cause explains.
        episodes: How many episodes there are.
    """
    lines = []
    for name, others in rivals:
        for other in others:
            told = "; ".join(MOTIONS[motion] for motion in _between(name, other))
            lines.append(f"to tell {name} from {other}: {told}")
    if unexplained:
        lines.append(f"to see what is left over: {MOTIONS['repeats']}")
    if episodes < 4:
        lines.append(f"{MOTIONS['varied']}; there {'is' if episodes == 1 else 'are'} {episodes}")
    wanted: dict[str, list[str]] = {}
    for name, why in not_testable.items():
        if name in EXCITES and why != NOT_ASKED:
            wanted.setdefault(EXCITES[name], []).append(name)
    lines += [f"to show {', '.join(names)}: {MOTIONS[motion]}" for motion, names in wanted.items()]
    return tuple(dict.fromkeys(lines))


def motions_of(lines: Sequence[str]) -> tuple[str, ...]:
    """The names of the motions that lines of advice ask for, in the order in which they do, each once."""
    found = {name: line for line in reversed(lines) for name, text in MOTIONS.items() if text in line}
    return tuple(sorted(found, key=lambda name: lines.index(found[name])))


def _between(one: str, other: str) -> tuple[str, ...]:
    """The motions that tell two causes apart: the one that is known to, or those that show each of them."""
    for names, motion in TELL_APART.items():
        if {one, other} <= names:
            return (motion,)
    return tuple(dict.fromkeys(EXCITES[name] for name in (one, other) if name in EXCITES)) or ("varied",)
