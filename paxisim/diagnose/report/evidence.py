"""Evidence: what speaks for a cause, in words."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.diagnosis import Interval
from paxisim.diagnose.explanation import Named
from paxisim.diagnose.problem import FloatArray, Problem, showing
from paxisim.diagnose.report.followed import followed


def evidence(problem: Problem, named: Named, gain: FloatArray, share: Interval) -> str:
    """What speaks for a cause.

    Args:
        problem: The recording.
        named: The cause.
        gain: ``(episodes,)`` N^2 that it takes away of each.
        share: The same of all, as a share of what can be explained.
    """
    shown = showing(gain)
    worse = int((gain[shown] > 0).sum())
    return (
        f"Without it the model predicts {worse} of the {int(shown.sum())} affected held-out episodes less accurately; "
        f"it explains {share.value:.0%} of the explainable error.{_covariate(problem, named)}"
    )


def _covariate(problem: Problem, named: Named) -> str:
    """The covariate that goes with what the cause reads without force; empty if it knows of none."""
    if not named.transform.covariate_names or named.cause.course is None:
        return ""
    rows, rest = problem.thinned, problem.thinned.at_rest
    rest = rest if rest.any() else np.ones_like(rest)
    added = rows.run(named.transform, np.zeros_like(rows.simulated))[rest]
    name, share = followed(named.transform, rows.covariates, added.reshape(len(added), -1), rest)
    return f" A straight line in {name} explains {share:.0%} of what it adds without contact."
