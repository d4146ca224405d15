"""The check of a sensor whose chips each measure the field along axes of their own: which of them respond.

Order and axes cannot be found by pressing: a magnetised skin changes the field at every chip, in any direction. Nothing
here reads a terminal or a device, as in `paxisim.hw.check`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError
from paxisim.hw.check import CheckResult, Finding, Step, checked_frames
from paxisim.hw.profile import Profile

RESPONDS = 8.0
"""Noises by which the field at a chip must change while the skin is pressed over it."""


@dataclass(frozen=True, eq=False)
class FieldRest:
    """What the chips read while nothing touches the skin.

    Attributes:
        field: ``(pads, 3, rows, cols)`` the median over time.
        noise: The same, standard deviation from reading to reading, without drift.
    """

    field: NDArray[np.float64]
    noise: NDArray[np.float64]


def field_steps() -> tuple[Step, ...]:
    """What to ask of the user, in this order."""
    return (
        Step("free", "Leave the sensor untouched, with no iron and no other magnet near it"),
        Step("press", "Press the skin with a finger and move over all of it, slowly"),
    )


def field_at_rest(profile: Profile, field: ArrayLike) -> FieldRest:
    """What the sensor reads while nobody touches it.

    Args:
        profile: The profile it was read with.
        field: ``(T, pads, 3, rows, cols)``, recorded during the step ``free``.

    Raises:
        InvalidValueError: Too few frames.
    """
    frames = checked_frames(profile, field, "free")
    return FieldRest(np.median(frames, axis=0), np.sqrt(np.mean(np.diff(frames, axis=0) ** 2, axis=0) / 2))


def responses(profile: Profile, step: Step, field: ArrayLike, rest: FieldRest) -> NDArray[np.float64]:
    """``(taxels,)`` by how many noises each chip's field changed most, in the order of the bytes.

    Args:
        profile: The profile it was read with.
        step: The one that was done.
        field: ``(T, 1, 3, rows, cols)``, recorded during it.
        rest: Of `field_at_rest`.

    Raises:
        InvalidValueError: Too few frames, or no chip felt anything. The step can be asked for again.
    """
    change = np.abs(checked_frames(profile, field, step.name) - rest.field).max(axis=0)
    # the steps of a chip's numbers may hide its noise
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
    """Say which chips respond.

    Args:
        profile: The profile that everything was read with.
        felt: What `responses` gave, under ``press``.
        verified: What the profile says under that name.

    Raises:
        InvalidValueError: A chip does not respond: no profile is made of a board that has a dead one.
    """
    ratio = felt["press"]
    silent = np.flatnonzero(ratio < RESPONDS)
    if silent.size:
        raise InvalidValueError(
            f"chip {', '.join(map(str, silent))} of {len(ratio)} (in the order of the bytes, from 0) does not respond: "
            "was the whole skin pressed? If so, its wires or its solder"
        )
    findings = [
        Finding(
            f"all {len(ratio)} chips respond, by {ratio.min():.0f} to {ratio.max():.0f} times their noise", False, True
        ),
        Finding("order and axes: cannot be told by pressing; calibration fits each channel for itself", False, True),
    ]
    return CheckResult(replace(profile, verified=verified), tuple(findings))
