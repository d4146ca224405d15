"""Taxels that fail at some time, and pairs of taxels that are swapped."""

import numpy as np
import pytest
from transform_examples import FRAME

from paxisim.augment import Chain, DeadTaxels, FailingTaxels, SwappedTaxels
from paxisim.errors import InvalidValueError


def force(count, seed=0):
    return np.random.default_rng(seed).normal(size=(count, *FRAME))


class TestFailingTaxels:
    def test_the_worked_example(self):
        fails = FailingTaxels(stuck=[[[1.0]]], value=[[[[0.5]]]], since=2.0)
        x = np.reshape([0.0, 3.0, 4.0, 0.0], (4, 1, 1, 1, 1)) * np.ones((1, 3, 1, 1))
        np.testing.assert_allclose(fails.run(x, np.arange(4.0))[:, 0, 2, 0, 0], [0, 3, 0.5, 0.5])

    def test_from_the_beginning_it_reads_as_dead_taxels_do(self):
        rng = np.random.default_rng(1)
        faults = (rng.random((2, 6, 5)) < 0.3, rng.random((2, 6, 5)) < 0.3, rng.normal(size=FRAME))
        x = force(5)
        np.testing.assert_array_equal(FailingTaxels(*faults).run(x, np.arange(5.0)), DeadTaxels(*faults)(x))

    def test_each_axis_fails_at_its_own_moment_or_never(self):
        since = np.reshape([1.0, np.inf, 3.0], (1, 3, 1, 1))
        x = force(5)
        y = FailingTaxels(dead=np.ones((1, 1, 1)), since=since).run(x, np.arange(5.0))
        for axis, moment in enumerate(since.ravel()):
            gone = np.arange(5.0) >= moment
            assert not y[gone, :, axis].any()
            np.testing.assert_array_equal(y[~gone, :, axis], x[~gone, :, axis])

    def test_the_others_never_fail(self):
        dead = np.zeros((2, 6, 5))
        dead[1, 2, 3] = 1
        x = force(4)
        y = FailingTaxels(dead, since=-1.0).run(x, np.arange(4.0))
        np.testing.assert_array_equal(np.argwhere((y != x).any(axis=(0, 2))), [[1, 2, 3]])

    def test_it_keeps_time_over_a_day_in_float32(self):
        fails = FailingTaxels(dead=np.ones((1, 1, 1)), since=86_400.5)
        x = force(1)[0].astype(np.float32)
        state = fails.initial_state(x)
        y, state = fails.step(x, state, 86_400.0)
        np.testing.assert_array_equal(y, x)
        for _ in range(1000):
            y, state = fails.step(x, state, 0.001)
        assert not y.any()

    def test_a_frame_alone_has_no_time(self):
        with pytest.raises(InvalidValueError, match="FailingTaxels remembers earlier frames"):
            FailingTaxels()(force(1)[0])


class TestSwappedTaxels:
    def test_each_of_a_pair_reads_the_other(self):
        x = force(2)
        y = SwappedTaxels([(1, 0, 2, 5, 4), (0, 1, 1, 1, 2)])(x)
        np.testing.assert_array_equal(y[:, 1, :, 0, 2], x[:, 1, :, 5, 4])
        np.testing.assert_array_equal(y[:, 1, :, 5, 4], x[:, 1, :, 0, 2])
        np.testing.assert_array_equal(y[:, 0, :, 1, 1], x[:, 0, :, 1, 2])
        moved = np.argwhere((y != x).any(axis=(0, 2))).tolist()
        assert moved == [[0, 1, 1], [0, 1, 2], [1, 0, 2], [1, 5, 4]]

    def test_it_undoes_itself_and_returns_from_json(self):
        x, swapped = force(1)[0], SwappedTaxels([(1, 0, 2, 5, 4)])
        np.testing.assert_array_equal(swapped(swapped(x)), x)
        (again,) = Chain.from_json(Chain([swapped]).to_json())
        assert again.pairs == swapped.pairs == ((1, 0, 2, 5, 4),)

    @pytest.mark.parametrize("pairs", [[(0, 1, 1, 2)], [(0, 1, 1, 2, -1)], [(0, 1, 1, 2, 0.5)], 3, [("a",) * 5]])
    def test_what_is_no_pair(self, pairs):
        with pytest.raises(InvalidValueError, match=r"^SwappedTaxels: pairs must be \(pad, row, col, row, col\) each"):
            SwappedTaxels(pairs)

    @pytest.mark.parametrize("pairs", [[(0, 1, 1, 1, 1)], [(1, 1, 1, 2, 1), (1, 0, 0, 1, 1)]])
    def test_a_taxel_is_in_one_pair(self, pairs):
        with pytest.raises(InvalidValueError, match=r"SwappedTaxels: pairs name the taxel \(1, 1\) of pad . twice"):
            SwappedTaxels(pairs)

    @pytest.mark.parametrize("pair", [(2, 0, 0, 1, 1), (0, 6, 0, 1, 1), (0, 0, 0, 1, 5)])
    def test_what_does_not_fit_the_tensor(self, pair):
        with pytest.raises(InvalidValueError, match=r"SwappedTaxels: .* are not both in a tensor of shape"):
            SwappedTaxels([pair])(force(1)[0])
