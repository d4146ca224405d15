"""The bonded layer against the half-space, a finite element solution, and properties of every elastic body."""

import functools

import numpy as np
import pytest
import skfem
from hypothesis import given, settings
from hypothesis import strategies as st
from skfem.helpers import ddot, div, grad, transpose
from skfem.models.elasticity import lame_parameters

from paxisim.errors import InvalidValueError
from paxisim.reference.bonded_layer import layer_response

PITCH = (1.5e-3, 1e-3)
SIDES = np.array(PITCH[::-1])
LAYER = {"thickness": 2e-3, "modulus": 3e5, "poisson": 0.45, "pitch": PITCH}


def shear_modulus(modulus, poisson):
    return modulus / (2 * (1 + poisson))


# --- a thick layer is a half-space -----------------------------------------------------------------------------------


def half_space_point_load(x, y, z, poisson):
    """Return displacements ``(..., 3, 3)`` per newton inside a half-space of shear modulus 1 (Johnson, chapter 3)."""
    r = np.sqrt(x**2 + y**2 + z**2)
    m, far = 1 - 2 * poisson, r + z
    along = lambda a: 1 + a**2 / r**2 + m * (r / far - a**2 / far**2)  # noqa: E731
    aside = x * y * (1 / r**2 - m / far**2)
    rows = [
        [along(x), aside, x * (z / r**2 - m / far)],
        [aside, along(y), y * (z / r**2 - m / far)],
        [x * (z / r**2 + m / far), y * (z / r**2 + m / far), 2 * (1 - poisson) + z**2 / r**2],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) / (4 * np.pi * r[..., None, None])


def half_space_rectangle(points, depth, poisson, order=24):
    """Return the response to point loads integrated over the rectangle."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, y = (points[:, i, None, None] - nodes.reshape(shape) * SIDES[i] / 2 for i, shape in ((0, (-1, 1)), (1, (1, -1))))
    x, y = np.broadcast_arrays(x, y)
    every = half_space_point_load(x, y, np.full_like(x, depth), poisson)
    return np.einsum("nabij,a,b->nij", every, weights / 2, weights / 2)


@pytest.mark.parametrize("poisson", [0, 0.3, 0.48])
@pytest.mark.parametrize("depth", [0, 0.5e-3, 2e-3])
def test_a_thick_layer_is_a_half_space(poisson, depth):
    points = np.array([[2e-3, 0], [1.7e-3, 1.1e-3], [-1e-3, 2.5e-3], [-3e-3, -2e-3]])
    if depth:
        points = np.concatenate([points, [[0, 0], [0.3e-3, 0.2e-3]]])
    modulus, around = 3e5, 1e-6
    moved, turned = layer_response(points, depth, 1e3, modulus, poisson, PITCH)

    def expected(dx=0.0, dy=0.0, dz=0.0):
        return half_space_rectangle(points + [dx, dy], depth + dz, poisson) / shear_modulus(modulus, poisson)

    scale = np.abs(expected()).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(moved / scale, expected() / scale, atol=2e-4)

    if depth:
        steps = np.eye(3) * around
        slopes = np.stack([(expected(*step) - expected(*-step)) / (2 * around) for step in steps], axis=1)
        scale = np.abs(slopes).max(axis=(1, 2, 3))[:, None, None]
        np.testing.assert_allclose(turned / scale, half_curl(slopes) / scale, atol=2e-4)


def half_curl(slopes):
    """Return the rotation for displacement gradients ``(n, derivative axis, displacement component, force)``."""
    return 0.5 * np.stack(
        [
            slopes[:, 1, 2] - slopes[:, 2, 1],
            slopes[:, 2, 0] - slopes[:, 0, 2],
            slopes[:, 0, 1] - slopes[:, 1, 0],
        ],
        axis=1,
    )


# --- finite elements -------------------------------------------------------------------------------------------------


@functools.cache
def finite_elements():
    """Assemble a quarter of the layer, 6 thicknesses wide, with quadratic hexahedra; lengths in mm.

    Returns:
        The basis, the stiffness matrices for Lame's two constants, the loads along x and z, and the degrees of
        freedom fixed for each load.
    """
    half, thickness, far = SIDES * 1e3 / 2, LAYER["thickness"] * 1e3, 12.0

    def lines(side):
        return np.concatenate(
            [side * np.array([0, 0.5, 0.8, 1]), side + (far - side) * np.linspace(0, 1, 10)[1:] ** 2.2]
        )

    mesh = skfem.MeshHex.init_tensor(lines(half[0]), lines(half[1]), thickness * np.linspace(0, 1, 7) ** 1.3)
    element = skfem.ElementVector(skfem.ElementHex2())
    basis = skfem.Basis(mesh, element, intorder=4)
    volume = skfem.BilinearForm(lambda u, v, _: div(u) * div(v)).assemble(basis)
    shape = skfem.BilinearForm(lambda u, v, _: ddot(grad(u), grad(v)) + ddot(grad(u), transpose(grad(v)))).assemble(
        basis
    )
    loaded = mesh.facets_satisfying(lambda x: (x[2] < 1e-9) & (x[0] < half[0]) & (x[1] < half[1]))
    surface = skfem.FacetBasis(mesh, element, facets=loaded, intorder=4)
    loads, fixed = [], []
    for force in (0, 2):
        loads.append(skfem.LinearForm(lambda v, _, force=force: v[force] / np.prod(2 * half)).assemble(surface))
        held = [basis.get_dofs(lambda x: x[2] > thickness - 1e-9).all()]
        for axis in (0, 1):
            # a plane of symmetry, or of antisymmetry if the force is normal to it
            components = {axis} if axis != force else {0, 1, 2} - {axis}
            plane = basis.get_dofs(lambda x, axis=axis: x[axis] < 1e-9)
            held.append(plane.all([f"u^{component + 1}" for component in components]))
        fixed.append(np.unique(np.concatenate(held)))
    return basis, volume, shape, loads, fixed


@pytest.mark.parametrize("poisson", [0.3, 0.48])
def test_finite_elements_agree(poisson):
    basis, volume, shape, loads, fixed = finite_elements()
    first, second = lame_parameters(1.0, poisson)
    stiffness = first * volume + second * shape
    solutions = [
        skfem.solve(*skfem.condense(stiffness, load, D=held), solver=skfem.solver_iter_pcg(rtol=1e-6))
        for load, held in zip(loads, fixed, strict=True)
    ]

    def moved_there(points):
        return (basis.probes(points.T) @ np.stack(solutions, axis=1)).reshape(3, len(points), 2).swapaxes(0, 1)

    points = np.array(
        [[0.2, 0.1, 0.1], [0.2, 0.3, 1.0], [0.8, 0.4, 0.5], [1.2, 1.1, 1.2], [0.1, 1.5, 0.5], [2, 2, 1.6]]
    )
    step = 0.05
    slopes = np.stack(
        [(moved_there(points + step * axis) - moved_there(points - step * axis)) / (2 * step) for axis in np.eye(3)], 1
    )
    steepest = np.sqrt(np.sum(slopes**2, axis=(1, 2)))
    for i, (x, y, z) in enumerate(points):
        moved, turned = layer_response([[x, y]], z, 2.0, 1.0, poisson, (1.5, 1.0))
        moved, turned = moved[0][:, [0, 2]], turned[0][:, [0, 2]]
        off = np.linalg.norm(moved - moved_there(points)[i], axis=0) / np.linalg.norm(moved, axis=0)
        off_turned = np.linalg.norm(turned - half_curl(slopes)[i], axis=0) / steepest[i]
        assert off.max() < 0.03
        assert off_turned.max() < 0.05


# --- properties of every layer ---------------------------------------------------------------------------------------

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
@settings(max_examples=30, deadline=None)
def test_a_force_here_moves_there_as_a_force_there_moves_here(layer, place):
    there, back = layer_response([place, np.negative(place)], 0, **layer)[0]
    np.testing.assert_allclose(there, back.T, atol=1e-6 * np.abs(there).max())


@given(layer=layers, place=places, deep=st.floats(0.25, 0.9))
@settings(max_examples=30, deadline=None)
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


@pytest.mark.parametrize(("poisson", "deep"), [(0, 0.3), (0.3, 0.8), (0.495, 0), (0.495, 0.6)])
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
@settings(max_examples=30, deadline=None)
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
@settings(max_examples=30, deadline=None)
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


def test_the_base_does_not_move():
    moved, _ = layer_response([[0, 0], [2e-3, 1e-3]], LAYER["thickness"] * (1 - 1e-9), **LAYER)
    assert np.abs(moved).max() < 1e-8 * np.abs(layer_response([[0, 0]], 0, **LAYER)[0]).max()


def test_a_point_far_away_does_not_change_the_others():
    layer = LAYER | {"poisson": 0.495}
    points = [[0, 0], [1e-3, 0], [0, 1e-3]]
    alone, among = (layer_response(where, 1e-3, **layer) for where in (points, [*points, [20e-3, -25e-3]]))
    for few, many in zip(alone, among, strict=True):
        np.testing.assert_allclose(many[:3], few, atol=1e-6 * np.abs(few).max())
    assert layer_response(np.zeros((0, 2)), 1e-3, **layer)[0].shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
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
    ],
)
def test_a_value_out_of_range_is_refused(change, message):
    with pytest.raises(InvalidValueError, match=message):
        layer_response(**{"offsets": [[0.0, 0.0]], "depth": 1e-3} | LAYER | change)
