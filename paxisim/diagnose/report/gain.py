"""Gain: pictures of the error of simulation, extended model and black box, and of the gain by cause and by episode."""

from __future__ import annotations

from paxisim.diagnose.report.style import EXTENDED, INK, MUTED, PAPER, SIMULATED, Picture, finish, panel
from paxisim.diagnose.result import HeldOut, Result

_MOST_TICKS = 12


def gain_pictures(diagnosis: Result) -> list[Picture]:
    """Return pictures of the improvement by the extended model."""
    pictures = [_bars(diagnosis.heldout, bool(diagnosis.causes))]
    if diagnosis.causes:
        pictures.append(_causes(diagnosis))
        if len(diagnosis.heldout.gain_per_episode) > 1:
            pictures.append(_episodes(diagnosis))
    return pictures


def percent(value: float) -> str:
    """Format a share in percent, without meaningless digits for a failing black box."""
    return f"{value:.1%}" if value < 10 else "over 1000%"


def _bars(heldout: HeldOut, extended: bool) -> Picture:
    rows = [("simulation", heldout.nrmse_before, SIMULATED)]
    if extended:
        rows.append(("extended", heldout.nrmse_after, EXTENDED))
    if heldout.ceiling_nrmse is not None:
        rows.append(("black box", heldout.ceiling_nrmse, MUTED))
    figure, axes = panel(0.85 + 0.38 * len(rows))
    most = max(heldout.nrmse_before, heldout.nrmse_after, heldout.noise_floor)
    for place, (_, value, colour) in enumerate(rows):
        end = 100 * min(value, 1.1 * most)  # keeps a failing black box from squashing the other bars
        axes.barh(place, end, height=0.62, color=colour)
        axes.annotate(percent(value), (end, place), (4, 0), textcoords="offset points", va="center", color=INK)
    axes.axvline(100 * heldout.noise_floor, color=INK, linewidth=1.2, linestyle=(0, (3, 2)))
    left = heldout.noise_floor < 0.55 * most
    axes.annotate(
        f"noise floor {heldout.noise_floor:.1%}", (100 * heldout.noise_floor, -0.52),
        (4, 3) if left else (-4, 3), textcoords="offset points", ha="left" if left else "right",
        color=INK, fontsize=8,
    )  # fmt: skip
    axes.set_yticks(range(len(rows)), [name for name, _, _ in rows], color=INK)
    axes.set_ylim(len(rows) - 0.5, -0.85)
    axes.set_xlim(0, 136 * most or 1.0)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("normalised RMSE, %")
    words = ", ".join(f"{name} {percent(value)}" for name, value, _ in rows)
    where = "Held-out" if len(heldout.gain_per_episode) > 1 else "In-sample"
    becomes = f" → {heldout.nrmse_after:.1%}" if extended else ""
    return finish(
        figure,
        f"{where} error: {heldout.nrmse_before:.1%}{becomes}",
        f"{where} normalised RMSE: {words}. The noise floor is {heldout.noise_floor:.1%}.",
        legend=False,
    )


def _causes(diagnosis: Result) -> Picture:
    causes = diagnosis.causes
    figure, axes = panel(0.85 + 0.38 * len(causes))
    for place, cause in enumerate(causes):
        gain = cause.gain
        axes.barh(place, 100 * gain.value, height=0.62, color=EXTENDED)
        end = gain.value
        if gain.low is not None and gain.high is not None:
            axes.plot([100 * gain.low, 100 * gain.high], [place, place], color=PAPER, linewidth=3.6)
            axes.plot([100 * gain.low, 100 * gain.high], [place, place], color=INK, linewidth=1.6)
            end = max(end, gain.high)
        axes.annotate(
            f"{gain.value:.0%}", (100 * end, place), (5, 0), textcoords="offset points", va="center", color=INK
        )
    most = max(max(cause.gain.value, cause.gain.high or 0.0) for cause in causes)
    least = min(min(cause.gain.value, cause.gain.low or 0.0, 0.0) for cause in causes)
    axes.set_yticks(range(len(causes)), [cause.name for cause in causes], color=INK)
    axes.set_ylim(len(causes) - 0.5, -0.5)
    axes.set_xlim(118 * least, max(120 * most, 1.0))
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("% of the explainable error, 90% interval")
    words = ", ".join(f"{cause.name} {cause.gain.value:.0%}" for cause in causes)
    return finish(
        figure,
        "Gain of each cause: full model compared with the model without it",
        f"Gain of each cause, with intervals: {words}.",
        legend=False,
    )


def _episodes(diagnosis: Result) -> Picture:
    gains = [100 * gain for gain in diagnosis.heldout.gain_per_episode]
    figure, axes = panel(2.0)
    shown = [max(gain, -100.0) for gain in gains]
    axes.bar(range(len(gains)), shown, color=[EXTENDED if gain >= 0 else SIMULATED for gain in gains], width=0.7)
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set_ylim(min(0.0, 1.1 * min(shown)), 100)
    # a loaded diagnosis has no streams and so does not know the numbers
    numbers = range(len(gains)) if diagnosis.streams is None else diagnosis.streams.numbers
    shown_at = range(0, len(gains), -(-len(gains) // _MOST_TICKS))
    axes.set_xticks(shown_at, [str(numbers[i]) for i in shown_at])
    axes.set_xlabel("episode" if diagnosis.streams is not None else "episode, counted from 0")
    axes.set_ylabel("error removed, %")
    axes.grid(axis="x", visible=False)
    better = sum(gain > 0 for gain in gains)
    return finish(
        figure,
        f"The error decreases in {better} of {len(gains)} episodes",
        f"Share of each episode's error energy that the model removes. It is positive in {better} of {len(gains)} "
        "episodes.",
        legend=False,
    )
