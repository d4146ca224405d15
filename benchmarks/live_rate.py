"""Rate and CPU share of the live view, and its effect on the reader's latency. Two 12x10 pads, into an .rrd file.

A separate process writes a timestamp into a pipe 100 times per second. The reader blocks on the pipe, as a driver does
on its port, and measures the latency, with and without a view in the same process.

    python benchmarks/live_rate.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from paxisim.layout import TaxelLayout
from paxisim.viz.live import LiveView

LAYOUT = TaxelLayout(12, 10, (26.1e-3 / 12, 22.6e-3 / 10))
PADS = ("left", "right")
HZ = 100.0
SECONDS = 10.0
WRITER = f"""
import os, struct, time
due = time.monotonic()
for _ in range({int(HZ * SECONDS)}):
    due += 1 / {HZ}
    time.sleep(max(0.0, due - time.monotonic()))
    os.write(1, struct.pack("d", time.monotonic()))
"""


def readings(count: int) -> np.ndarray:
    """Make ``(count, 2, 3, 12, 10)`` newtons: a periodic press on half of the taxels, with shear."""
    force = np.zeros((2, 3, 12, 10), dtype=np.float32)
    force[:, :, 3:9] = np.random.default_rng(0).uniform(-1, 1, (2, 3, 6, 10))
    force[:, 2] = np.abs(force[:, 2]) * 5
    return force * np.sin(np.arange(count) * 0.05, dtype=np.float32)[:, None, None, None, None] ** 2


def fastest(folder: Path, both: bool) -> str:
    """Draw every reading in order, and return rate and size as text."""
    forces = readings(1000)
    tensors = ("measured", "simulated") if both else ("measured",)
    path = folder / "fastest.rrd"
    start = time.perf_counter()
    with LiveView(LAYOUT, PADS, tensors, save=path, fps=None) as view:
        for i, force in enumerate(forces):
            view.show(i / HZ, force, 0.9 * force if both else None, wait=True)
    seconds = time.perf_counter() - start
    size = path.stat().st_size / len(forces) / 1e3
    return f"{view.drawn / seconds:6.0f} drawn per second, {size:5.1f} kB each"


def latency(show: Callable[[float, np.ndarray], None]) -> str:
    """Measure the reader's latency (ms) and the process's share of a core, and return both as text."""
    forces = readings(int(HZ * SECONDS))
    late = []
    with subprocess.Popen([sys.executable, "-c", WRITER], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        cpu, start = time.process_time(), time.perf_counter()
        for force in forces:
            written = float(np.frombuffer(os.read(writer.stdout.fileno(), 8))[0])
            got = time.monotonic()
            late.append(1e3 * (got - written))
            show(got, force)
        share = (time.process_time() - cpu) / (time.perf_counter() - start)
    median, high = np.percentile(late, [50, 99])
    return (
        f"late by {median:.2f} ms median, {high:.2f} at 99 %, {max(late):.2f} at most; {100 * share:4.1f} % of a core"
    )


def main() -> None:
    """Measure and print."""
    import rerun

    print(f"rerun {rerun.__version__}, numpy {np.__version__}, Python {sys.version.split()[0]}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(f"full speed, measured               {fastest(folder, both=False)}")
        print(f"full speed, with simulated         {fastest(folder, both=True)}")
        print(f"reader alone at {HZ:g} Hz            {latency(lambda at, force: None)}")
        for both in (False, True):
            tensors = ("measured", "simulated") if both else ("measured",)
            with LiveView(LAYOUT, PADS, tensors, save=folder / f"{both}.rrd") as view:
                seen = latency(lambda at, force, view=view, both=both: view.show(at, force, force if both else None))
            print(f"{'with simulated' if both else 'reader and view':15} at {HZ:g} Hz         {seen}")
            print(f"  {view.drawn} of {view.shown} drawn")


if __name__ == "__main__":
    main()
