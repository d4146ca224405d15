"""Advice: what to record next, to tell rivals apart and to show what this recording could not."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

MOTIONS: Mapping[frozenset[str], str] = {
    frozenset({"hysteresis", "creep"}): (
        "press and release in one triangle at three speeds over two decades, and hold for 30 s on the way up and "
        "on the way down: a loop that stays when slow is hysteresis"
    ),
    frozenset({"latency", "low_pass"}): (
        "tap quickly, or swing with a rising frequency: a delay keeps the height of the swings, a filter lowers it"
    ),
    frozenset({"interference", "offset"}): "open and close the gripper without contact, and record its opening",
    frozenset({"axis_gain", "stiffening", "saturation", "taxel_gain"}): (
        "press in a staircase of at least six levels up to over-range, on several places of the pad"
    ),
    frozenset({"drift", "creep"}): "leave the pads free for 60 s before and after the presses",
    frozenset({"rotation", "drift", "axis_coupling"}): "slide along one axis and then along the other, both ways",
    frozenset({"crosstalk", "poisson"}): "press single taxels with a fine tip, and then all with a flat plate",
    frozenset({"axis_gain", "axis_coupling"}): "slide past slip at two loads, along both axes",
}
"""Motions by the causes that they tell apart."""

ALONE: Mapping[str, str] = {
    "creep": "hold a press for 30 s, and leave the pad free for 60 s after it",
    "hysteresis": "press and release at three speeds over two decades, with reversals half way",
    "low_pass": "tap quickly, or swing with a rising frequency",
    "latency": "tap quickly, or swing with a rising frequency",
    "interference": "open and close the gripper without contact, and record its opening as gripper_opening",
    "drift": "record at least four episodes over ten minutes on one clock, with the pads free before and after each",
    "rotation": "slide along one axis and then along the other, both ways",
    "axis_coupling": "slide along one axis and then along the other, both ways",
    "poisson": "press single taxels with a fine tip, off the pad's middle",
    "crosstalk": "press single taxels with a fine tip",
    "saturation": "press up to over-range",
    "stiffening": "press in a staircase of at least six levels up to over-range",
    "dead_band": "press very lightly, and slowly more",
    "taxel_gain": "press on several places of the pad, so that each taxel is loaded",
    "axis_gain": "press and slide, so that each axis is loaded",
    "offset": "leave the pads free for some seconds at the beginning",
    "dead_taxels": "press on several places of the pad, so that each taxel is loaded",
    "layout": "press off the middle of one pad at a time, and slide along each axis",
    "quantisation": "press slowly, so that the readings pass through all counts",
}
"""Motions by the cause that they excite."""


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
            lines.append(f"to tell {name} from {other}: {_between(name, other)}")
    if unexplained:
        lines.append(
            "to see what is left over: repeat one press ten times with a fresh start, at two speeds, and look at "
            "whether the first differs"
        )
    if episodes < 4:
        lines.append(f"at least 8 episodes of different motions; there {'is' if episodes == 1 else 'are'} {episodes}")
    wanted: dict[str, list[str]] = {}
    for name, why in not_testable.items():
        if name in ALONE and why != "not asked for":
            wanted.setdefault(ALONE[name], []).append(name)
    lines += [f"to show {', '.join(names)}: {motion}" for motion, names in wanted.items()]
    return tuple(dict.fromkeys(lines))


def _between(one: str, other: str) -> str:
    for names, motion in MOTIONS.items():
        if {one, other} <= names:
            return motion
    known = [ALONE[name] for name in (one, other) if name in ALONE]
    return "; ".join(text for text, _ in itertools.groupby(known)) or "repeat the motion at several speeds and depths"
