"""JSON and TOML of a file from elsewhere: what it holds, or an error of ours."""

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
    """What a JSON text holds.

    Raises:
        InvalidValueError: It is no JSON, is nested too deep, or has a number of thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise InvalidValueError("not JSON that can be read: it is nested too deep") from None
    except ValueError as error:
        raise InvalidValueError(f"not JSON: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """What a TOML text holds.

    Raises:
        InvalidValueError: It is no TOML, is nested too deep, or has a number of thousands of digits.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InvalidValueError("not TOML that can be read: it is nested too deep") from None
    except ValueError as error:
        raise InvalidValueError(f"not TOML: {error}") from error
