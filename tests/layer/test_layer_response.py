"""The bonded layer: the equations of elasticity, its limits, and properties of every elastic body."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim.errors import InvalidValueError
from paxisim.layer.response import layer_response
from paxisim.reference.half_space import half_space_response

PITCH = (1.5e-3, 1e-3)
SIDES = np.array(PITCH[::-1])
LAYER = {"thickness": 2e-3, "modulus": 3e5, "poisson": 0.45, "pitch": PITCH}


def shear_modulus(modulus, poisson):
    return modulus / (2 * (1 + poisson))


def half_curl(slopes):
    """Return the rotation for displacement gradients ``(n, derivative axis, displacement component, force)``."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return 0.5 * np.stack([slopes[:, i, j] - slopes[:, j, i] for i, j in pairs], axis=1)


@pytest.mark.parametrize("poisson", [0, 0.3, 0.48])
@pytest.mark.parametrize("depth", [0.5e-3, 2e-3])
def test_a_thick_layer_is_a_half_space(poisson, depth):
    points = np.array([[2e-3, 0], [1.7e-3, 1.1e-3], [-1e-3, 2.5e-3], [-3e-3, -2e-3], [0, 0], [0.3e-3, 0.2e-3]])
    found = layer_response(points, depth, 1e3, 3e5, poisson, PITCH)
    for got, expected in zip(found, half_space_response(points, depth, 3e5, poisson, PITCH), strict=True):
        scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
        np.testing.assert_allclose(got / scale, expected / scale, atol=1e-3)


@pytest.mark.parametrize("poisson", [0, 0.3, 0.4])
def test_a_thin_layer_is_in_equilibrium_under_its_load(poisson):
    """Only one displacement solves Navier's equations, carries the load on the surface, and is zero at the base."""
    layer = LAYER | {"poisson": poisson}
    shear = shear_modulus(layer["modulus"], poisson)
    lame = 2 * shear * poisson / (1 - 2 * poisson)

    def moved(at):
        return layer_response([at[:2]], at[2], **layer)[0][0]

    def slopes(at, step):
        return np.stack([(moved(at + step * a) - moved(at - step * a)) / (2 * step) for a in np.eye(3)])

    step = 5e-5
    for at in np.array([[0.2e-3, 0.1e-3, 0.9e-3], [0.9e-3, 0.8e-3, 1.4e-3], [-1.5e-3, 0.4e-3, 0.7e-3]]):
        laplace = sum(moved(at + step * a) + moved(at - step * a) - 2 * moved(at) for a in np.eye(3)) / step**2
        ends = [[np.einsum("iij->j", slopes(at + s * step * a, step)) for s in (1, -1)] for a in np.eye(3)]
        gradient = np.stack([(after - before) / (2 * step) for after, before in ends])
        left = (lame + shear) * gradient + shear * laplace
        assert np.abs(left).max() < 0.02 * shear * np.abs(laplace).max()

    for at, loaded in (([0.1e-3, 0.2e-3, 1e-5], 1), ([1.2e-3, 0.3e-3, 1e-5], 0), ([0.2e-3, -1.5e-3, 1e-5], 0)):
        slope = slopes(np.array(at), 5e-6)
        stress = shear * (slope[2] + slope[:, 2])
        stress[2] += lame * np.einsum("iij->j", slope)
        np.testing.assert_allclose(-stress * np.prod(SIDES), loaded * np.eye(3), atol=0.04)

    held, _ = layer_response([[0, 0], [2e-3, 1e-3]], layer["thickness"] * (1 - 1e-9), **layer)
    assert np.abs(held).max() < 1e-8 * np.abs(layer_response([[0, 0]], 0, **layer)[0]).max()


layers = st.fixed_dictionaries(
    {
        "thickness": st.floats(0.5e-3, 20e-3),
        "modulus": st.floats(1e4, 1e7),
        "poisson": st.floats(0, 0.495),
        "pitch": st.tuples(st.floats(1e-3, 3e-3), st.floats(1e-3, 3e-3)),
    }
)
places = st.tuples(st.floats(-8e-3, 8e-3), st.floats(-8e-3, 8e-3))


@given(layer=layers, place=places)
@settings(max_examples=10, deadline=None)
def test_a_force_here_moves_there_as_a_force_there_moves_here(layer, place):
    there, back = layer_response([place, np.negative(place)], 0, **layer)[0]
    np.testing.assert_allclose(there, back.T, atol=1e-6 * np.abs(there).max())


@given(layer=layers, place=places, deep=st.floats(0.25, 0.9))
@settings(max_examples=10, deadline=None)
def test_the_rotation_is_half_the_curl_of_the_displacement(layer, place, deep):
    depth, step = deep * layer["thickness"], 1e-3 * layer["thickness"]
    slopes = []
    for axis in np.eye(3) * step:
        after, before = (
            layer_response([place + sign * axis[:2]], depth + sign * axis[2], **layer)[0] for sign in (1, -1)
        )
        slopes.append((after - before) / (2 * step))
    turned = layer_response([place], depth, **layer)[1]
    largest = np.abs(layer_response([(0, 0)], depth, **layer)[1]).max()
    np.testing.assert_allclose(turned, half_curl(np.stack(slopes, axis=1)), atol=1e-4 * largest)


@pytest.mark.parametrize(("poisson", "deep"), [(0.3, 0.8), (0.495, 0.6)])
def test_an_even_load_compresses_and_shears_evenly(poisson, deep):
    layer = LAYER | {"poisson": poisson}
    # wide enough for a nearly incompressible layer, which yields sideways over many thicknesses
    x, y = np.arange(-60, 61) * SIDES[0], np.arange(-40, 41) * SIDES[1]
    offsets = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    thickness, modulus = layer["thickness"], layer["modulus"]
    moved, turned = (
        values.sum(axis=0) * np.prod(SIDES) for values in layer_response(offsets, deep * thickness, **layer)
    )
    height = (1 - deep) * thickness
    sheared = height / shear_modulus(modulus, poisson)
    compressed = height * (1 + poisson) * (1 - 2 * poisson) / (modulus * (1 - poisson))
    np.testing.assert_allclose(moved, np.diag([sheared, sheared, compressed]), rtol=1e-3, atol=1e-6 * sheared)
    quarter_turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    about = -0.5 / shear_modulus(modulus, poisson) * quarter_turn
    np.testing.assert_allclose(turned, about, rtol=1e-3, atol=1e-6 * np.abs(about).max())


@given(layer=layers, place=places, deep=st.floats(0, 0.9), factor=st.floats(0.1, 10))
@settings(max_examples=10, deadline=None)
def test_stiffness_and_lengths_scale(layer, place, deep, factor):
    depth = deep * layer["thickness"]
    moved, turned = layer_response([place], depth, **layer)
    stiffer = layer_response([place], depth, **layer | {"modulus": factor * layer["modulus"]})
    np.testing.assert_allclose(stiffer[0] * factor, moved, atol=1e-9 * np.abs(moved).max())
    np.testing.assert_allclose(stiffer[1] * factor, turned, atol=1e-9 * np.abs(turned).max())
    larger = layer | {"thickness": factor * layer["thickness"], "pitch": tuple(factor * p for p in layer["pitch"])}
    moved_there, turned_there = layer_response([np.multiply(place, factor)], factor * depth, **larger)
    np.testing.assert_allclose(moved_there * factor, moved, atol=1e-7 * np.abs(moved).max())
    np.testing.assert_allclose(turned_there * factor**2, turned, atol=1e-7 * np.abs(turned).max())


@given(layer=layers, place=places, deep=st.floats(0, 0.9))
@settings(max_examples=10, deadline=None)
def test_mirrored_and_turned_loads(layer, place, deep):
    depth = deep * layer["thickness"]
    moved, turned = layer_response([place], depth, **layer)
    # far from the load the response is a tiny rest of terms as large as under the load, which sets the rounding error
    small_shift, small_turn = (1e-9 * np.abs(each).max() for each in layer_response([(0.0, 0.0)], depth, **layer))
    mirror = np.diag([-1, 1, 1])
    moved_there, turned_there = layer_response([(-place[0], place[1])], depth, **layer)
    np.testing.assert_allclose(moved_there, mirror @ moved @ mirror, atol=small_shift)
    # a rotation is an axial vector: it keeps its component normal to the mirror
    np.testing.assert_allclose(turned_there, -mirror @ turned @ mirror, atol=small_turn)
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved_there, turned_there = layer_response(
        [(-place[1], place[0])], depth, **layer | {"pitch": layer["pitch"][::-1]}
    )
    np.testing.assert_allclose(moved_there, quarter @ moved @ quarter.T, atol=small_shift)
    np.testing.assert_allclose(turned_there, quarter @ turned @ quarter.T, atol=small_turn)


def test_a_point_far_away_does_not_change_the_others():
    layer = LAYER | {"poisson": 0.495}
    points = [[0, 0], [1e-3, 0], [0, 1e-3]]
    alone, among = (layer_response(where, 1e-3, **layer) for where in (points, [*points, [20e-3, -25e-3]]))
    for few, many in zip(alone, among, strict=True):
        np.testing.assert_allclose(many[:3], few, atol=1e-6 * np.abs(few).max())
    assert layer_response(np.zeros((0, 2)), 1e-3, **layer)[0].shape == (0, 3, 3)


def test_a_value_out_of_range_is_refused():
    for change, message in (
        ({"offsets": [0.0, 0.0]}, "offsets"),
        ({"offsets": [[0.0, np.nan]]}, "finite"),
        ({"offsets": [["a", "b"]]}, "offsets"),
        ({"offsets": [[1.0, 0.0]]}, "within 100 pitches"),
        ({"depth": 2e-3}, "below the thickness"),
        ({"depth": -1e-6}, "depth"),
        ({"depth": np.nan}, "depth"),
        ({"depth": "deep"}, "depth must be a number"),
        ({"thickness": 0.0}, "thickness"),
        ({"modulus": np.inf}, "modulus"),
        ({"poisson": 0.5}, "0.495"),
        ({"pitch": 1e-3}, "pitch"),
        ({"pitch": (1e-3, 0.0)}, "pitch"),
        ({"pitch": (1e-3, 1e-3, 1e-3)}, "pitch"),
    ):
        with pytest.raises(InvalidValueError, match=message):
            layer_response(**{"offsets": [[0.0, 0.0]], "depth": 1e-3} | LAYER | change)
