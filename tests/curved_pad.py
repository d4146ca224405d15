"""A pad that is curved around a fingertip, for tests of what depends on places and frames."""

import numpy as np

from paxisim.layout import TaxelLayout

PITCH = 2e-3  # m
TURN = 0.2  # rad, between the normals of neighbouring taxels


def curved_pad(taxels):
    """Return three columns of `taxels` each around a cylinder."""
    angle = TURN * (np.arange(taxels) - (taxels - 1) / 2)
    radius = PITCH / TURN
    across, up = np.meshgrid(np.arange(3) * PITCH, np.arange(taxels), indexing="ij")
    positions = np.stack([across, radius * np.sin(angle)[up], radius * (1 - np.cos(angle))[up]], axis=-1)
    normals = np.stack([0 * across, np.sin(angle)[up], -np.cos(angle)[up]], axis=-1)
    pitch = (PITCH, PITCH)
    return TaxelLayout(3, taxels, pitch, positions=positions.reshape(-1, 3), normals=normals.reshape(-1, 3))
