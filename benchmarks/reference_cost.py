"""Cost of a magnetic pad compared with a fixed GCS chain: ``python benchmarks/reference_cost.py``.

Two pads are read frame by frame and in batches of 256, in float32 on one thread, with and without the gel's memory and
the neighbour's magnets. The times are processor times, the best of 50 rounds. The script also prints how long it takes
to make the first unit of a layout and a further one.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import numpy as np

import paxisim

LAYOUTS = (paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5)), paxisim.TaxelLayout(12, 10, (2.2e-3, 2.2e-3)))
SENSORS = ("unit:1", "unit:1+memory", "unit:1+memory+neighbour")
OPENING = {"gripper_opening": 0.02}
ROUNDS = 50


def best(call: Callable[[], object], count: int) -> float:
    """Return the microseconds of a call, the best of `ROUNDS` rounds of `count` calls."""
    call()
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()  # excludes the time of other processes
        for _ in range(count):
            call()
        times.append((time.process_time() - start) / count)
    return 1e6 * min(times)


def stepped(transform: paxisim.augment.Transform, force: np.ndarray, count: int) -> float:
    """Return the microseconds of a step of a stream, or of a batch of streams."""
    state = transform.initial_state(force, OPENING)
    return best(lambda: transform.step(force, state, 0.02, OPENING), count)


def seconds(call: Callable[[], object]) -> float:
    """Return the processor seconds of one call."""
    start = time.process_time()
    call()
    return time.process_time() - start


def main() -> None:
    """Print the tables."""
    rng = np.random.default_rng(0)
    for layout in LAYOUTS:
        first, more = (seconds(lambda seed=seed, at=layout: paxisim.MagneticPad.unit(at, seed)) for seed in (0, 1))
        print(f"{layout.rows}x{layout.cols}: the first unit takes {first:.2f} s, a further one {more:.3f} s")
    print(f"{'pads':<10}{'frames':>6}  {'sensor':<24}{'magnetic pads':>14}{'GCS chain':>12}{'ratio':>8}")
    for layout in LAYOUTS:
        chain = paxisim.GCS().sample(rng, layout=layout)
        for frames, count in ((1, 5), (256, 1)):
            force = rng.uniform(0, 0.5, (frames, 2, *layout.shape)).astype(np.float32)
            force = force[0] if frames == 1 else force
            other = stepped(chain, force, count) / frames
            for name in SENSORS:
                own = stepped(paxisim.reference_sensor(name)(layout), force, count) / frames
                size = f"2 x {layout.rows}x{layout.cols}"
                print(f"{size:<10}{frames:>6}  {name:<24}{own:>11.1f} us{other:>9.1f} us{own / other:>8.1f}")


if __name__ == "__main__":
    main()
