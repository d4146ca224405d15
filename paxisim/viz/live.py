"""LiveView: pads drawn in Rerun while they are read; the reader is never slowed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.viz.hand_over import HandOver
from paxisim.viz.live_drawing import LiveDrawing, need_display
from paxisim.viz.live_scene import Moment, Scale, Scene

_CHECK = 1.0  # s between two looks at whether the file grows
_PERIOD_WINDOW, _PERIOD_FILE = 1 / 30, 0.1  # s: what came in such a time is drawn at once
_AT_ONCE = 256  # readings, where none may be left out


class LiveView:
    """Pads where their taxels sit, normal force as colour and shear as arrows, total force and rate as plots.

    A thread of its own draws what came since it last did, at most `fps` readings a second. What it has no time for is
    not drawn, oldest first, and counted. Needs Rerun (the ``live`` extra). A context manager.

    Example::

        with LiveView(pads.layout, pads.pads) as view:
            for frame in pads.stream():
                view.show(frame.time, measured=frame.force)
    """

    def __init__(
        self,
        layout: TaxelLayout | Sequence[TaxelLayout],
        pads: Sequence[str],
        tensors: Sequence[str] = ("measured",),
        *,
        save: str | Path | None = None,
        vmax: float | None = None,
        shear_max: float | None = None,
        unit: str = "N",
        fps: float | None = 200.0,
        window: float | None = 10.0,
    ) -> None:
        """Open the viewer or the file.

        Args:
            layout: The pads' taxels; one layout for each pad, or one for all.
            pads: ``(pads,)`` different names.
            tensors: What will be shown: ``"measured"``, ``"simulated"``, or both, then with their difference.
            save: An .rrd file to write, over one that exists. Default: show Rerun's viewer.
            vmax: Normal force (N) of full red. Default: the largest of late, which fades in seconds.
            shear_max: Shear force (N) whose arrow is one pitch long. Default: likewise.
            unit: Unit of the tensors, for the plots' titles.
            fps: Readings drawn a second, at most. None: as many as can be.
            window: Seconds that the plots show. None: all.

        Raises:
            InvalidValueError: An argument that cannot be used.
            MissingExtraError: Rerun is not installed.
            UnsupportedError: There is no display, or Rerun's viewer does not start.
            OSError: The file cannot be written.
        """
        for name, value in (("fps", fps), ("window", window)):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InvalidValueError(f"{name} must be positive and finite, got {value!r}")
        layouts = [layout] * len(pads) if isinstance(layout, TaxelLayout) else list(layout)
        self._scene = Scene(layouts, pads, tensors)
        scale = Scale(vmax, shear_max)
        if save is None:
            need_display()
        self._drawing = LiveDrawing(
            self._scene, scale, unit=unit, save=None if save is None else Path(save), window=window
        )
        self._next_check = time.monotonic() + _CHECK
        self._start: float | None = None
        self._closed = False
        if fps is None:
            self._queue: HandOver[Moment] = HandOver(self._draw, _AT_ONCE)
        else:
            period = _PERIOD_WINDOW if save is None else _PERIOD_FILE
            self._queue = HandOver(self._draw, max(1, round(fps)), period, fps)

    @property
    def shown(self) -> int:
        """Readings handed over."""
        return self._queue.given

    @property
    def drawn(self) -> int:
        """Readings drawn so far."""
        return self._queue.taken

    @property
    def dropped(self) -> int:
        """Readings not drawn because a newer one was there."""
        return self._queue.dropped

    def show(
        self,
        time: float,
        measured: NDArray[np.floating] | None = None,
        simulated: NDArray[np.floating] | None = None,
        *,
        wait: bool = False,
    ) -> None:
        """Hand over a reading to be drawn. Takes microseconds.

        Args:
            time: When it was taken (s, any clock); the view counts from the first one.
            measured: ``(pads, 3, rows, cols)`` newtons, pad frames. Copied.
            simulated: The same for the simulation.
            wait: Wait where the drawing is behind, so that none is left out.

        Raises:
            InvalidValueError: Neither tensor, or one of another shape; the view was closed.
            OSError: What was drawn does not reach the file.
        """
        if measured is None and simulated is None:
            raise InvalidValueError("expected measured, simulated or both to show, got neither")
        tensors = [None if force is None else np.array(force, dtype=np.float32) for force in (measured, simulated)]
        for force in tensors:
            if force is not None:
                self._scene.check(force)
        if self._start is None:
            self._start = time
        self._queue.put(Moment(time - self._start, *tensors), wait)

    def close(self) -> None:
        """Draw the last reading and finish the file; a viewer's window stays. May be called twice.

        Raises:
            OSError: Not all of it reached the file.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._queue.close()
            self._drawing.check()
        finally:
            self._drawing.close()

    def __enter__(self) -> LiveView:
        """The view itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def _draw(self, moments: list[Moment], shown: int) -> None:
        self._drawing.draw(moments, shown)
        if time.monotonic() >= self._next_check:
            self._drawing.check()
            self._next_check = time.monotonic() + _CHECK
