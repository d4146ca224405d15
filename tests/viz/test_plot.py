"""Pictures of pads: what a person reads from colours, arrows, scales and names."""

import importlib
import io
import subprocess
import sys
from pathlib import Path

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver, QuiverKey
from matplotlib.text import Text

import paxisim
from paxisim import InvalidValueError, MissingExtraError, TaxelLayout, plot_pads, plot_tactile
from paxisim.diagnose.report.style import drawing
from paxisim.viz.colors import STOPS, UNKNOWN_COLOR, taxel_colors
from paxisim.viz.drawing import round_down

LAYOUT = TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
DOCS = Path(__file__).parents[2] / "docs"


def reading(layout=LAYOUT, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.uniform(-0.2, 1.0, layout.shape)).astype(np.float32)


def taxels_of(ax):
    return next(c for c in ax.collections if isinstance(c, PolyCollection) and not isinstance(c, Quiver))


def arrows_of(ax):
    return next(c for c in ax.collections if isinstance(c, Quiver))


def keys_of(*axes):
    return [artist for ax in axes for artist in ax.get_children() if isinstance(artist, QuiverKey)]


def drawn(axes_or_figure):
    """Force drawing: a figure's own canvas draws nothing until the figure is saved."""
    axes_or_figure.get_figure().savefig(io.BytesIO(), format="png")
    return axes_or_figure


def face_colors(ax):
    return taxels_of(drawn(ax)).get_facecolors()


def test_colors_go_from_blue_over_grey_to_red():
    force = np.full((2, 3, 1, 7), 99.0)  # shear does not count
    force[:, 2, 0] = -4, -2, -1, 0, 1, 2, 4
    force[1, 2, 0, 3] = np.nan
    rgba = taxel_colors(force, 2.0)
    assert rgba.shape == (2, 1, 7, 4)
    levels = [dict(STOPS)[level] for level in (-1, -1, -0.5, 0, 0.5, 1, 1)]
    np.testing.assert_allclose(rgba[0, 0, :, :3], levels)
    saturation = matplotlib.colors.rgb_to_hsv(levels[3:-1])[:, 1]
    assert saturation[0] < 0.02  # grey at rest
    assert np.all(np.diff(saturation) > 0)
    assert rgba[0, 0, -1, 0] > 0.7 > 0.2 > rgba[0, 0, -1, 1:3].max()
    np.testing.assert_array_equal(rgba[1, 0, 3], [*UNKNOWN_COLOR, 1])
    np.testing.assert_array_equal(rgba[..., 3], 1)


def test_taxels_have_these_colors():
    force = reading()
    force[2] = np.linspace(-0.3, 0.7, LAYOUT.taxels).reshape(6, 5)
    force[2, 3, 3] = np.nan
    expected = taxel_colors(force, 0.7).reshape(-1, 4)
    np.testing.assert_allclose(face_colors(plot_tactile(force, LAYOUT)), expected, atol=5e-3)


def test_taxels_lie_where_they_are_with_row_0_at_the_top():
    ax = drawn(plot_tactile(reading(), LAYOUT))
    corners = np.stack([path.vertices[:4] for path in taxels_of(ax).get_paths()])
    np.testing.assert_allclose(corners.mean(axis=1), 1e3 * LAYOUT.positions[:, :2])
    np.testing.assert_allclose(np.ptp(corners, axis=1), np.tile([4.52, 4.35], (30, 1)))
    assert ax.get_aspect() == 1
    assert "mm" in ax.get_xlabel()
    on_screen = ax.transData.transform(1e3 * LAYOUT.positions[[0, -1], :2])
    assert on_screen[0, 0] < on_screen[1, 0]  # column 0 is left
    assert on_screen[0, 1] > on_screen[1, 1]  # row 0 is at the top; matplotlib counts pixels from the bottom


def test_taxels_that_are_no_grid_are_flattened():
    angle = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    points = np.stack([6e-3 * np.cos(angle), 6e-3 * np.sin(angle), 1e-3 * angle], axis=-1)
    layout = TaxelLayout(1, 7, 2e-3, points, points - [0, 0, 0.05])
    ax = drawn(plot_tactile(reading(layout), layout))
    centres = [path.vertices[:4].mean(axis=0) for path in taxels_of(ax).get_paths()]
    np.testing.assert_allclose(centres, 1e3 * points[:, :2], atol=1e-9)


def test_arrows_point_along_the_shear_and_the_longest_is_one_pitch_or_as_asked():
    force = np.zeros(LAYOUT.shape)
    force[:2, 2, 3] = 0.3, 0.4
    index = 2 * 5 + 3
    for given, length in ((None, 4.35), (1.0, 4.35 / 2)):
        arrows = arrows_of(drawn(plot_tactile(force, LAYOUT, shear_max=given)))
        assert np.hypot(arrows.U[index], arrows.V[index]) / arrows.scale == pytest.approx(length, rel=1e-6)
        shown = np.flatnonzero(~np.broadcast_to(arrows.Umask, 30))
        np.testing.assert_array_equal(shown, [index])  # none where there is no shear
        outline = arrows.get_paths()[index].vertices  # relative to the taxel, in screen coordinates, y up
        direction = np.array([0.6, -0.8])
        tip = outline[(outline @ direction).argmax()]
        np.testing.assert_allclose(tip / np.linalg.norm(tip), direction, atol=1e-3)  # the tail has two corners


def test_scales_are_in_newtons():
    force = np.zeros(LAYOUT.shape)
    force[2, 1, 1], force[2, 1, 2], force[0, 1, 1] = 0.8, -0.3, 0.37
    ax = drawn(plot_tactile(force, LAYOUT))
    (bar,) = ax.child_axes
    assert bar.get_ylabel() == "normal force (N)"
    np.testing.assert_allclose(bar.get_ylim(), (-0.3, 0.8))
    (key,) = keys_of(ax)
    assert (key.label, key.U) == ("shear 0.2 N", 0.2)
    assert drawn(plot_tactile(force, LAYOUT, vmax=2.0)).child_axes[0].get_ylim()[1] == 2.0
    rounded = {1.0: 1.0, 0.99: 0.5, 4.9e-4: 2e-4, 1000.0: 1000.0, 5: 5}
    assert {value: round_down(value) for value in rounded} == rounded


def test_pads_at_rest_of_a_single_taxel_and_long_ones_can_be_drawn():
    assert np.ptp(face_colors(plot_tactile(np.zeros(LAYOUT.shape), LAYOUT)), axis=0).max() == 0
    for value in (1, np.nan):
        drawn(plot_tactile(np.full((3, 1, 1), value), TaxelLayout(1, 1, 5e-3)))
    for strip in (TaxelLayout(16, 2, 3e-3), TaxelLayout(2, 16, 3e-3)):
        drawn(plot_pads(reading(strip)[None], strip))


def test_torch_and_lists_draw_as_numpy_does():
    torch = pytest.importorskip("torch")
    force = reading()
    for same in (torch.tensor(force, requires_grad=True), force.tolist()):
        np.testing.assert_array_equal(face_colors(plot_tactile(same, LAYOUT)), face_colors(plot_tactile(force, LAYOUT)))


def test_draws_in_given_axes_and_any_name():
    figure = Figure()
    axes = figure.subplots(1, 2)
    broken = r"$\frac{$ a_{ \left("  # looks like broken TeX
    assert plot_tactile(reading(), LAYOUT, axes[1], title=broken) is axes[1]
    assert drawn(axes[1]).get_title(loc="left") == broken
    assert not axes[0].collections
    with drawing():  # a report
        figure = Figure()
        ax = figure.subplots()
        ax.plot([0, 1], label=broken)
        ax.set_title(broken)
        ax.set_xticks([0], labels=[broken])
        ax.legend()
        figure.savefig(io.BytesIO(), format="svg")


def test_a_pad_can_be_drawn_for_a_dark_page(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    light_and_dark = importlib.import_module("light_and_dark").light_and_dark
    force = np.zeros(LAYOUT.shape)
    force[2, 0, 0] = force[0, 1, 1] = 1.0
    before = dict(matplotlib.rcParams)
    for path, dark in zip(light_and_dark(tmp_path / "pad.png"), (False, True), strict=True):
        ax = plot_tactile(force, LAYOUT, title="left")
        ax.figure.savefig(path)
        paper = 0.0 if dark else 1.0
        colors = face_colors(ax)
        texts = [ax.xaxis.label, *ax.get_xticklabels(), ax.child_axes[0].yaxis.label, keys_of(ax)[0].text]
        texts += [next(t for t in ax.findobj(Text) if t.get_text() == "left")]
        assert {abs(matplotlib.colors.to_rgb(t.get_color())[0] - paper) > 0.7 for t in texts} == {True}
        assert abs(colors[-1, :3] - paper).max() < 0.3, "near the page at rest"
        assert colors[0, 0] - colors[0, 1] > 0.6, "red where pressed"
        green = arrows_of(ax).get_facecolor()[0, 1]
        assert abs(green - colors[-1, 1]) > 0.4, "the arrow is seen on a taxel at rest"
        corner = matplotlib.image.imread(path)[0, 0]
        assert corner[3] == (0 if dark else 1), "the page shows through"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["pad-dark.png", "pad.png"]
    assert dict(matplotlib.rcParams) == before


def test_pads_share_one_scale():
    force = np.stack([reading(), 0.5 * reading()])
    axes = drawn(plot_pads(force, LAYOUT, names=("left", "right"))).axes[:2]
    assert [ax.get_title(loc="left") for ax in axes] == ["left", "right"]
    assert [len(taxels_of(ax).get_paths()) for ax in axes] == [30, 30]
    assert taxels_of(axes[0]).norm.vmax == taxels_of(axes[1]).norm.vmax == pytest.approx(np.abs(force[:, 2]).max())
    assert arrows_of(axes[0]).scale == arrows_of(axes[1]).scale
    assert sum(len(ax.child_axes) for ax in axes) == 1  # colour bar
    assert len(keys_of(*axes)) == 1
    figure = drawn(plot_pads(np.stack([reading()] * 6), LAYOUT))
    assert [ax.get_title(loc="left") for ax in figure.axes[:6]] == [f"pad {i}" for i in range(6)]


@pytest.mark.parametrize("layout", [LAYOUT, TaxelLayout(16, 4, 3e-3)])
@pytest.mark.parametrize("name", ["left", "gripper0_right_left_inner_finger_pad"])
def test_no_name_is_under_the_reference_arrow(layout, name):
    figure = drawn(plot_pads(np.stack([reading(layout)] * 2), layout, names=("pad", name)))
    renderer = FigureCanvasAgg(figure).get_renderer()
    titles = [
        next(t for t in ax.findobj(Text) if t.get_text() == n)
        for ax, n in zip(figure.axes[:2], ("pad", name), strict=True)
    ]
    key = keys_of(figure.axes[1])[0].text.get_window_extent(renderer)
    places = [title.get_window_extent(renderer) for title in titles]
    assert not places[1].overlaps(key)
    assert key.y1 < figure.bbox.height, "the arrow is in the picture"
    assert places[0].y0 == pytest.approx(places[1].y0, abs=1.0)


PAIR = np.zeros((2, 3, 6, 5))


@pytest.mark.parametrize(
    ("draw", "force", "options", "words"),
    [
        (plot_tactile, np.zeros((3, 5, 6)), {}, r"expected a tensor of shape \(\.\.\., 3, 6, 5\), got \(3, 5, 6\)"),
        (plot_tactile, PAIR, {}, r"of shape \(3, 6, 5\), got \(2, 3, 6, 5\): .*plot_pads"),
        (plot_pads, PAIR[0], {}, r"\(pads, 3, 6, 5\), got \(3, 6, 5\): .*plot_tactile"),
        (plot_pads, PAIR[:0], {}, "no pad to draw"),
        (plot_pads, PAIR, {"names": ["left"]}, "a name for each of 2 pads, got 1: left"),
        *((plot_tactile, PAIR[0], {"vmax": wrong}, "vmax must be") for wrong in (0, -1.0, np.nan, np.inf)),
        (plot_pads, PAIR, {"shear_max": 0}, "shear_max must be"),
    ],
)
def test_what_is_refused(draw, force, options, words):
    with pytest.raises(InvalidValueError, match=words):
        draw(force, LAYOUT, **options)


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    for name in ("matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, name, None)
    for draw, given in (
        (plot_tactile, (PAIR[0], LAYOUT)),
        (plot_pads, (PAIR, LAYOUT)),
        (paxisim.plot_mounts, (None,)),
        (paxisim.plot_presses, (None,)),
        (paxisim.plot_calibration, (None, None)),
    ):
        with pytest.raises(MissingExtraError, match=rf"{draw.__name__} needs matplotlib.*paxisim\[viz\]"):
            draw(*given)


def test_pyplot_and_its_backend_are_left_alone():
    code = """
import io, sys
from paxisim.viz.plot import plot_pads, plot_tactile
assert "matplotlib" not in sys.modules
import numpy as np
from paxisim.layout import TaxelLayout
layout = TaxelLayout(2, 3, 1e-3)
plot_tactile(np.ones((3, 2, 3)), layout).figure.savefig(io.BytesIO())
assert "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
