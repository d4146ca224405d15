"""Causes inside the scene: replays of a motion with other values of the scene, and what the search makes of them."""
