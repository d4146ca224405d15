"""The live view: how it arranges pads and colours, and saved views, read back with Rerun."""

import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("rerun", exc_type=ImportError)
from rrd_files import read_rrd, rgba

from paxisim import InvalidValueError, MissingExtraError, TaxelLayout, UnsupportedError
from paxisim.viz.colors import taxel_colors
from paxisim.viz.live import LiveView
from paxisim.viz.live_drawing import LiveDrawing, import_rerun
from paxisim.viz.live_scene import Scale, Scene

GRID = TaxelLayout(3, 4, (2e-3, 3e-3))
CURVED = TaxelLayout(1, 5, 2e-3, positions=np.random.default_rng(1).uniform(-5e-3, 5e-3, (5, 3)))
PADS = ("left", "right of 2/3")


def test_pads_stand_side_by_side_and_lines_below_each_other_without_touching():
    scene = Scene([GRID, GRID], ["left", "right"], ["measured", "simulated"])
    assert scene.lines == ("measured", "simulated", "residual")
    assert Scene([GRID], ["a"], ["simulated"]).lines == ("simulated",)
    places = scene.positions[None] + scene.offsets[:, None, None]
    assert places.shape == (3, 2, GRID.taxels, 3)
    flat = places.reshape(-1, 3)
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=-1) + 1e9 * np.eye(len(flat))
    assert apart.min() == pytest.approx(2.0)  # mm, the pitch
    assert np.all(places[:, 1, :, 0] > places[:, 0, :, 0].max() + 4)
    for above, below in ((0, 1), (1, 2)):
        assert places[below, :, :, 1].min() > places[above, :, :, 1].max() + 2
    np.testing.assert_allclose(scene.positions[0] - scene.positions[0, 0], 1e3 * (GRID.positions - GRID.positions[0]))
    # names stand above the pads and to the left of the lines
    assert np.all(scene.headings[:, 1] < places[0, :, :, 1].min())
    assert np.all(scene.margins[:, 0] < places[..., 0].min())
    drawn = np.concatenate([flat, scene.headings, scene.margins])[:, :2]
    assert np.all(scene.bounds[0] < drawn.min(axis=0))
    assert np.all(scene.bounds[1] > drawn.max(axis=0))


def test_on_a_curved_pad_the_surface_says_what_presses_and_what_drags():
    """Three taxels on an arc; the outer ones face 60 degrees to the left and right."""
    x, z = np.sin(np.pi / 3), np.cos(np.pi / 3)
    normals = [[-x, 0, -z], [0, 0, -1], [x, 0, -z]]
    layout = TaxelLayout(1, 3, 2e-3, positions=[[-4e-3, 0, 2e-3], [0, 0, 0], [4e-3, 0, 2e-3]], normals=normals)
    scene = Scene([layout], ["tip"], ["measured"])
    assert not scene.flat
    force = np.zeros((1, 3, 1, 3))
    force[0, :, 0, 0] = -3 * layout.normals[0]  # pressing straight into the left taxel
    force[0, :, 0, 1] = 0.0, 1.0, 2.0
    force[0, :, 0, 2] = 0.5 * layout.frames[2, :, 0]  # along the surface of the right taxel
    normal, shear = scene.split(force)
    np.testing.assert_allclose(normal, [[3.0, 2.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(shear[0], [[0, 0, 0], [0, 1, 0], 0.5 * layout.frames[2, :, 0]], atol=1e-12)
    ((_, tails, _),) = scene.arrows(shear[None], 2.0)
    assert np.all(np.sum((tails - scene.positions[0, 1:]) * layout.normals[1:], axis=1) > 0), "in front of the taxels"
    scale = Scale()
    scale.update(0.0, np.where(normal > 2, np.nan, normal), shear)
    assert scale.vmax == pytest.approx(2.0), "what is not a number has no say"


def test_the_scale_follows_a_peak_at_once_and_forgets_it_in_time():
    scale, felt = Scale(shear_max=2.0), np.array([8.0])
    assert scale.vmax > 0
    scale.update(0.0, felt, np.ones((1, 3)))
    assert (scale.vmax, scale.shear_max) == (8.0, 2.0)
    seen = []
    for i in range(1, 200):
        scale.update(float(i), 0 * felt, np.zeros((1, 3)))
        seen.append(scale.vmax)
    assert np.all(np.diff(seen) <= 0)
    assert seen[0] > 7
    assert seen[9] == pytest.approx(8 / np.e)
    assert 0 < seen[-1] < 1
    scale.update(-5.0, felt, np.ones((1, 3)))  # a clock that runs backwards does not reduce the scale
    assert scale.vmax == 8.0


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Scene([], [], ["measured"]), "0 pads"),
        (lambda: Scene([GRID], ["a", "b"], ["measured"]), "1 pads"),
        (lambda: Scene([GRID, GRID], ["a", "a"], ["measured"]), "unique name"),
        (lambda: Scene([GRID, TaxelLayout(2, 3, 1e-3)], ["a", "b"], ["measured"]), "different rows"),
        (lambda: Scene([GRID], ["a"], []), "tensors must be"),
        (lambda: Scene([GRID], ["a"], ["residual"]), "tensors must be"),
        (lambda: Scale(vmax=np.nan), "vmax"),
        (lambda: Scale(shear_max=-1.0), "shear_max"),
        (lambda: Scale(shear_max=np.inf), "shear_max"),
    ],
)
def test_pads_that_cannot_be_arranged_and_scales_that_make_no_sense(make, says):
    with pytest.raises(InvalidValueError, match=says):
        make()


# saved views


def press(count, layout=GRID, pads=2):
    """Return ``(count, pads, 3, rows, cols)`` forces that differ in every frame, with shear on some taxels."""
    force = np.random.default_rng(0).uniform(-1, 1, (count, pads, *layout.shape)).astype(np.float32)
    force[:, :, 2] = 4 * np.abs(force[:, :, 2])
    force[:, :, :, :, 0] = 0
    return force


def save(path, forces, simulated=None, layout=GRID, pads=PADS, **options):
    tensors = ("measured",) if simulated is None else ("measured", "simulated")
    with LiveView(layout, pads, tensors, save=path, fps=None, **options) as view:
        for i, force in enumerate(forces):
            view.show(100 + 0.01 * i, force, None if simulated is None else simulated[i], wait=True)
    return view


def test_every_reading_is_in_the_file_with_its_colors_arrows_and_totals(tmp_path):
    forces = press(600)
    forces[317, 0, :, 1, 2] = np.nan
    view = save(tmp_path / "view.rrd", forces, vmax=4.0, shear_max=1.0)
    assert (view.shown, view.drawn, view.dropped) == (600, 600, 0)
    found = read_rrd(tmp_path / "view.rrd")
    for i, pad in enumerate(("left", r"right\ of\ 2\/3")):
        times, colors = found[f"/pads/measured/{pad}/taxels", "color"]
        np.testing.assert_allclose(times, 0.01 * np.arange(600), atol=1e-6)
        _, (positions,) = found[f"/pads/measured/{pad}/taxels", "position"]
        distances = np.linalg.norm(np.array(positions) - positions[0], axis=1)
        expected = 1e3 * np.linalg.norm(GRID.positions - GRID.positions[0], axis=1)
        np.testing.assert_allclose(distances, expected, atol=1e-5)
        (_, tails), (_, vectors) = (found[f"/pads/measured/{pad}/shear", what] for what in ("position", "vector"))
        for at in (0, 317, 599):
            expected = np.rint(255 * taxel_colors(forces[at, i], 4.0)).reshape(-1, 4)
            np.testing.assert_array_equal(rgba(colors[at]), expected)
            # an arrow of 1 N is 2 mm long, x to the right and y down; the first column has no shear and so no arrow
            shear = 2.0 * forces[at, i, :2].reshape(2, -1).T
            seen = np.linalg.norm(shear, axis=1) > 0.02 * 2.0
            np.testing.assert_allclose(vectors[at], shear[seen], rtol=1e-6)
            np.testing.assert_allclose(tails[at], np.array(positions)[seen], atol=1e-5)
        _, totals = found[f"/force/{pad}/measured", "scalar"]
        np.testing.assert_allclose(totals, forces[:, i].sum(axis=(-2, -1)), rtol=1e-5, atol=1e-5)
    assert found["/pads/names", "label"][1][0] == [*PADS, "measured"]
    _, rates = found["/rate", "scalar"]
    np.testing.assert_allclose(np.array(rates)[:, 0].mean(), 100, rtol=0.5)
    assert np.all(np.array(found["/scale", "scalar"][1]) == [4.0, 1.0])


def test_simulated_pads_stand_under_the_measured_and_the_residual_under_both(tmp_path):
    forces = press(20)
    save(tmp_path / "view.rrd", forces, 0.5 * forces, vmax=4.0)
    found = read_rrd(tmp_path / "view.rrd")
    heights = []
    for line, factor in (("measured", 1.0), ("simulated", 0.5), ("residual", 0.5)):
        _, colors = found[f"/pads/{line}/left/taxels", "color"]
        expected = np.rint(255 * taxel_colors(factor * forces[7, 0], 4.0)).reshape(-1, 4)
        np.testing.assert_allclose(rgba(colors[7]).astype(int), expected, atol=1)  # out of 255
        heights.append(np.array(found[f"/pads/{line}/left/taxels", "position"][1][0])[:, 1])
    assert heights[1].min() > heights[0].max()
    assert heights[2].min() > heights[1].max()
    totals = [np.array(found[f"/force/left/{line}", "scalar"][1]) for line in ("measured", "simulated")]
    np.testing.assert_allclose(0.5 * totals[0], totals[1], rtol=1e-6)


@pytest.mark.parametrize("layout", [CURVED, *(TaxelLayout(1, taxels, 1e-3) for taxels in (1, 3, 4))])
def test_a_curved_pad_and_pads_of_few_taxels(tmp_path, layout):
    save(tmp_path / "view.rrd", press(5, layout, 1), layout=layout, pads=("tip",))
    found = read_rrd(tmp_path / "view.rrd")
    _, (positions,) = found["/pads/measured/tip/taxels", "position"]
    expected = 1e3 * (layout.positions - layout.positions[0])[:, : len(positions[0])]
    assert len(positions[0]) == (3 if layout is CURVED else 2)
    np.testing.assert_allclose(np.array(positions) - positions[0], expected, atol=1e-5)
    _, colors = found["/pads/measured/tip/taxels", "color"]
    assert [len(instant) for instant in colors] == [layout.taxels] * 5


def test_in_real_time_what_overtakes_is_counted_and_the_newest_is_there(tmp_path):
    force = np.zeros((2, *GRID.shape), dtype=np.float32)  # the reader uses the same array again
    with LiveView(GRID, PADS, save=tmp_path / "view.rrd", fps=10.0) as view:
        for i in range(50):
            force[:] = i
            view.show(0.01 * i, force)
    assert view.shown == view.drawn + view.dropped == 50
    assert 0 < view.drawn <= 40
    times, totals = read_rrd(tmp_path / "view.rrd")["/force/left/measured", "scalar"]
    assert len(times) == view.drawn
    np.testing.assert_allclose(totals, GRID.taxels * np.rint(np.array(times) / 0.01)[:, None] * np.ones(3), rtol=1e-5)
    assert times[-1] == pytest.approx(0.49)


def test_a_file_is_readable_before_it_is_finished(tmp_path):
    view = LiveView(GRID, PADS, save=tmp_path / "view.rrd", fps=None)
    for i, force in enumerate(press(300)):
        view.show(0.01 * i, force, wait=True)
    deadline = time.monotonic() + 30
    while view.drawn < 300 and time.monotonic() < deadline:
        time.sleep(0.01)
    view._drawing.check()
    assert len(read_rrd(tmp_path / "view.rrd")["/force/left/measured", "scalar"][0]) == 300
    view.close()
    view.close()


FULL = """
import resource, signal, sys
import numpy as np
from paxisim.layout import TaxelLayout
from paxisim.viz.live import LiveView
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
rng = np.random.default_rng(0)
try:
    with LiveView(TaxelLayout(12, 10, 2e-3), ("a",), save=sys.argv[1], fps=None) as view:
        for i in range(2000):
            view.show(i, rng.normal(size=(1, 3, 12, 10)), wait=True)
except OSError as error:
    print("OSError", error)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs Linux to limit the size of a file")
def test_a_full_disk_is_noticed(tmp_path):
    words = [sys.executable, "-c", FULL, str(tmp_path / "view.rrd")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    assert "OSError cannot write" in done.stdout
    assert "disk may be full" in done.stdout


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"fps": 0.0}, "fps must be positive"),
        ({"window": -1.0}, "window must be positive"),
        ({"vmax": 0.0}, "vmax must be"),
        ({"tensors": ("guessed",)}, "tensors must be"),
        ({"save": "none/view.rrd"}, "none"),
    ],
)
def test_arguments_that_cannot_be_used(tmp_path, monkeypatch, options, says):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((InvalidValueError, OSError), match=says):
        LiveView(GRID, PADS, **{"save": "view.rrd"} | options)
    assert not list(tmp_path.iterdir())


def test_readings_that_cannot_be_shown(tmp_path):
    with LiveView(GRID, PADS, save=tmp_path / "view.rrd") as view:
        with pytest.raises(InvalidValueError, match="got neither"):
            view.show(0.0)
        with pytest.raises(InvalidValueError, match=r"\(2, 3, 3, 4\), got \(1, 3, 3, 4\)"):
            view.show(0.0, np.zeros((1, 3, 3, 4)))


def test_without_rerun_or_with_another_package_of_that_name_it_says_what_to_install(monkeypatch):
    for module, error, words in (
        (None, MissingExtraError, r"paxisim\[live\]"),
        (sys, UnsupportedError, r"rerun-sdk 0\."),
    ):
        monkeypatch.setitem(sys.modules, "rerun", module)
        with pytest.raises(error, match=words):
            import_rerun()


def test_the_window_shows_the_pads_and_a_plot_for_each(tmp_path):
    scene = Scene([GRID, GRID], PADS, ("measured",))
    drawing = LiveDrawing(scene, Scale(), save=tmp_path / "view.rrd", window=10.0)
    blueprint = drawing._blueprint(10.0)
    drawing.close()
    pads, plots = blueprint.root_container.contents
    assert pads.class_identifier == "2D"
    origins = [str(view.origin) for view in plots.contents]
    assert origins == ["/force/left", r"/force/right\ of\ 2\/3", "/rate", "/scale"]
