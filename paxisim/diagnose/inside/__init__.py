"""Causes inside the scene: replays of a motion with changed scene parameters, and the search over their effects."""
