"""Commissioning: check a new sensor, and measure its quality."""
