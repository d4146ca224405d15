"""Magnetometer boards: AnySkin, ReSkin and kin."""
