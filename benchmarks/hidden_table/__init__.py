"""The parts of `hidden_effects.py`: its cases, how one is solved, the baselines, poor motions, costs and the table."""

import sys
from pathlib import Path

# the generators of the recordings; here, since a process that works on a case may import only a part
sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
