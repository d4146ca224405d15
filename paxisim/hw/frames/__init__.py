"""Encoding and decoding of the messages of each family of boards, in both directions. No I/O."""
