"""MJCF: numbers as its attributes hold them."""

from __future__ import annotations

from collections.abc import Iterable


def numbers(values: Iterable[float]) -> str:
    """Format numbers as MJCF text, with nine significant digits and without negative zero."""
    return " ".join(f"{float(value) + 0.0:.9g}" for value in values)
