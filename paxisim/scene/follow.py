"""Follower: a compiled scene that follows the streams of one recording, an episode or a part of it at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.scene import streams
from paxisim.scene.drive import Drive
from paxisim.scene.episode import EpisodeRunner, Motion
from paxisim.scene.motion import Curve, PoseCurve, smooth_within
from paxisim.scene.rig import Rig, build_rig
from paxisim.scene.scene import Scene


class Follower:
    """A compiled scene together with the streams that move it.

    Attributes:
        scene: The scene.
        rig: The compiled scene.
        runner: The simulation, which keeps its state between two parts of an episode.
        resolution: Step of the encoder of each drive that moves a joint, in its stream's unit; 0 if it shows none.
        objects: Index in ``qpos`` of each object that has a start pose, and that pose in each episode.
    """

    def __init__(self, scene: Scene, recording: Recording, mean: bool) -> None:
        """Compile the scene and check the streams.

        Raises:
            InvalidValueError: See `paxisim.Scene.simulate`.
            UnknownNameError: See `paxisim.Scene.simulate`.
        """
        self.scene, self._mean = scene, mean
        self.rig: Rig = build_rig(scene)
        self._taxels = recording.tensor.shape[3:]
        self._pool = _pooling(self.rig, recording)
        streams.check_streams(recording, self.rig)
        self.resolution = {
            drive: streams.encoder_step(recording, drive) for drive in (*self.rig.prescribed, *self.rig.followed)
        }
        self.objects = [
            (self.rig.object_address(start.body), streams.object_poses(recording, start)) for start in scene.start
        ]
        self.runner = EpisodeRunner(self.rig)

    def known(self, part: Recording) -> NDArray[np.bool_]:
        """Return a mask ``(T,)`` of the samples at which all driving streams are known."""
        known = np.ones(len(part), dtype=bool)
        for drive in (*self.rig.prescribed, *self.rig.followed, *self.rig.commands):
            known &= streams.known_samples(streams.raw_values(part, drive))
        if not known.any():
            raise InvalidValueError(
                f"episode {int(part.episode[0])} has no start pose: its driving streams are never known all at once"
            )
        return known

    def forces(
        self,
        part: Recording,
        shifts: Mapping[Drive, float] = MappingProxyType({}),
        time: NDArray[np.float64] | None = None,
        start: NDArray[np.float64] | None = None,
        objects: tuple[tuple[int, NDArray[np.float64]], ...] | None = None,
    ) -> NDArray[np.float32]:
        """Return the forces of an episode, or of the part of it at `time`, which continues from the state `start`.

        `objects` are start poses in place of the scene's, see `Motion`.
        """
        motion = self.motion(part, shifts, time)
        motion = motion if objects is None else replace(motion, objects=objects)
        force = self.runner.run(motion, self.scene.settle, self._mean, start)
        pads, rows, cols = force.shape[1], *self._taxels
        return force.reshape(len(force), pads, 3, rows, self._pool[0], cols, self._pool[1]).sum(axis=(4, 6))

    def motion(
        self,
        part: Recording,
        shifts: Mapping[Drive, float] = MappingProxyType({}),
        at: NDArray[np.float64] | None = None,
    ) -> Motion:
        """Return the motion of an episode without unknown samples, or the part of it at the times `at`.

        `shifts` are added to the streams of drives.
        """
        number = int(part.episode[0])
        new = np.append(True, np.diff(part.time) > 0)  # the splines need increasing times: skip repeated ones
        curves: dict[Drive, Curve | PoseCurve] = {}
        for drive in (*self.rig.prescribed, *self.rig.followed):
            values, time = streams.raw_values(part, drive)[new], part.time[new]
            if drive.body:
                poses = drive.to_scene(values)
                poses[:, :3] += drive.gain * shifts.get(drive, 0.0)
                curves[drive] = PoseCurve(time, poses)
            else:
                smooth = smooth_within(time, values, self.resolution[drive])
                curves[drive] = Curve(time, drive.to_scene(smooth + shifts.get(drive, 0.0)))
        commands = {drive: streams.driving_values(part, drive) for drive in self.rig.commands}
        objects = tuple((address, poses[number]) for address, poses in self.objects)
        motion = Motion(number, part.time, curves, commands, objects)
        if at is None:
            return motion
        return replace(motion, time=at, commands={d: np.interp(at, part.time, v) for d, v in commands.items()})

    def closed(self, closing: float) -> Mapping[Drive, float]:
        """Return what is added to the stream of each drive if `closing` is added to the closing stream."""
        return {drive: closing for drive in self.scene.drives if drive.stream == self.scene.closing}

    def closing_step(self) -> float:
        """Return the change of the closing stream, in its unit, that moves its first drive by 1 mm or 1 mrad."""
        drive = next(d for d in self.scene.drives if d.stream == self.scene.closing)
        return 1e-3 / abs(drive.gain)


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
