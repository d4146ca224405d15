"""Time and memory to load a recording of 20 minutes: ``python benchmarks/recording_load.py``.

The recording has two pads of 12x10 taxels at 100 Hz: 120,000 messages of 720 numbers. It holds either values as from a
board, counts of 0.1 N with most taxels unloaded, or random float32 numbers. The lower bound is the cost of reading the
bytes and decompressing the chunks. Loading runs in a separate process, whose peak memory the system reports.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from paxisim.layout import TaxelLayout
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

SHAPE = (2, 3, 12, 10)
SAMPLES = 120_000


def write(path: Path, kind: str) -> float:
    """Write the file, and return the microseconds per message."""
    rng = np.random.default_rng(0)
    layout = TaxelLayout(12, 10, (26.1e-3 / 12, 22.6e-3 / 10))
    blocks = []
    for _ in range(100):  # 1 s each, repeated
        if kind == "counts":
            pressed = rng.random((100, 2, 1, 12, 10)) < 0.4
            blocks.append((pressed * rng.integers(-30, 120, (100, *SHAPE)) * 0.1).astype(np.float32))
        else:
            blocks.append(rng.normal(size=(100, *SHAPE)).astype(np.float32))
    begin = time.perf_counter()
    with LogWriter(path, {"layout": layout, "pads": ["left", "right"]}) as log:
        log.write("episode", 1.7e9, 0)
        for i in range(SAMPLES):
            log.write_at("measured", 1_700_000_000_000_000_000 + i * 10_000_000, blocks[i // 100 % 100][i % 100])
    return (time.perf_counter() - begin) / SAMPLES * 1e6


def load(path: Path) -> None:
    """Load the file, and print time and memory as JSON."""
    begin, begin_cpu = time.perf_counter(), time.process_time()
    recording = Recording.load(path)
    seconds, cpu = time.perf_counter() - begin, time.process_time() - begin_cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    assert len(recording) == SAMPLES
    print(json.dumps({"seconds": seconds, "cpu": cpu, "peak": peak}))


def floor(path: Path) -> float:
    """Return the CPU seconds needed to read the bytes and decompress the chunks."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, get_chunk_data_stream

    begin = time.process_time()
    with open(path, "rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                get_chunk_data_stream(record, validate_crc=True)
    return time.process_time() - begin


if __name__ == "__main__":
    if len(sys.argv) > 1:
        load(Path(sys.argv[1]))
        sys.exit()
    print("numbers   file MB  write us/msg  load s load CPU s  peak MiB  read+decompress CPU s  ratio")
    for kind in ("counts", "float32"):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "long.mcap"
            cost = write(path, kind)
            words = [sys.executable, __file__, str(path)]
            took = json.loads(subprocess.run(words, capture_output=True, check=True, text=True).stdout)
            least = floor(path)
            print(
                f"{kind:8} {path.stat().st_size / 1e6:8.1f} {cost:13.1f} {took['seconds']:7.2f} {took['cpu']:10.2f} "
                f"{took['peak']:9.0f} {least:22.2f} {took['cpu'] / least:6.1f}"
            )
