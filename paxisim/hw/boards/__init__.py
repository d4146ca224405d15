"""The host's side of the protocol of each family of boards."""
