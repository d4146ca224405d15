"""Causes: what a sensor or a scene may do that the simulation does not, one cause per file."""
