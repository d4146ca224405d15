"""Motions: what a recording must show so that a cause can be identified, as instructions for the next recording."""

from __future__ import annotations

from collections.abc import Mapping

MOTIONS: Mapping[str, str] = {
    "triangles": (
        "press and release in a triangle wave at three speeds spanning two decades, and hold for 30 s once during "
        "loading and once during unloading; a loop that remains at the slowest speed is hysteresis"
    ),
    "holds": "hold a press for 30 s, then leave the pad unloaded for 60 s",
    "taps": (
        "tap quickly, then oscillate the force at a rising frequency; a delay keeps the amplitude of the oscillation, "
        "a filter reduces it"
    ),
    "gripper": "open and close the gripper, or move the hand, without contact, and record its opening or its joints",
    "staircase": "press in a staircase of at least six force levels, up to over-range, at several places on the pad",
    "free": "leave the pads unloaded for 60 s before and after the presses",
    "slides": "slide along one axis and then along the other, in both directions",
    "loads": "slide past slip at two normal loads, along both axes",
    "probe": "press single taxels with a fine tip, then press all of them with a flat plate",
    "light": "press very lightly and slowly, so that the readings pass through every count",
    "places": "press at several places on the pad, so that every taxel is loaded",
    "corners": "press off-centre on one pad at a time, and slide along each axis",
    "sessions": "record four episodes or more over ten minutes on one clock, the pads unloaded before and after each",
    "repeats": "repeat one press ten times from a fresh start, at two speeds, and check whether the first one differs",
    "regrasps": "press one object at four places or more, turned by 90 degrees and tilted to both sides between them",
    "objects": "press two objects of known sizes, each at two depths at least",
    "varied": "record at least 8 episodes with different motions",
}
"""Instructions for each motion, by name. `Cause.excites` refers to these names."""
PROTOCOLS: Mapping[str, str] = {
    "press": "triangles holds taps staircase free slides loads light places corners sessions",
    "regrasp": "triangles holds taps gripper staircase free places sessions varied",
    "open-close": "gripper free sessions",
}
"""Names of the motions that each protocol of ``paxisim protocol`` has."""
