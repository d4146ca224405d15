"""Layer: its stiffness under rigid objects against solutions that its code does not contain."""

import numpy as np
import pytest
from scipy.optimize import nnls

from paxisim import Gel, InvalidValueError, Layer, TaxelLayout
from paxisim.layer.contact import indented, pressed
from paxisim.layer.response import surface_deflection

PAD = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
THICK, WIDE = 1.0, TaxelLayout(4, 4, 75e-3)
SQUARE = TaxelLayout(5, 5, 4e-3)


def plane_modulus(layer):
    return layer.modulus / (1 - layer.poisson**2)


# half-space


@pytest.mark.parametrize("bonded", [True, False])
@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
def test_a_thick_layer_under_a_square_punch_is_a_half_space(poisson, bonded):
    """A square punch: 1.012 times a circular one of its area (King, Int. J. Solids Struct. 23, 1987)."""
    layer = Layer(0.5e6, poisson, THICK, bonded)
    expected = 1.012 * 2 * plane_modulus(layer) * np.sqrt(np.prod(SQUARE.size) / np.pi)
    assert SQUARE.taxels * layer.stiffness(SQUARE, "flat") == pytest.approx(expected, rel=0.02)
    one = TaxelLayout(1, 1, 4e-3)
    assert layer.stiffness(PAD, "taxel") > layer.stiffness(one, "taxel") == pytest.approx(expected / 5, rel=0.02)


@pytest.mark.parametrize("poisson", [0.1, 0.49])
def test_a_ball_on_a_thick_layer_is_hertzs_contact(poisson):
    layer, radius, force = Layer(0.4e6, poisson, THICK), 10e-3, 2.0
    depth = (3 * force / (4 * plane_modulus(layer) * np.sqrt(radius))) ** (2 / 3)
    springs = force / (np.pi * depth**2 * (radius - depth / 3))  # the volume of a cap of the sphere
    area = np.prod(SQUARE.pitch)
    assert layer.stiffness(SQUARE, radius, force=force) == pytest.approx(springs * area, rel=0.03)
    # the secant: eight times the force is four times the depth, whose springs are half as stiff
    harder = layer.stiffness(SQUARE, 100 * radius, force=8e-4) / layer.stiffness(SQUARE, 100 * radius, force=1e-4)
    assert harder == pytest.approx(0.5, rel=0.02)

    cells = TaxelLayout(41, 41, 0.25e-3)
    apart = np.hypot(cells.positions[:, 0], cells.positions[:, 1])
    loads, sunk = pressed(layer.compliance(cells), apart**2 / (2 * radius), force)
    reach = np.sqrt(radius * depth)
    peak = 3 * force / (2 * np.pi * reach**2)
    expected = peak * np.sqrt(np.clip(1 - (apart / reach) ** 2, 0, None)) * 0.25e-3**2
    assert sunk == pytest.approx(depth, rel=0.01)
    assert np.abs(loads - expected).sum() < 0.05 * force


def test_far_from_a_load_a_thick_layer_sinks_as_boussinesq_says():
    layer = Layer(0.5e6, 0.3, THICK)
    apart = 20e-3
    sunk = surface_deflection([[apart, 0.0]], THICK, layer.modulus, layer.poisson, (1e-3, 1e-3))[0]
    # the base takes back about the thickness' share of it
    assert sunk == pytest.approx(1 / (np.pi * plane_modulus(layer) * apart), rel=0.03)


# a thin layer under a wide face


def test_a_thin_layer_without_poisson_effect_is_a_bed_of_springs():
    layer = Layer(0.5e6, 0.0, 2e-3)
    bed = layer.modulus / layer.thickness * np.prod(WIDE.pitch)
    assert layer.stiffness(WIDE, "flat") == pytest.approx(bed, rel=0.02)
    assert Gel.of(layer, WIDE).modulus == pytest.approx(layer.modulus, rel=0.02)
    wide = layer.stiffness(WIDE, "flat")
    assert wide > bed, "the edge of a face is carried by what is beside it"


@pytest.mark.parametrize("poisson", [0.3, 0.45])
def test_under_a_wide_face_a_bonded_layer_is_confined_and_a_free_one_is_not(poisson):
    confined = (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))
    for bonded, factor in ((True, confined), (False, 1 / (1 - poisson**2))):
        layer = Layer(0.5e6, poisson, 1e-3, bonded)
        bed = factor * layer.modulus / layer.thickness * np.prod(WIDE.pitch)
        assert layer.stiffness(WIDE, "flat") == pytest.approx(bed, rel=0.02)


def test_what_stiffens_a_layer():
    def flat(**change):
        return Layer(**{"modulus": 0.5e6, "poisson": 0.45, "thickness": 3e-3} | change).stiffness(PAD)

    assert flat(modulus=1e6) == pytest.approx(2 * flat())
    assert flat(thickness=2e-3) > flat() > flat(thickness=5e-3) > flat(bonded=False)
    rising = [flat(poisson=poisson) for poisson in (0.0, 0.3, 0.45, 0.48, 0.495)]
    assert rising == sorted(rising)
    assert rising[-1] > 5 * rising[0]
    layer = Layer()
    # confined under the whole pad, and free to rise beside one taxel; without Poisson effect neighbours help instead
    assert layer.stiffness(PAD, "flat") > 1.4 * layer.stiffness(PAD, "taxel")
    assert Layer(poisson=0.0).stiffness(PAD, "flat") < Layer(poisson=0.0).stiffness(PAD, "taxel")
    # a larger ball confines more; one as good as flat is a face
    balls = [layer.stiffness(PAD, radius) for radius in (5e-3, 20e-3, 0.1)]
    assert balls == sorted(balls)
    assert layer.stiffness(PAD, 1e3, force=50.0) == pytest.approx(layer.stiffness(PAD, "flat"), rel=0.01)


# the matrix


@pytest.mark.parametrize("layer", [Layer(), Layer(0.1e6, 0.2, 8e-3), Layer(bonded=False)])
def test_an_even_load_on_a_taxel_is_that_on_its_cells(layer):
    coarse, fine = TaxelLayout(3, 2, (4e-3, 3e-3)), TaxelLayout(12, 6, (1e-3, 1e-3))
    row, col = np.divmod(np.arange(fine.taxels), fine.cols)
    owner = np.eye(coarse.taxels)[row // 4 * 2 + col // 3]
    matrix, cells = layer.compliance(coarse), layer.compliance(fine)
    per_cell = 12
    np.testing.assert_allclose(owner.T @ cells @ owner / per_cell**2, matrix, atol=1e-3 * matrix.max())
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12)
    assert np.linalg.eigvalsh(cells).min() > 0


def test_a_nearly_incompressible_layer_rises_beside_a_load_and_another_does_not():
    assert Layer(poisson=0.48).compliance(PAD)[12, 13] < 0 < Layer(poisson=0.1).compliance(PAD)[12, 13]


def test_loads_are_those_of_the_quadratic_program():
    """The loads minimise the elastic energy less the work over all loads without tension, here found by scipy."""
    rng = np.random.default_rng(0)
    for layer in (Layer(), Layer(poisson=0.0)):
        matrix = layer.compliance(SQUARE)
        gap = rng.uniform(0, 3e-4, SQUARE.taxels)
        loads = indented(matrix, gap, 2e-4)
        root = np.linalg.cholesky(matrix)
        found, _ = nnls(root.T, np.linalg.solve(root, 2e-4 - gap))
        np.testing.assert_allclose(loads, found, atol=1e-6 * loads.max())
        assert 0 < np.count_nonzero(loads) < SQUARE.taxels
        again, depth = pressed(matrix, gap + 1e-3, loads.sum())
        np.testing.assert_allclose(again, loads, atol=1e-6 * loads.max())
        assert depth == pytest.approx(2e-4 - gap.min())


# MuJoCo's springs, and bad input


def test_springs_of_a_layer_have_its_stiffness_and_thickness():
    layer = Layer(0.3e6, 0.47, 2.5e-3)
    gel = Gel.of(layer, PAD, "taxel", relaxation=0.02, friction=0.7)
    assert gel.stiffness(PAD) == pytest.approx(layer.stiffness(PAD, "taxel"))
    assert (gel.thickness, gel.relaxation, gel.friction) == (2.5e-3, 0.02, 0.7)
    assert Gel.of(layer, PAD, 10e-3, force=1.0).stiffness(PAD) < Gel.of(layer, PAD).stiffness(PAD)


def test_what_is_no_layer_or_no_contact():
    for change, words in (
        ({"modulus": 0.0}, "modulus must be positive and finite, got 0.0"),
        ({"thickness": float("nan")}, "thickness"),
        ({"thickness": "3"}, "thickness"),
        ({"poisson": 0.5}, "from 0 to 0.495, got 0.5"),
        ({"poisson": True}, "poisson"),
        ({"bonded": "yes"}, "True or False, got 'yes'"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            Layer(**change)
    scattered = TaxelLayout(1, 2, 1e-3, positions=np.array([[0, 0, 0], [1e-3, 0, 1e-4]]))
    for call, words in (
        (lambda: Layer().stiffness(PAD, "edge"), "'flat', 'taxel' or a radius in m, got 'edge'"),  # type: ignore[arg-type]
        (lambda: Layer().stiffness(PAD, -1e-3), "radius in m"),
        (lambda: Layer().stiffness(PAD, 1e-2, force=0.0), "positive force"),
        (lambda: Layer(0.05e6).stiffness(PAD, 2e-3, force=20.0), "smaller force"),
        (lambda: Layer().stiffness(scattered), "only the contact 'taxel'"),
        (lambda: Layer().compliance(scattered), "flat grid"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            call()
    assert Layer().stiffness(scattered, "taxel") > 0
