"""Check of a sensor whose chips each measure the field along their own axes: find the chips that respond.

Pressing cannot reveal order and axes: a magnetised skin changes the field at every chip, in any direction. As in
`paxisim.hw.commissioning.check`, nothing here reads a terminal or a device.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError
from paxisim.hw.commissioning.check import CheckResult, Finding, Step, checked_frames
from paxisim.hw.profiles.profile import Profile

RESPONDS = 8.0
"""Minimum change of a chip's field while the skin is pressed over it, in multiples of its noise."""


@dataclass(frozen=True, eq=False)
class FieldRest:
    """Readings of the chips while nothing touches the skin.

    Attributes:
        field: ``(pads, 3, rows, cols)`` median over time.
        noise: ``(pads, 3, rows, cols)`` standard deviation from reading to reading, without drift.
    """

    field: NDArray[np.float64]
    noise: NDArray[np.float64]


def field_steps() -> tuple[Step, ...]:
    """Return the steps to ask of the user, in order."""
    return (
        Step("free", "Leave the sensor untouched, with no iron and no other magnet near it"),
        Step("press", "Press the skin with a finger and slowly move over all of it"),
    )


def field_at_rest(profile: Profile, field: ArrayLike) -> FieldRest:
    """Return the readings of the untouched sensor.

    Args:
        profile: Profile that the sensor was read with.
        field: ``(T, pads, 3, rows, cols)``, recorded during the step ``free``.

    Raises:
        InvalidValueError: There are too few frames.
    """
    frames = checked_frames(profile, field, "free")
    return FieldRest(np.median(frames, axis=0), np.sqrt(np.mean(np.diff(frames, axis=0) ** 2, axis=0) / 2))


def responses(profile: Profile, step: Step, field: ArrayLike, rest: FieldRest) -> NDArray[np.float64]:
    """Return each chip's largest field change in multiples of its noise, ``(taxels,)`` in the order of the bytes.

    Args:
        profile: Profile that the sensor was read with.
        step: The step that was done.
        field: ``(T, 1, 3, rows, cols)``, recorded during that step.
        rest: Result of `field_at_rest`.

    Raises:
        InvalidValueError: There are too few frames, or no chip responded. The step can be repeated.
    """
    change = np.abs(checked_frames(profile, field, step.name) - rest.field).max(axis=0)
    # a chip's quantisation may hide its noise
    floor = max(float(np.median(rest.noise)), profile.resolution * 1e-3)
    ratio = (change / np.maximum(rest.noise, floor)).max(axis=1)[0].ravel()
    if ratio.max() < RESPONDS:
        raise InvalidValueError(
            f"step {step.name}: too weak, the field changed by {ratio.max():.1f} times its noise where at least "
            f"{RESPONDS:g} is needed; press harder"
        )
    order = profile.wire_layout.vendor_order
    return ratio if order is None else ratio[np.asarray(order)]


def conclude_field(profile: Profile, felt: Mapping[str, NDArray[np.float64]], verified: str = "") -> CheckResult:
    """Check that all chips respond and return the profile as verified.

    Args:
        profile: Profile that all steps were read with.
        felt: Result of `responses`, under the key ``press``.
        verified: `Profile.verified` of the returned profile.

    Raises:
        InvalidValueError: A chip does not respond; a board with a dead chip gets no profile.
    """
    ratio = felt["press"]
    silent = np.flatnonzero(ratio < RESPONDS)
    if silent.size:
        raise InvalidValueError(
            f"chip {', '.join(map(str, silent))} of {len(ratio)} (in the order of the bytes, from 0) does not respond: "
            "was the whole skin pressed? If so, check its wires and solder"
        )
    findings = [
        Finding(
            f"all {len(ratio)} chips respond, by {ratio.min():.0f} to {ratio.max():.0f} times their noise", False, True
        ),
        Finding("order and axes: pressing cannot reveal them; calibration fits each channel separately", False, True),
    ]
    return CheckResult(replace(profile, verified=verified), tuple(findings))
