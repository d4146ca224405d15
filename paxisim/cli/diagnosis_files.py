"""Files that ``paxisim diagnose`` writes to the folder of a diagnosis."""

from __future__ import annotations

from pathlib import Path

from paxisim.cli.output import check_folder, check_no_file
from paxisim.errors import OutputExistsError

FILES = {
    "report.html": "the report with pictures, for a browser",
    "diagnosis.json": "all numbers of the diagnosis",
    "model.json": "the extended sensor model",
    "fitted_scene.toml": "the scene with the fitted values",
    "fitted_scene.xml": "its MJCF",
}


def check_diagnosis_folder(folder: Path, force: bool) -> None:
    """Check the output folder before any work is done.

    Raises:
        InvalidValueError: It is a file, or cannot be made or written to.
        OutputExistsError: It holds a diagnosis, and `force` is off.
    """
    check_no_file(folder)
    check_folder(folder / "report.html" if folder.is_dir() else folder)
    for name in FILES:
        if (folder / name).exists() and not force:
            raise OutputExistsError(f"{folder / name} exists; --force overwrites it")
