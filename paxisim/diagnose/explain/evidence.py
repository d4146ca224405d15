"""Evidence: one or two sentences that state the evidence for a cause."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.causes.kinds import BaselineCause
from paxisim.diagnose.data.problem import FloatArray, Problem, showing
from paxisim.diagnose.explain.explanation import Named
from paxisim.diagnose.explain.followed import followed
from paxisim.diagnose.result import Interval


def evidence(problem: Problem, named: Named, gain: FloatArray, share: Interval) -> str:
    """Return the evidence for a cause in words.

    Args:
        problem: The recording.
        named: The cause.
        gain: ``(episodes,)`` N^2, reduction of each episode's squared error by the cause.
        share: Total reduction, as a share of the explainable error.
    """
    shown = showing(gain)
    worse = int((gain[shown] > 0).sum())
    return (
        f"Without this cause, the model predicts {worse} of the {int(shown.sum())} affected held-out episodes less "
        f"accurately. The cause explains {share.value:.0%} of the explainable error.{_covariate(problem, named)}"
    )


def _covariate(problem: Problem, named: Named) -> str:
    """Return a sentence on the covariate that the cause follows without contact; empty if it uses no covariate."""
    if not named.transform.covariate_names or not isinstance(named.cause, BaselineCause):
        return ""
    rows, rest = problem.thinned, problem.thinned.at_rest
    rest = rest if rest.any() else np.ones_like(rest)
    added = rows.run(named.transform, np.zeros_like(rows.simulated))[rest]
    name, share = followed(named.transform, rows.covariates, added.reshape(len(added), -1), rest)
    return f" A linear function of {name} explains {share:.0%} of its effect without contact."
