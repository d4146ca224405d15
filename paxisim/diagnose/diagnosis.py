"""Diagnosis: the result of a diagnosis, as text, as files and as a report."""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import replace
from pathlib import Path

from paxisim.diagnose.report.page import head, page
from paxisim.diagnose.report.text import text_of
from paxisim.diagnose.result import Result
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.files import all_or_none, parse_file, whole_file
from paxisim.scene.scene import Scene

REPORT_FILE, MODEL_FILE = "report.html", "model.json"
SCENE_FILE = "fitted_scene.toml"  # scene.toml may be the user's own


class Diagnosis(Result):
    """What the simulation gets wrong, why, and how much a correction gains. `print` shows it as text.

    Attributes:
        verdict: "no_discrepancy", "clocks_differ" (once the clocks are aligned there is no discrepancy), "explained",
            "ambiguous" (rivals that the data cannot separate), "partly_explained" (named causes, plus structure in the
            residual, near misses or parameters at their bounds), "unexplained" or "unrelated" (the streams do not show
            the same motion, and nothing was fitted).
        causes: The named causes, largest gain first.
        heldout: Errors on held-out episodes.
        confidence: For each cause, a value from 0 to 1: how often it passes its test when held-out episodes are
            resampled, divided among the cause and its rivals; a parameter at its bound counts as one more rival.
        not_testable: Reason for each cause that this recording cannot test.
        symptoms: Where the error is.
        advice: What to record next.
        model: The extended sensor model. Latency and low-pass filters were fitted on interpolated frames: stepped in a
            simulator they behave as fitted, whereas on frames 50 ms apart they attenuate fast motions slightly more.
        intervals: 90% intervals of the model's parameters: by member and parameter, the lowest and the highest value as
            arrays of the parameter's shape, as ``GCS.around(model, intervals)`` expects. Parameters without an
            interval are omitted.
        scene: The scene with the fitted values, to be used with `model`; `paxisim.Scene.save` writes it with its MJCF.
            None if the diagnosis had no scene.
        scene_values: Fitted scene parameters by name, in SI units; see `paxisim.Scene.parameters`.
        streams: Tensors for the pictures of the report; None if the diagnosis was loaded from a file.
        clock_shift: Time (s) by which the measured stream lagged the simulated one before their clocks were aligned; 0
            if the clocks agree.
        known: Which part of a given sensor model was taken as known, as a sentence; empty if none was given. The model
            then begins with it, as the member ``known_sensor``, and the errors before the correction are those of the
            simulation seen through it.
    """

    def report(self) -> str:
        """The diagnosis as a self-contained HTML page with pictures, without scripts or external resources.

        A diagnosis loaded from a file has no streams, so its page lacks the pictures that need them.

        Raises:
            MissingExtraError: matplotlib or jinja2 is not installed.
        """
        return page(self)

    def save(self, folder: str | Path) -> None:
        """Write ``diagnosis.json``, ``model.json`` and ``report.html`` to `folder`, which is created if needed.

        With a scene, it also writes ``fitted_scene.toml`` and ``.xml``, the scene with the fitted values. Each file is
        written atomically; `Chain.load` reads ``model.json``. If matplotlib or jinja2 is missing, a warning replaces
        the report. For unrelated streams there is no model. Files of an earlier diagnosis in the folder that are not
        overwritten are removed. After an error, no new file is left.

        Raises:
            OSError: The folder or a file in it cannot be written.
        """
        folder = Path(folder)
        is_new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        scene_files = (SCENE_FILE, Path(SCENE_FILE).with_suffix(".xml").name)
        try:
            with all_or_none([folder / name for name in ("diagnosis.json", MODEL_FILE, REPORT_FILE, *scene_files)]):
                self._save(folder, scene_files)
        except BaseException:
            if is_new:
                with contextlib.suppress(OSError):
                    folder.rmdir()
            raise

    def _save(self, folder: Path, scene_files: tuple[str, ...]) -> None:
        files = self.files()
        for name, text in files.items():
            _write(folder / name, text)
        if MODEL_FILE not in files:
            (folder / MODEL_FILE).unlink(missing_ok=True)
        if self.scene is not None:
            self.scene.save(folder / SCENE_FILE)
        else:
            for name in scene_files:
                (folder / name).unlink(missing_ok=True)
        try:
            page = self.report()
        except MissingExtraError as error:
            (folder / REPORT_FILE).unlink(missing_ok=True)
            warnings.warn(f"{REPORT_FILE} was not written: {error}", stacklevel=3)
        else:
            _write(folder / REPORT_FILE, page)

    def files(self) -> dict[str, str]:
        """Contents of the JSON files that `save` writes, by file name."""
        files = {MODEL_FILE: self.model.to_json() + "\n", "diagnosis.json": self.to_json() + "\n"}
        if self.verdict == "unrelated":
            del files[MODEL_FILE]
        return files

    @classmethod
    def load(cls, folder: str | Path) -> Diagnosis:
        """Read a diagnosis that `save` wrote.

        Raises:
            InvalidValueError: As for `from_json`; or the MJCF of its scene is not in the folder.
            FileNotFoundError: There is no file.
        """
        found = parse_file(Path(folder) / "diagnosis.json", cls.from_json)
        path = Path(folder) / SCENE_FILE
        if not path.is_file():
            return found
        scene = Scene.load(path)
        if Path(scene.mjcf).resolve().parent != path.resolve().parent:
            raise InvalidValueError(f"{path} must name an MJCF in its own folder, got {scene.mjcf}")
        return replace(found, scene=scene)

    def __repr__(self) -> str:
        """Summary on one line."""
        causes = ", ".join(cause.name for cause in self.causes) or "none"
        change = f"held-out error {self.heldout.nrmse_before:.1%} -> {self.heldout.nrmse_after:.1%}"
        return f"<Diagnosis: {self.verdict}; causes: {causes}; {change}>"

    def _repr_html_(self) -> str:
        """The head of the report, for a notebook."""
        return head(self)

    def __str__(self) -> str:
        """The diagnosis as text, 80 columns wide."""
        return text_of(self)


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
