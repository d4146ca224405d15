"""Taxels: pictures of causes with a value for each taxel: maps, and the channel that shows the cause best."""

from __future__ import annotations

import numpy as np

from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.gains import TaxelGain
from paxisim.augment.layout_faults import LayoutFault
from paxisim.augment.swapped_taxels import SwappedTaxels
from paxisim.diagnose.report import marks
from paxisim.diagnose.report.curves import force_force
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.maps import MOST_PADS, grid_of_maps
from paxisim.diagnose.report.style import AXES, Picture, finish, panel, thin


def taxel_map(effect: Effect) -> list[Picture]:
    """Map of the gain of each taxel, and force against force for the most affected taxel."""
    streams, member = effect.streams, effect.member
    assert isinstance(member, TaxelGain)
    gains = np.asarray(member.gain, dtype=float)
    gains = 100 * (np.broadcast_to(gains, (len(streams.pads), *streams.measured.shape[-2:])) - 1)
    pads = sorted(np.argsort(-(gains**2).sum(axis=(1, 2)), kind="stable")[:MOST_PADS].tolist())
    limit = float(np.abs(gains[pads]).max()) or 1.0
    figure = grid_of_maps(
        streams.layout, [gains[pad] for pad in pads], [f"{streams.pad(pad)}" for pad in pads], 2, limit,
        signed=True, unit="%",
    )  # fmt: skip
    spread = finish(
        figure,
        f"Taxel gains deviate from 1 by {gains.min():+.0f}% to {gains.max():+.0f}%",
        f"Maps of the fitted gain of each taxel, as deviations from 1: {gains.min():+.1f}% to {gains.max():+.1f}%.",
        legend=False,
    )
    return [spread, force_force(effect, "The most affected taxel")]


def silent_map(effect: Effect) -> list[Picture]:
    """Maps of the taxels that do not respond, and the trace of one of them under load."""
    streams, member = effect.streams, effect.member
    assert isinstance(member, DeadTaxels)
    gone = np.asarray(member.dead, dtype=float) + np.asarray(member.stuck, dtype=float)
    gone = np.broadcast_to(gone, (len(streams.pads), *streams.measured.shape[-2:]))
    pads = sorted(np.argsort(-gone.sum(axis=(1, 2)), kind="stable")[:MOST_PADS].tolist())
    titles = [f"{streams.pad(pad)}" for pad in pads]
    figure = grid_of_maps(streams.layout, [gone[pad] for pad in pads], titles, 2, 1.0, strip=False)
    count = int(gone.sum())
    names = ", ".join(f"{streams.pad(p)} ({r}, {c})" for p, r, c in np.argwhere(gone > 0)[:12])
    where = finish(
        figure,
        f"{count} taxel{'s do' if count > 1 else ' does'} not respond",
        f"Maps of the taxels that do not respond: {names}.",
        legend=False,
    )
    channel = effect.channel
    number = int(effect.energy[(slice(None), *channel)].argmax())
    return [where, _trace(effect, channel, number, "The reading stays constant under load")]


def mapping(effect: Effect) -> list[Picture]:
    """Pictures of the force as simulated, as measured, and as simulated with the corrected mapping."""
    member = effect.member
    if isinstance(member, SwappedTaxels):
        return [_moved(effect), _swapped(effect)]
    assert isinstance(member, LayoutFault)
    pictures = []
    moved = member.flip_rows or member.flip_cols or member.transpose or member.pad_order is not None
    if moved:
        pictures.append(_moved(effect))
    turned = [axis for axis in range(3) if member.axis_signs[axis] < 0 or member.axis_order[axis] != axis]
    for axis in turned[:1]:
        energy = effect.energy[:, :, axis]
        number, pad, row, col = (int(i) for i in np.unravel_index(int(energy.argmax()), energy.shape))
        title = (
            f"{AXES[axis]} has the wrong sign" if member.axis_signs[axis] < 0 else f"{AXES[axis]} reads another axis"
        )
        pictures.append(_trace(effect, (pad, axis, row, col), number, title))
    if not moved:
        pictures.append(force_force(effect, "Measured and simulated force disagree"))
    elif not turned:
        pictures.append(_swapped(effect))
    return pictures


def _swapped(effect: Effect) -> Picture:
    channel = effect.channel
    number = int(effect.energy[(slice(None), *channel)].argmax())
    return _trace(effect, channel, number, "A taxel reads the force on another taxel")


def _moved(effect: Effect) -> Picture:
    streams = effect.streams
    number = int(effect.energy.sum(axis=(1, 2, 3, 4)).argmax())
    span = streams.episodes[number]
    change = [float(np.sum((effect.model[t] - effect.without[t]) ** 2)) for t in range(span.start, span.stop)]
    at = span.start + int(np.argmax(change))
    kinds = ((effect.without, "simulated"), (streams.measured, "measured"), (effect.model, "corrected"))
    pads = range(min(len(streams.pads), MOST_PADS))
    maps = [np.abs(values[at, pad, 2]).astype(float) for pad in pads for values, _ in kinds]
    titles = [f"{streams.pads[pad]}, {name}" for pad in pads for _, name in kinds]
    figure = grid_of_maps(streams.layout, maps, titles, 3, float(np.max(maps)) or 1.0)
    return finish(
        figure,
        "One contact: simulated, measured, and with the corrected order of taxels",
        f"Maps of the normal force {streams.time[at] - streams.time[span.start]:.1f} s into "
        f"episode {streams.numbers[number]}: "
        "simulated, measured, and simulated with the corrected order, which agrees with the measurement.",
        legend=False,
    )


def _trace(effect: Effect, channel: tuple[int, int, int, int], number: int, title: str) -> Picture:
    span = effect.streams.episodes[number]
    time: Series = effect.streams.time[span] - effect.streams.time[span.start]
    t, measured, lacking, model = thin(time, *effect.at(channel, span))
    figure, axes = panel()
    marks.force_trace(axes, t, measured, lacking, model, effect.cause.name)
    axes.set_ylabel(f"{AXES[channel[1]]} force, N")
    place = effect.place(channel)
    return finish(
        figure,
        f"{title} ({place})",
        f"Measured force on {place} in episode {effect.streams.numbers[number]}, and the model with and without "
        f"{effect.cause.name}.",
    )
