"""Drawing of the live view in Rerun: entities, window layout and output.

Entities: ``pads/LINE/PAD/taxels`` and ``.../shear`` for the lines measured, simulated and residual; ``pads/names``;
``force/PAD/measured`` and ``.../simulated``, the total x, y, z (N); ``rate``, moments read and drawn per second;
``scale``, the forces for full red and for an arrow one pitch long (N). All are on one timeline, ``time``, in seconds.

Written for Rerun 0.23 and later; uses only the part of its API that has not changed since.
"""

from __future__ import annotations

import sys
import uuid
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from paxisim.errors import MissingExtraError, UnsupportedError
from paxisim.viz.live_scene import Moment, Scale, Scene

TIMELINE = "time"
_GREEN, _INK = (11, 138, 58), (150, 150, 150)
_AXES = {
    "measured": [(214, 69, 65), (46, 160, 67), (66, 120, 220)],
    "simulated": [(244, 170, 160), (160, 215, 165), (165, 195, 245)],
}
_RATE_EVERY = 0.5  # s between points in the plot of the rate


def import_rerun() -> ModuleType:
    """Import Rerun's SDK.

    Raises:
        MissingExtraError: Rerun is not installed.
        UnsupportedError: Rerun is installed but unusable: it is too old or conflicts with another package.
    """
    try:
        import rerun
    except ModuleNotFoundError as error:
        raise MissingExtraError("rerun", "live", "the live view") from error
    except ImportError as error:
        raise UnsupportedError(f"the live view needs rerun, which cannot be imported: {error}") from error
    if not hasattr(rerun, "Scalars"):  # also true of another package called rerun
        raise UnsupportedError("the live view needs rerun-sdk 0.23 or later: pip install --upgrade 'paxisim[live]'")
    return rerun


class LiveDrawing:
    """Draws moments in order into a file or into Rerun's viewer. Not thread-safe."""

    def __init__(
        self,
        scene: Scene,
        scale: Scale,
        *,
        unit: str = "N",
        save: Path | None = None,
        window: float | None = None,
    ) -> None:
        """Open the file, or start the viewer, and draw the static parts.

        Args:
            scene: Arrangement of the pads.
            scale: Forces for full colour and for an arrow one pitch long.
            unit: Unit of the forces.
            save: An .rrd file to write. Default: start the viewer.
            window: Time span that the plots show (s). Default: everything.

        Raises:
            MissingExtraError: Rerun is not installed.
            UnsupportedError: Rerun cannot be used, or its viewer does not start.
            OSError: The file cannot be written.
        """
        self._scene, self._scale, self._unit, self._path = scene, scale, unit, save
        self._rerun = rr = import_rerun()
        self._points, self._arrows = (rr.Points2D, rr.Arrows2D) if scene.flat else (rr.Points3D, rr.Arrows3D)
        self._axes = 2 if scene.flat else 3
        self._recording: Any = rr.RecordingStream("paxisim", recording_id=uuid.uuid4())
        if save is not None:
            with save.open("wb"):  # raises if the file cannot be written, which Rerun would only log
                pass
            self._recording.save(save)
        else:
            try:
                self._recording.spawn()
            except RuntimeError as error:
                raise UnsupportedError(
                    f"Rerun's viewer does not start: {error}; --save writes a file instead"
                ) from error
        self._recording.send_blueprint(self._blueprint(window))
        self._draw_fixed()
        self._rate_from: tuple[float, int, int] | None = None
        self._drawn = 0
        self._now: float | None = None

    def draw(self, moments: Sequence[Moment], read: int) -> None:
        """Draw moments; several at once cost little more than one.

        Args:
            moments: One or more moments, oldest first. A tensor that a moment lacks stays as last drawn.
            read: Number of moments so far, including those not drawn.
        """
        parts = []
        for line in self._scene.lines:
            there = [(moment.time, moment.tensors()[line]) for moment in moments if line in moment.tensors()]
            if there:
                times, force = np.array([at for at, _ in there]), np.stack([tensor for _, tensor in there])
                parts.append((line, times, force, *self._scene.split(force)))
        # a common scale makes weaker tensors look weaker
        for _, times, _, normal, shear in parts:
            self._scale.update(times[-1], normal, shear)
        for line, times, force, normal, shear in parts:
            self._draw_line(line, times, normal, shear)
            if line != "residual":
                totals = force.sum(axis=(-2, -1), dtype=np.float64)
                for i, pad in enumerate(self._scene.pads):
                    self._plot(["force", pad, line], times, totals[:, i])
        self._now = moments[-1].time
        self._plot_scale()
        self._drawn += len(moments)
        self._draw_rate(self._now, read)

    def _draw_line(self, line: str, times: np.ndarray, normal: np.ndarray, shear: np.ndarray) -> None:
        scene = self._scene
        colors = scene.colors(normal, self._scale.vmax)
        arrows = scene.arrows(shear, self._scale.shear_max)
        shift = scene.offsets[scene.lines.index(line)]
        for i, pad in enumerate(scene.pads):
            dots = self._points.columns(colors=colors[:, i].reshape(-1, 4))
            self._send(["pads", line, pad, "taxels"], times, dots.partition(np.full(len(times), colors.shape[2])))
            counts, tails, vectors = arrows[i]
            lines = self._arrows.columns(origins=self._project(tails + shift), vectors=self._project(vectors))
            self._send(["pads", line, pad, "shear"], times, lines.partition(counts))

    def _plot_scale(self) -> None:
        self._plot(["scale"], np.array([self._now]), np.array([[self._scale.vmax, self._scale.shear_max]]))

    def _plot(self, path: list[str], times: np.ndarray, values: np.ndarray) -> None:
        """Plot ``(T, n)`` values of n curves."""
        columns = self._rerun.Scalars.columns(scalars=values.reshape(-1))
        self._send(path, times, columns.partition(np.full(len(times), values.shape[1])))

    def _send(self, path: list[str], times: np.ndarray, columns: Any) -> None:
        rr = self._rerun
        self._recording.send_columns(
            rr.new_entity_path(path), [rr.TimeColumn(TIMELINE, duration=times)], columns, strict=True
        )

    def check(self) -> None:
        """Raise `OSError` if the drawing does not reach the file, e.g. on a full disk; Rerun only logs that."""
        if self._path is None or self._now is None:
            return
        try:
            self._recording.flush()
            before = self._path.stat().st_size
            self._plot_scale()
            self._recording.flush()
            written = self._path.stat().st_size > before
        except RuntimeError:  # newer versions of Rerun raise this on a failed write
            written = False
        if not written:
            raise OSError(f"cannot write {self._path}: its disk may be full")

    def close(self) -> None:
        """Finish the file, or disconnect from the viewer."""
        self._recording.disconnect()

    def _project(self, points: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(points[..., : self._axes], dtype=np.float32)

    def _draw_fixed(self) -> None:
        rr, scene = self._rerun, self._scene
        over = {"draw_order": 50.0} if scene.flat else {}  # otherwise Rerun draws points on top of arrows

        def fix(path: str | list[str], entity: Any) -> None:
            self._recording.log(path, entity, static=True, strict=True)

        if not scene.flat:
            fix("pads", rr.ViewCoordinates.RDF)  # x right, y down, z away from the viewer: the pad frame
        for line, shift in zip(scene.lines, scene.offsets, strict=True):
            for pad, positions in zip(scene.pads, scene.positions, strict=True):
                fix(["pads", line, pad, "taxels"], self._points(self._project(positions + shift), radii=scene.radius))
                look = self._arrows.from_fields(colors=[_GREEN], radii=[0.08 * scene.pitch], **over)
                fix(["pads", line, pad, "shear"], look)
        words = np.concatenate([scene.headings, scene.margins])
        labels = [*scene.pads, *scene.lines]
        fix("pads/names", self._points(self._project(words), labels=labels, radii=0.01 * scene.pitch, colors=_INK))
        for pad in scene.pads:
            for line in ("measured", "simulated"):
                if line in scene.lines:
                    names = [f"{axis} {line}" for axis in "xyz"]
                    fix(["force", pad, line], rr.SeriesLines(names=names, colors=_AXES[line]))
        fix("rate", rr.SeriesLines(names=["read", "drawn"], colors=[_INK, _GREEN]))
        fix("scale", rr.SeriesLines(names=["full red", "arrow of one pitch"], colors=[_AXES["measured"][0], _GREEN]))

    def _draw_rate(self, time: float, read: int) -> None:
        if self._rate_from is None or time < self._rate_from[0]:
            self._rate_from = (time, read, self._drawn)
            return
        since, read_before, drawn_before = self._rate_from
        if time - since >= _RATE_EVERY:
            rates = np.array([[read - read_before, self._drawn - drawn_before]]) / (time - since)
            self._plot(["rate"], np.array([time]), rates)
            self._rate_from = (time, read, self._drawn)

    def _blueprint(self, window: float | None) -> Any:
        """Return the window layout: pads on the left; plots of each pad's total force, rate and scale on the right."""
        import rerun.blueprint as rrb

        rr, plot, fit = self._rerun, {}, {}
        if int(np.__version__.split(".")[0]) >= 2:  # with numpy 1, Rerun 0.23 cannot write ranges
            if window is not None:
                boundary = rr.TimeRangeBoundary
                ends = {"start": boundary.cursor_relative(seconds=-window), "end": boundary.cursor_relative()}
                plot["time_ranges"] = [rr.VisibleTimeRange(TIMELINE, **ends)]
            if self._scene.flat:
                (left, top), (right, bottom) = self._scene.bounds
                fit["visual_bounds"] = rrb.VisualBounds2D(x_range=[left, right], y_range=[top, bottom])
        space = rrb.Spatial2DView if self._scene.flat else rrb.Spatial3DView
        total = "total force" if self._unit == "N" else "sum over the taxels"
        plots = [
            *((rr.new_entity_path(["force", pad]), f"{pad}: {total} ({self._unit})") for pad in self._scene.pads),
            ("/rate", "readings per second"),
            ("/scale", f"scale ({self._unit})"),
        ]
        views = [rrb.TimeSeriesView(origin=origin, name=name, **plot) for origin, name in plots]
        shares = [2] * len(self._scene.pads) + [1, 1]
        return rrb.Blueprint(
            rrb.Horizontal(
                space(origin="/pads", name="pads (mm), seen from outside", **fit),
                rrb.Vertical(*views, row_shares=shares),
                column_shares=[3, 2],
            ),
            collapse_panels=True,
        )


def need_display() -> None:
    """Raise an error if no window can be opened.

    Raises:
        UnsupportedError: There is no display. Checked on Linux only; other systems always have one.
    """
    import os

    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in screens):
        raise UnsupportedError(
            f"the live view needs a display, but neither {' nor '.join(screens)} is set: --save FILE.rrd writes a "
            "file that `rerun FILE.rrd` opens on a machine with a screen"
        )
