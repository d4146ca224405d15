"""The table of hidden effects: one case runs through all of its stages, is stored, and is not made again."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import harness
from hidden_table.cases import solve, tasks
from hidden_table.table import misses, table
from recorded import SMALL


def test_a_case_is_solved_stored_and_shown(capsys, tmp_path):
    (task,) = tasks({"single": 1}, 77)
    task = replace(task, options=(*task.options, *SMALL.items()))
    parser = argparse.ArgumentParser()
    harness.add_options(parser)
    options = parser.parse_args(["--json", str(tmp_path / "outcomes.jsonl")])
    (outcome,) = harness.run(solve, [task], options, "a")
    assert outcome.verdict not in ("refused", "crashed")
    assert outcome.about["signal"] > 0
    with options.json.open("a") as file:
        file.write('{"version": "a", "na')  # an interrupted run
    table([outcome])
    misses([replace(outcome, named={"creep": ()})])
    out = capsys.readouterr().out
    assert "exact singles, all" in out
    assert "single:0" in out
    options.limit_minutes = 0.0
    assert harness.run(solve, [task, replace(task, number=1)], options, "a") == [outcome]
    assert "1 of 2 cases" in capsys.readouterr().out
