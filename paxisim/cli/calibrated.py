"""The options ``--calibration`` and ``--covariates`` of the commands that read a sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    from paxisim.calibrate.background import Background
    from paxisim.calibrate.calibration import Calibration


def load_calibration(
    path: Path | None, function: str | None
) -> tuple[Calibration | Background | None, Callable[[], Mapping[str, Any]] | None]:
    """Load what ``--calibration`` and ``--covariates`` name, if anything.

    Raises:
        InvalidValueError: The file is neither a calibration nor a background, there is no such function, or only one
            of both is given where both are needed.
    """
    if path is None:
        if function is not None:
            raise InvalidValueError("--covariates are the values of a background: expected --calibration FILE with it")
        return None, None
    from paxisim.calibrate.background import Background
    from paxisim.calibrate.calibration import Calibration
    from paxisim.files import parse_file, parse_json
    from paxisim.hw.capture.extra_streams import import_function

    def loaded(text: str) -> Calibration | Background:
        document = parse_json(text)
        is_background = isinstance(document, dict) and document.get("format") == Background.FORMAT
        return Background.from_document(document) if is_background else Calibration.from_document(document)

    model = parse_file(path, loaded)
    if function is None:
        if model.covariates:
            raise InvalidValueError(
                f"{path} subtracts a background that depends on {', '.join(model.covariates)}: expected --covariates "
                "module:function with it, a function that returns their present values; or record without "
                "--calibration, and subtract afterwards with paxisim calibrate --background"
            )
        return model, None
    module, _, name = function.partition(":")
    if not (module and name):
        raise InvalidValueError(f"--covariates must be module:function, e.g. robot:state, got {function!r}")
    return model, import_function(module, name, f"--covariates {function}")
