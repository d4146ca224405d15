"""Addresses on the boards, by family. See `paxisim.hw.frames` for their sources and how reliable they are."""

# serial converter: 32-bit addresses

CONVERTER_ZERO = 3
"""Write 1: the present reading becomes the zero."""
CONVERTER_RESULTANT = 1008
"""A block of 30 bytes, the resultant in its first 3; the taxels follow it, so one request reads both."""
CONVERTER_TAXELS = 1038
CONVERTER_VERSION = 6100
CONVERTER_VERSION_BYTES = 100

# high-speed board: 16-bit registers

HIGH_SPEED_MODULES = 28

HIGH_SPEED_VERSION = 0x0000
HIGH_SPEED_VERSION_BYTES = 15
HIGH_SPEED_ZERO = 0x0002
"""Function 17 with 1: zeroes all modules."""
HIGH_SPEED_ACTIVE = 0x0010
"""4 bytes; module m is bit m % 8 of byte m // 8."""
HIGH_SPEED_ACTIVE_BYTES = 4
HIGH_SPEED_DATA_TYPE = 0x0016
"""Bit 0: stream resultants; bit 1: stream taxels."""
HIGH_SPEED_PUSH = 0x0017
"""1: stream; 0: do not stream."""
HIGH_SPEED_COUNTS = 0x0030
"""Number of taxels of module 0, a little-endian 16-bit number; two bytes per module."""
HIGH_SPEED_FIRST_PALM = 20
HIGH_SPEED_PALM_COUNTS = 0x0066
"""Counts of the 8 palm modules according to one source; in another they follow those of the fingers."""

# control box: 16-bit addresses in the pad on the selected port, 8-bit addresses in its configuration

CONTROL_BOX_RESULTANT = 1008
"""A block of 30 bytes, the resultant in its first 3; the taxels follow it, so one request reads both."""
CONTROL_BOX_TAXELS = 1038
CONTROL_BOX_ZERO = 3
"""Configuration; write 1: the pad's present reading becomes the zero. Answers error 6 although it works."""
