"""The messages of each family of boards, both directions, as bytes. No I/O."""
