"""Text table of a readout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from paxisim.calibrate.linear import LinearCalibration

MAX_LISTED_CHANNELS = 30
"""Maximum number of listed channels; if there are more, those with the most unexplained variance are listed."""
MAX_WITH_ERRORS = 3
"""Maximum number of loads for which gains are listed with their intervals."""


def table_of(readout: LinearCalibration) -> str:
    """Return the delay, the loads and the channels of a readout as a text table."""
    return "\n".join([*_delay(readout), "", *_loads(readout), "", *_channels(readout)])


def _delay(readout: LinearCalibration) -> list[str]:
    low, high = (1e3 * end for end in readout.delay_interval)
    if low <= 0 <= high:
        lines = [f"delay: none, 95% interval {low:.1f} to {high:.1f} ms"]
    else:
        what = "the channels follow the loads" if readout.delay > 0 else "the loads follow the channels"
        lines = [f"delay: {what} by {abs(1e3 * readout.delay):.1f} ms, 95% interval {low:.1f} to {high:.1f} ms"]
    return [*lines, f"held out in turn: {readout.blocks} blocks; regularisation (ridge): {readout.ridge:g}"]


def _loads(readout: LinearCalibration) -> list[str]:
    width = max(4, *(len(load.name) for load in readout.loads))
    lines = [f"{'load':{width}}  {'changes by':>14}  {'by itself':>9}"]
    found = readout.excitation
    for k, load in enumerate(readout.loads):
        said = "" if found.separable[k] else "not excited" if not found.excited[k] else "not excited by itself"
        size = f"{found.spread[k]:.3g} {load.unit}"
        lines.append(f"{load.name:{width}}  {size:>14}  {found.alone[k]:>9.0%}  {said}".rstrip())
    return lines


def _channels(readout: LinearCalibration) -> list[str]:
    unit = readout.unit or "units"
    count, few = int(readout.used.sum()), len(readout.loads) <= MAX_WITH_ERRORS
    width = 17 if few else 10
    lines = [
        f"gains in {unit} per N or N m" + (", ± half widths of 95% intervals" if few else ""),
        f"error: root mean square on held-out data, in {unit}",
        f"{'channel':11}"
        + "".join(f"{load.name:>{width}}" for load in readout.loads)
        + f"{'error':>8} {'explained':>9}",
    ]
    used = np.flatnonzero(readout.used)
    order = used[np.argsort(readout.explained.ravel()[used], kind="stable")]
    for flat in np.sort(order[:MAX_LISTED_CHANNELS]):
        at = tuple(int(i) for i in np.unravel_index(flat, readout.used.shape))
        pad, axis, row, col = at
        gains = [
            f"{gain:.3g} ±{error:.1g}" if few else f"{gain:.3g}"
            for gain, error in zip(readout.gain[(..., *at)], readout.gain_error[(..., *at)], strict=True)
        ]
        name = f"{pad}: {row},{col} {'xyz'[axis]}"
        lines.append(
            f"{name:11}"
            + "".join(f"{gain:>{width}}" for gain in gains)
            + f"{readout.error[at]:>8.3g} {readout.explained[at]:>9.2%}"
        )
    if count > MAX_LISTED_CHANNELS:
        lines.append(f"... the {MAX_LISTED_CHANNELS} least explained of {count} channels")
    if count < readout.used.size:
        lines.append(
            f"not related to any load, set to zero: {readout.used.size - count} of {readout.used.size} channels"
        )
    return lines
