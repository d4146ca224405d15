"""Physics of the transforms that mix or move taxels or axes: worked values, limits, symmetries."""

import math
from functools import partial

import numpy as np
import pytest
from forces import frame, press, taxel
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim import Chain, InvalidValueError, TaxelLayout
from paxisim.augment import AxisCoupling, AxisGain, Crosstalk, LayoutFault, Poisson, Rotation, SwappedTaxels
from paxisim.augment.rotation import rotation_matrix


class TestCrosstalk:
    def test_neighbours_get_their_share(self):
        s, length, far = 0.05, 0.5, 0.8
        y = Crosstalk((0, 0, s), length, far)(press(3, 3))
        z = y[0, 2]
        np.testing.assert_allclose([z[2, 3], z[4, 3], z[3, 2], z[3, 4]], s)
        np.testing.assert_allclose([z[2, 2], z[4, 4]], s * far * math.exp((1 - math.sqrt(2)) / length))
        np.testing.assert_allclose(z[3, 5], s * far * math.exp(-1 / length))
        assert not y[:, :2].any(), "each axis keeps to itself"
        corner = Crosstalk((0, 0, s), length, far)(press(0, 0))[0, 2, 0, 0]
        assert z[3, 3] < corner < 1, "a corner spreads less than the middle"

    @pytest.mark.parametrize("taken", [0.0, 0.4, 1.0])
    def test_what_neighbours_get_is_taken_in_that_share(self, taken):
        x = frame()
        total = x.sum(axis=(-2, -1))
        gained = Crosstalk((0.1, 0.05, -0.02), taken=0.0)(x).sum(axis=(-2, -1)) - total
        crosstalk = Crosstalk((0.1, 0.05, -0.02), taken=taken)
        np.testing.assert_allclose(crosstalk(x).sum(axis=(-2, -1)), total + (1 - taken) * gained, atol=1e-12)
        if taken == 1:
            np.testing.assert_allclose(crosstalk(np.full((2, 3, 6, 5), 2.5)), 2.5, err_msg="a uniform load stays")

    @pytest.mark.parametrize(
        "mixing", [partial(Crosstalk, (0.1, 0.05, 0.02)), partial(Poisson, 0.2, 0.1), partial(Poisson, 0.2, 0.1, 1.0)]
    )
    def test_a_grid_mixes_as_one_whatever_its_pitch_and_by_positions_too(self, mixing):
        x, grid = frame(), TaxelLayout(6, 5, (6e-3, 2e-3))
        on_grid = mixing()(x)
        np.testing.assert_array_equal(mixing(layout=grid)(x), on_grid)
        moved = TaxelLayout(6, 5, (6e-3, 2e-3), grid.positions + 1e-9 * np.arange(30)[:, None] / 30)
        assert not moved.is_grid
        np.testing.assert_allclose(mixing(layout=moved)(x), on_grid, atol=1e-4)
        order = np.random.default_rng(5).permutation(30)
        line = TaxelLayout(1, 30, (6e-3, 2e-3), grid.positions[order])
        y = mixing(layout=line)(x.reshape(2, 3, 1, 30)[..., order])
        np.testing.assert_allclose(y[..., 0, :], on_grid.reshape(2, 3, 30)[..., order], atol=1e-14)
        again = Chain.from_json(Chain([mixing(layout=line)]).to_json())[0]
        assert again.layout == line
        with pytest.raises(InvalidValueError, match="layout has 1x30 taxels, the tensor 6x5"):
            again(x)

    def test_taxels_nearer_than_a_pitch_get_no_more_than_a_neighbour(self):
        positions = [[0, 0, 0], [0, 0, 0], [1e-3, 0, 0], [2e-3, 0, 0]]
        layout = TaxelLayout(1, 4, (2e-3, 2e-3), np.array(positions))
        z = Crosstalk((0, 0, 0.1), 0.5, layout=layout)(press(0, 0, 1, 4))[0, 2, 0]
        np.testing.assert_allclose(z, [0.7, 0.1, 0.1, 0.1])


def test_gains_and_rotations_are_couplings_of_axes():
    x, gain, angles = frame(), np.array([0.5, 1.2, 2.0]), np.array([0.2, -0.1, 0.5])
    np.testing.assert_allclose(AxisCoupling(np.diag(gain))(x), AxisGain(gain)(x))
    np.testing.assert_allclose(AxisCoupling(rotation_matrix(-angles))(x), Rotation(angles[None])(x), atol=1e-14)


class TestRotation:
    @pytest.mark.parametrize(
        ("angles", "force", "read"),
        [
            ((0, 0, math.pi / 2), (0, 1, 0), (1, 0, 0)),  # the sensor's x axis is the pad's y axis
            ((0, 0, math.pi / 2), (1, 0, 0), (0, -1, 0)),
            ((math.pi / 2, 0, 0), (0, 0, 1), (0, 1, 0)),
            ((0, math.pi / 2, 0), (1, 0, 0), (0, 0, 1)),
            ((0, 0, math.pi), (1, 2, 3), (-1, -2, 3)),
        ],
    )
    def test_quarter_and_half_turns(self, angles, force, read):
        x = np.concatenate([taxel(*force)] * 2)
        y = Rotation((angles, (0, 0, 0)))(x)
        np.testing.assert_allclose(y, np.concatenate([taxel(*read), taxel(*force)]), atol=1e-15)

    @settings(max_examples=30)
    @given(st.lists(st.floats(-math.pi, math.pi), min_size=3, max_size=3), st.integers(0, 100))
    def test_the_length_stays_and_the_turn_can_be_undone(self, angles, seed):
        x = frame(seed)
        y = Rotation((angles,))(x)
        np.testing.assert_allclose((y**2).sum(1), (x**2).sum(1), atol=1e-12)
        np.testing.assert_allclose(Rotation((-np.array(angles),))(y), x, atol=1e-12)
        axis = np.asarray(angles).reshape(1, 3, 1, 1)
        np.testing.assert_allclose(Rotation((angles,))(axis), axis, atol=1e-14)

    @pytest.mark.parametrize("angle", [1e-9, 1e-4, 0.0999, 0.1, 0.1001, 1.0, 3.0])
    def test_the_series_meets_the_formula(self, angle):
        matrix = rotation_matrix(np.array([0, 0, angle]))
        c, s = math.cos(angle), math.sin(angle)
        np.testing.assert_allclose(matrix, [[c, -s, 0], [s, c, 0], [0, 0, 1]], rtol=1e-15, atol=1e-16)

    def test_second_derivatives_exist_at_zero(self):
        torch = pytest.importorskip("torch")

        def read(angles):
            return Rotation(angles[None])(torch.as_tensor(taxel(1, 2, 3))).sum()

        zero = torch.zeros(3, dtype=torch.float64)
        assert torch.isfinite(torch.autograd.functional.hessian(read, zero)).all()


class TestLayoutFault:
    @pytest.mark.parametrize(
        ("fault", "to"),
        [
            ({}, [0, 1]),
            ({"flip_rows": True}, [3, 1]),
            ({"flip_cols": True}, [0, 2]),
            ({"transpose": True}, [1, 0]),
            ({"transpose": True, "flip_rows": True}, [2, 0]),  # transposed first
        ],
    )
    def test_a_taxel_goes_where_it_is_said_to(self, fault, to):
        assert np.argwhere(LayoutFault(**fault)(press(0, 1, 4, 4))[0, 2]).tolist() == [to]

    def test_pads_axes_and_signs(self):
        x = frame()
        np.testing.assert_array_equal(LayoutFault(pad_order=(1, 0))(x), x[::-1])
        y = LayoutFault(axis_order=(1, 2, 0), axis_signs=(1, -1, -1))(x)
        np.testing.assert_array_equal(y, np.stack([x[:, 1], -x[:, 2], -x[:, 0]], axis=1))


class TestSwappedTaxels:
    def test_each_of_a_pair_reads_the_other(self):
        x, swapped = frame(0, 2), SwappedTaxels([(1, 0, 2, 5, 4), (0, 1, 1, 1, 2)])
        expected = x.copy()
        for pad, *pair in swapped.rings:
            (a, b), (c, d) = pair[:2], pair[2:]
            expected[:, pad, :, a, b], expected[:, pad, :, c, d] = x[:, pad, :, c, d], x[:, pad, :, a, b]
        np.testing.assert_array_equal(swapped(x), expected)
        (again,) = Chain.from_json(Chain([swapped]).to_json())
        assert again.rings == ((1, 0, 2, 5, 4), (0, 1, 1, 1, 2))

    def test_each_of_a_ring_reads_the_next(self):
        x = frame(0, 2)
        y = SwappedTaxels([(1, 0, 2, 5, 4, 3, 0)])(x)
        expected = x.copy()
        for (row, col), (next_row, next_col) in (((0, 2), (5, 4)), ((5, 4), (3, 0)), ((3, 0), (0, 2))):
            expected[:, 1, :, row, col] = x[:, 1, :, next_row, next_col]
        np.testing.assert_array_equal(y, expected)
