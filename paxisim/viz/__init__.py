"""Pictures of the force tensor (matplotlib) and the live view of a model's pads (MuJoCo's viewer)."""
