"""Replay: a scene combined with a recording, to simulate single episodes and pair the streams."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim._version import __version__
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.scene.auto_mode import COARSE_FRACTION, with_mode
from paxisim.scene.closing import total_normal
from paxisim.scene.doubt import find_doubts, find_grasps
from paxisim.scene.encoder import EncoderError
from paxisim.scene.follow import Follower
from paxisim.scene.grasps import CLOSING_FITS, by_grasp
from paxisim.scene.modes import MODES
from paxisim.scene.rig import Rig
from paxisim.scene.scene import Scene

CONTACT_FORCE = 0.2
"""Total normal force (N) above which there is certainly contact."""

_BEFORE = 1.0  # s


@dataclass(frozen=True, eq=False)
class SimulatedEpisode:
    """Result of `Replay.run`.

    Attributes:
        number: Number of the episode.
        force: ``(T, pads, 3, rows, cols)`` forces (N) at the recording's samples of the episode; NaN where the driving
            streams are unknown.
        qpos: ``(T, nq)`` positions of `Replay.rig.model` at these samples, NaN likewise.
        pressed: ``(T,)`` force (N) beyond its weight with which the surroundings pushed an object in the hand.
        closings: Constant added to the closing stream in each grasp, in its unit: given to `Replay.run`, or fitted by
            mode ``"fitted"`` or ``"shape"``; empty in the other modes.
        notes: Remarks on the simulation.
    """

    number: int
    force: NDArray[np.float32]
    qpos: NDArray[np.float32]
    pressed: NDArray[np.float32]
    closings: tuple[float, ...] = ()
    notes: tuple[str, ...] = field(default=())


class Replay:
    """A compiled scene together with the recording it follows, which has been checked."""

    def __init__(self, scene: Scene, recording: Recording, mean: bool = False) -> None:
        """Compile the scene and check the recording; see `paxisim.Scene.prepare`.

        Raises:
            InvalidValueError: See `paxisim.Scene.simulate`.
            UnknownNameError: See `paxisim.Scene.simulate`.
        """
        scene, self._reason = with_mode(scene, recording)
        if scene.mode in CLOSING_FITS and recording.measured is None:
            raise InvalidValueError(f"mode {scene.mode} needs the measured forces, but the recording has none")
        if scene.mode in CLOSING_FITS and recording.unit != "N":
            raise InvalidValueError(
                f"mode {scene.mode} needs forces in newtons, but the recording is in {recording.unit}: convert it "
                "first with paxisim calibrate"
            )
        self._scene, self._recording, self._mean = scene, recording, mean
        self._follower = Follower(scene, recording, mean)

    @property
    def scene(self) -> Scene:
        """The scene, with the mode that it is replayed in."""
        return self._scene

    @property
    def rig(self) -> Rig:
        """The compiled scene."""
        return self._follower.rig

    @property
    def episodes(self) -> tuple[int, ...]:
        """Numbers of the recording's episodes."""
        return tuple(int(part.episode[0]) for part in self._recording.episodes())

    def run(self, number: int, closings: Sequence[float] | None = None) -> SimulatedEpisode:
        """Simulate one episode.

        Args:
            number: Number of the episode.
            closings: Constant to add to the closing stream in each grasp, in its unit, instead of fitting it.

        Raises:
            UnsupportedError: The simulation becomes unstable.
            InvalidValueError: In mode ``"fitted"`` or ``"shape"``, no closing reproduces the measured force of any
                grasp, or their number differs from that of `closings`.
        """
        part = self._recording.select([number])
        known = self._follower.known(part)
        moving = part[known]
        if self._scene.mode in CLOSING_FITS:
            done = by_grasp(self._follower, moving, closings)
            force, qpos, pressed = (_within(known, values) for values in (done.force, done.qpos, done.pressed))
            return SimulatedEpisode(number, force, qpos, pressed, done.closings, done.notes)
        force = self._follower.forces(moving)
        qpos, pressed = self._follower.runner.path, self._follower.runner.pressed
        if len(self.rig.free) == 1 and find_doubts(moving, force):
            assert moving.measured is not None
            grasps = find_grasps(moving.time, moving.measured)
            done = by_grasp(self._follower, moving, [0.0] * len(grasps))
            force, qpos, pressed = done.force, done.qpos, done.pressed
        notes = self._missed(moving, force)
        force, qpos, pressed = (_within(known, values) for values in (force, qpos, pressed))
        return SimulatedEpisode(number, force, qpos, pressed, notes=notes)

    def forces(self) -> NDArray[np.float32]:
        """Return the forces ``(T, pads, 3, rows, cols)`` (N) of the streams as they are, NaN where these are unknown.

        Raises:
            UnsupportedError: The simulation becomes unstable.
        """
        parts = []
        for part in self._recording.episodes():
            known = self._follower.known(part)
            parts.append(_within(known, self._follower.forces(part[known])))
        return np.concatenate(parts)

    def pose(self, sample: int) -> NDArray[np.float64]:
        """Return the positions ``(nq,)`` of `rig.model` at a sample, from a simulation of the second before it.

        Raises:
            UnsupportedError: The simulation becomes unstable.
            InvalidValueError: The driving streams are not known at that time.
        """
        time, number = self._recording.time[sample], int(self._recording.episode[sample])
        part = self._recording.select([number])
        part = part[(part.time <= time) & (part.time >= time - _BEFORE)]
        part = part[self._follower.known(part)]
        if part.time[-1] < time:
            raise InvalidValueError(f"the driving streams are not all known at {time:.3f} s of episode {number}")
        self._follower.forces(part)
        return self._follower.runner.qpos

    def inputs(self, number: int, closings: Sequence[float] | None = None) -> Iterator[bytes]:
        """Yield everything that the result of `run` depends on, apart from the versions of paxisim and MuJoCo."""
        from paxisim.scene.toml import format_scene

        yield self._model_digest
        yield format_scene(self._scene, "").encode()
        steps = sorted((drive.source, step) for drive, step in self._follower.resolution.items())
        yield repr(
            (self._mean, None if closings is None else tuple(closings), self._recording.tensor.shape[1:], steps)
        ).encode()
        part = self._recording.select([number])
        arrays: list[np.ndarray] = [part.time]
        for source in dict.fromkeys(moved.stream for moved in (*self._scene.drives, *self._scene.start)):
            arrays += [part.covariates[source]] if source in part.covariates else []
        if part.measured is not None:  # it divides the episode into grasps, and closings are fitted to it
            arrays.append(part.measured)
        for array in arrays:
            yield f"{array.dtype} {array.shape}".encode()
            yield np.ascontiguousarray(array).tobytes()

    @cached_property
    def _model_digest(self) -> bytes:
        """A hash of the compiled model, with all meshes that its files named; computed once, as meshes are large."""
        model = self.rig.model
        buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
        mujoco.mj_saveModel(model, None, buffer)
        return hashlib.sha256(buffer.tobytes()).digest()

    def _missed(self, part: Recording, force: NDArray[np.float32]) -> tuple[str, ...]:
        """Return a note if contact was measured in an episode but none is simulated."""
        if part.measured is None or force.any():
            return ()
        measured = total_normal(part.measured)
        if not np.nanmax(measured, initial=0.0) > CONTACT_FORCE:
            return ()
        at = float(part.time[int(np.nanargmax(measured))])
        gap = self._follower.runner.clearance(self._follower.motion(part), at)
        where = f"{1e3 * gap:.2f} mm from the nearest object" if np.isfinite(gap) else "far from any object"
        number = int(part.episode[0])
        return (
            f"episode {number}: {np.nanmax(measured):.3g} N were measured at {at:.2f} s, when the pads of the scene "
            f"are {where}: check the object's start pose, and the offsets, signs and units of the drives",
        )

    def encoder_error(self, episodes: Sequence[SimulatedEpisode]) -> EncoderError | None:
        """Return the force change caused by half an encoder step, in the episode with the highest force.

        The episode is simulated once more for each encoder that shows steps.

        Returns:
            The error, or None if no encoder shows steps or there is no contact.
        """
        coarse = [drive for drive in self.rig.prescribed if self._follower.resolution[drive]]
        peaks = [float(np.nanmax(total_normal(episode.force), initial=0.0)) for episode in episodes]
        if not coarse or not max(peaks, default=0.0) > 0:
            return None
        strongest = episodes[int(np.argmax(peaks))]
        part = self._recording.select([strongest.number])
        known = self._follower.known(part)
        changed = []
        for drive in coarse:
            shift = {drive: math.copysign(0.5 * self._follower.resolution[drive], drive.gain)}
            if strongest.closings:
                force = by_grasp(self._follower, part[known], strongest.closings, shift).force
            else:
                force = self._follower.forces(part[known], shift)
            changed.append(total_normal(force))
        total = total_normal(strongest.force[known])
        held = np.isfinite(total)  # without a grasp to which no closing could be fitted
        return EncoderError.of(strongest.number, total[held], [one[held] for one in changed])

    def paired(self, episodes: Sequence[SimulatedEpisode]) -> Recording:
        """Return the recording with the simulated stream of all its episodes and a description of the replay.

        Args:
            episodes: All simulated episodes, in any order.

        Raises:
            InvalidValueError: An episode is missing.
        """
        by_number = {episode.number: episode for episode in episodes}
        missing = [number for number in self.episodes if number not in by_number]
        if missing:
            raise InvalidValueError(f"episode {missing[0]} was not simulated")
        ordered = [by_number[number] for number in self.episodes]
        force = np.concatenate([episode.force for episode in ordered])
        kept, doubts, known = [], [], 0
        for part, episode in zip(self._recording.episodes(), ordered, strict=True):
            force = episode.force.copy()
            # what is fixed cannot be lost: if the hand misses it, that is what a diagnosis must explain
            for doubt in find_doubts(part, force, episode.pressed) if self.rig.free else ():
                doubts.append(f"episode {episode.number}, {doubt.begin:.2f} s to {doubt.end:.2f} s: {doubt.why}")
                force[doubt.samples] = np.nan
            kept.append(force)
            known += int(self._follower.known(part).sum())
        force = np.concatenate(kept)
        left = int(np.isfinite(force[:, 0, 0, 0, 0]).sum())
        described = {**self._described(ordered), "doubts": doubts, "in_doubt": 1 - left / known}
        return self._recording.with_simulated(force, scene=self.rig.mjcf, replay=described)

    def _described(self, episodes: Sequence[SimulatedEpisode]) -> dict[str, object]:
        """Return the ``replay`` entry of the metadata, in a form that JSON can store."""
        from paxisim.scene.toml import format_scene

        scene = replace(self._scene, sensor="", pool=1, mounts=(), pads=self.rig.pads.names)
        mode, error = MODES[scene.mode], self.encoder_error(episodes)
        notes = [self._reason] if self._reason else []
        notes += [note for episode in episodes for note in episode.notes]
        coarse = error is not None and error.newtons > COARSE_FRACTION * error.peak
        if error is not None and coarse and scene.mode not in CLOSING_FITS:
            notes.append(
                f"half an encoder step changes the force by {error.newtons:.2g} N at the peak of {error.peak:.3g} N in "
                f"episode {error.episode}: positions alone do not determine the total force to {COARSE_FRACTION:.0%}"
            )
        described: dict[str, object] = {
            "version": __version__,
            "mode": scene.mode,
            "mean": self._mean,
            "starts": [start.stream for start in scene.start if start.stream],
            "not_testable": dict(mode.not_testable),
            "encoder_steps": {d.source: step for d, step in self._follower.resolution.items() if step},
            "toml": format_scene(scene, "scene.xml"),
            "encoder_error": None if error is None else vars(error),
            "notes": notes,
        }
        if scene.mode in CLOSING_FITS:
            described["closing"] = {str(episode.number): list(episode.closings) for episode in episodes}
        return described


def _within(known: NDArray[np.bool_], values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return values of the known samples at all samples, NaN at the others."""
    whole = np.full((len(known), *values.shape[1:]), np.nan, dtype=np.float32)
    whole[known] = values
    return whole
