"""Measure: time and memory of diagnosing a recording, in a separate process: ``measure.py FILE JOBS``."""

import json
import resource
import sys
import time

import numpy as np

import paxisim
from paxisim.recording import Recording


def measure(path: str, jobs: int) -> None:
    """Diagnose the recording at `path`, and print time and memory as JSON."""
    with np.load(path) as file:
        data = {name: file[name] for name in file.files}
    covariates = {name: data[name] for name in data.keys() - {"time", "measured", "simulated", "episode"}}
    recording = Recording(data["time"], data["measured"], data["simulated"], covariates, data["episode"])
    begin = time.perf_counter()
    diagnosis = paxisim.diagnose(recording, jobs=jobs)
    row = {
        "samples": len(recording),
        "channels": int(data["measured"][0].size),
        "seconds": time.perf_counter() - begin,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "named": [cause.name for cause in diagnosis.causes],
    }
    print(json.dumps(row))


if __name__ == "__main__":
    measure(sys.argv[1], int(sys.argv[2]))
