"""The modes in which a scene follows a recorded motion, and the causes that each makes unobservable.

Mode ``"auto"`` stands for ``"kinematic"`` or ``"fitted"``; `paxisim.scene.auto_mode` chooses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

Mode = Literal["auto", "kinematic", "fitted", "shape", "servo", "force"]

_SERVO = "the servo follows with a lag and a stiffness of its own"
_FORCE = "the recorded force sets the total, so its calibration error looks like one of the sensor"
_SHAPE = "the closing was fitted to the shape of the measured force over time"
_FITTED = "the closing was fitted to the measured total force"


@dataclass(frozen=True)
class ReplayMode:
    """A mode of following a motion.

    Attributes:
        what: Description of what the mode reproduces.
        not_testable: The causes of a diagnosis that the mode makes unobservable, each with the reason.
    """

    what: str
    not_testable: Mapping[str, str]


MODES: Mapping[Mode, ReplayMode] = {
    "kinematic": ReplayMode(
        "positions, velocities and accelerations are exactly the recorded ones, whatever force this requires",
        {},
    ),
    "fitted": ReplayMode(
        "as kinematic, with a constant added to the closing stream in each grasp so that the mean of the total "
        "normal force equals the measured one",
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
        "as kinematic, with a constant added to the closing stream in each grasp so that the total normal force over "
        "time has the shape of the measured one, whatever its gain and delay; this locates the object along the "
        "closing",
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
            "latency": "the start of contact follows from the model's friction and inertia",
            "low_pass": "the rate at which force rises follows from the model's friction and inertia",
        },
    ),
}


def hidden_by_replay(recording: Recording) -> dict[str, str]:
    """Return the causes that the replay mode of a recording makes unobservable, each with the reason."""
    replay = recording.metadata.get("replay")
    hidden = replay.get("not_testable") if isinstance(replay, Mapping) else None
    return {str(name): f"{why}" for name, why in hidden.items()} if isinstance(hidden, Mapping) else {}


def start_streams(recording: Recording) -> frozenset[str]:
    """Return the streams that the replay of a recording used only to place objects at the start of each episode."""
    replay = recording.metadata.get("replay")
    starts = replay.get("starts") if isinstance(replay, Mapping) else None
    return frozenset(map(str, starts)) if isinstance(starts, list) else frozenset()


def checked(mode: str) -> Mode:
    """Check the name of a mode and return it.

    Raises:
        InvalidValueError: The mode does not exist.
    """
    for known in get_args(Mode):
        if mode == known:
            return known
    raise InvalidValueError(f"mode must be one of {', '.join(get_args(Mode))}, got {mode!r}")
