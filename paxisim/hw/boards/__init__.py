"""The host's side of the conversation with each family of boards."""
