"""Inside: pictures of causes inside the scene: slip, force during closing, displaced pads, and uneven surfaces."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.maps import grid_of_maps
from paxisim.diagnose.report.style import EXTENDED, MEASURED, MUTED, SIMULATED, Picture, binned, finish, panel, thin
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.parameters import height_map as surface_of

_SLIDES = 0.05  # least normal force at which slip is evaluated, as a share of the largest
_EXAGGERATED = 0.25  # largest size of a displacement in the drawing, as a share of the pad
_COLOURS = (MEASURED, SIMULATED, EXTENDED)


def slip(effect: Effect) -> list[Picture]:
    """Shear against normal force; their largest ratio is the friction coefficient."""
    pad = effect.axes[0][0]
    forces = [_resultants(a[:, pad]) for a in (effect.streams.measured, effect.without, effect.model)]
    pressed = forces[0][1] > _SLIDES * forces[0][1].max()
    figure, axes = panel(3.0)
    for (shear, normal), colour, label in zip(forces, _COLOURS, _labels(effect), strict=True):
        x, y = thin(normal[pressed], shear[pressed])
        axes.plot(x, y, ".", markersize=3, alpha=0.5, color=colour, label=label)
    axes.set_xlabel(f"normal force on {effect.streams.pad(pad)}, N")
    axes.set_ylabel("shear, N")
    ratios = [float(np.quantile(s[pressed] / n[pressed], 0.95)) for s, n in forces]
    title = f"When sliding, shear is {ratios[0]:.2f} of the normal force ({ratios[1]:.2f} in the unchanged scene)"
    return [finish(figure, title, f"{title}; {ratios[2]:.2f} with the fitted friction.")]


def closing(effect: Effect) -> list[Picture]:
    """Total force on a pad against the covariate that it follows best, or against time if there is none."""
    pad, axis = effect.axes[0]
    names = {name: values for name, values in effect.streams.covariates.items() if np.ptp(values) > 0}
    measured, lacking, model = effect.sums(pad, axis)
    x, label, drawn = effect.streams.time, "time, s", thin
    if names:
        alike = {name: abs(float(np.corrcoef(values, lacking)[0, 1])) for name, values in names.items()}
        best = max(alike, key=lambda name: alike[name])
        x, label, drawn = names[best], best, binned
    figure, axes = panel(3.0)
    lines = (measured, lacking, model)
    for values, colour, name in zip(lines, _COLOURS, _labels(effect), strict=True):
        at, mean = drawn(np.asarray(x, dtype=float), values)
        axes.plot(at, mean, color=colour, linewidth=1.6, label=name)
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(label)
    axes.set_ylabel(f"{'xyz'[axis]} force on {effect.streams.pad(pad)}, N")
    title = "Total force on the most affected pad"
    return [finish(figure, title, f"{title}: measured, in the unchanged scene, and with {effect.cause.name}.")]


def mount(effect: Effect) -> list[Picture]:
    """Fitted place of each pad or object, with its displacement magnified."""
    numbers = _numbers(effect)
    pictures = []
    for target in dict.fromkeys(item.target for item in numbers):
        own = {item: value for item, value in numbers.items() if item.target == target}
        pictures.append(_displaced(effect, target, own))
    return pictures


def _displaced(effect: Effect, target: str, own: dict[SceneParameter, float]) -> Picture:
    across, down = 1e3 * effect.streams.layout.size[1], 1e3 * effect.streams.layout.size[0]
    moved = np.zeros(3)
    turned = np.zeros(3)
    for item, value in own.items():
        (moved if item.unit == "m" else turned)[item.index % 3] = value
    moved, turned = 1e3 * moved, np.degrees(turned)
    times = _EXAGGERATED * across / max(float(np.abs(moved[:2]).max()), 1e-9)
    times = 1.0 if not moved[:2].any() or times < 1 else float(10 ** np.floor(np.log10(times)))
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * [across / 2, down / 2]
    figure, axes = panel(3.0)
    axes.plot(*corners.T, color=MUTED, linestyle="--", linewidth=1.2, label="in the scene")
    shift = times * moved[:2]
    axes.plot(*(corners + shift).T, color=EXTENDED, linewidth=1.8, label="found")
    if moved[:2].any():
        arrow = {"arrowstyle": "-|>", "color": EXTENDED, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (float(shift[0]), float(shift[1])), (0, 0), arrowprops=arrow)
    for axis, style, angle in zip("xyz", ("-", "-.", ":"), turned, strict=True):
        if angle:
            line = np.array([[-across / 2, 0.0], [across / 2, 0.0]])
            line = line if axis == "x" else np.array([[0.0, -down / 2], [0.0, down / 2]])
            label = f"{angle:+.2g}° about {axis}"
            axes.plot(*(line + shift).T, color=SIMULATED, linestyle=style, linewidth=1.0, label=label)
    axes.set_aspect("equal")
    axes.invert_yaxis()  # rows grow downwards
    larger = f" (displacement magnified {times:g} times)" if times != 1 else ""
    axes.set_xlabel(f"x of {target}, mm{larger}")
    axes.set_ylabel("y, mm")
    said = [f"{1e3 * v:+.2f} mm" if i.unit == "m" else f"{np.degrees(v):+.2f} deg" for i, v in own.items()]
    parts = ", ".join(f"{item.name} {text}" for item, text in zip(own, said, strict=True))
    return finish(figure, f"Place of {target}", f"{target} is displaced: {parts}.")


def height_map(effect: Effect) -> list[Picture]:
    """Maps of the fitted surface of each pad."""
    layout, numbers = effect.streams.layout, _numbers(effect)
    heights: dict[str, dict[int, float]] = {}
    for item, value in numbers.items():
        heights.setdefault(item.target, {})[item.index] = 1e3 * value
    maps = {pad: surface_of(layout, own) for pad, own in heights.items()}
    limit = max(float(np.abs(one).max()) for one in maps.values()) or 1.0
    figure = grid_of_maps(layout, list(maps.values()), list(maps), 2, limit, signed=True, unit=" mm")
    title = f"The surface rises by up to {max(float(one.max()) for one in maps.values()):.2f} mm"
    return [finish(figure, title, f"{title}; maps of the height of each pad's surface.", legend=False)]


def _labels(effect: Effect) -> tuple[str, str, str]:
    """Labels of the three streams, which are drawn in `_COLOURS`."""
    return ("measured", "unchanged scene", f"with {effect.cause.name}")


def _numbers(effect: Effect) -> dict[SceneParameter, float]:
    """Return the cause's numbers of the scene with their fitted values."""
    inside = effect.streams.in_scene
    assert inside is not None
    own = {item: inside.values[name] for name, item in inside.parameters.items() if name in inside.values}
    return {item: value for item, value in own.items() if item.group == effect.cause.name}


def _resultants(force: np.ndarray) -> tuple[Series, Series]:
    """``(T,)`` shear and normal force on a pad (N)."""
    total = force.sum(axis=(2, 3), dtype=float)
    return np.hypot(total[:, 0], total[:, 1]), np.maximum(total[:, 2], 1e-9)
