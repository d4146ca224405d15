"""Signals and profiles for tests against emulated boards."""

import dataclasses

import numpy as np

from paxisim import Profile, Slot, TaxelLayout, load_profile


def profile(name: str = "gen3-highspeed-mc-m2020", **changes) -> Profile:
    """A shipped profile with changes, marked as verified to avoid the warning."""
    return dataclasses.replace(load_profile(name), **{"verified": "in a test", **changes})


def small(family: str, slots=(("pad", 1),), **changes) -> Profile:
    """A profile of 3x4 taxels in shuffled order, with rotated axes."""
    layout = TaxelLayout(3, 4, 3e-3, vendor_order=(3, 7, 11, 2, 6, 10, 1, 5, 9, 0, 4, 8))
    named = tuple(Slot(*slot) for slot in slots)
    fields = {"axes": ("-y", "+x", "+z"), "baud": 460800, "verified": "in a test"} | changes
    return Profile("small", family, fields.pop("wire_layout", layout), named, **fields)


class Numbered:
    """A new random tensor of whole counts at every call, which makes every message unique."""

    def __init__(self, profile: Profile, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._shape = (len(profile.slots), *profile.wire_layout.shape)
        self.calls = 0

    def __call__(self, now: float) -> np.ndarray:
        self.calls += 1
        counts = self._rng.integers(-128, 128, self._shape)
        counts[:, 2] += 128
        return 0.1 * counts


def constant(profile: Profile, seed: int = 0):
    """A signal that always returns the same random tensor of whole counts, each at least 2 and none clipped."""
    force = np.random.default_rng(seed).integers(2, 120, (len(profile.slots), *profile.wire_layout.shape)) * 0.1
    return lambda now: force
