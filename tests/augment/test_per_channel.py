"""Physics of the transforms that act on each channel separately: worked values, limits, symmetries."""

import math

import numpy as np
import pytest
from forces import frame, taxel
from hypothesis import given
from hypothesis import strategies as st

from paxisim import augment
from paxisim.augment import Chain, ChannelCurve, DeadBand, Firmware, Quantisation, Saturation, Stiffening


def column(value):
    """Return a parameter with one value for each axis."""
    return np.reshape(value, (1, 3, 1, 1))


def readings(transform, normal):
    """Return what one taxel reads of several normal forces."""
    x = np.zeros((len(normal), 1, 3, 1, 1))
    x[:, 0, 2, 0, 0] = normal
    return transform(x)[:, 0, 2, 0, 0]


CURVE = ChannelCurve(np.reshape([0.0, 0.4, 0.2], (3, 1, 1, 1, 1)), 0.0, 2.0)
SOFT, ALL_SOFT = Saturation((-5.0,), (10.0,), 0.4), Saturation((-5.0,), (10.0,), 1.0)  # knees at -3 and 6, and at 0
ONE_SIDED = Saturation(limit_high=(2.0, math.inf, math.inf), softness=1.0)


@pytest.mark.parametrize(
    ("transform", "force", "reading"),
    [
        (CURVE, (0.5, 1, 3), (0.7, 1.4, 3.2)),
        (augment.Offset(column([0.1, -0.2, 0.3])), (0, 0, 1), (0.1, -0.2, 1.3)),
        (Stiffening(0.7, 2.0), (0, 1.2, 1.6), (0, 1.2, 1.6)),  # the load of the calibration reads right
        (Stiffening(2 / 3, 1.0, 1e-3), (0, 0, 8.0), (0, 0, 4.0)),  # a power law above the knee
        (Stiffening(1.5, 2.0, 1e-3), (0, 0, 0.5), (0, 0, 2 * 0.25**1.5)),
        (Stiffening(5.0, 2.0, 10.0), (0, 0, 4.0), (0, 0, 4 * (104 / 101) ** 2)),  # about the square of the force
        (Stiffening(0.7, 1.0, 0.3), (0, 0, 1e-6), (0, 0, 1e-6 * (0.3 / math.hypot(1, 0.3)) ** -0.3)),  # linear below it
        (SOFT, (6, -3, 5.9), (6, -3, 5.9)),
        (SOFT, (8, -4, 100), (6 + 4 * math.tanh(0.5), -3 - 2 * math.tanh(0.5), 10)),
        (ALL_SOFT, (3, -3, 30), (10 * math.tanh(0.3), -5 * math.tanh(0.6), 10 * math.tanh(3))),
        (ONE_SIDED, (-1e3, 1e3, -1e3), (-1e3, 1e3, -1e3)),
        (ONE_SIDED, (1e3, 0, 0), (2, 0, 0)),
        (DeadBand((0.2,) * 3), (0.19, -0.19, 0.2), (0, 0, 0.2)),
        (DeadBand((0.2,) * 3), (5, -5, -0.2), (5, -5, -0.2)),
        (DeadBand((0.2,) * 3, 1.0), (0.2, -0.2, 0.1), (0, 0, 0)),
        (DeadBand((0.2,) * 3, 1.0), (1, -1, 0.3), (0.8, -0.8, 0.1)),
        (DeadBand((0.2,) * 3, edge=0.5), (0.1, 0.2, -0.3), (0, 0.1, -0.3)),  # half open at the width
        (DeadBand((0.5, 0.0, 3.0)), (0.4, 0.1, -2), (0, 0.1, 0)),
        (augment.TaxelGain((((0.5,),),)), (1, 2, 3), (0.5, 1, 1.5)),
        (augment.PadAxisGain(((1, 2, 0.5),)), (1, 2, 3), (1, 4, 1.5)),
        (augment.AxisGain((1, 2, 0.5)), (1, 2, 3), (1, 4, 1.5)),
        (Quantisation((0.5,)), (0.25, 0.75, -0.25), (0, 1, 0)),  # halves go to the even step
        (Quantisation((0.5,)), (0.26, 1.24, -0.26), (0.5, 1, -0.5)),
        (Quantisation((0.1, 0.25, 0.0)), (0.26, -0.4, 0.33), (0.3, -0.5, 0.33)),  # 0: the axis has no steps
        (Firmware(), (0.26, -0.24, 3.04), (0.3, -0.2, 3.0)),
        (Firmware(), (0.14, -0.14, 0.1), (0, 0, 0)),  # a single count is gated to zero
        (Firmware(), (99, -99, 99), (12.7, -12.8, 25.5)),
        (Firmware(), (0, 0, -7), (0, 0, 0)),  # no tension
        (Firmware(gate_counts=0), (0.14, -0.14, 0.1), (0.1, -0.1, 0.1)),
        (Firmware(shear_floor_counts=2), (0.04, -0.14, 0.2), (0.2, -0.2, 0.2)),  # on: shear of two counts or more
        (Firmware(shear_floor_counts=2), (0, -0.34, 3.0), (0.2, -0.3, 3.0)),
        (Firmware(shear_floor_counts=2), (0.5, -0.5, 0.1), (0, 0, 0)),  # off, like its normal force
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_worked_values(transform, force, reading):
    np.testing.assert_allclose(transform(taxel(*force)).ravel(), reading, rtol=1e-5, atol=1e-15)


class TestChannelCurve:
    def test_each_channel_has_its_own_and_beyond_the_ends_the_error_stays(self):
        error = np.random.default_rng(0).normal(size=(5, 2, 3, 6, 5))
        for load, at in ((-7.0, 0), (-1.0, 0), (0.0, 1), (3.0, 4), (50.0, 4)):
            y = ChannelCurve(error, -1.0, 3.0)(np.full((2, 3, 6, 5), load))
            np.testing.assert_allclose(y, load + error[at])
        np.testing.assert_allclose(ChannelCurve(error[:1])(frame()), frame() + error[0], err_msg="one knot: an offset")


class TestStiffening:
    def test_axes_bend_together_or_each_by_itself(self):
        x = taxel(0.4, -0.8, 3.0)
        apart, between, together = (Stiffening(0.7, 2.0, 0.2, share)(x) for share in (0.0, 0.5, 1.0))
        for axis in range(3):
            alone = np.zeros_like(x)
            alone[:, axis] = x[:, axis]
            np.testing.assert_allclose(apart[:, axis], Stiffening(0.7, 2.0, 0.2)(alone)[:, axis], rtol=1e-12)
        assert together[0, 0, 0, 0] < between[0, 0, 0, 0] < apart[0, 0, 0, 0], "shear stiffens under normal load"

    def test_the_direction_stays_whatever_it_is(self):
        x = frame()
        y = Stiffening(1.4)(x)
        turn = augment.Rotation(((0.3, -0.5, 1.0),))
        np.testing.assert_allclose(Stiffening(1.4)(turn(x)), turn(y), atol=1e-13)


class TestSaturation:
    def test_a_hard_limit_is_a_clip_and_the_limit_of_a_soft_one(self):
        x, low, high = 10 * frame(), np.array([-12.8, -12.8, 0.0]), np.array([12.7, 12.7, 25.5])
        clipped = np.clip(x, low.reshape(3, 1, 1), high.reshape(3, 1, 1))
        np.testing.assert_array_equal(Saturation(low, high)(x), clipped)
        np.testing.assert_allclose(Saturation(low, high, 1e-6)(x), clipped, atol=3e-5)

    @given(st.floats(0, 1), st.floats(0, 100), st.floats(-1e3, 1e3), st.floats(0, 10))
    def test_it_rises_within_its_limits(self, softness, limit, force, more):
        y = Saturation((-limit,) * 3, (limit,) * 3, softness)(taxel(force, force + more, -force))[0, :, 0, 0]
        assert np.all(np.abs(y) <= limit)
        assert y[0] <= y[1] + 1e-12
        assert y[2] == -y[0]
        assert np.all(np.abs(y) <= np.abs([force, force + more, force]) + 1e-9)


class TestDeadBand:
    def test_a_soft_edge_is_the_mean_of_noise_ahead_of_a_threshold(self):
        width, noise = 0.2, 0.03
        force = np.linspace(0.05, 0.4, 36)
        shaken = force + noise * np.random.default_rng(0).standard_normal((20000, 1))
        passed = np.where(np.abs(shaken) >= width, shaken, 0.0).mean(axis=0)
        soft = DeadBand((width,) * 3, edge=2.1 * noise / width)
        np.testing.assert_allclose(readings(soft, force), passed, atol=0.02)


@pytest.mark.parametrize(
    ("transform", "force", "gradient"),
    [
        (Quantisation((0.1,)), (0.3, -1.24, 7), (1, 1, 1)),  # straight through
        (Firmware(), (5, 50, -1), (1, 0, 0)),  # stops at the clip
        (Saturation((-math.inf,), (2.0,), 0.5), (-5, 0.5, 100), (1, 1, 0)),
    ],
)
def test_gradients(transform, force, gradient):
    torch = pytest.importorskip("torch")
    x = torch.as_tensor(taxel(*force)).requires_grad_()
    y = transform(x)
    np.testing.assert_array_equal(y.detach(), transform(taxel(*force)), "the value is exact")
    y.sum().backward()
    assert x.grad.ravel().tolist() == pytest.approx(gradient)


def test_gradients_with_one_infinite_limit():
    torch = pytest.importorskip("torch")
    limits = [torch.tensor(value, requires_grad=True) for value in ([-math.inf], [2.0], 0.5)]
    Saturation(*limits)(torch.as_tensor(taxel(-5, 5, 0))).sum().backward()
    assert all(torch.isfinite(value.grad).all() for value in limits)


def test_dead_and_stuck_taxels():
    x = frame()
    dead, stuck = np.zeros((2, 2, 6, 5))
    dead[0, 1, 2] = stuck[1, 3, 4] = dead[1, 0, 0] = stuck[1, 0, 0] = 1
    expected = x.copy()
    expected[0, :, 1, 2] = expected[1, :, 0, 0] = 0  # both: dead wins
    expected[1, :, 3, 4] = 1, 2, 3
    for kind in (float, bool):
        y = augment.DeadTaxels(dead.astype(kind), stuck.astype(kind), column([1.0, 2.0, 3.0]))(x)
        np.testing.assert_array_equal(y, expected)


class TestCovariates:
    def test_interference_is_the_same_at_all_taxels_and_follows_its_covariate(self):
        field = augment.Interference(((1.0, 0, 2.0), (0, 0, -1.0)), ((0, 50.0, 0), (0, 0, 0)))
        x, opening = frame(0, 5), np.linspace(0, 0.08, 5)
        added = field.run(x, np.arange(5.0), {"gripper_opening": opening}) - x
        expected = np.stack([opening, 50 * opening**2, 2 * opening, 0 * opening, 0 * opening, -opening], axis=1)
        np.testing.assert_allclose(added, np.broadcast_to(expected.reshape(5, 2, 3, 1, 1), x.shape), atol=1e-14)

    def test_another_covariate_and_two_of_them(self):
        one = augment.Interference(((0.0, 0.0, 1.0),), covariate="wrist")
        chain = Chain([one, augment.Interference(((0.0, 0.0, 1.0),))])
        assert chain.covariate_names == ("wrist", "gripper_opening")
        y = chain(np.zeros((1, 3, 2, 2)), {"wrist": 1.0, "gripper_opening": 0.25})
        np.testing.assert_allclose(y[0, 2], 1.25)

    def test_a_field_of_two_covariates_is_linear_and_quadratic_in_their_projections(self):
        amounts = np.random.default_rng(0).normal(size=(4, 2, 3, 6, 5))
        directions, middle = np.array([[2.0, 0.5], [-0.5, 2.0]]), np.array([0.2, -0.1])
        field = augment.CovariateField(amounts, ("a", "b"), tuple(middle), tuple(map(tuple, directions)))
        u = directions @ ([0.5, 0.3] - middle)
        expected = frame() + np.tensordot([*u, *(u**2 - 1)], amounts, axes=1)
        np.testing.assert_allclose(field(frame(), {"a": 0.5, "b": 0.3}), expected, atol=1e-13)


class TestFirmware:
    def test_it_is_saturation_quantisation_and_dead_band_in_one_and_sends_again_what_it_sent(self):
        x = 5 * frame(0, 20)
        parts = [Saturation((-12.8, -12.8, 0.0), (12.7, 12.7, 25.5)), Quantisation((0.1,)), DeadBand((0.15,))]
        y = Firmware()(x)
        np.testing.assert_allclose(y, Chain(parts)(x), atol=1e-12)
        np.testing.assert_array_equal(Firmware()(y), y)

    def test_its_floor_of_the_shear_is_that_of_a_dead_band_between_counts(self):
        x = 0.3 * np.random.default_rng(0).standard_normal((200, 2, 3, 3, 3))
        y = Firmware(
            resolution=1e-4, gate_counts=1500, shear_floor_counts=2000, shear_counts=10**5, normal_counts=10**5
        )(x)
        band = DeadBand((0.0, 0.0, 0.15), shear_floor=0.2)(np.maximum(x, [[[-np.inf]], [[-np.inf]], [[0.0]]]))
        gated = np.abs(x[:, :, :2]) < 0.15  # its gate on the shear comes before the floor
        np.testing.assert_allclose(y[:, :, :2][~gated], band[:, :, :2][~gated], atol=1e-4)
        np.testing.assert_allclose(np.abs(y), np.abs(band), atol=1e-4)
