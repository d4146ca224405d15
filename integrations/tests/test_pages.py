"""The pages on the tasks and on many trainings: their commands, numbers and scripts are as printed."""

import functools
import importlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from paxisim_insertion.shell import command
from paxisim_lab.cells import read_cells
from paxisim_lab.cost import cost
from paxisim_lab.rates import RESULTS, comparable, read_results, tables
from paxisim_lab.table import table

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guides" / "scale.md"
README = ROOT / "integrations" / "README.md"
MEASURED = ROOT / "docs" / "measurements" / "insertion.md"


def blocks(kind, page=PAGE):
    """Return the fenced blocks of a kind."""
    return re.findall(rf"^```{kind}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", [PAGE, PAGE.with_name("insertion.md"), PAGE.with_name("loop.md"), README, MEASURED])
def test_the_commands_are_ones_that_there_are(page):
    text = page.read_text(encoding="utf-8").replace("\\\n", "")
    lines = re.findall(r"(?:^|`)(python -m paxisim_(?:insertion|lab)\.[^`\n]*)", text, re.MULTILINE)
    assert lines
    for line in lines:
        words = shlex.split(line)
        function = getattr(importlib.import_module(words[2]), words[2].rpartition(".")[2])
        called = []

        @functools.wraps(function)
        def parsed(*_, called=called, **__):
            called.append(True)

        assert command(parsed, words[3:]) == 0, line
        assert called, line


def test_the_matrix_and_the_costs_of_the_page(tmp_path, capsys):
    (text,) = blocks("toml")
    (tmp_path / "matrix.toml").write_text(text)
    cells = read_cells(tmp_path / "matrix.toml")
    assert len(cells) == 18
    assert cells[0].sensors == ("sim", "transfer pads", "transfer surrogates", "reference:unit:7")
    (line,) = [line for block in blocks("bash") for line in block.splitlines() if "paxisim_lab.cost" in line]
    words = shlex.split(line)[3:]
    assert command(cost, [str(ROOT / words[0]), *words[1:], "--results", str(RESULTS)]) == 0
    assert blocks("text") == [capsys.readouterr().out]


def test_the_tables_of_the_pages_are_those_that_the_command_prints(capsys):
    assert command(table, ["--results", str(RESULTS)]) == 0
    assert capsys.readouterr().out.strip() in MEASURED.read_text(encoding="utf-8")
    found, _ = comparable(read_results(RESULTS))
    simulated, pads, surrogates = (one for one in tables(found) if "TF" in one.rows)
    lines = README.read_text(encoding="utf-8").splitlines()
    for method in pads.rows:
        means = (*simulated.means(method), *pads.means(method), surrogates.means(method)[1])
        if means[1] is not None:
            row = " | ".join("" if mean is None else f"{mean:.2f}" for mean in means)
            assert f"| {method} | {row} |" in lines


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_script_of_the_page_runs_where_there_is_no_slurm(tmp_path):
    pytest.importorskip("submitit")
    (script,) = blocks("python")
    (tmp_path / "slurm.py").write_text(script)
    (tmp_path / "matrix.toml").write_text(
        'trials = 1\nsteps = {"SX-2mm" = 20}\n'
        '[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [0]\nsensors = ["sim"]\n'
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    arguments = [sys.executable, "slurm.py", "matrix.toml"]
    done = subprocess.run(arguments, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=250)
    assert done.stdout == "SX-2mm TF seed 0: finished\n", done.stderr
    assert all(cell.is_finished(tmp_path / "results") for cell in read_cells(tmp_path / "matrix.toml"))
