"""Write samples until killed, printing the time of each sample to stdout once it is written."""

import sys
import time

import numpy as np

from paxisim.logs.mcap_writer import LogWriter

if __name__ == "__main__":
    with LogWriter(sys.argv[1], {"pads": ["left"]}) as log:
        for i in range(100_000):
            now = time.time_ns()
            log.write_at("measured", now, np.full((1, 3, 2, 2), i, np.float32))
            print(now, flush=True)
            time.sleep(0.002)
