"""The ``paxisim diagnose`` command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.output import check_folder, check_no_file, progress
from paxisim.cli.several import diagnose_each
from paxisim.cli.stages import Stages
from paxisim.errors import InvalidValueError, OutputExistsError

FILES = {
    "report.html": "the report with pictures, for a browser",
    "diagnosis.json": "all numbers of the diagnosis",
    "model.json": "the extended sensor model",
    "fitted_scene.toml": "the scene with the fitted values",
    "fitted_scene.xml": "its MJCF",
}


def diagnose(
    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PATH [PATH ...]")],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    scene: Path | None = None,
    causes: str = "",
    seed: int = 0,
    jobs: int = 1,
    force: bool = False,
) -> None:
    """Find out where and why a simulation differs from the real sensor.

    The recording holds measured and simulated tensors of the same motion. The command writes report.html (report with
    pictures), diagnosis.json (all numbers) and model.json (extended sensor model). If the two tensors are not of the
    same motion, it writes no model and exits with status 1.

    With --scene, the command also searches for causes inside the scene, such as friction or the position of a pad. It
    replays the motion with other values of the scene's parameters, so the recording needs no simulated tensors. It
    writes the scene with the fitted values to fitted_scene.toml and fitted_scene.xml.

    Several recordings are diagnosed in processes of their own, each into the folder of its name within the output. One
    that fails stops no other; the status is then 2.

    For example:

    paxisim diagnose recording.mcap -o diagnosis/

    paxisim diagnose recording.mcap --scene scene.toml -o diagnosis/ --jobs 2

    paxisim diagnose monday.mcap tuesday.mcap -o diagnoses/ --jobs 2

    Args:
        recordings: Recordings with measured and simulated tensors (.mcap, .npz, .csv).
        output: Output folder; created if missing, but its parent must exist.
        scene: Scene file, .toml, as for `paxisim replay`.
        causes: Causes to search for, separated by commas; default: all.
            Sensor causes: axis_gain, taxel_gain, offset, drift,
            stiffening, poisson, crosstalk, axis_coupling,
            rotation, layout, creep, hysteresis, low_pass,
            latency, saturation, dead_band, quantisation,
            dead_taxels, swapped_taxels, interference,
            channel_curve.
            Scene causes: friction, gel_stiffness, grip_force,
            mount_offset, mount_tilt, surface, object_size,
            object_pose, joint_offset.
        seed: Random seed.
        jobs: Number of parallel processes, over all recordings.
        force: Overwrite an existing diagnosis in the folder.
    """
    if len(recordings) == 0:
        raise InvalidValueError("expected a recording to diagnose, such as recording.mcap")
    if len(recordings) > 1:
        options = ["--causes", causes, "--seed", str(seed), *(["--force"] if force else [])]
        diagnose_each(recordings, output, options if scene is None else [*options, "--scene", str(scene)], jobs)
        return
    recording = recordings[0]
    from paxisim.diagnose.run import diagnose as run
    from paxisim.recording import Recording
    from paxisim.scene.scene import Scene

    names = [name.strip() for name in causes.split(",") if name.strip()] or None
    _check_folder(output, force)
    progress(f"reading {recording}")
    loaded = Recording.load(recording)
    inside = None if scene is None else Scene.load(scene)
    with Stages() as stages:
        found = run(loaded, names, scene=inside, seed=seed, jobs=jobs, progress=stages)
    _check_folder(output, force)
    progress("drawing the report")
    found.save(output)
    print(found)
    print()
    for name, what in FILES.items():
        if (output / name).exists():  # there is no report without the extra `diagnose`
            print(f"{output / name}: {what}")
    if found.verdict == "unrelated":
        raise SystemExit(1)


def _check_folder(folder: Path, force: bool) -> None:
    """Check the output folder before any work is done."""
    check_no_file(folder)
    check_folder(folder / "report.html" if folder.is_dir() else folder)
    for name in FILES:
        if (folder / name).exists() and not force:
            raise OutputExistsError(f"{folder / name} exists; --force overwrites it")
