"""GCS draws each parameter as Table I of the paper states."""

import numpy as np
import pytest
from forces import needs_torch, torch
from scipy import stats

from paxisim import GCS, GaussianBump, InvalidValueError, TaxelLayout, sensor
from paxisim.augment import AxisGain, GelOperator, Poisson, TaxelGain
from paxisim.augment.gcs import PAPER_LAYOUT, Ranges

LAYOUT = TaxelLayout(6, 5, 4.4e-3)
# smallest accepted p-value; the seeds are fixed, and by chance one test in a thousand would fall below it
LEAST_P = 1e-3


@pytest.fixture(params=["numpy", pytest.param("torch", marks=needs_torch)])
def rng(request):
    return np.random.default_rng(0) if request.param == "numpy" else torch.Generator().manual_seed(0)


def drawn(rng, gcs=None, environments=4000, **options):
    """Return the parameters of as many chains by "member.parameter"."""
    chain = (gcs or GCS()).sample(rng, (environments,), layout=LAYOUT, **options)
    return {
        f"{name}.{field}": np.asarray(getattr(member, field), dtype=float)
        for name, member in zip(chain.names, chain, strict=True)
        for field in ("cx", "cy", "gain", "value", "poisson", "own_normal", "taken")
        if hasattr(member, field)
    }


def assert_drawn_from(values, distribution):
    assert stats.kstest(values.reshape(-1), distribution.cdf).pvalue > LEAST_P


def assert_independent(a, b):
    assert stats.pearsonr(a.reshape(-1), b.reshape(-1)).pvalue > LEAST_P


def test_the_ranges_are_those_of_table_i():
    ranges = Ranges()
    assert (ranges.axis_gain, ranges.convolution, ranges.deviation) == ((0.5, 1.5), (0.1, 0.3), (1.0, 3.0))
    assert (ranges.taxel_gain, ranges.dropout, ranges.offset) == ((1.0, 0.25), 0.2, 0.0)


@pytest.mark.parametrize("pads", [1, 4])
def test_a_chain_for_another_number_of_pads_says_so(pads):
    x = np.ones((pads, 3, 6, 5), np.float32)
    words = rf"TaxelGain: .*: it was drawn for 2 pads and the tensor has {pads}; draw it with pads={pads}$"
    with pytest.raises(InvalidValueError, match=words):
        GCS().sample(np.random.default_rng(0))(x)
    assert GCS().sample(np.random.default_rng(0), pads=pads)(x).shape == x.shape
    with pytest.raises(InvalidValueError, match=r"does not fit a tensor of shape \(2, 3, 4, 4\)$"):
        TaxelGain(np.ones((2, 6, 5)))(np.ones((2, 3, 4, 4)))


def test_axis_gains_and_convolution_are_uniform_and_independent(rng):
    values = drawn(rng)
    gains, cx, cy = values["axis_gain.gain"], values["poisson.cx"], values["poisson.cy"]
    assert (gains.shape, cx.shape) == ((4000, 3), (4000,))
    assert_drawn_from(gains, stats.uniform(0.5, 1.0))
    for c in (cx, cy):
        assert_drawn_from(c, stats.uniform(0.1, 0.2))
    for a, b in ((gains[:, 0], gains[:, 1]), (gains[:, 0], gains[:, 2]), (gains[:, 1], gains[:, 2]), (cx, cy)):
        assert_independent(a, b)


def test_taxel_gains_are_normal_with_deviation_a_quarter_and_a_fifth_dropped(rng):
    gains = drawn(rng, environments=1000)["taxel_gain.gain"]
    assert gains.shape == (1000, 2, 6, 5)
    dropped = gains == 0
    assert stats.binomtest(int(dropped.sum()), gains.size, 0.2).pvalue > LEAST_P
    assert_drawn_from(gains[~dropped], stats.norm(1.0, 0.25))
    # taxels are dropped independently, so the number dropped per pad is binomial
    counts = dropped.sum(axis=(-2, -1)).reshape(-1)
    np.testing.assert_allclose(counts.var(), 30 * 0.2 * 0.8, rtol=0.1)
    assert_independent(gains[:, 0], gains[:, 1])


def test_the_other_readings_of_the_paper(rng):
    """A quarter as variance, with what clipping does; a dropped gain of 1; axis gains for each pad."""
    gains = drawn(rng, GCS(taxel_gain_is_variance=True, ranges=Ranges(dropout=0)), 1000)["taxel_gain.gain"]
    assert gains.min() == 0
    assert stats.binomtest(int((gains == 0).sum()), gains.size, stats.norm.cdf(-2)).pvalue > LEAST_P
    assert_drawn_from(gains[gains > 0], stats.truncnorm(-2, np.inf, 1.0, 0.5))
    gains = drawn(rng, GCS(dropout_of="gain"), 1000)["taxel_gain.gain"]
    assert stats.binomtest(int((gains == 1).sum()), gains.size, 0.2).pvalue > LEAST_P
    assert_drawn_from(gains[gains != 1], stats.norm(1.0, 0.25))
    gains = drawn(rng, GCS(axis_gain_per_pad=True), pads=3)["pad_axis_gain.gain"]
    assert gains.shape == (4000, 3, 3)
    assert_drawn_from(gains, stats.uniform(0.5, 1.0))
    assert_independent(gains[:, 0, 2], gains[:, 1, 2])


def test_other_ranges():
    ranges = Ranges((2.0, 3.0), (5.0, 0.0), 0.0, (0.4, 0.4))
    values = drawn(np.random.default_rng(0), GCS(ranges), 10)
    assert 2 <= values["axis_gain.gain"].min() <= values["axis_gain.gain"].max() <= 3
    np.testing.assert_array_equal(values["taxel_gain.gain"], 5)
    np.testing.assert_allclose(values["poisson.cx"], 0.4)


def test_an_offset_is_shared_by_the_taxels_that_were_not_dropped(rng):
    values = drawn(rng, GCS(Ranges(offset=0.5)), 1000)
    offset = values["offset.value"]
    kept = np.broadcast_to(values["taxel_gain.gain"][:, :, None] > 0, offset.shape)
    assert np.all(offset[~kept] == 0)
    shared = np.where(kept, offset, np.nan)
    largest, least = np.nanmax(shared, axis=(-2, -1)), np.nanmin(shared, axis=(-2, -1))
    np.testing.assert_array_equal(largest, least)
    assert_drawn_from(largest, stats.uniform(-0.5, 1.0))
    alone = drawn(rng, GCS(Ranges(offset=0.5), scaling=False), 50)["offset.value"]
    assert np.all(alone != 0), "without scaling no taxel is dropped"


@pytest.mark.parametrize(
    ("gcs", "kinds"),
    [
        (GCS(convolution=False), [AxisGain, TaxelGain]),
        (GCS(scaling=False), [Poisson]),
        (GCS(Ranges(offset=0.5)), [Poisson, AxisGain, TaxelGain, None]),
        (GCS(operator=GelOperator(poisson=(0.4, 0.1))), [None, AxisGain, TaxelGain]),
        (GCS(convolution=False, operator=GelOperator(poisson=(0.4, 0.1))), [AxisGain, TaxelGain]),
    ],
)
def test_switching_a_part_changes_nothing_else(gcs, kinds):
    full, part = (one.sample(np.random.default_rng(1), (2,), layout=LAYOUT) for one in (GCS(), gcs))
    for name, member, kind in zip(part.names, part, kinds, strict=True):
        if kind is not None:
            assert type(member) is kind
            for field in {"cx", "cy", "gain"} & set(vars(member)):
                np.testing.assert_array_equal(getattr(member, field), getattr(full[name], field))


def test_surfaces_are_those_of_gaussian_bumps(rng):
    heights = GCS().sample_surface(rng, (500,), layout=LAYOUT)
    assert heights.shape == (500, 2, 6, 5)
    assert isinstance(heights, np.ndarray if isinstance(rng, np.random.Generator) else torch.Tensor)
    heights = np.asarray(heights)
    # a batch follows the same distribution as bumps that are sampled one at a time
    reference = np.stack([GaussianBump.sample(LAYOUT, np.random.default_rng(i)).heights(LAYOUT) for i in range(1000)])
    for statistic in (np.mean, np.ptp, np.min, lambda h, axis: h.argmax(axis)):
        ours, theirs = (statistic(h.reshape(-1, 30), axis=1) for h in (heights, reference))
        assert stats.ks_2samp(ours, theirs).pvalue > LEAST_P
    assert not np.allclose(heights[:, 0], heights[:, 1]), "each pad has its own draw"


def test_surfaces_that_are_fixed_or_flat():
    fixed = {"h_max": 1.4e-3, "depth_is": "recess", "center": (1.5, 2.5), "deviation": (1.0, 3.0)}
    heights = GCS().sample_surface(np.random.default_rng(0), (3,), layout=LAYOUT, **fixed)
    np.testing.assert_array_equal(heights, np.broadcast_to(GaussianBump(**fixed).heights(LAYOUT), (3, 2, 6, 5)))
    heights = GCS(geometry=False).sample_surface(np.random.default_rng(0), layout=LAYOUT)
    np.testing.assert_allclose(heights, np.full((2, 6, 5), 1e-3))


def test_one_episode_of_one_environment_is_reproducible():
    chain, again = (GCS().sample(np.random.default_rng(3)) for _ in range(2))
    assert chain.names == ("poisson", "axis_gain", "taxel_gain")
    assert chain.to_json() == again.to_json()
    assert chain["axis_gain"].gain.dtype == np.float32


@needs_torch
def test_torch_parameters_live_where_the_generator_does():
    chain = GCS().sample(torch.device("meta"), (7,))
    assert {member.gain.device.type for member in chain[1:]} == {"meta"}
    assert chain(torch.empty(7, 2, 3, 6, 5, device="meta")).shape == (7, 2, 3, 6, 5)
    chain = GCS().sample(torch.Generator().manual_seed(0), (7,))
    assert chain["taxel_gain"].gain.dtype == torch.float32
    for gcs in (GCS(), GCS(geometry=False)):
        heights = gcs.sample_surface(torch.device("meta"), (7,), center=(1.5, 2.5))
        assert (heights.device.type, heights.shape) == ("meta", (7, 2, 6, 5))


@needs_torch
def test_bumps_are_the_same_in_torch():
    fixed = {"center": (1.5, 2.5), "deviation": (1.0, 3.0), "depth_is": "recess"}
    heights = GCS().sample_surface(torch.Generator(), (2,), layout=LAYOUT, **fixed)
    np.testing.assert_allclose(heights[1, 0], GaussianBump(**fixed).heights(LAYOUT), rtol=1e-6)


def test_layouts():
    positions = np.random.default_rng(0).uniform(-5e-3, 5e-3, (8, 3)) * [1, 1, 0]
    layout = TaxelLayout(1, 8, 3e-3, positions)
    chain = GCS(reach=2.9, falloff=0.5).sample(np.random.default_rng(0), layout=layout)
    assert (chain[0].layout, chain[0].reach, chain[0].falloff) == (layout, 2.9, 0.5)
    assert chain["taxel_gain"].gain.shape == (2, 1, 8)
    assert GCS().sample_surface(np.random.default_rng(0), layout=layout).shape == (2, 1, 8)
    paper = sensor("paxini-gen1-l4629").layout.pool(2, 2)
    assert (PAPER_LAYOUT.rows, PAPER_LAYOUT.cols) == (paper.rows, paper.cols)
    np.testing.assert_allclose(PAPER_LAYOUT.pitch, paper.pitch)


def test_an_operator_is_drawn_around_the_product_s_in_place_of_the_convolution(rng):
    product = GelOperator(-0.1, -0.2, poisson=(0.4, 0.1), along=(0.8, 0.7), taken=0.5)
    values = drawn(rng, GCS(Ranges(operator=0.25), operator=product), 4000)
    assert "poisson.cx" not in values
    shares = values["gel_operator.poisson"] / [0.4, 0.1]
    assert_drawn_from(shares, stats.uniform(0.75, 0.5))
    assert_drawn_from(values["gel_operator.own_normal"], stats.uniform(-0.25, 0.1))
    assert abs(np.corrcoef(shares.T)[0, 1]) < 0.06
    assert values["gel_operator.taken"] == 0.5
