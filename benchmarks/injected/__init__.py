"""The parts of `injections.py`: the real signal, effects, streams that do not correspond, the table."""
