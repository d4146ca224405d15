"""The ``paxisim scene init`` command."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, check_output, png, progress, write_output

if TYPE_CHECKING:
    from paxisim.recording import Recording
    from paxisim.scene.scene import Scene

_GAP = 2  # spaces between the columns of a table


def scene_init(
    model: Annotated[Path, tyro.conf.Positional],
    recording: Annotated[Path, tyro.conf.Positional],
    *,
    streams: tuple[Path, ...] = (),
    opening: str = "",
    quaternion: Literal["wxyz", "xyzw"] | None = None,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    picture: Path | None = None,
    force: bool = False,
) -> None:
    """Write a first version of the scene file for a recording.

    A scene file states which recorded stream moves which joint, body or actuator of a model with pads. The command
    guesses this from the names, ranges and encoder steps of the streams. It prints what to check, and repeats the list
    at the top of the file.

    For example:

    paxisim scene init gripper.xml squeeze.mcap -o squeeze.toml

    paxisim scene init scene.xml squeeze.mcap --streams robot.csv -o squeeze.toml --picture contact.png

    Args:
        model: MJCF file with pads, as `paxisim attach` writes it.
        recording: Recording to replay.
        streams: Files with more streams of the same motion, such as the robot's log; as for `paxisim convert`.
        opening: Stream that is the opening of the gripper, the distance between its pads; default: as its name says.
        quaternion: Order of the quaternions of poses given as position and quaternion.
        output: Output file, .toml; default: the name of the model, with .toml.
        picture: Picture of the scene when the measured normal force first exceeds 0.2 N, .png.
        force: Overwrite the outputs if they exist.
    """
    import os

    from paxisim.recording import Recording
    from paxisim.scene.guess import guess_scene
    from paxisim.scene.toml import format_scene

    path = model.with_suffix(".toml") if output is None else output
    check_output(path, force, ".toml")
    if picture is not None:
        check_output(picture, force, ".png")
    progress(f"reading {recording}")
    loaded = Recording.load(recording, streams=streams)
    guessed = guess_scene(model, loaded, opening, quaternion or "")
    contact = None if picture is None else _first_contact(guessed.scene, loaded)
    relative = Path(os.path.relpath(model.absolute(), path.absolute().parent)).as_posix()
    comments = [f"# {line}" for line in ("Which recorded stream moves what. To check:", *guessed.open)]
    write_output(path, "\n".join(comments) + "\n" + format_scene(guessed.scene, relative), force)
    if picture is not None and contact is not None:
        write_output(picture, contact[0], force)
    for line in guessed.found:
        print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent="  "))
    for line in guessed.open:
        print(textwrap.fill(f"to check: {line}", TERMINAL_COLUMNS, subsequent_indent="  "))
    print()
    print(_table(guessed.scene, loaded))
    if contact is not None:
        print(f"{picture}: {contact[1]}")
    print(f"{path}: {len(guessed.scene.drives)} drives")


def _first_contact(scene: Scene, recording: Recording) -> tuple[bytes, str]:
    """Return a picture of the scene at the first contact as PNG, and when that is.

    Raises:
        InvalidValueError: The recording has no forces in newtons, or none that means contact.
    """
    import numpy as np

    from paxisim.errors import InvalidValueError
    from paxisim.scene.closing import total_normal
    from paxisim.scene.replay import CONTACT_FORCE, Replay
    from paxisim.viz.scene_picture import plot_scene

    if recording.measured is None or recording.unit != "N":
        has = "has none" if recording.measured is None else f"is in {recording.unit}"
        raise InvalidValueError(
            f"--picture needs measured forces in newtons, but the recording {has}: convert it with paxisim calibrate, "
            "or leave --picture out"
        )
    force = total_normal(recording.measured)
    above = np.flatnonzero(force > CONTACT_FORCE)
    if not len(above):
        raise InvalidValueError(
            f"--picture shows the first contact, but the total normal force never exceeds {CONTACT_FORCE:g} N (it "
            f"reaches {np.nanmax(force, initial=0.0):.3g} N): leave --picture out"
        )
    first = int(above[0])
    progress("simulating the first contact")
    replay = Replay(scene, recording)
    when = f"the first contact, {force[first]:.2g} N at {recording.time[first]:.2f} s"
    figure = plot_scene(replay.rig.model, replay.rig.pads, replay.pose(first), when)
    return png(figure), when


def _table(scene: Scene, recording: Recording) -> str:
    """Return a table of the drives: stream, joint or body, unit and range."""
    import numpy as np

    from paxisim.scene.poses import as_poses
    from paxisim.scene.streams import known_samples

    rows = [("stream", "moves", "unit", "range")]
    for drive in scene.drives:
        values = recording.covariates[drive.stream]
        if drive.body:  # its position
            values = as_poses(values[known_samples(values)], drive.quaternion, drive.stream)[:, :3]
        span = f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
        rows.append((drive.source, drive.target, drive.unit, span))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    most = (TERMINAL_COLUMNS - sum(widths[2:]) - 3 * _GAP) // 2
    if sum(widths[:2]) > 2 * most:
        widths[:2] = [most, most]
    lines = [
        (" " * _GAP).join(_short(cell, width).ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def _short(text: str, width: int) -> str:
    """Shorten a name to its end, which tells it from others."""
    return text if len(text) <= width else "..." + text[len(text) - width + 3 :]
