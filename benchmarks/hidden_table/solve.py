"""Solve: make a case, diagnose it, and compare the answer with the hidden effects."""

from __future__ import annotations

import importlib
import resource
import time
import traceback

import numpy as np
from hidden.cases import Case, again, joined
from hidden.compare import LITTLE, compare, headroom_share

import paxisim
from hidden_table.patience import patience
from hidden_table.tasks import STRONG, Answer, Outcome, Task
from paxisim.diagnose.diagnosis import Diagnosis
from paxisim.recording import Recording

SLOW = 20.0  # Hz, sampling rate of poor motions; low, since the advised motions take minutes
TRIES = 20  # attempts to find a case in which poor motions show the effect at all


def solve(task: Task, nested: int = 0) -> Outcome:
    """Make a case and diagnose it. A crash counts as a miss and does not stop the other cases.

    Args:
        task: The case.
        nested: Number of cases of each kind to diagnose once more without two episodes, to judge the model on these.
    """
    case = made(task)
    weakest = min(case.signals.values(), default=case.signal)
    try:
        diagnosis, seconds = diagnosed(case)
    except Exception:
        return Outcome(task, case.signal, weakest, None, memory=_memory(), error=traceback.format_exc(limit=-4))
    answer = _answer(diagnosis, seconds)
    share = headroom_share(case, diagnosis.heldout.nrmse_before, diagnosis.heldout.nrmse_after)
    if task.generator == "exam":
        return Outcome(task, case.signal, weakest, answer, share=share, memory=_memory())
    if task.kind == "poor":
        return _follow(task, case, answer)
    from hidden_table.baselines import baselines  # not needed for an exam

    named, shares = baselines(recording(case), case.ideal)
    return Outcome(
        task,
        case.signal,
        weakest,
        answer,
        share=share,
        nested=_nested(case, task.seed) if task.number < nested else None,
        compared=compared(case, diagnosis),
        baselines=named,
        baseline_shares=shares,
        memory=_memory(),
    )


def made(task: Task) -> Case:
    """Make the case of a task.

    For poor motions, this is the first of `TRIES` attempts in which the effect stands above the noise, if there is one;
    otherwise the last. Effects that are not visible at all are a separate question.
    """
    make = importlib.import_module(f"hidden.{task.generator}.cases").make
    if task.kind != "poor":
        return make(task.true, seed=task.seed, ideal=True, **dict(task.options))
    for attempt in range(TRIES):
        case = make(task.true, seed=task.seed + 100_000_000 * attempt, family="poor", rate=SLOW)
        if case.signal > STRONG:
            break
    return case


def recording(case: Case) -> Recording:
    """Return the recording of a case, without what only the generator knows."""
    return Recording(case.time, case.measured, case.simulated, case.covariates, case.episode)


def diagnosed(case: Case) -> tuple[Diagnosis, float]:
    """Return the diagnosis and the seconds it took.

    Raises:
        TimeoutError: The diagnosis exceeds the limit of `patience`.
    """
    begin = time.perf_counter()
    with patience():
        diagnosis = paxisim.diagnose(recording(case))
    return diagnosis, time.perf_counter() - begin


def compared(case: Case, diagnosis: Diagnosis) -> dict[str, tuple[float, int, int]]:
    """Return for each cause that was hidden and named: error, intervals that contain the true value, all intervals."""
    out = {}
    for found in diagnosis.causes:
        if found.name in case.causes:
            intervals = {p.name: (p.value.value, p.value.low, p.value.high) for p in found.parameters}
            result = compare(found.name, case, diagnosis.model[found.name].run, intervals)
            out[found.name] = (float(result.error), int(result.inside), int(result.intervals))
    return out


def _answer(diagnosis: Diagnosis, seconds: float) -> Answer:
    explained = diagnosis.heldout.explained
    return Answer(
        verdict=diagnosis.verdict,
        named=tuple(found.name for found in diagnosis.causes),
        rivals={found.name: found.rivals for found in diagnosis.causes},
        explained=None if explained is None else explained.value,
        ceiling=diagnosis.heldout.ceiling_explained,
        not_testable=tuple(diagnosis.not_testable),
        left_over=tuple(item.what for item in diagnosis.symptoms.left_over),
        advice=diagnosis.advice,
        seconds=seconds,
    )


def _nested(case: Case, seed: int) -> float | None:
    """Return the share of the headroom that the model explains in two episodes that the diagnosis never saw."""
    assert case.ideal is not None
    load = np.abs(case.simulated).max(axis=(1, 2, 3, 4))
    pressed = [e for e in np.unique(case.episode)[1:] if load[case.episode == e].max() > 0.1 * load.max()]
    out = np.isin(case.episode, np.random.default_rng(seed).choice(pressed, 2, replace=False))
    given = recording(case)
    try:
        model = paxisim.diagnose(given[~out]).model
        predicted = model.run(case.simulated.astype(float), case.time, case.covariates)
    except Exception:
        return 0.0
    before, after, floor = (
        float(np.sum((case.measured[out] - stream[out].astype(float)) ** 2))
        for stream in (case.simulated, predicted, case.ideal)
    )
    return (before - after) / (before - floor) if before - floor > LITTLE * floor else None


def _follow(task: Task, case: Case, answer: Answer) -> Outcome:
    """Record the advised motions with the same sensor, and diagnose both recordings together."""
    from paxisim.diagnose.advice import motions_of

    motions = motions_of(answer.advice)
    if not motions:
        return Outcome(task, case.signal, case.signal, answer, after=answer, memory=_memory())
    both = joined(case, again(case, motions, seed=task.seed + 1))
    try:
        after = _answer(*diagnosed(both))
    except Exception:
        error = traceback.format_exc(limit=-4)
        return Outcome(task, case.signal, case.signal, answer, motions=motions, memory=_memory(), error=error)
    return Outcome(task, case.signal, case.signal, answer, motions=motions, after=after, memory=_memory())


def _memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
