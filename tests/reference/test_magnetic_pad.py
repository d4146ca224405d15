"""Readings of a magnetic pad: calibrated presses, and the paper's three gaps reproduced from physics."""

import numpy as np
import pytest

from paxisim import InvalidValueError, Layer, TaxelLayout
from paxisim.layer.response import layer_response
from paxisim.reference.dipoles import field, turned
from paxisim.reference.pad import MagneticPad
from paxisim.reference.parameters import PadParameters

LAYOUT = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))


@pytest.fixture(scope="module")
def nominal() -> MagneticPad:
    return MagneticPad(LAYOUT)


def pressed(taxel, force):
    out = np.zeros((3, 6, 5))
    out[(slice(None), *taxel)] = force
    return out


def spread(total):
    return np.full((3, 6, 5), 0.0) + np.array([0, 0, total / 30])[:, None, None]


def test_nothing_is_nothing_and_a_calibrated_press_is_read(nominal):
    np.testing.assert_array_equal(nominal.read(np.zeros((3, 6, 5))), 0)
    for taxel in ((0, 0), (2, 3), (5, 4)):
        for force in ((0.0, 0.0, 0.5), (0.1, -0.1, 0.7)):
            read = nominal.read(pressed(taxel, force))
            np.testing.assert_allclose(read[(slice(None), *taxel)], force, atol=0.12 * force[2])


def test_shear_without_a_load_of_its_own_points_outward(nominal):
    """The paper's second gap: under a flat press, the pad reads shear that points away from the middle."""
    read = nominal.read(spread(6.0))
    x, y = LAYOUT.positions[:, 0].reshape(6, 5), LAYOUT.positions[:, 1].reshape(6, 5)
    outward = read[0] * x + read[1] * y
    edge = np.ones((6, 5), dtype=bool)
    edge[1:-1, 1:-1] = False
    assert np.all(outward[edge] > 0)
    assert np.abs(read[:2].sum(axis=(1, 2))).max() < 1e-9
    assert np.hypot(read[0], read[1]).max() > 0.03 * read[2].max()


def test_a_pad_of_smaller_taxels_is_a_smaller_pad(nominal):
    """All lengths shrink with the taxels, so equal pressures give equal readings."""
    assert nominal.parameters == PadParameters()
    fine = MagneticPad(TaxelLayout(6, 5, (26.1e-3 / 12, 22.6e-3 / 10)))
    force = np.random.default_rng(6).uniform(0, 0.5, (3, 6, 5))
    np.testing.assert_allclose(4 * fine.read(force / 4), nominal.read(force), atol=1e-4)
    dense = MagneticPad.unit(TaxelLayout(12, 10, (26.1e-3 / 12, 22.6e-3 / 10)), 7)
    even = np.zeros((3, 12, 10)) + np.array([0, 0, 0.05])[:, None, None]
    assert np.abs(dense.read(even)).max() < 0.05


def test_units_differ_in_scale_by_axis_and_taxel_and_a_number_is_a_unit():
    """The paper's third gap: every pad has different scales."""
    first, second = MagneticPad.unit(LAYOUT, 1), MagneticPad.unit(LAYOUT, 2)
    force = spread(6.0)
    a, b = first.read(force), second.read(force)
    assert np.abs(a - b).max() > 0.1 * a.max()
    assert abs(a[2].sum() / b[2].sum() - 1) > 0.01
    np.testing.assert_array_equal(a, MagneticPad.unit(LAYOUT, 1).read(force))
    # the first gap: uneven normal force under a flat press
    assert (a[2] - MagneticPad(LAYOUT).read(force)[2]).std() > 0.05 * a[2].mean()


def test_a_number_is_the_same_unit_in_every_version():
    """Recordings and results name units by their numbers."""
    force = np.zeros((3, 6, 5)) + np.array([0.05, 0.0, 0.27])[:, None, None]
    for seed, corner, total in (
        (7, [-0.01785241, -0.10154946, 0.1793728], [4.00875105, -0.0739618, 2.98963289]),
        (1234, [-0.03561559, -0.10696921, 0.25228456], [5.10789559, 0.10892, 3.60525292]),
    ):
        read = MagneticPad.unit(LAYOUT, seed).read(force)
        np.testing.assert_allclose(read[:, 0, 0], corner, atol=1e-7)
        np.testing.assert_allclose(read.sum(axis=(1, 2)), total, atol=1e-7)


def test_neighbours_are_read_too(nominal):
    """The gel and the magnets' superposed fields cause crosstalk, which the paper's transforms leave out.

    An incompressible gel rises beside a press, so neighbours read a pull.
    """
    read = nominal.read(pressed((2, 2), (0, 0, 1.0)))[2]
    assert -0.3 < read[2, 3] < -0.02
    assert abs(read[2, 3]) > 3 * abs(read[2, 4])
    foam = MagneticPad(LAYOUT, PadParameters(Layer(poisson=0.1))).read(pressed((2, 2), (0, 0, 1.0)))[2]
    assert foam[2, 3] > read[2, 3]


def test_a_pad_is_as_symmetric_as_its_grid(nominal):
    force = np.random.default_rng(0).uniform(0, 0.3, (3, 6, 5))
    mirrored = force[:, :, ::-1] * np.array([-1, 1, 1])[:, None, None]
    read = nominal.read(force)[:, :, ::-1] * np.array([-1, 1, 1])[:, None, None]
    np.testing.assert_allclose(nominal.read(mirrored), read, atol=1e-9)


def test_small_loads_add_up_and_large_ones_less_than_that(nominal):
    small = pressed((2, 2), (0.0, 0.0, 1e-3))
    np.testing.assert_allclose(nominal.read(2 * small), 2 * nominal.read(small), rtol=0.01, atol=1e-6)
    moved = [nominal.motion(pressed((2, 2), (0, 0, f)))[0][2, 2, 2] for f in (1e-3, 2.0)]
    assert moved[1] < 0.95 * 2000 * moved[0]


def test_a_unit_reads_the_sum_of_its_own_magnets():
    """The unit's matrices agree with a plain sum over all dipoles at their actual places."""
    pad = MagneticPad.unit(LAYOUT, 3, PadParameters(gain_spread=0.0, turn_spread=0.0))
    force = np.random.default_rng(4).uniform(0, 0.4, (3, 6, 5))
    moved, rotated = (part.reshape(3, 30).T for part in pad.motion(force))
    there, moments, sensors = pad.made.magnets.T, pad.made.moments.T, pad.made.sensors.T
    loaded = field(turned(moments, rotated), sensors[:, None] - there - moved)
    change = (loaded - field(moments, sensors[:, None] - there)).sum(axis=1)
    np.testing.assert_allclose(pad.flux(force).reshape(3, 30).T, change, atol=2e-3 * np.abs(change).max())


def test_each_magnet_moves_as_the_gel_does_where_it_is():
    """A manufactured magnet is neither at its nominal depth nor in the middle of its taxel."""
    pad = MagneticPad.unit(LAYOUT, 5)
    layer, places = pad.parameters.layer, pad.made.magnets.T
    force = np.random.default_rng(5).uniform(0, 1e-3, (3, 6, 5))  # small: the gel does not stiffen yet
    moved, rotated = pad.motion(force)
    for magnet in (0, 13, 29):
        offsets = places[magnet, :2] - LAYOUT.positions[:, :2]
        responses = layer_response(
            offsets, places[magnet, 2], layer.thickness, layer.modulus, layer.poisson, LAYOUT.pitch
        )
        for got, response in zip((moved, rotated), responses, strict=True):
            exact = np.einsum("nij,jn->i", response, force.reshape(3, 30))
            np.testing.assert_allclose(got.reshape(3, 30)[:, magnet], exact, atol=0.02 * np.abs(exact).max())
    apart = MagneticPad.unit(LAYOUT, 5, PadParameters(place_spread=0.0)).motion(force)[0] - moved
    assert np.abs(apart).max() > 0.05 * np.abs(moved).max()


def test_noise_steps_and_range_of_the_hall_sensors(nominal):
    rest = np.zeros((2000, 3, 6, 5))
    noisy = nominal.measure(rest, np.random.default_rng(0))
    assert 1e-4 < noisy.std() < 0.05
    assert np.abs(noisy.mean(axis=0)).max() < 5 * noisy.std() / np.sqrt(2000) + 0.01
    narrow = MagneticPad(LAYOUT, PadParameters(range=3.1e-3))
    force = spread(60.0)
    clipped = narrow.measure(force, np.random.default_rng(0))
    assert clipped[2].max() < 0.9 * nominal.measure(force, np.random.default_rng(0))[2].max()


def test_warm_magnets_and_a_field_from_outside_shift_the_zero():
    pad, rest = MagneticPad.unit(LAYOUT, 4), np.zeros((3, 6, 5))
    warm = pad.read(rest, warmer=10.0)
    assert 0.01 < np.abs(warm).max() < 1.0
    np.testing.assert_allclose(pad.read(rest, warmer=20.0), 2 * warm)
    # weaker magnets also reduce the reading of a load
    load = pressed((2, 2), (0, 0, 1.0))
    gain = (pad.read(load, warmer=10.0) - warm)[2, 2, 2] / pad.read(load)[2, 2, 2]
    assert gain == pytest.approx(1 - 1.2e-2, rel=1e-6)
    iron = pad.read(rest, outside=(0.0, 0.0, 50e-6))
    assert 0.02 < np.abs(iron).max() < 0.5
    torch = pytest.importorskip("torch")
    both = pad.read(torch.zeros(3, 6, 5, dtype=torch.float64), warmer=10.0, outside=(0.0, 0.0, 50e-6))
    np.testing.assert_allclose(both.numpy(), warm + iron, atol=1e-9)


def test_torch_gives_what_numpy_gives():
    torch = pytest.importorskip("torch")
    pad = MagneticPad.unit(LAYOUT, 3)
    force = np.random.default_rng(2).uniform(0, 0.5, (2, 4, 3, 6, 5))
    got = pad.read(torch.as_tensor(force))
    assert got.dtype == torch.float64
    np.testing.assert_allclose(got.numpy(), pad.read(force), atol=1e-9)
    single = pad.read(torch.as_tensor(force, dtype=torch.float32))
    np.testing.assert_allclose(single.numpy(), pad.read(force), atol=2e-3)


def test_what_cannot_be_built_is_refused():
    for make, words in (
        (lambda: MagneticPad(TaxelLayout(1, 3, (1e-3, 1e-3), positions=np.eye(3) * 1e-3)), "flat grid"),
        (lambda: MagneticPad.unit(LAYOUT, -1), "0 or more"),
        (lambda: MagneticPad.unit(LAYOUT, 1.5), "0 or more"),
        (lambda: PadParameters(magnet_depth=4e-3), "magnet_depth"),
        (lambda: PadParameters(Layer(bonded=False)), "shear"),
        (lambda: PadParameters(0.5e6), "paxisim.Layer"),  # type: ignore[arg-type]
        (lambda: PadParameters(remanence=-1.0), "remanence"),
        (lambda: MagneticPad(LAYOUT).read(np.zeros((3, 5, 6))), "6"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            make()
