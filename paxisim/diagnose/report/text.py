"""Text: a diagnosis as plain text for the terminal, and its causes and faults in words."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.failing_taxels import FailingTaxels
from paxisim.augment.layout_faults import LayoutFault
from paxisim.augment.swapped_taxels import SwappedTaxels
from paxisim.diagnose.explain.advice import NOT_ASKED
from paxisim.diagnose.report.effect import unwrapped
from paxisim.diagnose.report.style import AXES
from paxisim.diagnose.result import FittedParameter, HeldOut, Result, Symptoms, pad_in_words, percentage

TEXT_COLUMNS = 80
MAX_LISTED = 8  # most elements of an array, or taxels of a pad, listed one by one
INDEX = re.compile(r"(_\d+)+$")  # index of an element at the end of a parameter's name

HEADS: Mapping[str, str] = {
    "no_discrepancy": "The simulation agrees with the measurement",
    "clocks_differ": "The clocks of the two streams differ",
    "explained": "Explained by {}",
    "ambiguous": "Explained by {}",
    "one_episode": "Perhaps explained by {}",
    "partly_explained": "Partly explained by {}",
    "unexplained": "The simulation differs from the measurement, and no known cause explains it",
    "unrelated": "The two streams are not of the same motion",
}
TAILS: Mapping[str, str] = {
    "no_discrepancy": "The residual is within noise and tolerances.",
    "clocks_differ": "Once they are aligned, the residual is within noise and tolerances.",
    "explained": "The residual shows no further structure.",
    "ambiguous": "This recording cannot tell the rivals apart. See What to record next.",
    "one_episode": "A single episode cannot confirm a cause. Record several episodes.",
    "unrelated": "Nothing was fitted. See What remains and What to record next.",
}
IN_HEAD = 3  # causes that a headline names, and parameters of each at the top of the page
APART = 0.15  # difference between the sum of the gains and what all causes explain, above which gains do not add up
EXPLAINS = "Explains: by how much the error grows when the model is refitted without the cause."
CONFIDENCE = (
    "Confidence: how often the cause passes its test when episodes are resampled, divided among the cause and "
    "its rivals. A parameter at its bound counts as one more rival."
)


def _kind(diagnosis: Result) -> str:
    """The verdict, or "one_episode" if it is ambiguous because no episode was held out, rather than for rivals."""
    alone = diagnosis.verdict == "ambiguous" and not any(item.rivals for item in diagnosis.causes)
    return "one_episode" if alone else diagnosis.verdict


def headline(diagnosis: Result) -> str:
    """Return what was found, in a line; causes that can take over much of one another are given their sum."""
    explained, named = diagnosis.heldout.explained, []
    apart = 0.0 if explained is None else abs(sum(cause.gain.value for cause in diagnosis.causes) - explained.value)
    together = explained is not None and apart >= APART * explained.value
    for cause in diagnosis.causes:
        about = [] if together else [percentage(cause.gain.value)]
        about += [f"or {' or '.join(cause.rivals)}"] if cause.rivals else []
        named.append(f"{cause.name} ({', '.join(about)})".removesuffix(" ()").replace("_", " "))
    if len(named) > IN_HEAD:
        named[IN_HEAD - 1 :] = [f"{len(named) - IN_HEAD + 1} more causes"]
    joined = f"{', '.join(named[:-1])} and {named[-1]}" if len(named) > 1 else "".join(named)
    if explained is not None and together:
        joined += f" ({percentage(explained.value)}{' together' if len(named) > 1 else ''})"
    return HEADS[_kind(diagnosis)].format(joined)


def tail(diagnosis: Result) -> str:
    """Return what follows from the verdict, in a sentence or two."""
    remains = ["See What remains."] if diagnosis.symptoms.left_over else []
    return TAILS.get(_kind(diagnosis)) or " ".join([*diagnosis.symptoms.reasons, *remains])


def text_of(diagnosis: Result) -> str:
    """Return the diagnosis as text, 80 columns wide."""
    symptoms, extended = diagnosis.symptoms, bool(diagnosis.causes)
    clocks = f", clocks differ by {abs(diagnosis.clock_shift):.2f} s" if diagnosis.clock_shift else ""
    lines = [f"Verdict: {diagnosis.verdict}{clocks}"]
    lines += _wrap("  ", f"{headline(diagnosis)}. {tail(diagnosis)}", diagnosis.known)
    lines += _wrap("", *(f"Warning: {warning}" for warning in symptoms.warnings))
    lines += ["", *_table(diagnosis)] if extended else []
    lines += ["", *_figures(diagnosis.heldout, extended)] if diagnosis.verdict != "unrelated" else []
    if symptoms.left_over:
        lines += ["", "What remains", *_wrap("  ", *(f"- {item.what}" for item in symptoms.left_over))]
    if (symptoms.axes or symptoms.phases) and diagnosis.verdict not in ("no_discrepancy", "clocks_differ"):
        compared = ", before -> after" if extended else ""
        lines += ["", f"Where the error is (share of its energy{compared})", *_places(symptoms, extended)]
    if reasons := reasons_of(diagnosis):
        listed = (f"- {', '.join(names)}: {reason}" for reason, names in reasons.items())
        lines += ["", "Not testable with this recording", *_wrap("  ", *listed)]
    if diagnosis.advice:
        lines += ["", "What to record next", *_wrap("  ", *(f"- {item}" for item in diagnosis.advice))]
    return "\n".join(lines)


def reasons_of(diagnosis: Result) -> dict[str, list[str]]:
    """Return the causes that the recording cannot test by reason, without those that the caller excluded."""
    asked = {name: why for name, why in diagnosis.not_testable.items() if why != NOT_ASKED}
    return {why: [name for name, other in asked.items() if other == why] for why in asked.values()}


def _wrap(indent: str, *texts: str) -> list[str]:
    wrapper = textwrap.TextWrapper(TEXT_COLUMNS, initial_indent=indent, subsequent_indent=indent + "  ")
    return [line for text in texts for line in wrapper.wrap(text)]


def _table(diagnosis: Result) -> list[str]:
    lines = [f"{'Cause':<16}{'explains':<26}{'confidence':>10}  rivals"]
    for cause in diagnosis.causes:
        rivals = ", ".join(cause.rivals) or "none"
        confidence = percentage(diagnosis.confidence.get(cause.name, 0))
        head = f"{cause.name[:15]:<16}{cause.gain.percent():<26}{confidence:>10}  "
        first, *rest = textwrap.wrap(rivals, TEXT_COLUMNS - len(head))
        lines += [head + first, *[" " * len(head) + line for line in rest]]
        for part in cause.parts:
            own = differences([p for p in cause.parameters if p.name in part.parameters], diagnosis)
            lines += _wrap("  ", f"{part.name}, {part.words}: explains {part.gain.percent()}; {own}")
        in_parts = {name for part in cause.parts for name in part.parameters}
        rest = [p for p in cause.parameters if p.name not in in_parts]
        explained = (f"({name}: {words})" for name, _, words in parameters_in_words(rest, diagnosis) if words)
        listed = fault_in_words(diagnosis, cause.name) or differences(rest, diagnosis)
        lines += _wrap("  ", listed, *explained, cause.evidence)
    return [*lines, "", *_wrap("", EXPLAINS, CONFIDENCE)]


def differences(parameters: Sequence[FittedParameter], diagnosis: Result, most: int = 99) -> str:
    """List the parameters that differ from neutral, most first and at most so many, and count the others.

    Long arrays are left to the details if there are other parameters.
    """
    single = [p for own in _arrays(parameters).values() if len(own) <= MAX_LISTED for p in own]
    ordered = sorted(single or parameters, key=lambda p: -(p.size or 0.0))
    near = [p for p in ordered[1:] if p.neutral is not None and p.size is not None and p.size < 1]
    shown = parameters_in_words([p for p in ordered if p not in near], diagnosis)
    words = [f"{name} {value}" for name, value, _ in shown[:most]]
    words += [f"{len(shown) - most} more"] if len(shown) > most else []
    counts = Counter(f"{p.neutral:g}" for p in near)
    return ", ".join([*words, *(f"{n} other{'s' * (n > 1)} near {neutral}" for neutral, n in counts.items())])


def parameters_in_words(parameters: Sequence[FittedParameter], diagnosis: Result) -> list[tuple[str, str, str]]:
    """Return names, values and meanings of the parameters; long arrays are summarised by their range."""
    lines, pads = [], [place.where for place in diagnosis.symptoms.pads]
    for name, own in _arrays(parameters).items():
        unit = "" if own[0].unit == "1" else f" {own[0].unit}"
        if len(own) > MAX_LISTED:
            values, places = [p.value.value for p in own], {tuple(p.name.split("_")[-4:]) for p in own}
            what = {1: ": {} numbers", 3: " of {} taxels"}.get(own[0].name[len(name) :].count("_"), " of {} channels")
            lines.append((name + what.format(len(places)), f"from {min(values):.3g} to {max(values):.3g}{unit}", ""))
            continue
        for p in own:
            shown = p.name if p.pad is None else f"{pads[p.pad]}: {name.replace('_', ' ')}"
            degrees = f" ({np.rad2deg(p.value.value):.1f} deg)" if p.unit == "rad" else ""
            lines.append((shown, f"{p.value}{unit}{degrees}", p.words))
    return lines


def _arrays(parameters: Sequence[FittedParameter]) -> dict[str, list[FittedParameter]]:
    """Group the parameters by name; elements of one array form a group."""
    arrays: dict[str, list[FittedParameter]] = {}
    for parameter in parameters:
        arrays.setdefault(INDEX.sub("", parameter.name), []).append(parameter)
    return arrays


def _figures(heldout: HeldOut, extended: bool) -> list[str]:
    after = f", extended model {heldout.nrmse_after:.1%}" if extended else ""
    errors = f"simulation {heldout.nrmse_before:.1%}{after}, noise floor {heldout.noise_floor:.1%}"
    if heldout.ceiling_nrmse is not None:
        errors += f", black box {heldout.ceiling_nrmse:.1%}"
    shares = ""
    if extended and heldout.explained is not None:
        shares = f"the extended model explains {heldout.explained.percent()} of the explainable error"
        if heldout.ceiling_explained is not None:
            shares += f", the black box {max(heldout.ceiling_explained, 0.0):.1%}"
    beyond = black_box_in_words(heldout) if extended else ""
    return ["Held-out error (normalised RMSE)", f"  {errors}", *_wrap("  ", shares, beyond, heldout.note)]


def black_box_in_words(heldout: HeldOut) -> str:
    """Return a sentence on what the black box explains beyond the model; empty if it explains no more."""
    ceiling, explained = heldout.ceiling_explained, heldout.explained
    if ceiling is None or explained is None or ceiling <= explained.ends[1] or ceiling - explained.value < 0.005:
        return ""
    words = f"The black box explains another {ceiling - explained.value:.0%} of the explainable error. This part "
    return words + "depends on the forces and their history, but no known cause describes it."


def _places(symptoms: Symptoms, extended: bool) -> list[str]:
    lines = []
    for title in ("pads", "axes", "phases", "frequencies", "taxels"):
        shown = sorted(getattr(symptoms, title), key=lambda place: -place.before)[:4]
        texts = [f"{p.where} {p.before:.0%}" + (f" -> {p.after:.0%}" if extended else "") for p in shown]
        lines += _wrap("  ", f"{title}: {', '.join(texts)}") if texts else []
    return lines


def fault_in_words(diagnosis: Result, name: str) -> str:
    """Describe a layout fault, swapped taxels or dead taxels; empty for other causes."""
    member = unwrapped(diagnosis.model[name]) if name in diagnosis.model.names else None
    pads = [place.where for place in diagnosis.symptoms.pads]
    words: list[str] = []
    if isinstance(member, LayoutFault):
        words = _layout(member, pads)
    elif isinstance(member, SwappedTaxels):
        swapped: dict[int, list[str]] = {}
        for pad, *own in member.rings:
            taxels = [f"({row}, {col})" for row, col in zip(own[::2], own[1::2], strict=True)]
            swapped.setdefault(pad, []).extend(_moved([*range(1, len(taxels)), 0], taxels))
        words = [f"{_pad(pads, pad)} {_first(own)}" for pad, own in sorted(swapped.items())]
    elif isinstance(member, DeadTaxels):
        for which, what in ((member.dead, "no response"), (member.stuck, "stuck")):
            places = np.argwhere(np.asarray(which) > 0)
            named = []
            for pad in np.unique(places[:, 0]):
                own = [f"({row}, {col}){_since(member, p, row, col)}" for p, row, col in places if p == pad]
                named.append(f"{_pad(pads, pad)} {_first(own)}")
            words += [f"{what}: {', '.join(named)}"] if named else []
    return "; ".join(words)


def _layout(fault: LayoutFault, pads: Sequence[str]) -> list[str]:
    words = ["rows and columns swapped"] if fault.transpose else []
    flipped = [name for name, flip in (("rows", fault.flip_rows), ("columns", fault.flip_cols)) if flip]
    words += [f"{' and '.join(flipped)} reversed"] if flipped else []
    words += _moved(fault.axis_order, AXES)
    signs = [AXES[axis] for axis, sign in enumerate(fault.axis_signs) if sign < 0]
    words += [f"sign of {' and '.join(signs)} reversed"] if signs else []
    order = fault.pad_order or ()
    return words + _moved(order, [_pad(pads, number) for number in range(len(order))])


def _moved(order: Sequence[int], names: Sequence[str]) -> list[str]:
    moved = [(names[came], names[place]) for place, came in enumerate(order) if came != place]
    if len(moved) == 2:
        return [f"{moved[1][0]} and {moved[0][0]} swapped"]
    return [", ".join(f"{came} read as {place}" for came, place in moved)] if moved else []


def _since(fault: DeadTaxels, pad: int, row: int, col: int) -> str:
    """Say which axes of a taxel have failed and since when; empty for all axes from the start."""
    if not isinstance(fault, FailingTaxels):
        return ""
    grid = np.broadcast_shapes(np.shape(fault.dead), np.shape(fault.stuck))
    since = np.broadcast_to(np.asarray(fault.since, dtype=float), (grid[0], 3, *grid[1:]))[pad, :, row, col]
    words = ""
    for moment in np.unique(since[np.isfinite(since)]):
        axes = [axis for axis, own in zip(AXES, since, strict=True) if own == moment]
        words += f" {' and '.join(axes)}" if len(axes) < len(AXES) else ""
        words += f" since {moment:.1f} s" if moment > 0 else ""
    return words


def _first(names: Sequence[str]) -> str:
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return f"{', '.join(names[:MAX_LISTED])}{more}"


def _pad(pads: Sequence[str], number: int) -> str:
    return pad_in_words(pads[number] if number < len(pads) else str(number))
