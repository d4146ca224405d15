"""MuJoCo models: pads, their surface and gel, their attachment to grippers, and their readout."""
