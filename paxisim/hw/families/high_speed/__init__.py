"""PaXini's GEN3 high-speed board."""
