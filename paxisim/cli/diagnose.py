"""``paxisim diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.output import check_folder, progress
from paxisim.cli.stages import Stages
from paxisim.errors import InvalidValueError, OutputExistsError

FILES = {
    "report.html": "the report with pictures, for a browser",
    "diagnosis.json": "all figures of the diagnosis",
    "model.json": "the extended sensor model",
    "fitted_scene.toml": "the scene with the values that were found",
    "fitted_scene.xml": "its MJCF",
}


def diagnose(
    recording: Annotated[Path, tyro.conf.Positional],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    scene: Path | None = None,
    causes: str = "",
    seed: int = 0,
    jobs: int = 1,
    force: bool = False,
) -> None:
    """Diagnose what the simulation gets wrong and why.

    The recording contains the measured and the simulated tensors of the same motion. The command writes report.html,
    the report with pictures; diagnosis.json, all figures; and model.json, the extended sensor model. If the two streams
    are not of the same motion, the exit status is 1 and there is no model.

    With --scene it also searches for causes inside the scene, such as friction or the place of a pad, by replaying the
    motion with other values of the scene's parameters. The recording then needs no simulated tensors.
    fitted_scene.toml and fitted_scene.xml are the scene with the fitted values.

    For example:

    paxisim diagnose recording.mcap -o diagnosis/

    paxisim diagnose recording.mcap --scene scene.toml -o diagnosis/ --jobs 2

    Args:
        recording: Recording with measured and simulated tensors (.mcap, .npz, .csv).
        output: Output folder; created if missing, but its parent must exist.
        scene: Scene file, .toml, as `paxisim replay` takes it.
        causes: Causes to search for, separated by commas; default: all. Those of the sensor are axis_gain,
            taxel_gain, offset, drift, stiffening, poisson, crosstalk, axis_coupling, rotation, layout, creep,
            hysteresis, low_pass, latency, saturation, dead_band, quantisation, dead_taxels, swapped_taxels,
            interference and channel_curve; those of the scene are friction, gel_stiffness, grip_force, mount_offset,
            mount_tilt, surface, object_size, object_pose and joint_offset.
        seed: Random seed.
        jobs: Number of processors to use.
        force: Overwrite an existing diagnosis in the folder.
    """
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
        if (output / name).exists():  # without the extra for the report there was a warning
            print(f"{output / name}: {what}")
    if found.verdict == "unrelated":
        raise SystemExit(1)


def _check_folder(folder: Path, force: bool) -> None:
    """Check the output folder before any work is done."""
    if folder.exists() and not folder.is_dir():
        raise InvalidValueError(f"the output must be a folder, {folder} is a file")
    check_folder(folder / "report.html" if folder.is_dir() else folder)
    for name in FILES:
        if (folder / name).exists() and not force:
            raise OutputExistsError(f"{folder / name} exists; --force overwrites it")
