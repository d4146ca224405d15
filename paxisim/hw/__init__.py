"""Real sensors: bytes on a serial line to the same tensor that the simulator gives, and a sensor made of bytes.

From the line up: `framing` and `frames` (bytes and messages, no I/O), `registers` (addresses), `transport` (a serial
port), `boards` (the conversation with each kind of board), `profile` (which part, in which order and signs),
`device` (frames of newtons, from one port or several), `capture` (into a file). `emulator` is the other end of the
line.
"""
