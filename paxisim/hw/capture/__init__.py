"""Capture: frames and extra streams written to a file as they arrive."""
