"""Physics of the transforms that mix taxels or axes: worked values, limits, symmetries."""

import math
from functools import partial

import numpy as np
import pytest
from forces import frame, press, taxel
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim.augment.axis_coupling import AxisCoupling
from paxisim.augment.chain import Chain
from paxisim.augment.crosstalk import Crosstalk
from paxisim.augment.gains import AxisGain
from paxisim.augment.layout_faults import LayoutFault
from paxisim.augment.poisson import Poisson
from paxisim.augment.rotation import Rotation, rotation_matrix
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout


class TestCrosstalk:
    @pytest.mark.parametrize("taken", [0.0, 0.4, 1.0])
    def test_what_neighbours_get_is_taken_in_that_share(self, taken):
        x = np.random.default_rng(0).normal(size=(2, 3, 6, 5))
        total = x.sum(axis=(-2, -1))
        gained = Crosstalk((0.1, 0.05, -0.02), taken=0.0)(x).sum(axis=(-2, -1)) - total
        y = Crosstalk((0.1, 0.05, -0.02), taken=taken)(x)
        np.testing.assert_allclose(y.sum(axis=(-2, -1)), total + (1 - taken) * gained, atol=1e-12)

    def test_neighbours_get_their_share(self):
        s, length, far = 0.05, 0.5, 0.8
        z = Crosstalk((0, 0, s), length, far)(press(3, 3))[0, 2]
        np.testing.assert_allclose([z[2, 3], z[4, 3], z[3, 2], z[3, 4]], s)
        np.testing.assert_allclose([z[2, 2], z[4, 4]], s * far * math.exp((1 - math.sqrt(2)) / length))
        np.testing.assert_allclose(z[3, 5], s * far * math.exp(-1 / length))
        assert z[3, 3] == pytest.approx(1 - (z.sum() - z[3, 3]))

    def test_each_axis_keeps_to_itself(self):
        y = Crosstalk((0.1, 0.1, 0.05))(press(3, 3))
        assert not y[:, :2].any()
        x = frame()
        np.testing.assert_array_equal(Crosstalk((0.1, 0.0, 0.1))(x)[:, 1], x[:, 1])

    @settings(max_examples=20)
    @given(st.floats(-0.5, 0.5), st.floats(0.05, 20), st.floats(0, 10), st.integers(0, 100))
    def test_force_and_uniform_loads_are_conserved(self, strength, length, far, seed):
        t = Crosstalk(np.full(3, strength), length, far)
        x = frame(seed)
        np.testing.assert_allclose(t(x).sum((-2, -1)), x.sum((-2, -1)), atol=1e-9)
        np.testing.assert_allclose(t(np.full((2, 3, 6, 5), 2.5)), 2.5, atol=1e-9)

    def test_a_corner_spreads_less_than_the_middle(self):
        middle, corner = (Crosstalk((0, 0, 0.05))(press(i, i))[0, 2, i, i] for i in (3, 0))
        assert middle < corner < 1

    def test_the_effect_is_mutual(self):
        a, b = Crosstalk((0, 0, 0.05))(press(1, 2)), Crosstalk((0, 0, 0.05))(press(4, 6))
        assert a[0, 2, 4, 6] == b[0, 2, 1, 2] > 0

    def test_a_grid_is_a_grid_by_positions_too(self):
        grid = TaxelLayout(6, 5, (3e-3, 3e-3))
        line = TaxelLayout(1, 30, (3e-3, 3e-3), grid.positions)
        x = frame()
        on_grid = Crosstalk((0.1, 0.05, 0.02))(x)
        by_position = Crosstalk((0.1, 0.05, 0.02), layout=line)(x.reshape(2, 3, 1, 30))
        np.testing.assert_allclose(by_position.reshape(x.shape), on_grid, atol=1e-14)
        np.testing.assert_array_equal(Crosstalk((0.1, 0.05, 0.02), layout=grid)(x), on_grid)

    @pytest.mark.parametrize(
        "mixing", [partial(Crosstalk, (0.1, 0.05, 0.02)), partial(Poisson, 0.2, 0.1), partial(Poisson, 0.2, 0.1, 1.0)]
    )
    def test_a_grid_that_is_off_by_a_nanometre_mixes_as_the_grid(self, mixing):
        grid = TaxelLayout(6, 5, (6e-3, 2e-3))
        moved = TaxelLayout(6, 5, (6e-3, 2e-3), grid.positions + 1e-9 * np.arange(30)[:, None] / 30)
        assert not moved.is_grid
        np.testing.assert_allclose(mixing(layout=moved)(frame()), mixing(layout=grid)(frame()), atol=1e-4)

    def test_taxels_nearer_than_a_pitch_get_no_more_than_a_neighbour(self):
        positions = [[0, 0, 0], [0, 0, 0], [1e-3, 0, 0], [2e-3, 0, 0]]
        layout = TaxelLayout(1, 4, (2e-3, 2e-3), np.array(positions))
        z = Crosstalk((0, 0, 0.1), 0.5, layout=layout)(press(0, 0, 1, 4))[0, 2, 0]
        np.testing.assert_allclose(z, [0.7, 0.1, 0.1, 0.1])

    def test_another_layout_is_refused(self):
        layout = TaxelLayout(1, 30, (1e-3, 1e-3), np.random.default_rng(0).normal(size=(30, 3)))
        with pytest.raises(InvalidValueError, match="Crosstalk: layout has 1x30 taxels, the tensor 6x5"):
            Crosstalk((0.1,), layout=layout)(frame())

    def test_a_layout_compiles(self):
        torch = pytest.importorskip("torch")
        t = Crosstalk((0.1,), layout=TaxelLayout(1, 30, (1.0, 1.0), np.random.default_rng(0).normal(size=(30, 3))))
        x = torch.as_tensor(frame(rows=1, cols=30))
        torch._dynamo.reset()
        compiled = torch.compile(lambda x: t(x), fullgraph=True, backend="eager")
        np.testing.assert_allclose(compiled(x), t(x.numpy()), atol=1e-13)

    def test_a_layout_travels_in_json(self):
        layout = TaxelLayout(1, 30, (1e-3, 1e-3), np.random.default_rng(0).normal(size=(30, 3)))
        chain = Chain([Crosstalk((0.1,), layout=layout)])
        assert Chain.from_json(chain.to_json())[0].layout == layout


class TestAxisCoupling:
    def test_a_normal_force_is_read_as_shear(self):
        matrix = np.eye(3)
        matrix[0, 2] = 0.1
        np.testing.assert_allclose(AxisCoupling(matrix)(taxel(0, 0, 5)), taxel(0.5, 0, 5))
        np.testing.assert_allclose(AxisCoupling(matrix)(taxel(5, 0, 0)), taxel(5, 0, 0))

    def test_couplings_multiply(self):
        a, b = np.random.default_rng(0).normal(size=(2, 3, 3))
        x = frame()
        np.testing.assert_allclose(AxisCoupling(a)(AxisCoupling(b)(x)), AxisCoupling(a @ b)(x), atol=1e-12)
        np.testing.assert_allclose(AxisCoupling(np.linalg.inv(a))(AxisCoupling(a)(x)), x, atol=1e-12)

    def test_its_diagonal_is_a_gain(self):
        gain = np.array([0.5, 1.2, 2.0])
        np.testing.assert_allclose(AxisCoupling(np.diag(gain))(frame()), AxisGain(gain)(frame()))

    def test_a_rotation_is_a_coupling(self):
        angles = np.array([0.2, -0.1, 0.5])
        matrix = rotation_matrix(angles).T
        np.testing.assert_allclose(AxisCoupling(matrix)(frame()), Rotation(angles[None])(frame()), atol=1e-14)


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
        np.testing.assert_allclose(Rotation((angles,))(taxel(*force)), taxel(*read), atol=1e-15)

    def test_a_small_tilt_leaks_normal_force_into_shear(self):
        y = Rotation(((0.01, 0.02, 0),))(taxel(0, 0, 10))
        np.testing.assert_allclose(y, taxel(-0.2, 0.1, 10), atol=0.003)

    @given(st.lists(st.floats(-math.pi, math.pi), min_size=3, max_size=3), st.integers(0, 100))
    def test_the_length_stays_and_the_turn_can_be_undone(self, angles, seed):
        x = frame(seed)
        y = Rotation((angles,))(x)
        np.testing.assert_allclose((y**2).sum(1), (x**2).sum(1), atol=1e-12)
        np.testing.assert_allclose(Rotation((-np.array(angles),))(y), x, atol=1e-12)
        axis = np.asarray(angles).reshape(1, 3, 1, 1)
        np.testing.assert_allclose(Rotation((angles,))(axis), axis, atol=1e-14)

    def test_each_pad_by_itself(self):
        x = frame()
        y = Rotation(((0, 0, 0.4), (0, 0, 0)))(x)
        np.testing.assert_array_equal(y[1], x[1])
        assert not np.allclose(y[0], x[0])

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
        # y = x - a cross x + ...: per radian about x, the sum changes by -(x_y - x_z); likewise about y and z
        np.testing.assert_allclose(
            torch.autograd.functional.jacobian(read, zero), [-1 * (2 - 3), -1 * (3 - 1), -1 * (1 - 2)]
        )
        assert torch.isfinite(torch.autograd.functional.hessian(read, zero)).all()


class TestLayoutFault:
    def test_the_first_taxel_goes_where_it_is_said_to(self):
        def corner(**fault):
            return [
                tuple(int(i) for i in where) for where in np.argwhere(LayoutFault(**fault)(press(0, 1, 4, 4))[0, 2])
            ]

        assert corner() == [(0, 1)]
        assert corner(flip_rows=True) == [(3, 1)]
        assert corner(flip_cols=True) == [(0, 2)]
        assert corner(transpose=True) == [(1, 0)]
        assert corner(transpose=True, flip_rows=True) == [(2, 0)]  # transposed first

    def test_pads_axes_and_signs(self):
        x = frame()
        np.testing.assert_array_equal(LayoutFault(pad_order=(1, 0))(x), x[::-1])
        y = LayoutFault(axis_order=(1, 2, 0), axis_signs=(1, -1, -1))(x)
        np.testing.assert_array_equal(y, np.stack([x[:, 1], -x[:, 2], -x[:, 0]], axis=1))

    def test_flips_and_swaps_undo_themselves(self):
        fault = LayoutFault(
            flip_rows=True, flip_cols=True, pad_order=(1, 0), axis_order=(1, 0, 2), axis_signs=(-1, -1, 1)
        )
        x = frame()
        np.testing.assert_array_equal(fault(fault(x)), x)
        square = frame(rows=5)
        np.testing.assert_array_equal(LayoutFault(transpose=True)(LayoutFault(transpose=True)(square)), square)

    def test_nothing_is_lost(self):
        x = frame(rows=5)
        y = LayoutFault(True, True, True, (1, 0), (2, 0, 1), (1, -1, 1))(x)
        np.testing.assert_array_equal(np.sort(np.abs(y), axis=None), np.sort(np.abs(x), axis=None))

    @pytest.mark.parametrize(
        ("fault", "message"),
        [
            ({"pad_order": (0, 2)}, "pad_order must be a permutation"),
            ({"axis_order": (0, 1, 1)}, "axis_order must be a permutation"),
            ({"axis_signs": (1, 1, 0)}, "axis_signs must be three of 1 and -1"),
            ({"axis_signs": (1, 1)}, "axis_signs must be three of 1 and -1"),
            ({"axis_signs": 1}, "axis_signs must be whole numbers"),
            ({"pad_order": (0, 0.5)}, "pad_order must be whole numbers"),
            ({"flip_rows": "yes"}, "flip_rows must be true or false"),
        ],
    )
    def test_what_is_no_fault(self, fault, message):
        with pytest.raises(InvalidValueError, match=f"^LayoutFault: {message}"):
            LayoutFault(**fault)

    def test_what_does_not_fit_the_tensor(self):
        with pytest.raises(InvalidValueError, match="LayoutFault: transpose needs as many rows as columns"):
            LayoutFault(transpose=True)(frame())
        with pytest.raises(InvalidValueError, match="LayoutFault: pad_order names 3 pads"):
            LayoutFault(pad_order=(2, 0, 1))(frame())
