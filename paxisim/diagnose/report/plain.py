"""Plain: for any cause, also one of the user's: what is seen against what it predicts, and both in time."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import AXES, Picture, finish, panel, thin


def plain(effect: Effect) -> list[Picture]:
    """What the cause adds in time, and point by point against what is measured beyond the rest of the model."""
    channel, name = effect.channel, effect.cause.name
    number = int(effect.energy[(slice(None), *channel)].argmax())
    span = effect.streams.episodes[number]
    time = effect.streams.time[span] - effect.streams.time[span.start]
    t, measured, lacking, model = thin(time, *effect.at(channel, span))
    place = effect.place(channel)

    figure, axes = panel()
    marks.level(axes)
    marks.cloud(axes, t, measured - lacking)
    marks.with_cause(axes, t, model - lacking, name)
    axes.set_xlabel("time in the episode, s")
    axes.set_ylabel(f"what comes on top on {AXES[channel[1]]}, N")
    in_time = finish(
        figure,
        f"What {name} adds is what is missing",
        f"Measured force minus that of the model without {name}, and what {name} adds, in time: {place}, "
        f"episode {number}.",
    )

    measured, lacking, model = effect.at(channel)
    adds, seen = model - lacking, measured - lacking
    figure, axes = panel()
    marks.cloud(axes, adds, seen)
    marks.level(axes)
    ends = np.array([adds.min(), adds.max()])
    marks.with_cause(axes, ends, ends, name)
    axes.set_xlabel(f"{name} says, N")
    axes.set_ylabel("missing without it, N")
    against = finish(
        figure,
        "Point by point: what is missing, and what the cause says",
        f"What the measurement has beyond the model without {name}, against what {name} adds, {place}: points lie "
        "about the line on which both are equal.",
    )
    return [in_time, against]
