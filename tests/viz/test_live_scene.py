"""Contents of the live view, computed without drawing."""

import numpy as np
import pytest

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.viz.live_scene import Scale, Scene

GRID = TaxelLayout(3, 2, (2e-3, 4e-3))


def test_pads_stand_side_by_side_and_lines_below_each_other_without_touching():
    scene = Scene([GRID, GRID], ["left", "right"], ["measured", "simulated"])
    assert scene.lines == ("measured", "simulated", "residual")
    assert Scene([GRID], ["a"], ["simulated"]).lines == ("simulated",)
    places = scene.positions[None] + scene.offsets[:, None, None]
    assert places.shape == (3, 2, 6, 3)
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
        (lambda: Scene([GRID], ["a"], ["measured"]).check(np.zeros((3, 3, 2))), r"\(1, 3, 3, 2\), got \(3, 3, 2\)"),
        (lambda: Scale(vmax=0.0), "vmax"),
        (lambda: Scale(vmax=np.nan), "vmax"),
        (lambda: Scale(shear_max=-1.0), "shear_max"),
        (lambda: Scale(shear_max=np.inf), "shear_max"),
    ],
)
def test_what_is_refused(make, says):
    with pytest.raises(InvalidValueError, match=says):
        make()
