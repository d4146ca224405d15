"""Plain: pictures for any cause: measured and modelled deviation over time, and against each other."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import AXES, Picture, finish, panel, thin


def plain(effect: Effect) -> list[Picture]:
    """Measured deviation and effect of the cause, over time and against each other."""
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
    axes.set_ylabel(f"deviation on {AXES[channel[1]]}, N")
    in_time = finish(
        figure,
        f"Deviation without {name}, and effect of {name}",
        f"Measured force minus force in the model without {name}, and the effect of {name}, against time, {place}, "
        f"episode {effect.streams.numbers[number]}.",
    )

    measured, lacking, model = effect.at(channel)
    adds, seen = model - lacking, measured - lacking
    figure, axes = panel()
    marks.cloud(axes, adds, seen)
    marks.level(axes)
    ends = np.array([adds.min(), adds.max()])
    marks.with_cause(axes, ends, ends, name)
    axes.set_xlabel(f"effect of {name}, N")
    axes.set_ylabel("measured deviation, N")
    against = finish(
        figure,
        f"Measured deviation against the effect of {name}",
        f"Measured force minus force in the model without {name}, against the effect of {name}, {place}. The points "
        "scatter around the line of equality.",
    )
    return [in_time, against]
