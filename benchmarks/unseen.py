"""An examination of `paxisim.diagnose` on effects in mathematics that its authors have not seen.

    python benchmarks/unseen.py --seed N --jobs 2 --json outcomes.jsonl

There is no default seed. **A seed is spent by looking at it**: once any answer or truth of a seed has been read, the
engine must not be judged on that seed again after a change, and whoever changes the engine must not read
`benchmarks/exam`. `--describe CASE` prints the truth of a case and `--save CASE FILE.mcap` writes its recording; both
spend the seed. Seeds 0 to 3 are spent: they tested this program.

About 320 cases of 11 kinds (`benchmarks/exam/cases.py`); to make one takes 1 s, a pair with a loop up to 30 s, and its
diagnosis comes on top. Outcomes are stored with the digest of the code and the seed.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path

import harness
import numpy as np
from exam.cases import Case, Numbers, all_cases, make
from exam.judge import Judgement, judge
from harness import Outcome, add_options, diagnosed, print_costs, print_rate, run, wilson

LEAST = 0.1  # signal (RMS effect over RMS noise) above which a single counts
KINDS = {
    "single": "one effect",
    "pair": "two, comparable",
    "uneven": "two, energies 10:1",
    "order": "two, unusual order",
    "part": "one pad or region",
    "onset": "from the middle on",
    "null": "nothing",
    "hardnull": "nothing, hard",
    "outsider": "outside the names",
    "poor": "poor motion",
    "broken": "broken streams",
}
Pair = tuple[Outcome, Judgement]


def work(case: Case) -> Outcome:
    """Make a case, diagnose it, and return the outcome with the names of causes (not of their parts)."""
    made = make(case)
    outcome, found = diagnosed(case.name, case.kind, made.true, made.recording)
    about = {"seed": case.seed, "accepted": made.accepted, "tolerated": made.tolerated, "effects": made.effects}
    named = {cause.name: tuple(cause.rivals) for cause in found.causes} if found else {}
    return replace(outcome, named=named, about={**about, **made.about})


def report(outcomes: Sequence[Outcome], same: dict[str, str]) -> None:
    """Print the tables and the targets."""
    judged = [(outcome, judge(outcome, same)) for outcome in outcomes]
    counted = [pair for pair in judged if pair[0].kind != "single" or _signal(pair[0]) > LEAST]
    heads = (("cases", 6), ("exact", 7), ("+rival", 7), ("truth", 7), ("false", 7), ("sure", 6), ("right", 7))
    print(f"\n{'kind':<22}" + "".join(f"{head:>{width}}" for head, width in heads) + "  95 % (Wilson)")
    print("(singles above the least signal; +rival: exact only if rivals of `ambiguous` count; truth: all hidden")
    print("causes named, rivals included; false: cases with a false name; sure: `explained` with a false name)")
    for kind, words in KINDS.items():
        _print_row(words, [pair for pair in counted if pair[0].kind == kind])
    faint = [pair for pair in judged if pair[0].kind == "single" and _signal(pair[0]) <= LEAST]
    _print_row("one effect, faint", faint)
    print("\nsingles by cause")
    singles = [pair for pair in counted if pair[0].kind == "single"]
    for cause in dict.fromkeys(pair[0].true[0] for pair in singles):
        mark = " <--" if cause in ("creep", "hysteresis") else ""
        _print_row(cause + mark, [pair for pair in singles if pair[0].true == (cause,)])
    print("\ntargets, with 95 % intervals (Wilson)")
    _print_targets(judged, counted, singles)
    crashed = [o.name for o in outcomes if o.verdict == "crashed"]
    print(f"crashed: {len(crashed)} {' '.join(crashed)}")
    print_costs(outcomes)


def _signal(outcome: Outcome) -> float:
    return min((effect["signal"] for effect in outcome.about["effects"]), default=np.inf)


def _print_row(what: str, pairs: Sequence[Pair]) -> None:
    if not pairs:
        return
    js = [j for _, j in pairs]
    counts = [sum(j.exact for j in js), sum(j.by_rival for j in js), sum(j.contained for j in js)]
    counts += [sum(bool(j.false) for j in js), sum(j.confident for j in js), sum(j.right for j in js)]
    widths = (7, 7, 7, 7, 6, 7)
    low, high = wilson(counts[-1], len(js))
    columns = "".join(f"{n:>{w}}" for n, w in zip(counts, widths, strict=True))
    print(f"{what:<22}{len(js):>6}{columns}  {100 * low:.0f} to {100 * high:.0f} %")


def _print_targets(judged: Sequence[Pair], counted: Sequence[Pair], singles: Sequence[Pair]) -> None:
    """Print each rate beside its target; faint singles count only as confidently wrong."""
    judgements = {outcome.name: judgement for outcome, judgement in judged}

    def rate(what: str, some: Sequence[Pair], hit: Callable[[Judgement], bool], target: str = "") -> None:
        print_rate(what, [outcome for outcome, _ in some], lambda o: hit(judgements[o.name]), target)

    def of(*kinds: str) -> list[Pair]:
        return [pair for pair in counted if pair[0].kind in kinds]

    pairs = of("pair", "uneven", "order")
    rate("singles exact or by rivals", singles, lambda j: j.exact or j.by_rival, ">= 90 %")
    rate("  of these exact without rivals", singles, lambda j: j.exact)
    for cause in ("hysteresis", "creep"):
        some = [pair for pair in singles if pair[0].true == (cause,)]
        rate(f"  {cause}", some, lambda j: j.exact or j.by_rival, ">= 80 %")
    rate("pairs exact or by rivals, all three kinds", pairs, lambda j: j.exact or j.by_rival, ">= 75 %")
    for kind in ("pair", "uneven", "order"):
        rate(f"  {KINDS[kind]}", of(kind), lambda j: j.exact or j.by_rival)
    rate("part or onset: exact or by rivals", of("part", "onset"), lambda j: j.exact or j.by_rival)
    rate("nulls with a name", of("null", "hardnull"), lambda j: bool(j.false), "<= 2 %")
    rate("outsiders flagged", of("outsider"), lambda j: j.right, ">= 90 %")
    rate("poor motions right", of("poor"), lambda j: j.right)
    rate("broken streams noticed", of("broken"), lambda j: j.right, ">= 100 %")
    rate("confidently wrong, all kinds", judged, lambda j: j.confident, "<= 3 %")


def _print_misses(outcomes: Sequence[Outcome], same: dict[str, str]) -> None:
    for outcome in outcomes:
        if not judge(outcome, same).right:
            effects = ", ".join(f"{e['cause']} {e['signal']:.2f}" for e in outcome.about["effects"])
            print(f"{outcome.name} [{effects}]: {outcome}")


def _describe(case: Case) -> None:
    made = make(case)
    facts = {field.name: getattr(made, field.name) for field in fields(made) if field.name != "recording"}
    print(case.name, made.recording, json.dumps(facts, indent=1), sep="\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_options(parser)
    parser.add_argument("--seed", type=int, required=True, help="seed of all cases; spent once an answer was read")
    parser.add_argument("--only", default="", metavar="PREFIX", help="only cases whose name begins like this")
    parser.add_argument("--describe", metavar="CASE", help="print the truth of a case, and end")
    parser.add_argument("--save", nargs=2, metavar=("CASE", "FILE"), help="write the recording of a case, and end")
    parser.add_argument("--list", action="store_true", help="print the names of the cases, and end")
    parser.add_argument("--same", action="append", default=[], metavar="A=B", help="count the name A as B")
    for number in fields(Numbers):
        parser.add_argument(f"--{number.name}s", type=int, default=number.default, help="cases of this kind (or form)")
    options = parser.parse_args()
    numbers = Numbers(**{number.name: getattr(options, f"{number.name}s") for number in fields(Numbers)})
    cases = {case.name: case for case in all_cases(options.seed, numbers)}
    wanted = options.describe or (options.save[0] if options.save else "")
    if wanted and wanted not in cases:
        raise SystemExit(f"there is no case {wanted!r}: see --list")
    if options.list:
        print(*cases, sep="\n")
    elif options.describe:
        _describe(cases[wanted])
    elif options.save:
        make(cases[wanted]).recording.save(Path(options.save[1]))
    else:
        some = [case for name, case in cases.items() if name.startswith(options.only)]
        version = f"{harness.digest('benchmarks/exam')}-{options.seed}"
        outcomes = run(work, some, options, version)
        same = dict(pair.split("=", 1) for pair in options.same)
        report(outcomes, same)
        if options.misses:
            _print_misses(outcomes, same)


if __name__ == "__main__":
    sys.exit(main())
