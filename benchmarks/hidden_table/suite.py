"""Suite: how often the cases of the test suite are solved, which is what its bounds rest on."""

from __future__ import annotations

import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "diagnose"))

import test_hidden_effects as tested

from hidden_table.table import wilson


def suite(draws: int, seed: int, jobs: int) -> None:
    """Print the rate of each case of `tests/diagnose/test_hidden_effects.py` over some draws, with the misses."""
    cases = [("effects", (name,)) for name in tested.EFFECTS] + [("effects", pair) for pair in tested.PAIRS]
    cases += [("outsider", (name,)) for name in tested.OUTSIDERS]
    said: dict[str, list[str]] = defaultdict(list)
    with ProcessPoolExecutor(jobs) as pool:
        wanted = {
            pool.submit(getattr(tested, kind), names, number, seed): "+".join(names)
            for number in range(draws)
            for kind, names in cases
        }
        wanted |= {pool.submit(tested.null, n, seed): "nothing" for n in range(draws * len(tested.NULLS))}
        for number, job in enumerate(as_completed(wanted), start=1):
            said[wanted[job]].append(f"crash: {job.exception()}" if job.exception() else job.result())
            print(f"\r{number}/{len(wanted)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print("\ncases of tests/diagnose/test_hidden_effects.py: solved, 95 % interval")
    for name in [*("+".join(names) for _, names in cases), "nothing"]:
        own = said[name]
        hits = sum(not fault for fault in own)
        low, high = wilson(hits, len(own))
        print(f"  {name:<24} {hits:>3}/{len(own):<3} {hits / len(own):.2f} ({low:.2f} to {high:.2f})")
        for fault in own:
            if fault:
                print(f"      {fault}")
