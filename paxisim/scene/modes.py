"""The ways in which a scene follows a recorded motion, and what each makes unobservable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

Mode = Literal["kinematic", "fitted", "shape", "servo", "force"]

_SERVO = "the servo follows with a lag and a stiffness of its own"
_FORCE = "the recorded force sets the total, so an error of its calibration looks like one of the sensor"
_SHAPE = "the closing was fitted to the course of the measured force"
_FITTED = "the closing was fitted to the measured total force"


@dataclass(frozen=True)
class ReplayMode:
    """One way to follow a motion.

    Attributes:
        what: What it reproduces.
        not_testable: The reason, for each cause of a diagnosis that it makes unobservable.
    """

    what: str
    not_testable: Mapping[str, str]


MODES: Mapping[Mode, ReplayMode] = {
    "kinematic": ReplayMode(
        "positions, velocities and accelerations are exactly the recorded ones, whatever force that takes",
        {},
    ),
    "fitted": ReplayMode(
        "as kinematic, with a constant added to the closing stream of each episode, such that the mean of the total "
        "normal force is the measured one",
        {
            "axis_gain": _FITTED,
            "taxel_gain": _FITTED,
            "offset": _FITTED,
            "stiffening": _FITTED,
            "dead_band": _FITTED,
            "saturation": _FITTED,
        },
    ),
    "shape": ReplayMode(
        "as kinematic, with a constant added to the closing stream of each episode, such that the course of the total "
        "normal force is like the measured one, whatever its gain and delay: where the object lies along the closing",
        {"stiffening": _SHAPE, "dead_band": _SHAPE, "saturation": _SHAPE},
    ),
    "servo": ReplayMode(
        "the actuators of the model follow the recorded positions or take the recorded commands",
        {"axis_gain": _SERVO, "stiffening": _SERVO, "latency": _SERVO, "low_pass": _SERVO, "creep": _SERVO},
    ),
    "force": ReplayMode(
        "the actuators of the model exert the recorded forces",
        {
            "axis_gain": _FORCE,
            "offset": _FORCE,
            "latency": "when contact begins follows from the model's friction and inertia",
            "low_pass": "how fast force rises follows from the model's friction and inertia",
        },
    ),
}


def hidden_by_replay(recording: Recording) -> dict[str, str]:
    """By name why causes cannot be told after the way in which a recording's motion was replayed."""
    replay = recording.metadata.get("replay")
    hidden = replay.get("not_testable") if isinstance(replay, Mapping) else None
    return {str(name): f"{why}" for name, why in hidden.items()} if isinstance(hidden, Mapping) else {}


def checked(mode: str) -> Mode:
    """The mode of that name.

    Raises:
        InvalidValueError: There is none.
    """
    for known in get_args(Mode):
        if mode == known:
            return known
    raise InvalidValueError(f"mode must be one of {', '.join(get_args(Mode))}, got {mode!r}")
