"""TaxelLayout: the convention of the force tensor, and conversions to and from it."""

import copy
import dataclasses
import json
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim.errors import InvalidValueError, PaxisimError
from paxisim.layout import TaxelLayout

LAYOUT = TaxelLayout(3, 4, (2e-3, 5e-3))

counts = st.integers(1, 7)
pitches = st.floats(1e-4, 5e-2)
layouts = st.builds(lambda rows, cols, py, px: TaxelLayout(rows, cols, (py, px)), counts, counts, pitches, pitches)
repeatable = settings(derandomize=True, deadline=None, max_examples=40)


@pytest.fixture(params=["numpy", "torch"])
def array(request):
    """Return a function that creates an array of the library under test."""
    if request.param == "numpy":
        return lambda values: np.array(values)
    torch = pytest.importorskip("torch")
    return lambda values: torch.tensor(np.array(values))


def same_kind(result, source):
    assert type(result) is type(source)
    assert result.dtype == source.dtype
    return np.asarray(result)


def reading(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


# the frame: row 0 at the top, column 0 at the left, x right, y down, z into the pad


def test_a_grid_is_centred_with_row_0_at_the_top_and_column_0_at_the_left():
    y = [-2e-3, 0, 2e-3]
    x = [-7.5e-3, -2.5e-3, 2.5e-3, 7.5e-3]
    expected = [[(x[c], y[r], 0) for c in range(4)] for r in range(3)]
    np.testing.assert_allclose(LAYOUT.positions.reshape(3, 4, 3), expected, atol=1e-15)
    np.testing.assert_array_equal(LAYOUT.normals, np.tile([0, 0, -1], (12, 1)))
    np.testing.assert_array_equal(LAYOUT.frames, np.tile(np.eye(3), (12, 1, 1)))


def test_counts_and_extent():
    assert LAYOUT.taxels == 12
    assert LAYOUT.shape == (3, 3, 4)
    assert LAYOUT.size == pytest.approx((6e-3, 20e-3))
    assert LAYOUT.is_grid


def test_one_pitch_serves_both_directions():
    assert TaxelLayout(2, 2, 1e-3) == TaxelLayout(2, 2, (1e-3, 1e-3))
    assert TaxelLayout(np.int64(2), 2.0, np.array([1e-3, 2e-3])) == TaxelLayout(2, 2, (1e-3, 2e-3))


@repeatable
@given(layouts)
def test_every_grid_is_centred_and_spaced_by_its_pitch(layout):
    grid = layout.positions.reshape(layout.rows, layout.cols, 3)
    np.testing.assert_allclose(grid.mean(axis=(0, 1)), 0, atol=1e-12)
    np.testing.assert_allclose(np.diff(grid[..., 1], axis=0), layout.pitch[0], rtol=1e-9)
    np.testing.assert_allclose(np.diff(grid[..., 0], axis=1), layout.pitch[1], rtol=1e-9)
    assert layout.size == pytest.approx((layout.rows * layout.pitch[0], layout.cols * layout.pitch[1]))


def test_positions_and_normals_cannot_be_changed_in_place():
    with pytest.raises(ValueError, match="read-only"):
        LAYOUT.positions[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        LAYOUT.normals[0] = 1
    mine = np.zeros((2, 3))
    layout = TaxelLayout(1, 2, 1e-3, mine)
    mine[:] = 7
    assert np.all(layout.positions == 0)


# explicit positions and normals


def sphere(count=40, radius=8e-3, seed=1):
    """Taxels all around a sphere, with normals in all directions, including the poles and the equator."""
    normals = np.random.default_rng(seed).normal(size=(count, 3))
    normals[:6] = np.vstack([np.eye(3), -np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return TaxelLayout(1, count, 2e-3, radius * normals, normals)


def test_explicit_taxels_are_kept_and_their_normals_normalised():
    layout = TaxelLayout(1, 2, 1e-3, [[0, 0, 0], [1e-3, 2e-3, 3e-3]], [[0, 0, -5], [3, 0, -4]])
    np.testing.assert_array_equal(layout.positions[1], [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(layout.normals, [[0, 0, -1], [0.6, 0, -0.8]])
    assert not layout.is_grid
    assert layout.size == pytest.approx((3e-3, 2e-3))


def test_frames_are_right_handed_with_z_inward_for_every_normal():
    layout = sphere()
    frames = layout.frames
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (40, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1)
    np.testing.assert_allclose(frames[:, :, 2], -layout.normals)


def test_a_tilted_taxel_keeps_the_pads_x_and_a_steep_one_its_y():
    tilted, steep = TaxelLayout(1, 2, 1e-3, np.zeros((2, 3)), [[-0.6, 0, -0.8], [-1, 0, -1e-3]]).frames
    np.testing.assert_allclose(tilted, [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]], atol=1e-12)
    assert steep[:, 1] == pytest.approx([0, 1, 0])


@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0, 84.0, 86.0, 90.0])
def test_x_stays_right_and_y_down_as_a_surface_gets_steeper(tilt):
    angle = np.radians(tilt)
    for axis in (0, 1):
        for sign in (-1, 1):
            normal = np.array([0, 0, -np.cos(angle)])
            normal[axis] = sign * np.sin(angle)
            frame = TaxelLayout(1, 1, 1e-3, [[0, 0, 0]], [normal]).frames[0]
            assert frame[1 - axis, 1 - axis] == pytest.approx(1), "the axis about which it tilts is unchanged"
            assert frame[axis, axis] == pytest.approx(np.cos(angle), abs=1e-12)


# identity


def test_equality_and_hash_see_every_field():
    base = TaxelLayout(2, 2, 1e-3)
    moved = base.positions + [0, 0, 1e-4]
    others = [
        TaxelLayout(1, 4, 1e-3),
        TaxelLayout(2, 2, 2e-3),
        TaxelLayout(2, 2, 1e-3, positions=moved),
        TaxelLayout(2, 2, 1e-3, normals=np.tile([0, 0.1, -1], (4, 1))),
        TaxelLayout(2, 2, 1e-3, vendor_order=(3, 2, 1, 0)),
    ]
    assert base == TaxelLayout(2, 2, (1e-3, 1e-3))
    assert all(base != other for other in others)
    assert len({base, TaxelLayout(2, 2, 1e-3), *others}) == 6
    assert base != "a layout"


def test_equal_layouts_have_equal_hashes_even_with_negative_zeros():
    zeros = TaxelLayout(1, 1, 1e-3)
    negative = TaxelLayout(1, 1, 1e-3, [[-0.0, -0.0, -0.0]], [[-0.0, -0.0, -1.0]])
    assert zeros == negative
    assert hash(zeros) == hash(negative)


@pytest.mark.parametrize("layout", [LAYOUT, sphere(), TaxelLayout(1, 3, 1e-3, vendor_order=(2, 0, 1))])
def test_copies_and_pickles_are_equal(layout):
    for other in (pickle.loads(pickle.dumps(layout)), copy.deepcopy(layout), dataclasses.replace(layout)):
        assert other == layout
        assert hash(other) == hash(layout)
        assert other.is_grid == layout.is_grid


def test_replacing_the_order_leaves_a_grid_a_grid():
    assert dataclasses.replace(LAYOUT, vendor_order=tuple(range(12))).is_grid
    lifted = dataclasses.replace(LAYOUT, positions=LAYOUT.positions - [0, 0, 1e-3])
    tilted = dataclasses.replace(LAYOUT, normals=np.tile([0, 1e-3, -1], (12, 1)))
    assert not lifted.is_grid
    assert not tilted.is_grid
    assert dataclasses.replace(lifted, positions=None) == LAYOUT


@pytest.mark.parametrize("layout", [LAYOUT, sphere(), TaxelLayout(1, 3, 0.1, vendor_order=(2, 0, 1))])
def test_through_json_bit_for_bit(layout):
    document = json.loads(json.dumps(layout.to_dict()))
    assert TaxelLayout.from_dict(document) == layout
    assert ("positions" in document) == (not layout.is_grid)


@pytest.mark.parametrize("document", [{}, {"rows": 1, "cols": 2}, {"rows": 1, "cols": 2, "pitch": 1, "depth": 3}])
def test_a_document_with_other_fields(document):
    with pytest.raises(InvalidValueError, match="expected the fields of a TaxelLayout, got"):
        TaxelLayout.from_dict(document)
    with pytest.raises(InvalidValueError, match="rows must be"):
        TaxelLayout.from_dict({"rows": 0, "cols": 2, "pitch": 1})


# pooling


def test_pooling_halves_the_grid_and_keeps_its_extent():
    fine = TaxelLayout(12, 10, (2.175e-3, 2.26e-3), vendor_order=tuple(reversed(range(120))))
    pooled = fine.pool(2, 2)
    assert pooled.shape == (3, 6, 5)
    assert pooled.pitch == pytest.approx((4.35e-3, 4.52e-3))
    assert pooled.size == pytest.approx(fine.size)
    assert pooled.is_grid
    assert pooled.vendor_order is None
    assert fine.pool(1, 5).shape == (3, 12, 2)
    assert fine.pool(12, 10).taxels == 1


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
    for row in range(2):
        for col in range(2):
            block = force[..., 2 * row : 2 * row + 2, 3 * col : 3 * col + 3]
            np.testing.assert_allclose(result[..., row, col], block.sum(axis=(-1, -2)), rtol=1e-5, atol=1e-6)


@repeatable
@given(counts, counts, st.integers(1, 4), st.integers(1, 4), st.integers(0, 9))
def test_pooling_conserves_the_total_force_and_agrees_with_the_layout(rows, cols, by_rows, by_cols, seed):
    layout = TaxelLayout(rows * by_rows, cols * by_cols, (1e-3, 2e-3))
    force = reading(2, *layout.shape, seed=seed).astype(float)
    pooled = layout.pool_force(force, by_rows, by_cols)
    layout.pool(by_rows, by_cols).check(pooled)
    np.testing.assert_allclose(pooled.sum(axis=(-1, -2)), force.sum(axis=(-1, -2)), atol=1e-9)


@pytest.mark.parametrize("block", [(2, 2), (3, 3), (0, 1), (1, -1), (4, 4)])
def test_blocks_that_do_not_divide_the_grid(block):
    with pytest.raises(InvalidValueError, match="cannot pool 3x4 taxels in blocks of"):
        LAYOUT.pool(*block)
    with pytest.raises(InvalidValueError, match="cannot pool 3x4 taxels in blocks of"):
        LAYOUT.pool_force(reading(3, 3, 4), *block)


# other shapes of the same reading


def test_image(array):
    force = reading(2, 3, 3, 4)
    image = same_kind(LAYOUT.to_image(array(force)), array(force))
    assert image.shape == (2, 3, 4, 3)
    for axis in range(3):
        np.testing.assert_array_equal(image[..., axis], force[:, axis])
    np.testing.assert_array_equal(same_kind(LAYOUT.from_image(array(image)), array(image)), force)


def test_an_image_is_a_view():
    force = reading(3, 3, 4)
    LAYOUT.to_image(force)[1, 2, 0] = 5
    assert force[0, 1, 2] == 5
    LAYOUT.from_image(LAYOUT.to_image(force))[2, 0, 0] = 6
    assert force[2, 0, 0] == 6


def test_policy_channels_are_oldest_first_then_pads_then_axes(array):
    history = reading(8, 5, 2, 3, 3, 4)  # batch, history, pads, axes, rows, cols
    channels = same_kind(LAYOUT.to_policy(array(history)), array(history))
    assert channels.shape == (8, 30, 3, 4)
    for time in range(5):
        for pad in range(2):
            for axis in range(3):
                np.testing.assert_array_equal(channels[:, (time * 2 + pad) * 3 + axis], history[:, time, pad, axis])
    np.testing.assert_array_equal(same_kind(LAYOUT.from_policy(array(channels), 2), array(channels)), history)


def test_policy_without_a_batch_and_with_two_batch_axes():
    assert LAYOUT.to_policy(reading(1, 2, 3, 3, 4)).shape == (6, 3, 4)
    assert LAYOUT.to_policy(reading(2, 7, 4, 1, 3, 3, 4)).shape == (2, 7, 12, 3, 4)
    assert LAYOUT.from_policy(reading(2, 7, 12, 3, 4), pads=1).shape == (2, 7, 4, 1, 3, 3, 4)


def test_flat_values_are_the_xyz_of_each_taxel_row_by_row(array):
    force = reading(6, 3, 3, 4)
    flat = same_kind(LAYOUT.to_flat(array(force)), array(force))
    assert flat.shape == (6, 36)
    for taxel in range(12):
        np.testing.assert_array_equal(flat[:, 3 * taxel : 3 * taxel + 3], force[:, :, taxel // 4, taxel % 4])


def test_flat_values_follow_the_vendors_order(array):
    order = (4, 2, 0, 5, 3, 1)  # not an involution: the inverse of this permutation differs from it
    layout = TaxelLayout(2, 3, 1e-3, vendor_order=order)
    force = reading(2, 3, 2, 3)
    flat = same_kind(layout.to_flat(array(force)), array(force))
    for place, taxel in enumerate(order):
        np.testing.assert_array_equal(flat[:, 3 * place : 3 * place + 3], force[:, :, taxel // 3, taxel % 3])
    np.testing.assert_array_equal(same_kind(layout.from_flat(array(flat)), array(flat)), force)


@repeatable
@given(st.data(), layouts, st.integers(0, 9))
def test_every_way_out_leads_back(data, layout, seed):
    order = data.draw(st.permutations(range(layout.taxels)))
    layout = dataclasses.replace(layout, vendor_order=order)
    force = reading(2, 3, *layout.shape, seed=seed)
    np.testing.assert_array_equal(layout.from_image(layout.to_image(force)), force)
    np.testing.assert_array_equal(layout.from_policy(layout.to_policy(force), 3), force)
    np.testing.assert_array_equal(layout.from_flat(layout.to_flat(force)), force)


def test_torch_gradients_pass_through():
    torch = pytest.importorskip("torch")
    force = torch.ones(2, 3, 4, 6, requires_grad=True)
    layout = TaxelLayout(4, 6, 1e-3, vendor_order=tuple(reversed(range(24))))
    (layout.pool_force(force, 2, 2).sum() + 2 * layout.to_flat(force).sum()).backward()
    assert torch.equal(force.grad, torch.full_like(force, 3))


# invalid input: one line that says what was expected and what was given


@pytest.mark.parametrize("value", [True, 0, -1, 2.5, float("nan"), float("inf"), "three", None, [1, 2]])
@pytest.mark.parametrize("name", ["rows", "cols"])
def test_bad_counts(name, value):
    fields = {"rows": 2, "cols": 2, "pitch": 1e-3} | {name: value}
    with pytest.raises(InvalidValueError, match=f"{name} must be a whole number of at least 1, got"):
        TaxelLayout(**fields)


def test_more_taxels_than_any_sensor_has():
    with pytest.raises(InvalidValueError, match="at most 1000000 taxels, got 100000x100000"):
        TaxelLayout(100_000, 100_000, 1e-3)


@pytest.mark.parametrize(
    "pitch", [0, -1e-3, (1e-3, 0), (1e-3, float("nan")), float("inf"), (1e-3, 1e-3, 1e-3), "wide", None, ()]
)
def test_bad_pitch(pitch):
    with pytest.raises(InvalidValueError, match="pitch must be two positive finite lengths in m, got"):
        TaxelLayout(2, 2, pitch)


@pytest.mark.parametrize("name", ["positions", "normals"])
def test_bad_points(name):
    with pytest.raises(InvalidValueError, match=rf"{name} must have shape \(4, 3\) for 2x2 taxels, got \(4, 2\)"):
        TaxelLayout(2, 2, 1e-3, **{name: np.ones((4, 2))})
    with pytest.raises(InvalidValueError, match=rf"{name} must have shape \(4, 3\).*got \(2, 2, 3\)"):
        TaxelLayout(2, 2, 1e-3, **{name: np.ones((2, 2, 3))})
    for bad in (np.nan, np.inf):
        points = np.ones((4, 3))
        points[2, 1] = bad
        with pytest.raises(InvalidValueError, match=f"{name} must be finite"):
            TaxelLayout(2, 2, 1e-3, **{name: points})
    with pytest.raises(InvalidValueError, match=f"{name} must"):
        TaxelLayout(1, 2, 1e-3, **{name: [[0, 0, 1], [0, 1]]})


def test_a_normal_without_length():
    with pytest.raises(InvalidValueError, match="normals must not have zero length, but that of taxel 2 has"):
        TaxelLayout(1, 3, 1e-3, normals=[[0, 0, -1], [0, 1, 0], [0, 0, 0]])


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 1, 2, 2), (1, 2, 3, 4), (0, 1, 2, -1), range(5)])
def test_an_order_that_is_no_permutation(order):
    with pytest.raises(InvalidValueError, match=r"vendor_order must be a permutation of 0\.\.3"):
        TaxelLayout(2, 2, 1e-3, vendor_order=order)


def test_check():
    LAYOUT.check(reading(3, 3, 4))
    LAYOUT.check(reading(9, 2, 3, 3, 4), pads=2)
    with pytest.raises(InvalidValueError, match=r"expected a tensor of shape \(\.\.\., 3, 3, 4\), got \(3, 4, 3\)"):
        LAYOUT.check(reading(3, 4, 3))
    with pytest.raises(
        InvalidValueError, match=r"expected a tensor of shape \(\.\.\., 2, 3, 3, 4\), got \(1, 3, 3, 4\)"
    ):
        LAYOUT.check(reading(1, 3, 3, 4), pads=2)
    with pytest.raises(InvalidValueError, match=r"got \(3, 3, 4\)"):
        LAYOUT.check(reading(3, 3, 4), pads=1)


@pytest.mark.parametrize("convert", ["to_image", "to_policy", "to_flat"])
def test_readings_of_another_layout(convert):
    with pytest.raises(
        InvalidValueError, match=r"expected a tensor of shape \(\.\.\., 3, 3, 4\), got \(1, 1, 3, 4, 3\)"
    ):
        getattr(LAYOUT, convert)(reading(1, 1, 3, 4, 3))


def test_other_shapes_that_do_not_fit():
    with pytest.raises(InvalidValueError, match=r"expected an array of shape \(\.\.\., 3, 4, 3\), got \(4, 3, 3\)"):
        LAYOUT.from_image(reading(4, 3, 3))
    with pytest.raises(InvalidValueError, match=r"\(\.\.\., history, pads, 3, rows, cols\), got \(2, 3, 3, 4\)"):
        LAYOUT.to_policy(reading(2, 3, 3, 4))
    for shape in [(7, 3, 4), (6, 4, 3), (3, 4)]:
        with pytest.raises(InvalidValueError, match=r"expected a tensor of shape \(\.\.\., k \* 6, 3, 4\), got"):
            LAYOUT.from_policy(reading(*shape), pads=2)
    with pytest.raises(InvalidValueError, match=r"expected flat values of shape \(\.\.\., 36\), got \(2, 35\)"):
        LAYOUT.from_flat(reading(2, 35))
    with pytest.raises(PaxisimError, match=r"expected flat values of shape \(\.\.\., 36\), got \(\)"):
        LAYOUT.from_flat(np.float32(1))


@pytest.mark.parametrize("pads", [0, -1])
def test_policy_channels_of_no_pads(pads):
    with pytest.raises(InvalidValueError):
        LAYOUT.from_policy(reading(6, 3, 4), pads=pads)
