"""Drawing of a pad, its shear arrows and scales in matplotlib axes. The public functions are in `paxisim.viz.plot`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout
from paxisim.viz.colors import STOPS, STOPS_ON_DARK, UNKNOWN_COLOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.quiver import Quiver

GREEN, GREEN_ON_DARK = "#0b8a3a", "#56d364"
"""Colours of the shear arrows."""
_INK = "#444444"
_SHORTEST = 0.02  # arrows shorter than this fraction of a pitch are omitted
_LETTER, _KEY = 0.09, 1.1  # width in inches of a letter in a title, and of the reference arrow with its text


def draw_pad(
    ax: Axes,
    force: NDArray[np.float64],
    layout: TaxelLayout,
    vmax: float,
    shear_max: float,
    title: str,
    *,
    above_key: bool = False,
) -> tuple[PolyCollection, Quiver]:
    """Draw one pad, without scales, in colours for the background that matplotlib's settings give.

    Args:
        ax: Axes to draw in; their limits, aspect, title and labels are set. Lengths in mm.
        force: ``(3, rows, cols)`` newtons, pad frame.
        layout: The pad's taxels.
        vmax: Normal force (N) of full red.
        shear_max: Shear force (N) whose arrow is one pitch long.
        title: Title of the axes.
        above_key: Whether the title is above the reference arrow instead of beside it.

    Returns:
        The taxels as polygons in row-major order, and the arrows, which are masked where there is no visible shear.
    """
    from matplotlib import rcParams
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    ramp = [((stop + 1) / 2, rgb) for stop, rgb in (STOPS_ON_DARK if on_dark() else STOPS)]
    colors = LinearSegmentedColormap.from_list("paxisim", ramp, N=512).with_extremes(bad=UNKNOWN_COLOR)
    x, y = 1e3 * layout.positions[:, :2].T
    half_y, half_x = (500 * pitch for pitch in layout.pitch)
    offsets = np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])
    taxels = PolyCollection(
        list(np.stack([x, y], axis=-1)[:, None] + offsets),
        array=np.ma.masked_invalid(force[2].reshape(-1)),
        cmap=colors,
        norm=Normalize(-vmax, vmax),
        edgecolors=rcParams["axes.facecolor"],
        linewidths=1.0,
    )
    ax.add_collection(taxels)
    ax.set_aspect("equal")
    ax.set_xlim(x.min() - half_x, x.max() + half_x)
    ax.set_ylim(y.max() + half_y, y.min() - half_y)
    # a blank title reserves the space that the reference arrow needs
    ax.set_title(title or " ", loc="left", fontsize="large", pad=26 if above_key else 8, parse_math=False)
    ax.set_xlabel("x (mm)", color=_ink())
    ax.set_ylabel("y (mm)", color=_ink())
    longest = max(layout.size)
    ax.locator_params(axis="x", nbins=max(1, int(5 * layout.size[1] / longest)), min_n_ticks=1)
    ax.locator_params(axis="y", nbins=max(1, int(5 * layout.size[0] / longest)), min_n_ticks=1)
    ax.tick_params(length=0, colors=_ink(), labelsize="small")
    ax.spines[:].set_visible(False)
    return taxels, _draw_shear(ax, force[:2].reshape(2, -1), layout, shear_max)


def _ink() -> str:
    """Return the colour of labels: that of text by matplotlib's settings, if these are not the default's black."""
    from matplotlib import rcParams

    return _INK if rcParams["text.color"] == "black" else rcParams["text.color"]


def beside_key(ax: Axes, layout: TaxelLayout, title: str) -> bool:
    """Whether a title and the reference arrow fit side by side."""
    height, width = layout.size
    inches = min(ax.bbox.width, ax.bbox.height * width / height) / ax.figure.dpi
    return _LETTER * len(title) + _KEY <= inches


def _draw_shear(ax: Axes, shear: NDArray[np.float64], layout: TaxelLayout, top: float) -> Quiver:
    from matplotlib import rcParams

    pitch = 1e3 * min(layout.pitch)
    thickness = min(0.1 * pitch, 0.025 * 1e3 * max(layout.size))
    u, v = _visible(shear, top)
    # "xy" measures length and direction in data units, so positive y points down the inverted axis
    x, y = 1e3 * layout.positions[:, :2].T
    arrows = ax.quiver(
        *(x, y, u, v),
        **{"angles": "xy", "scale_units": "xy", "scale": top / pitch, "units": "xy", "pivot": "mid"},
        **{"width": thickness, "headwidth": 3.2, "headlength": 3.4, "headaxislength": 3.0, "minlength": 0.0},
        **{"color": GREEN_ON_DARK if on_dark() else GREEN, "edgecolor": rcParams["axes.facecolor"]},
        **{"linewidth": 0.6, "clip_on": False, "zorder": 3},
    )
    arrows.set_in_layout(False)  # constrained layout misjudges the size of the arrows
    return arrows


def _visible(shear: NDArray[np.float64], top: float) -> np.ma.MaskedArray:
    """Return shear ``(2, taxels)`` without what is too small to be seen."""
    invisible = ~(np.hypot(*shear) > _SHORTEST * top)  # the negation also covers NaN
    return np.ma.array(shear, mask=[invisible, invisible])


def update_pad(drawn: tuple[PolyCollection, Quiver], force: NDArray[np.float64], shear_max: float) -> None:
    """Change the reading of a pad that is drawn.

    Args:
        drawn: Return value of `draw_pad`.
        force: ``(3, rows, cols)`` newtons, pad frame.
        shear_max: Shear force (N) whose arrow is one pitch long, as when it was drawn.
    """
    taxels, arrows = drawn
    taxels.set_array(np.ma.masked_invalid(force[2].reshape(-1)))
    arrows.set_UVC(*_visible(force[:2].reshape(2, -1), shear_max))


def draw_scales(
    ax: Axes, drawn: tuple[PolyCollection, Quiver], layout: TaxelLayout, lowest: float, vmax: float, shear_max: float
) -> None:
    """Draw the colour bar to the right of the axes and the reference arrow above them.

    Args:
        ax: Axes in which `draw_pad` has drawn.
        drawn: Return value of `draw_pad`.
        layout: The pad's taxels.
        lowest: Smallest normal force (N) that the colour bar shows, at least ``-vmax``.
        vmax: Normal force (N) of full red, the largest that the colour bar shows.
        shear_max: Shear force (N) whose arrow is one pitch long.
    """
    taxels, arrows = drawn
    height, width = (1e3 * length for length in layout.size)
    bar_width = max(0.045 * height / width, 0.02)
    bar = ax.figure.colorbar(taxels, cax=ax.inset_axes((1 + bar_width, 0, bar_width, 1)))
    bar.ax.set_ylim(lowest, vmax)
    bar.set_label("normal force (N)", color=_ink())
    bar.ax.tick_params(length=0, colors=_ink(), labelsize="small")
    bar.outline.set_visible(False)  # type: ignore[operator]
    value = round_down(shear_max)
    tail = 1 - value / shear_max * 1e3 * min(layout.pitch) / width
    points = 72 / ax.figure.dpi * min(ax.bbox.height, ax.bbox.width * height / width)
    look = {"labelpos": "W", "labelsep": 0.08, "labelcolor": _ink(), "fontproperties": {"size": "small"}}
    ax.quiverkey(arrows, tail, 1 + 10 / points, value, f"shear {value:g} N", **look)


def round_down(value: float) -> float:
    """Round `value` down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step for step in (1, 2, 5, 10) if step * power <= value * (1 + 1e-9)) * power:.1g}")


def on_dark() -> bool:
    """Whether figures have a dark background by matplotlib's settings: their text is bright."""
    from matplotlib import rcParams
    from matplotlib.colors import to_rgb

    return sum(to_rgb(rcParams["text.color"])) > 1.5
