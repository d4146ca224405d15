"""Structure of the package: six rooms, imports that run one way, and everything specific to a cause in its own file."""

import ast
from pathlib import Path

import pytest

import paxisim.diagnose as package
from paxisim.diagnose.causes.vocabulary import CAUSES

PACKAGE = Path(package.__file__).parent
ROOMS = ["rules", "data", "causes", "known", "scorer", "search", "result", "explain", "stages", "inside", "report"]
ROOMS += ["diagnosis", "pipeline"]
"""Rooms and single files in the order in which each may import those before it."""
LINES = {  # the target, and the upper bound until it is reached
    "core": (3800, 6420),
    "causes": (1200, 2415),
    "inside": (600, 510),
    "report": (1900, 1900),
}
NAMES = {item.name for item in CAUSES}


def room_of(path):
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[0]


FILES = sorted(PACKAGE.rglob("*.py"))
GENERIC = [path for path in FILES if room_of(path) not in ("causes", "inside", "report")]


def strings(path):
    """Return the strings of a module with their line numbers, without docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    words = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return [(n.value, n.lineno) for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in words]


@pytest.mark.parametrize("part", LINES)
def test_the_package_is_small(part):
    _, most = LINES[part]
    own = GENERIC if part == "core" else [path for path in FILES if room_of(path) == part]
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in own)
    assert most - 100 <= lines <= most, "a part that shrinks gets a smaller upper bound"


@pytest.mark.parametrize("path", GENERIC, ids=lambda path: path.name)
def test_a_module_that_serves_all_causes_knows_none_by_name(path):
    assert [(value, line) for value, line in strings(path) if value in NAMES] == []


def test_each_cause_of_a_sensor_has_a_file_of_its_own():
    files = {path.stem for path in (PACKAGE / "causes").glob("*.py")}
    # causes of a scene share one file because they differ only in their numbers
    assert files >= {item.name for item in CAUSES if not item.in_scene} | {"scene"}


def test_imports_run_from_room_to_room_one_way():
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("paxisim.diagnose."):
                own, other = room_of(path), node.module.split(".")[2]
                if own in ROOMS:
                    assert ROOMS.index(other) <= ROOMS.index(own), f"{own}: {path.name} must not import {other}"
