"""Plain: for any cause, also one of the user's: what is seen against what it predicts, and both in time."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    MEASURED,
    SIMULATED,
    Picture,
    finish,
    panel,
    scattered,
    thin,
)


def plain(effect: Effect) -> list[Picture]:
    """What the cause adds in time, and point by point against what is measured beyond the rest of the model."""
    channel, name = effect.channel, effect.cause.name
    number = int(effect.energy[(slice(None), *channel)].argmax())
    span = effect.streams.episodes[number]
    time = effect.streams.time[span] - effect.streams.time[span.start]
    t, measured, without, model = thin(time, *effect.at(channel, span))
    place = effect.place(channel)

    figure, axes = panel()
    axes.axhline(0, color=SIMULATED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(t, measured - without, ".", color=MEASURED, alpha=0.4, markersize=3.5, label="measured")
    axes.plot(t, model - without, color=EXTENDED, linewidth=1.7, label=f"with {name}")
    axes.set_xlabel("time in the episode, s")
    axes.set_ylabel(f"on top on {AXES[channel[1]]}, N")
    in_time = finish(
        figure,
        f"What {name} adds is what is missing",
        f"Measured force minus that of the model without {name}, and what {name} adds, in time: {place}, "
        f"episode {number}.",
    )

    measured, without, model = effect.at(channel)
    adds, seen = model - without, measured - without
    figure, axes = panel()
    axes.plot(*scattered(adds, seen), ".", color=MEASURED, alpha=0.3, markersize=4, markeredgewidth=0, label="measured")
    ends = np.array([adds.min(), adds.max()])
    axes.axhline(0, color=SIMULATED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(ends, ends, color=EXTENDED, linewidth=1.8, label=f"with {name}")
    axes.set_xlabel(f"{name} says, N")
    axes.set_ylabel("missing without it, N")
    against = finish(
        figure,
        "Point by point: what is missing against what the cause says",
        f"What the measurement has beyond the model without {name}, against what {name} adds, {place}: points lie "
        "about the line on which both are equal.",
    )
    return [in_time, against]
