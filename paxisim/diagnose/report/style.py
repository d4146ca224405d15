"""Style: what all pictures of a report share: colours, figures, marks, and the conversion to inline SVG.

Each picture is as wide as a phone screen, so its text has the size of the page's text; wider windows show several side
by side. Colours are CSS variables in the SVG, so they follow the page's dark mode.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, PAPER, MUTED, GRID = "#1f2328", "#fffffe", "#656d76", "#d8dee4"
MEASURED, SIMULATED, EXTENDED = INK, "#d9480f", "#1971c2"
DARK = {INK: "#e6edf3", PAPER: "#161b22", MUTED: "#9aa4ae", GRID: "#30363d", SIMULATED: "#ff922b", EXTENDED: "#4dabf7"}
_VARIABLES = {INK: "ink", PAPER: "paper", MUTED: "muted", GRID: "grid", SIMULATED: "simulated", EXTENDED: "extended"}
DASHES = (0, (4, 1.5))
WIDTH, HEIGHT = 3.75, 2.7  # inches; 360 CSS pixels wide
AXES = "xyz"
_LONG = re.compile(r"(\.\d\d)\d+")  # coordinates are cut to two decimals, to save space
MAX_POINTS = 500  # most points in a line or cloud


@dataclass(frozen=True)
class Picture:
    """A picture on the page: SVG as a data URI, a caption, and a text for readers who cannot see it."""

    source: str
    title: str
    alt: str


@contextmanager
def drawing() -> Iterator[None]:
    """Context with the matplotlib settings of a report; restores the previous settings on exit."""
    from matplotlib import rc_context

    settings: Any = {"font.family": "DejaVu Sans", "text.parse_math": False}  # names may contain dollar signs
    settings |= dict.fromkeys(("font.size", "axes.labelsize"), 9.0)
    settings |= dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 8.0)
    settings |= dict.fromkeys(("text.color", "axes.labelcolor"), INK)
    settings |= dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), MUTED)
    settings |= dict.fromkeys(("figure.facecolor", "savefig.facecolor"), PAPER)
    settings |= {"axes.facecolor": "none", "axes.linewidth": 0.7, "axes.spines.top": False, "axes.spines.right": False}
    settings |= {"axes.grid": True, "axes.axisbelow": True, "grid.color": GRID, "grid.linewidth": 0.6}
    settings |= {"legend.frameon": False, "lines.solid_capstyle": "round", "path.simplify": True}
    settings |= {"svg.fonttype": "none", "svg.hashsalt": "paxisim"}
    with rc_context(settings):
        yield


def blank(height: float) -> Figure:
    """Return an empty figure as wide as a phone screen."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def panel(x: str, y: str = "", height: float = HEIGHT) -> tuple[Figure, Axes]:
    """Return a figure with one set of axes that have the labels `x` and `y`."""
    figure = blank(height)
    axes = figure.add_subplot()
    axes.set(xlabel=x, ylabel=y)
    return figure, axes


def finish(figure: Figure, title: str, alt: str) -> Picture:
    """Convert a figure to a `Picture`, with a legend of its labelled lines above the axes."""
    pairs = (pair for axes in figure.axes for pair in zip(*axes.get_legend_handles_labels(), strict=True))
    labelled = {label: handle for handle, label in pairs}
    if labelled:
        figure.legend(
            labelled.values(), labelled.keys(), loc="outside upper left", ncols=3, handlelength=1.4,
            columnspacing=1.1, borderpad=0.1, handletextpad=0.5,
        )  # fmt: skip
    return Picture("data:image/svg+xml;base64," + base64.b64encode(_svg(figure).encode()).decode(), title, alt)


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = buffer.getvalue()[buffer.getvalue().index("<svg") :]
    for colour, name in _VARIABLES.items():
        text = text.replace(colour, f"var(--{name})")
    text = text.replace("'DejaVu Sans'", "system-ui, sans-serif")
    text = re.sub(r' (?:d|x|y)="[^"]*"', lambda match: _LONG.sub(r"\1", match[0]), text)
    light = "".join(f"--{name}:{colour};" for colour, name in _VARIABLES.items())
    dark = "".join(f"--{name}:{DARK[colour]};" for colour, name in _VARIABLES.items())
    style = f"<style>svg{{{light}}}@media(prefers-color-scheme:dark){{svg{{{dark}}}}}</style>"
    return text.replace("<defs>", style + "<defs>", 1)


def cloud(axes: Axes, x: np.ndarray, y: np.ndarray, faint: bool = False) -> None:
    """Draw measured samples as points; faint ones serve as a backdrop for their means and have no legend entry."""
    x, y = scattered(x, y)
    alpha, label = (0.18, None) if faint else (0.35, "measured")
    axes.plot(x, y, "o", color=MEASURED, alpha=alpha, markersize=2.8, markeredgewidth=0, label=label)


def points(axes: Axes, x: np.ndarray, y: np.ndarray, label: str = "measured", size: float = 4.0) -> None:
    """Draw a few measured samples, or the means of many, as individual points."""
    axes.plot(x, y, "o", color=MEASURED, markersize=size, alpha=0.9, markeredgewidth=0, label=label)


def without(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw the model without the cause."""
    axes.plot(x, y, color=SIMULATED, linewidth=1.4, linestyle=DASHES, label="without")


def level(axes: Axes, value: float = 0.0) -> None:
    """Draw the model without the cause where it is constant."""
    axes.axhline(value, color=SIMULATED, linewidth=1.3, linestyle=DASHES, label="without")


def with_cause(axes: Axes, x: np.ndarray, y: np.ndarray, name: str, width: float = 1.8) -> None:
    """Draw the model with the cause."""
    axes.plot(x, y, color=EXTENDED, linewidth=width, label=f"with {name}")


def note(axes: Axes, text: str, at: tuple[float, float], shift: tuple[float, float], **aligned: Any) -> None:
    """Write a text beside a point of the picture, shifted by points of the page."""
    axes.annotate(text, at, shift, textcoords="offset points", **aligned)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], size: float = 9.0) -> None:
    """Draw an arrow in the colour of the model with the cause."""
    look = {"arrowstyle": "-|>", "color": EXTENDED, "mutation_scale": size, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=look)


def shade(value: float, share: float) -> Any:
    """Return the colour of a value, by its sign, with the given share of full colour."""
    from matplotlib.colors import to_rgba

    return to_rgba(SIMULATED if value >= 0 else EXTENDED, share)


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Name the rows of horizontal bars."""
    axes.set_yticks(range(len(names)), names, color=INK)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)


def logarithmic(axes: Axes, which: str, values: np.ndarray) -> None:
    """Make axis "x" or "y" logarithmic, with ticks at 1, 2 and 5 for a small range, otherwise at powers of ten."""
    low, high = float(values.min()), float(values.max())
    steps = (1, 2, 5) if high < 300 * low else (1,)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks = [step * 10.0**power for power in powers for step in steps]
    ticks = [tick for tick in ticks if low * 0.999 <= tick <= high * 1.001]
    getattr(axes, f"set_{which}scale")("log")
    getattr(axes, f"set_{which}ticks")(ticks, [f"{tick:g}" for tick in ticks])
    getattr(axes, f"set_{which}ticks")([], minor=True)


def thin(*arrays: np.ndarray, points: int = MAX_POINTS) -> tuple[np.ndarray, ...]:
    """Keep every n-th sample, so that at most `points` remain."""
    step = max(1, -(-len(arrays[0]) // points))
    return tuple(array[::step] for array in arrays)


def scattered(x: np.ndarray, *others: np.ndarray, points: int = MAX_POINTS) -> tuple[np.ndarray, ...]:
    """Keep at most `points` samples, spread evenly over the range of `x`: only dense regions are thinned."""
    if len(x) <= points:
        return (x, *others)
    cell = _cells(x, 40)
    order = np.argsort(cell, kind="stable")
    within = np.arange(len(x)) - np.searchsorted(cell[order], cell[order])  # index within its cell
    sizes = np.bincount(cell, minlength=40)
    share = max(1, points // max(int((sizes > 0).sum()), 1))
    step = np.maximum(1, -(-sizes // share))
    kept = np.sort(order[within % step[cell[order]] == 0])
    return tuple(array[kept] for array in (x, *others))


def binned(x: np.ndarray, *others: np.ndarray, bins: int = 24, least: int = 5) -> tuple[np.ndarray, ...]:
    """Means of all arrays in `bins` equal bins over the range of `x`, for bins with at least `least` samples."""
    cell = _cells(x, bins)
    count = np.bincount(cell, minlength=bins)
    kept = count >= min(least, max(1, len(x) // bins))
    return tuple(np.bincount(cell, weights=a, minlength=bins)[kept] / count[kept] for a in (x, *others))


def _cells(x: np.ndarray, bins: int) -> np.ndarray:
    """``(len(x),)`` index of the bin of each sample, of `bins` equal bins over the range of `x`."""
    low, high = float(x.min()), float(x.max())
    return np.minimum((bins * (x - low) / max(high - low, 1e-12)).astype(int), bins - 1)
