"""Table: rates with intervals next to their targets, gains, and errors of the named effects."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from harness import Outcome, print_costs, print_rate

from hidden_table.cases import HARD

STRONG = 0.1  # share of the noise energy; an effect above it must be named


def table(outcomes: Sequence[Outcome]) -> None:
    """Print all tables. Nothing here distinguishes one cause from another."""
    singles, pairs, nulls, outsiders = (
        [o for o in outcomes if o.kind == kind] for kind in ("single", "pair", "null", "outsider")
    )
    strong = [o for o in singles if o.about["signal"] > STRONG]
    clear = [o for o in pairs if o.about["weakest"] > STRONG]
    print(f"{'':<62} {'target':<8} rate (95 % Wilson interval)")
    print_rate(f"exact singles, signal > {STRONG}", strong, lambda o: o.exact, ">= 95 %")
    print_rate("exact singles, all", singles, lambda o: o.exact)
    print_rate("exact pairs", pairs, lambda o: o.exact, ">= 88 %")
    print_rate("both of a pair named", pairs, lambda o: o.contained, ">= 97 %")
    print_rate(f"exact pairs, each signal > {STRONG}", clear, lambda o: o.exact)
    print_rate("nulls with a false name", nulls, lambda o: bool(o.named), "<= 1 %")
    print_rate("outsiders flagged", outsiders, lambda o: o.flagged, ">= 90 %")
    for kind in HARD:
        some = [o for o in outcomes if o.kind == kind]
        print_rate(f"{kind}: exact", some, lambda o: o.exact)
        print_rate(f"{kind}: all named, perhaps with others", some, lambda o: o.contained)
        print_rate(f"{kind}: confidently wrong", some, lambda o: o.confidently_wrong)
    print_rate("confidently wrong, of everything", outcomes, lambda o: o.confidently_wrong, "<= 2 %")
    print_rate("not counted above: right if a cause is replaced by its rival", [*singles, *pairs], by_rivals)
    print(f"verdicts: {dict(Counter(o.verdict for o in outcomes))}")
    _gains([o for o in (*strong, *pairs) if o.about.get("share") is not None])
    _errors([o for o in outcomes if o.about.get("errors")])
    print_costs(outcomes)


def by_rivals(outcome: Outcome) -> bool:
    """Whether the named set is wrong, but right if causes are replaced by rivals named for them."""
    if outcome.exact or len(outcome.named) != len(outcome.true):
        return False
    choices = itertools.product(*((name, *rivals) for name, rivals in outcome.named.items()))
    return any(set(choice) == set(outcome.true) for choice in choices)


def _quantiles(values: Iterable[float | None]) -> str:
    known = np.array([v for v in values if v is not None])
    return f"{np.median(known):.3f}, {np.quantile(known, 0.1):.3f} ({len(known)} cases)" if len(known) else "-"


def _gains(some: Sequence[Outcome]) -> None:
    """Print the held-out gain as a share of the headroom, for cases whose effect stands above the noise."""
    print("held-out gain as a share of the headroom: median, p10")
    print(f"  above the diagnosis' own noise floor        {_quantiles(o.explained for o in some)}")
    print(f"  above what the true effect leaves           {_quantiles(o.about['share'] for o in some)}")
    print(f"  black box, above the same noise floor       {_quantiles(o.ceiling for o in some)}")


def _errors(some: Sequence[Outcome]) -> None:
    """Print the errors of correctly named effects, see `hidden.compare`."""
    rows = [(name, error) for o in some for name, error in o.about["errors"].items()]
    print("effects named correctly, errors relative to the effect: median, p10")
    for name in sorted({name for name, _ in rows}):
        print(f"  {name:<42}  {_quantiles(error for other, error in rows if other == name)}")


def misses(outcomes: Sequence[Outcome]) -> None:
    """Print the wrong answers, the confidently wrong ones first."""
    wrong = [o for o in outcomes if not (o.flagged if o.kind == "outsider" else o.exact)]
    for o in sorted(wrong, key=lambda o: (not o.confidently_wrong, -o.about["signal"])):
        print(f"  {o.name:<12} {' + '.join(o.true) or 'nothing':<34} signal {o.about['signal']:8.3f}  {o}")
