"""Scene: pictures of causes inside the scene: slip, force during closing, displaced pads, and uneven surfaces."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import style
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.maps import grid_of_maps
from paxisim.diagnose.report.style import AXES, EXTENDED, MEASURED, MUTED, SIMULATED, Picture
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.parameters import height_map as surface_of

_SLIDES = 0.05  # least normal force at which slip is evaluated, as a share of the largest
_EXAGGERATED = 0.25  # largest size of a displacement in the drawing, as a share of the pad


def slip(effect: Effect) -> list[Picture]:
    """Shear against normal force; their largest ratio is the friction coefficient."""
    pad = effect.axes[0][0]
    totals = [force[:, pad].sum(axis=(2, 3), dtype=float) for force in effect.forces]
    forces = [(np.hypot(total[:, 0], total[:, 1]), np.maximum(total[:, 2], 1e-9)) for total in totals]
    pressed = forces[0][1] > _SLIDES * forces[0][1].max()
    figure, axes = style.panel(f"normal force on {effect.streams.pad(pad)}, N", "shear, N", 3.0)
    for (shear, normal), (colour, label) in zip(forces, _looks(effect), strict=True):
        x, y = style.thin(normal[pressed], shear[pressed])
        axes.plot(x, y, ".", markersize=3, alpha=0.5, color=colour, label=label)
    ratios = [float(np.quantile(shear[pressed] / normal[pressed], 0.95)) for shear, normal in forces]
    title = f"When sliding, shear is {ratios[0]:.2f} of the normal force ({ratios[1]:.2f} in the unchanged scene)"
    return [style.finish(figure, title, f"{title}; {ratios[2]:.2f} with the fitted friction.")]


def closing(effect: Effect) -> list[Picture]:
    """Total force on a pad against the covariate that it follows best, or against time if there is none."""
    pad, axis = effect.axes[0]
    forces = effect.sums(pad, axis)
    covariates = {name: values for name, values in effect.streams.covariates.items() if np.ptp(values) > 0}
    alike = {name: abs(float(np.corrcoef(values, forces[1])[0, 1])) for name, values in covariates.items()}
    best = max(alike, key=lambda name: alike[name]) if alike else ""
    x, drawn = (covariates[best], style.binned) if best else (effect.streams.time, style.thin)
    figure, axes = style.panel(best or "time, s", f"{AXES[axis]} force on {effect.streams.pad(pad)}, N", 3.0)
    for force, (colour, label) in zip(forces, _looks(effect), strict=True):
        at, mean = drawn(np.asarray(x, dtype=float), force)
        axes.plot(at, mean, color=colour, linewidth=1.6, label=label)
    axes.locator_params(axis="x", nbins=5)
    title = "Total force on the most affected pad"
    return [style.finish(figure, title, f"{title}: measured, in the unchanged scene, and with {effect.cause.name}.")]


def mount(effect: Effect) -> list[Picture]:
    """Fitted place of each pad or object, with its displacement magnified."""
    return [_displaced(effect, target, own) for target, own in _numbers(effect).items()]


def height_map(effect: Effect) -> list[Picture]:
    """Maps of the fitted surface of each pad."""
    layout, maps = effect.streams.layout, []
    for pad, own in _numbers(effect).items():
        maps.append((pad, surface_of(layout, {item.index: 1e3 * value for item, value in own.items()})))
    figure = grid_of_maps(layout, maps, signed=True, unit=" mm")
    title = f"The surface rises by up to {max(float(heights.max()) for _, heights in maps):.2f} mm"
    return [style.finish(figure, title, f"{title}; maps of the height of each pad's surface.")]


def _displaced(effect: Effect, target: str, own: dict[SceneParameter, float]) -> Picture:
    across, down = 1e3 * effect.streams.layout.size[1], 1e3 * effect.streams.layout.size[0]
    moved, turned = np.zeros(3), np.zeros(3)
    for item, value in own.items():
        (moved if item.unit == "m" else turned)[item.index % 3] = value
    moved, turned = 1e3 * moved, np.degrees(turned)
    times = _EXAGGERATED * across / max(float(np.abs(moved[:2]).max()), 1e-9)
    times = 1.0 if not moved[:2].any() or times < 1 else float(10 ** np.floor(np.log10(times)))
    larger = f" (displacement magnified {times:g} times)" if times != 1 else ""
    figure, axes = style.panel(f"x of {target}, mm{larger}", "y, mm", 3.0)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * [across / 2, down / 2]
    axes.plot(*corners.T, color=MUTED, linestyle="--", linewidth=1.2, label="in the scene")
    shift = times * moved[:2]
    axes.plot(*(corners + shift).T, color=EXTENDED, linewidth=1.8, label="found")
    if moved[:2].any():
        style.arrow(axes, (0, 0), (float(shift[0]), float(shift[1])))
    for axis, line, angle in zip(AXES, ("-", "-.", ":"), turned, strict=True):
        if angle:
            half = np.array([across / 2, 0.0] if axis == "x" else [0.0, down / 2])
            ends = np.array([shift - half, shift + half])
            axes.plot(*ends.T, color=SIMULATED, linestyle=line, linewidth=1.0, label=f"{angle:+.2g}° about {axis}")
    axes.set_aspect("equal")
    axes.invert_yaxis()  # rows grow downwards
    said = [f"{1e3 * v:+.2f} mm" if i.unit == "m" else f"{np.degrees(v):+.2f} deg" for i, v in own.items()]
    parts = ", ".join(f"{item.name} {text}" for item, text in zip(own, said, strict=True))
    return style.finish(figure, f"Place of {target}", f"{target} is displaced: {parts}.")


def _looks(effect: Effect) -> tuple[tuple[str, str], ...]:
    """Colour and label of measurement, unchanged scene and fitted scene."""
    return (MEASURED, "measured"), (SIMULATED, "unchanged scene"), (EXTENDED, f"with {effect.cause.name}")


def _numbers(effect: Effect) -> dict[str, dict[SceneParameter, float]]:
    """Return the cause's numbers of the scene with their fitted values, by pad or object."""
    inside = effect.streams.in_scene
    assert inside is not None
    numbers: dict[str, dict[SceneParameter, float]] = {}
    for name, item in inside.parameters.items():
        if name in inside.values and item.group == effect.cause.name:
            numbers.setdefault(item.target, {})[item] = inside.values[name]
    return numbers
