"""Profiles: which part is connected, as data."""
