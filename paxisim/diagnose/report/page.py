"""Page: a diagnosis as a single HTML file."""

from __future__ import annotations

from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from paxisim._version import __version__
from paxisim.augment.chain import Chain
from paxisim.augment.latency import Latency
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.report.faults import fault_in_words
from paxisim.diagnose.report.text import (
    CONFIDENCE,
    EXPLAINS,
    black_box_in_words,
    is_of_one_episode,
    meanings,
    parameters_in_words,
    reasons_of,
)
from paxisim.diagnose.result import FoundCause, Interval, Result
from paxisim.errors import MissingExtraError

HEADS = {
    "no_discrepancy": "The simulation agrees with the measurement",
    "clocks_differ": "The clocks of the two streams differ",
    "explained": "{causes} explain{s} the difference",
    "ambiguous": "{causes} may explain the difference, but other causes fit equally well",
    "partly_explained": "{causes} explain{s} part of the difference",
    "unexplained": "The simulation differs from the measurement, and no known cause explains it",
    "unrelated": "The two streams are not of the same motion",
}
TAILS = {
    "no_discrepancy": "The residual is within noise and tolerances.",
    "clocks_differ": "Once they are aligned, the residual is within noise and tolerances.",
    "explained": "The residual shows no further structure.",
    "ambiguous": "This recording cannot separate the rival causes. See What to record next.",
    "partly_explained": "Structure remains, a cause is a near miss, or a parameter is at its bound. See What remains.",
    "unexplained": "The residual has structure, so it is not just noise. See What remains.",
    "unrelated": "Nothing was fitted. See What remains and What to record next.",
}
ONE_EPISODE_HEAD = "{causes} may explain the difference"
ONE_EPISODE_TAIL = "A single episode cannot confirm a cause. Record several episodes."


def page(diagnosis: Result) -> str:
    """Return the report as HTML; see `Diagnosis.report`.

    Raises:
        MissingExtraError: matplotlib or jinja2 is not installed.
    """
    for module in ("matplotlib", "jinja2"):
        try:
            __import__(module)
        except ImportError as error:
            raise MissingExtraError(module, "diagnose", "the report of a diagnosis") from error
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
    environment.filters["percent"] = _percent
    template = files("paxisim.diagnose.report").joinpath("page.html.j2").read_text(encoding="utf-8")
    return environment.from_string(template).render(_context(diagnosis))


def head(diagnosis: Result) -> str:
    """Return the head of the report as HTML: the verdict, and the causes with their gains."""
    sentence, figures = _sentence(diagnosis), diagnosis.heldout
    lines = [f"<h4>{escape(_head(diagnosis))}</h4>", f"<p>{escape(sentence)}</p>"]
    if diagnosis.causes:
        error = f"{figures.nrmse_before:.1%} &rarr; {figures.nrmse_after:.1%}"
        lines.append(f"<p>Error (normalised RMSE): {error}; noise floor {figures.noise_floor:.1%}</p>")
        cells = [("cause", "explains", "confidence", "rivals")]
        for item in diagnosis.causes:
            sure = f"{diagnosis.confidence.get(item.name, 0):.0%}"
            cells.append((item.name, _percent(item.gain), sure, ", ".join(item.rivals) or "none"))
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in cells)
        lines.append("<table>" + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>")
    return "\n".join(lines)


def _sentence(diagnosis: Result) -> str:
    return ONE_EPISODE_TAIL if is_of_one_episode(diagnosis) else TAILS[diagnosis.verdict]


def _context(diagnosis: Result) -> dict[str, Any]:
    from paxisim.diagnose.report.effect import effects
    from paxisim.diagnose.report.gain import gain_pictures
    from paxisim.diagnose.report.kinds import evidence
    from paxisim.diagnose.report.maps import places
    from paxisim.diagnose.report.remains import remains
    from paxisim.diagnose.report.style import drawing
    from paxisim.diagnose.report.traces import shares, worst_episodes

    streams, extended = diagnosis.streams, bool(diagnosis.causes)
    with drawing():
        found = [] if streams is None else effects(diagnosis.causes, diagnosis.model, streams)
        pictures = {effect.cause.name: evidence(effect) for effect in found}
        context = {
            "maps": [] if streams is None else places(streams, extended),
            "traces": [] if streams is None else worst_episodes(streams, extended),
            "shares": shares(diagnosis.symptoms, extended),
            "gain": gain_pictures(diagnosis),
            "remains": remains(streams, extended) if streams is not None and diagnosis.symptoms.left_over else [],
        }
    causes = [
        {
            "found": cause,
            "words": _words(cause.name),
            "pictures": pictures.get(cause.name, []),
            "parameters": _parameters(diagnosis, cause),
            "meanings": meanings(cause.parameters),
            "confidence": diagnosis.confidence.get(cause.name),
        }
        for cause in diagnosis.causes
    ]
    return {
        **context,
        "diagnosis": diagnosis,
        "head": _head(diagnosis),
        "sentence": _sentence(diagnosis),
        "causes": causes,
        "confidence_in_words": CONFIDENCE,
        "explains_in_words": EXPLAINS,
        "beyond_in_words": black_box_in_words(diagnosis.heldout) if extended else "",
        "held_out": len(diagnosis.heldout.gain_per_episode) > 1,
        "reasons": reasons_of(diagnosis),
        "has_model": bool(list(diagnosis.model)),
        "covariates": diagnosis.model.covariate_names,
        "reads_ahead": _reads_ahead(diagnosis.model),
        "version": __version__,
    }


def _head(diagnosis: Result) -> str:
    names = [cause.name.replace("_", " ") for cause in diagnosis.causes]
    joined = names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1] if names else ""
    head = ONE_EPISODE_HEAD if is_of_one_episode(diagnosis) else HEADS[diagnosis.verdict]
    text = head.format(causes=joined, s="s" if len(names) == 1 else "")
    return text[:1].upper() + text[1:]


def _words(name: str) -> str:
    """Return the one-sentence description of a cause; empty if it is no longer registered."""
    return cause(name).words if name in known_causes() else ""


def _reads_ahead(model: Chain) -> bool:
    """Whether a reading depends on future frames because the simulated stream lags the measured one."""
    return any(
        _reads_ahead(member) if isinstance(member, Chain) else isinstance(member, Latency) and np.min(member.delay) < 0
        for member in model
    )


def _parameters(diagnosis: Result, cause: FoundCause) -> list[tuple[str, str]]:
    """Names and values of the parameters as text; long arrays are summarised by their range."""
    if words := fault_in_words(diagnosis, cause.name):
        return [("fault", words)]
    return parameters_in_words(cause.parameters)


def _percent(value: Interval | float) -> str:
    from paxisim.diagnose.report.gain import percent

    if not isinstance(value, Interval):
        return percent(value)
    if value.low is None or value.high is None:
        return f"{value.value:.0%}"
    return f"{value.value:.0%} [{value.low:.0%}, {value.high:.0%}]"
