"""GCS draws each parameter as Table I of the paper states."""

import numpy as np
import pytest
from optional import needs_torch, torch
from scipy import stats

from paxisim.augment.gains import AxisGain, PadAxisGain, TaxelGain
from paxisim.augment.gcs import GCS, PAPER_LAYOUT, Ranges
from paxisim.augment.poisson import Poisson
from paxisim.bump import GaussianBump
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.sensors import sensor

LAYOUT = TaxelLayout(6, 5, 4.4e-3)
# smallest accepted p-value; the seeds are fixed, and by chance one test in a thousand would fall below it
LEAST_P = 1e-3


@pytest.fixture(params=["numpy", pytest.param("torch", marks=needs_torch)])
def rng(request):
    return np.random.default_rng(0) if request.param == "numpy" else torch.Generator().manual_seed(0)


def drawn(rng, gcs=None, environments=4000, **options):
    chain = (gcs or GCS()).sample(rng, (environments,), layout=LAYOUT, **options)
    return {
        f"{name}.{field}": np.asarray(getattr(member, field), dtype=float)
        for name, member in zip(chain.names, chain, strict=True)
        for field in ("cx", "cy", "gain", "value")
        if hasattr(member, field)
    }


def assert_drawn_from(values, distribution):
    assert stats.kstest(values.reshape(-1), distribution.cdf).pvalue > LEAST_P


def test_axis_gains_are_uniform_and_independent(rng):
    gains = drawn(rng)["axis_gain.gain"]
    assert gains.shape == (4000, 3)
    assert_drawn_from(gains, stats.uniform(0.5, 1.0))
    for i, j in [(0, 1), (0, 2), (1, 2)]:
        assert stats.pearsonr(gains[:, i], gains[:, j]).pvalue > LEAST_P


def test_convolution_is_uniform_and_its_axes_are_independent(rng):
    values = drawn(rng)
    assert values["poisson.cx"].shape == (4000,)
    assert_drawn_from(values["poisson.cx"], stats.uniform(0.1, 0.2))
    assert_drawn_from(values["poisson.cy"], stats.uniform(0.1, 0.2))
    assert stats.pearsonr(values["poisson.cx"], values["poisson.cy"]).pvalue > LEAST_P


def test_taxel_gains_are_normal_with_deviation_a_quarter_and_a_fifth_dropped(rng):
    gains = drawn(rng, environments=1000)["taxel_gain.gain"]
    assert gains.shape == (1000, 2, 6, 5)
    dropped = gains == 0
    assert stats.binomtest(int(dropped.sum()), gains.size, 0.2).pvalue > LEAST_P
    assert_drawn_from(gains[~dropped], stats.norm(1.0, 0.25))
    # taxels are dropped independently, so the number dropped per pad is binomial
    counts = dropped.sum(axis=(-2, -1)).reshape(-1)
    np.testing.assert_allclose(counts.var(), 30 * 0.2 * 0.8, rtol=0.1)
    assert abs(np.corrcoef(gains[:, 0].reshape(-1), gains[:, 1].reshape(-1))[0, 1]) < 4 / np.sqrt(30_000)


def test_a_quarter_as_variance_and_what_clipping_does(rng):
    gains = drawn(rng, GCS(taxel_gain_is_variance=True, ranges=Ranges(dropout=0)), 1000)["taxel_gain.gain"]
    assert gains.min() == 0
    assert stats.binomtest(int((gains == 0).sum()), gains.size, stats.norm.cdf(-2)).pvalue > LEAST_P
    assert_drawn_from(gains[gains > 0], stats.truncnorm(-2, np.inf, 1.0, 0.5))
    np.testing.assert_allclose(gains.mean(), 1.0042, atol=4 * 0.5 / np.sqrt(gains.size))


def test_a_dropped_gain_keeps_one(rng):
    gains = drawn(rng, GCS(dropout_of="gain"), 1000)["taxel_gain.gain"]
    ones = gains == 1
    assert stats.binomtest(int(ones.sum()), gains.size, 0.2).pvalue > LEAST_P
    assert_drawn_from(gains[~ones], stats.norm(1.0, 0.25))


def test_axis_gains_for_each_pad(rng):
    gains = drawn(rng, GCS(axis_gain_per_pad=True), pads=3)["pad_axis_gain.gain"]
    assert gains.shape == (4000, 3, 3)
    assert_drawn_from(gains, stats.uniform(0.5, 1.0))
    assert stats.pearsonr(gains[:, 0, 2], gains[:, 1, 2]).pvalue > LEAST_P


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


def test_an_offset_changes_nothing_else_and_holds_without_scaling():
    plain = drawn(np.random.default_rng(0), GCS(), 1)
    more = drawn(np.random.default_rng(0), GCS(Ranges(offset=0.5)), 1)
    assert set(more) - set(plain) == {"offset.value"}
    for name, value in plain.items():
        np.testing.assert_array_equal(more[name], value)
    alone = drawn(np.random.default_rng(0), GCS(Ranges(offset=0.5), scaling=False), 50)["offset.value"]
    assert np.all(alone != 0), "without scaling no taxel is dropped"


def test_surfaces_are_those_of_gaussian_bumps(rng):
    heights = GCS().sample_surface(rng, (500,), layout=LAYOUT)
    assert heights.shape == (500, 2, 6, 5)
    assert isinstance(heights, np.ndarray)
    inner = heights[..., 1:-1, 1:-1]
    bump = GaussianBump((0, 0))
    assert heights.min() >= bump.h_min - bump.boundary - 1e-12
    assert heights.max() <= bump.h_max + 1e-12
    assert inner.min() >= bump.h_min
    # a batch follows the same distribution as bumps that are sampled one at a time
    reference = np.stack([GaussianBump.sample(LAYOUT, np.random.default_rng(i)).heights(LAYOUT) for i in range(1000)])
    for statistic in (np.mean, np.ptp, np.min):
        ours = statistic(heights.reshape(-1, 30), axis=1)
        theirs = statistic(reference.reshape(-1, 30), axis=1)
        assert stats.ks_2samp(ours, theirs).pvalue > LEAST_P
    assert not np.allclose(heights[:, 0], heights[:, 1]), "each pad has its own draw"


def test_a_batch_of_surfaces_is_that_of_single_bumps():
    fixed = {"h_max": 1.4e-3, "depth_is": "recess", "center": (1.5, 2.5), "deviation": (1.0, 3.0)}
    heights = GCS().sample_surface(np.random.default_rng(0), (3,), layout=LAYOUT, **fixed)
    np.testing.assert_array_equal(heights, np.broadcast_to(GaussianBump(**fixed).heights(LAYOUT), (3, 2, 6, 5)))


def test_the_bumps_centre_and_deviations_follow_table_one(monkeypatch):
    seen = {}

    def spy(bump, layout, center, deviation):
        seen.update(center=center, deviation=deviation)

    monkeypatch.setattr("paxisim.augment.gcs.bump_heights", spy)
    GCS().sample_surface(np.random.default_rng(0), (2000,), layout=LAYOUT)
    assert_drawn_from(seen["center"][..., 0], stats.uniform(0, 5))
    assert_drawn_from(seen["center"][..., 1], stats.uniform(0, 6))
    assert_drawn_from(seen["deviation"], stats.uniform(1, 2))


@pytest.mark.parametrize("off", ["convolution", "scaling"])
def test_the_ablation_changes_nothing_else(off, rng):
    full = GCS().sample(np.random.default_rng(1), layout=LAYOUT)
    part = GCS(**{off: False}).sample(np.random.default_rng(1), layout=LAYOUT)
    kinds = [type(member) for member in part]
    assert kinds == ([AxisGain, TaxelGain] if off == "convolution" else [Poisson])
    for name, member in zip(part.names, part, strict=True):
        for field in ("cx", "cy", "gain", "value"):
            if hasattr(member, field):
                np.testing.assert_array_equal(getattr(member, field), getattr(full[name], field))


def test_without_geometry_pads_are_flat():
    heights = GCS(geometry=False).sample_surface(np.random.default_rng(0), layout=LAYOUT)
    np.testing.assert_allclose(heights, np.full((2, 6, 5), 1e-3))


def test_one_episode_of_one_environment_is_reproducible_and_saves():
    chain = GCS().sample(np.random.default_rng(3))
    again = GCS().sample(np.random.default_rng(3))
    assert chain.names == ("poisson", "axis_gain", "taxel_gain")
    assert chain.to_json() == again.to_json()
    x = np.random.default_rng(4).normal(size=(2, 3, 6, 5)).astype(np.float32)
    y = chain(x)
    assert y.dtype == np.float32
    np.testing.assert_array_equal(type(chain).from_json(chain.to_json())(x), y)
    assert GCS(axis_gain_per_pad=True).sample(np.random.default_rng(3))["pad_axis_gain"].gain.shape == (2, 3)
    assert isinstance(GCS(axis_gain_per_pad=True).sample(np.random.default_rng(3))[1], PadAxisGain)


@needs_torch
def test_torch_parameters_live_where_the_generator_does():
    chain = GCS().sample(torch.device("meta"), (7,))
    assert {member.gain.device.type for member in chain[1:]} == {"meta"}
    assert chain(torch.empty(7, 2, 3, 6, 5, device="meta")).shape == (7, 2, 3, 6, 5)
    chain = GCS().sample(torch.Generator().manual_seed(0), (7,))
    assert chain["taxel_gain"].gain.dtype == torch.float32


def test_layouts_off_the_grid_reach_the_convolution():
    positions = np.random.default_rng(0).uniform(-5e-3, 5e-3, (8, 3)) * [1, 1, 0]
    layout = TaxelLayout(1, 8, 3e-3, positions)
    chain = GCS().sample(np.random.default_rng(0), layout=layout)
    assert chain["poisson"].layout == layout
    assert chain["taxel_gain"].gain.shape == (2, 1, 8)
    assert GCS().sample_surface(np.random.default_rng(0), layout=layout).shape == (2, 1, 8)


def test_the_default_layout_is_the_papers():
    paper = sensor("paxini-gen1-l4629").layout.pool(2, 2)
    assert (PAPER_LAYOUT.rows, PAPER_LAYOUT.cols) == (paper.rows, paper.cols)
    np.testing.assert_allclose(PAPER_LAYOUT.pitch, paper.pitch)


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"axis_gain": (1.5, 0.5)}, "GCS: axis_gain"),
        ({"axis_gain": (-1.0, 0.5)}, "GCS: axis_gain"),
        ({"convolution": (0.1, np.inf)}, "GCS: convolution"),
        ({"deviation": (0.0, 1.0)}, "GCS: deviation must be finite bounds, above 0"),
        ({"taxel_gain": (1.0, -0.25)}, "GCS: taxel_gain"),
        ({"dropout": 1.2}, "GCS: dropout must be a probability"),
        ({"offset": -0.1}, "GCS: offset must be finite and at least 0 N"),
    ],
)
def test_bad_ranges(wrong, match):
    with pytest.raises(InvalidValueError, match=match):
        Ranges(**wrong)


def test_bad_choices():
    with pytest.raises(InvalidValueError, match="dropout_of"):
        GCS(dropout_of="pad")  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="reach"):
        GCS(reach=0)
    with pytest.raises(InvalidValueError, match=r"numpy\.random\.Generator or a torch\.Generator, got 3"):
        GCS().sample(3)
