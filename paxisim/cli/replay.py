"""The ``paxisim replay`` command."""

from __future__ import annotations

import contextlib
import shutil
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, check_output, named_after, progress
from paxisim.cli.plot import print_film
from paxisim.cli.stages import Stages
from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    from paxisim.recording import Recording
    from paxisim.scene.replay import Replay


def replay(
    recording: Annotated[Path, tyro.conf.Positional],
    *,
    scene: Path,
    streams: tuple[Path, ...] = (),
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    mode: Literal["auto", "kinematic", "fitted", "shape", "servo", "force"] | None = None,
    mean: bool = False,
    align_clocks: bool = False,
    place_objects: bool = False,
    jobs: int = 1,
    film: Path | None = None,
    force: bool = False,
) -> None:
    """Replay a recorded motion in MuJoCo and write measured and simulated forces side by side.

    The scene file states which recorded stream moves which part of the model; `paxisim scene init` writes a first
    version. The output also contains the scene and its MJCF. If the command is interrupted, run it again: it resumes
    after the last finished episode.

    Instead of a recording, the command also takes a motion of `paxisim protocol`. It then simulates the recording that
    a robot would make.

    For example:

    paxisim replay press.mcap --scene press.toml -o paired.mcap

    paxisim replay press.mcap --scene press.toml -o paired.mcap --film replay.mp4

    Args:
        recording: Recording with the streams that drive the scene (.mcap, .npz, .csv), or a motion (.json).
        scene: Scene file, .toml.
        streams: Files with more streams of the same motion, such as the robot's log; as for `paxisim convert`.
        output: Output file, .mcap or .npz; default: the name of the recording, with -replayed.mcap.
        mode: How the scene follows the motion; default: as the scene file states.
            auto: fitted if the opening of the gripper does not determine the force, else kinematic.
            kinematic: exact poses.
            fitted: exact poses, with a closing offset fitted to the measured force.
            shape: as fitted, but only to the time course of the force.
            servo: the actuators of the model follow the recorded positions or commands.
            force: the actuators exert the recorded forces.
        mean: Simulate the mean force since the previous sample, as a sensor that averages measures it.
        align_clocks: First move the driving streams of each episode to the clock of the sensor, if a robot and a sensor
            with clocks of their own were recorded. The latency of the sensor then cannot be determined any more.
        place_objects: First find where the free object stands in each grasp, from how its force is distributed over the
            taxels. Each grasp becomes an episode.
        jobs: Number of episodes to simulate in parallel.
        film: Film of the scene beside the pads of both streams, .mp4, .gif or .webp; in real time, for up to 60 s.
            Without a display, it needs MUJOCO_GL=egl or MUJOCO_GL=osmesa.
        force: Overwrite the outputs if they exist.
    """
    from dataclasses import replace
    from math import degrees

    from paxisim.protocols.protocol import Protocol
    from paxisim.recording import Recording
    from paxisim.scene.agreement import compare_streams
    from paxisim.scene.clocks import align_clocks as align
    from paxisim.scene.placing import place_objects as place
    from paxisim.scene.resume import simulate_resumable
    from paxisim.scene.scene import Scene

    output = named_after(recording, "-replayed.mcap") if output is None else output
    if output.suffix.lower() not in (".mcap", ".npz"):
        raise InvalidValueError(f"the output must end in .mcap or .npz, got {output}")
    check_output(output, force)
    if film is not None:
        from paxisim.viz.film import check_film
        from paxisim.viz.film_scene import check_renderer

        check_film(film)
        check_output(film, force)
        check_renderer()
    loaded_scene = Scene.load(scene)
    if mode is not None:
        loaded_scene = replace(loaded_scene, mode=mode)
    progress(f"reading {recording}")
    protocol = Protocol.load(recording) if recording.suffix.lower() == ".json" else None
    if protocol is not None and streams:
        raise InvalidValueError("--streams adds to a recording, but the motion of a protocol is complete: leave it out")
    loaded = Recording.load(recording, streams=streams) if protocol is None else protocol.unrecorded(loaded_scene)
    if film is not None and loaded.measured is not None and loaded.unit != "N":
        raise InvalidValueError(
            f"--film shows both streams on one scale, but measured is in {loaded.unit}: convert it with paxisim "
            "calibrate, or leave --film out"
        )
    lags = None
    if align_clocks:
        loaded, lags = align(loaded_scene, loaded, progress)
    places = ()
    if place_objects:
        loaded_scene, loaded, places = place(loaded_scene, loaded, progress)
    kept = output.with_name(f".{output.name}.episodes")
    try:
        paired = simulate_resumable(loaded_scene, loaded, kept, mean=mean, jobs=jobs, progress=_say)
    except BaseException:
        with contextlib.suppress(OSError):  # there is no folder, or it has finished episodes
            kept.rmdir()
        raise
    progress(f"writing {output}")
    paired.save(output)
    seconds = None if film is None else _film(film, loaded_scene.prepare(loaded, mean=mean), kept, paired)
    shutil.rmtree(kept)
    print(textwrap.fill(f"{output}: {paired!r}", TERMINAL_COLUMNS, subsequent_indent="  ", break_on_hyphens=False))
    if film is not None and seconds is not None:
        print_film(film, paired, seconds)
    _print_how(paired)
    if lags is not None:
        moved = ", ".join(f"{lag.episode}: {1e3 * lag.seconds:+.0f}" for lag in lags.lags)
        said = f"Streams delayed to the clock of the sensor, by episode (ms): {moved}"
        print(textwrap.fill(said, TERMINAL_COLUMNS, subsequent_indent="  "))
    for item in places:
        said = f"{1e3 * item.shift:+.2f} mm, {degrees(item.turn):+.2f} deg"
        unlike = f"distribution of the force off by {item.before:.0%}, now {item.after:.0%}"
        print(f"  grasp {item.episode} placed by {said}: {unlike}")
    if paired.measured is not None and paired.unit != "N":
        print(
            f"measured is in {paired.unit}, so it is not compared with the simulated newtons: convert it with "
            "paxisim calibrate"
        )
    elif paired.measured is not None:
        print()
        print(compare_streams(paired))
    if protocol is not None:
        _print_peaks(paired, protocol.stop_force)


def _film(path: Path, replay: Replay, kept: Path, paired: Recording) -> float:
    """Film the episodes that the replay has kept in a folder; return the length of the film (s)."""
    from paxisim.scene.cache import EpisodeCache
    from paxisim.viz.film import film_replay

    cache = EpisodeCache(kept)
    episodes = [cache.run(replay, number) for number in replay.episodes]
    with Stages() as stages:
        return film_replay(path, replay, episodes, paired, lambda share: stages("filming", share))


def _print_peaks(rehearsed, stop_force: float) -> None:
    from paxisim.protocols.protocol import peak_forces

    for pad, peak in peak_forces(rehearsed).items():
        print(f"{pad}: total normal force up to {peak:.3g} N, the protocol stops at {stop_force:g} N")
        if peak > stop_force:
            print(
                f"paxisim: warning: {pad} would be stopped: write the protocol with less --depth-mm, or with a larger "
                "--stop-n if the sensor withstands it",
                file=sys.stderr,
            )


def _say(done: int, count: int, before: int) -> None:
    kept = f", {before} from an earlier run" if before else ""
    progress(f"simulated {done} of {count} episode{'s' * (count != 1)}{kept}")


def _print_how(paired) -> None:
    how = paired.metadata["replay"]
    print(f"mode {how['mode']}")
    if how["not_testable"]:
        print(f"  makes unobservable: {', '.join(how['not_testable'])}")
    if closing := how.get("closing"):
        values = "; ".join(f"{number}: {', '.join(f'{v:+.4g}' for v in own)}" for number, own in closing.items())
        said = f"  closing added, by episode and grasp: {values}"
        print(textwrap.fill(said, TERMINAL_COLUMNS, subsequent_indent="    "))
    for stream, step in how["encoder_steps"].items():
        print(f"  {stream} was smoothed within its steps of {step:.4g}")
    if how["in_doubt"]:
        print(f"In doubt, and left out: {how['in_doubt']:.1%} of the samples")
    for doubt in how["doubts"][:8]:
        print(textwrap.fill(f"  {doubt}", TERMINAL_COLUMNS, subsequent_indent="    "))
    if len(how["doubts"]) > 8:
        print(f"  and {len(how['doubts']) - 8} more")
    for note in how["notes"]:
        print(f"paxisim: warning: {note}", file=sys.stderr)
