"""Report: the table of results, by group and kind, and the diagnoses of cases that are wrong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from hidden_table.table import wilson

from injected.judge import Outcome


def show(outcomes: Sequence[Outcome], *, kinds: bool, misses: bool) -> None:
    """Print the table.

    Args:
        outcomes: Outcomes of all cases.
        kinds: Whether to print a row for each kind as well.
        misses: Whether to print a line for each case that is wrong.
    """
    groups = {name: [o for o in outcomes if o.group == name] for name in ("injected", "null", "broken")}
    effects, empty, broken = groups.values()
    print(f"{'':<52} {'target':<9} {'rate (95 % Wilson interval)':<28}")
    _row("injected effects: exact", ">= 75 %", effects, lambda o: o.exact)
    _row("injected effects: kind and place right", ">= 90 %", effects, lambda o: o.kind_and_place)
    _row("nulls with a name", "0 %", empty, lambda o: bool(o.named) or o.verdict in ("crashed", "refused"))
    _row("explained by a cause of another kind (all of these)", "0 %", effects + empty, lambda o: o.false_and_explained)
    _row("streams that do not correspond: detected", "100 %", broken, lambda o: o.told)
    _row("    reported, whatever else is named", "", broken, lambda o: o.warned)
    _row("crashed or timed out (all)", "0 %", outcomes, lambda o: o.verdict == "crashed")
    seconds = [o.seconds for o in outcomes]
    if seconds:
        print(
            f"seconds per diagnosis: median {np.median(seconds):.1f}, p90 {np.quantile(seconds, 0.9):.1f}, maximum "
            f"{max(seconds):.1f}; peak memory {max(o.memory for o in outcomes):.2f} GB"
        )
    signals = [o.signal for o in effects]
    if signals:
        low, middle, high = np.quantile(signals, [0, 0.5, 1])
        print(
            f"energy of the effects over that of the regression's residual (minimum, median, maximum): {low:.3g}, "
            f"{middle:.3g}, {high:.3g}"
        )
    if kinds:
        _kinds(outcomes)
    if misses:
        for o in outcomes:
            if not o.right:
                print(said(o))


def _row(what: str, target: str, some: Sequence[Outcome], hit: Callable[[Outcome], bool]) -> None:
    if some:
        hits = sum(map(hit, some))
        low, high = wilson(hits, len(some))
        rate = f"{100 * hits / len(some):.0f} % ({100 * low:.0f} to {100 * high:.0f})"
        print(f"{f'{what} ({hits}/{len(some)})':<62} {target:<9} {rate}")


def _kinds(outcomes: Sequence[Outcome]) -> None:
    print(f"\n{'kind':<34} {'right':<8} {'kind and place':<15} named")
    for group, kind in dict.fromkeys((o.group, o.kind) for o in outcomes):
        own = [o for o in outcomes if (o.group, o.kind) == (group, kind)]
        named = Counter(", ".join(o.named) or o.verdict for o in own)
        place = f"{sum(o.kind_and_place for o in own)}/{len(own)}" if group == "injected" else ""
        words = "; ".join(f"{what} x{count}" if count > 1 else what for what, count in named.most_common())
        print(f"{group + ' ' + kind:<34} {f'{sum(o.right for o in own)}/{len(own)}':<8} {place:<15} {words}")


def said(o: Outcome) -> str:
    """Return a case and its diagnosis as two lines of text."""
    names = ", ".join(
        name + f" {o.confidence.get(name, 0):.2f}" + (f" ({' '.join(o.rivals[name])})" if o.rivals.get(name) else "")
        for name in o.named
    )
    last = o.said[-1].strip().splitlines()[-1] if o.verdict == "crashed" else " | ".join(o.said)
    match = "" if o.match is None else f", match {o.match:.2f}"
    share = "" if o.explained is None else f", explains {o.explained:.0%}"
    return (
        f"{o.name} {o.kind} [{o.words.split(';')[0]}], signal {o.signal:.3g}\n"
        f"    {o.verdict}: {names or 'nothing'}{share}{match}{'. ' + last if last else ''}"
    )
