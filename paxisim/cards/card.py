"""Card: the fitted model of one sensor, with what it is of, how good it is and how to use it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from paxisim._version import __version__
from paxisim.augment.chain import Chain
from paxisim.augment.gcs import GCS, FittedGCS
from paxisim.augment.recorded import read_recording
from paxisim.cards.score import Score, score
from paxisim.diagnose.diagnosis import Diagnosis
from paxisim.diagnose.result import intervals_as_arrays, intervals_as_lists
from paxisim.document import Document, built, finite
from paxisim.errors import InvalidValueError
from paxisim.files import all_or_none, parse_file, whole_file
from paxisim.recording import Recording

CARD_FILE, PAGE_FILE = "card.json", "index.html"


@dataclass(frozen=True)
class Source:
    """The recording that a card's model was fitted to.

    Attributes:
        name: Name of the file; empty if it is not known.
        sha256: SHA-256 of the file; empty if it is not known.
        samples: Number of samples; 0 if it is not known.
        episodes: Number of episodes; 0 if it is not known.
    """

    name: str = ""
    sha256: str = ""
    samples: int = 0
    episodes: int = 0

    @classmethod
    def of(cls, path: Path, recording: Recording) -> Source:
        """Describe a recording that was loaded from a file."""
        digest = sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
        return cls(path.name, digest, len(recording), len(np.unique(recording.episode)))


@dataclass(frozen=True)
class NamedCause:
    """A cause that the diagnosis named.

    Attributes:
        name: Name of the cause.
        gain: Share of the explainable error that it explains on held-out episodes.
        parameters: Its parameters with their 90 % intervals, as text, by name.
        rivals: Causes that fit equally well in its place.
    """

    name: str
    gain: float
    parameters: dict[str, str] = field(default_factory=dict)
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Card(Document):
    """A sensor's fitted model to share: what it is of, the chain with its intervals, and how good it is.

    Example::

        card = paxisim.Card.load("card/")
        print(card.judge(paxisim.Recording.load("recording.mcap")))
        gcs = card.randomisation  # a GCS that draws sensors like this one

    Attributes:
        product: The sensor's product, such as ``"paxini-gen1-l4629"``.
        unit: Which unit of it; empty if it does not matter.
        model: Chain from simulated forces to readings.
        intervals: 90 % intervals of its parameters, as `GCS.around` expects.
        verdict: Verdict of the diagnosis.
        causes: The causes that it named.
        held_out: Normalised RMSE on held-out episodes of the simulation, of the model, and of noise alone.
        source: The recording that the model was fitted to.
        version: Version of paxisim.
        notes: What a user of the card should know.
    """

    product: str
    unit: str
    model: Chain
    intervals: Mapping[str, Any]
    verdict: str
    causes: tuple[NamedCause, ...]
    held_out: tuple[float, float, float]
    source: Source
    version: str = __version__
    notes: tuple[str, ...] = ()

    FORMAT = "paxisim-card/1"
    ENTRIES = (
        "product", "unit", "model", "intervals", "verdict", "causes", "held_out", "source", "version", "notes"
    )  # fmt: skip

    @classmethod
    def of(cls, diagnosis: Diagnosis, product: str, unit: str = "", source: Source | None = None) -> Card:
        """Make a card of a diagnosis.

        Args:
            diagnosis: Diagnosis with a model.
            product: The sensor's product.
            unit: Which unit of it.
            source: The recording that was diagnosed.

        Raises:
            InvalidValueError: The diagnosis has no model, or the product has no name.
        """
        if not len(diagnosis.model):
            raise InvalidValueError(
                f"the diagnosis names no cause in the sensor (its verdict is {diagnosis.verdict}): there is no model"
            )
        if not product.strip():
            raise InvalidValueError("expected the sensor's product, such as paxini-gen1-l4629")
        causes = tuple(
            NamedCause(
                cause.name,
                cause.gain.value,
                {p.name: f"{p.value}{'' if p.unit == '1' else ' ' + p.unit}" for p in cause.parameters},
                cause.rivals,
            )
            for cause in diagnosis.causes
        )
        heldout = diagnosis.heldout
        return cls(
            product,
            unit,
            diagnosis.model,
            diagnosis.intervals,
            diagnosis.verdict,
            causes,
            (heldout.nrmse_before, heldout.nrmse_after, heldout.noise_floor),
            source or Source(),
            notes=tuple(note for note in (diagnosis.known, heldout.note) if note),
        )

    @property
    def randomisation(self) -> FittedGCS:
        """A randomisation that draws sensors within the intervals of this one, see `GCS.around`."""
        return GCS.around(self.model, self.intervals)

    def judge(self, recording: Recording) -> Score:
        """Score the model on a recording with measured and simulated forces; see `Score`.

        Raises:
            InvalidValueError: The recording lacks a stream, is not in newtons, or has other pads or taxels.
            MissingCovariateError: The recording lacks a covariate that the model needs.
        """
        return score(recording, read_recording(self.model, recording))

    def save(self, folder: str | Path, recording: Recording | None = None) -> None:
        """Write ``card.json`` and ``index.html`` to a folder, which is created if needed.

        Args:
            folder: The folder.
            recording: Recording whose score and pictures the page shows.

        Raises:
            MissingExtraError: matplotlib or jinja2 is not installed.
            OSError: The folder or a file in it cannot be written.
        """
        from paxisim.cards.page import card_page

        folder = Path(folder)
        page = card_page(self, recording)
        folder.mkdir(parents=True, exist_ok=True)
        texts = {CARD_FILE: self.to_json() + "\n", PAGE_FILE: page}
        with all_or_none([folder / name for name in texts]):
            for name, text in texts.items():
                with whole_file(folder / name) as temporary:
                    temporary.write_text(text, encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Card:
        """Read a card: its folder, or its ``card.json``.

        Raises:
            InvalidValueError: The file is no card of this version.
            FileNotFoundError: There is no file.
        """
        path = Path(path)
        return parse_file(path / CARD_FILE if path.is_dir() else path, cls.from_json)

    def _entries(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in self.ENTRIES if name not in ("model", "intervals")}
        lists = intervals_as_lists(self.intervals)
        return {**finite(plain), "model": self.model.to_document(), "intervals": lists}

    @classmethod
    def _from_entries(cls, entries: dict[str, Any]) -> Card:
        low, high, floor = (built(float, value) for value in entries["held_out"])
        return cls(
            built(str, entries["product"]),
            built(str, entries["unit"]),
            Chain.from_document(entries["model"]),
            intervals_as_arrays(entries["intervals"]),
            built(str, entries["verdict"]),
            built(tuple[NamedCause, ...], entries["causes"]),
            (low, high, floor),
            built(Source, entries["source"]),
            built(str, entries["version"]),
            built(tuple[str, ...], entries["notes"]),
        )
