"""TaxelLayout: the convention of the force tensor, and conversions to and from it."""

import copy
import dataclasses
import inspect
import json
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim.augment import GCS
from paxisim.errors import InvalidValueError, PaxisimError
from paxisim.layout import TaxelLayout

LAYOUT = TaxelLayout(3, 4, (2e-3, 5e-3))


@pytest.fixture(params=["numpy", "torch"])
def array(request):
    """Return a function that creates an array of the library under test."""
    if request.param == "numpy":
        return lambda values: np.array(values)
    torch = pytest.importorskip("torch")
    return lambda values: torch.tensor(np.array(values))


def same_kind(result, source):
    """Check that a result is of the source's library and type; return it as numpy."""
    assert type(result) is type(source)
    assert result.dtype == source.dtype
    return np.asarray(result)


def reading(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def sphere(count=40, radius=8e-3):
    """Taxels all around a sphere, with normals in all directions, including the poles and the equator."""
    normals = np.random.default_rng(1).normal(size=(count, 3))
    normals[:6] = np.vstack([np.eye(3), -np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return TaxelLayout(1, count, 2e-3, radius * normals, normals)


# the frame: row 0 at the top, column 0 at the left, x right, y down, z into the pad


def test_a_grid_is_centred_with_row_0_at_the_top_and_column_0_at_the_left():
    y = [-2e-3, 0, 2e-3]
    x = [-7.5e-3, -2.5e-3, 2.5e-3, 7.5e-3]
    expected = [[(x[c], y[r], 0) for c in range(4)] for r in range(3)]
    np.testing.assert_allclose(LAYOUT.positions.reshape(3, 4, 3), expected, atol=1e-15)
    np.testing.assert_array_equal(LAYOUT.normals, np.tile([0, 0, -1], (12, 1)))
    np.testing.assert_array_equal(LAYOUT.frames, np.tile(np.eye(3), (12, 1, 1)))
    assert (LAYOUT.taxels, LAYOUT.shape, LAYOUT.is_grid) == (12, (3, 3, 4), True)
    assert LAYOUT.size == pytest.approx((6e-3, 20e-3))


def test_explicit_taxels_are_kept_normalised_and_read_only():
    assert TaxelLayout(2, 2, 1e-3) == TaxelLayout(np.int64(2), 2.0, np.array([1e-3, 1e-3]))
    mine = np.array([[0, 0, 0], [1e-3, 2e-3, 3e-3]])
    layout = TaxelLayout(1, 2, 1e-3, mine, [[0, 0, -5], [3, 0, -4]])
    mine[:] = 7
    np.testing.assert_array_equal(layout.positions[1], [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(layout.normals, [[0, 0, -1], [0.6, 0, -0.8]])
    assert layout.size == pytest.approx((3e-3, 2e-3))
    for points in (layout.positions, layout.normals):
        with pytest.raises(ValueError, match="read-only"):
            points[0] = 1


def test_frames_are_right_handed_with_z_inward_for_every_normal():
    layout = sphere()
    frames = layout.frames
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (40, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1)
    np.testing.assert_allclose(frames[:, :, 2], -layout.normals)


@pytest.mark.parametrize("tilt", [30.0, 84.0, 86.0, 90.0])
def test_x_stays_right_and_y_down_as_a_surface_gets_steeper(tilt):
    angle = np.radians(tilt)
    for axis in (0, 1):
        for sign in (-1, 1):
            normal = np.array([0, 0, -np.cos(angle)])
            normal[axis] = sign * np.sin(angle)
            frame = TaxelLayout(1, 1, 1e-3, [[0, 0, 0]], [normal]).frames[0]
            assert frame[1 - axis, 1 - axis] == pytest.approx(1), "the axis about which it tilts is unchanged"
            assert frame[axis, axis] == pytest.approx(np.cos(angle), abs=1e-12)


# identity and copies


def test_equality_and_hash_see_every_field():
    base = TaxelLayout(2, 2, 1e-3)
    others = [
        TaxelLayout(1, 4, 1e-3),
        TaxelLayout(2, 2, 2e-3),
        TaxelLayout(2, 2, 1e-3, positions=base.positions + [0, 0, 1e-4]),
        TaxelLayout(2, 2, 1e-3, normals=np.tile([0, 0.1, -1], (4, 1))),
        TaxelLayout(2, 2, 1e-3, vendor_order=(3, 2, 1, 0)),
    ]
    assert all(base != other for other in others)
    assert len({base, TaxelLayout(2, 2, 1e-3), *others}) == 6
    assert base != "a layout"
    negative = TaxelLayout(1, 1, 1e-3, [[-0.0, -0.0, -0.0]], [[-0.0, -0.0, -1.0]])
    assert len({TaxelLayout(1, 1, 1e-3), negative}) == 1, "zeros of either sign are equal"


@pytest.mark.parametrize("layout", [LAYOUT, sphere(), TaxelLayout(1, 3, 0.1, vendor_order=(2, 0, 1))])
def test_copies_are_equal_bit_for_bit(layout):
    document = json.loads(json.dumps(layout.to_dict()))
    assert ("positions" in document) == (not layout.is_grid)
    copies = [pickle.loads(pickle.dumps(layout)), copy.deepcopy(layout), dataclasses.replace(layout)]
    for other in [*copies, TaxelLayout.from_dict(document)]:
        assert (other, hash(other), other.is_grid) == (layout, hash(layout), layout.is_grid)


def test_a_grid_is_one_by_its_positions_and_normals():
    assert dataclasses.replace(LAYOUT, vendor_order=tuple(range(12))).is_grid
    assert not dataclasses.replace(LAYOUT, positions=LAYOUT.positions - [0, 0, 1e-3]).is_grid
    assert not dataclasses.replace(LAYOUT, normals=np.tile([0, 1e-3, -1], (12, 1))).is_grid


# pooling


def test_pooling_keeps_the_extent_and_drops_the_vendors_order():
    fine = TaxelLayout(12, 10, (2.175e-3, 2.26e-3), vendor_order=tuple(reversed(range(120))))
    assert fine.pool(2, 2) == TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
    assert fine.pool(1, 5).shape == (3, 12, 2)
    assert fine.pool(12, 10).taxels == 1


def test_subdivided_taxels_pool_to_the_layout_they_came_from():
    fine = TaxelLayout(3, 4, (4e-3, 6e-3)).subdivide(2, 3)
    assert fine == TaxelLayout(6, 12, (2e-3, 2e-3))
    assert fine.pool(2, 3) == TaxelLayout(3, 4, (4e-3, 6e-3))
    curved = TaxelLayout(1, 2, 1e-3, positions=[[0, 0, 0], [1e-3, 0, 1e-4]])
    for layout, by, words in ((fine, (0, 1), "0x1"), (curved, (2, 2), "flat grid")):
        with pytest.raises(InvalidValueError, match=words):
            layout.subdivide(*by)


def test_a_pooled_taxel_sits_at_the_mean_of_its_members():
    fine = TaxelLayout(4, 6, (1e-3, 2e-3))
    means = fine.positions.reshape(2, 2, 2, 3, 3).mean(axis=(1, 3)).reshape(-1, 3)
    np.testing.assert_allclose(fine.pool(2, 3).positions, means, atol=1e-15)
    curved = TaxelLayout(4, 6, (1e-3, 2e-3), fine.positions + [0, 0, 1e-3], np.tile([0.6, 0, -0.8], (24, 1)))
    pooled = curved.pool(2, 3)
    np.testing.assert_allclose(pooled.positions, means + [0, 0, 1e-3], atol=1e-15)
    np.testing.assert_allclose(pooled.normals, np.tile([0.6, 0, -0.8], (4, 1)))
    assert pooled.pitch == pytest.approx((2e-3, 6e-3))


def test_pooled_forces_are_the_sums_of_their_blocks(array):
    force = reading(5, 2, 3, 4, 6)
    result = same_kind(TaxelLayout(4, 6, 1e-3).pool_force(array(force), 2, 3), array(force))
    assert result.shape == (5, 2, 3, 2, 2)
    for row, col in np.ndindex(2, 2):
        block = force[..., 2 * row : 2 * row + 2, 3 * col : 3 * col + 3]
        np.testing.assert_allclose(result[..., row, col], block.sum(axis=(-1, -2)), rtol=1e-5, atol=1e-6)


# other shapes of the same reading


def test_an_image_is_a_view_with_the_axes_last(array):
    force = reading(2, 3, 3, 4)
    image = same_kind(LAYOUT.to_image(array(force)), array(force))
    np.testing.assert_array_equal(image, np.moveaxis(force, 1, -1))
    np.testing.assert_array_equal(same_kind(LAYOUT.from_image(array(image)), array(image)), force)
    LAYOUT.to_image(force)[0, 1, 2, 0] = 5
    LAYOUT.from_image(LAYOUT.to_image(force))[0, 2, 0, 0] = 6
    assert (force[0, 0, 1, 2], force[0, 2, 0, 0]) == (5, 6)


def test_policy_channels_are_oldest_first_then_pads_then_axes(array):
    history = reading(8, 5, 2, 3, 3, 4)  # batch, history, pads, axes, rows, cols
    channels = same_kind(LAYOUT.to_policy(array(history)), array(history))
    assert channels.shape == (8, 30, 3, 4)
    for time, pad, axis in np.ndindex(5, 2, 3):
        np.testing.assert_array_equal(channels[:, (time * 2 + pad) * 3 + axis], history[:, time, pad, axis])
    np.testing.assert_array_equal(same_kind(LAYOUT.from_policy(array(channels), 2), array(channels)), history)
    assert LAYOUT.to_policy(reading(1, 2, 3, 3, 4)).shape == (6, 3, 4)
    assert LAYOUT.to_policy(reading(2, 7, 4, 1, 3, 3, 4)).shape == (2, 7, 12, 3, 4)
    assert LAYOUT.from_policy(reading(2, 7, 12, 3, 4), pads=1).shape == (2, 7, 4, 1, 3, 3, 4)


@pytest.mark.parametrize("order", [None, (4, 2, 0, 5, 3, 1)])  # no involution: its inverse differs from it
def test_flat_values_are_the_xyz_of_each_taxel_in_the_vendors_order(array, order):
    layout = TaxelLayout(2, 3, 1e-3, vendor_order=order)
    force = reading(2, 3, 2, 3)
    flat = same_kind(layout.to_flat(array(force)), array(force))
    assert flat.shape == (2, 18)
    for place, taxel in enumerate(order or range(6)):
        np.testing.assert_array_equal(flat[:, 3 * place : 3 * place + 3], force[:, :, taxel // 3, taxel % 3])
    np.testing.assert_array_equal(same_kind(layout.from_flat(array(flat)), array(flat)), force)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(1, 3), st.integers(1, 3), st.randoms(use_true_random=False))
def test_of_any_layout_every_way_out_leads_back_and_pooling_conserves_the_force(rows, cols, by_rows, by_cols, random):
    shape = (rows * by_rows, cols * by_cols)
    order = random.sample(range(shape[0] * shape[1]), shape[0] * shape[1])
    layout = TaxelLayout(*shape, (1e-3, 2e-3), vendor_order=order)
    np.testing.assert_allclose(layout.positions.mean(axis=0), 0, atol=1e-12)
    force = reading(2, 3, *layout.shape).astype(float)
    np.testing.assert_array_equal(layout.from_image(layout.to_image(force)), force)
    np.testing.assert_array_equal(layout.from_policy(layout.to_policy(force), 3), force)
    np.testing.assert_array_equal(layout.from_flat(layout.to_flat(force)), force)
    pooled = layout.pool_force(force, by_rows, by_cols)
    layout.pool(by_rows, by_cols).check(pooled)
    np.testing.assert_allclose(pooled.sum(axis=(-1, -2)), force.sum(axis=(-1, -2)), atol=1e-9)


# invalid input: one line that says what was expected and what was given


def points(bad):
    """Return four points of which one coordinate is `bad`."""
    return [[1, 1, 1], [1, 1, 1], [1, bad, 1], [1, 1, 1]]


NAN, INF = float("nan"), float("inf")
REFUSED = [
    *[({name: value}, f"{name} must be a whole number of at least 1, got")
      for name in ("rows", "cols") for value in (True, 0, -1, 2.5, NAN, INF, "three", None, [1, 2])],
    *[({"pitch": value}, "pitch must be two positive finite lengths in m, got")
      for value in (0, -1e-3, (1e-3, 0), (1e-3, NAN), INF, (1e-3, 1e-3, 1e-3), "wide", None, ())],
    ({"pitch": 2.0}, "pitch must be in m, got 2.0.*millimetres meant"),
    ({"rows": 100_000, "cols": 100_000}, "at most 1000000 taxels, got 100000x100000"),
    ({"rows": 1, "cols": 1_000_001}, "at most 1000000 taxels"),
    *[({name: value}, f"{name} must {words}")
      for name in ("positions", "normals")
      for value, words in [
          (np.ones((4, 2)), r"have shape \(4, 3\) for 2x2 taxels, got \(4, 2\)"),
          (np.ones((2, 2, 3)), r"have shape \(4, 3\).*got \(2, 2, 3\)"),
          (points(NAN), "be finite"),
          (points(INF), "be finite"),
          ([[0, 0, 1], [0, 1]], "be 4 points of three numbers"),
      ]],
    ({"normals": [[0, 0, -1], [0, 1, 0], [0, 0, 0], [0, 0, -1]]}, "zero length, but that of taxel 2 has"),
    *[({"vendor_order": order}, r"vendor_order must be a permutation of 0\.\.3")
      for order in ((0, 1, 2), (0, 1, 2, 2), (1, 2, 3, 4), (0, 1, 2, -1), range(5))],
]  # fmt: skip


def test_fields_that_do_not_fit_are_named():
    for fields, words in REFUSED:
        with pytest.raises(InvalidValueError, match=words):
            TaxelLayout(**{"rows": 2, "cols": 2, "pitch": 1e-3, **fields})
    for document in ({}, {"rows": 1, "cols": 2}, {"rows": 1, "cols": 2, "pitch": 1, "depth": 3}):
        with pytest.raises(InvalidValueError, match="expected the fields of a TaxelLayout, got"):
            TaxelLayout.from_dict(document)
    with pytest.raises(InvalidValueError, match="rows must be"):
        TaxelLayout.from_dict({"rows": 0, "cols": 2, "pitch": 1})
    with pytest.raises(InvalidValueError, match="expected an object"):
        TaxelLayout.from_dict([1])


BLOCKS = [(2, 2), (3, 3), (0, 1), (1, -1), (4, 4)]


def test_shapes_that_do_not_fit_are_named():
    LAYOUT.check(reading(3, 3, 4))
    LAYOUT.check(reading(9, 2, 3, 3, 4), pads=2)
    for call, words in [
        (lambda: LAYOUT.check(reading(3, 4, 3)), "..., 3, 3, 4), got (3, 4, 3)"),
        (lambda: LAYOUT.check(reading(1, 3, 3, 4), pads=2), "..., 2, 3, 3, 4), got (1, 3, 3, 4)"),
        (lambda: LAYOUT.check(reading(3, 3, 4), pads=1), "got (3, 3, 4)"),
        (lambda: LAYOUT.to_image(reading(1, 3, 4, 3)), "..., 3, 3, 4), got (1, 3, 4, 3)"),
        (lambda: LAYOUT.to_policy(reading(1, 1, 3, 4, 3)), "..., 3, 3, 4), got (1, 1, 3, 4, 3)"),
        (lambda: LAYOUT.to_policy(reading(2, 3, 3, 4)), "..., history, pads, 3, rows, cols), got (2, 3, 3, 4)"),
        (lambda: LAYOUT.to_flat(reading(1, 3, 4, 3)), "..., 3, 3, 4), got (1, 3, 4, 3)"),
        (lambda: LAYOUT.from_image(reading(4, 3, 3)), "..., 3, 4, 3), got (4, 3, 3)"),
        (lambda: LAYOUT.from_policy(reading(7, 3, 4), 2), "..., k * 6, 3, 4), got (7, 3, 4)"),
        (lambda: LAYOUT.from_policy(reading(6, 4, 3), 2), "..., k * 6, 3, 4), got (6, 4, 3)"),
        (lambda: LAYOUT.from_policy(reading(3, 4), 2), "..., k * 6, 3, 4), got (3, 4)"),
        (lambda: LAYOUT.from_policy(reading(6, 3, 4), pads=0), "at least one pad, got 0"),
        (lambda: LAYOUT.from_flat(reading(2, 35)), "..., 36), got (2, 35)"),
        (lambda: LAYOUT.from_flat(np.float32(1)), "..., 36), got ()"),
        (lambda: LAYOUT.pool_force(reading(3, 3, 4), 2, 2), "cannot pool 3x4 taxels in blocks of 2x2"),
        *[(lambda by=by: LAYOUT.pool(*by), "cannot pool 3x4 taxels in blocks of") for by in BLOCKS],
    ]:
        with pytest.raises(PaxisimError) as error:
            call()
        assert words in str(error.value)


def test_a_layout_says_in_one_line_what_it_is():
    grid = TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
    assert repr(grid) == "TaxelLayout(6x5, pitch 4.35 x 4.52 mm)"
    places = TaxelLayout(1, 2, 4e-3, [[0, 0, 0], [0.01, 0, 0]], vendor_order=(1, 0))
    assert repr(places) == "TaxelLayout(1x2, positions of its own in 4 x 14 mm, vendor's order)"
    assert "TaxelLayout(6x5, pitch 4.35 x 4.52 mm)" in str(inspect.signature(GCS.sample))
