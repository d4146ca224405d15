"""Real sensors: a driver that turns bytes on a serial line into the simulator's tensor, and an emulator of the sensors.

From the line up: `framing` and `frames` (bytes and messages, no I/O), `registers` (addresses), `transport` (a serial
port), `boards` (the protocol of each family of boards), `profile` (which part is connected, with the order and signs of
its taxels), `device` (frames of the tensor, from one or several ports), `capture` (recording to a file). `emulator` is
the other end of the line.
"""
