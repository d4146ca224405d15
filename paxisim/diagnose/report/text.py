"""Text: a diagnosis as plain text for the terminal."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from paxisim.diagnose.explain.advice import NOT_ASKED
from paxisim.diagnose.report.faults import fault_in_words

if TYPE_CHECKING:
    from paxisim.diagnose.result import FittedParameter, FoundCause, HeldOut, Place, Result, Symptoms, Verdict

TEXT_COLUMNS = 80
MAX_LISTED = 8  # most elements of an array listed one by one; longer arrays are summarised by their range
INDEX = re.compile(r"(_\d+)+$")  # index of an element at the end of a parameter's name

SENTENCES: Mapping[Verdict, str] = {
    "no_discrepancy": "The simulation agrees with the measurement within noise and tolerances.",
    "clocks_differ": "The clocks of the two streams differ. Once they are aligned, the simulation agrees.",
    "explained": "The causes below explain the difference; the residual shows no further structure.",
    "ambiguous": "The causes below explain the difference, but so do their rivals. See Record next.",
    "partly_explained": "The causes below explain part of the difference. See What remains.",
    "unexplained": "The simulation differs from the measurement, and no known cause explains it.",
    "unrelated": "The two streams are not of the same motion, so nothing was fitted. See What remains.",
}

_AGREES = ("no_discrepancy", "clocks_differ")
ONE_EPISODE = (
    "The causes below explain the difference, but a single episode cannot confirm them. Record several episodes."
)


EXPLAINS = "Explains: by how much the error grows when the model is refitted without the cause."
CONFIDENCE = (
    "Confidence: how often the cause passes its test when episodes are resampled, divided among the cause and "
    "its rivals. A parameter at its bound counts as one more rival."
)


def is_of_one_episode(diagnosis: Result) -> bool:
    """Whether the verdict is ambiguous because no episode was held out, rather than because of rivals."""
    return diagnosis.verdict == "ambiguous" and not any(item.rivals for item in diagnosis.causes)


def text_of(diagnosis: Result) -> str:
    """Return the diagnosis as text, 80 columns wide."""
    sentence = ONE_EPISODE if is_of_one_episode(diagnosis) else SENTENCES[diagnosis.verdict]
    clocks = f", clocks differ by {abs(diagnosis.clock_shift):.2f} s" if diagnosis.clock_shift else ""
    lines = [f"Verdict: {diagnosis.verdict}{clocks}", *_wrap(sentence, "  ")]
    lines += _wrap(diagnosis.known, "  ")
    lines += [line for warning in diagnosis.symptoms.warnings for line in _wrap(f"Warning: {warning}", "")]
    lines += ["", *_table(diagnosis)] if diagnosis.causes else []
    lines += ["", *_figures(diagnosis.heldout, bool(diagnosis.causes))] if diagnosis.verdict != "unrelated" else []
    if diagnosis.symptoms.left_over:
        lines += ["", "What remains"]
        lines += [line for item in diagnosis.symptoms.left_over for line in _wrap(f"- {item.what}", "  ")]
    if any((diagnosis.symptoms.axes, diagnosis.symptoms.phases)) and diagnosis.verdict not in _AGREES:
        compared = ", before -> after" if diagnosis.causes else ""
        lines += ["", f"Where the error is (share of its energy{compared})"]
        lines += _places(diagnosis.symptoms, bool(diagnosis.causes))
    reasons = reasons_of(diagnosis)
    if reasons:
        lines += ["", "Not testable with this recording"]
        for reason, names in reasons.items():
            lines += _wrap(f"- {', '.join(names)}: {reason}", "  ")
    if diagnosis.advice:
        lines += ["", "Record next"]
        lines += [line for item in diagnosis.advice for line in _wrap(f"- {item}", "  ")]
    return "\n".join(lines)


def reasons_of(diagnosis: Result) -> dict[str, list[str]]:
    """Return the causes that the recording cannot test by reason, without those that the caller excluded."""
    reasons: dict[str, list[str]] = {}
    for name, why in diagnosis.not_testable.items():
        if why != NOT_ASKED:
            reasons.setdefault(why, []).append(name)
    return reasons


def _wrap(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, TEXT_COLUMNS, initial_indent=indent, subsequent_indent=indent + "  ")


def _table(diagnosis: Result) -> list[str]:
    lines = [f"{'Cause':<16}{'explains':<26}{'confidence':>10}  rivals"]
    for cause in diagnosis.causes:
        rivals = ", ".join(cause.rivals) or "none"
        head = f"{cause.name[:15]:<16}{cause.gain.percent:<26}{diagnosis.confidence.get(cause.name, 0):>10.0%}  "
        first, *rest = textwrap.wrap(rivals, TEXT_COLUMNS - len(head))
        lines += [head + first, *[" " * len(head) + line for line in rest]]
        for part in cause.parts:
            own = [p for p in cause.parameters if p.name in part.parameters]
            lines += _wrap(f"{part.name}, {part.words}: explains {part.gain.percent}; {_listed(own)}", "  ")
        rest = outside_parts(cause)
        lines += _wrap(fault_in_words(diagnosis, cause.name) or _listed(rest), "  ")
        for name, words in meanings(rest):
            lines += _wrap(f"({name}: {words})", "  ")
        lines += _wrap(cause.evidence, "  ")
    return [*lines, "", *_wrap(EXPLAINS, ""), *_wrap(CONFIDENCE, "")]


def outside_parts(cause: FoundCause) -> list[FittedParameter]:
    """Return the parameters of a cause that belong to none of its parts."""
    in_parts = {name for part in cause.parts for name in part.parameters}
    return [p for p in cause.parameters if p.name not in in_parts]


def _listed(parameters: Sequence[FittedParameter]) -> str:
    return ", ".join(f"{name} {value}" for name, value in parameters_in_words(parameters))


def parameters_in_words(parameters: Sequence[FittedParameter]) -> list[tuple[str, str]]:
    """Return names and values of the parameters as text; long arrays are summarised by their range."""
    lines = []
    for own in _arrays(parameters).values():
        values = [p.value.value for p in own]
        if len(own) > MAX_LISTED:
            name = INDEX.sub("", own[0].name)
            lines.append((name, f"{len(own)} numbers from {min(values):.3g} to {max(values):.3g}{_unit(own[0])}"))
        else:
            lines += [(p.name, f"{p.value}{_unit(p)}") for p in own]
    return lines


def _arrays(parameters: Sequence[FittedParameter]) -> dict[str, list[FittedParameter]]:
    """Group the parameters by name; elements of one array form a group."""
    arrays: dict[str, list[FittedParameter]] = {}
    for parameter in parameters:
        arrays.setdefault(INDEX.sub("", parameter.name), []).append(parameter)
    return arrays


def meanings(parameters: Sequence[FittedParameter]) -> list[tuple[str, str]]:
    """Return names and meanings of the listed parameters that have an explanation."""
    listed = [p for own in _arrays(parameters).values() if len(own) <= MAX_LISTED for p in own]
    return [(p.name, p.words) for p in listed if p.words]


def _unit(parameter: FittedParameter) -> str:
    return "" if parameter.unit == "1" else f" {parameter.unit}"


def _figures(heldout: HeldOut, extended: bool) -> list[str]:
    after = f", extended model {heldout.nrmse_after:.1%}" if extended else ""
    errors = f"simulation {heldout.nrmse_before:.1%}{after}, noise floor {heldout.noise_floor:.1%}"
    if heldout.ceiling_nrmse is not None:
        errors += f", black box {heldout.ceiling_nrmse:.1%}"
    lines = ["Held-out error (normalised RMSE)", f"  {errors}"]
    if extended and heldout.explained is not None:
        shares = f"the extended model explains {heldout.explained.percent} of the explainable error"
        if heldout.ceiling_explained is not None:
            shares += f", the black box {max(heldout.ceiling_explained, 0.0):.1%}"
        lines += _wrap(shares, "  ")
    beyond = black_box_in_words(heldout) if extended else ""
    return lines + [line for text in (beyond, heldout.note) if text for line in _wrap(text, "  ")]


def black_box_in_words(heldout: HeldOut) -> str:
    """Return a sentence on what the black box explains beyond the model; empty if it explains no more."""
    ceiling, explained = heldout.ceiling_explained, heldout.explained
    if ceiling is None or explained is None or ceiling <= (explained.high or explained.value):
        return ""
    return (
        f"The black box explains another {ceiling - explained.value:.0%} of the explainable error. This part depends "
        "on the forces and their history, but no known cause describes it."
    )


def _places(symptoms: Symptoms, extended: bool) -> list[str]:
    lines = []
    for title in ("pads", "axes", "phases", "frequencies", "taxels"):
        places: tuple[Place, ...] = getattr(symptoms, title)
        shown = sorted(places, key=lambda place: -place.before)[:4]
        after = [f" -> {place.after:.0%}" if extended else "" for place in shown]
        text = ", ".join(f"{place.where} {place.before:.0%}{now}" for place, now in zip(shown, after, strict=True))
        lines += _wrap(f"{title}: {text}", "  ") if text else []
    return lines
