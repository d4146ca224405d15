"""PaXini's older GEN1 hand board."""
