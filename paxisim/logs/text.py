"""Parsing of JSON and TOML from untrusted files, with paxisim's own errors."""

from __future__ import annotations

import json
import sys
from typing import Any

from paxisim.errors import InvalidValueError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]


def parse_json(text: str | bytes) -> Any:
    """Parse a JSON text.

    Raises:
        InvalidValueError: The text is not JSON, is nested too deeply, or has a number of thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise InvalidValueError("the JSON cannot be read: it is nested too deeply") from None
    except ValueError as error:
        raise InvalidValueError(f"not JSON: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises:
        InvalidValueError: The text is not TOML, is nested too deeply, or has a number of thousands of digits.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InvalidValueError("the TOML cannot be read: it is nested too deeply") from None
    except ValueError as error:
        raise InvalidValueError(f"not TOML: {error}") from error
