"""Misfit of each cause's form on the forms of hidden effects; the basis for choosing the `misfit` of each cause.

    python benchmarks/misfit.py --jobs 2

Each form of each effect in `tests/hidden`, or of those named with ``--only``, is recorded three times, and the
corresponding cause is fitted to it together with an offset. The script prints the residual energy of the fit in excess
of the residual that the effect itself would leave on the same simulation, as a share of the fitted effect's energy. A
negative value means that the fit has also absorbed some of the noise and the tolerances.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import harness  # noqa: F401  # makes the generator importable
import numpy as np
from hidden.cases import make
from hidden.compare import PARTS
from hidden.effects import EFFECTS
from hidden_table.cases import recording

from paxisim.diagnose.causes.kinds import Cause, DetectedCause
from paxisim.diagnose.causes.vocabulary import cause
from paxisim.diagnose.data.baseline import Curves
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.scorer import Scorer

STRENGTH = 0.85
SEED = 100


@dataclass(frozen=True)
class Hidden:
    """An effect to hide and fit."""

    name: str
    form: str
    seed: int


def fitted_to(effect: str) -> Cause:
    """Return the cause that is fitted to an effect; some effects are parts of a cause."""
    return cause("gel_operator" if effect in PARTS.values() else effect)


def left(hidden: Hidden) -> tuple[float, float]:
    """Return the share that the form leaves, and the effect's energy as a share of the noise energy."""
    case = make(
        (hidden.name,), seed=hidden.seed, family=("development", "final")[hidden.seed % 2], ideal=True,
        strength=STRENGTH, rows=4, cols=3, rate=30, forms={hidden.name: hidden.form},
    )  # fmt: skip
    problem = problem_of(prepare(recording(case))[0])
    causes = [cause("offset"), fitted_to(hidden.name)]
    fit = Scorer(problem, causes, Rules()).fit([item.name for item in causes])
    level = replace(problem, curves=Curves(np.ones((1, len(problem.time)))))
    ideal = float(np.sum(level.weigh(problem.measured - case.ideal) ** 2))
    effect = fit.effects[causes[1].name]
    return (float(fit.energy.sum()) - ideal) / effect, effect / problem.samples


def main() -> None:
    """Fit all forms and print the shares that they leave."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--recordings", type=int, default=3, help="number of recordings per form")
    parser.add_argument("--only", nargs="+", choices=EFFECTS, default=list(EFFECTS), help="names of effects")
    arguments = parser.parse_args()
    fitted = [n for n in arguments.only if not isinstance(fitted_to(n), DetectedCause) and n != "offset"]
    forms = [(name, form) for name in fitted for form in (*EFFECTS[name].forms, *EFFECTS[name].rare)]
    todo = [Hidden(*pair, SEED + k) for pair in forms for k in range(arguments.recordings)]
    print(f"{'cause':<14}{'misfit':>8}  {'form':<18}{'left in each recording':>30}{'effect / noise':>18}")
    with ProcessPoolExecutor(arguments.jobs) as pool:
        found = dict(zip(todo, pool.map(left, todo), strict=True))
    for name, form in forms:
        own = [found[hidden] for hidden in todo if (hidden.name, hidden.form) == (name, form)]
        shares = " ".join(f"{share:.3f}" for share, _ in own)
        print(f"{name:<14}{fitted_to(name).misfit:>8}  {form:<18}{shares:>30}{np.median([e for _, e in own]):>18.2f}")


if __name__ == "__main__":
    main()
