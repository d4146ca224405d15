"""Named: streams that are named as the joint or body that they move.

A stream and what it moves belong together if their names agree but for case, separators and generic words, or if one
name ends as the whole of the other does and no other pair fits as well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.scene import units
from paxisim.scene.drive import Drive
from paxisim.scene.poses import is_pose
from paxisim.scene.streams import limits_of

NOT_MOTION = re.compile(r"force|current|torque|effort|velocity|speed|temp|resultant|command", re.IGNORECASE)
"""Names of streams that are no positions."""
_GENERIC = re.compile(r"\b(joint states?|state|observation|pos|position|pose|qpos|rad|deg|mm|m)\b")
_FREE, _SLIDE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_SLIDE)

Streams = Mapping[str, NDArray[np.float64]]


def by_name(model: mujoco.MjModel, streams: Streams) -> tuple[list[Drive], list[str], list[str]]:
    """Return the drives of the streams that are named as what they move, why, and what is in doubt."""
    joints = [model.joint(i).name for i in range(model.njnt) if is_scalar(model, i)]
    bodies = [model.body(i).name for i in range(1, model.nbody) if _is_posed(model, i)]
    drives, found, doubts = [], [], []
    for kind, does, names in (("joint", "moves", joints), ("body", "poses", bodies)):
        its = [name for name, values in streams.items() if _suits(values, kind) and not NOT_MOTION.search(name)]
        for exact in (True, False):
            alike = {stream: _alike(stream, names, exact) for stream in its}
            if kind == "joint" and not exact:
                alike = {s: [n for n in same if is_near(model, n, streams[s])] for s, same in alike.items()}
            for stream, same in alike.items():
                rivals = [other for other, its_same in alike.items() if set(its_same) & set(same)]
                if len(same) == 1 == len(rivals):
                    drives.append(Drive(stream, joint=same[0]) if kind == "joint" else Drive(stream, body=same[0]))
                    said = f"stream {stream!r} {does} {kind} {same[0]!r}: their names"
                    (found if exact else doubts).append(f"{said} {'agree' if exact else 'end alike'}")
                elif same and not exact:
                    doubts.append(
                        f"{several('stream', rivals)} could each move {several(kind, same)}, so none does: rename "
                        "them, or write the drive by hand"
                    )
            its = [stream for stream in its if not any(drive.stream == stream for drive in drives)]
            names = [name for name in names if not any(drive.target == name for drive in drives)]
    return drives, found, list(dict.fromkeys(doubts))


def several(kind: str, names: Sequence[str]) -> str:
    """Return names with what they are, such as ``streams 'a', 'b'``."""
    return f"{kind} {names[0]!r}" if len(names) == 1 else f"{kind}s {', '.join(map(repr, names))}"


def _suits(values: NDArray[np.float64], kind: str) -> bool:
    return values.ndim == 1 if kind == "joint" else is_pose(values)


def _alike(stream: str, names: Sequence[str], exact: bool) -> list[str]:
    """Return the names that agree with that of a stream, or those that have the longest ending in common with it."""
    whole = "".join(_words(stream))
    if exact:
        return [name for name in names if whole and whole == "".join(_words(name))]
    common = {}
    for name in names:
        other = "".join(_words(name))
        if whole in _endings(name) or other in _endings(stream):
            common[name] = min(len(whole), len(other))
    return [name for name, length in common.items() if length == max(common.values())]


def is_near(
    model: mujoco.MjModel, joint: str, values: NDArray[np.float64], factors: Sequence[float] = (1.0, math.pi / 180)
) -> bool:
    """Return whether values are within the limits of a joint when multiplied by one of the factors."""
    limits = limits_of(model, Drive("stream", joint=joint))
    factors = (1.0,) if int(model.joint(joint).type[0]) == _SLIDE else factors
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return any(units.is_within(factor * low, factor * high, limits) for factor in factors)


def _words(name: str) -> tuple[str, ...]:
    """Return the words of a name in lower case, without generic ones."""
    return tuple(_GENERIC.sub(" ", re.sub(r"[\W_]+", " ", name.lower())).split())


def _endings(name: str) -> set[str]:
    """Return the endings of a name, word by word, which have a letter."""
    words = _words(name)
    endings = ("".join(words[i:]) for i in range(len(words)))
    return {ending for ending in endings if re.search("[a-z]", ending)}


def is_scalar(model: mujoco.MjModel, joint: int) -> bool:
    """Return whether a joint has a name and is a slide or a hinge."""
    return bool(model.joint(joint).name) and int(model.jnt_type[joint]) in (_SLIDE, int(mujoco.mjtJoint.mjJNT_HINGE))


def _is_posed(model: mujoco.MjModel, body: int) -> bool:
    return model.body_mocapid[body] >= 0 or is_object(model, body)


def is_object(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body has a name and a free joint."""
    first = int(model.body_jntadr[body])
    return bool(model.body(body).name) and first >= 0 and int(model.jnt_type[first]) == _FREE
