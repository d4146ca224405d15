"""The generator of hidden effects shares nothing with what it tests, and its effects and recordings are as named."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hidden import broad
from hidden.cases import again, make
from hidden.effects import EFFECTS, FORMS, Episode
from hidden.outsiders import FURTHER, OUTSIDERS
from hidden.sensor import rounded

HERE = Path(__file__).parent
FAMILIES = ("development", "final", "poor", "broad")
SMALL = {"rows": 4, "cols": 3, "duration": 5.0}
PAD = make((), seed=3, **SMALL).sensor.pad


def forces():
    """Return 2 s of a press that slides over the pad, (T, pads, 3, N)."""
    t = np.arange(1000) / 500
    share = np.exp(-np.sum((PAD.where - 3e-3 * np.sin(t)[:, None, None]) ** 2, axis=-1) / 3e-5)
    normal = 1.3 * PAD.peak * np.sin(np.pi * t / 2)[:, None] * share
    each = np.stack([0.3 * np.sin(6 * t)[:, None] * normal, 0.2 * np.cos(5 * t)[:, None] * normal, normal], axis=1)
    return np.stack([each, 0.8 * each], axis=1), Episode(200.0, 0.02 + 0.02 * np.cos(3 * t), 25 + t)


def test_the_generator_shares_nothing_with_what_it_tests():
    allowed = {"numpy", "scipy", "hidden"} | set(sys.stdlib_module_names) - {"importlib", "runpy"}
    modules = [path for path in HERE.rglob("*.py") if not path.name.startswith("test_")]
    assert len(modules) > 10
    for path in modules:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{path} has a relative import, which hides its target"
                names = [str(node.module)]
            assert {name.split(".")[0] for name in names} <= allowed, path
        assert "__import__" not in path.read_text()


def test_making_a_case_loads_nothing_of_paxisim():
    code = (
        f"import sys; sys.path.insert(0, {str(HERE.parent)!r}); from hidden.cases import make; "
        "make(('creep',), seed=1, rows=3, cols=2, duration=2.0); "
        "print([m for m in sys.modules if m.startswith('paxisim')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("family", FAMILIES)
def test_a_seed_gives_the_same_case_bit_for_bit(family):
    causes, some = (*EFFECTS, *OUTSIDERS, *FURTHER), {**SMALL, "duration": 4.0 if family == "broad" else 2.0}
    first, second, other = (make(causes, seed=seed, family=family, **some) for seed in (11, 11, 12))
    for name in ("measured", "simulated", "time", "episode"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes(), name
    assert repr(first.truth) == repr(second.truth)
    assert first.measured.tobytes() != other.measured.tobytes()


@pytest.mark.parametrize("name", EFFECTS)
def test_each_form_of_an_effect_differs_and_grows_with_its_strength(name):
    force, episode = forces()
    seen = set()
    for form in FORMS[name]:
        sizes = []
        for strength in (0.0, 0.35, 0.7, 1.0):
            apply, truth = EFFECTS[name](np.random.default_rng(3), PAD, strength, form)
            assert truth["form"] == form
            read = rounded(force, truth["step"], form) if name == "quantisation" else apply(force, episode)
            sizes.append(np.sum((read - force) ** 2))
        assert sizes == sorted(sizes) or name == "dead_taxels", form  # other taxels
        assert sizes[-1] > 2 * sizes[0] or name == "layout", form  # a layout has no strength
        assert sizes[0] > 0, form
        seen.add(read.tobytes())
    assert len(seen) == len(FORMS[name])


def test_old_families_draw_the_first_forms_only_and_the_family_broad_draws_all():
    rng = np.random.default_rng(0)
    for effect in EFFECTS.values():
        assert {effect(rng, PAD, 0.5)[1]["form"] for _ in range(60)} == set(effect.usual)
    some = {"rows": 2, "cols": 2, "pads": 1, "duration": 4.0, "family": "broad", "rate": 20}
    cases = [make(("layout", "axis_coupling"), seed=seed, **some) for seed in range(30)]
    assert all({case.truth[name]["form"] for case in cases} == set(FORMS[name]) for name in cases[0].truth)


def test_an_outsider_stands_above_the_noise():
    for name in (*OUTSIDERS, *FURTHER):
        assert make((name,), seed=2, strength=0.9, family="broad", **SMALL).signal > 0.3, name


@pytest.mark.parametrize("options", [{}, {"rho": 0.95}, {"coarse": True}, {"strong_noise": True}])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_null_holds_no_effect(family, options):
    case = make((), seed=5, family=family, **options, **SMALL)
    assert (case.causes, case.signal, case.truth) == ((), 0, {})
    assert np.abs(case.measured - case.simulated)[:, :, :2].mean() < (0.3 if "strong_noise" in options else 0.1)
    assert case.measured[:, :, 2].min() >= 0
    assert np.diff(case.time).min() > 0
    if "coarse" in options:
        np.testing.assert_allclose(case.measured, np.round(case.measured, 1), atol=1e-5)


def test_the_families_move_differently_and_broad_has_all_motions_objects_and_imperfections():
    cases = {family: make((), seed=5, family=family, **SMALL) for family in FAMILIES}
    assert len({case.simulated.tobytes() for case in cases.values()}) == 4
    case = cases["broad"]
    at = [case.episode == number for number in np.unique(case.episode)]
    assert all(not case.simulated[own][[0, 1, -2, -1]].any() for own in at)  # free at both ends
    free = [own for own in at if not case.simulated[own].any()]
    assert len(at) - len(free) == len(broad.CONTACT)
    assert len(free) in (2, 3)
    assert all(np.ptp(case.covariates["gripper_opening"][own]) > 0.035 for own in free)
    assert np.ptp(case.covariates["temperature"]) > 1
    moves = [move for seed in range(4) for move in broad.episodes(np.random.default_rng(seed), (0.02, 0.02), 2, 6.0)]
    assert {move.indenter for move in moves} == set(broad.OBJECTS)
    assert all(np.isfinite(move.shear).all() and move.normal.min() >= 0 for move in moves)
    sensors = [make((), seed=seed, rows=2, cols=2, duration=4.0, family="broad").sensor.nuisance for seed in range(8)]
    assert {bool(sensor.averaged) for sensor in sensors} == {False, True}


def test_the_same_sensor_is_recorded_again():
    case = make(("axis_gain",), seed=21, strength=0.8, **SMALL)
    second = again(case, seed=5)
    assert second.truth is case.truth
    assert second.time[0] > case.time[-1]
    z = second.simulated[:, :, 2].astype(float)
    gain = np.sum(z * second.measured[:, :, 2]) / np.sum(z * z)
    assert gain == pytest.approx(case.truth["axis_gain"]["gain"][2], rel=0.02)


@pytest.mark.parametrize(
    ("causes", "forms", "word"),
    [(("creep",), {"creep": "seven_modes"}, "has the forms"), (("gremlins",), {}, "unknown cause")],
)
def test_what_there_is_not_is_refused(causes, forms, word):
    with pytest.raises(ValueError, match=word):
        make(causes, seed=1, forms=forms, **SMALL)
