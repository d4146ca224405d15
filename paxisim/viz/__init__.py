"""Pictures and films of the force tensor (matplotlib), and live views of pads (Rerun, MuJoCo's viewer)."""
