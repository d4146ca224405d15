"""Recordings on disk: streams at their own rates, and the formats they come in."""
