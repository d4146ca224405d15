"""``python -m paxisim_lab.tied train ...``: a command that ends when the process that started it ends.

A matrix runs its commands this way. Otherwise the training of a killed worker or driver would go on, and the next
attempt at the same cell would write to the same folder at the same time. The starting process holds the other end of
this process's standard input; the system closes it, however that process ends.
"""

from __future__ import annotations

import os
import runpy
import sys
import threading


def _end_with_input() -> None:
    while os.read(0, 1):
        pass
    os._exit(1)  # a killed training loses nothing that was saved, see HistoryReplayBuffer


if __name__ == "__main__":
    threading.Thread(target=_end_with_input, daemon=True).start()
    del sys.argv[0]
    runpy.run_module(f"paxisim_insertion.{sys.argv[0]}", run_name="__main__", alter_sys=True)
