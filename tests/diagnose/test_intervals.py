"""The intervals of a diagnosis are those of its model's parameters, and GCS samples around the model within them."""

import numpy as np
import pytest
from recorded import diagnosed, small

from paxisim import GCS
from paxisim.diagnose import Diagnosis


@pytest.fixture(scope="module", params=["rotation", pytest.param("creep", marks=pytest.mark.slow), "taxel_gain"])
def found(request):
    return diagnosed(small(request.param, seed=5, duration=5.0, strength=0.9), (request.param,), seed=1)


def leaves(intervals, model):
    for name, own in intervals.items():
        member = model[name]
        if hasattr(member, "members"):
            yield from leaves(own, member)
        else:
            for parameter, (low, high) in own.items():
                yield member, parameter, low, high


def test_the_fit_is_within_the_intervals(found):
    every = list(leaves(found.intervals, found.model))
    assert every
    for member, parameter, low, high in every:
        value = np.asarray(getattr(member, parameter), dtype=float)
        assert np.all((low <= value) & (value <= high))
    (cause,) = found.causes
    if cause.name == "rotation":  # others have other numbers than their transforms
        ((low, high),) = found.intervals["rotation"].values()
        np.testing.assert_allclose(np.ravel(low), [p.value.low for p in cause.parameters])
        np.testing.assert_allclose(np.ravel(high), [p.value.high for p in cause.parameters])


def test_gcs_draws_around_a_diagnosis_and_one_that_was_saved(found):
    loaded = Diagnosis.from_json(found.to_json())
    chains = [
        GCS.around(diagnosis.model, diagnosis.intervals).sample(np.random.default_rng(0), (50,))
        for diagnosis in (found, loaded)
    ]
    assert chains[0].to_json() == chains[1].to_json()
    for member, parameter, low, high in leaves(found.intervals, found.model):
        drawn = [m for chain in chains for m in flat(chain) if type(m) is type(member)]
        values = np.asarray(getattr(drawn[0], parameter))
        assert values.shape == (50, *low.shape)
        assert np.ptp(values, axis=0)[high > low].min() > 0


def flat(chain):
    for member in chain:
        yield from flat(member) if hasattr(member, "members") else (member,)
