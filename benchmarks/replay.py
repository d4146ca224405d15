"""Accuracy and speed of replaying a recorded motion, and the causes that a diagnosis then names.

    python benchmarks/replay.py [--rigs 10] [--first 0] [--deep] [--exact]

The real stage is an indenter in MuJoCo, moved by servos, on one pad of 6x5 taxels with a gel of 600 kPa. In each of six
episodes it presses to a depth drawn from 0.8 to 1.4 mm, at two places drawn within 3 x 4 mm of the centre. Its joints
are recorded in encoder steps of 0.05 mm at 100 Hz. Its sensor reads 0.8 of the force, 80 ms late, with 0.02 N of noise.
The recording is replayed in the default mode and diagnosed, and the forces of the replay are compared with those of the
stage. With --exact it is also diagnosed against the stage's own forces, which an exact replay would give.

The deep rigs press to 1.8 to 2.1 mm, where the gel is so stiff that half an encoder step corresponds to a tenth of the
force or more.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "scene"))

from rigs import LAYOUT, press, recording, simulated_press, steps_of, total, with_servos

import paxisim
from paxisim.scene import ready

HIDDEN = paxisim.Chain([paxisim.augment.AxisGain((0.8, 0.8, 0.8)), paxisim.augment.Latency(0.08)])
EPISODES = 6
SHALLOW, DEEP = (0.8e-3, 1.4e-3), (1.8e-3, 2.1e-3)
GEL = paxisim.Gel(modulus=600e3)


def rig(seed: int, depths: tuple[float, float] = SHALLOW) -> tuple[paxisim.Recording, np.ndarray]:
    """Return a recording of the stage and the forces on its pad; `depths` (m) bound the depth of a press."""
    rng = np.random.default_rng(seed)
    parts, forces = [], []
    for number in range(EPISODES):
        time, streams = press(depth=rng.uniform(*depths))
        streams = {"x": streams["x"] * rng.uniform(-1, 1), "y": streams["y"] * rng.uniform(-1, 1), **_rest(streams)}
        force, joints = simulated_press(_stage(), time, streams, gel=GEL)
        read = HIDDEN.run(force, time) + rng.normal(0, 0.02, force.shape)
        covariates = dict(zip(streams, steps_of(joints).T, strict=True))
        episode = np.full(len(time), number)
        parts.append(recording(time, covariates, measured=read.astype(np.float32), episode=episode))
        forces.append(force)
    return paxisim.Recording.concatenate(parts), np.concatenate(forces)


def _stage() -> str:
    """Return the indenter's MJCF with stiff servos, so that neither weight nor contact displaces the ball much."""
    mjcf = with_servos(ready.indenter(LAYOUT)).replace('kp="20000" kv="400"', 'kp="100000" kv="900"')
    return mjcf.replace('<body name="ball"', '<body name="ball" gravcomp="1"')


def _rest(streams: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: values for name, values in streams.items() if name not in ("x", "y")}


def named(recording: paxisim.Recording) -> str:
    """Return the verdict and the names of the causes as text."""
    sys.modules.update(dict.fromkeys(("sklearn", "sklearn.ensemble")))  # skip the black box: slow, and names nothing
    found = paxisim.diagnose(recording)
    return f"{found.verdict}: {', '.join(sorted(cause.name for cause in found.causes)) or 'nothing'}"


def main() -> None:
    """Print one line per rig."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=10, help="number of rigs to draw")
    parser.add_argument("--first", type=int, default=0, help="random seed of the first rig; the seeds are consecutive")
    parser.add_argument("--deep", action="store_true", help="press to depths at which the gel is stiff")
    parser.add_argument("--exact", action="store_true", help="also diagnose the result of an exact replay")
    arguments = parser.parse_args()
    scene = ready.indenter(LAYOUT)
    hits = dict.fromkeys(["replayed", "exact"] if arguments.exact else ["replayed"], 0)
    for seed in range(arguments.first, arguments.first + arguments.rigs):
        given, force = rig(seed, DEEP if arguments.deep else SHALLOW)
        began = perf_counter()
        paired = scene.simulate(given, modulus=GEL.modulus)
        seconds = perf_counter() - began
        off = total(paired.simulated).max() / total(force).max() - 1
        said = any("encoder" in note for note in paired.metadata["replay"]["notes"])
        print(
            f"rig {seed}: peak of {total(force).max():.1f} N {off:+.1%}{' (reported)' if said else ''}; "
            f"{len(given.time) / 100:.0f} s replayed in {seconds:.1f} s",
            flush=True,
        )
        pairs = {"replayed": paired, "exact": given.with_simulated(force.astype(np.float32))}
        for name in hits:
            words = named(pairs[name])
            hits[name] += words.endswith(": axis_gain, latency")
            print(f"  {name}: {words}", flush=True)
    for name, count in hits.items():
        print(f"{name}: exactly axis_gain and latency in {count} of {arguments.rigs}")


if __name__ == "__main__":
    main()
