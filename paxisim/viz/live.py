"""LiveView: pads drawn in Rerun while they are read, without slowing the reader."""

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

_CHECK = 1.0  # s between checks that the file grows
_PERIOD_WINDOW, _PERIOD_FILE = 1 / 30, 0.1  # s: readings received within this period are drawn together
_AT_ONCE = 256  # size of the queue without a limit on the rate


class LiveView:
    """Live view with taxels at their positions, normal force as colour, shear as arrows, and plots of force and rate.

    A background thread draws the readings received since its last pass, at most `fps` per second. If it falls behind,
    it drops the oldest readings and counts them. Needs Rerun (the ``live`` extra). Can be used as a context manager.

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
            layout: The pads' taxels; one layout per pad, or one for all pads.
            pads: ``(pads,)`` different names.
            tensors: Tensors to show: ``"measured"``, ``"simulated"``, or both, which also shows their difference.
            save: An .rrd file to write; an existing file is overwritten. Default: open Rerun's viewer.
            vmax: Normal force (N) of full red. Default: a recent peak that decays over seconds.
            shear_max: Shear force (N) whose arrow is one pitch long. Default: likewise.
            unit: Unit of the tensors, for the titles of the plots.
            fps: Maximum number of readings drawn per second. None: no limit.
            window: Time span that the plots show (s). None: everything.

        Raises:
            InvalidValueError: An argument is invalid.
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
        """Number of readings passed to `show`."""
        return self._queue.given

    @property
    def drawn(self) -> int:
        """Number of readings drawn so far."""
        return self._queue.taken

    @property
    def dropped(self) -> int:
        """Number of readings not drawn, because newer ones replaced them or `fps` was exceeded."""
        return self._queue.dropped

    def show(
        self,
        time: float,
        measured: NDArray[np.floating] | None = None,
        simulated: NDArray[np.floating] | None = None,
        *,
        wait: bool = False,
    ) -> None:
        """Queue a reading to be drawn. Takes microseconds unless `wait` is set.

        Args:
            time: Timestamp of the reading (s, any clock); the view's time starts at the first reading.
            measured: ``(pads, 3, rows, cols)`` newtons, pad frames. Copied.
            simulated: The same for the simulation.
            wait: Wait while the queue is full instead of dropping a reading.

        Raises:
            InvalidValueError: Neither tensor is given, a tensor has another shape, or the view was closed.
            OSError: The drawing could not be written to the file.
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
        """Draw the remaining readings and finish the file; a viewer's window stays open. May be called twice.

        Raises:
            OSError: The drawing could not be written to the file.
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
        """Return the view itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the view."""
        self.close()

    def _draw(self, moments: list[Moment], shown: int) -> None:
        self._drawing.draw(moments, shown)
        if time.monotonic() >= self._next_check:
            self._drawing.check()
            self._next_check = time.monotonic() + _CHECK
