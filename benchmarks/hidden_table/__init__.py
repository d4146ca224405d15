"""The parts of `hidden_effects.py`: its cases, how one is solved, the baselines, poor motions, costs and the table."""
