"""Text: a diagnosis as a table that a person reads in a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

from paxisim.diagnose.advice import NOT_ASKED
from paxisim.diagnose.faults import fault_in_words

if TYPE_CHECKING:
    from paxisim.diagnose.diagnosis import Diagnosis, FittedParameter, HeldOut, Interval, Place, Symptoms, Verdict

WIDTH = 80

SENTENCES: Mapping[Verdict, str] = {
    "no_discrepancy": "The simulation agrees with the measurement within noise and tolerances.",
    "explained": "The causes below explain the difference; nothing of note is left over.",
    "ambiguous": "The causes below explain the difference, but so do their rivals: record what is advised.",
    "partly_explained": "The causes below explain a part; what else there is stands under Left over.",
    "unexplained": "The measurement differs from the simulation, and no known cause explains it.",
}

ONE_EPISODE = "The causes below explain the difference, but one episode makes no name certain: record several."


def is_of_one_episode(diagnosis: Diagnosis) -> bool:
    """Whether a verdict is ambiguous because nothing was held out, not because of rivals."""
    return diagnosis.verdict == "ambiguous" and not any(item.rivals for item in diagnosis.causes)


def text_of(diagnosis: Diagnosis) -> str:
    """The table, 80 columns wide."""
    sentence = ONE_EPISODE if is_of_one_episode(diagnosis) else SENTENCES[diagnosis.verdict]
    lines = [f"Verdict: {diagnosis.verdict}", *_wrap(sentence, "  ")]
    lines += [line for warning in diagnosis.symptoms.warnings for line in _wrap(f"Warning: {warning}", "")]
    lines += ["", *_table(diagnosis)] if diagnosis.causes else []
    lines += ["", *_figures(diagnosis.heldout)]
    if diagnosis.symptoms.left_over:
        lines += ["", "Left over"]
        lines += [line for item in diagnosis.symptoms.left_over for line in _wrap(f"- {item.what}", "  ")]
    if any((diagnosis.symptoms.axes, diagnosis.symptoms.phases)) and diagnosis.verdict != "no_discrepancy":
        lines += ["", "Where the error lives (share of its energy: before -> after)", *_places(diagnosis.symptoms)]
    reasons = reasons_of(diagnosis)
    if reasons:
        lines += ["", "Not testable with this recording"]
        for reason, names in reasons.items():
            lines += _wrap(f"- {', '.join(names)}: {reason}", "  ")
    if diagnosis.advice:
        lines += ["", "Record next"]
        lines += [line for item in diagnosis.advice for line in _wrap(f"- {item}", "  ")]
    return "\n".join(lines)


def reasons_of(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """By reason, the causes that the recording cannot show; those that were not asked for are left out."""
    reasons: dict[str, list[str]] = {}
    for name, why in diagnosis.not_testable.items():
        if why != NOT_ASKED:
            reasons.setdefault(why, []).append(name)
    return reasons


def _wrap(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent + "  ")


def _table(diagnosis: Diagnosis) -> list[str]:
    lines = [f"{'Cause':<16}{'held-out gain':<26}{'confidence':>10}  rivals"]
    for cause in diagnosis.causes:
        rivals = ", ".join(cause.rivals) or "none"
        head = f"{cause.name[:15]:<16}{_percent(cause.gain):<26}{diagnosis.confidence.get(cause.name, 0):>10.0%}  "
        first, *rest = textwrap.wrap(rivals, WIDTH - len(head))
        lines += [head + first, *[" " * len(head) + line for line in rest]]
        numbers = fault_in_words(diagnosis, cause.name) or _parameters(cause.parameters)
        lines += _wrap(numbers, "  ") + _wrap(cause.evidence, "  ")
    return lines


def _percent(value: Interval) -> str:
    if value.low is None or value.high is None:
        return f"{value.value:.1%}"
    return f"{value.value:.1%} [{value.low:.1%}, {value.high:.1%}]"


def _parameters(parameters: tuple[FittedParameter, ...]) -> str:
    """The parameters in a line; many are summed up by their range."""
    if len(parameters) > 8:
        values = [p.value.value for p in parameters]
        unit = "" if parameters[0].unit == "1" else f" {parameters[0].unit}"
        return f"{len(parameters)} parameters from {min(values):.3g} to {max(values):.3g}{unit}"
    return ", ".join(f"{p.name} {p.value}{'' if p.unit == '1' else ' ' + p.unit}" for p in parameters)


def _figures(heldout: HeldOut) -> list[str]:
    ceiling = "not run" if heldout.ceiling_nrmse is None else f"{heldout.ceiling_nrmse:.1%}"
    share = "nothing to explain" if heldout.explained is None else _percent(heldout.explained)
    lines = [
        "Held-out error (normalised RMSE)",
        f"  simulation {heldout.nrmse_before:.1%}, extended model {heldout.nrmse_after:.1%}, "
        f"noise floor {heldout.noise_floor:.1%}",
        f"  explained of what can be: {share}",
        f"  black box: {ceiling}"
        + (f", explains {heldout.ceiling_explained:.1%}" if heldout.ceiling_explained is not None else ""),
    ]
    return lines + (_wrap(heldout.note, "  ") if heldout.note else [])


def _places(symptoms: Symptoms) -> list[str]:
    lines = []
    for title in ("pads", "axes", "phases", "frequencies", "taxels"):
        places: tuple[Place, ...] = getattr(symptoms, title)
        shown = sorted(places, key=lambda place: -place.before)[:4]
        text = ", ".join(f"{place.where} {place.before:.0%} -> {place.after:.0%}" for place in shown)
        lines += _wrap(f"{title}: {text}", "  ") if text else []
    return lines
