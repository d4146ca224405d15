import numpy as np
import pytest
from optional import needs_torch, torch

from paxisim.augment.chain import Chain
from paxisim.augment.poisson import Poisson
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout


def load(*taxels, shape=(6, 5), force=1.0):
    x = np.zeros((1, 3, *shape))
    for row, col in taxels:
        x[0, 2, row, col] = force
    return x


def test_load_pushes_its_neighbours_away():
    y = Poisson(0.2, 0.1)(load((3, 2)))[0]
    assert y[0, 3, 3] > 0 > y[0, 3, 1]
    assert y[1, 4, 2] > 0 > y[1, 2, 2]
    assert y[0, 4, 3] > 0
    assert y[1, 4, 3] > 0
    assert y[0, 3, 2] == y[1, 3, 2] == 0, "a taxel does not push itself"
    assert y[0, 4, 2] == y[1, 3, 3] == 0
    np.testing.assert_array_equal(y[2], load((3, 2))[0, 2])
    assert np.abs(y[:2]).astype(bool).sum() == 12, "no further than 3x3"


def test_the_default_kernel_is_nearly_sobels():
    y = Poisson(4.0, 4.0)(load((3, 2)))[0, 0, 2:5, 1:4]
    np.testing.assert_allclose(y, [[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], atol=0.07)


@pytest.mark.parametrize(("reach", "falloff"), [(1, 1), (1.5, 1), (1.5, 0.3), (2.9, 2), (2.9, np.inf)])
def test_c_is_the_shear_beside_a_load_on_one_side(reach, falloff):
    x = np.zeros((1, 3, 9, 9))
    x[0, 2, :, :4] = 1.0
    y = Poisson(0.2, 0.1, reach, falloff)(x)[0]
    np.testing.assert_allclose(y[0, 4, 4], 0.2)
    np.testing.assert_allclose(y[1, 4, 4], 0, atol=1e-15)
    y = Poisson(0.2, 0.1, reach, falloff)(x.swapaxes(-1, -2))[0]
    np.testing.assert_allclose(y[1, 4, 4], 0.1)


def test_uniform_load_shears_only_the_rim_and_that_outward():
    x = np.zeros((2, 3, 6, 5))
    x[:, 2] = 1.0
    y = Poisson(0.2, 0.1)(x)
    np.testing.assert_allclose(y[:, :2, 1:-1, 1:-1], 0, atol=1e-15)
    np.testing.assert_allclose(y[:, 0, 1:-1, 0], -0.2)
    np.testing.assert_allclose(y[:, 0, 1:-1, -1], 0.2)
    np.testing.assert_allclose(y[:, 1, 0, 1:-1], -0.1)
    np.testing.assert_allclose(y[:, 1, -1, 1:-1], 0.1)


def test_a_load_away_from_the_rim_adds_no_total_shear():
    rng = np.random.default_rng(0)
    x = np.zeros((2, 3, 6, 5))
    x[:, :, 1:-1, 1:-1] = rng.normal(size=(2, 3, 4, 3))
    np.testing.assert_allclose(Poisson(0.2, 0.3)(x).sum(axis=(-2, -1)), x.sum(axis=(-2, -1)), atol=1e-14)


def test_it_is_linear_and_neutral_at_zero():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 2, 3, 6, 5))
    poisson = Poisson(0.2, 0.3)
    np.testing.assert_allclose(poisson(2 * a - 3 * b), 2 * poisson(a) - 3 * poisson(b), atol=1e-14)
    np.testing.assert_array_equal(Poisson()(a), a)


def test_mirrored_load_gives_mirrored_shear():
    x = np.random.default_rng(2).normal(size=(1, 3, 6, 5))
    poisson = Poisson(0.2, 0.3)
    sign = np.array([-1, 1, 1])[:, None, None]
    np.testing.assert_allclose(poisson(sign * x[..., ::-1]), sign * poisson(x)[..., ::-1], atol=1e-14)


def test_each_environment_its_own_c():
    x = np.random.default_rng(3).normal(size=(4, 2, 3, 6, 5))
    cx, cy = np.array([0.0, 0.1, 0.2, 0.3]), 0.2
    y = Poisson(cx, cy)(x)
    for i in range(4):
        np.testing.assert_allclose(y[i], Poisson(cx[i], cy)(x[i]), atol=1e-15)
    # one frame for four environments
    assert Poisson(cx, cy)(x[0]).shape == (4, 2, 3, 6, 5)
    np.testing.assert_array_equal(Poisson(cx, cy)(x[0])[:, :, 2], np.broadcast_to(x[0, :, 2], (4, 2, 6, 5)))
    with pytest.raises(InvalidValueError, match=r"Poisson: cx of shape \(3,\)"):
        Poisson(cx[:3])(x)


def test_a_grid_needs_no_layout_and_its_pitch_does_not_matter():
    x = np.random.default_rng(4).normal(size=(1, 3, 6, 5))
    grid = TaxelLayout(6, 5, (3e-3, 2e-3))
    np.testing.assert_allclose(Poisson(0.2, 0.1, layout=grid)(x), Poisson(0.2, 0.1)(x), atol=1e-14)


def test_positions_off_the_grid_agree_with_the_grid_where_they_are_one():
    """The grid's taxels, listed in one row in random order, form no grid but give the same values."""
    rng = np.random.default_rng(5)
    grid = TaxelLayout(6, 5, 2e-3)
    order = rng.permutation(30)
    scattered = TaxelLayout(1, 30, 2e-3, grid.positions[order])
    x = rng.normal(size=(2, 3, 6, 5))
    y = Poisson(0.2, 0.1, layout=scattered)(x.reshape(2, 3, 1, 30)[..., order])
    np.testing.assert_allclose(y[..., 0, :], Poisson(0.2, 0.1)(x).reshape(2, 3, 30)[..., order], atol=1e-14)


def test_a_tilted_pad_reads_what_a_flat_one_reads_turned():
    """Turning the whole pad about its x axis turns the forces with it; the taxel frames keep their x axis."""
    rng = np.random.default_rng(6)
    flat = TaxelLayout(4, 5, 2e-3)
    a = 0.4
    turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    tilted = TaxelLayout(4, 5, 2e-3, flat.positions @ turn.T, flat.normals @ turn.T)
    x = rng.normal(size=(2, 3, 4, 5))

    def turned(force):
        return np.einsum("ij,pjrc->pirc", turn, force)

    y = Poisson(0.2, 0.1, layout=tilted)(turned(x))
    np.testing.assert_allclose(y, turned(Poisson(0.2, 0.1)(x)), atol=1e-14)


def test_on_a_fingertip_the_push_lies_in_the_tangent_plane():
    angle = np.linspace(-1, 1, 7)
    normals = np.stack([np.sin(angle), np.zeros(7), -np.cos(angle)], axis=1)
    tip = TaxelLayout(1, 7, (2e-3, 2e-3), 6e-3 * normals, normals)
    x = np.zeros((1, 3, 1, 7))
    x[0, :, 0, 3] = -normals[3]  # 1 N along the middle taxel's normal
    push = (Poisson(0.2, 0.2, layout=tip)(x) - x)[0, :, 0].T
    assert np.abs(push[[2, 4]]).max() > 0.05
    np.testing.assert_allclose(np.sum(push * normals, axis=1), 0, atol=1e-15)
    assert push[4, 0] > 0 > push[2, 0]
    np.testing.assert_allclose(push[4], push[2] * [-1, 1, 1], atol=1e-15)


@needs_torch
@pytest.mark.parametrize("tip", [False, True])
def test_torch_gives_the_same_numbers_compiled_too(tip):
    rng = np.random.default_rng(7)
    normals = [[0, 0.1 * i, -1] for i in range(30)]
    layout = TaxelLayout(6, 5, 2e-3, TaxelLayout(6, 5, 2e-3).positions, normals) if tip else None
    x = rng.normal(size=(4, 2, 3, 6, 5))
    cx = rng.uniform(0.1, 0.3, 4)
    want = Poisson(cx, 0.1, layout=layout)(x)
    poisson, frame = Poisson(torch.from_numpy(cx), 0.1, layout=layout), torch.from_numpy(x)
    np.testing.assert_allclose(poisson(frame).numpy(), want, atol=1e-12)
    compiled = torch.compile(lambda x: poisson(x), fullgraph=True, backend="aot_eager")
    np.testing.assert_allclose(compiled(frame).numpy(), want, atol=1e-12)


@needs_torch
def test_a_constant_made_in_inference_mode_serves_gradients():
    x = torch.ones(2, 3, 3, 7, dtype=torch.float64)
    with torch.inference_mode():
        Poisson(0.2)(x)
    cx = torch.tensor(0.2, dtype=torch.float64, requires_grad=True)
    Poisson(cx)(x).sum().backward()
    Poisson(0.2)(x.requires_grad_()).sum().backward()
    assert x.grad is not None


def test_json_with_a_layout():
    layout = TaxelLayout(1, 3, 2e-3, [[0, 0, 0], [1e-3, 2e-3, 0], [2e-3, 1e-3, 0]])
    chain = Chain([Poisson(np.array([0.1, 0.2]), 0.2, 2.9, 0.5, layout)])
    again = Chain.from_json(chain.to_json())[0]
    assert again.layout == layout
    assert (again.reach, again.falloff, again.cy) == (2.9, 0.5, 0.2)
    np.testing.assert_array_equal(again.cx, [0.1, 0.2])


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"cx": -0.1}, r"Poisson: cx must lie in \[0, inf\]"),
        ({"cy": np.nan}, "Poisson: cy must be finite"),
        ({"reach": 0.5}, "Poisson: reach must be at least 1 pitch"),
        ({"reach": np.inf}, "Poisson: reach"),
        ({"falloff": 0.0}, "Poisson: falloff must be positive"),
    ],
)
def test_bad_parameters(wrong, match):
    with pytest.raises(InvalidValueError, match=match):
        Poisson(**wrong)


def test_a_layout_of_another_size():
    with pytest.raises(InvalidValueError, match="Poisson: layout has 2x2 taxels, the tensor 6x5"):
        Poisson(0.1, layout=TaxelLayout(2, 2, 1e-3))(load())
