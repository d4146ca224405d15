"""The tactile encoder of the networks, and their sizes, for any learner."""

from __future__ import annotations

from torch import nn

FEATURES = 128
"""Output size of each encoder (paper)."""

LAYERS = ((32, 2), (32, 1), (64, 2), (64, 1))
"""Channels and stride of the CNN's layers, all with 3x3 kernels: our choice. Without strides an update takes three
times as long on a CPU."""

POSE_SCALE = 100.0
"""Factor that converts poses to cm and centiradian: a layer learns slowly from inputs of a few thousandths."""


def tactile_encoder(channels: int, rows: int, cols: int) -> nn.Sequential:
    """Build the CNN that maps ``(batch, channels, rows, cols)`` to ``(batch, 128)``."""
    layers: list[nn.Module] = []
    for size, stride in LAYERS:
        layers += [nn.Conv2d(channels, size, 3, stride, padding=1, bias=False), nn.BatchNorm2d(size), nn.ReLU()]
        channels, rows, cols = size, -(-rows // stride), -(-cols // stride)
    return nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels * rows * cols, FEATURES), nn.ReLU())
