"""The elastic layer against a solution by finite elements, made by a library of its own."""

import functools

import numpy as np
import pytest
import skfem
from skfem.helpers import ddot, div, grad, transpose
from skfem.models.elasticity import lame_parameters

from paxisim.layer.response import layer_response, surface_deflection

pytestmark = pytest.mark.slow

PITCH = (1.5e-3, 1e-3)
SIDES = np.array(PITCH[::-1])
THICKNESS = 2e-3


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


@functools.cache
def finite_elements():
    """Assemble a quarter of the layer, 6 thicknesses wide, with quadratic hexahedra; lengths in mm.

    Returns:
        The basis, the stiffness matrices for Lame's two constants, the loads along x and z, and the degrees of
        freedom fixed for each load.
    """
    half, thickness, far = SIDES * 1e3 / 2, THICKNESS * 1e3, 12.0

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


@pytest.mark.parametrize("poisson", [0.3, 0.48])
@pytest.mark.parametrize("bonded", [True, False])
def test_the_surface_sinks_as_finite_elements_say_on_either_base(poisson, bonded):
    basis, volume, shape, (_, load), (_, held) = finite_elements()
    if not bonded:  # the base holds back only what moves into it
        base = basis.mesh.facets_satisfying(lambda x: x[2] > THICKNESS * 1e3 - 1e-9)
        planes = [basis.get_dofs(lambda x, a=axis: x[a] < 1e-9).all([f"u^{axis + 1}"]) for axis in (0, 1)]
        held = np.unique(np.concatenate([basis.get_dofs(base).all(["u^3"]), *planes]))
    first, second = lame_parameters(1.0, poisson)
    system = skfem.condense(first * volume + second * shape, load, D=held)
    solution = skfem.solve(*system, solver=skfem.solver_iter_pcg(rtol=1e-8))
    mean = 4 * load @ solution  # the load is a quarter of 1 N, spread evenly, so its work is a quarter of the mean
    sunk = surface_deflection([[0.0, 0.0]], 2.0, 1.0, poisson, (1.5, 1.0), bonded=bonded)[0]
    assert sunk == pytest.approx(mean, rel=0.01)
