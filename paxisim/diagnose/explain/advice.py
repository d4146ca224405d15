"""Advice: what to record next, to separate rival causes and to excite causes that this recording could not show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

NOT_ASKED = "not asked for"
"""The reason given for a cause that the caller excluded from the search."""

MOTIONS: Mapping[str, str] = {
    "triangles": (
        "press and release in a triangle wave at three speeds spanning two decades, and hold for 30 s once during "
        "loading and once during unloading; a loop that remains at the slowest speed is hysteresis"
    ),
    "holds": "hold a press for 30 s, then leave the pad unloaded for 60 s",
    "taps": (
        "tap quickly, then oscillate the force at a rising frequency; a delay keeps the amplitude of the oscillation, "
        "a filter reduces it"
    ),
    "gripper": "open and close the gripper, or move the hand, without contact, and record its opening or its joints",
    "staircase": "press in a staircase of at least six force levels, up to over-range, at several places on the pad",
    "free": "leave the pads unloaded for 60 s before and after the presses",
    "slides": "slide along one axis and then along the other, in both directions",
    "loads": "slide past slip at two normal loads, along both axes",
    "probe": "press single taxels with a fine tip, then press all of them with a flat plate",
    "light": "press very lightly and slowly, so that the readings pass through every count",
    "places": "press at several places on the pad, so that every taxel is loaded",
    "corners": "press off-centre on one pad at a time, and slide along each axis",
    "sessions": (
        "record at least four episodes over ten minutes on one clock, with the pads unloaded before and after each"
    ),
    "repeats": "repeat one press ten times from a fresh start, at two speeds, and check whether the first one differs",
    "regrasps": (
        "press the same object at four places or more, turned by 90 degrees and tilted to both sides between them"
    ),
    "objects": "press two objects of known sizes, each at two depths at least",
    "varied": "record at least 8 episodes with different motions",
}
"""Instructions for each motion, by name. `Cause.excites` refers to these names."""


def advice(
    rivals: Sequence[tuple[str, Sequence[str]]],
    not_testable: Mapping[str, str],
    excites: Mapping[str, str],
    *,
    unexplained: bool,
    episodes: int,
) -> tuple[str, ...]:
    """What to record next, most useful first.

    Args:
        rivals: Named causes, each with its rivals.
        not_testable: Reason for each cause that this recording cannot test, by the cause's name.
        excites: Name of the motion that excites each cause, by the cause's name.
        unexplained: Whether the residual has structure that no cause explains.
        episodes: Number of episodes in the recording.
    """
    lines = []
    for name, others in rivals:
        for other in others:
            motions = dict.fromkeys(excites.get(n, "varied") for n in (name, other))
            lines.append(f"to separate {name} from {other}: {'; '.join(MOTIONS[motion] for motion in motions)}")
    if unexplained:
        lines.append(f"to investigate the unexplained residual: {MOTIONS['repeats']}")
    if episodes < 4:
        lines.append(f"{MOTIONS['varied']} (this recording has {episodes})")
    wanted: dict[str, list[str]] = {}
    for name, why in not_testable.items():
        if name in excites and why != NOT_ASKED:
            wanted.setdefault(excites[name], []).append(name)
    lines += [f"to test for {', '.join(names)}: {MOTIONS[motion]}" for motion, names in wanted.items()]
    return tuple(dict.fromkeys(lines))


def motions_of(lines: Sequence[str]) -> tuple[str, ...]:
    """The names of the motions that the advice asks for, in order of first mention and without repeats."""
    found = {name: line for line in reversed(lines) for name, text in MOTIONS.items() if text in line}
    return tuple(sorted(found, key=lambda name: lines.index(found[name])))
