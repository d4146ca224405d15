"""MuJoCo: pads, their surface and gel, how they get onto a gripper, and how they are read."""
