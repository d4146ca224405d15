"""Whether the diagnosis still gives the answers that it gave: ``python benchmarks/golden.py FOLDER --jobs 2``.

Some 110 small cases of all kinds are diagnosed: hidden effects in generated recordings, alone, in pairs, none, and
effects outside the vocabulary; effects injected into real presses, unchanged presses and streams that do not
correspond; and units of a magnetic pad. FOLDER holds eFlesh's ``press_1`` and ``press_2``. The answers, with gains,
intervals and held-out errors, are compared with those in ``golden.jsonl``. On a build whose answers are to be kept,
``--json golden.jsonl`` writes that file.

A change of the code that should not change answers must keep causes and verdicts, and the numbers to 1e-6. These seeds
are spent: they judge no claim.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from harness import Outcome, add_options, diagnosed, run
from hidden_table import cases as generated
from injected.broken import COUNT, broken
from injected.cases import Source, injected, null
from reference_diagnosis import halves

import paxisim

FROZEN = Path(__file__).with_suffix(".jsonl")
SEED = 7000
TOLERANCE = 1e-6
GENERATED = {
    "both": {"single": 19, "pair": 10, "null": 4, "outsider": 5},
    "broad": {"single": 19, "pair": 5, "null": 3, "outsider": 5},
}
"""Number of cases of each family and kind."""
REAL = {"injected": 21, "null": 3, "broken": COUNT}
"""Number of cases made of real presses."""
MOST = 24
"""Parameters of a cause that are kept one by one; an offset has one for each channel."""
UNITS = (180,)
"""Units of the magnetic pad."""


@dataclass(frozen=True)
class Task:
    """A case: its family (a generator's, ``real`` or ``pad``), its kind and its number."""

    family: str
    kind: str
    number: int
    folder: Path

    @property
    def name(self) -> str:
        """Name of the case."""
        return f"{self.family}:{self.kind}:{self.number}"

    def recording(self) -> paxisim.Recording:
        """Make the recording."""
        if self.family == "pad":
            return halves(self.number, uneven=False)[0]
        if self.family == "real":
            make = {"injected": injected, "null": null, "broken": broken}[self.kind]
            return make(presses(self.folder), SEED, self.number).recording
        return generated.recording(generated.tasks({self.kind: self.number + 1}, SEED, self.family)[-1].made())


@cache
def presses(folder: Path) -> Source:
    """Load the real presses, once a process."""
    return Source(folder)


def tasks(folder: Path) -> list[Task]:
    """Return all cases."""
    counts: dict[str, Mapping[str, int]] = {**GENERATED, "real": REAL}
    found = [
        Task(f, kind, n, folder) for f, kinds in counts.items() for kind, count in kinds.items() for n in range(count)
    ]
    return found + [Task("pad", "unit", unit, folder) for unit in UNITS]


def solve(task: Task) -> Outcome:
    """Diagnose a case, and keep the numbers of its answer."""
    warnings.simplefilter("ignore")
    outcome, found = diagnosed(task.name, task.kind, (), task.recording())
    if found is None:
        message = outcome.said[-1].strip().splitlines()[-1]
        outcome.about["answer"] = {"verdict": outcome.verdict, "message": message}
        return outcome
    outcome.about["answer"] = answer(found)
    return replace(outcome, said=())


def answer(found: paxisim.diagnose.Diagnosis) -> dict[str, Any]:
    """Return what a change of the code must keep: names, verdict, parameters, gains, intervals, held-out errors."""
    document = found.to_document()
    causes = {
        cause["name"]: {
            "rivals": cause["rivals"],
            "gain": cause["gain"],
            "parameters": brief({own["name"]: own["value"] for own in cause["parameters"]}),
        }
        for cause in document["causes"]
    }
    errors = {name: document["heldout"][name] for name in ("nrmse_before", "nrmse_after", "noise_floor")}
    return {"verdict": document["verdict"], "causes": causes, "heldout": errors, "shift": document["clock_shift"]}


def brief(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return parameters as they are, or of more than `MOST` the sum and the norm of their values and interval ends."""
    if len(parameters) <= MOST:
        return parameters
    columns = {end: [own[end] or 0.0 for own in parameters.values()] for end in ("value", "low", "high")}
    sums = {end: {"sum": math.fsum(own), "norm": math.hypot(*own)} for end, own in columns.items()}
    return {"count": len(parameters), **sums}


def differences(before: Any, now: Any, where: str = "") -> Iterator[str]:
    """Yield each difference between two answers in words; numbers may differ by `TOLERANCE`."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*before, *(key for key in now if key not in before)]:
            if key not in now or key not in before:
                yield f"{where}{key} is {'gone' if key in before else 'new'}"
            else:
                yield from differences(before[key], now[key], f"{where}{key} ")
    elif isinstance(before, float) and isinstance(now, float):
        if not math.isclose(before, now, rel_tol=TOLERANCE, abs_tol=1e-9):
            yield f"{where}{before:.9g} -> {now:.9g}"
    elif before != now:
        yield f"{where}{before} -> {now}"


def main() -> None:
    """Diagnose the cases and print what differs from the frozen answers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with press_1 and press_2")
    parser.add_argument("--only", default="", help="cases whose name begins so, such as real:null")
    add_options(parser)
    options = parser.parse_args()
    wanted = [task for task in tasks(options.folder) if task.name.startswith(options.only)]
    outcomes = run(solve, wanted, options)
    print(f"{sum(outcome.seconds for outcome in outcomes):.0f} s of diagnoses")
    if options.json and options.json.resolve() == FROZEN:
        return
    if not FROZEN.exists():
        raise SystemExit(f"error: {FROZEN} is not there: write it with --json {FROZEN}")
    frozen = {row["name"]: row["about"]["answer"] for row in map(json.loads, FROZEN.read_text().splitlines())}
    changed = 0
    for outcome in outcomes:
        if outcome.name not in frozen:
            print(f"{outcome.name}: no frozen answer")
        elif found := list(differences(frozen[outcome.name], outcome.about["answer"])):
            changed += 1
            print(f"{outcome.name}: {'; '.join(found[:4])}{'; ...' if len(found) > 4 else ''}")
    print(f"{changed} of {len(outcomes)} answers differ")
    sys.exit(changed > 0)


if __name__ == "__main__":
    main()
