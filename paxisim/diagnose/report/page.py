"""Page: a diagnosis as a single HTML file, and the kinds of pictures on it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from paxisim._version import __version__
from paxisim.augment.chain import Chain
from paxisim.augment.latency import Latency
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.report import text
from paxisim.diagnose.report.curves import axes_mixed, channel_curves, curves, gains, loops, small_forces, steps
from paxisim.diagnose.report.effect import Effect, effects
from paxisim.diagnose.report.error import gain_pictures, percent, places, remains, shares, worst_episodes
from paxisim.diagnose.report.maps import kernel, mapping, silent_map, taxel_map, zero, zero_in_time
from paxisim.diagnose.report.scene import closing, height_map, mount, slip
from paxisim.diagnose.report.style import Picture, drawing
from paxisim.diagnose.report.timing import covariate, edges, holds, plain, shift
from paxisim.diagnose.result import Result, percentage
from paxisim.errors import MissingExtraError

PICTURES: Mapping[str, Callable[[Effect], list[Picture]]] = {
    "axes": axes_mixed,
    "closing": closing,
    "channel_curves": channel_curves,
    "covariate": covariate,
    "curves": curves,
    "edges": edges,
    "gains": gains,
    "height_map": height_map,
    "holds": holds,
    "kernel": kernel,
    "loops": loops,
    "mapping": mapping,
    "mount": mount,
    "plain": plain,
    "shift": shift,
    "silent_map": silent_map,
    "slip": slip,
    "small_forces": small_forces,
    "steps": steps,
    "taxel_map": taxel_map,
    "zero": zero,
    "zero_in_time": zero_in_time,
}
"""The function that draws the pictures of an effect, by kind."""


def page(diagnosis: Result) -> str:
    """Return the report as HTML; see `Diagnosis.report`.

    Raises:
        MissingExtraError: matplotlib or jinja2 is not installed.
    """
    return rendered("page.html.j2", lambda: _context(diagnosis), "the report of a diagnosis")


def rendered(template: str, context: Callable[[], dict[str, Any]], purpose: str) -> str:
    """Render a template of this folder.

    Args:
        template: File name of the template.
        context: Function that returns its variables; it needs the packages.
        purpose: What is rendered, for the error.

    Raises:
        MissingExtraError: matplotlib or jinja2 is not installed.
    """
    for module in ("matplotlib", "jinja2"):
        try:
            __import__(module)
        except ImportError as error:
            raise MissingExtraError(module, "diagnose", purpose) from error
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
    environment.loader = FileSystemLoader(Path(__file__).parent)
    environment.filters |= {"percent": percent, "percentage": percentage}
    return environment.get_template(template).render(context())


def head(diagnosis: Result) -> str:
    """Return the head of the report as HTML: the verdict, and the causes with their gains."""
    figures = diagnosis.heldout
    lines = [f"<h4>{escape(text.headline(diagnosis))}</h4>", f"<p>{escape(text.tail(diagnosis))}</p>"]
    if diagnosis.causes:
        error = f"{figures.nrmse_before:.1%} &rarr; {figures.nrmse_after:.1%}"
        lines.append(f"<p>Error (normalised RMSE): {error}; noise floor {figures.noise_floor:.1%}</p>")
        sure = {c.name: percentage(diagnosis.confidence.get(c.name, 0)) for c in diagnosis.causes}
        cells = [("cause", "explains", "confidence", "rivals")]
        cells += [(c.name, percent(c.gain), sure[c.name], ", ".join(c.rivals) or "none") for c in diagnosis.causes]
        rows = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in cells)
        lines.append("<table>" + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>")
    return "\n".join(lines)


def evidence(effect: Effect) -> list[Picture]:
    """Return the pictures of a cause, of the kind that it declares; plain ones, with a warning, if they do not suit."""
    kind = effect.about.picture if effect.about else "plain"  # it may not be registered any more
    try:
        return PICTURES[kind](effect)
    except Exception as error:
        if kind == "plain":
            raise
        warnings.warn(f"the picture {kind!r} does not suit {effect.cause.name!r}: {error!r}", stacklevel=2)
        return plain(effect)


def _context(diagnosis: Result) -> dict[str, Any]:
    streams, extended, model = diagnosis.streams, bool(diagnosis.causes), diagnosis.model
    evidences: dict[str, list[Picture]] = {}
    with drawing():
        pictures = {"shares": shares(diagnosis.symptoms, extended), "gain": gain_pictures(diagnosis)}
        pictures |= {"maps": [], "traces": [], "remains": []}
        if streams is not None:
            evidences = {effect.cause.name: evidence(effect) for effect in effects(diagnosis.causes, model, streams)}
            pictures |= {"maps": places(streams, extended), "traces": worst_episodes(streams, extended)}
            pictures["remains"] = remains(streams, extended) if diagnosis.symptoms.left_over else []
    words = {found.name: text.fault_in_words(diagnosis, found.name) for found in diagnosis.causes}
    causes = [
        {
            "found": found,
            "words": cause(found.name).words if found.name in known_causes() else "",  # a saved cause may be unknown
            "pictures": evidences.get(found.name, []),
            "differs": words[found.name] or text.differences(found.parameters, diagnosis, text.IN_HEAD),
            "parameters": text.parameters_in_words(() if words[found.name] else found.parameters, diagnosis),
            "confidence": diagnosis.confidence.get(found.name),
        }
        for found in diagnosis.causes
    ]
    return {
        **pictures,
        "diagnosis": diagnosis,
        "head": text.headline(diagnosis),
        "sentence": text.tail(diagnosis),
        "causes": causes,
        "confidence_in_words": text.CONFIDENCE,
        "explains_in_words": text.EXPLAINS,
        "beyond_in_words": text.black_box_in_words(diagnosis.heldout) if extended else "",
        "held_out": len(diagnosis.heldout.gain_per_episode) > 1,
        "reasons": text.reasons_of(diagnosis),
        "has_model": bool(list(model)),
        "covariates": model.covariate_names,
        "reads_ahead": _reads_ahead(model),
        "version": __version__,
    }


def _reads_ahead(model: Chain) -> bool:
    """Whether a reading depends on future frames because the simulated stream lags the measured one."""
    return any(isinstance(member, Latency) and np.min(member.delay) < 0 for member in model.flattened)
