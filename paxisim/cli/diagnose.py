"""The ``paxisim diagnose`` command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.diagnosis_files import FILES, check_diagnosis_folder
from paxisim.cli.output import named_after, progress
from paxisim.cli.several import diagnose_each
from paxisim.cli.stages import Stages
from paxisim.errors import InvalidValueError


def diagnose(
    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PATH [PATH ...]")],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    scene: Path | None = None,
    sensor: Path | None = None,
    causes: Annotated[str, tyro.conf.arg(aliases=["--only"])] = "",
    seed: int = 0,
    jobs: int = 1,
    ray: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="[ADDRESS]")] = None,
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
    that fails stops no other; the status is then 2. With --ray, the nodes of a Ray cluster work on them instead of this
    machine, one core each. A recording whose node is killed is started again on another one.

    For example:

    paxisim diagnose recording.mcap -o diagnosis/

    paxisim diagnose recording.mcap --scene scene.toml -o diagnosis/ --jobs 2

    paxisim diagnose monday.mcap tuesday.mcap -o diagnoses/ --jobs 2

    paxisim diagnose monday.mcap tuesday.mcap -o /shared/diagnoses/ --ray head-node:6379

    Args:
        recordings: Recordings with measured and simulated tensors (.mcap, .npz, .csv).
        output: Output folder; created if missing, but its parent must exist. Default: the name of the recording, with
            -diagnosis; of several recordings, diagnoses.
        scene: Scene file, .toml, as for `paxisim replay`.
        sensor: Model of the sensor known beforehand, .json: the model.json of a diagnosis of the same unit, or a chain
            of your own. What its gel and magnets do is taken as known.
        causes: Causes to search for, separated by commas; default: all but those of a known sensor. With --scene, fewer
            causes need fewer replays.
            Sensor causes: axis_gain, taxel_gain, offset, drift,
            stiffening, gel_operator, axis_coupling, rotation,
            layout, creep, hysteresis, low_pass,
            latency, saturation, dead_band, quantisation,
            dead_taxels, swapped_taxels, interference,
            channel_curve.
            Scene causes: friction, gel_stiffness, grip_force,
            mount_offset, mount_tilt, surface, object_size,
            object_pose, joint_offset, base_pose, hand_pose.
        seed: Random seed.
        jobs: Number of parallel processes, over all recordings.
        ray: Diagnose several recordings on a running Ray cluster: HOST:PORT of its head; without an address, the
            cluster that this machine belongs to. All nodes must see the recordings and the output folder. Needs the
            extra `ray`.
        force: Overwrite an existing diagnosis in the folder.
    """
    if len(recordings) == 0:
        raise InvalidValueError("expected a recording to diagnose, such as recording.mcap")
    address = _address(ray, jobs, len(recordings))
    if output is None:
        output = named_after(recordings[0], "-diagnosis") if len(recordings) == 1 else Path("diagnoses")
    if len(recordings) > 1:
        options = ["--causes", causes, "--seed", str(seed)]
        options += [] if sensor is None else ["--sensor", str(sensor.absolute())]
        options += [] if scene is None else ["--scene", str(scene.absolute())]
        diagnose_each(recordings, output, options, force=force, jobs=jobs, ray=address)
        return
    recording = recordings[0]
    from paxisim.augment.chain import Chain
    from paxisim.diagnose.pipeline import diagnose as run
    from paxisim.recording import Recording
    from paxisim.scene.scene import Scene

    names = [name.strip() for name in causes.split(",") if name.strip()] or None
    check_diagnosis_folder(output, force)
    progress(f"reading {recording}")
    loaded = Recording.load(recording)
    inside = None if scene is None else Scene.load(scene)
    known = None if sensor is None else Chain.load(sensor)
    with Stages() as stages:
        found = run(loaded, names, scene=inside, sensor=known, seed=seed, jobs=jobs, progress=stages)
    check_diagnosis_folder(output, force)
    progress("drawing the report")
    found.save(output)
    print(found)
    print()
    for name, what in FILES.items():
        if (output / name).exists():  # there is no report without the extra `diagnose`
            print(f"{output / name}: {what}")
    if found.verdict == "unrelated":
        raise SystemExit(1)


def _address(ray: tuple[str, ...] | None, jobs: int, recordings: int) -> str | None:
    """Return the address of the Ray cluster; None for this machine."""
    if ray is None:
        return None
    if jobs != 1:
        raise InvalidValueError("expected one of --jobs and --ray: on Ray, each core of the cluster has a recording")
    if len(ray) > 1:
        raise InvalidValueError(f"expected one address after --ray, got {' '.join(ray)}")
    if recordings == 1:
        raise InvalidValueError("expected several recordings with --ray, got one: leave --ray out")
    return ray[0] if ray else "auto"
