"""The board's side of the conversation, for each family."""
