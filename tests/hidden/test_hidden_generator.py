"""Checks of the generator: it is independent and reproducible, and its effects behave as named."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from hidden.cases import make
from hidden.effects import EFFECTS, FORMS
from hidden.outsiders import OUTSIDERS

HERE = Path(__file__).parent
MODULES = sorted(path for path in HERE.rglob("*.py") if not path.name.startswith("test_"))
SMALL = {"rows": 4, "cols": 3, "duration": 5.0}


def imports(path):
    """Yield the full names of the modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name} has a relative import, which hides its target"
            yield str(node.module)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(HERE)))
def test_the_generator_shares_nothing_with_what_it_tests(path):
    allowed = {"numpy", "scipy", "hidden"} | set(sys.stdlib_module_names) - {"importlib", "runpy"}
    assert {name.split(".")[0] for name in imports(path)} <= allowed
    assert "__import__" not in path.read_text()


def test_making_a_case_loads_nothing_of_paxisim():
    code = (
        f"import sys; sys.path.insert(0, {str(HERE.parents[1])!r}); from hidden.cases import make; "
        "make(('creep',), seed=1, rows=3, cols=2, duration=2.0); "
        "print([m for m in sys.modules if m.startswith('paxisim')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", [*EFFECTS, *OUTSIDERS])
def test_a_seed_gives_the_same_case_bit_for_bit(name):
    first, second = (make((name,), seed=11, **SMALL) for _ in range(2))
    other = make((name,), seed=12, **SMALL)
    assert first.measured.tobytes() == second.measured.tobytes()
    assert first.simulated.tobytes() == second.simulated.tobytes()
    assert first.time.tobytes() == second.time.tobytes()
    assert first.measured.tobytes() != other.measured.tobytes()


@pytest.mark.parametrize(
    ("name", "form"), [(name, form) for name in sorted(set(EFFECTS) - {"layout"}) for form in FORMS[name]]
)  # a layout has no strength
def test_effects_grow_with_their_strength(name, form):
    options = {**SMALL, "forms": {name: form}}
    signals = [make((name,), seed=3, strength=strength, **options).signal for strength in (0.0, 0.35, 0.7, 1.0)]
    assert signals == sorted(signals)
    assert signals[-1] > 2 * signals[0]


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_the_forms_of_an_effect_differ_and_all_are_drawn(name):
    cases = [make((name,), seed=3, strength=0.7, forms={name: form}, **SMALL) for form in FORMS[name]]
    assert [case.truth[name]["form"] for case in cases] == list(FORMS[name])
    assert len({case.measured.tobytes() for case in cases}) == len(cases)
    rng = np.random.default_rng(0)
    assert {EFFECTS[name](rng, cases[0].sensor.pad, 0.5)[1]["form"] for _ in range(60)} == set(FORMS[name])


def test_an_unknown_form_is_refused():
    with pytest.raises(ValueError, match="has the forms"):
        make(("creep",), seed=1, forms={"creep": "seven_modes"}, **SMALL)


@pytest.mark.parametrize("family", ["development", "final", "poor"])
def test_a_null_holds_no_effect(family):
    case = make((), seed=5, family=family, **SMALL)
    assert case.causes == ()
    assert case.signal == 0
    rest = case.measured - case.simulated
    assert np.abs(rest[:, :, :2]).mean() < 0.1


def test_the_family_final_moves_otherwise_than_development():
    first, second = (make((), seed=5, family=family, **SMALL) for family in ("development", "final"))
    assert not np.array_equal(first.simulated, second.simulated)


def test_an_unknown_cause_is_refused():
    with pytest.raises(ValueError, match="unknown cause"):
        make(("gremlins",), seed=1)
