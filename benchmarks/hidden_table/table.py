"""Table: rates with intervals next to their targets and the baselines, gains, and errors.

Nothing here distinguishes one cause from another unless the misses are requested (see `misses`). An exam can therefore
be repeated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from scipy.stats import binomtest

from hidden_table.misses import said, show_misses
from hidden_table.tasks import BASELINES, STRONG, Answer, Outcome, by_rivals, is_confidently_wrong, is_exact


def wilson(hits: float, count: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a rate."""
    interval = binomtest(round(hits), count).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def _rate(hits: float, count: int) -> str:
    if not count:
        return "-"
    low, high = wilson(hits, count)
    return f"{100 * hits / count:5.1f} % ({100 * low:.0f} to {100 * high:.0f})"


def _row(what: str, target: str, own: str, met: bool | None = None, others: Sequence[str] = ()) -> None:
    mark = "" if met is None else "met" if met else "MISSED"
    print(f"{what:<42} {target:<9} {own:<24} {mark:<7} " + " ".join(f"{other:<24}" for other in others))


def _rates(
    what: str,
    some: Sequence[Outcome],
    hit: Callable[[Outcome], bool],
    target: str = "",
    other: Callable[[set[str], set[str]], bool] | None = None,
) -> None:
    """Print a row: how often `hit` holds, and how often `other` (of named and true set) holds for each baseline."""
    if not some:
        return
    hits = sum(map(hit, some))
    met = None
    if target:
        limit = float(target.split()[1]) / 100
        met = hits / len(some) >= limit if target.startswith(">=") else hits / len(some) <= limit
    others = []
    if other:
        for name in BASELINES:
            here = [o for o in some if name in o.baselines]
            if here:
                others.append(_rate(sum(other(set(o.baselines[name]), set(o.task.true)) for o in here), len(here)))
    _row(f"{what} ({hits}/{len(some)})", target, _rate(hits, len(some)), met, others)


def table(outcomes: Sequence[Outcome], misses: bool = False) -> None:
    """Print all tables, and the misses if requested."""
    kinds = {kind: [o for o in outcomes if o.task.kind == kind] for kind in Counter(o.task.kind for o in outcomes)}
    main = [o for o in outcomes if o.task.kind != "poor"]
    if main:
        _main(kinds, main)
        _gains(main)
        _parameters(main)
    if "poor" in kinds:
        _poor(kinds["poor"], misses)
    _costs(outcomes)
    if misses:
        show_misses(outcomes)


def _main(kinds: dict[str, list[Outcome]], main: Sequence[Outcome]) -> None:
    def exact(named: set[str], true: set[str]) -> bool:
        return named == true

    def contained(named: set[str], true: set[str]) -> bool:
        return true <= named

    def anything(named: set[str], true: set[str]) -> bool:
        return bool(named)

    singles, pairs, triples = (kinds.get(kind, []) for kind in ("single", "pair", "triple"))
    nulls, outsiders = kinds.get("null", []), kinds.get("outsider", [])
    strong = [o for o in singles if o.signal > STRONG]
    others = [name for name in BASELINES if any(name in o.baselines for o in main)]
    print(f"{'':<42} {'target':<9} {'paxisim (95 % interval)':<24} {'':<7} " + " ".join(f"{n:<24}" for n in others))
    _rates(f"exact singles, signal > {STRONG}", strong, lambda o: o.exact, ">= 95 %", exact)
    _rates("exact singles, all", singles, lambda o: o.exact, "", exact)
    _rates("exact pairs", pairs, lambda o: o.exact, ">= 88 %", exact)
    _rates("both of a pair named", pairs, lambda o: o.contained, ">= 97 %", contained)
    clear = [o for o in pairs if o.weakest > STRONG]
    _rates(f"exact pairs, each signal > {STRONG}", clear, lambda o: o.exact, "", exact)
    _rates("both of such a pair named", clear, lambda o: o.contained, "", contained)
    _rates("exact triples", triples, lambda o: o.exact, ">= 65 %", exact)
    _rates("nulls with a false name", nulls, lambda o: bool(o.named), "<= 1 %", anything)
    _rates("nulls said to be unexplained", nulls, lambda o: o.flagged)
    _rates("outsiders flagged", outsiders, lambda o: o.flagged, ">= 90 %")
    clear = [o for o in outsiders if o.signal > STRONG]
    _rates(f"outsiders flagged, signal > {STRONG}", clear, lambda o: o.flagged)
    _rates("outsiders given a name", outsiders, lambda o: bool(o.named), "", anything)
    _rates(
        "confidently wrong, of everything",
        main,
        lambda o: is_confidently_wrong(o.task, o.answer),
        "<= 2 %",
        lambda named, true: bool(named) and named != true,
    )
    print("\nnot counted above: right only if a cause is replaced by one of its named rivals")
    for kind in ("single", "pair", "triple"):
        _rates(f"{kind}s right among rivals", kinds.get(kind, []), lambda o: by_rivals(o.task, o.answer))
    crashes = sum(o.answer is None for o in main)
    print(f"verdicts: {dict(Counter(o.answer.verdict for o in main if o.answer))}, crashes: {crashes}")


def _quantiles(values: Iterable[float | None]) -> str:
    known = np.array([v for v in values if v is not None])
    if not len(known):
        return "-"
    return f"{np.median(known):.3f}, {np.quantile(known, 0.1):.3f} ({len(known)} cases)"


def _gains(main: Sequence[Outcome]) -> None:
    """Print the held-out gain as a share of the headroom, for cases whose effect stands above the noise."""
    some = [o for o in main if o.signal > STRONG and o.task.kind in ("single", "pair", "triple") and o.answer]
    if not some:
        return
    answers = [o.answer for o in some if o.answer]
    print(f"\nheld-out gain as a share of the headroom, signal > {STRONG}: median, p10 (target 0.970, 0.900)")
    print(f"  above the diagnosis' own noise floor        {_quantiles(a.explained for a in answers)}")
    print(f"  above what the true effect leaves           {_quantiles(o.share for o in some)}")
    right = [o for o in some if o.exact]
    print(f"  the same, where the set is exact            {_quantiles(o.share for o in right)}")
    for name in BASELINES:
        shares = [o.baseline_shares[name] for o in some if name in o.baseline_shares]
        if shares:
            print(f"  {name + ', above what the true effect leaves':<43} {_quantiles(shares)}")
    print(f"  black box, above the same noise floor       {_quantiles(a.ceiling for a in answers)}")
    nested = [o for o in some if o.nested is not None]
    if nested:
        print("  two episodes that the diagnosis never saw, above what the true effect leaves:")
        print(f"    on these episodes                         {_quantiles(o.nested for o in nested)}")
        print(f"    by the diagnosis' own folds, same cases   {_quantiles(o.share for o in nested)}")


def _parameters(main: Sequence[Outcome]) -> None:
    """Print the errors of correctly named causes, and how often the intervals contain the true value."""
    rows = [(name, *values) for o in main for name, values in o.compared.items()]
    if not rows:
        return
    errors = np.array([row[1] for row in rows])
    print(f"\nparameters of correctly named causes: median error {np.median(errors):.1%} (target <= 10 %)", end="")
    with_intervals = [(inside, count) for _, _, inside, count in rows if count]
    if with_intervals:
        shares = [inside / count for inside, count in with_intervals]
        print(
            f"; 90 % intervals contain the true value in {np.mean(shares):.1%} (target 85 to 95 %), mean over "
            f"{len(shares)} causes found; {sum(i for i, _ in with_intervals)} of {sum(c for _, c in with_intervals)} "
            "parameters",
            end="",
        )
    print("\n  cause          found   error: median     p90   intervals with the true value")
    for name in sorted({row[0] for row in rows}):
        own = [row for row in rows if row[0] == name]
        if own:
            own_errors = [row[1] for row in own]
            inside, count = sum(row[2] for row in own), sum(row[3] for row in own)
            held = f"{inside}/{count} = {inside / count:.0%}" if count else "no counterpart in the hidden effect"
            high = np.quantile(own_errors, 0.9)
            print(f"  {name:<14} {len(own):>5} {np.median(own_errors):>14.1%} {high:>8.1%}   {held}")


def _poor(poor: Sequence[Outcome], misses: bool) -> None:
    """Print the rates for poor motions, for effects that one slow speed shows and for those that it does not."""
    seen = [o for o in poor if o.signal > STRONG]
    hidden = [o for o in poor if o.signal <= STRONG]

    def among(answer: Answer | None, true: str) -> bool:
        return answer is not None and any(true == n or true in answer.rivals[n] for n in answer.named)

    print("\npoor motions (one slow speed)")
    _rates("truth in the answer or its rivals", seen, lambda o: among(o.answer, o.task.true[0]), ">= 90 %")
    _rates("exact at once", seen, lambda o: o.exact)
    _rates("false certainty", poor, lambda o: is_confidently_wrong(o.task, o.answer), "<= 0 %")
    _rates("following the advice: exact", seen, lambda o: is_exact(o.task, o.after), ">= 90 %")
    _rates("following the advice: false certainty", seen, lambda o: is_confidently_wrong(o.task, o.after), "<= 0 %")
    print(f"effects that these motions do not show ({len(hidden)})")
    _rates(
        "reported as not testable, or named",
        hidden,
        lambda o: o.answer is not None and (o.task.true[0] in o.answer.not_testable or among(o.answer, o.task.true[0])),
    )
    _rates("following the advice: exact", hidden, lambda o: is_exact(o.task, o.after))
    for o in poor if misses else ():
        first, second = said(o.answer), said(o.after)
        if o.answer is None or not is_exact(o.task, o.after):
            print(f"  {o.task.name:<10} {o.task.true[0]:<14} signal {o.signal:8.3f}: {first}")
            print(f"    after {', '.join(o.motions) or 'nothing'}: {second}")


def _costs(outcomes: Sequence[Outcome]) -> None:
    seconds = [o.answer.seconds for o in outcomes if o.answer]
    if seconds:
        print(
            f"\nseconds per diagnosis: median {np.median(seconds):.1f}, p90 {np.quantile(seconds, 0.9):.1f}, largest "
            f"{max(seconds):.1f}; largest memory of a process, including the generator, "
            f"{max(o.memory for o in outcomes):.2f} GB"
        )
