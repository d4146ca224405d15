"""Duration of a fit compared with `scipy.optimize.least_squares` on the same residual.

    python benchmarks/fit_speed.py

Both start from the same values. The script prints their times, the ratio and the final energies for three sets of
causes, on recordings with these causes made by `tests/hidden`.
"""

from __future__ import annotations

import time

import harness  # noqa: F401  # one thread for both; makes the generator importable
import numpy as np
from hidden.cases import make
from scipy.optimize import least_squares

from paxisim.diagnose.causes.vocabulary import cause
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.model import Model
from paxisim.diagnose.scorer.scorer import Scorer
from paxisim.diagnose.scorer.squares import Squares, best_start
from paxisim.recording import Recording

SETS = (("creep",), ("stiffening", "rotation"), ("hysteresis", "gel_operator", "latency"))


def main() -> None:
    """Time the fits and print a table."""
    print(f"{'causes':<34}{'ours (s)':>10}{'scipy (s)':>10}{'ratio':>8}{'energies':>22}")
    for number, names in enumerate(SETS):
        case = make(names, seed=number, strength=0.7)
        recording = Recording(case.time, case.measured, case.simulated, case.covariates, case.episode)
        problem = problem_of(recording)
        causes = [cause(n) for n in (*names, "offset")]
        fitter = Scorer(problem, causes, Rules()).fitter
        rows = fitter.rows(causes, {"offset": ()})
        squares = Squares(Model(fitter.problem, causes, rows), causes)
        zero = np.zeros((1, *rows.alive.shape))
        values: dict[str, np.ndarray] = {}
        for name in names:
            begun = [c for c in causes if c.name in values or c.name in (name, "offset")]
            values[name] = best_start(Model(fitter.problem, begun, rows), cause(name), values, zero)

        begin = time.perf_counter()
        ours = squares.descend(values, zero)
        seconds = time.perf_counter() - begin
        least = squares.energy(ours, zero)

        scale = np.array([f.scale for _, _, f in squares.free])
        low, high = (np.array([getattr(f, end) for _, _, f in squares.free]) / scale for end in ("low", "high"))

        def residual(x: np.ndarray, squares=squares, scale=scale, zero=zero, values=values) -> np.ndarray:
            trial = {n: v.copy() for n, v in values.items()}
            for (name, place, _), value in zip(squares.free, x * scale, strict=True):
                trial[name][place] = value
            return squares.residual(trial, zero)

        start = np.array([values[n][i] for n, i, _ in squares.free]) / scale
        start = np.clip(start, low + 1e-6, high - 1e-6)
        begin = time.perf_counter()
        found = least_squares(residual, start, bounds=(low, high), ftol=1e-4)
        theirs = time.perf_counter() - begin
        print(
            f"{'+'.join(names):<34}{seconds:>10.2f}{theirs:>10.2f}{theirs / seconds:>8.1f}"
            f"{least:>11.0f}{2 * found.cost:>11.0f}"
        )


if __name__ == "__main__":
    main()
