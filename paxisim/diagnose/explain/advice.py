"""Advice: what to record next, to separate rival causes and to excite causes that this recording could not show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from paxisim.diagnose.data.motions import MOTIONS, PROTOCOLS

NOT_ASKED = "not asked for"
"""The reason given for a cause that the caller excluded from the search."""


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
            lines.append(f"to separate {name} from {other}: {_instructions(*motions)}")
    if unexplained:
        lines.append(f"to investigate the unexplained residual: {_instructions('repeats')}")
    if episodes < 4:
        lines.append(f"{MOTIONS['varied']} (this recording has {episodes})")
    wanted: dict[str, list[str]] = {}
    for name, why in not_testable.items():
        if name in excites and why != NOT_ASKED:
            wanted.setdefault(excites[name], []).append(name)
    lines += [f"to test for {', '.join(names)}: {_instructions(motion)}" for motion, names in wanted.items()]
    return tuple(dict.fromkeys(lines))


def _instructions(*motions: str) -> str:
    """What to do for these motions, with the commands that write all of them for a robot."""
    names = " or ".join(name for name, own in PROTOCOLS.items() if set(motions) <= set(own.split()))
    return "; ".join(MOTIONS[m] for m in motions) + (f" (for a robot: paxisim protocol {names})" if names else "")
