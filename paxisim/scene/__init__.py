"""Replay: a simulated scene driven by the streams of a recording."""
