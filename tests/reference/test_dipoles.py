"""Magnetic dipole fields against an independent package and for self-consistency."""

import numpy as np
import pytest

from paxisim.reference.dipoles import field, jacobian, turned
from paxisim.reference.parameters import PadParameters
from paxisim.reference.stiffening import finite_share

magpylib = pytest.importorskip("magpylib", reason="needs magpylib; install the test extra")
RNG = np.random.default_rng(0)


def test_a_dipole_is_magpylibs():
    moment, offset = RNG.normal(size=(20, 3)) * 1e-3, RNG.normal(size=(20, 3)) * 5e-3
    for m, r in zip(moment, offset, strict=True):
        np.testing.assert_allclose(field(m, r), magpylib.misc.Dipole(moment=m).getB(r), rtol=1e-9)


def test_the_pads_magnets_are_small_enough_for_dipoles():
    """At the sensor below, the fields of a cylindrical magnet of the pad and of its dipole differ by a few per cent."""
    own = PadParameters()
    cylinder = magpylib.magnet.Cylinder(polarization=(0, 0, own.remanence), dimension=(1e-3, 0.5e-3))
    for offset in ([0, 0, own.distance], [1e-3, 0, own.distance], [4e-3, 2e-3, own.distance]):
        finite = cylinder.getB(offset)
        dipole = field(np.array([0, 0, own.moment]), np.array(offset))
        assert np.linalg.norm(dipole - finite) < 0.04 * np.linalg.norm(finite)


def test_the_jacobian_predicts_small_movements():
    moment, offset = RNG.normal(size=(6, 3)) * 1e-3, np.array([0, 0, 4e-3]) + RNG.normal(size=(6, 3)) * 1e-3
    moved, rotated = RNG.normal(size=(6, 3)) * 2e-6, RNG.normal(size=(6, 3)) * 1e-3
    exact = field(turned(moment, rotated), offset - moved) - field(moment, offset)
    linear = np.einsum("nij,nj->ni", jacobian(moment, offset), np.concatenate([moved, rotated], axis=1))
    np.testing.assert_allclose(linear, exact, atol=0.01 * np.abs(exact).max())


def test_a_turn_keeps_the_length_and_is_a_small_rotation():
    moment = RNG.normal(size=(50, 3))
    rotation = 0.02 * RNG.normal(size=(50, 3))
    out = turned(moment, rotation)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), np.linalg.norm(moment, axis=1))
    np.testing.assert_allclose(out, moment + np.cross(rotation, moment), atol=5e-3)


@pytest.mark.parametrize("strain", [1e-6, 0.01, 0.1, 0.5, 2.0])
def test_the_stretch_solves_the_neo_hookean_rod(strain):
    stretch = 1 - strain * finite_share(np.float64(strain))
    assert stretch - stretch**-2 == pytest.approx(-3 * strain, rel=1e-4 if strain < 1 else 3e-3)
    assert finite_share(np.float64(-strain)) == pytest.approx(1), "tension counts as small strain"
