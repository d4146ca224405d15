"""Grasps: simulation of an episode grasp by grasp.

Between two grasps the hand holds nothing, so the state of the object is unknown again. The closing is therefore fitted
to each grasp, and an object that the simulated hand lost begins the next grasp where the real hand carried it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.scene.closing import FittedClosing, fit_closing
from paxisim.scene.doubt import find_doubts, find_grasps, held
from paxisim.scene.drive import Drive
from paxisim.scene.follow import Follower
from paxisim.scene.shape import fit_shape

CLOSING_FITS = {"fitted": fit_closing, "shape": fit_shape}
"""Functions that fit the closing of a grasp, by mode."""


@dataclass(frozen=True, eq=False)
class Grasped:
    """An episode simulated grasp by grasp.

    Attributes:
        force: ``(T, pads, 3, rows, cols)`` forces (N); NaN in a grasp to which no closing could be fitted.
        qpos: ``(T, nq)`` positions of the model.
        pressed: ``(T,)`` as `EpisodeRunner.pressed`.
        closings: Constant added to the closing stream in each grasp, in its unit.
        notes: Why a closing was not fitted.
    """

    force: NDArray[np.float32]
    qpos: NDArray[np.float32]
    pressed: NDArray[np.float32]
    closings: tuple[float, ...]
    notes: tuple[str, ...]


def by_grasp(
    follower: Follower,
    part: Recording,
    closings: Sequence[float] | None,
    shifts: Mapping[Drive, float] = MappingProxyType({}),
) -> Grasped:
    """Simulate an episode grasp by grasp, each from the end of the one before.

    Args:
        follower: The scene and its streams.
        part: The samples of the episode at which all streams are known, with measured forces.
        closings: Constant to add to the closing stream in each grasp; None to fit it.
        shifts: Further constants to add to the streams of single drives.

    Raises:
        InvalidValueError: No closing could be fitted to any grasp, or `closings` has another number of grasps.
        UnsupportedError: The simulation becomes unstable.
    """
    assert part.measured is not None
    grasps = find_grasps(part.time, part.measured)
    if closings is not None and len(closings) != len(grasps):
        number = int(part.episode[0])
        raise InvalidValueError(f"episode {number} has {len(grasps)} grasps, got {len(closings)} closings")
    force = np.full(part.measured.shape, np.nan, dtype=np.float32)
    qpos = np.zeros((len(part), follower.rig.model.nq), dtype=np.float32)
    pressed = np.zeros(len(part), dtype=np.float32)
    found: list[float] = []
    last: FittedClosing | None = None
    notes: list[str] = []
    failed: list[InvalidValueError] = []
    state: NDArray[np.float64] | None = None
    for k, span in enumerate(grasps):
        # a grasp ends with the first sample of the next one, which continues from there
        new = slice(span.start + (k > 0), min(span.stop + 1, len(part)))
        grasp = _Grasp(follower, part, slice(span.start, new.stop), state, shifts)
        before = found[-1] if found else 0.0
        try:
            fitted = (
                grasp.fitted(last) if closings is None else FittedClosing(closings[k], grasp.simulated(closings[k]))
            )
            last = fitted
        except InvalidValueError as error:
            failed.append(error)
            fitted = FittedClosing(before, np.full_like(grasp.simulated(before), np.nan), (str(error),))
        force[new] = fitted.force[k > 0 :]
        path, presses = grasp.course(fitted.closing)
        qpos[new], pressed[new] = path[k > 0 :], presses[k > 0 :]
        found.append(fitted.closing)
        notes += fitted.notes
        state = grasp.end(fitted.closing)
        if len(follower.rig.free) == 1:  # of several objects, nobody knows which the hand held
            doubts = find_doubts(part, force)
            if any(span.start <= doubt.samples.start < span.stop for doubt in doubts):
                state = grasp.carried(fitted.closing)
    if len(failed) == len(grasps):
        raise failed[0]
    return Grasped(force, qpos, pressed, tuple(found), tuple(notes))


class _Grasp:
    """One grasp, which can be simulated with different closings."""

    def __init__(
        self,
        follower: Follower,
        episode: Recording,
        span: slice,
        start: NDArray[np.float64] | None,
        shifts: Mapping[Drive, float],
    ) -> None:
        self._follower, self._episode, self._part = follower, episode, episode[span]
        self._start, self._shifts = start, shifts
        self._ends: dict[float, NDArray[np.float64]] = {}
        self._courses: dict[float, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}

    def simulated(self, closing: float) -> NDArray[np.float32]:
        """Return the forces with a closing."""
        force = self._follower.forces(self._episode, self._moved(closing), self._part.time, self._start)
        self._ends[closing] = self._follower.runner.state()
        self._courses[closing] = self._follower.runner.path, self._follower.runner.pressed
        return force

    def _moved(self, closing: float) -> Mapping[Drive, float]:
        closed = self._follower.closed(closing)
        return {drive: closed.get(drive, 0.0) + self._shifts.get(drive, 0.0) for drive in {**closed, **self._shifts}}

    def fitted(self, before: FittedClosing | None) -> FittedClosing:
        """Fit the closing to the measured forces, beginning near the fit of the grasp before."""
        fit: Callable[..., FittedClosing] = CLOSING_FITS[self._follower.scene.mode]
        step, number = self._follower.closing_step(), int(self._part.episode[0])
        return fit(self.simulated, self._part.measured, self._part.time, step, number, before)

    def end(self, closing: float) -> NDArray[np.float64]:
        """Return the state at the end with a closing."""
        return self._ends[closing]

    def course(self, closing: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the positions of the model at the samples with a closing, and `EpisodeRunner.pressed`."""
        return self._courses[closing]

    def carried(self, closing: float) -> NDArray[np.float64]:
        """Return the same with the one free object where the real hand carried it."""
        assert self._part.measured is not None
        runner, (address,) = self._follower.runner, self._follower.rig.free
        motion = self._follower.motion(self._episode, self._moved(closing), self._part.time)
        times = held(self._part.time, self._part.measured)
        return runner.carried(address, motion, self._start, self.end(closing), times)
