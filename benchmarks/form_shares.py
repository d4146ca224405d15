"""What the fitted form of each cause leaves for the others to explain: what `Cause.form` and `mistaken` rest on.

    python benchmarks/form_shares.py --seeds 6 --jobs 2

One strong effect is hidden (`tests/hidden`), its own cause is fitted, then each other cause beside it. What the other
gains, per mille of what the effect's own cause gains, is its share; the largest over the seeds is printed. Gains too
little to matter do not count, nor do recordings in which the own cause takes away less than a quarter of the noise's
energy: there, what all sensors are off by counts for more than forms. A recording whose counts hide its noise shares
more, as its offsets are not told.
"absorbed" is what is left where `Cause.absorbers` are fitted besides.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import defaultdict
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: one thread for each job
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from hidden.practice.cases import make
from hidden.practice.effects import EFFECTS
from hidden_table.solve import recording

from paxisim.diagnose.cause import cause, known_causes
from paxisim.diagnose.fitting import fit
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.outliers import without_outliers
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.state import CLOSER
from paxisim.diagnose.under_load import tells_under_load
from paxisim.diagnose.worth import Thresholds

NAMES = tuple(name for name in known_causes() if name in EFFECTS and cause(name).is_searched)
ENOUGH = 0.25  # of the noise's energy
STRENGTHS = (0.6, 1.0)


def shares(task: tuple[str, int]) -> Mapping[str, float] | None:
    """By name of another cause, its share beside the hidden one; None if that gains too little to tell."""
    true, seed = task
    rng = np.random.default_rng([seed, NAMES.index(true)])
    family = ("development", "final")[rng.integers(2)]
    case = make((true,), seed=int(rng.integers(2**31)), family=family, strength=rng.uniform(*STRENGTHS))
    problem = problem_of(recording(case), Tolerance())
    if tells_under_load(problem):
        return None
    own = fit(problem, [cause(true)])
    out: dict[str, float] = defaultdict(float)
    for part in (problem, without_outliers(problem, own.prediction)):  # the diagnosis looks at both
        nothing, own = fit(part, []), fit(part, [cause(true)], own.values)  # what more steps gain is no other's gain
        gain, least = float((nothing.energy - own.energy).sum()), CLOSER * Thresholds().material * part.samples
        if gain < ENOUGH * part.samples:
            return None
        if cause(true).absorbs:
            absorbed = fit(part, [cause(n) for n in (true, *cause(true).absorbers)], own.values)
            for name in cause(true).absorbs:
                more = fit(part, [*absorbed.causes, cause(name)], absorbed.values)
                left = float((absorbed.energy - more.energy).sum())
                out[f"{name} absorbed"] = max(out[f"{name} absorbed"], left / gain if left > least else 0.0)
        for name in NAMES:
            if name != true and not cause(name).barred(part):
                both = fit(part, [cause(true), cause(name)], own.values)
                left = float((own.energy - both.energy).sum())
                out[name] = max(out[name], left / gain if left > least else 0.0)
    return out


def main() -> None:
    """Parse the arguments, fit and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6, help="recordings of each effect")
    parser.add_argument("--seed", type=int, default=0, help="of the first")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument(
        "--causes", nargs="+", choices=NAMES, default=NAMES, metavar="CAUSE", help="in rows; default: all"
    )
    arguments = parser.parse_args()
    tasks = [(name, arguments.seed + number) for name in arguments.causes for number in range(arguments.seeds)]
    largest: dict[tuple[str, str], float] = defaultdict(float)
    told: dict[str, int] = defaultdict(int)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for number, ((true, _), found) in enumerate(zip(tasks, pool.map(shares, tasks), strict=True), start=1):
            print(f"\r{number}/{len(tasks)}", end="", file=sys.stderr, flush=True)
            if found:
                told[true] += 1
                for name, share in found.items():
                    largest[true, name] = max(largest[true, name], share)
    print(file=sys.stderr)
    print("per mille of the gain of the cause in a row, that the cause in a column gains beside it: largest (allowed)")
    for true in arguments.causes:
        print(f"\n{true}, {told[true]} recordings")
        for name in NAMES:
            if (true, name) in largest:
                allowed = cause(true).form.get(name, cause(name).mistaken)
                print(f"  {name:<20} {1000 * largest[true, name]:8.1f} {1000 * allowed:10.1f}")
        for name, allowed in cause(true).absorbs.items():
            if (true, name) in largest:
                share = largest[true, f"{name} absorbed"]
                print(f"  {name + ' absorbed':<20} {1000 * share:8.1f} {1000 * allowed:10.1f}")


if __name__ == "__main__":
    main()
