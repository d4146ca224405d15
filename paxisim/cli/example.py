"""The ``paxisim example`` command."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.output import check_output, write_output
from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    from paxisim.recording import Recording

_NAMES = {"gripper": "my_gripper.xml", "recording": "paired.mcap"}
GAIN, DELAY = 0.9, 0.04  # errors of the example's sensor: gain of the normal force, and delay (s)


def example(
    kind: Annotated[Literal["gripper", "recording"], tyro.conf.Positional],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    force: bool = False,
) -> None:
    """Write an example file for the other commands: a gripper, or a recording to diagnose.

    The gripper is a small parallel gripper without pads, for `paxisim attach`. The recording, for `paxisim diagnose`,
    holds simulated tensors and those of a made-up sensor, which reads 10 % too little normal force, 40 ms late.

    For example:

    paxisim example gripper

    paxisim example recording -o paired.mcap

    Args:
        kind: What to write.
        output: Output file; default: my_gripper.xml or paired.mcap.
        force: Overwrite the output if it exists.
    """
    path = Path(_NAMES[kind]) if output is None else output
    if kind == "gripper":
        from importlib.resources import files

        check_output(path, force, ".xml")
        write_output(path, files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8"), force)
        print(f"{path}: a parallel gripper without pads; next:")
        into = shlex.quote(str(path.with_name("tactile_gripper.xml")))
        print(f"paxisim attach {shlex.quote(str(path))} --sensor paxini-gen1-l4629 --pool 2 -o {into}")
        return
    if path.suffix.lower() not in (".mcap", ".npz"):
        raise InvalidValueError(f"the output must end in .mcap or .npz, got {path}")
    check_output(path, force)
    made = example_recording()
    made.save(path)
    print(f"{path}: {made}\nnext: paxisim diagnose {path} -o diagnosis/")


def example_recording() -> Recording:
    """Return a minute of presses that drag on two pads: simulated, and measured by a sensor with errors."""
    import numpy as np

    import paxisim
    from paxisim.augment import AxisGain, Latency

    rng = np.random.default_rng(0)
    time = np.arange(0, 60, 0.05)
    load = np.clip(6 * np.sin(1.3 * time) * np.sin(0.21 * time), 0, None)  # N; presses of varying force
    drag = np.stack([0.3 * np.sin(2.1 * time), 0.3 * np.cos(1.7 * time), np.ones_like(time)], axis=1)
    simulated = load[:, None, None, None, None] * drag[:, None, :, None, None] * rng.uniform(0.2, 1, (2, 1, 6, 5))
    sensor = paxisim.Chain([AxisGain((1.0, 1.0, GAIN)), Latency(DELAY)])
    measured = sensor.run(simulated, time) + rng.normal(0, 0.03, simulated.shape)
    layout = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    return paxisim.Recording(time=time, measured=measured, simulated=simulated, layout=layout, pads=("left", "right"))
