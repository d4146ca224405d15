"""PaXini's control box."""
