"""A stage with a magnetic pad computed from first principles: a recording to diagnose, without a robot.

A ball presses and drags on one pad of 6x5 taxels in MuJoCo, along the motion of the protocol ``press``. The measured
stream is the reading of a manufactured unit of `paxisim.MagneticPad`, in counts of 0.1 N; the simulated stream is the
forces on a flat pad. The unit's surface is uneven, and the diagnosis fits none of the formulas of the pad.

    python examples/reference_robot.py --unit 7 --out robot.mcap
    paxisim diagnose robot.mcap -o diagnosis
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import tyro

import paxisim
from paxisim.protocols.ready import press
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))  # the size of a PaXini pad, pooled 2x2
RATE = 25.0  # Hz
COUNT = 0.1  # N


def recording(unit: int, episodes: int = 8, *, uneven: bool = True) -> paxisim.Recording:
    """Return the readings of a unit together with the forces on a flat pad.

    Args:
        unit: Number of the unit.
        episodes: Number of episodes of the protocol.
        uneven: Whether the unit has its uneven surface; otherwise it is flat as well.
    """
    pad = paxisim.MagneticPad.unit(LAYOUT, unit)
    stage, real = ready.indenter(LAYOUT), ready.indenter(LAYOUT, pad.heights if uneven else None)
    motion = press(stop_force=60.0).unrecorded(stage).select(range(episodes))
    simulated, felt = (scene.simulate(motion).resample(RATE).select(known=True) for scene in (stage, real))
    assert felt.simulated is not None
    read = pad.measure(felt.simulated[:, 0].astype(np.float64), np.random.default_rng(unit))[:, None]
    return replace(simulated, measured=(COUNT * np.rint(read / COUNT)).astype(np.float32))


def main(out: Path, unit: int = 7, episodes: int = 8, uneven: bool = True) -> None:
    """Write the recording.

    Args:
        out: Output file, .mcap.
        unit: Number of the manufactured unit.
        episodes: Number of episodes of the protocol, up to eight.
        uneven: Whether the unit has its uneven surface.
    """
    made = recording(unit, episodes, uneven=uneven)
    made.save(out)
    print(f"{out}: {made}")


if __name__ == "__main__":
    try:
        tyro.cli(main)
    except (paxisim.PaxisimError, OSError) as error:
        print(f"reference_robot: error: {error}", file=sys.stderr)
        sys.exit(2)
