"""The generator of the exam: its imports, reproducibility, and the visibility of its effects."""

import ast
import sys
from pathlib import Path

import numpy as np
import pytest

from hidden.exam.cases import SHAPES, make
from hidden.exam.effects import EFFECTS
from hidden.exam.outsiders import OUTSIDERS
from hidden.exam.tasks import UNFAIR, tasks

ORDER = (
    "layout stiffening creep hysteresis poisson crosstalk axis_coupling rotation interference axis_gain taxel_gain "
    "offset drift low_pass latency dead_band saturation quantisation dead_taxels"
)
SMALL = {"shape": (3, 3), "pads": 1}


def test_imports_only_what_it_may():
    for path in Path(__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, path
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in names:
                top = name.split(".")[0]
                own = name.startswith("hidden.exam.")
                tests = top == "pytest" and path.name.startswith("test_")
                assert own or tests or top in ("numpy", "scipy") or top in sys.stdlib_module_names, (path, name)


def test_names_in_the_order_of_the_sensor():
    assert " ".join(EFFECTS) == ORDER
    assert len(OUTSIDERS) >= 8
    assert not set(EFFECTS) & set(OUTSIDERS)
    assert make(("latency", "creep"), seed=1, **SMALL).causes == ("creep", "latency")


def test_unknown_cause():
    with pytest.raises(ValueError, match="gremlins"):
        make(("gremlins",), seed=1)


@pytest.mark.parametrize("causes", [(), ("creep",), ("hysteresis", "drift"), ("interference",), ("swapped_packets",)])
def test_same_seed_same_case(causes):
    first, second = (make(causes, seed=5, ideal=True, **SMALL) for _ in range(2))
    for name in ("time", "measured", "simulated", "episode"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.truth == second.truth
    assert first.signal == second.signal
    other = make(causes, seed=6, **SMALL)
    assert other.measured.shape != first.measured.shape or not np.array_equal(other.measured, first.measured)


@pytest.mark.parametrize("name", EFFECTS)
def test_signal_grows(name):
    weak, strong = (make((name,), seed=11, strength=s, **SMALL).signal for s in (0, 1))
    assert weak > 0
    assert strong == weak if name == "layout" else strong > weak


@pytest.mark.parametrize("name", EFFECTS)
def test_drawn_single_is_visible(name):
    case = make((name,), seed=21, ideal=True, **SMALL)
    assert case.signal >= 0.02
    assert case.signals == {name: case.signal}
    assert set(case.truth) == {name}
    assert np.isfinite(case.measured).all()
    assert np.isfinite(case.ideal).all()
    # the simulation with the true effects is closer to the measurement than the simulation alone
    assert np.mean((case.measured - case.ideal) ** 2) < np.mean((case.measured - case.simulated) ** 2)


@pytest.mark.parametrize("options", [{}, {"rho": 0.95}, {"coarse": True}, {"strong_noise": True}])
def test_null(options):
    case = make((), seed=31, **options, **SMALL)
    assert case.signal == 0
    assert case.causes == ()
    assert case.signals == {}
    if "coarse" in options:
        np.testing.assert_allclose(case.measured, np.round(case.measured, 1), atol=1e-5)


@pytest.mark.parametrize("name", OUTSIDERS)
def test_outsider_changes_something(name):
    case = make((name,), seed=41, ideal=True, shape=(3, 3))
    assert case.signal >= 0.3
    assert case.ideal is None
    assert np.isfinite(case.measured).all()


@pytest.mark.parametrize("shape", SHAPES)
def test_shape_range_and_time(shape):
    case = make((), seed=51, shape=shape)
    frames = len(case.time)
    assert case.measured.shape[0] == case.simulated.shape[0] == case.episode.shape[0] == frames
    assert case.measured.shape[2:] == case.simulated.shape[2:] == (3, *shape)
    assert case.measured.dtype == case.simulated.dtype == np.float32
    assert np.diff(case.time).min() > 0
    assert case.measured[:, :, 2].min() >= 0
    assert np.abs(case.measured).max() <= 25.5
    assert {name: len(values) for name, values in case.covariates.items()} == {
        "gripper_opening": frames, "temperature": frames}  # fmt: skip


def test_motions():
    case = make((), seed=61, **SMALL)
    numbers = np.unique(case.episode)
    assert 8 <= len(numbers) <= 12
    opening = case.covariates["gripper_opening"]
    free, still = 0, []
    for number in numbers:
        at = np.flatnonzero(case.episode == number)
        force = case.simulated[at]
        assert not force[:3].any()
        assert not force[-3:].any()
        assert 5.5 < np.ptp(case.time[at]) < 10.1
        if not force.any():
            free += 1
            assert np.ptp(opening[at]) > 1e-3
        else:
            still.append(opening[at][0])
    assert free >= 2
    assert np.ptp(opening) > 0.035
    assert len(set(still)) == len(still)


def test_tasks():
    every = tasks(40, 12, 6, 14, seed=3)
    assert every == tasks(40, 12, 6, 14, seed=3)
    assert every[:40] == tasks(40, 2, 0, 0, seed=3)[:40]
    assert {task.causes[0] for task in every if task.kind == "single"} == set(EFFECTS)
    assert {task.causes[0] for task in every if task.kind == "outsider"} == set(OUTSIDERS)
    assert all(len(set(t.causes)) == 2 and set(t.causes) not in UNFAIR for t in every if t.kind == "pair")
    assert [t.options for t in every if t.kind == "null"][:3] == [{}, {"rho": 0.95}, {"coarse": True}]
    assert len({task.seed for task in every}) == len(every)
    assert len(set(every)) == len(every)
