"""The table of hidden effects uses internals of the diagnosis: one case runs through all of its stages."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from hidden_table.solve import solve
from hidden_table.table import table
from hidden_table.tasks import BASELINES, practice
from recorded import SMALL


@pytest.mark.slow
def test_a_case_is_solved_and_compared_with_the_baselines(capsys):
    (task,) = practice({"single": 1}, 77, "both")
    task = replace(task, options=(*task.options, *SMALL.items()))
    outcome = solve(task)
    assert not outcome.error
    assert outcome.answer is not None
    assert set(outcome.baselines) == set(BASELINES)
    table([outcome], misses=False)
    assert "exact" in capsys.readouterr().out
