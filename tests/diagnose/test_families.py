"""Families of effects that are linear in their weights, and forms that the fitted ones do not contain."""

import numpy as np
import pytest
from recorded import diagnosed, names, plain, small

from paxisim import augment
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.data.problem import problem_of

FAMILIES = [c for c in map(cause, known_causes()) if isinstance(c, FittedCause) and c.basis is not None]
MEMORIES = ("creep", "hysteresis", "stiffening", "axis_gain", "latency", "low_pass", "offset")


@pytest.mark.parametrize("item", FAMILIES, ids=lambda item: item.name)
def test_a_basis_combines_to_what_its_transform_reads(item):
    problem = problem_of(plain(seed=3))
    basis = np.stack(item.basis(problem, problem.simulated))
    values = np.random.default_rng(1).uniform(0, 0.15, len(item.parameters(problem)))
    expected = item.on(problem.simulated, values, problem, problem)
    combined = item.combined(problem.simulated, basis, values, problem)
    np.testing.assert_allclose(combined, expected, atol=1e-9)
    assert np.abs(expected - problem.simulated).max() > 1e-2


@pytest.mark.parametrize(
    ("hidden", "form"),
    [
        ("creep", "grows_with_load"),
        pytest.param("creep", "logarithmic", marks=pytest.mark.slow),
        pytest.param("creep", "slow_recovery", marks=pytest.mark.slow),
        ("hysteresis", "return_curves"),
        pytest.param("hysteresis", "dahl", marks=pytest.mark.slow),
        pytest.param("hysteresis", "signed_relays", marks=pytest.mark.slow),
        pytest.param("hysteresis", "of_amplitude", marks=pytest.mark.slow),
    ],
)
def test_creep_and_hysteresis_are_told_apart_in_other_mathematics(hidden, form):
    found = diagnosed(small(hidden, seed=4, strength=0.8, forms=((hidden, form),)), MEMORIES)
    assert names(found) == [hidden]
    assert not {"creep", "hysteresis"} & set(found.causes[0].rivals)


def test_the_width_of_a_loop_is_reported_with_its_interval():
    found = diagnosed(small("hysteresis", seed=4, strength=0.8, forms=(("hysteresis", "play"),)), MEMORIES)
    (width,) = (p.value for p in found.causes[0].parameters if p.name == "loop_width")
    true = 0.02 * (0.15 / 0.02) ** 0.8  # of the generator, for this strength
    assert width.low <= true <= width.high
    assert width.high - width.low < 0.6 * true


def test_a_sensor_that_hardly_reads_small_swings_is_diagnosed():
    """Its weights sum to nearly 1, beyond which `Hysteresis` refuses them."""
    plays = augment.Hysteresis((0.5, 0.49), (0.1, 0.3))
    found = diagnosed(plain(plays.run, seed=7), ("hysteresis", "latency", "axis_gain"))
    assert "hysteresis" in names(found)
