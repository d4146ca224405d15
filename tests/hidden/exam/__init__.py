"""Recordings with known hidden effects, written apart from the engine and from the practice generator."""
