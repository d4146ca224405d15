"""The parts of `hidden_effects.py`: its cases, the table and the costs."""
