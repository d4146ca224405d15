"""Scene: a MuJoCo model with pads, and which recorded streams move what in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from paxisim.errors import InvalidValueError
from paxisim.models.gel import Gel
from paxisim.models.mount import Mount
from paxisim.recording import Recording
from paxisim.scene import modes
from paxisim.scene.drive import Drive, ObjectStart
from paxisim.scene.modes import Mode

if TYPE_CHECKING:
    from paxisim.scene.parameters import SceneParameter
    from paxisim.scene.replay import Replay

_GEL = tuple(item.name for item in fields(Gel))


@dataclass(frozen=True, eq=False)
class Scene:
    """A MuJoCo model with pads that the streams of a recording move.

    The pads have the sensor's taxels, or a whole number of finer ones for each, whose forces then add up.

    Example:
        ```python
        scene = paxisim.Scene("press.xml", [paxisim.Drive("z", joint="z", unit="mm")])
        paired = scene.simulate(paxisim.Recording.load("press.mcap"))
        ```

    Attributes:
        mjcf: Path of the MJCF file, or its text. An episode begins at its first keyframe, if it has one.
        drives: What each stream moves.
        mode: How the motion is followed: see `paxisim.scene.modes.MODES`, which also says what each mode makes
            unobservable.
        closing: The stream that presses or closes; modes ``"fitted"`` and ``"shape"`` add a
            constant to it.
        start: Where objects are when an episode begins.
        settle: Seconds for which the scene rests at the first pose before each episode.
        gel: The gel that the taxels get.
        pads: Names of the MJCF's pads in the order of the recording's. Default: all, in the order of their bodies.
        sensor: Name of a sensor in the catalogue to put on the model; empty where the MJCF has its pads.
        pool: Make one taxel of each `pool` x `pool` of that sensor.
        mounts: Where that sensor's pads go. Default: as `paxisim.attach` finds.
        bounds: Least and largest values of parameters, by name, for a diagnosis; see `parameters` for the defaults.

    Raises:
        InvalidValueError: No such mode, a time that is not 0 or more, a mode that fits a closing
            without a closing stream.
    """

    mjcf: str | Path
    drives: tuple[Drive, ...]
    mode: Mode = "kinematic"
    closing: str = ""
    start: tuple[ObjectStart, ...] = ()
    settle: float = 0.2
    gel: Gel = field(default_factory=Gel)
    pads: tuple[str, ...] = ()
    sensor: str = ""
    pool: int = 1
    mounts: tuple[Mount, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check what can be checked without the model."""
        for name in ("drives", "start", "pads", "mounts"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        modes.checked(self.mode)
        if not 0 <= self.settle <= 60:
            raise InvalidValueError(f"a scene's settle must lie between 0 and 60 s, got {self.settle!r}")
        if self.pool < 1:
            raise InvalidValueError(f"a scene's pool must be 1 or more, got {self.pool!r}")
        if not self.drives:
            raise InvalidValueError("a scene needs at least one drive, or nothing in it moves")
        streams = [drive.stream for drive in self.drives]
        if self.closing and self.closing not in streams:
            raise InvalidValueError(f"closing must be one of the driving streams ({', '.join(streams)})")
        if self.mode in ("fitted", "shape") and not self.closing:
            raise InvalidValueError(f"mode {self.mode} needs closing: the stream to which the fitted constant is added")
        targets = [(drive.kind, drive.target) for drive in self.drives]
        twice = next((target for target in targets if targets.count(target) > 1), None)
        if twice:
            raise InvalidValueError(f"two drives move the same {twice[0]} {twice[1]!r}")

    def simulate(
        self,
        recording: Recording,
        *,
        mode: Mode | None = None,
        mean: bool = False,
        progress: Callable[[str], None] | None = None,
        **parameters: float,
    ) -> Recording:
        """Replay the recorded motion and give the recording its simulated stream.

        Each episode is simulated by itself: the objects are placed, the scene rests for `settle` seconds at the first
        pose, then the streams move it, interpolated to the physics step with velocities and accelerations to match.

        Args:
            recording: Has the driving streams among its covariates.
            mode: Instead of the scene's.
            mean: Take the mean force since the sample before, as a sensor does that averages; default: the force at
                the sample's time.
            progress: Called with a line of text for each episode.
            parameters: Other values of the scene's parameters or its gel's fields, such as ``friction=0.6`` or
                ``mount_offset_x=5e-4``; see `parameters`.

        Returns:
            The recording with `simulated`; NaN before and after the driving streams. Its metadata has the MJCF
            (``scene``) and how it was replayed (``replay``), from which `from_recording` makes the scene again.

        Raises:
            InvalidValueError: Streams that the scene cannot follow: the message says which, when, and what to do.
            UnknownNameError: A stream, joint, body, actuator or parameter that is not there.
        """
        replay = self.prepare(recording, mode=mode, mean=mean, **parameters)
        parts = []
        for number in replay.episodes:
            if progress is not None:
                progress(f"episode {number}, {len(parts) + 1} of {len(replay.episodes)}")
            parts.append(replay.run(number))
        return replay.paired(parts)

    def prepare(
        self, recording: Recording, *, mode: Mode | None = None, mean: bool = False, **parameters: float
    ) -> Replay:
        """Compile the model and check the recording; the result simulates single episodes.

        Takes and raises what `simulate` does.
        """
        from paxisim.scene.replay import Replay

        scene = self if mode is None else replace(self, mode=modes.checked(mode))
        return Replay(scene.with_parameters(**parameters), recording, mean)

    def parameters(self) -> dict[str, SceneParameter]:
        """The numbers of the scene that may be wrong, by name, with their nominal values and bounds.

        Raises:
            InvalidValueError: Bounds exclude the nominal value, or the scene cannot be compiled.
            UnknownNameError: Bounds for a parameter that the scene does not have.
        """
        from paxisim.scene.parameters import parameters_of
        from paxisim.scene.rig import build_rig

        return parameters_of(self, build_rig(self))

    def with_parameters(self, **parameters: float) -> Scene:
        """The scene with other values of its parameters, or other fields of its gel.

        Args:
            parameters: By name, as `parameters` lists them, or a field of `paxisim.Gel`.

        Raises:
            UnknownNameError: There is no such parameter.
            InvalidValueError: The value cannot be used.
        """
        of_gel = {name: value for name, value in parameters.items() if name in _GEL}
        scene = replace(self, gel=replace(self.gel, **of_gel)) if of_gel else self
        others = {name: value for name, value in parameters.items() if name not in _GEL}
        if not others:
            return scene
        from paxisim.scene.changed import changed
        from paxisim.scene.parameters import checked_values

        known = scene.parameters()
        checked_values(others, {**known, **dict.fromkeys(_GEL)})  # type: ignore[dict-item]
        return changed(scene, {known[name]: value for name, value in others.items()})

    @classmethod
    def load(cls, path: str | Path) -> Scene:
        """Read a scene from its TOML file; the path of the MJCF in it is relative to the file.

        Raises:
            InvalidValueError: Not such a file; the message names the key.
            UnknownNameError: A key that a scene does not have.
            FileNotFoundError: There is no such file.
        """
        from paxisim.scene.toml import read_scene

        return read_scene(Path(path))

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML, whole or not at all.

        A scene that has the text of its MJCF, and no file, writes that beside it, with the suffix ``.xml``.

        Raises:
            OSError: A file cannot be written.
        """
        from paxisim.scene.toml import write_scene

        write_scene(self, Path(path))

    @classmethod
    def from_recording(cls, recording: Recording) -> Scene:
        """The scene by which `simulate` made a recording's simulated stream.

        Raises:
            InvalidValueError: The recording was not made by `simulate`.
        """
        from paxisim.scene.toml import parse_scene

        replayed, mjcf = recording.metadata.get("replay"), recording.metadata.get("scene")
        if not isinstance(replayed, dict) or not isinstance(mjcf, str) or "toml" not in replayed:
            raise InvalidValueError("the recording holds no scene: it was not made by Scene.simulate or paxisim replay")
        return replace(parse_scene(str(replayed["toml"])), mjcf=mjcf)
