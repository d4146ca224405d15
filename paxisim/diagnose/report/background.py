"""Background: what is read though nothing presses: against the gripper's opening, and against time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.interference import Interference
from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.maps import MOST_PADS, grid_of_maps
from paxisim.diagnose.report.style import (
    AXES,
    Picture,
    binned,
    finish,
    panel,
    thin,
)

_LENGTHS = {"gripper_opening": ("gripper opening, mm", 1e3), "temperature": ("temperature, °C", 1.0)}


def field(effect: Effect) -> list[Picture]:
    """Interference: the mean reading of a pad against the covariate it goes with, on the two worst axes."""
    member = effect.member
    name = member.covariate if isinstance(member, Interference) else "gripper_opening"
    label, scale = _LENGTHS.get(name, (name, 1.0))
    x = scale * effect.streams.covariates[name]
    frames = _free(effect)
    return [_field(effect, pad, axis, x, frames, label) for pad, axis in effect.axes[:2]]


def _free(effect: Effect) -> NDArray[np.bool_]:
    rest = effect.streams.at_rest
    return rest if rest.sum() >= 20 else np.ones(len(rest), dtype=bool)


def _field(effect: Effect, pad: int, axis: int, x: Series, frames: NDArray[np.bool_], label: str) -> Picture:
    taxels = effect.streams.layout.taxels
    measured, without, model = (values[frames] / taxels for values in effect.sums(pad, axis))
    x, seen, adds = x[frames], measured - without, model - without
    middle = float(np.mean(seen - adds))  # the field is told up to a constant
    figure, axes = panel()
    marks.cloud(axes, x, seen)
    marks.level(axes, middle)
    mean, fitted = binned(x, adds + middle, bins=60, least=1)
    marks.with_cause(axes, mean, fitted, effect.cause.name)
    axes.set_xlabel(f"{label}; nothing touches the pads")
    axes.set_ylabel(f"{AXES[axis]} reading, N a taxel")
    swing = float(adds.max() - adds.min())
    place = f"pad {effect.streams.pads[pad]}, {AXES[axis]}"
    return finish(
        figure,
        f"Nothing touches it, yet {place} moves by {swing:.2g} N with the {label.split(',')[0]}",
        f"Mean reading of {place} with nothing pressed, against {label}: points follow the curve of the model with "
        f"{effect.cause.name}, which spans {swing:.3g} N.",
    )


def zero(effect: Effect) -> list[Picture]:
    """Offset and drift: what is read at rest, taxel by taxel and in time."""
    shift = _amount(effect)
    pads = sorted(np.argsort(-(shift**2).sum(axis=(1, 2, 3)), kind="stable")[:MOST_PADS].tolist())
    titles = [f"{effect.streams.pads[pad]}, {AXES[axis]}" for pad in pads for axis in range(3)]
    limit = float(np.abs(shift[pads]).max()) or 1.0
    maps = [shift[pad, axis] for pad in pads for axis in range(3)]
    figure = grid_of_maps(effect.streams.layout, maps, titles, 3, limit, signed=True)
    pad, axis, row, col = (int(i) for i in np.unravel_index(int(np.abs(shift).argmax()), shift.shape))
    name = effect.cause.name
    spread = finish(
        figure,
        "What each taxel reads without any force" if name == "offset" else "How far each taxel's zero wanders",
        f"Maps of the fitted {name} of each taxel by pad and axis; the largest is {shift[pad, axis, row, col]:.3g} N "
        f"at {effect.place((pad, axis, row, col))}.",
        legend=False,
    )
    return [_in_time(effect, shift), spread]


def _amount(effect: Effect) -> Series:
    """``(pads, 3, rows, cols)`` N that the cause adds, at the end against the start if it wanders."""
    first, last = effect.streams.episodes[0], effect.streams.episodes[-1]
    ends = [np.mean(effect.model[s] - effect.without[s], axis=0, dtype=float) for s in (first, last)]
    return ends[1] - ends[0] if effect.cause.name == "drift" else ends[0]


def _in_time(effect: Effect, shift: Series) -> Picture:
    """The mean of the taxels of one pad's axis that are off to the side to which most are: their noise averages out."""
    sides = np.stack([np.clip(shift, 0, None), np.clip(-shift, 0, None)]).sum(axis=(3, 4))
    side, pad, axis = (int(i) for i in np.unravel_index(int(sides.argmax()), sides.shape))
    taxels = shift[pad, axis] * (1 - 2 * side) > 0
    arrays = (effect.streams.measured, effect.without, effect.model)
    measured, lacking, model = (a[:, pad, axis][:, taxels].mean(axis=1, dtype=float) for a in arrays)
    seen, adds = measured - lacking, model - lacking
    frames = _free(effect)
    minutes = (effect.streams.time - effect.streams.time[0]) / 60
    figure, axes = panel()
    marks.cloud(axes, minutes[frames], seen[frames], faint=True)
    rests = [np.arange(s.start, s.stop)[frames[s]] for s in effect.streams.episodes]
    rests = [rest for rest in rests if len(rest)]
    marks.level(axes)
    at, fitted = thin(minutes, adds)
    marks.with_cause(axes, at, fitted, effect.cause.name)
    marks.means(
        axes, np.array([minutes[rest].mean() for rest in rests]), np.array([seen[rest].mean() for rest in rests])
    )
    axes.set_xlabel("time, min; nothing touches the pads")
    axes.set_ylabel(f"{AXES[axis]} reading, N a taxel")
    place = f"pad {effect.streams.pads[pad]}, {AXES[axis]}, mean of {int(taxels.sum())} taxels"
    return finish(
        figure,
        f"{'The zero wanders' if effect.cause.name == 'drift' else 'At rest it does not read zero'} ({place})",
        f"Readings with nothing pressed in time, {place}: the means of the episodes lie on the line of the model with "
        f"{effect.cause.name}.",
    )
