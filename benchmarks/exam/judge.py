"""Right or wrong: the names of a diagnosis beside the hidden causes.

A cause counts as named if it is named, or if the verdict is ``ambiguous`` and it is a rival of a name. `quantisation`
is ignored where the sensor reads whole counts, as that is then true.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol


class Answer(Protocol):
    """What a judge needs to know; `harness.Outcome` has it.

    ``about`` has the entries ``accepted``, ``tolerated``, ``effects`` and, for a broken stream, ``broken``.
    """

    @property
    def kind(self) -> str: ...  # noqa: D102
    @property
    def true(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def verdict(self) -> str: ...  # noqa: D102
    @property
    def named(self) -> dict[str, tuple[str, ...]]: ...  # noqa: D102
    @property
    def said(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def about(self) -> dict[str, Any]: ...  # noqa: D102


@dataclass(frozen=True)
class Judgement:
    """What is right about an answer.

    Attributes:
        exact: The hidden causes are named, and nothing else.
        by_rival: The same, if rivals of an ``ambiguous`` verdict count; False if `exact`.
        contained: All hidden causes are named, rivals included, perhaps among others.
        false: Names that are neither hidden, nor have a hidden rival, nor are accepted.
        confident: Verdict ``explained`` with a false name.
        right: What the kind of the case asks for: exact or by rivals where something is hidden, no false name in a
            null, an open question for an outsider, and so on.
    """

    exact: bool
    by_rival: bool
    contained: bool
    false: tuple[str, ...]
    confident: bool
    right: bool


def judge(answer: Answer, same: Mapping[str, str] | None = None) -> Judgement:
    """Return the judgement of an answer.

    Args:
        answer: The answer to a case.
        same: Names that count as another, decided before the examination is opened.
    """
    as_one = dict(same or {})
    true = set(answer.true)
    names: dict[str, set[str]] = {}
    for name, rivals in answer.named.items():
        one = as_one.get(name, name)
        if one in true or one not in answer.about["tolerated"]:
            names.setdefault(one, set()).update(as_one.get(rival, rival) for rival in rivals)
    answered = answer.verdict not in ("refused", "crashed", "unrelated")
    stands_for = _matched(names, true, answer.verdict == "ambiguous")
    false = tuple(n for n in names if n not in stands_for and n not in answer.about["accepted"])
    exact = answered and set(names) == true
    whole = answered and set(stands_for.values()) == true
    by_rival = whole and not exact and len(stands_for) == len(names)
    confident = answer.verdict == "explained" and bool(false)
    right = _right(answer, names, exact or by_rival, false)
    return Judgement(exact, by_rival, whole, false, confident, right)


def _matched(names: Mapping[str, set[str]], true: set[str], ambiguous: bool) -> dict[str, str]:
    """Return for each name the hidden cause that it stands for: itself, or else a rival that has no name of its own."""
    found = {name: name for name in names if name in true}
    for name, rivals in names.items() if ambiguous else ():
        open_causes = sorted((rivals & true) - set(found.values()))
        if name not in found and open_causes:
            found[name] = open_causes[0]
    return found


def _right(answer: Answer, names: Mapping[str, set[str]], whole: bool, false: tuple[str, ...]) -> bool:
    if answer.verdict == "crashed":
        return False
    if answer.kind in ("null", "hardnull"):
        return not false
    if answer.kind == "outsider":
        return answer.verdict not in ("explained", "no_discrepancy")
    if answer.kind == "poor":
        rivals = set().union(*names.values()) if names else set()
        open_question = answer.verdict == "ambiguous" and bool(set(answer.true) & (set(names) | rivals))
        return not names or open_question or (len(names) == 1 and not false)
    if answer.kind == "broken":
        return _noticed(answer, names, false)
    return whole


def _noticed(answer: Answer, names: Mapping[str, set[str]], false: tuple[str, ...]) -> bool:
    """Return whether a broken stream was noticed: refused, unrelated, left open without names, or told in words."""
    if answer.verdict in ("refused", "unrelated"):
        return True
    words = " ".join(answer.said)
    if answer.about["broken"] == "clocks":
        return not false and (answer.verdict == "clocks_differ" or "clock" in words.lower())
    if answer.about["broken"] == "milli":
        return not false and re.search(r"\bunits?\b|\bmilli|\bmN\b|\b1000\b", words) is not None
    return not names and answer.verdict in ("unexplained", "partly_explained", "clocks_differ")
