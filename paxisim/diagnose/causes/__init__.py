"""The causes that come with paxisim; importing this registers them."""

from paxisim.diagnose.causes import curves, field, gains, memory, mixing, read_off, timing

__all__ = ["curves", "field", "gains", "memory", "mixing", "read_off", "timing"]
