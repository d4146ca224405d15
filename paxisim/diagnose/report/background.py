"""Background: pictures of readings at rest, against a covariate and against time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.explain.followed import followed
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

_LABELS = {"gripper_opening": ("gripper opening, mm", 1e3), "temperature": ("temperature, °C", 1.0)}
_KNOWN = {label for label, _ in _LABELS.values()}


def covariate(effect: Effect) -> list[Picture]:
    """Mean reading of a pad at rest against the covariate that it follows, on the two most affected axes."""
    frames, pictures = _at_rest(effect), []
    for pad, axis in effect.axes[:2]:
        _, without, model = effect.sums(pad, axis)
        name = followed(effect.member, effect.streams.covariates, (model - without)[frames, None], frames)[0]
        label, scale = _LABELS.get(name, (name, 1.0))
        pictures.append(_against(effect, pad, axis, scale * effect.streams.covariates[name], frames, label))
    return pictures


def _at_rest(effect: Effect) -> NDArray[np.bool_]:
    rest = effect.streams.at_rest
    return rest if rest.sum() >= 20 else np.ones(len(rest), dtype=bool)


def _against(effect: Effect, pad: int, axis: int, x: Series, frames: NDArray[np.bool_], label: str) -> Picture:
    taxels = effect.streams.layout.taxels
    measured, without, model = (values[frames] / taxels for values in effect.sums(pad, axis))
    x, seen, adds = x[frames], measured - without, model - without
    middle = float(np.mean(seen - adds))  # the effect is determined only up to a constant
    figure, axes = panel()
    marks.cloud(axes, x, seen)
    marks.level(axes, middle)
    mean, fitted = binned(x, adds + middle, bins=60, least=1)
    marks.with_cause(axes, mean, fitted, effect.cause.name)
    axes.set_xlabel(f"{label} (pads unloaded)")
    axes.set_ylabel(f"{AXES[axis]} reading, N per taxel")
    swing = float(adds.max() - adds.min())
    what = f"the {label.split(',')[0]}" if label in _KNOWN else label
    place = f"{effect.streams.pad(pad)}, {AXES[axis]}"
    return finish(
        figure,
        f"{place}: the reading without contact changes by {swing:.2g} N with {what}",
        f"Mean reading of {place} at rest against {label}. The points follow the curve of the model with "
        f"{effect.cause.name}, which spans {swing:.3g} N.",
    )


def zero(effect: Effect) -> list[Picture]:
    """Reading at rest over time, and maps of the zero of each taxel."""
    first = effect.streams.episodes[0]
    return _zeros(
        effect, _added(effect, first), "The sensor does not read zero at rest", "Reading of each taxel at rest"
    )


def zero_in_time(effect: Effect) -> list[Picture]:
    """Reading at rest over time, and maps of the drift of each taxel's zero."""
    first, last = effect.streams.episodes[0], effect.streams.episodes[-1]
    change = _added(effect, last) - _added(effect, first)
    return _zeros(effect, change, "The zero drifts", "Drift of each taxel's zero over the recording")


def _zeros(effect: Effect, shift: Series, title: str, title_of_maps: str) -> list[Picture]:
    pads = sorted(np.argsort(-(shift**2).sum(axis=(1, 2, 3)), kind="stable")[:MOST_PADS].tolist())
    titles = [f"{effect.streams.pads[pad]}, {AXES[axis]}" for pad in pads for axis in range(3)]
    limit = float(np.abs(shift[pads]).max()) or 1.0
    maps = [shift[pad, axis] for pad in pads for axis in range(3)]
    figure = grid_of_maps(effect.streams.layout, maps, titles, 3, limit, signed=True)
    pad, axis, row, col = (int(i) for i in np.unravel_index(int(np.abs(shift).argmax()), shift.shape))
    name = effect.cause.name
    spread = finish(
        figure,
        title_of_maps,
        f"Maps of the fitted {name} of each taxel, by pad and axis. The largest is {shift[pad, axis, row, col]:.3g} N "
        f"at {effect.place((pad, axis, row, col))}.",
        legend=False,
    )
    return [_in_time(effect, shift, title), spread]


def _added(effect: Effect, span: slice) -> Series:
    """``(pads, 3, rows, cols)`` N, mean effect of the cause over an episode."""
    return np.mean(effect.model[span] - effect.without[span], axis=0, dtype=float)


def _in_time(effect: Effect, shift: Series, title: str) -> Picture:
    """Mean reading over the taxels of one pad and axis that shift in the same direction; averaging reduces noise."""
    sides = np.stack([np.clip(shift, 0, None), np.clip(-shift, 0, None)]).sum(axis=(3, 4))
    side, pad, axis = (int(i) for i in np.unravel_index(int(sides.argmax()), sides.shape))
    taxels = shift[pad, axis] * (1 - 2 * side) > 0
    arrays = (effect.streams.measured, effect.without, effect.model)
    measured, lacking, model = (a[:, pad, axis][:, taxels].mean(axis=1, dtype=float) for a in arrays)
    seen, adds = measured - lacking, model - lacking
    frames = _at_rest(effect)
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
    axes.set_xlabel("time, min (pads unloaded)")
    axes.set_ylabel(f"{AXES[axis]} reading, N per taxel")
    place = f"{effect.streams.pad(pad)}, {AXES[axis]}, mean of {int(taxels.sum())} taxels"
    return finish(
        figure,
        f"{title} ({place})",
        f"Reading at rest against time, {place}. The episode means lie on the line of the model with "
        f"{effect.cause.name}.",
    )
