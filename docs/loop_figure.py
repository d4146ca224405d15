"""Draws docs/images/loop.png: record, replay, diagnose, train.

Each panel shows what that step gives for the recording of `paxisim example recording`.

    python docs/loop_figure.py
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from light_and_dark import light_and_dark
from matplotlib.figure import Figure
from matplotlib.patches import ConnectionPatch

import paxisim
from paxisim.cli.example import example_recording
from paxisim.diagnose import Diagnosis
from paxisim.viz.drawing import on_dark

OUTPUT = Path(__file__).parent / "images" / "loop.png"
SHOWN = slice(60, 170)  # samples of the traces
LIGHT = ("#333333", "#c0392b", "#2c6fbb", "#0b8a3a")  # ink, measured, simulated, fitted
DARK = ("#d9dde2", "#ff7b6b", "#6cb0f5", "#56d364")
TITLES = (
    ("1  Record", "the sensor, and what moves it"),
    ("2  Replay", "the same motion in MuJoCo"),
    ("3  Diagnose", "what explains the difference"),
    ("4  Train", "on what the sensor would read"),
)


def main() -> None:
    """Diagnose the example and draw."""
    recording = example_recording()
    found = paxisim.diagnose(recording, ["axis_gain", "latency"])
    print(found)
    corrected = found.model.run(recording.simulated.astype(float), recording.time)
    streams = (recording.measured, recording.simulated, corrected)
    traces = [stream[SHOWN, 0, 2].sum(axis=(-2, -1)) for stream in streams]
    for path in light_and_dark(OUTPUT):
        draw(found, recording.time[SHOWN], *traces).savefig(path, dpi=110)
        print(path)


def draw(found: Diagnosis, time: np.ndarray, measured: np.ndarray, simulated: np.ndarray, model: np.ndarray) -> Figure:
    """Draw what each step gives."""
    ink, red, blue, green = DARK if on_dark() else LIGHT
    names = {cause.name: {p.name: p.value for p in cause.parameters} for cause in found.causes}
    gain, delay = names["axis_gain"]["gain_z"], names["latency"]["delay"]

    figure = Figure(figsize=(11, 3.1), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.16, rect=(0, 0.08, 1, 0.92))
    panels = figure.subplots(1, 4)
    for ax, (title, what) in zip(panels, TITLES, strict=True):
        ax.set_title(f"{title}\n", loc="left", fontsize=13, fontweight="bold", color=ink)
        ax.text(0, 1.04, what, transform=ax.transAxes, fontsize=9.5, color=ink)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=8, colors=ink)
    for ax in panels[[0, 1, 3]]:
        ax.plot(time, measured, color=red, linewidth=1.3, label="measured")
        ax.set(xlabel="time (s)", ylabel="normal force (N)", ylim=(-4, 145))
    panels[1].plot(time, simulated, color=blue, linewidth=1.3, label="simulated")
    panels[3].plot(time, model, color=green, linewidth=2, linestyle=(0, (2, 1.5)), label="simulated, by the model")
    for ax in panels[[0, 1, 3]]:
        ax.legend(frameon=False, fontsize=8, loc="upper left", borderpad=0)
    shares = [100 * cause.gain.value for cause in found.causes]
    labels = {
        "axis_gain": f"axis_gain\ngain_z {gain.value:.2f}",
        "latency": f"latency\n{1e3 * delay.value:.0f} ms",
    }
    panels[2].barh([labels[cause.name] for cause in found.causes], shares, color=green, height=0.5)
    panels[2].invert_yaxis()
    panels[2].set(xlabel="share of the error explained (%)", xlim=(0, 100))
    for before, after in itertools.pairwise(panels):
        arrow = {"coordsA": "axes fraction", "coordsB": "axes fraction", "arrowstyle": "-|>", "mutation_scale": 16}
        figure.add_artist(ConnectionPatch((0.98, 1.18), (-0.06, 1.18), axesA=before, axesB=after, color=ink, **arrow))
    figure.text(0.5, 0.02, "deploy the policy, and record again", ha="center", fontsize=9.5, color=ink)
    return figure


if __name__ == "__main__":
    main()
