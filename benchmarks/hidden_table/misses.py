"""Misses: what was named, by cause and by case. Once its misses are inspected, an exam is only a practice generator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from hidden_table.tasks import Answer, Outcome, is_confidently_wrong


def show_misses(outcomes: Sequence[Outcome]) -> None:
    """Print the singles by cause, nulls and outsiders by group, and one line per miss."""
    singles = [o for o in outcomes if o.task.kind == "single"]
    if singles:
        _by_cause(singles)
    for kind in ("null", "outsider"):
        some = [o for o in outcomes if o.task.kind == kind]
        groups = Counter(_group(o) for o in some)
        hits = Counter(_group(o) for o in some if not is_miss(o))
        for name in groups:
            print(f"  {kind} {name:<40} {hits[name]}/{groups[name]} right")
    misses = [o for o in outcomes if is_miss(o)]
    print(f"\n{len(misses)} misses (to see one as text, run the same command with --case and the name of the case)")
    for o in sorted(misses, key=lambda o: (not is_confidently_wrong(o.task, o.answer), -o.signal)):
        true = " + ".join(o.task.true) or "nothing"
        what = o.error.strip().splitlines()[-1] if o.error else said(o.answer)
        weakest = f" weakest {o.weakest:7.3f}" if len(o.task.true) > 1 else ""
        print(f"  {o.task.name:<12} {true:<34} signal {o.signal:8.3f}{weakest}  {what}")


def is_miss(outcome: Outcome) -> bool:
    """Whether the answer is wrong; poor motions have their own table."""
    if outcome.task.kind == "poor":
        return False
    return not outcome.flagged if outcome.task.kind == "outsider" else not outcome.exact


def said(answer: Answer | None) -> str:
    """Return the verdict and the named causes with their rivals as text."""
    if answer is None:
        return "crash"
    named = [name + (f" (or {'/'.join(answer.rivals[name])})" if answer.rivals[name] else "") for name in answer.named]
    return f"{answer.verdict}: {', '.join(named) or 'nothing'}"


def _group(outcome: Outcome) -> str:
    return " + ".join(outcome.task.true) or str({n: v for n, v in outcome.task.options if n != "family"} or "plain")


def _by_cause(singles: Sequence[Outcome]) -> None:
    print("\nsingles by cause: exact, and what else was named; a case with several names counts for each of them")
    for name in dict.fromkeys(o.task.true[0] for o in singles):
        own = [o for o in singles if o.task.true == (name,)]
        else_ = Counter(other for o in own if not o.exact for other in (o.named or ("nothing",)) if other != name)
        others = ", ".join(f"{other} {count}" for other, count in else_.most_common())
        print(f"  {name:<14} {sum(o.exact for o in own):>3}/{len(own):<3} {others}")
