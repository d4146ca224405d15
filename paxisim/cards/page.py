"""Page: a card as a single HTML file."""

from __future__ import annotations

from typing import Any

import numpy as np

from paxisim.augment.recorded import read_recording
from paxisim.cards.card import Card
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.report.error import places, worst_episodes
from paxisim.diagnose.report.page import rendered
from paxisim.diagnose.report.style import drawing
from paxisim.diagnose.result import Streams
from paxisim.recording import Recording


def card_page(card: Card, recording: Recording | None) -> str:
    """Return a card as HTML, with the pictures of a recording.

    Raises:
        MissingExtraError: matplotlib or jinja2 is not installed.
        InvalidValueError: See `Card.judge`.
    """
    return rendered("card.html.j2", lambda: _context(card, recording), "the page of a card")


def _context(card: Card, recording: Recording | None) -> dict[str, Any]:
    known = known_causes()
    words = {own.name: cause(own.name).words if own.name in known else "" for own in card.causes}
    context: dict[str, Any] = {"card": card, "words": words, "score": None, "maps": [], "traces": []}
    if recording is not None:
        streams = _streams(card, recording)
        with drawing():
            context |= {"maps": places(streams), "traces": worst_episodes(streams)}
        context["score"] = card.judge(recording)
    return context


def _streams(card: Card, recording: Recording) -> Streams:
    """Return the streams of a recording with the readings of the model, where all are known."""
    card.judge(recording)  # raises for a recording that cannot be compared
    read = read_recording(card.model, recording)
    assert recording.measured is not None
    assert recording.simulated is not None
    assert read.simulated is not None
    streams = (recording.measured, recording.simulated, read.simulated)
    known = np.logical_and.reduce([np.isfinite(stream).all(axis=(1, 2, 3, 4)) for stream in streams])
    plain = {name: values[known] for name, values in recording.covariates.items() if values.ndim == 1}
    measured, simulated, extended = (stream[known] for stream in streams)
    return Streams(
        recording.time[known],
        recording.episode[known],
        measured,
        simulated,
        extended,
        plain,
        recording.pads,
        recording.layout,
    )
