"""Encodings, which turn a force tensor into a policy's input, and the history of the last frames."""

import numpy as np
import pytest
from forces import needs_torch, torch

from paxisim import History, InvalidValueError, TaxelLayout, encoding
from paxisim.augment import CentreOfPressure, TaxelBinarization, TaxelDirection
from paxisim.augment.encodings import ENCODINGS

LAYOUT = TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
NAMES = ["NT", "TF", "TB", "TD", "DT", "GCS", "CoP"]


def force(*batch, seed=0):
    return (np.random.default_rng(seed).normal(size=(*batch, 2, 3, 6, 5)) * 0.3).astype(np.float32)


@pytest.fixture(params=["numpy", pytest.param("torch", marks=needs_torch)])
def array(request):
    """Function that converts a numpy array to the kind under test."""
    return np.asarray if request.param == "numpy" else torch.as_tensor


def test_names_shapes_and_histories_are_the_papers():
    assert list(ENCODINGS) == NAMES
    for k in (1, 10):
        shapes = {name: encoding(name, LAYOUT).shape(pads=2, k=k) for name in NAMES}
        images = {name: (channels * k, 6, 5) for name, channels in (("TB", 2), ("TD", 6), ("DT", 6), ("GCS", 6))}
        assert shapes == {"NT": (0,), "TF": (6 * k,), "CoP": (12 * k,)} | images
    lengths = [History(encoding(name, LAYOUT)).k for name in ("TF", "TB", "TD", "DT", "GCS")]
    assert lengths == [1, 10, 10, 10, 20]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("batch", [(), (0,), (2, 3)])
def test_shape_dtype_and_kind(name, batch, array):
    x = array(force(*batch))
    y = encoding(name, LAYOUT).encode(x)
    assert tuple(y.shape) == (*batch, *encoding(name, LAYOUT).shape())
    assert type(y) is type(x)
    assert y.dtype == x.dtype
    np.testing.assert_allclose(np.asarray(y), encoding(name, LAYOUT).encode(force(*batch)), atol=1e-6)


def test_total_force_and_direct_transfer():
    np.testing.assert_allclose(encoding("TF", LAYOUT).encode(force()), force().sum(axis=(-2, -1)).reshape(6), rtol=1e-5)
    for name in ("DT", "GCS"):
        np.testing.assert_array_equal(encoding(name, LAYOUT).encode(force(4)), LAYOUT.to_policy(force(4, 1)))


def test_binarization_and_direction():
    x = np.zeros((2, 3, 6, 5), np.float32)
    x[0, 2, 0, 0] = 0.1  # not above the threshold
    x[0, 2, 0, 1] = 0.11
    x[1, :, 2, 3] = [0.08, -0.08, 0.0]  # 0.113 N of shear
    x[1, :, 5, 4] = [0.1, -0.2, 0.3]
    for kind, touched in (
        (encoding("TB", LAYOUT), [[0, 0, 1], [1, 2, 3], [1, 5, 4]]),
        (TaxelBinarization(LAYOUT, of="normal"), [[0, 0, 1], [1, 5, 4]]),
        (TaxelBinarization(LAYOUT, threshold=0.2), [[1, 5, 4]]),
    ):
        y = kind.encode(x)
        assert np.argwhere(y).tolist() == touched
        assert y.max() == 1
    y = encoding("TD", LAYOUT).encode(x)
    assert [(*place, y[tuple(place)]) for place in np.argwhere(y)] == [(2, 0, 1, 1), (4, 5, 4, -1), (5, 5, 4, 1)]
    assert np.count_nonzero(TaxelDirection(LAYOUT, threshold=0.25).encode(x)) == 1


def test_centre_of_pressure(array):
    x = np.zeros((2, 3, 6, 5), np.float64)
    x[0, 2, 5, 4] = 2.0
    x[0, 0, 1, 1] = 0.5
    x[1, 2] = 0.1
    x[1, 2, 0, 0] = -50  # tension, which does not count
    y = np.asarray(encoding("CoP", LAYOUT).encode(array(x))).reshape(2, 6)
    np.testing.assert_allclose(y[0], [0.5, 0, 2.0, 0.8, 5 / 6, 1])
    np.testing.assert_allclose(y[1], [0, 0, -47.1, 2 * 0.8 / 58, 2 * (5 / 6) / 58 * 1.5, 1], atol=0.02)
    metres = CentreOfPressure(LAYOUT, in_metres=True).encode(x)
    np.testing.assert_allclose(metres[3:5], LAYOUT.positions[-1, :2])
    x = np.zeros((3, 2, 3, 6, 5), np.float32)
    x[1, :, 2], x[2, :, 2] = 1e-38, -1
    y = np.asarray(encoding("CoP", LAYOUT).encode(array(x))).reshape(3, 2, 6)
    assert np.isfinite(y).all()
    assert not y[..., 3:].any(), "without contact: the middle"


def test_centre_of_pressure_of_positions_off_the_grid():
    layout = TaxelLayout(1, 3, 2e-3, [[1e-3, 0, 0], [5e-3, 4e-3, 1e-3], [3e-3, 0, 0]])
    x = np.zeros((1, 3, 1, 3))
    x[0, 2, 0, 1] = 1
    np.testing.assert_allclose(encoding("CoP", layout).encode(x)[3:5], [2 / 3, 2 / 3])


@needs_torch
@pytest.mark.parametrize("name", ["CoP", *(pytest.param(n, marks=pytest.mark.slow) for n in NAMES[:-1])])
def test_encodings_compile(name):
    x = torch.as_tensor(force(4))
    encode = encoding(name, LAYOUT).encode
    compiled = torch.compile(lambda x: encode(x), fullgraph=True, backend="aot_eager")
    np.testing.assert_allclose(compiled(x).numpy(), encode(x).numpy(), atol=1e-6)


def expected(frames, k, fill):
    """Return the policy input of one environment, straight from the definition."""
    first = frames[0] if fill == "first" else np.zeros_like(frames[0])
    return np.concatenate([*[first] * max(0, k - len(frames)), *frames[-k:]])


@pytest.mark.parametrize(("name", "k"), [("TF", 1), ("TF", 3), ("TB", 3), ("GCS", 4)])
@pytest.mark.parametrize("fill", ["first", "zeros"])
def test_history_of_environments_that_reset_apart(name, fill, k, array):
    rng = np.random.default_rng(0)
    e = encoding(name, LAYOUT)
    history = History(e, k, fill=fill)
    episodes = [[] for _ in range(4)]
    for t in range(9):
        mask = rng.random(4) < 0.3
        for one in (mask & [True, True, False, False], mask & [False, False, True, True]):  # resets add up
            if t:
                history.reset(array(one))
        frame = force(4, seed=t)
        history.append(array(frame))
        for i, episode in enumerate(episodes):
            if mask[i]:
                episode.clear()
            episode.append(e.encode(frame[i]))
        done = rng.random(4) < 0.2
        if done.any():  # and begin anew within the same step
            frame = force(4, seed=100 + t)
            history.begin(array(frame), array(done))
            for i in np.flatnonzero(done):
                episodes[i] = [e.encode(frame[i])]
        read = history.read()
        assert tuple(read.shape) == (4, *e.shape(k=k))
        assert isinstance(read, type(array(frame)))
        np.testing.assert_allclose(np.asarray(read), [expected(ep, k, fill) for ep in episodes], atol=1e-6)


def test_history_of_one_environment_is_the_callers_to_keep():
    history = History(encoding("DT", LAYOUT), 2)
    for early_call in (history.read, lambda: history.begin(force(4), np.ones(4, dtype=bool))):
        with pytest.raises(InvalidValueError, match="no frame yet"):
            early_call()
    history.append(force(seed=1))
    early = history.read()
    history.append(force(seed=2))
    np.testing.assert_array_equal(early, LAYOUT.to_policy(np.stack([force(seed=1)] * 2)))
    read = history.read()
    np.testing.assert_array_equal(read, LAYOUT.to_policy(np.stack([force(seed=1), force(seed=2)])))
    read[...] = 7
    assert not (history.read() == 7).any()
    history.reset()
    history.append(force(5, seed=3))  # another batch size
    assert history.read().shape == (5, 12, 6, 5)
    with pytest.raises(InvalidValueError, match=r"expected a frame that encodes to \(5, 6, 6, 5\)"):
        history.append(force(4))


@needs_torch
def test_history_waits_for_no_device():
    """A tensor on the meta device has no values, so reading one would raise."""
    history = History(encoding("GCS", LAYOUT), 3)
    for _ in range(4):
        history.append(torch.empty(4, 2, 3, 6, 5, device="meta"))
        history.reset(torch.empty(4, dtype=torch.bool, device="meta"))
        history.begin(torch.empty(4, 2, 3, 6, 5, device="meta"), torch.empty(4, dtype=torch.bool, device="meta"))
    assert history.read().shape == (4, 18, 6, 5)
