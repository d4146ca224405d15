"""Replay: a simulated scene that the streams of a recording move."""
