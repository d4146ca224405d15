"""FilmFrame: one frame of a film: the scene, the pads of both streams, and the total normal force over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paxisim.presses import runs
from paxisim.recording import Recording
from paxisim.viz import drawing

SIZE = (960, 540)
"""Width and height of a frame in pixels."""
SCENE = (400, 356)
"""Width and height of the picture of the scene, at the frame's upper left."""
COLORS = {"measured": "#c0392b", "simulated": "#2c6fbb"}

_DPI = 100
_INK, _SHADE = "#333333", "#f3d9a4"
_LEFT, _RIGHT = 10, 90  # pixels beside the pads; the scales are at the right
_TOP, _HEADER = 6, 18  # pixels above the pads, and for the name of a stream
_GAP = 18  # pixels between two pads, for their names
_LETTERS = 24  # of a pad's name
_PLOT = (76, 36, 20, 144)  # pixels to the left of, below and to the right of the plot over time, and its height
_USUAL = 0.99  # share of the samples that the scale covers: an impact must not set it


class FilmFrame:
    """The picture of a moment of a recording; all that does not change is drawn once.

    Attributes:
        vmax: Normal force of full red, in N or the recording's unit.
    """

    def __init__(
        self, recording: Recording, clock: NDArray[np.float64], doubtful: NDArray[np.bool_], with_scene: bool
    ) -> None:
        """Draw what does not change.

        Args:
            recording: The recording.
            clock: ``(T,)`` times (s) at which its samples are drawn; they increase.
            doubtful: ``(T,)`` True where the span is shaded.
            with_scene: Whether to leave room for a picture of the scene.
        """
        self._recording, self._clock = recording, clock
        streams = {"measured": recording.measured, "simulated": recording.simulated}
        self._streams = {name: force for name, force in streams.items() if force is not None}
        self.vmax = _scale([np.abs(force[:, :, 2]) for force in self._streams.values()])
        self._shear_max = _scale([np.hypot(force[:, :, 0], force[:, :, 1]) for force in self._streams.values()])
        figure = Figure(figsize=(SIZE[0] / _DPI, SIZE[1] / _DPI), dpi=_DPI)
        self._canvas = FigureCanvasAgg(figure)
        self._pads = self._draw_pads(figure, SCENE[0] if with_scene else 0)
        self._moving = self._draw_plot(figure, doubtful)
        for artist in [*(one for pair in self._pads.values() for one in pair), *self._moving]:
            artist.set_animated(True)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(figure.bbox)

    def picture(self, sample: int, scene: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
        """Return the frame ``(height, width, 3)`` of a sample.

        Args:
            sample: Index of the sample.
            scene: Picture of the scene, of the size `SCENE`.
        """
        self._canvas.restore_region(self._still)
        for (name, pad), drawn in self._pads.items():
            drawing.update_pad(drawn, self._streams[name][sample, pad].astype(np.float64), self._shear_max)
            for artist in drawn:
                artist.axes.draw_artist(artist)
        cursor, now = self._moving
        at = float(self._clock[sample])
        cursor.set_xdata([at, at])
        now.set_text(f"{self._recording.time[sample]:.2f} s, episode {self._recording.episode[sample]}")
        for artist in self._moving:
            artist.axes.draw_artist(artist)
        frame = np.asarray(self._canvas.buffer_rgba())[..., :3].copy()
        if scene is not None:
            frame[: SCENE[1], : SCENE[0]] = scene
        return frame

    def _draw_pads(self, figure: Figure, left: int) -> dict[tuple[str, int], Any]:
        """Draw the pads of each stream to the right of `left`; return the moving parts by stream and pad."""
        layout, names = self._recording.layout, self._recording.pads
        aspect = layout.size[1] / layout.size[0]
        area = (SIZE[0] - left - _LEFT - _RIGHT, SCENE[1] - _TOP)
        across, columns = _arranged(len(self._streams), len(names), area, aspect)
        block = (area[0] / across, area[1] * across / len(self._streams))
        cell = _cell(block, len(names), columns)
        height = max(_height(cell, aspect), 4.0)
        found = {}
        for index, name in enumerate(self._streams):
            corner = (left + _LEFT + block[0] * (index % across), SIZE[1] - _TOP - block[1] * (index // across))
            middle = ((corner[0] + block[0] / 2) / SIZE[0], (corner[1] - 2) / SIZE[1])
            figure.text(*middle, name, color=COLORS[name], ha="center", va="top", fontsize=11)
            for pad, label in enumerate(names):
                x = corner[0] + (pad % columns + 0.5) * cell[0]
                y = corner[1] - _HEADER - (pad // columns + 1) * cell[1] + 2 + (cell[1] - _GAP - height) / 2
                box = (x - height * aspect / 2, y, height * aspect, height)
                ax = figure.add_axes(tuple(np.divide(box, (*SIZE, *SIZE))))
                taxels, arrows = drawing.draw_pad(ax, np.zeros(layout.shape), layout, self.vmax, self._shear_max, "")
                arrows.set_linewidth(0)  # taxels are small here, and white edges would hide their arrows
                ax.set(xticks=[], yticks=[], xlabel="", ylabel="", title="")
                style = {"ha": "center", "va": "bottom", "fontsize": 8, "color": _INK, "parse_math": False}
                figure.text(x / SIZE[0], (y + height + 2) / SIZE[1], label[:_LETTERS], **style)
                found[name, pad] = taxels, arrows
        self._draw_scales(figure, next(iter(found.values())))
        return found

    def _draw_scales(self, figure: Figure, drawn: Any) -> None:
        """Draw the colour bar and the arrow's length at the right."""
        unit = self._recording.unit
        taxels, _ = drawn
        top, bottom = SIZE[1] - 94, SIZE[1] - SCENE[1] + 24
        ax = figure.add_axes(((SIZE[0] - 76) / SIZE[0], bottom / SIZE[1], 10 / SIZE[0], (top - bottom) / SIZE[1]))
        bar = figure.colorbar(taxels, cax=ax)
        lowest = min(float(np.nanmin(force[:, :, 2], initial=0.0)) for force in self._streams.values())
        ax.set_ylim(max(lowest, -self.vmax), self.vmax)
        ax.tick_params(length=0, labelsize=8, colors=_INK)
        bar.set_label(f"normal force of a taxel ({unit})" if unit == "N" else f"z ({unit})", fontsize=8, color=_INK)
        bar.outline.set_visible(False)  # type: ignore[operator]
        style = {"fontsize": 8, "color": drawing.GREEN, "ha": "right", "va": "top"}
        figure.text((SIZE[0] - 8) / SIZE[0], (SIZE[1] - 10) / SIZE[1], _arrow_text(self._shear_max, unit), **style)

    def _draw_plot(self, figure: Figure, doubtful: NDArray[np.bool_]) -> tuple[Any, Any]:
        """Draw the total normal force over time; return the cursor and the text of the time."""
        left, bottom, right, height = _PLOT
        box = (left / SIZE[0], bottom / SIZE[1], (SIZE[0] - left - right) / SIZE[0], (height - 24) / SIZE[1])
        ax = figure.add_axes(box)
        clock, unit = self._clock, self._recording.unit
        for index, (begin, end) in enumerate(runs(doubtful)):
            label = None if index else "in doubt"
            ax.axvspan(clock[begin], clock[end - 1], color=_SHADE, lw=0, label=label)
        ends = np.flatnonzero(np.diff(self._recording.episode)) + 1
        for end in ends:
            ax.axvline(float(clock[end - 1] + clock[end]) / 2, color="#dddddd", lw=0.8)
        for name, force in self._streams.items():
            total = force[:, :, 2].astype(np.float64).sum(axis=(1, 2, 3))
            gaps = np.insert(clock, ends, np.nan), np.insert(total, ends, np.nan)
            ax.plot(*gaps, color=COLORS[name], lw=1.1, label=name)
        ax.set_xlim(clock[0], max(clock[-1], clock[0] + 1e-3))
        ax.set_ylabel(f"total normal\nforce ({unit})" if unit == "N" else f"total z ({unit})", fontsize=8, color=_INK)
        ax.set_xlabel("time (s)", fontsize=8, color=_INK, labelpad=1)
        ax.tick_params(labelsize=8, colors=_INK, length=2)
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=3, frameon=False, fontsize=8, borderpad=0)
        cursor = ax.axvline(clock[0], color=_INK, lw=1)
        now = ax.text(0, 1.03, "", transform=ax.transAxes, fontsize=9, color=_INK, va="bottom")
        return cursor, now


def _arranged(streams: int, pads: int, area: tuple[int, int], aspect: float) -> tuple[int, int]:
    """Return how many streams side by side, and how many columns of pads in each, make the pads largest."""

    def height(arranged: tuple[int, int]) -> float:
        across, columns = arranged
        return _height(_cell((area[0] / across, area[1] * across / streams), pads, columns), aspect)

    return max(((across, columns) for across in {1, streams} for columns in range(1, pads + 1)), key=height)


def _cell(block: tuple[float, float], pads: int, columns: int) -> tuple[float, float]:
    """Return the width and height of the room for a pad with its name in the block of a stream."""
    return block[0] / columns, (block[1] - _HEADER) / -(-pads // columns)


def _height(cell: tuple[float, float], aspect: float) -> float:
    """Return the height of a pad in its room."""
    return min((cell[0] - _GAP) / aspect, cell[1] - _GAP)


def _scale(parts: list[NDArray[Any]]) -> float:
    """Return a magnitude that almost all samples stay below; 1 if all are zero."""
    peaks = np.concatenate([np.nan_to_num(part).reshape(len(part), -1).max(axis=1) for part in parts])
    most = float(np.quantile(peaks, _USUAL))
    return most if most > 1e-9 else 1.0


def _arrow_text(shear_max: float, unit: str) -> str:
    return f"shear arrow\none taxel long:\n{shear_max:.2g} {unit}"
