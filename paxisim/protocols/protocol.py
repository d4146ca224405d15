"""Protocol: timed positions that a robot or a stage follows during a recording, and the purpose of each part."""

from __future__ import annotations

import itertools
import json
import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from paxisim.document import DocumentFile
from paxisim.errors import InvalidValueError
from paxisim.protocols.segment import Segment, entries_of, number_of, segment_from, value_of
from paxisim.recording import Recording

if TYPE_CHECKING:
    from paxisim.scene.scene import Scene

PEAK_TO_MEAN_SPEED = 1.875
"""Peak speed of a minimum-jerk move from rest to rest, divided by its mean speed."""
_BETWEEN = "minimum jerk, at rest at each waypoint"
_PLAIN = {"name": str, "about": str, "scene": str, "frame": str}


@dataclass(frozen=True)
class Protocol(DocumentFile):
    """A motion to follow. Between two waypoints it follows a minimum-jerk curve, at rest at both.

    Attributes:
        name: Name of the protocol.
        about: Description of what moves.
        scene: Ready-made scene of `paxisim scene make` in which the protocol can be rehearsed.
        streams: Names of the moved streams, as in the scene's drives.
        frame: Meaning of the positions.
        max_speed: Maximum speed (m/s) of any stream.
        stop_force: Total normal force (N) on a pad at which the robot must stop.
        rate: Minimum sampling rate of the recording (Hz).
        segments: Segments in order.

    Raises:
        InvalidValueError: Times do not increase, a waypoint lacks one position per stream, a move is faster than
            `max_speed`, or episodes are out of order.
    """

    name: str
    about: str
    scene: str
    streams: tuple[str, ...]
    frame: str
    max_speed: float
    stop_force: float
    rate: float
    segments: tuple[Segment, ...]

    FORMAT = "paxisim-protocol/1"
    ENTRIES = (
        "name",
        "about",
        "scene",
        "seconds",
        "units",
        "frame",
        "between_waypoints",
        "max_speed",
        "stop_at_normal_force_on_a_pad",
        "record_at_least",
        "columns",
        "segments",
    )

    def __post_init__(self) -> None:
        """Check the values."""
        if not self.streams or len(set(self.streams)) < len(self.streams):
            raise InvalidValueError(f"a protocol needs streams with distinct names, got {self.streams!r}")
        for name, unit in (("max_speed", "m/s"), ("stop_force", "N"), ("rate", "Hz")):
            if not 0 < getattr(self, name) < math.inf:
                raise InvalidValueError(f"a protocol's {name} must be above 0 {unit}, got {getattr(self, name)!r}")
        episodes = [segment.episode for segment in self.segments]
        if episodes != sorted(episodes):
            raise InvalidValueError("the segments of a protocol must be in the order of their episodes")
        points = [point for segment in self.segments for point in segment.waypoints]
        if len(points) < 2:
            raise InvalidValueError(f"a protocol needs at least two waypoints, got {len(points)}")
        for point in points:
            if len(point) != 1 + len(self.streams) or not np.isfinite(point).all():
                raise InvalidValueError(
                    f"a waypoint must be a time and a position of {', '.join(self.streams)}, all finite, got {point!r}"
                )
        for before, after in itertools.pairwise(points):
            self._check_move(before, after)

    def _check_move(self, before: Sequence[float], after: Sequence[float]) -> None:
        seconds = after[0] - before[0]
        if not seconds > 0:
            raise InvalidValueError(f"times of waypoints must increase, got {after[0]:g} s after {before[0]:g} s")
        for stream, start, end in zip(self.streams, before[1:], after[1:], strict=True):
            speed = PEAK_TO_MEAN_SPEED * abs(end - start) / seconds
            if speed > (1 + 1e-9) * self.max_speed:
                raise InvalidValueError(
                    f"{stream} moves at up to {speed:.3g} m/s from {before[0]:g} s to {after[0]:g} s, faster than the "
                    f"protocol's max_speed of {self.max_speed:.3g} m/s: allow it more time"
                )

    @property
    def seconds(self) -> float:
        """Duration of the protocol (s)."""
        return self.segments[-1].waypoints[-1][0] - self.segments[0].waypoints[0][0]

    @property
    def waypoints(self) -> NDArray[np.float64]:
        """Times (s) and positions (m) of all waypoints, ``(N, 1 + streams)``."""
        return np.array([point for segment in self.segments for point in segment.waypoints], dtype=np.float64)

    def positions(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``(T, streams)`` positions (m) at ``(T,)`` times (s); at rest before the first and after the last."""
        points = self.waypoints
        knots, values = points[:, 0], points[:, 1:]
        i = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
        u = np.clip((time - knots[i]) / (knots[i + 1] - knots[i]), 0, 1)[:, None]
        return values[i] + u**3 * (10 - 15 * u + 6 * u**2) * (values[i + 1] - values[i])

    def unrecorded(self, scene: Scene) -> Recording:
        """Return a recording of the motion alone: streams and episodes at `rate`, with unknown forces (NaN).

        Args:
            scene: Scene to simulate the recording in; the recording has its pads.

        Raises:
            InvalidValueError: The scene cannot be compiled.
        """
        from paxisim.scene.rig import build_rig

        pads = build_rig(scene).pads
        begin = self.segments[0].waypoints[0][0]
        time = begin + np.arange(round(self.seconds * self.rate) + 1) / self.rate
        ends = np.array([segment.waypoints[-1][0] for segment in self.segments])
        of = np.minimum(np.searchsorted(ends, time), len(self.segments) - 1)
        return Recording(
            time,
            simulated=np.full((len(time), *pads.shape), np.nan, dtype=np.float32),
            covariates=dict(zip(self.streams, self.positions(time).T, strict=True)),
            episode=np.array([segment.episode for segment in self.segments])[of],
            layout=pads.layout,
            pads=pads.names,
            metadata={"protocol": self.name},
        )

    def rehearse(self, scene: Scene, **parameters: float) -> Recording:
        """Simulate the motion, as a robot would record it with a sensor that behaves like the model.

        Args:
            scene: A ready-made scene, or your own scene of the robot with drives of the same streams.
            parameters: Fields of the gel, see `paxisim.Scene.simulate`.

        Returns:
            A recording with `simulated` forces and the streams.

        Raises:
            InvalidValueError: The scene cannot follow the motion.
            UnknownNameError: The scene is driven by other streams.
        """
        return scene.with_parameters(**parameters).simulate(self.unrecorded(scene))

    def to_json(self) -> str:
        """Return the protocol as JSON text with a waypoint a line; times in s, positions in m."""
        document = self.to_document()
        segments = [
            _in_lines(segment, "waypoints", map(json.dumps, segment["waypoints"])) for segment in document["segments"]
        ]
        return _in_lines(document, "segments", segments)

    def _entries(self) -> dict[str, Any]:
        return {
            **{name: getattr(self, name) for name in ("name", "about", "scene")},
            "seconds": self.seconds,
            "units": {"time": "s", "position": "m", "speed": "m/s", "force": "N", "rate": "Hz"},
            "frame": self.frame,
            "between_waypoints": _BETWEEN,
            "max_speed": self.max_speed,
            "stop_at_normal_force_on_a_pad": self.stop_force,
            "record_at_least": self.rate,
            "columns": ["time", *self.streams],
            "segments": [entries_of(segment) for segment in self.segments],
        }

    @classmethod
    def _from_entries(cls, entries: dict[str, Any]) -> Protocol:
        columns = value_of(entries, "columns", list)
        if columns[:1] != ["time"] or not all(isinstance(name, str) for name in columns):
            raise InvalidValueError(f'columns must be "time" and the names of the streams, got {columns!r}')
        return cls(
            **{name: value_of(entries, name, kind) for name, kind in _PLAIN.items()},
            streams=tuple(columns[1:]),
            max_speed=number_of(entries, "max_speed"),
            stop_force=number_of(entries, "stop_at_normal_force_on_a_pad"),
            rate=number_of(entries, "record_at_least"),
            segments=tuple(segment_from(segment) for segment in value_of(entries, "segments", list)),
        )


def _in_lines(table: dict[str, Any], last: str, items: Iterable[str]) -> str:
    """Return the entries of a table a line each, and for the list `last` the texts of its items."""
    lines = [f"{json.dumps(key)}: {json.dumps(value)}," for key, value in table.items() if key != last]
    listed = textwrap.indent(",\n".join(items), "  ")
    return "{\n" + textwrap.indent("\n".join([*lines, f"{json.dumps(last)}: [\n{listed}\n]"]), "  ") + "\n}"


def peak_forces(recording: Recording) -> dict[str, float]:
    """Return the peak total normal force (N) of each pad in a recording's tensor; NaN counts as 0."""
    total = np.nansum(recording.tensor[:, :, 2].astype(np.float64), axis=(2, 3))
    return dict(zip(recording.pads, total.max(axis=0).tolist(), strict=True))
