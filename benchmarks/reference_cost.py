"""What a magnetic pad costs beside a fixed chain of GCS: ``python benchmarks/reference_cost.py``.

Two pads are read, frame by frame and in batches of 256, on one thread. The ratio is that of the best of five rounds.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy

import numpy as np

import paxisim

LAYOUTS = (paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5)), paxisim.TaxelLayout(12, 10, (2.2e-3, 2.2e-3)))
ROUNDS = 5


def best(call: Callable[[], object], count: int) -> float:
    """Microseconds of a call, the best of some rounds of `count` calls."""
    call()
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        for _ in range(count):
            call()
        times.append((time.perf_counter() - start) / count)
    return 1e6 * min(times)


def main() -> None:
    """Print the table."""
    print("pads      frames  magnetic pads   GCS chain   ratio")
    rng = np.random.default_rng(0)
    for layout in LAYOUTS:
        sensor, chain = paxisim.MagneticSensor(layout, unit=1), paxisim.GCS().sample(rng, layout=layout)
        for frames, count in ((1, 100), (256, 1)):
            force = rng.uniform(0, 0.5, (frames, 2, *layout.shape)).astype(np.float32)
            force = force[0] if frames == 1 else force
            own, other = (best(lambda t=t, force=force: t(force), count) / frames for t in (sensor, chain))
            size = f"2 x {layout.rows}x{layout.cols}"
            print(f"{size:<10}{frames:>6}  {own:>10.1f} us  {other:>8.1f} us  {own / other:>6.1f}")


if __name__ == "__main__":
    main()
