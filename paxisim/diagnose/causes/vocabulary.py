"""Vocabulary: the causes that a diagnosis knows, both built-in and registered by a user."""

from __future__ import annotations

from paxisim.diagnose.causes.axis_coupling import AXIS_COUPLING
from paxisim.diagnose.causes.axis_gain import AXIS_GAIN
from paxisim.diagnose.causes.channel_curve import CHANNEL_CURVE
from paxisim.diagnose.causes.creep import CREEP
from paxisim.diagnose.causes.dead_band import DEAD_BAND
from paxisim.diagnose.causes.dead_taxels import DEAD_TAXELS
from paxisim.diagnose.causes.drift import DRIFT
from paxisim.diagnose.causes.gel_operator import GEL_OPERATOR
from paxisim.diagnose.causes.hysteresis import HYSTERESIS
from paxisim.diagnose.causes.interference import INTERFERENCE
from paxisim.diagnose.causes.kinds import PICTURES, BaselineCause, Cause, DetectedCause, FittedCause, PerChannelCause
from paxisim.diagnose.causes.latency import LATENCY
from paxisim.diagnose.causes.layout import LAYOUT
from paxisim.diagnose.causes.low_pass import LOW_PASS
from paxisim.diagnose.causes.offset import OFFSET
from paxisim.diagnose.causes.quantisation import QUANTISATION
from paxisim.diagnose.causes.rotation import ROTATION
from paxisim.diagnose.causes.saturation import SATURATION
from paxisim.diagnose.causes.scene import SCENE_CAUSES
from paxisim.diagnose.causes.stiffening import STIFFENING
from paxisim.diagnose.causes.swapped_taxels import SWAPPED_TAXELS
from paxisim.diagnose.causes.taxel_gain import TAXEL_GAIN
from paxisim.diagnose.data.motions import MOTIONS
from paxisim.errors import InvalidValueError, UnknownNameError

CAUSES: tuple[Cause, ...] = (
    *SCENE_CAUSES,
    LAYOUT,
    SWAPPED_TAXELS,
    STIFFENING,
    CREEP,
    HYSTERESIS,
    GEL_OPERATOR,
    AXIS_COUPLING,
    ROTATION,
    INTERFERENCE,
    AXIS_GAIN,
    LOW_PASS,
    LATENCY,
    CHANNEL_CURVE,
    TAXEL_GAIN,
    OFFSET,
    DRIFT,
    DEAD_BAND,
    SATURATION,
    QUANTISATION,
    DEAD_TAXELS,
)
"""The built-in causes, in chain order."""

_ADDED: list[Cause] = []


def register_cause(cause: Cause) -> None:
    """Add a cause to those that a diagnosis looks for.

    Raises:
        InvalidValueError: It is none of the four kinds, a cause of that name already exists, or there is no motion or
            kind of picture of the name that it has.
    """
    if not isinstance(cause, (FittedCause, PerChannelCause, BaselineCause, DetectedCause)):
        raise InvalidValueError(
            "a cause must be a FittedCause, PerChannelCause, BaselineCause or DetectedCause, got "
            f"{type(cause).__name__}: see docs/how-to/add-a-cause.md"
        )
    if cause.name in known_causes():
        raise InvalidValueError(f"there is a cause {cause.name!r} already; choose another name")
    for field, names in (("excites", MOTIONS), ("picture", PICTURES)):
        given = getattr(cause, field)
        if given not in names:
            raise InvalidValueError(
                f"{field} of the cause {cause.name!r} must be one of {', '.join(names)}, got {given!r}"
            )
    _ADDED.append(cause)


def known_causes() -> tuple[str, ...]:
    """Names of all causes, in chain order."""
    return tuple(item.name for item in _all())


def cause(name: str) -> Cause:
    """Return the cause of that name.

    Raises:
        UnknownNameError: There is no such cause.
    """
    for item in _all():
        if item.name == name:
            return item
    fitted = (item for item in _all() if isinstance(item, FittedCause))
    whole = next((item.name for item in fitted for part in item.parts if part.name.lower().startswith(name)), "")
    advice = f"it is a part of {whole}" if whole else "if it is your own, import its module first"
    raise UnknownNameError("cause", name, known_causes(), advice)


def _all() -> list[Cause]:
    return sorted((*CAUSES, *_ADDED), key=lambda item: item.order)
