"""Physics of the transforms that act on each channel separately: worked values, limits, symmetries."""

import math

import numpy as np
import pytest
from forces import frame, taxel
from hypothesis import given
from hypothesis import strategies as st

from paxisim.augment.chain import Chain
from paxisim.augment.channel_curve import ChannelCurve
from paxisim.augment.dead_band import DeadBand
from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.firmware import Firmware
from paxisim.augment.interference import Interference
from paxisim.augment.offset import Offset
from paxisim.augment.quantisation import Quantisation
from paxisim.augment.rotation import Rotation
from paxisim.augment.saturation import Saturation
from paxisim.augment.stiffening import Stiffening
from paxisim.errors import InvalidValueError


class TestChannelCurve:
    def test_the_worked_example(self):
        curve = ChannelCurve(np.reshape([0.0, 0.4, 0.2], (3, 1, 1, 1, 1)), 0.0, 2.0)
        y = [curve(taxel(0, 0, x))[0, 2, 0, 0] for x in (0, 0.5, 1, 3)]
        np.testing.assert_allclose(y, [0, 0.7, 1.4, 3.2])

    def test_each_channel_has_its_own_and_beyond_the_ends_the_error_stays(self):
        error = np.random.default_rng(0).normal(size=(5, 2, 3, 6, 5))
        curve = ChannelCurve(error, -1.0, 3.0)
        for load, at in ((-7.0, 0), (-1.0, 0), (0.0, 1), (3.0, 4), (50.0, 4)):
            np.testing.assert_allclose(curve(np.full((2, 3, 6, 5), load)), load + error[at])

    @pytest.mark.parametrize("low", [2.0, np.array([-1.0, 2.0])])
    def test_the_last_knot_is_not_below_the_first(self, low):
        with pytest.raises(InvalidValueError, match="ChannelCurve: high - low must lie in"):
            ChannelCurve(low=low, high=0.0)

    def test_one_knot_is_an_offset(self):
        x = frame()
        np.testing.assert_allclose(ChannelCurve(np.full((1, 1, 1, 1, 1), 0.3))(x), x + 0.3)


class TestOffset:
    def test_it_is_what_an_unloaded_sensor_reads(self):
        value = frame()
        np.testing.assert_array_equal(Offset(value)(np.zeros((4, 2, 3, 6, 5))), np.broadcast_to(value, (4, 2, 3, 6, 5)))

    def test_offsets_add(self):
        x, a, b = frame(0), frame(1), frame(2)
        np.testing.assert_allclose(Offset(a)(Offset(b)(x)), Offset(a + b)(x), atol=1e-14)

    def test_one_value_for_each_axis(self):
        y = Offset(np.array([0.1, -0.2, 0.3]).reshape(1, 3, 1, 1))(np.zeros((2, 3, 6, 5)))
        assert {tuple(force) for force in np.moveaxis(y, 1, -1).reshape(-1, 3)} == {(0.1, -0.2, 0.3)}


class TestStiffening:
    def test_the_load_of_calibration_reads_right(self):
        for exponent in (0.5, 0.7, 1.5, 3):
            np.testing.assert_allclose(Stiffening(exponent, 2.0)(taxel(0, 1.2, 1.6)), taxel(0, 1.2, 1.6), rtol=1e-14)

    def test_a_power_law_well_above_the_knee(self):
        y = Stiffening(2 / 3, 1.0)(taxel(0, 0, 8.0))
        assert y[0, 2, 0, 0] == pytest.approx(4.0, rel=1e-4)
        y = Stiffening(1.5, 2.0)(taxel(0, 0, 0.5))
        assert y[0, 2, 0, 0] == pytest.approx(2 * 0.25**1.5, rel=1e-3)

    def test_linear_below_the_knee(self):
        for knee in (0.01, 0.3):
            bent = Stiffening(0.7, 1.0, knee)
            tiny = bent(taxel(0, 0, 1e-6))[0, 2, 0, 0]
            assert tiny / 1e-6 == pytest.approx((knee / math.hypot(1, knee)) ** -0.3)
            assert bent(taxel(0, 0, 2e-6))[0, 2, 0, 0] == pytest.approx(2 * tiny, rel=1e-6)

    def test_with_a_large_knee_the_gain_changes_with_the_square_of_the_force(self):
        knee, exponent, scale = 10.0, 5.0, 2.0
        bent = Stiffening(exponent, scale, knee)
        force = np.array([0.5, 1.0, 2.0, 4.0])
        gain = np.array([bent(taxel(0, 0, f))[0, 2, 0, 0] for f in force]) / force
        away = gain - (knee / math.hypot(1, knee)) ** (exponent - 1)
        np.testing.assert_allclose(away / away[0], (force / force[0]) ** 2, rtol=0.05)
        assert gain[2] == pytest.approx(1)

    def test_axes_bend_together_or_each_by_itself(self):
        x = taxel(0.4, -0.8, 3.0)
        apart = Stiffening(0.7, 2.0, 0.2, 0.0)(x)
        for axis in range(3):
            alone = np.zeros_like(x)
            alone[:, axis] = x[:, axis]
            np.testing.assert_allclose(apart[:, axis], Stiffening(0.7, 2.0, 0.2)(alone)[:, axis], rtol=1e-12)
        between = Stiffening(0.7, 2.0, 0.2, 0.5)(x)
        together = Stiffening(0.7, 2.0, 0.2)(x)
        shear = [y[0, 0, 0, 0] for y in (together, between, apart)]
        assert shear[0] < shear[1] < shear[2]

    def test_the_direction_stays_whatever_it_is(self):
        x = frame()
        y = Stiffening(1.4)(x)
        np.testing.assert_allclose(np.cross(x, y, axis=1), 0, atol=1e-13)
        assert np.all((x * y).sum(1) > 0)
        np.testing.assert_allclose(Stiffening(1.4)(-x), -y)
        turn = Rotation(((0.3, -0.5, 1.0),))
        np.testing.assert_allclose(Stiffening(1.4)(turn(x)), turn(y), atol=1e-13)

    def test_shear_stiffens_under_normal_load(self):
        alone, pressed = (Stiffening(0.7)(taxel(0.1, 0, z))[0, 0, 0, 0] for z in (0.0, 5.0))
        assert pressed < 0.1 < alone

    @given(st.floats(0.1, 5), st.floats(0, 50), st.floats(1e-3, 50))
    def test_more_force_reads_more(self, exponent, force, more):
        y = Stiffening(exponent)(np.concatenate([taxel(0, 0, force), taxel(0, 0, force + more)]))
        assert y[0, 2, 0, 0] < y[1, 2, 0, 0]


class TestSaturation:
    def test_a_hard_limit_is_a_clip(self):
        x = 10 * frame()
        low, high = np.array([-12.8, -12.8, 0.0]), np.array([12.7, 12.7, 25.5])
        clipped = np.clip(x, low.reshape(3, 1, 1), high.reshape(3, 1, 1))
        np.testing.assert_array_equal(Saturation(low, high)(x), clipped)

    def test_a_soft_limit(self):
        soft = Saturation((-5.0,), (10.0,), 0.4)  # knees at -3 and 6
        assert soft(taxel(6, -3, 5.9)).ravel().tolist() == [6, -3, 5.9]
        np.testing.assert_allclose(
            soft(taxel(8, -4, 100)).ravel(), [6 + 4 * math.tanh(0.5), -3 - 2 * math.tanh(0.5), 10]
        )
        np.testing.assert_allclose(Saturation((-5.0,), (10.0,), 1.0)(taxel(3, -3, 30)).ravel(), [
            10 * math.tanh(0.3), -5 * math.tanh(0.6), 10 * math.tanh(3)
        ])  # fmt: skip

    @given(st.floats(0, 1), st.floats(0, 100), st.floats(-1e3, 1e3), st.floats(0, 10))
    def test_it_rises_within_its_limits(self, softness, limit, force, more):
        t = Saturation((-limit,) * 3, (limit,) * 3, softness)
        y = t(taxel(force, force + more, -force))[0, :, 0, 0]
        assert np.all(np.abs(y) <= limit)
        assert y[0] <= y[1] + 1e-12
        assert y[2] == -y[0]
        assert np.all(np.abs(y) <= np.abs([force, force + more, force]) + 1e-9)

    def test_the_slope_has_no_jump_at_a_soft_knee(self):
        t = Saturation((-10.0,), (10.0,), 0.5)
        below, at, above = t(taxel(5 - 1e-6, 5, 5 + 1e-6)).ravel()
        assert (above - at) / (at - below) == pytest.approx(1, abs=1e-6)

    def test_a_hard_knee_is_the_limit_of_a_soft_one(self):
        x = 10 * frame()
        hard, soft = (Saturation((-5.0,), (5.0,), softness)(x) for softness in (0.0, 1e-6))
        np.testing.assert_allclose(soft, hard, atol=1e-5)

    def test_a_limit_on_one_side_only(self):
        t = Saturation(limit_high=(2.0, math.inf, math.inf), softness=1.0)
        assert t(taxel(-1e3, 1e3, -1e3)).ravel().tolist() == [-1e3, 1e3, -1e3]
        assert t(taxel(1e3, 0, 0))[0, 0, 0, 0] == 2.0

    def test_infinite_limits_travel_in_json(self):
        limits = (Saturation(limit_low=(-1.0, -math.inf, 0.0)), Saturation(limit_high=np.array([[1, np.inf, 2.5]])))
        again = Chain.from_json(Chain(limits).to_json())
        assert again[0].limit_low == (-1.0, -math.inf, 0.0)
        np.testing.assert_array_equal(again[1].limit_high, [[1, np.inf, 2.5]])

    def test_gradients_with_one_infinite_limit(self):
        torch = pytest.importorskip("torch")
        low = torch.tensor([-math.inf], requires_grad=True)
        high = torch.tensor([2.0], requires_grad=True)
        softness = torch.tensor(0.5, requires_grad=True)
        x = torch.as_tensor(taxel(-5, 5, 0), dtype=torch.float32).requires_grad_()
        Saturation(low, high, softness)(x).sum().backward()
        assert all(torch.isfinite(value.grad).all() for value in (low, high, softness, x))


class TestDeadBand:
    def test_a_threshold(self):
        y = DeadBand((0.2,) * 3)(taxel(0.19, -0.19, 0.2))
        assert y.ravel().tolist() == [0, 0, 0.2]
        assert DeadBand((0.2,) * 3)(taxel(5, -5, -0.2)).ravel().tolist() == [5, -5, -0.2]

    def test_a_slack(self):
        slack = DeadBand((0.2,) * 3, 1.0)
        np.testing.assert_allclose(slack(taxel(0.2, -0.2, 0.1)), 0)
        np.testing.assert_allclose(slack(taxel(1, -1, 0.3)).ravel(), [0.8, -0.8, 0.1])

    def test_a_soft_edge_is_half_open_at_the_width_and_has_no_jump(self):
        soft = DeadBand((0.2,) * 3, edge=0.5)
        assert soft(taxel(0.1, 0.2, -0.3)).ravel().tolist() == pytest.approx([0, 0.1, -0.3])
        line = np.zeros((401, 1, 3, 1, 1))
        line[:, 0, 2, 0, 0] = np.linspace(-0.5, 0.5, 401)
        assert np.abs(np.diff(soft(line)[:, 0, 2, 0, 0])).max() < 4 * 0.0025
        line += 1e-4  # avoid the width itself
        np.testing.assert_allclose(DeadBand((0.2,) * 3, 0.4, 1e-9)(line), DeadBand((0.2,) * 3, 0.4)(line), atol=1e-7)

    def test_a_soft_edge_is_the_mean_of_noise_ahead_of_a_threshold(self):
        width, noise = 0.2, 0.03
        force = np.linspace(0.05, 0.4, 36)
        shaken = force + noise * np.random.default_rng(0).standard_normal((20000, 1))
        passed = np.where(np.abs(shaken) >= width, shaken, 0.0).mean(axis=0)
        line = np.zeros((len(force), 1, 3, 1, 1))
        line[:, 0, 2, 0, 0] = force
        read = DeadBand((width,) * 3, edge=2.1 * noise / width)(line)[:, 0, 2, 0, 0]
        np.testing.assert_allclose(read, passed, atol=0.02)

    def test_it_is_odd_and_works_axis_by_axis(self):
        t = DeadBand((0.5, 0.0, 3.0), 0.3)
        x = frame()
        np.testing.assert_array_equal(t(-x), -t(x))
        np.testing.assert_array_equal(t(x)[:, 1], x[:, 1])
        assert not t(x)[:, 2][np.abs(x[:, 2]) < 3].any()


class TestQuantisation:
    def test_halves_go_to_the_even_step(self):
        y = Quantisation((0.5,))(taxel(0.25, 0.75, -0.25))
        assert y.ravel().tolist() == [0.0, 1.0, 0.0]
        assert Quantisation((0.5,))(taxel(0.26, 1.24, -0.26)).ravel().tolist() == [0.5, 1.0, -0.5]

    def test_readings_are_whole_steps_at_most_half_a_step_away(self):
        step, x = np.array([0.1, 0.25, 1.0]), frame()
        y = Quantisation(step)(x)
        counts = y / step.reshape(3, 1, 1)
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-12)
        assert np.all(np.abs(y - x) <= step.reshape(3, 1, 1) / 2 + 1e-12)
        np.testing.assert_array_equal(Quantisation(step)(y), y)

    def test_an_axis_without_steps_stays(self):
        x = frame()
        np.testing.assert_array_equal(Quantisation((0.1, 0.0, 0.1))(x)[:, 1], x[:, 1])

    def test_the_gradient_passes_and_the_value_is_exact(self):
        torch = pytest.importorskip("torch")
        x = torch.as_tensor(frame(), dtype=torch.float32).requires_grad_()
        y = Quantisation((0.1,))(x)
        np.testing.assert_array_equal(y.detach().numpy(), Quantisation((0.1,))(x.detach().numpy()))
        (3 * y).sum().backward()
        assert (x.grad == 3).all()


class TestDeadTaxels:
    def test_who_reads_what(self):
        x = frame()
        dead, stuck = np.zeros((2, 2, 6, 5))
        dead[0, 1, 2] = stuck[1, 3, 4] = dead[1, 0, 0] = stuck[1, 0, 0] = 1
        y = DeadTaxels(dead, stuck, np.array([1.0, 2.0, 3.0]).reshape(1, 3, 1, 1))(x)
        assert y[0, :, 1, 2].tolist() == [0, 0, 0]
        assert y[1, :, 3, 4].tolist() == [1, 2, 3]
        assert y[1, :, 0, 0].tolist() == [0, 0, 0]  # both: dead wins
        untouched = (dead + stuck == 0)[:, None] & np.ones_like(x, dtype=bool)
        np.testing.assert_array_equal(y[untouched], x[untouched])

    def test_a_stuck_taxel_does_not_move(self):
        stuck = np.ones((1, 6, 5))
        t = DeadTaxels(stuck=stuck, value=frame(7))
        np.testing.assert_array_equal(t(frame(0)), t(frame(1)))

    def test_booleans_do_and_probabilities_do_not(self):
        dead = np.random.default_rng(0).random((2, 6, 5)) < 0.3
        np.testing.assert_array_equal(DeadTaxels(dead)(frame()), DeadTaxels(dead.astype(float))(frame()))
        with pytest.raises(InvalidValueError, match="DeadTaxels: dead must be whole numbers"):
            DeadTaxels(np.full((2, 6, 5), 0.2))


class TestInterference:
    def test_the_field_is_the_same_at_all_taxels(self):
        field = Interference(((1.0, 0, 2.0), (0, 0, -1.0)), ((0, 50.0, 0), (0, 0, 0)))
        y = field(np.zeros((2, 3, 6, 5)), {"gripper_opening": 0.04})
        np.testing.assert_allclose(y[0, :, 3, 2], [0.04, 0.08, 0.08])
        np.testing.assert_allclose(y[1, :, 3, 2], [0, 0, -0.04])
        assert np.ptp(y, axis=(-2, -1)).max() == 0

    def test_it_adds_to_the_force_and_follows_the_covariate(self):
        field = Interference(((1.0, 2.0, 3.0),), ((10.0, 0.0, 0.0),))
        x, opening = frame(0, 5), np.linspace(0, 0.08, 5)
        added = field.run(x, np.arange(5.0), {"gripper_opening": opening}) - x
        np.testing.assert_allclose(added[:, 0, 0, 0, 0], opening + 10 * opening**2, atol=1e-14)
        np.testing.assert_allclose(added[:, 1, 2, 5, 4], 3 * opening, atol=1e-14)
        assert not added[0].any()

    def test_another_covariate_and_two_of_them(self):
        one = Interference(((0.0, 0.0, 1.0),), covariate="wrist")
        chain = Chain([one, Interference(((0.0, 0.0, 1.0),))])
        assert one.covariate_names == ("wrist",)
        assert chain.covariate_names == ("wrist", "gripper_opening")
        y = chain(np.zeros((1, 3, 2, 2)), {"wrist": 1.0, "gripper_opening": 0.25})
        np.testing.assert_allclose(y[0, 2], 1.25)


class TestFirmware:
    def test_what_a_sensor_sends(self):
        read = Firmware()
        np.testing.assert_allclose(read(taxel(0.26, -0.24, 3.04)).ravel(), [0.3, -0.2, 3.0])
        np.testing.assert_allclose(read(taxel(0.14, -0.14, 0.1)), 0)  # a single count is gated to zero
        np.testing.assert_allclose(read(taxel(99, -99, 99)).ravel(), [12.7, -12.8, 25.5])
        np.testing.assert_allclose(read(taxel(0, 0, -7)), 0)  # no tension

    def test_a_component_is_zero_or_at_least_two_counts(self):
        counts = np.round(Firmware()(0.3 * frame(0, 50)) / 0.1)
        assert not np.any(np.abs(counts) == 1)
        assert np.any(counts == 2)
        assert np.any(counts == -2)
        ungated = np.round(Firmware(gate_counts=0)(0.3 * frame(0, 50)) / 0.1)
        assert np.any(ungated == 1)

    def test_its_readings_fit_their_bytes(self):
        counts = np.round(Firmware()(30 * frame(0, 50)) / 0.1)
        assert (counts[..., :2, :, :].min(), counts[..., :2, :, :].max()) == (-128, 127)
        assert (counts[..., 2, :, :].min(), counts[..., 2, :, :].max()) == (0, 255)

    def test_what_it_sends_it_would_send_again(self):
        y = Firmware()(5 * frame(0, 20))
        np.testing.assert_array_equal(Firmware()(y), y)

    def test_it_is_saturation_dead_band_and_quantisation_in_one(self):
        x = 5 * frame(0, 20)
        parts = [Saturation((-12.8, -12.8, 0.0), (12.7, 12.7, 25.5)), Quantisation((0.1,)), DeadBand((0.15,))]
        np.testing.assert_allclose(Firmware()(x), Chain(parts[:1] + parts[1:])(x), atol=1e-12)

    def test_near_the_identity_with_fine_steps(self):
        x = np.abs(frame())
        np.testing.assert_allclose(Firmware(1e-6, 1e8, 1e8, 0)(x), x, atol=1e-6)

    def test_the_gradient_stops_at_the_clip(self):
        torch = pytest.importorskip("torch")
        x = torch.as_tensor(taxel(5, 50, -1)).requires_grad_()
        Firmware()(x).sum().backward()
        assert x.grad.ravel().tolist() == [1, 0, 0]
