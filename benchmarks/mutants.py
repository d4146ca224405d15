"""How many small faults the tests notice: seeded mutants of the code, each run against the tests nearest to it.

A mutant changes one place: a comparison, an operator, a number, a condition or a returned value. Places are drawn per
package, in proportion to the places that it has. A mutant counts as killed if a test fails; as survived if the tests
that name its module, its functions or its package pass, or if none fails within `--limit` seconds of CPU time (as a
mutant that never ends, too, since the tests' own timeout counts seconds of a clock and is lifted here).

    python benchmarks/mutants.py --output before.jsonl
    python benchmarks/mutants.py --output after.jsonl --compare before.jsonl

Each mutant is tried in a clone of the last commit, so uncommitted changes do not count. The same code and the same seed
give the same mutants, whatever the tests are. A run that was stopped goes on where it was.
"""

from __future__ import annotations

import ast
import collections
import dataclasses
import json
import os
import random
import re
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

import tyro

ROOT = Path(__file__).resolve().parents[1]
SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
FEWEST = 8
"""Smallest number of mutants of a package."""


@dataclasses.dataclass(frozen=True)
class Mutant:
    """A change of one place in one file; `start` and `end` are lines (from 1) and byte columns, as in `ast`."""

    file: str
    start: tuple[int, int]
    end: tuple[int, int]
    inside: str
    before: str
    after: str

    @property
    def package(self) -> str:
        """The package under `paxisim`, or ``integrations``."""
        parts = Path(self.file).parts
        return parts[0] if parts[0] == "integrations" or len(parts) == 2 else "/".join(parts[:2])

    def apply(self, source: bytes) -> bytes:
        """Return the source with the change."""
        lines = source.splitlines(keepends=True)
        first, last = (sum(map(len, lines[: line - 1])) + column for line, column in (self.start, self.end))
        return source[:first] + self.after.encode() + source[last:]


def changed(node: ast.AST) -> ast.expr | None:
    """Return the expression to put in place of `node`; None if it is no place for a mutant."""
    match node:
        case ast.Compare(left=left, ops=[op], comparators=right):
            return ast.Compare(left, [SWAPS[type(op)]()], right)  # type: ignore[arg-type]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in SWAPS:
            return ast.BinOp(left, SWAPS[type(op)](), right)  # type: ignore[arg-type]
        case ast.BoolOp(op=op, values=values):
            return ast.BoolOp(SWAPS[type(op)](), values)  # type: ignore[arg-type]
        case ast.Constant(value=bool(value)):
            return ast.Constant(not value)
        case ast.Constant(value=int(value)):
            return ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            return ast.Constant(1.5 * value if value else 1.0)
    return None


def places(file: str) -> Iterator[Mutant]:
    """Yield all mutants of a file."""
    source = (ROOT / file).read_text()

    def visit(node: ast.AST, inside: str) -> Iterator[Mutant]:
        for field, child in ast.iter_fields(node):
            # what annotations, decorators and messages say is not what the code does
            if field in ("annotation", "returns", "decorator_list") or isinstance(child, ast.JoinedStr):
                continue
            for one in child if isinstance(child, list) else [child]:
                if not isinstance(one, ast.AST) or isinstance(one, (ast.Raise, ast.JoinedStr)):
                    continue
                name = getattr(one, "name", "") if isinstance(one, (ast.FunctionDef, ast.ClassDef)) else ""
                new = changed(one)
                if field == "test" and isinstance(node, (ast.If, ast.IfExp)) and new is None:
                    new = ast.UnaryOp(ast.Not(), one)  # type: ignore[arg-type]
                if field == "value" and isinstance(node, ast.Return) and new is None:
                    new = ast.Constant(None)
                if new is not None and ast.unparse(one) != "TYPE_CHECKING":
                    place = ((one.lineno, one.col_offset), (one.end_lineno, one.end_col_offset))  # type: ignore[attr-defined]
                    yield Mutant(file, *place, inside, ast.unparse(one), f"({ast.unparse(new)})")  # type: ignore[arg-type]
                yield from visit(one, f"{inside}.{name}".strip(".") if name else inside)

    yield from visit(ast.parse(source), "")


def drawn(count: int, seed: int) -> list[Mutant]:
    """Return `count` mutants or a few more, of all packages."""
    listed = subprocess.run(["git", "ls-files", "paxisim", "integrations"], cwd=ROOT, capture_output=True, text=True)
    files = [file for file in listed.stdout.split() if file.endswith(".py") and "/tests/" not in file]
    of_package: dict[str, list[Mutant]] = collections.defaultdict(list)
    for file in sorted(files):
        for mutant in places(file):
            of_package[mutant.package].append(mutant)
    total = sum(map(len, of_package.values()))
    mutants = []
    for package, its in sorted(of_package.items()):
        share = max(FEWEST, round(count * len(its) / total))
        mutants += random.Random(f"{seed} {package}").sample(its, min(share, len(its)))
    return mutants


def nearest_tests(tree: Path, mutant: Mutant) -> list[str]:
    """Return the test files that name what the mutant changes, or that test its package, the nearest first."""
    module, package = Path(mutant.file).stem, mutant.package.rpartition("/")[2]
    # "__init__" is no name that a test uses, and a private function has no test of its own
    names = [name for name in (module, *mutant.inside.split(".")) if name and not name.startswith("_")]
    found = []
    for path in sorted([*tree.glob("tests/**/test_*.py"), *tree.glob("integrations/tests/test_*.py")]):
        text = path.read_text()
        named = sum(len(re.findall(rf"\b{name}\b", text)) for name in names)
        own = module in path.stem
        near = package in path.relative_to(tree).parts or package in path.stem
        if own or near or named:
            found.append((not own, -named / (len(text) + 2000) - near * 1e-3, str(path.relative_to(tree))))
    return [path for *_, path in sorted(found)]


def try_mutant(tree: Path, mutant: Mutant, limit: int) -> dict[str, object]:
    """Run the tests on one mutant in a clone; return its outcome.

    A test that fails without the change as well says nothing: its file is left out.
    """
    path, files = tree / mutant.file, nearest_tests(tree, mutant)
    source = path.read_bytes()
    while True:
        try:
            path.write_bytes(mutant.apply(source))
            status, failed = run_tests(tree, files, limit)
        finally:
            path.write_bytes(source)
        file = failed.partition("::")[0]
        if file not in files or run_tests(tree, [failed], limit)[0] == 0:
            break
        files.remove(file)
    outcome = {0: "survived", 5: "survived"}.get(status, "survived in time" if status < 0 else "killed")
    return dataclasses.asdict(mutant) | {"package": mutant.package, "outcome": outcome, "by": failed}


def run_tests(tree: Path, names: list[str], limit: int) -> tuple[int, str]:
    """Run test files or single tests in a clone; return the exit status and the first test that failed, if any."""
    environment = os.environ | {"PYTHONPATH": f"{tree}:{tree / 'integrations'}", "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n0", "-x", "-q", "-p", "no:cacheprovider", "--timeout", "0", *names],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5)),
    )
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return done.returncode, failed[1] if failed else ""


def table(results: list[dict[str, object]], before: list[dict[str, object]]) -> str:
    """Return killed / tried for each package, after those of `before`, if there are any."""

    def shares(found: list[dict[str, object]]) -> dict[object, str]:
        tried = collections.Counter(result["package"] for result in found)
        killed = collections.Counter(result["package"] for result in found if result["outcome"] == "killed")
        return {"all": f"{sum(killed.values())} / {len(found)}"} | {
            package: f"{killed[package]} / {tried[package]}" for package in sorted(tried, key=str)
        }

    rows = shares(results)
    earlier = shares(before)
    return "\n".join(f"| {name} | {earlier[name] + ' | ' if before else ''}{share} |" for name, share in rows.items())


def main(
    output: Path,
    count: int = 300,
    seed: int = 0,
    jobs: int = 2,
    limit: int = 60,
    package: str = "",
    compare: Path | None = None,
) -> None:
    """Try the mutants and print the share killed in each package.

    Args:
        output: File of outcomes, a line of JSON each; those that it holds are not tried again.
        count: Number of mutants.
        seed: Random seed.
        jobs: Mutants to try at once.
        limit: CPU time for the tests of one mutant (s).
        package: Try those of this package only.
        compare: Outcomes of an earlier run to print beside.
    """
    mutants = [mutant for mutant in drawn(count, seed) if mutant.package.startswith(package)]
    results = _read(output)
    done = {(result["file"], *map(tuple, (result["start"], result["end"]))) for result in results}  # type: ignore[arg-type]
    left = [mutant for mutant in mutants if (mutant.file, mutant.start, mutant.end) not in done]
    with tempfile.TemporaryDirectory() as folder, output.open("a") as file, ThreadPoolExecutor(jobs) as pool:
        trees: SimpleQueue[Path] = SimpleQueue()
        for job in range(jobs):
            tree = Path(folder, str(job), "paxisim")
            subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(tree)], check=True)
            trees.put(tree)

        def one(mutant: Mutant) -> dict[str, object]:
            tree = trees.get()
            try:
                return try_mutant(tree, mutant, limit)
            finally:
                trees.put(tree)

        for number, result in enumerate(pool.map(one, left), len(results) + 1):
            file.write(json.dumps(result) + "\n")
            file.flush()
            where = f"{result['file']}:{result['start'][0]}"  # type: ignore[index]
            print(
                f"{number}/{len(mutants)} {where} {result['before']} -> {result['after']}: {result['outcome']}",
                flush=True,
            )
    print(table(_read(output), _read(compare) if compare else []))


def _read(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


if __name__ == "__main__":
    tyro.cli(main)
