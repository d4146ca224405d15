"""Replay: a scene combined with a recording, to simulate single episodes and pair the streams."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim._version import __version__
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.scene import streams
from paxisim.scene.closing import fit_closing, total_normal
from paxisim.scene.drive import Drive
from paxisim.scene.encoder import EncoderError
from paxisim.scene.episode import EpisodeRunner, Motion
from paxisim.scene.modes import MODES
from paxisim.scene.motion import Curve, PoseCurve, smooth_within
from paxisim.scene.rig import Rig, build_rig
from paxisim.scene.scene import Scene
from paxisim.scene.shape import fit_shape

COARSE_FRACTION = 0.1
"""Fraction of the peak force above which half an encoder step is reported as too coarse for the total force."""

CLOSING_FITS = {"fitted": fit_closing, "shape": fit_shape}
"""Functions that fit the closing of an episode, by mode."""

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
        closing: Constant added to the closing stream, in its unit: given to `Replay.run`, or fitted by mode
            ``"fitted"`` or ``"shape"``; otherwise 0.
        notes: Remarks on the simulation.
    """

    number: int
    force: NDArray[np.float32]
    closing: float = 0.0
    notes: tuple[str, ...] = field(default=())


class Replay:
    """A compiled scene together with the recording it follows, which has been checked."""

    def __init__(self, scene: Scene, recording: Recording, mean: bool = False) -> None:
        """Compile the scene and check the recording; see `paxisim.Scene.prepare`.

        Raises:
            InvalidValueError: See `paxisim.Scene.simulate`.
            UnknownNameError: See `paxisim.Scene.simulate`.
        """
        if scene.mode in CLOSING_FITS and recording.measured is None:
            raise InvalidValueError(f"mode {scene.mode} needs the measured forces, but the recording has none")
        if scene.mode in CLOSING_FITS and recording.unit != "N":
            raise InvalidValueError(
                f"mode {scene.mode} needs forces in newtons, but the recording is in {recording.unit}: convert it "
                "first with paxisim calibrate"
            )
        self._scene, self._recording, self._mean = scene, recording, mean
        self._rig: Rig = build_rig(scene)
        self._pool = _pooling(self._rig, recording)
        streams.check_streams(recording, self._rig)
        self._resolution = {
            drive: streams.encoder_step(recording, drive) for drive in (*self._rig.prescribed, *self._rig.followed)
        }
        self._objects = [
            (self._rig.object_address(start.body), streams.object_poses(recording, start)) for start in scene.start
        ]
        self._runner = EpisodeRunner(self._rig)

    @property
    def rig(self) -> Rig:
        """The compiled scene."""
        return self._rig

    @property
    def episodes(self) -> tuple[int, ...]:
        """Numbers of the recording's episodes."""
        return tuple(int(part.episode[0]) for part in self._recording.episodes())

    def run(self, number: int, closing: float | None = None) -> SimulatedEpisode:
        """Simulate one episode.

        Args:
            number: Number of the episode.
            closing: Constant to add to the closing stream, in its unit, instead of fitting it.

        Raises:
            UnsupportedError: The simulation becomes unstable.
            InvalidValueError: In mode ``"fitted"`` or ``"shape"``, no closing reproduces the measured force.
        """
        part = self._recording.select([number])
        known = self._known(part)
        fit = CLOSING_FITS.get(self._scene.mode)
        if closing is not None:
            force = self._simulated(part, known, self._closed(closing))
            return SimulatedEpisode(number, _within(part, known, force), closing)
        if fit is None:
            force = self._simulated(part, known)
            return SimulatedEpisode(number, _within(part, known, force), notes=self._missed(part[known], force))
        assert part.measured is not None
        fitted = fit(
            lambda closing: self._simulated(part, known, self._closed(closing)),
            part.measured[known],
            part.time[known],
            self._closing_step(),
            number,
        )
        return SimulatedEpisode(number, _within(part, known, fitted.force), fitted.closing, fitted.notes)

    def pose(self, sample: int) -> NDArray[np.float64]:
        """Return the positions ``(nq,)`` of `rig.model` at a sample, from a simulation of the second before it.

        Raises:
            UnsupportedError: The simulation becomes unstable.
            InvalidValueError: The driving streams are not known at that time.
        """
        time, number = self._recording.time[sample], int(self._recording.episode[sample])
        part = self._recording.select([number])
        part = part[(part.time <= time) & (part.time >= time - _BEFORE)]
        part = part[self._known(part)]
        if part.time[-1] < time:
            raise InvalidValueError(f"the driving streams are not all known at {time:.3f} s of episode {number}")
        self._runner.run(self._motion(part), self._scene.settle, mean=False)
        return self._runner.qpos

    def inputs(self, number: int, closing: float | None = None) -> Iterator[bytes]:
        """Yield everything that the result of `run` depends on, apart from the versions of paxisim and MuJoCo."""
        from paxisim.scene.toml import format_scene

        yield self._model_digest
        yield format_scene(self._scene, "").encode()
        steps = sorted((drive.source, step) for drive, step in self._resolution.items())
        yield repr((self._mean, closing, self._recording.tensor.shape[1:], steps)).encode()
        part = self._recording.select([number])
        arrays: list[np.ndarray] = [part.time]
        for source in dict.fromkeys(moved.stream for moved in (*self._scene.drives, *self._scene.start)):
            arrays += [part.covariates[source]] if source in part.covariates else []
        if part.measured is not None and closing is None:  # a closing is fitted to it, and a missed contact noted
            arrays.append(part.measured)
        for array in arrays:
            yield f"{array.dtype} {array.shape}".encode()
            yield np.ascontiguousarray(array).tobytes()

    @cached_property
    def _model_digest(self) -> bytes:
        """A hash of the compiled model, with all meshes that its files named; computed once, as meshes are large."""
        model = self._rig.model
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
        gap = self._runner.clearance(self._motion(part), at)
        where = f"{1e3 * gap:.2f} mm from the nearest object" if np.isfinite(gap) else "far from any object"
        number = int(part.episode[0])
        return (
            f"episode {number}: {np.nanmax(measured):.3g} N were measured at {at:.2f} s, when the pads of the scene "
            f"are {where}: check the object's start pose, and the offsets, signs and units of the drives",
        )

    def _known(self, part: Recording) -> NDArray[np.bool_]:
        """Return a mask ``(T,)`` of the samples at which all driving streams are known."""
        known = np.ones(len(part), dtype=bool)
        for drive in (*self._rig.prescribed, *self._rig.followed, *self._rig.commands):
            known &= streams.known_samples(streams.raw_values(part, drive))
        if not known.any():
            raise InvalidValueError(
                f"episode {int(part.episode[0])} has no start pose: its driving streams are never known all at once"
            )
        return known

    def _simulated(
        self, part: Recording, known: NDArray[np.bool_], shifts: Mapping[Drive, float] = MappingProxyType({})
    ) -> NDArray[np.float32]:
        force = self._runner.run(self._motion(part[known], shifts), self._scene.settle, self._mean)
        pads, rows, cols = force.shape[1], *self._recording.tensor.shape[3:]
        return force.reshape(len(force), pads, 3, rows, self._pool[0], cols, self._pool[1]).sum(axis=(4, 6))

    def _motion(self, part: Recording, shifts: Mapping[Drive, float] = MappingProxyType({})) -> Motion:
        """Return the motion of an episode without unknown samples; `shifts` are added to the streams of drives."""
        number = int(part.episode[0])
        new = np.append(True, np.diff(part.time) > 0)  # the splines need increasing times: skip repeated ones
        curves: dict[Drive, Curve | PoseCurve] = {}
        for drive in (*self._rig.prescribed, *self._rig.followed):
            values, time = streams.raw_values(part, drive)[new], part.time[new]
            if drive.body:
                poses = drive.to_scene(values)
                poses[:, :3] += drive.gain * shifts.get(drive, 0.0)
                curves[drive] = PoseCurve(time, poses)
            else:
                smooth = smooth_within(time, values, self._resolution[drive])
                curves[drive] = Curve(time, drive.to_scene(smooth + shifts.get(drive, 0.0)))
        commands = {drive: streams.driving_values(part, drive) for drive in self._rig.commands}
        objects = tuple((address, poses[number]) for address, poses in self._objects)
        return Motion(number, part.time, curves, commands, objects)

    def _closed(self, closing: float) -> Mapping[Drive, float]:
        """Return what is added to the stream of each drive if `closing` is added to the closing stream."""
        return {drive: closing for drive in self._scene.drives if drive.stream == self._scene.closing}

    def encoder_error(self, episodes: Sequence[SimulatedEpisode]) -> EncoderError | None:
        """Return the force change caused by half an encoder step, in the episode with the highest force.

        The episode is simulated once more for each encoder that shows steps.

        Returns:
            The error, or None if no encoder shows steps or there is no contact.
        """
        coarse = [drive for drive in self._rig.prescribed if self._resolution[drive]]
        peaks = [float(np.nanmax(total_normal(episode.force), initial=0.0)) for episode in episodes]
        if not coarse or not max(peaks, default=0.0) > 0:
            return None
        strongest = episodes[int(np.argmax(peaks))]
        part = self._recording.select([strongest.number])
        known, shifts = self._known(part), self._closed(strongest.closing)
        half = {drive: math.copysign(0.5 * self._resolution[drive], drive.gain) for drive in coarse}
        moved = [{**shifts, drive: shifts.get(drive, 0.0) + half[drive]} for drive in coarse]
        changed = [total_normal(self._simulated(part, known, shift)) for shift in moved]
        return EncoderError.of(strongest.number, total_normal(strongest.force[known]), changed)

    def _closing_step(self) -> float:
        """Return the change of the closing stream, in its unit, that moves its first drive by 1 mm or 1 mrad."""
        drive = next(d for d in self._scene.drives if d.stream == self._scene.closing)
        return 1e-3 / abs(drive.gain)

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
        return self._recording.with_simulated(
            np.concatenate([episode.force for episode in ordered]),
            scene=self._rig.mjcf,
            replay=self._described(ordered),
        )

    def _described(self, episodes: Sequence[SimulatedEpisode]) -> Mapping[str, object]:
        """Return the ``replay`` entry of the metadata, in a form that JSON can store."""
        from paxisim.scene.toml import format_scene

        scene = replace(self._scene, sensor="", pool=1, mounts=(), pads=self._rig.pads.names)
        mode, error = MODES[scene.mode], self.encoder_error(episodes)
        notes = [note for episode in episodes for note in episode.notes]
        if error is not None and error.newtons > COARSE_FRACTION * error.peak:
            notes.append(
                f"half an encoder step changes the force by {error.newtons:.2g} N at the peak of {error.peak:.3g} N in "
                f"episode {error.episode}: positions alone do not determine the total force to {COARSE_FRACTION:.0%}"
            )
        described: dict[str, object] = {
            "version": __version__,
            "mode": scene.mode,
            "mean": self._mean,
            "not_testable": dict(mode.not_testable),
            "encoder_steps": {d.source: step for d, step in self._resolution.items() if step},
            "toml": format_scene(scene, "scene.xml"),
            "encoder_error": None if error is None else vars(error),
            "notes": notes,
        }
        if scene.mode in CLOSING_FITS:
            described["closing"] = {str(episode.number): episode.closing for episode in episodes}
        return described


def _within(part: Recording, known: NDArray[np.bool_], force: NDArray[np.float32]) -> NDArray[np.float32]:
    whole = np.full((len(part), *force.shape[1:]), np.nan, dtype=np.float32)
    whole[known] = force
    return whole


def _pooling(rig: Rig, recording: Recording) -> tuple[int, int]:
    """Return how many of the scene's taxels, down and across, form one taxel of the recording.

    Raises:
        InvalidValueError: The pads or taxels do not match.
    """
    scene, recorded = rig.pads.shape, recording.tensor.shape[1:]
    if scene[0] == recorded[0] and scene[2] % recorded[2] == 0 and scene[3] % recorded[3] == 0:
        return scene[2] // recorded[2], scene[3] // recorded[3]
    hint = ""
    if scene[0] == recorded[0] and recorded[2] % scene[2] == 0 and recorded[3] % scene[3] == 0:
        by = recorded[2] // scene[2], recorded[3] // scene[3]
        hint = f": pool the recording with Recording.pool{by}, or build the scene with the sensor's own taxels"
    elif scene[0] != recorded[0]:
        hint = f": name the scene's pads in pads = [...] (it has {', '.join(rig.pads.names)}), or select recorded ones"
    raise InvalidValueError(
        f"the recording has {recorded[0]} pads of {recorded[2]}x{recorded[3]} taxels, "
        f"the scene {scene[0]} of {scene[2]}x{scene[3]}{hint}"
    )
