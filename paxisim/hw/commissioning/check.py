"""Logic of ``paxisim device check``: infer the profile of a sensor from presses at known places.

`check_steps` lists what to ask of the user, `feel` evaluates the recording of one step, and `conclude` compares all
steps with the profile and corrects it. Nothing here reads a terminal or a device. Force is passed as arrays
``(T, pads, 3, rows, cols)`` in the profile's unit, read with the profile to be checked and **not pooled**. A touch must
exceed the noise at rest and, if the unit is newtons, a fixed minimum.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError
from paxisim.hw.commissioning.taxel_order import fit_order
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.layout import TaxelLayout

MIN_PRESS = 0.5
"""Minimum total normal force (N) of a press."""
MIN_DRAG = 0.3
"""Minimum total shear (N) of a drag."""

_LEAST_FRAMES = 3
_ABOVE_NOISE = 8  # threshold of a touch, in standard deviations at rest
_STILL = 10  # tolerated range of an untouched pad's total, in units of its noise, if not in newtons
_LEAST_SLIDING = 0.15  # shear / normal force; less is an oblique press, not a drag
_STRAIGHT, _CLEARLY_STRAIGHT = 1.7, 3.0  # shear along the drag / shear across it
_DISTINCT, _CLEARLY_DISTINCT = 0.1, 0.3  # `OrderFit.margin`
_CORNER = 0.75  # expected place of a press "near the corner", in half extents of the pad
_IN_ITS_QUARTER = 0.1  # minimum distance of the press felt from the centre lines, in half extents of the pad


@dataclass(frozen=True)
class Step:
    """One step to ask of the user.

    Attributes:
        name: Short name, e.g. ``"top-left"``.
        prompt: Instruction for a person who faces the sensing surface.
        pad: Pad to touch, counted in the profile's order.
        corner: Where to press, as (x, y) in half extents of the pad; None if the place does not matter.
        drag: Axis of the drag: 0 for x, 1 for y; None if the step is not a drag.
    """

    name: str
    prompt: str
    pad: int = 0
    corner: tuple[float, float] | None = None
    drag: int | None = None


@dataclass(frozen=True, eq=False)
class Rest:
    """Readings of an untouched sensor.

    Attributes:
        force: ``(pads, 3, rows, cols)`` median over time.
        least_press: ``(pads,)`` minimum total normal force that counts as a press.
        least_drag: ``(pads,)`` minimum total shear that counts as a drag.
    """

    force: NDArray[np.float64]
    least_press: NDArray[np.float64]
    least_drag: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Touch:
    """Readings during one step.

    Attributes:
        pad: Pad that felt the touch, counted in the profile's order.
        force: ``(3, rows, cols)`` mean over the time of contact, minus the reading at rest.
        least_drag: Minimum total shear that counts as a drag.
    """

    pad: int
    force: NDArray[np.float64]
    least_drag: float

    @property
    def total(self) -> NDArray[np.float64]:
        """Sum over taxels, ``(3,)``."""
        return self.force.sum(axis=(1, 2))


@dataclass(frozen=True)
class Finding:
    """One finding of the check.

    Attributes:
        text: The finding in words.
        changed: True if the profile said otherwise.
        clear: False if this is the likeliest explanation, but only by a small margin.
    """

    text: str
    changed: bool
    clear: bool

    def __str__(self) -> str:
        """Return the text, marked if it is a change or unclear."""
        return f"{'! ' if self.changed else '  '}{self.text}{'' if self.clear else ' (unclear: check again)'}"


@dataclass(frozen=True)
class CheckResult:
    """Corrected profile and findings.

    Attributes:
        profile: Profile that explains the touches.
        findings: Findings on taxel order, axes and pads.
    """

    profile: Profile
    findings: tuple[Finding, ...]

    @property
    def changed(self) -> bool:
        """True if anything in the profile was wrong."""
        return any(finding.changed for finding in self.findings)


def check_steps(profile: Profile) -> tuple[Step, ...]:
    """Return the steps to ask of the user, in order. The first is always ``free``, the input of `rest_of`."""
    names = [slot.name for slot in profile.slots]
    here = f"on pad {names[0]!r}" if len(names) > 1 else "on the pad"
    steps = [Step("free", "Leave the sensor untouched")]
    steps += [
        Step(f"touch-{name}", f"Press pad {name!r} in its middle and no other pad", i)
        for i, name in enumerate(names[:-1])
    ]
    if profile.has_positions:
        for row, y in (("top", -_CORNER), ("bottom", _CORNER)):
            for col, x in (("left", -_CORNER), ("right", _CORNER)):
                if (row, col) != ("bottom", "right"):
                    steps.append(Step(f"{row}-{col}", f"Press near the {row} {col} corner {here}", corner=(x, y)))
    else:
        steps.append(Step("press", f"Press straight down {here}"))
    steps += [
        Step("drag-right", f"Press and drag to the right {here}; lift before going back", drag=0),
        Step("drag-down", f"Press and drag down {here}; lift before going back", drag=1),
    ]
    return tuple(steps)


def rest_of(profile: Profile, force: ArrayLike) -> Rest:
    """Return the readings of the untouched sensor.

    Args:
        profile: Profile that the sensor was read with.
        force: ``(T, pads, 3, rows, cols)``, recorded during the step ``free``.

    Raises:
        InvalidValueError: There are too few frames, or the sensor was touched.
    """
    frames = checked_frames(profile, force, "free")
    total = frames.sum(axis=(-2, -1))
    noise = total.std(axis=0)
    press = _ABOVE_NOISE * noise[:, 2]
    if profile.unit == "N":
        press, drag = np.maximum(press, MIN_PRESS), np.full(len(profile.slots), MIN_DRAG)
        wander = noise[:, 2] / (MIN_PRESS / 2)
    else:
        quick = np.sqrt(np.mean(np.diff(total[:, :, 2], axis=0) ** 2, axis=0) / 2)
        drag = np.maximum(_ABOVE_NOISE * noise[:, :2].max(axis=1), _ABOVE_NOISE * profile.resolution)
        press = np.maximum(press, _ABOVE_NOISE * profile.resolution)
        wander = np.ptp(total[:, :, 2], axis=0) / np.maximum(_STILL * quick, 1e-9)
    worst = int(wander.argmax())
    if wander[worst] > 1:
        raise InvalidValueError(
            f"pad {profile.slots[worst].name!r} was not left alone: its total changed by "
            f"{np.ptp(total[:, worst, 2]):.1f} {profile.unit} while it should be at rest"
        )
    return Rest(np.median(frames, axis=0), press, drag)


def feel(profile: Profile, step: Step, force: ArrayLike, rest: Rest) -> Touch:
    """Return what the sensor felt during a step.

    Args:
        profile: Profile that the sensor was read with.
        step: One of `check_steps`, other than ``free``.
        force: ``(T, pads, 3, rows, cols)``, recorded during that step.
        rest: Result of `rest_of`.

    Raises:
        InvalidValueError: The touch was too weak or too short, more than one pad felt it, or the drag had too little or
            oblique shear. The step can be repeated.
    """
    frames = checked_frames(profile, force, step.name) - rest.force
    total = np.abs(frames[:, :, 2].sum(axis=(-2, -1)))
    peak = total.max(axis=0)
    pad = int(peak.argmax())
    least = float(rest.least_press[pad])
    if peak[pad] < least:
        raise InvalidValueError(
            f"step {step.name}: too weak, {peak[pad]:.1f} {profile.unit} of normal force where at least {least:.1f} "
            f"{profile.unit} is needed"
        )
    others = np.delete(peak, pad)
    if others.size and others.max() > peak[pad] / 2:
        raise InvalidValueError(f"step {step.name}: more than one pad was pressed; press one at a time")
    contact = total[:, pad] >= peak[pad] / 2
    if contact.sum() < _LEAST_FRAMES:
        raise InvalidValueError(f"step {step.name}: too short, {int(contact.sum())} frames; hold it for a second")
    touch = Touch(pad, frames[contact, pad].mean(axis=0), float(rest.least_drag[pad]))
    if step.drag is not None:
        _drag_axis(profile, step, touch)
    return touch


def conclude(profile: Profile, touches: Mapping[str, Touch], verified: str = "") -> CheckResult:
    """Compare the touches with the profile and correct it.

    Args:
        profile: Profile that all steps were read with.
        touches: Results of `feel` for all steps but ``free``, keyed by the name of the step.
        verified: `Profile.verified` of the corrected profile, also entered as the source of what was checked.

    Returns:
        The corrected profile and the findings. Whatever the steps cannot determine stays as it was.

    Raises:
        InvalidValueError: A step is missing, a step was done on another pad than requested, or no order of the taxels
            fits the touches.
    """
    steps = check_steps(profile)[1:]
    missing = [step.name for step in steps if step.name not in touches]
    if missing:
        raise InvalidValueError(f"the check is incomplete, it lacks: {', '.join(missing)}")
    slots, pads_finding = _find_slots(profile, steps, touches)
    axes, axes_findings = _find_axes(profile, steps, touches)
    layout, pool, order_finding = _find_order(profile, steps, touches)
    findings = (order_finding, *axes_findings, *((pads_finding,) if len(slots) > 1 else ()))
    sources = dict(profile.sources)
    if verified:
        sources |= dict.fromkeys(("layout", "axes", "slots") if profile.has_positions else ("axes", "slots"), verified)
    corrected = replace(
        profile, wire_layout=layout, pool=pool, axes=axes, slots=slots, verified=verified, sources=sources
    )
    return CheckResult(corrected, findings)


def checked_frames(profile: Profile, force: ArrayLike, step: str) -> NDArray[np.float64]:
    """Return the frames of a step as a float64 array ``(T, pads, 3, rows, cols)``.

    Raises:
        InvalidValueError: There are too few frames, or they have another shape.
    """
    frames = np.asarray(force, dtype=np.float64)
    profile.wire_layout.check(frames, len(profile.slots))
    if frames.ndim != 5 or len(frames) < _LEAST_FRAMES:
        raise InvalidValueError(
            f"step {step}: expected at least {_LEAST_FRAMES} frames, (T, pads, 3, rows, cols), got shape {frames.shape}"
        )
    return frames


# ---- pads ---------------------------------------------------------------------------------------------------------


def _find_slots(
    profile: Profile, steps: tuple[Step, ...], touches: Mapping[str, Touch]
) -> tuple[tuple[Slot, ...], Finding]:
    slots = profile.slots
    found = [touches[step.name].pad for step in steps if step.name.startswith("touch-")]
    if len(set(found)) != len(found):
        raise InvalidValueError("the answers contradict one another: two different pads were felt as the same one")
    found += [pad for pad in range(len(slots)) if pad not in found]
    for step in steps:
        if touches[step.name].pad != found[step.pad]:
            raise InvalidValueError(
                f"step {step.name} was done on another pad than the one touched as {slots[step.pad].name!r}"
            )
    corrected = tuple(Slot(slot.name, slots[pad].index) for slot, pad in zip(slots, found, strict=True))
    if corrected == slots:
        return slots, Finding("pads: they match the profile", False, True)
    moved = [f"{new.name!r} is at {new.index}" for new, old in zip(corrected, slots, strict=True) if new != old]
    return corrected, Finding(f"pads: they are swapped; {' and '.join(moved)}", True, True)


# ---- axes and signs -----------------------------------------------------------------------------------------------


def _drag_axis(profile: Profile, step: Step, touch: Touch) -> tuple[int, int, float, float]:
    """Return the tensor axis and the sign of a drag, and the shear along and across that axis."""
    shear = touch.total[:2]
    axis = int(np.abs(shear).argmax())
    along, across = abs(shear[axis]), abs(shear[1 - axis])
    least, unit = max(touch.least_drag, _LEAST_SLIDING * abs(touch.total[2])), profile.unit
    if along < least:
        raise InvalidValueError(
            f"step {step.name}: too little shear, {along:.1f} {unit} where at least {least:.1f} {unit} is needed; drag "
            "until it slides, and lift before going back"
        )
    if along < _STRAIGHT * across:
        raise InvalidValueError(
            f"step {step.name}: the shear was askew, {along:.1f} {unit} along one axis and {across:.1f} {unit} along "
            "the other; drag in a straight line"
        )
    return axis, 1 if shear[axis] > 0 else -1, float(along), float(across)


def _find_axes(
    profile: Profile, steps: tuple[Step, ...], touches: Mapping[str, Touch]
) -> tuple[tuple[str, str, str], list[Finding]]:
    axes = list(profile.axes)
    findings = []
    felt_on = {}
    for step in steps:
        if step.drag is None:
            continue
        axis, sign, along, across = _drag_axis(profile, step, touches[step.name])
        felt_on[step.drag] = axis
        axes[step.drag] = _signed(profile.axes[axis], sign)
        changed = axes[step.drag] != profile.axes[step.drag]
        was = f", not {profile.axes[step.drag]}" if changed else ""
        findings.append(
            Finding(
                f"axes: the pad's {'xy'[step.drag]} is the wire's {axes[step.drag]}{was} "
                f"({along:.1f} {profile.unit} of shear along it, {across:.1f} {profile.unit} across)",
                changed,
                along >= _CLEARLY_STRAIGHT * across,
            )
        )
    if felt_on[0] == felt_on[1]:
        raise InvalidValueError(
            "the answers contradict one another: the drags to the right and down were felt along the same axis"
        )
    normal = [touches[step.name].total[2] for step in steps]
    if min(normal) < 0 < max(normal):
        raise InvalidValueError("the answers contradict one another: some presses were felt as push, others as pull")
    changed = normal[0] < 0
    axes[2] = _signed(profile.axes[2], -1 if changed else 1)
    was = f", not {profile.axes[2]}" if changed else ""
    findings.append(Finding(f"axes: the pad's z is the wire's {axes[2]}{was}", changed, True))
    return (axes[0], axes[1], axes[2]), findings


def _signed(axis: str, sign: int) -> str:
    return axis if sign > 0 else ("+" if axis[0] == "-" else "-") + axis[1]


# ---- order of the taxels ------------------------------------------------------------------------------------------


def _find_order(
    profile: Profile, steps: tuple[Step, ...], touches: Mapping[str, Touch]
) -> tuple[TaxelLayout, tuple[int, int], Finding]:
    layout, pool = profile.wire_layout, profile.pool
    corners = {step.name: step.corner for step in steps if step.corner is not None}
    if not corners:
        text = "order: cannot be determined, as the taxels' positions are unknown; they stay in the order of the bytes"
        return layout, pool, Finding(text, False, True)
    asked = np.array(list(corners.values()))
    fit = fit_order(layout, np.stack([touches[name].force[2] for name in corners]), asked)
    for name, at, felt in zip(corners, asked, fit.felt, strict=True):
        if np.any(np.sign(at) * felt < _IN_ITS_QUARTER):
            raise InvalidValueError(
                f"the answers contradict one another: no order of the taxels puts the press of step {name} in its "
                "quarter of the pad and the others in theirs; press closer to the corners"
            )
    if fit.margin < _DISTINCT:
        raise InvalidValueError(
            "the answers contradict one another: the presses at the corners fit several orders of the taxels about "
            "equally well; press closer to the corners, with a fingertip"
        )
    clear = fit.margin >= _CLEARLY_DISTINCT
    if fit.layout == layout:
        return layout, pool, Finding("order: the taxels match the profile", False, clear)
    text = f"order: {fit.orientation.text}"
    if fit.refolded:
        text = f"order: the bytes run along the other direction of the grid; with this fixed, {fit.orientation.text}"
    if not layout.is_grid:
        text += "; the positions were transformed accordingly"
    if fit.orientation.exchanges:
        pool = (pool[1], pool[0])
    return fit.layout, pool, Finding(text, True, clear)
