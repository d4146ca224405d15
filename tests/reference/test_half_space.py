"""The half-space against properties that hold independently of the formula used."""

import numpy as np
import pytest

from paxisim.reference.half_space import half_space_response, point_response

E, NU, PITCH = 0.5e6, 0.48, (4e-3, 5e-3)
G = E / (2 * (1 + NU))


def test_a_normal_force_moves_the_surface_as_boussinesq_says():
    far = np.array([[0.05, 0.0, 1e-9]])
    moved = point_response(far, E, NU)[0]
    assert moved[2, 2] == pytest.approx((1 - NU) / (2 * np.pi * G * 0.05), rel=1e-6)
    # the surface of a compressible body moves towards a press
    assert point_response(far, E, 0.2)[0, 0, 2] < 0


@pytest.mark.parametrize("poisson", [0.2, 0.48])
def test_the_displacements_are_in_equilibrium_and_leave_the_surface_free(poisson):
    """Navier: (lambda + mu) grad div u + mu laplace u = 0 inside, by differences; no traction away from the force."""
    shear, h = E / (2 * (1 + poisson)), 5e-6
    lame = 2 * shear * poisson / (1 - 2 * poisson)
    at = np.array([1.5e-3, -0.7e-3, 1.2e-3])

    def u(point):
        return point_response(np.asarray(point)[None], E, poisson)[0]

    def slopes(point, h=h):
        return np.stack([(u(point + h * a) - u(point - h * a)) / (2 * h) for a in np.eye(3)])

    laplace = sum(u(at + h * a) + u(at - h * a) - 2 * u(at) for a in np.eye(3)) / h**2
    divergence = [np.einsum("iij->j", slopes(at + h * a)) - np.einsum("iij->j", slopes(at - h * a)) for a in np.eye(3)]
    left = (lame + shear) * np.stack(divergence) / (2 * h) + shear * laplace
    assert np.abs(left).max() < 2e-3 * shear * np.abs(laplace).max()

    on = np.array([2e-3, 1e-3, 1e-6])
    grad = slopes(on, 1e-7)
    stress = shear * (grad[2] + grad[:, 2])  # sigma_zi
    stress[2] = lame * np.einsum("iij->j", grad) + 2 * shear * grad[2, 2]
    inside = np.array([1e-6, 1e-6, 1e-3])
    below = shear * 2 * slopes(inside)[2, 2, 2]
    assert np.abs(stress[:, :]).max() < 5e-3 * abs(below)


def test_a_rectangle_far_away_is_a_point_and_twice_the_modulus_is_half_the_way():
    offsets = np.array([[0.04, 0.03]])
    moved, turned = half_space_response(offsets, 1e-3, E, NU, PITCH)
    point = point_response(np.array([[0.04, 0.03, 1e-3]]), E, NU)
    np.testing.assert_allclose(moved, point, rtol=5e-3, atol=1e-4 * np.abs(point).max())
    half, half_turned = half_space_response(offsets, 1e-3, 2 * E, NU, PITCH)
    np.testing.assert_allclose(moved, 2 * half)
    np.testing.assert_allclose(turned, 2 * half_turned)
