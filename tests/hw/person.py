"""A simulated user who follows the guided check, and grids whose bytes run line by line."""

import numpy as np

from paxisim.hw.commissioning.check import Step
from paxisim.layout import TaxelLayout


def scan(rows: int, cols: int, along_rows: bool, up: bool, leftward: bool) -> TaxelLayout:
    """A grid whose bytes run line by line from one of its corners, along its rows or its columns."""
    lines = [[(r, c) for c in range(cols)] for r in range(rows)]
    if not along_rows:
        lines = [[(r, c) for r in range(rows)] for c in range(cols)]
    order = [(rows - 1 - r if up else r) * cols + (cols - 1 - c if leftward else c) for line in lines for r, c in line]
    pitch = (2.2e-3, 2.2e-3)
    return TaxelLayout(rows, cols, pitch, vendor_order=None if order == sorted(order) else tuple(order))


def scans(size: tuple[int, int]) -> list[TaxelLayout]:
    """All grids that `size[0] * size[1]` taxels can form when read line by line."""
    both = [True, False]
    return [scan(*shape, a, u, v) for shape in (size, size[::-1]) for a in both for u in both for v in both]


def person(layout: TaxelLayout, step: Step, newtons: float = 6.0) -> np.ndarray:
    """``(3, rows, cols)`` forces (N) of a fingertip on a pad with this layout, in the pad frame."""
    at = np.zeros(2) if step.corner is None else 0.7 / 0.75 * np.array(step.corner)
    points = layout.positions[:, :2]
    middle, half = (points.min(axis=0) + points.max(axis=0)) / 2, np.ptp(points, axis=0) / 2
    away = (points - middle - at * half) / max(1.1 * max(layout.pitch), 0.15 * half.min())
    patch = np.exp(-0.5 * np.sum(away**2, axis=1))
    patch *= newtons / patch.sum()
    shear = np.zeros(2) if step.drag is None else 0.5 * np.eye(2)[step.drag]
    shear = shear + [0.04, -0.05]  # a real press is never exactly normal
    return np.stack([shear[0] * patch, shear[1] * patch, patch]).reshape(layout.shape)


def careless_person(layout: TaxelLayout, step: Step, rng: np.random.Generator) -> np.ndarray:
    """Like `person`, with random fingertip size, position in the requested quarter, force and slant."""
    at = rng.uniform(-0.5, 0.5, 2)
    if step.corner is not None:
        at = np.clip(np.array(step.corner) * rng.uniform(0.3, 1.25, 2), -1, 1)
    points = layout.positions[:, :2]
    middle, half = (points.min(axis=0) + points.max(axis=0)) / 2, np.ptp(points, axis=0) / 2
    angle = rng.uniform(0, np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    away = (points - middle - at * half) @ turn / (rng.uniform(0.7, 2.5, 2) * max(layout.pitch))
    patch = np.exp(-0.5 * np.sum(away**2, axis=1))
    patch *= rng.uniform(3, 15) / patch.sum()
    shear = rng.uniform(-0.12, 0.12, 2)
    if step.drag is not None:
        shear += rng.uniform(0.35, 0.8) * np.eye(2)[step.drag]
    return np.stack([shear[0] * patch, shear[1] * patch, patch]).reshape(layout.shape)
