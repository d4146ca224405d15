"""Figures of the force tensor, as in the paper's Figure 1: red shows normal force, green arrows show shear.

Each pad is seen from outside, facing its sensing surface: x right, y down, row 0 at the top. Lengths are in mm,
forces in newtons, both in the pad frame. A negative normal force is drawn blue, never red. Taxels that are not on
a flat grid are projected onto the x-y plane. Text and background have the colours of matplotlib's settings; with a dark
style, taxels at rest are dark. Needs matplotlib (the ``viz`` extra), but no display and no pyplot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.layout import TaxelLayout
from paxisim.viz import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MAX_COLUMNS = 4


def plot_tactile(
    tensor: Any,
    layout: TaxelLayout,
    ax: Axes | None = None,
    *,
    vmax: float | None = None,
    shear_max: float | None = None,
    title: str = "",
) -> Axes:
    """Draw the reading of one pad.

    Args:
        tensor: ``(3, rows, cols)`` newtons, pad frame; numpy, torch or nested lists.
        layout: The pad's taxels.
        ax: Axes to draw in. Default: axes in a new figure that is not shown in a window; use
            ``ax.figure.savefig("pad.png")``.
        vmax: Normal force (N) of full red. Default: the largest magnitude in `tensor`.
        shear_max: Shear force (N) whose arrow is one pitch long. Default: the largest in `tensor`.
        title: Title of the axes.

    Returns:
        The axes, in mm, with a colour bar in newtons and a reference arrow for shear.

    Raises:
        InvalidValueError: `tensor` is not of shape ``(3, rows, cols)``, or a maximum is not positive and finite.
        MissingExtraError: matplotlib is not installed.
    """
    force = _reading(tensor, layout, 3, "plot_tactile draws one pad; plot_pads draws all pads of one moment")
    _need_matplotlib("plot_tactile")
    vmax, shear_max = _scales(force, vmax, shear_max)
    if ax is None:
        ax = _figure(layout, 1, 1).add_subplot()
    above = not drawing.beside_key(ax, layout, title)
    drawn = drawing.draw_pad(ax, force, layout, vmax, shear_max, title, above_key=above)
    drawing.draw_scales(ax, drawn, layout, _lowest(force, vmax), vmax, shear_max)
    return ax


def plot_pads(
    tensor: Any,
    layout: TaxelLayout,
    names: Sequence[str] | None = None,
    *,
    vmax: float | None = None,
    shear_max: float | None = None,
) -> Figure:
    """Draw the readings of several pads at one moment, side by side and on a common scale.

    Args:
        tensor: ``(pads, 3, rows, cols)`` newtons, pad frame; numpy, torch or nested lists.
        layout: The pads' taxels.
        names: ``(pads,)`` titles. Default: pad 0, pad 1, ...
        vmax: Normal force (N) of full red. Default: the largest magnitude in `tensor`.
        shear_max: Shear force (N) whose arrow is one pitch long. Default: the largest in `tensor`.

    Returns:
        A figure that is not shown in a window; use ``figure.savefig("pads.png")``. ``figure.axes[:pads]`` are the axes
        of the pads.

    Raises:
        InvalidValueError: `tensor` is not of shape ``(pads, 3, rows, cols)`` or has no pads, there are not as many
            names as pads, or a maximum is not positive and finite.
        MissingExtraError: matplotlib is not installed.
    """
    force = _reading(tensor, layout, 4, "plot_pads draws the pads of one moment; plot_tactile draws one pad")
    pads = len(force)
    if pads == 0:
        raise InvalidValueError("there is no pad to draw: the tensor's pads axis is empty")
    names = [f"pad {i}" for i in range(pads)] if names is None else list(names)
    if len(names) != pads:
        raise InvalidValueError(f"expected a name for each of {pads} pads, got {len(names)}: {', '.join(names)}")
    _need_matplotlib("plot_pads")
    vmax, shear_max = _scales(force, vmax, shear_max)
    columns = min(pads, _MAX_COLUMNS)
    lines = -(-pads // columns)
    figure = _figure(layout, lines, columns)
    axes = [figure.add_subplot(lines, columns, i + 1) for i in range(pads)]
    above = not all(drawing.beside_key(ax, layout, name) for ax, name in zip(axes, names, strict=True))
    drawn = [
        drawing.draw_pad(axes[i], force[i], layout, vmax, shear_max, names[i], above_key=above) for i in range(pads)
    ]
    for i, ax in enumerate(axes):
        if i % columns:
            ax.set_ylabel("")
    corner = columns - 1
    drawing.draw_scales(axes[corner], drawn[corner], layout, _lowest(force, vmax), vmax, shear_max)
    return figure


def _need_matplotlib(purpose: str) -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("matplotlib", "viz", purpose) from error


def _reading(tensor: Any, layout: TaxelLayout, ndim: int, hint: str) -> NDArray[np.float64]:
    if hasattr(tensor, "detach"):  # torch, perhaps on a GPU or with gradients
        tensor = tensor.detach().cpu()
    force = np.asarray(tensor, dtype=np.float64)
    layout.check(force)
    if force.ndim != ndim:
        expected = ", ".join([*["pads"] * (ndim - 3), *(str(n) for n in layout.shape)])
        raise InvalidValueError(f"expected a tensor of shape ({expected}), got {force.shape}: {hint}")
    return force


def _scales(force: NDArray[np.float64], vmax: float | None, shear_max: float | None) -> tuple[float, float]:
    """Return both maxima, as given or taken from the reading; 1 N if the reading is zero."""
    felt = (np.abs(force[..., 2, :, :]), np.hypot(force[..., 0, :, :], force[..., 1, :, :]))
    found = []
    for name, given, values in zip(("vmax", "shear_max"), (vmax, shear_max), felt, strict=True):
        if given is not None and not (np.isfinite(given) and given > 0):
            raise InvalidValueError(f"{name} must be a positive finite force in N, got {given!r}")
        largest = float(np.max(values, initial=0.0, where=np.isfinite(values)))
        # a reading below a nanonewton is rounding error, and its tiny scale would mislead
        found.append(float(given) if given is not None else largest if largest > 1e-9 else 1.0)
    return found[0], found[1]


def _lowest(force: NDArray[np.float64], vmax: float) -> float:
    """Return the lower end of the colour bar (N): 0, or the lowest normal force if there are negative ones."""
    normal = force[..., 2, :, :]
    return max(-vmax, float(np.min(normal, initial=0.0, where=np.isfinite(normal))))


def _figure(layout: TaxelLayout, lines: int, columns: int) -> Figure:
    from matplotlib.figure import Figure

    height, width = layout.size
    inches = min(3.3 / height, 3.9 / width)  # per metre
    size = (columns * (width * inches + 0.45) + 1.3, lines * (height * inches + 0.95))
    return Figure(figsize=(max(size[0], 2.8), max(size[1], 2.0)), layout="constrained")
