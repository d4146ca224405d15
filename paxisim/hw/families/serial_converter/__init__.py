"""PaXini's GEN3 serial converter."""
