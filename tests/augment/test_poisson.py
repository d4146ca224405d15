"""Poisson: which way a load pushes its neighbours and how far, on the grid and off it."""

import numpy as np
import pytest
from forces import frame, needs_torch, press, torch

from paxisim.augment.poisson import Poisson
from paxisim.layout import TaxelLayout


def test_load_pushes_its_neighbours_away():
    y = Poisson(0.2, 0.1)(press(3, 2))[0]
    assert y[0, 3, 3] > 0 > y[0, 3, 1]
    assert y[1, 4, 2] > 0 > y[1, 2, 2]
    assert y[0, 4, 3] > 0
    assert y[1, 4, 3] > 0
    assert y[0, 3, 2] == y[1, 3, 2] == 0, "a taxel does not push itself"
    np.testing.assert_array_equal(y[2], press(3, 2)[0, 2])
    assert np.count_nonzero(y[:2]) == 12, "no further than 3x3, and not across"


def test_the_default_kernel_is_nearly_sobels():
    y = Poisson(4.0, 4.0)(press(3, 2))[0, 0, 2:5, 1:4]
    np.testing.assert_allclose(y, [[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], atol=0.07)


@pytest.mark.parametrize(("reach", "falloff"), [(1, 1), (1.5, 1), (1.5, 0.3), (2.9, 2), (2.9, np.inf)])
def test_c_is_the_shear_beside_a_load_on_one_side(reach, falloff):
    x = np.zeros((1, 3, 9, 9))
    x[0, 2, :, :4] = 1.0
    for load, shear in ((x, (0.2, 0)), (x.swapaxes(-1, -2), (0, 0.1))):
        y = Poisson(0.2, 0.1, reach, falloff)(load)[0]
        np.testing.assert_allclose(y[:2, 4, 4], shear, atol=1e-15)


def test_each_environment_its_own_cx_and_all_one_cy():
    x, cx = frame(3, 4), np.array([0.0, 0.1, 0.2, 0.3])
    for force in (x, x[0]):
        y = Poisson(cx, 0.2)(force)
        expected = [Poisson(one, 0.2)(x[i] if force is x else force) for i, one in enumerate(cx)]
        np.testing.assert_allclose(y, expected, atol=1e-15)


def test_a_tilted_pad_reads_what_a_flat_one_reads_turned():
    """Turning the whole pad about its x axis turns the forces with it; the taxel frames keep their x axis."""
    flat, a = TaxelLayout(6, 5, 2e-3), 0.4
    turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    tilted = TaxelLayout(6, 5, 2e-3, flat.positions @ turn.T, flat.normals @ turn.T)

    def turned(force):
        return np.einsum("ij,pjrc->pirc", turn, force)

    y = Poisson(0.2, 0.1, layout=tilted)(turned(frame()))
    np.testing.assert_allclose(y, turned(Poisson(0.2, 0.1)(frame())), atol=1e-14)


def test_on_a_fingertip_the_push_lies_in_the_tangent_plane():
    angle = np.linspace(-1, 1, 7)
    normals = np.stack([np.sin(angle), np.zeros(7), -np.cos(angle)], axis=1)
    tip = TaxelLayout(1, 7, (2e-3, 2e-3), 6e-3 * normals, normals)
    x = np.zeros((1, 3, 1, 7))
    x[0, :, 0, 3] = -normals[3]  # 1 N along the middle taxel's normal
    push = (Poisson(0.2, 0.2, layout=tip)(x) - x)[0, :, 0].T
    assert np.abs(push[[2, 4]]).max() > 0.05
    np.testing.assert_allclose(np.sum(push * normals, axis=1), 0, atol=1e-15)
    assert push[4, 0] > 0 > push[2, 0]
    np.testing.assert_allclose(push[4], push[2] * [-1, 1, 1], atol=1e-15)


@needs_torch
def test_a_constant_made_in_inference_mode_serves_gradients():
    x = torch.ones(2, 3, 3, 7, dtype=torch.float64)
    with torch.inference_mode():
        Poisson(0.2)(x)
    cx = torch.tensor(0.2, dtype=torch.float64, requires_grad=True)
    Poisson(cx)(x.requires_grad_()).sum().backward()
    assert x.grad is not None
    assert cx.grad is not None
