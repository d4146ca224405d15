"""Surfaces: flat, the paper's bump, a measured map, a curved finger."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import PAPER, POOLED

from paxisim import GaussianBump, InvalidValueError, TaxelLayout, conform, flat, heights_from_map

repeatable = settings(derandomize=True, deadline=None, max_examples=25)


def test_flat():
    np.testing.assert_array_equal(flat(POOLED), np.full((6, 5), 1e-3))
    np.testing.assert_array_equal(flat(TaxelLayout(1, 3, 1e-3), 2e-3), np.full((1, 3), 2e-3))
    for thickness in (-1, 0, float("nan")):
        with pytest.raises(InvalidValueError, match="positive and finite"):
            flat(POOLED, thickness)
    with pytest.raises(InvalidValueError, match=r"at most 0.1, got 1: were millimetres meant"):
        flat(POOLED, 1.0)


# the paper's bump


def paper_depths(rows, cols, gx, gy, sx, sy, h_min, h_max, boundary):
    """Return the depths by the paper's formula, one taxel at a time."""

    def distance(row, col):
        x, y = col + 0.5, row + 0.5
        return math.sqrt((gx - x) ** 2 / sx**2 + (gy - y) ** 2 / sy**2)

    cells = [(row, col) for row in range(rows) for col in range(cols)]
    furthest = max(distance(*cell) for cell in cells)
    depths = {}
    for row, col in cells:
        depth = h_min + distance(row, col) / furthest * (h_max - h_min)
        if row in (0, rows - 1) or col in (0, cols - 1):
            depth -= boundary
        depths[row, col] = depth
    return np.array([[depths[row, col] for col in range(cols)] for row in range(rows)])


@repeatable
@given(
    st.integers(2, 9),
    st.integers(2, 9),
    st.tuples(st.floats(-1, 10), st.floats(-1, 10)),
    st.tuples(st.floats(1, 3), st.floats(1, 3)),
    st.floats(0.3e-3, 1e-3),
    st.floats(0, 2e-3),
    st.floats(0, 0.2e-3),
)
def test_the_bump_is_the_papers_formula(rows, cols, center, deviation, h_min, bump, boundary):
    layout = TaxelLayout(rows, cols, (4e-3, 5e-3))
    values = (h_min, h_min + bump, boundary)
    expected = paper_depths(rows, cols, *center, *deviation, *values)
    np.testing.assert_allclose(GaussianBump(center, deviation, *values).heights(layout), expected, atol=1e-12)
    recess = GaussianBump(center, deviation, *values, depth_is="recess").heights(layout)
    np.testing.assert_allclose(recess, 2 * h_min + bump - expected, atol=1e-12)


def test_the_default_bump_is_around_the_papers_1_mm():
    heights = GaussianBump((2.5, 3.0)).heights(POOLED)
    assert 0.8e-3 <= heights.min() < 1e-3 < heights.max() <= 1.1e-3 + 1e-12
    np.testing.assert_allclose(GaussianBump((0.5, 0.5), boundary=0).heights(TaxelLayout(1, 1, 1e-3)), 0.9e-3)


def test_taxels_off_a_grid_count_by_their_positions_and_have_no_boundary():
    positions = [[-2e-3, 0, 0], [2e-3, 0, 0], [6e-3, 8e-3, 1e-3]]
    layout = TaxelLayout(1, 3, (4e-3, 4e-3), positions)
    heights = GaussianBump((0.5, 0.5), (1.0, 1.0), h_min=1e-3, h_max=2e-3, boundary=0.5e-3).heights(layout)
    # one and two pitches to the right, two pitches down
    expected = 1e-3 + 1e-3 * np.array([[0, 1 / math.hypot(2, 2), 1]])
    np.testing.assert_allclose(heights, expected)


def test_drawn_bumps_lie_in_table_1_fill_it_and_keep_what_is_fixed():
    rng = np.random.default_rng(0)
    bumps = [GaussianBump.sample(POOLED, rng) for _ in range(500)]
    centers = np.array([b.center for b in bumps])
    deviations = np.array([b.deviation for b in bumps])
    assert np.all((centers >= 0) & (centers <= [5, 6]))
    assert np.all(centers.max(axis=0) > [4.8, 5.8])
    assert np.all(centers.min(axis=0) < 0.2)
    assert np.all((deviations >= 1) & (deviations <= 3))
    np.testing.assert_allclose(deviations.mean(axis=0), 2, atol=0.1)
    assert abs(np.corrcoef(deviations.T)[0, 1]) < 0.15, "drawn independently"
    first, again, other = (GaussianBump.sample(PAPER, np.random.default_rng(seed)) for seed in (7, 7, 8))
    assert first == again != other
    fixed = GaussianBump.sample(PAPER, np.random.default_rng(7), h_max=1.3e-3, depth_is="recess")
    assert (fixed.h_max, fixed.depth_is, fixed.center) == (1.3e-3, "recess", first.center)
    assert GaussianBump.sample(PAPER, np.random.default_rng(7), center=(1.0, 2.0)).center == (1.0, 2.0)


def test_bad_bumps():
    cases = [
        ({"center": (np.nan, 1)}, "must be finite"),
        ({"center": (1, np.inf)}, "must be finite"),
        ({"h_max": np.nan}, "must be finite"),
        ({"boundary": np.inf}, "must be finite"),
        ({"deviation": (0, 1)}, "positive deviations and 0 < h_min <= h_max"),
        ({"deviation": (1, -2)}, "positive deviations"),
        ({"h_min": 0}, "0 < h_min <= h_max"),
        ({"h_min": 1.2e-3}, "0 < h_min <= h_max"),
        ({"boundary": -1e-6}, r"boundary must lie in \[0, h_min\)"),
        ({"boundary": 0.9e-3}, r"boundary must lie in \[0, h_min\), got 0.0009"),
        ({"depth_is": "height"}, "'thickness' or 'recess', got 'height'"),
    ]
    for change, message in cases:
        with pytest.raises(InvalidValueError, match=message):
            GaussianBump(**({"center": (1, 1)} | change))
    assert GaussianBump((2, 2), h_min=1e-3, h_max=1e-3, boundary=0).heights(POOLED) == pytest.approx(1e-3)


# a measured surface


@repeatable
@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 20), st.integers(0, 20), st.integers(0, 99))
def test_areas_are_averaged_exactly_also_where_samples_straddle_taxels(rows, cols, more_rows, more_cols, seed):
    layout = TaxelLayout(rows, cols, 2e-3)
    height_map = np.random.default_rng(seed).uniform(0, 0.5e-3, (rows + more_rows, cols + more_cols))
    # split every sample into rows x cols equal parts, so that each taxel is a whole number of parts
    parts = np.repeat(np.repeat(height_map, rows, axis=0), cols, axis=1)
    mean = parts.reshape(rows, rows + more_rows, cols, cols + more_cols).mean(axis=(1, 3))
    result = heights_from_map(layout, height_map, thickness=1.5e-3)
    np.testing.assert_allclose(result, mean - mean.mean() + 1.5e-3, atol=1e-12)


def test_a_constant_map_is_flat_and_bad_maps_are_refused():
    for shape in [(6, 5), (600, 500), (13, 6)]:
        np.testing.assert_allclose(heights_from_map(POOLED, np.full(shape, 3.7)), 1e-3, atol=1e-12)
    holes, steps = np.zeros((6, 5)), np.zeros((6, 5))
    holes[2, 2], steps[0, 0] = np.nan, -1.5e-3
    cases = [
        (np.zeros((5, 5)), r"a height map of at least 6x5, got shape \(5, 5\)"),
        *((np.zeros(shape), "got shape") for shape in ((6, 4), (30,), (6, 5, 1))),
        (holes, "must be finite: fill the holes"),
        (steps, r"spans 1\.5 mm, more than cubes of 1 mm can show"),
    ]
    for height_map, message in cases:
        with pytest.raises(InvalidValueError, match=message):
            heights_from_map(POOLED, height_map)


# a curved finger: meshes in the pad frame, with their front towards -z


def dome(radius=15e-3):
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    sphere.apply_translation([0, 0, radius])
    return sphere


def rod(radius=15e-3, length=60e-3):
    """Return a cylinder along y."""
    cylinder = trimesh.creation.cylinder(radius=radius, height=length, sections=180)
    cylinder.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    cylinder.apply_translation([0, 0, radius])
    return cylinder


def block(depth=0.0, x=0.0):
    box = trimesh.creation.box([50e-3, 50e-3, 10e-3])
    box.apply_translation([x, 0, 5e-3 + depth])
    return box


def test_on_a_plane_the_layout_only_moves():
    layout = conform(POOLED, block(depth=2e-3))
    np.testing.assert_allclose(layout.positions, POOLED.positions + [0, 0, 2e-3], atol=1e-9)
    np.testing.assert_allclose(layout.normals, POOLED.normals, atol=1e-9)
    assert (layout.rows, layout.cols, layout.pitch) == (6, 5, POOLED.pitch)
    assert conform(POOLED, block()).frames == pytest.approx(POOLED.frames, abs=1e-9)


@pytest.mark.parametrize(("mesh", "curved"), [(dome(), [1, 1, 1]), (rod(), [1, 0, 1])], ids=["sphere", "cylinder"])
def test_on_a_curve_positions_lie_on_the_surface_and_normals_point_out(mesh, curved, tmp_path):
    order = tuple(reversed(range(30)))
    layout = conform(TaxelLayout(6, 5, POOLED.pitch, vendor_order=order), mesh)
    assert layout.vendor_order == order
    np.testing.assert_array_equal(layout.positions[:, :2], POOLED.positions[:, :2])
    out = (layout.positions - [0, 0, 15e-3]) * curved
    distance = np.linalg.norm(out, axis=1)
    np.testing.assert_allclose(distance, 15e-3, atol=0.05e-3)  # limited by the mesh's facets
    assert np.all(layout.positions[:, 2] < 15e-3), "the near side"
    angles = np.degrees(np.arccos(np.clip(np.sum(layout.normals * out, axis=1) / distance, -1, 1)))
    assert angles.max() < 1.5
    np.testing.assert_allclose(np.linalg.norm(layout.normals, axis=1), 1)
    mesh.export(tmp_path / "finger.stl")
    for path in (tmp_path / "finger.stl", str(tmp_path / "finger.stl")):
        np.testing.assert_allclose(conform(POOLED, path).positions, layout.positions, atol=1e-8)


def test_the_first_surface_that_faces_the_object_counts():
    inside_out = trimesh.Trimesh(block(depth=-20e-3).vertices, block().faces[:, ::-1], process=False)
    both = trimesh.util.concatenate([block(depth=8e-3), block(depth=3e-3)])
    np.testing.assert_allclose(conform(POOLED, both).positions[:, 2], 3e-3, atol=1e-9)
    # faces that point away cannot be pressed: of the inverted block, only the far side counts, seen from within
    assert conform(POOLED, inside_out).positions[:, 2] == pytest.approx(-10e-3)


def test_an_edge_is_not_rounded():
    """A roof with a ridge along y at x = 0: each side keeps its own normal."""
    vertices = [(x, y, 2 * abs(x)) for x in (-0.03, 0, 0.03) for y in (-0.03, 0.03)]  # 63 deg: sharp enough
    roof = trimesh.Trimesh(vertices, [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]], process=False)
    layout = conform(TaxelLayout(2, 4, 4e-3), roof)
    slope = np.array([2, 0, -1]) / np.sqrt(5)
    expected = np.sign(layout.positions[:, :1]) * [slope[0], 0, 0] + [0, 0, slope[2]]
    np.testing.assert_allclose(layout.normals, expected, atol=1e-9)


def test_meshes_that_cannot_be_pressed(tmp_path):
    (tmp_path / "noise.stl").write_bytes(b"no mesh at all")
    narrow = trimesh.creation.box([22e-3 - 4.52e-3 * 1.5, 0.1, 0.01])
    cases = [
        (tmp_path / "nowhere.stl", r"cannot read the mesh .*nowhere\.stl"),
        (tmp_path / "noise.stl", r"cannot read the mesh .*noise\.stl|no triangles"),
        (narrow, r"12 of 30 taxels miss the mesh, the first at row 0, column 0 \(x"),
        (block(x=1.0), r"30 of 30 taxels miss the mesh.*in m"),
    ]
    for mesh, message in cases:
        with pytest.raises(InvalidValueError, match=message):
            conform(POOLED, mesh)
    layout = TaxelLayout(1, 5, 5e-3)  # 10 mm off its axis, a sphere of radius 11 mm is 65 deg steep
    conform(layout, dome(11e-3))
    with pytest.raises(InvalidValueError, match=r"row 0, column [04] is 6\d deg steep, more than 45"):
        conform(layout, dome(11e-3), max_angle=45)
