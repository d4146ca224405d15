"""GelOperator: every linear map that turns with the layer, fitted to readings and derived from a magnetic pad."""

import dataclasses

import numpy as np
import pytest
from curved_pad import curved_pad

import paxisim
from paxisim.augment import Crosstalk, GelOperator, Poisson
from paxisim.augment.parameter_spec import parameters
from paxisim.errors import InvalidValueError

ROWS, COLS = 5, 6
RNG = np.random.default_rng(0)
ONE_RING = GelOperator(-0.1, -0.2, (-0.05, -0.13), (0.8, 0.7), (0.4, 0.1), (-0.16, -0.17), (-0.08, -0.02))
TWO_RINGS = GelOperator(0.1, 0.2, *(tuple(RNG.uniform(-0.3, 0.3, 5)) for _ in range(5)))


def forces(*lead):
    """Return forces of one pad, ``(*lead, 1, 3, rows, cols)``."""
    return np.random.default_rng(1).normal(size=(*lead, 1, 3, ROWS, COLS))


def turned(force):
    """Turn a picture of forces by a quarter: what pointed to +x at the top points to +y at the right."""
    x, y, z = (np.rot90(force[:, axis], -1, axes=(1, 2)) for axis in range(3))
    return np.stack([-y, x, z], axis=1)


def mirrored(force):
    return np.stack([-1, 1, 1])[:, None, None] * force[..., ::-1]


@pytest.mark.parametrize("operator", [ONE_RING, TWO_RINGS], ids=["one ring", "two rings"])
@pytest.mark.parametrize("moved", [turned, mirrored])
def test_it_has_no_preferred_direction(operator, moved):
    force = forces()
    np.testing.assert_allclose(operator(moved(force)), moved(operator(force)), atol=1e-12)


def test_one_of_its_kinds_is_the_paper_s_operator():
    far = np.exp(1 - np.sqrt(2))
    profile = np.array([1, far]) / (1 + 2 * far / np.sqrt(2))
    ours = GelOperator(poisson=0.2 * profile, poisson_skew=0.1 * profile)
    np.testing.assert_allclose(ours(forces()), Poisson(0.3, 0.1)(forces()), atol=1e-12)


def test_two_of_its_kinds_are_crosstalk_with_its_nearest_neighbours():
    profile = np.array([1, np.exp((1 - np.sqrt(2)) / 0.5)])
    ours = GelOperator(shear=0.05 * profile, shear_skew=0.02 * profile, normal=0.03 * profile)
    force = np.zeros((1, 3, ROWS, COLS))
    force[..., 2, 2] = 1.0
    near = (..., slice(1, 4), slice(1, 4))
    np.testing.assert_allclose(ours(force)[near], Crosstalk((0.07, 0.03, 0.03), length=0.5, taken=0.0)(force)[near])


def test_what_neighbours_take_is_lost_also_at_the_edge():
    operator = GelOperator(shear=(0.05, 0.02), normal=(0.03, 0.01), taken=1.0)
    even = np.ones((1, 3, ROWS, COLS))
    np.testing.assert_allclose(operator(even), even, atol=1e-12)
    force = forces()
    np.testing.assert_allclose(operator(force).sum(axis=(2, 3)), force.sum(axis=(2, 3)), atol=1e-12)
    kept = GelOperator(shear=(0.05, 0.02), normal=(0.03, 0.01))
    np.testing.assert_allclose(kept(even)[0, 2, 0, 0], 1 + 2 * 0.03 + 0.01)


def test_a_neighbour_s_shear_counts_along_the_line_between_them():
    force = np.zeros((1, 3, ROWS, COLS))
    force[0, 0, 2, 2] = 1.0
    (y,) = GelOperator(along=(0.5, 0.4), lift=(0.3, 0.0))(force)
    assert y[0, 2, 3] == y[0, 2, 1] == 0.5
    assert (y[:2, 1, 2] == 0).all()
    np.testing.assert_allclose(y[:2, 3, 3], [0.2, 0.2])  # half of it, turned into the diagonal
    assert (y[2, 2, 3], y[2, 2, 1]) == (0.3, -0.3)


@pytest.mark.parametrize("operator", [ONE_RING, TWO_RINGS], ids=["one ring", "two rings"])
def test_neighbours_are_taken_by_place(operator):
    grid = paxisim.TaxelLayout(ROWS, COLS, (2e-3, 2e-3))
    order = np.random.default_rng(2).permutation(grid.taxels)
    scattered = paxisim.TaxelLayout(1, grid.taxels, grid.pitch, positions=grid.positions[order], normals=grid.normals)
    force = forces()
    flat = force.reshape(1, 3, 1, -1)[..., order]
    expected = operator(force).reshape(1, 3, 1, -1)[..., order]
    by_place = GelOperator(**{**dataclasses.asdict(operator), "layout": scattered})
    np.testing.assert_allclose(by_place(flat), expected, atol=1e-9)


def test_a_curved_pad_reads_in_the_frames_of_its_taxels():
    layout = curved_pad(7)
    force = np.zeros((1, 3, 3, 7))
    force[0, 2, 1, 3] = 1.0  # on the taxel at the top, whose frame is that of the pad
    (y,) = GelOperator(poisson=(0.3, 0.0), layout=layout)(force) - force
    at = layout.frames[1 * 7 + 4]
    np.testing.assert_allclose(at.T @ y[:, 1, 4], [0, 0.3, 0], atol=0.01)
    assert np.linalg.norm(y[:, 1, 4]) == pytest.approx(0.3, rel=0.02)


@pytest.mark.parametrize(("operator", "rings"), [(ONE_RING, 1), (TWO_RINGS, 2)], ids=["one ring", "two rings"])
def test_a_fit_finds_its_numbers(operator, rings):
    force = forces(40)
    found = GelOperator.fitted(force, operator(force), rings=rings)
    for name in parameters(operator):
        np.testing.assert_allclose(getattr(found, name), getattr(operator, name), atol=1e-9)


def test_the_operator_of_the_nominal_pad_explains_most_of_a_unit():
    layout = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
    operator = paxisim.nominal_operator(layout)
    rng = np.random.default_rng(3)
    row, col = np.mgrid[:6, :5]
    force = []
    for _ in range(100):
        place, width = rng.uniform([0, 0], [5, 4]), rng.uniform(0.8, 3)
        bump = rng.uniform(0.1, 1) * np.exp(-((row - place[0]) ** 2 + (col - place[1]) ** 2) / (2 * width**2))
        force.append([*(rng.uniform(-0.4, 0.4) * bump for _ in range(2)), bump])
    force = np.array(force)
    for unit in range(3):
        reading = paxisim.MagneticPad.unit(layout, unit).read(force)
        left = np.std(reading - operator(force[:, None])[:, 0])
        assert left < 0.3 * np.std(reading - force)
        own = GelOperator.fitted(force, reading)
        assert np.std(reading - own(force[:, None])[:, 0]) <= left


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: GelOperator(poisson=(0.1, 0.1, 0.1)), "2 or 5 distances"),
        (lambda: GelOperator(poisson=(0.1,) * 5, normal=(0.1, 0.1)), "2 or 5 distances"),
        (lambda: GelOperator.fitted(forces(), forces(2)), "one shape"),
        (lambda: GelOperator.fitted(forces(), forces(), rings=3), "rings"),
        (lambda: GelOperator.fitted(forces(), np.full((1, 3, ROWS, COLS), np.nan)), "finite"),
        (lambda: GelOperator(layout=paxisim.TaxelLayout(2, 2, (1e-3, 1e-3)))(forces()), "2x2"),
    ],
)
def test_what_cannot_be_an_operator_is_refused(make, word):
    with pytest.raises(InvalidValueError, match=word):
        make()
