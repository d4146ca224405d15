"""Scene: a MuJoCo model with pads and the recorded streams that move it."""

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

    The pads have the sensor's taxels, or a whole number of finer taxels for each, whose forces are summed.

    Example:
        ```python
        scene = paxisim.Scene("press.xml", [paxisim.Drive("z", joint="z", unit="mm")])
        paired = scene.simulate(paxisim.Recording.load("press.mcap"))
        ```

    Attributes:
        mjcf: Path of the MJCF file, or its text. An episode begins at its first keyframe, if it has one.
        drives: The drives: which stream moves which part of the model.
        mode: How the motion is followed: see `paxisim.scene.modes.MODES`, which also states what each mode makes
            unobservable. ``"auto"`` is ``"fitted"`` where the opening of a gripper does not determine the force of a
            free object to a tenth, otherwise ``"kinematic"``.
        closing: The stream that presses or closes; modes ``"fitted"`` and ``"shape"`` add a constant to it.
        start: Start poses of objects at the beginning of an episode.
        settle: Time (s) for which the scene rests at the first pose before each episode.
        gel: Gel of the taxels.
        pads: Names of the MJCF's pads in the order of the recording's. Default: all, in the order of their bodies.
        sensor: Name of a sensor in the catalogue to attach to the model; empty if the MJCF already has pads.
        pool: Merge each `pool` x `pool` taxels of that sensor into one.
        mounts: Mounts of that sensor's pads. Default: as found by `paxisim.attach`.
        bounds: Lower and upper bounds of parameters by name, for a diagnosis; see `parameters` for the defaults.

    Raises:
        InvalidValueError: The mode does not exist, `settle` or `pool` is out of range, there is no drive, a part is
            driven twice, or a mode that fits the closing lacks a closing stream.
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
        """Replay the recorded motion and add the simulated stream to the recording.

        Each episode is simulated independently: the objects are placed, the scene rests for `settle` seconds at the
        first pose, then the streams move it, interpolated to the physics step with matching velocities and
        accelerations.

        Args:
            recording: Recording with the driving streams among its covariates.
            mode: Mode to use instead of the scene's.
            mean: Return the mean force since the previous sample, like a sensor that averages; default: the force at
                the sample's time.
            progress: Callback that is called with a line of text for each episode.
            parameters: Other values of the scene's parameters or its gel's fields, such as ``friction=0.6`` or
                ``mount_offset_x=5e-4``; see `parameters`.

        Returns:
            The recording with `simulated`, which is NaN before and after the driving streams. Its metadata hold the
            MJCF (``scene``) and a description of the replay (``replay``), from which `from_recording` restores the
            scene.

        Raises:
            InvalidValueError: The scene cannot follow a stream; the message says which, when, and what to do.
            UnknownNameError: A stream, joint, body, actuator or parameter does not exist.
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

        The arguments and errors are those of `simulate`.
        """
        from paxisim.scene.replay import Replay

        scene = self if mode is None else replace(self, mode=modes.checked(mode))
        return Replay(scene.with_parameters(**parameters), recording, mean)

    def parameters(self) -> dict[str, SceneParameter]:
        """Return the uncertain parameters of the scene by name, with their nominal values and bounds.

        Raises:
            InvalidValueError: Bounds exclude the nominal value, or the scene cannot be compiled.
            UnknownNameError: Bounds are given for a parameter that the scene does not have.
        """
        from paxisim.scene.parameters import parameters_of
        from paxisim.scene.rig import build_rig

        return parameters_of(self, build_rig(self))

    def with_parameters(self, **parameters: float) -> Scene:
        """Return the scene with other values of its parameters or of its gel's fields.

        Args:
            parameters: Values by name, as listed by `parameters`, or fields of `paxisim.Gel`.

        Raises:
            UnknownNameError: A parameter does not exist.
            InvalidValueError: A value cannot be used.
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
        """Read a scene from a TOML file; the MJCF path in it is relative to the file.

        Raises:
            InvalidValueError: The file is not valid; the message names the key.
            UnknownNameError: The file has an unknown key.
            FileNotFoundError: The file does not exist.
        """
        from paxisim.scene.toml import read_scene

        return read_scene(Path(path))

    def save(self, path: str | Path) -> None:
        """Write the scene as TOML, atomically.

        If the scene holds its MJCF as text instead of a path, the text is written beside it with the suffix ``.xml``.

        Raises:
            OSError: A file cannot be written.
        """
        from paxisim.scene.toml import write_scene

        write_scene(self, Path(path))

    @classmethod
    def from_recording(cls, recording: Recording, *, trusted: bool = False) -> Scene:
        """Return the scene with which `simulate` created a recording's simulated stream.

        Args:
            recording: The recording.
            trusted: Accept a model that names files, such as meshes, which MuJoCo would open, or that asks for an
                unusual amount of memory or time. Do so only for a recording of your own.

        Raises:
            InvalidValueError: The recording was not created by `simulate`, or its model needs trust.
        """
        from paxisim.models.untrusted import check_untrusted
        from paxisim.scene.toml import parse_scene

        replayed, mjcf = recording.metadata.get("replay"), recording.metadata.get("scene")
        if not isinstance(replayed, dict) or not isinstance(mjcf, str) or "toml" not in replayed:
            raise InvalidValueError("the recording holds no scene: it is not from Scene.simulate or paxisim replay")
        if not trusted:
            check_untrusted(mjcf, "the recording")
        return replace(parse_scene(str(replayed["toml"])), mjcf=mjcf)
