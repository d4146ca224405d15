"""The soft layer between the taxels as one cause: by its parts, and with neighbours taken by their places."""

import dataclasses
import json

import numpy as np
import pytest
from curved_pad import curved_pad
from recorded import diagnosed, make, names, recording_of

import paxisim
from paxisim import augment
from paxisim.diagnose import Diagnosis
from paxisim.layout import TaxelLayout

CAUSES = ("gel_operator", "axis_gain", "rotation")
"""Enough rivals for a cause that they resemble; more would only take time."""


def pressed(layout, operator, seed=0, noise=0.02):
    """Return a recording of presses between the taxels of a layout, read through an operator with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 48, 0.05)
    episode = (time // 6).astype(int)
    where = layout.positions / np.max(layout.pitch)
    force = np.zeros((len(time), 1, 3, layout.taxels))
    for number in np.unique(episode):
        for press in range(2):
            begin = 6 * number + 3 * press
            rise = np.clip(np.sin(np.pi * (time - begin - 0.5) / 2.0), 0, None) * ((time > begin) & (time < begin + 3))
            bump = np.exp(-np.sum((where - where[rng.integers(layout.taxels)]) ** 2, axis=1) / rng.uniform(0.5, 3))
            load = np.array([*rng.uniform(-0.4, 0.4, 2), 1.0]) * rng.uniform(1, 3)
            local = np.einsum("nab,b->na", layout.frames, load)  # in each taxel's frame, turned into the pad's
            force[:, 0] += rise[:, None, None] * (bump[:, None] * local).T
    force = force.reshape(len(time), 1, 3, layout.rows, layout.cols)
    read = np.asarray(operator(force)) + noise * rng.standard_normal(force.shape)
    return paxisim.Recording(time, read, force, episode=episode, layout=layout)


def grid(rows=5, cols=4):
    return TaxelLayout(rows, cols, (2e-3, 2e-3))


def shuffled(layout):
    """Return the same taxels in another order, as a layout that is not a grid."""
    order = np.random.default_rng(1).permutation(layout.taxels)
    return TaxelLayout(1, layout.taxels, layout.pitch, positions=layout.positions[order], normals=layout.normals)


def parts_of(found):
    (cause,) = found.causes
    assert cause.name == "gel_operator"
    return {part.name: part for part in cause.parts}


def value(found, name):
    (parameter,) = (p for p in found.causes[0].parameters if p.name == name)
    return parameter.value


@pytest.mark.parametrize(
    "layout",
    [
        shuffled(grid()),
        curved_pad(8),
        pytest.param(grid(), marks=pytest.mark.slow),
        pytest.param(paxisim.sensor("paxini-gen3-dp-s1813-elite").layout, marks=pytest.mark.slow),
    ],
    ids=["shuffled", "curved", "grid", "scattered"],
)
def test_neighbours_are_taken_by_place(layout):
    hidden = augment.GelOperator(poisson=(0.25, 0.1), layout=None if layout.is_grid else layout)
    found = diagnosed(pressed(layout, hidden), CAUSES)
    assert found.verdict == "explained"
    assert list(parts_of(found)) == ["Poisson effect"]
    assert value(found, "poisson_next").value == pytest.approx(0.25, abs=0.03)
    assert value(found, "poisson_diagonal").value == pytest.approx(0.1, abs=0.03)
    assert found.heldout.explained.value > 0.95


def test_the_parts_that_matter_are_reported_each_with_its_gain(tmp_path):
    hidden = augment.GelOperator(poisson=(0.2, 0.1), along=(0.6, 0.5))
    found = diagnosed(pressed(grid(), hidden, seed=3), CAUSES)
    parts = parts_of(found)
    assert set(parts) == {"Poisson effect", "shear along shear"}
    assert all(part.gain.low > 0 for part in parts.values())
    assert value(found, "along_next").value == pytest.approx(0.6, abs=0.1)
    assert "Poisson effect, shear away from a neighbour's normal force: explains" in str(found)
    found.save(tmp_path / "new")
    assert Diagnosis.load(tmp_path / "new").causes == found.causes
    # a file from before there were parts
    text = json.loads(found.to_json())
    del text["causes"][0]["parts"]
    assert Diagnosis.from_json(json.dumps(text)).causes[0].parts == ()


def test_counts_coarser_than_the_noise_do_not_stop_the_fit():
    hidden = augment.GelOperator(poisson=(0.2, 0.1), along=(0.6, 0.5), lift=(-0.2, -0.1), normal=(-0.1, -0.05))
    recording = pressed(grid(), hidden, seed=3, noise=0.002)
    found = diagnosed(dataclasses.replace(recording, measured=0.1 * np.rint(recording.measured / 0.1)), CAUSES)
    assert found.verdict == "explained"
    assert len(parts_of(found)) == 4
    assert value(found, "along_next").value == pytest.approx(0.6, abs=0.1)
    assert value(found, "lift_next").value == pytest.approx(-0.2, abs=0.1)


def test_a_gain_larger_than_a_layer_causes_is_a_cause_of_its_own():
    options = {"rows": 5, "cols": 4, "rate": 20, "duration": 6.0, "forms": (("axis_gain", "common"),)}
    case = make(("axis_gain", "poisson"), seed=1, strength=0.8, **options)
    found = diagnosed(recording_of(case), CAUSES)
    assert set(names(found)) == {"axis_gain", "poisson"}
    assert found.model["axis_gain"].gain[2] == pytest.approx(case.truth["axis_gain"]["gain"][2], abs=0.02)


def test_the_name_of_a_part_leads_to_its_cause():
    with pytest.raises(paxisim.UnknownNameError, match="part of gel_operator"):
        diagnosed(pressed(grid(), augment.GelOperator()), ["poisson"])


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_unit_of_the_magnetic_pad_is_its_operator():
    """No generator of ours made its readings: they follow from elasticity and magnets."""
    layout = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
    unit = paxisim.MagneticPad.unit(layout, 1)
    recording = pressed(layout, unit.read, seed=5)
    measured = 0.1 * np.rint(recording.measured / 0.1)
    found = diagnosed(dataclasses.replace(recording, measured=measured))
    assert "gel_operator" in [cause.name for cause in found.causes]
    assert "offset" not in [cause.name for cause in found.causes]
    assert found.heldout.nrmse_after < 0.5 * found.heldout.nrmse_before
