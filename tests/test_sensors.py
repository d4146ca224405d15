"""The catalogue: consistent figures, a source for each, and layouts that need no optional package."""

import copy
import importlib.util
import pickle
import sys
import types

import numpy as np
import pytest

from paxisim.errors import InvalidValueError, MissingExtraError, UnknownNameError, UnsupportedError
from paxisim.hw.profiles.load import known_profiles, shipped_entry
from paxisim.sensors import Sensor, format_table, known_sensors, sensor, surface_layout

CURVED = [s.name for s in known_sensors() if (s.coordinates or "").startswith("paxini-sdk:")]
FIGURES = ("pitch", "rate", "mass", "resolution", "shear_range", "normal_range")


def dome(radii: tuple[float, float, float], spacing: float = 2.8) -> tuple[np.ndarray, np.ndarray]:
    """Return points on the upper half of an ellipsoid (mm, vendor's frame) and their outward normals."""
    unit = []
    for polar in np.linspace(0, np.pi / 2, 6):
        around = max(1, round(2 * np.pi * np.sin(polar) * float(np.mean(radii)) / spacing))
        for angle in 2 * np.pi * np.arange(around) / around:
            unit.append([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)])
    points = np.array(unit) * radii
    normals = points / np.square(radii)
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_pads_have_the_figures_of_the_paper_and_of_xela():
    layout = sensor("paxini-gen1-l4629").layout
    assert (layout.shape, layout.is_grid) == ((3, 12, 10), True)
    assert layout.size == pytest.approx((26.1e-3, 22.6e-3))
    assert layout.pool(2, 2).pitch == pytest.approx((4.35e-3, 4.52e-3))
    assert sensor("xela-uspa44").layout.shape == (3, 4, 4)
    assert sensor("xela-uspa44").layout.pitch == pytest.approx((14e-3 / 3, 14e-3 / 3), rel=1e-4)
    assert sensor("xela-uspa44").mass == pytest.approx(3.6e-3)
    assert sensor("xela-uspa46").layout.shape == (3, 4, 6)
    assert sensor("xela-uspa46").layout.pitch == pytest.approx((7.17e-3, 7.24e-3))


def test_a_name_is_found_in_any_case_and_an_unknown_one_offers_its_neighbours():
    assert all(s.name == s.name.lower() for s in known_sensors())
    assert sensor("PaXini-GEN1-L4629") is sensor("paxini-gen1-l4629")
    with pytest.raises(UnknownNameError, match=r"did you mean .*'paxini-gen1-l4629'"):
        sensor("paxini-l4629")


def test_every_figure_is_plausible_and_has_a_source():
    for item in known_sensors():
        stated = {"taxels"} | {name for name in FIGURES if getattr(item, name) is not None}
        if item.coordinates is not None:
            stated.add("positions")
        assert set(item.sources) == stated, item.name
        assert all(len(text) > 20 and "\n" not in text for text in item.sources.values()), item.name
        assert (item.pitch is None) != (item.coordinates is None), item.name
        if item.pitch is not None:
            assert all(1e-3 < p < 2e-2 for p in item.pitch), item.name
            assert item.layout.shape == (3, item.rows, item.cols)
            assert item.layout is item.layout, "it is made once"
        assert item.mass is None or 1e-4 < item.mass < 0.1, item.name
        assert item.rate is None or 10 <= item.rate <= 2000, item.name
        for limits in (item.shear_range, item.normal_range):
            assert limits is None or limits[0] <= 0 < limits[1], item.name
        if item.resolution is not None and item.shear_range is not None and item.normal_range is not None:
            assert item.shear_range == pytest.approx((-128 * item.resolution, 127 * item.resolution))
            assert item.normal_range == pytest.approx((0, 255 * item.resolution))
        assert pickle.loads(pickle.dumps(item)) == item == copy.deepcopy(item)
    assert len(set(known_sensors())) == len(known_sensors())


def test_table_fits_a_terminal_and_lists_everything():
    lines = format_table().splitlines()
    assert max(map(len, lines)) <= 80
    assert all(line == line.rstrip() for line in lines)
    for item in known_sensors():
        (at,) = (i for i, line in enumerate(lines) if line.startswith(item.name + " "))
        assert [line.split()[-1] for line in lines[at : at + len(item.profiles)]] == list(item.profiles)
    assert "4x6     7.17 x 7.24    -" in format_table()


def test_the_profiles_of_a_product_have_its_taxels():
    named = [(item, profile) for item in known_sensors() for profile in item.profiles]
    assert {profile for _, profile in named} <= set(known_profiles())
    assert len({profile for _, profile in named}) == len(named)
    for item, profile in named:
        entry = shipped_entry(profile)
        layout, pitch = entry["layout"], item.pitch
        if item.coordinates is not None:
            assert layout["coordinates"] == item.coordinates
        elif entry["family"] != "magnetometer-board":  # a field sensor has contact cells in place of taxels
            assert (layout["rows"], layout["cols"]) == (item.rows, item.cols), profile
            assert layout["pitch"] == pytest.approx(pitch, rel=1e-4), profile


@pytest.mark.parametrize("radii", [(8, 8, 8), (8, 14, 7), (15, 18, 9)])
def test_surface_layout_on_a_dome(radii: tuple[float, float, float]):
    points, outward = dome(radii)
    layout = surface_layout(points + [3.0, 40.0, -5.0])  # the position of the vendor's origin does not matter
    assert layout.shape == (3, 1, len(points))
    position = layout.positions
    assert position[:, 2].min() == pytest.approx(0.0)
    assert position[:, :2].max(axis=0) == pytest.approx(-position[:, :2].min(axis=0))
    assert np.ptp(position, axis=0) == pytest.approx(1e-3 * np.ptp(points, axis=0))
    assert layout.pitch[0] == pytest.approx(2.8e-3, rel=0.4)
    # x right, y down, z inwards: the apex is highest, the tip (largest y of the table) on top
    assert position[np.argmax(points[:, 2]), 2] == pytest.approx(0.0)
    assert position[np.argmax(points[:, 1]), 1] == pytest.approx(position[:, 1].min())
    assert position[np.argmax(points[:, 0]), 0] == pytest.approx(position[:, 0].max())
    cosine = np.sum(layout.normals * outward * [1, -1, -1], axis=1)
    error = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    assert error.mean() < 5
    assert error.max() < (1e-3 if len(set(radii)) == 1 else 17)


def test_surface_layout_of_a_flat_table_faces_out_of_the_pad_and_of_no_table_is_refused():
    x, y = np.meshgrid(np.arange(3.0), np.arange(4.0))
    layout = surface_layout(np.stack([x, y, np.full_like(x, 5.5)], axis=-1).reshape(-1, 3))
    np.testing.assert_allclose(layout.normals, np.tile([0, 0, -1], (12, 1)), atol=1e-9)
    assert layout.pitch == pytest.approx((1e-3, 1e-3))
    assert layout.size == pytest.approx((4e-3, 3e-3))
    for points in (np.zeros((6, 3)), np.zeros((9, 2)), np.full((9, 3), np.nan), np.zeros(9)):
        with pytest.raises(InvalidValueError, match="at least 7 finite points"):
            surface_layout(points)


def test_a_curved_layout_without_its_package_or_hand_names_what_reads_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "paxini_sdk.sensor_registry", None)
    for name in CURVED:
        item = copy.copy(sensor(name))
        item.__dict__.pop("layout", None)
        assert item.taxels > 20  # known without the package
        with pytest.raises(MissingExtraError, match=rf"{name}.*paxini-sdk.*pip install 'paxisim\[paxini\]'"):
            _ = item.layout
    assert sensor("xela-uscuah").taxels == 30
    with pytest.raises(UnsupportedError, match=r"'xela-uscuah'.*--xacro FILE.*paxisim\.sensor_modules"):
        _ = sensor("xela-uscuah").layout


def test_coordinates_that_do_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch):
    package, registry = types.ModuleType("paxini_sdk"), types.ModuleType("paxini_sdk.sensor_registry")
    tables = {"A": dome((8, 8, 8))[0].tolist()}
    registry.load_points = tables.__getitem__  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "paxini_sdk", package)
    monkeypatch.setitem(sys.modules, "paxini_sdk.sensor_registry", registry)
    count = len(tables["A"])
    assert Sensor("a", "m", "a", 1, count, coordinates="paxini-sdk:A").layout.taxels == count
    for coordinates, words in [
        ("paxini-sdk:A", f"expected 52 points of A from paxini-sdk, got {count}"),
        ("paxini-sdk:B", "no coordinates of B"),
        ("elsewhere:C", "unknown kind"),
        (None, "neither a pitch nor coordinates"),
    ]:
        with pytest.raises((UnsupportedError, InvalidValueError), match=words):
            _ = Sensor("a", "m", "a", 1, 52, coordinates=coordinates).layout


@pytest.mark.skipif(importlib.util.find_spec("paxini_sdk") is None, reason="needs paxini-sdk")
@pytest.mark.parametrize("name", CURVED)
def test_curved_layouts_make_sense(name: str):
    item = sensor(name)
    layout = item.layout
    assert layout.shape == (3, 1, item.taxels)
    assert not layout.is_grid
    position, normal = layout.positions, layout.normals
    height, width = np.ptp(position[:, 1]), np.ptp(position[:, 0])
    assert 1.5e-3 < layout.pitch[0] < 4e-3
    # normals: outwards at the apex, mirror-symmetric in x
    assert normal[position[:, 2].argmin(), 2] < -0.88
    if "-dp-" in name:  # a fingertip: longer than wide, its normals up at the tip and to the sides at the sides
        assert 10e-3 < width < height < 40e-3
        assert 3e-3 < position[:, 2].max() < width
        assert normal[position[:, 1].argmin(), 1] < -0.7
        assert normal[position[:, 0].argmax(), 0] > 0.7
    else:  # a pad that is slightly domed
        assert 8e-3 < width < 1.05 * height < 60e-3
        assert 1e-3 < position[:, 2].max() < 4e-3
    mirror = np.linalg.norm(position[:, None] - (position * [-1, 1, 1])[None], axis=-1).argmin(axis=0)
    assert np.sum(normal[mirror] * normal * [-1, 1, 1], axis=1).min() > 0.99
