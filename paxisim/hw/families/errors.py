"""Errors: the codes with which PaXini's boards refuse a request."""

from __future__ import annotations

from collections.abc import Mapping

SERIAL_CONVERTER: Mapping[int, str] = {
    0x00: "ok",
    0x01: "length",
    0x02: "check byte",
    0x03: "main command",
    0x04: "sub command",
    0x05: "overflow",
    0x06: "parameter",
    0x07: "no data",
    0x0A: "arrangement",
}
"""Status bytes of a GEN3 serial converter."""

CONTROL_BOX: Mapping[int, str] = {
    **SERIAL_CONVERTER,
    0x0C: "host id",
    0x0D: "others",
    0x10: "get",
    0x11: "execute",
    0x12: "CRC",
}
"""Error bytes of a control box."""


def error_name(code: int, names: Mapping[int, str]) -> str:
    """Return an error code with its name, e.g. ``"error 0x07 (no data)"``."""
    return f"error 0x{code:02X} ({names.get(code, 'unknown')})"
