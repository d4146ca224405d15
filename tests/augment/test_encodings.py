import numpy as np
import pytest
from optional import torch

from paxisim.augment.encodings import ENCODINGS, CentreOfPressure, TaxelBinarization, encoding
from paxisim.augment.history import History
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout

LAYOUT = TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
NAMES = ["NT", "TF", "TB", "TD", "DT", "GCS", "CoP"]
KINDS = ["numpy", pytest.param("torch", marks=pytest.mark.skipif(torch is None, reason="needs torch"))]


def force(*batch, seed=0):
    return (np.random.default_rng(seed).normal(size=(*batch, 2, 3, 6, 5)) * 0.3).astype(np.float32)


@pytest.fixture(params=KINDS)
def array(request):
    """Function that converts a numpy array to the kind under test."""
    return np.asarray if request.param == "numpy" else torch.as_tensor


def test_the_names_are_the_papers():
    assert list(ENCODINGS) == NAMES
    with pytest.raises(UnknownNameError, match="unknown encoding 'COP'; did you mean 'CoP'"):
        encoding("COP", LAYOUT)


@pytest.mark.parametrize("k", [1, 10])
def test_shapes_of_policy_inputs_are_the_papers(k):
    shapes = {name: encoding(name, LAYOUT).shape(pads=2, k=k) for name in NAMES}
    image = (6, 5)
    assert shapes == {
        "NT": (0,),
        "TF": (6 * k,),
        "TB": (2 * k, *image),
        "TD": (6 * k, *image),
        "DT": (6 * k, *image),
        "GCS": (6 * k, *image),
        "CoP": (12 * k,),
    }
    assert {name: ENCODINGS[name].paper_history for name in NAMES if name not in ("NT", "CoP")} == {
        "TF": 1,
        "TB": 10,
        "TD": 10,
        "DT": 10,
        "GCS": 20,
    }


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("batch", [(), (4,), (0,), (2, 3)])
def test_shape_dtype_and_kind(name, batch, array):
    x = array(force(*batch))
    y = encoding(name, LAYOUT).encode(x)
    assert tuple(y.shape) == (*batch, *encoding(name, LAYOUT).shape())
    assert type(y) is type(x)
    assert y.dtype == x.dtype
    np.testing.assert_allclose(np.asarray(y), encoding(name, LAYOUT).encode(force(*batch)), atol=1e-6)


def test_total_force():
    np.testing.assert_allclose(encoding("TF", LAYOUT).encode(force()), force().sum(axis=(-2, -1)).reshape(6), rtol=1e-5)


def test_binarization(array):
    x = np.zeros((2, 3, 6, 5), np.float32)
    x[0, 2, 0, 0] = 0.1  # not above the threshold
    x[0, 2, 0, 1] = 0.11
    x[1, :, 2, 3] = [0.08, -0.08, 0.0]  # 0.113 N of shear
    y = np.asarray(encoding("TB", LAYOUT).encode(array(x)))
    assert set(zip(*np.nonzero(y), strict=True)) == {(0, 0, 1), (1, 2, 3)}
    assert set(np.unique(y)) == {0, 1}
    y = TaxelBinarization(LAYOUT, of="normal").encode(x)
    assert set(zip(*np.nonzero(y), strict=True)) == {(0, 0, 1)}
    assert not TaxelBinarization(LAYOUT, threshold=0.2).encode(x).any()
    with pytest.raises(InvalidValueError, match="of must be"):
        TaxelBinarization(LAYOUT, of="z")  # type: ignore[arg-type]


def test_direction(array):
    x = np.zeros((2, 3, 6, 5), np.float32)
    x[1, :, 2, 3] = [0.1, -0.2, 0.3]
    y = np.asarray(encoding("TD", LAYOUT).encode(array(x)))
    np.testing.assert_array_equal(y[3:, 2, 3], [0, -1, 1])
    assert np.abs(y).sum() == 2


def test_direct_transfer_is_the_policys_layout():
    np.testing.assert_array_equal(encoding("DT", LAYOUT).encode(force(4)), LAYOUT.to_policy(force(4, 1)))


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


def test_centre_of_pressure_is_finite_and_central_without_contact(array):
    x = np.zeros((3, 2, 3, 6, 5), np.float32)
    x[1, :, 2] = 1e-38
    x[2, :, 2] = -1
    y = np.asarray(encoding("CoP", LAYOUT).encode(array(x))).reshape(3, 2, 6)
    assert np.isfinite(y).all()
    assert not y[..., 3:].any()


def test_centre_of_pressure_of_positions_off_the_grid():
    layout = TaxelLayout(1, 3, 2e-3, [[1e-3, 0, 0], [5e-3, 4e-3, 1e-3], [3e-3, 0, 0]])
    x = np.zeros((1, 3, 1, 3))
    x[0, 2, 0, 1] = 1
    np.testing.assert_allclose(encoding("CoP", layout).encode(x)[3:5], [2 / 3, 2 / 3])


@pytest.mark.skipif(torch is None, reason="needs torch")
@pytest.mark.parametrize("name", NAMES)
def test_encodings_compile(name):
    x = torch.as_tensor(force(4))
    encode = encoding(name, LAYOUT).encode
    compiled = torch.compile(lambda x: encode(x), fullgraph=True, backend="aot_eager")
    np.testing.assert_allclose(compiled(x).numpy(), encode(x).numpy(), atol=1e-6)


@pytest.mark.parametrize("wrong", [np.zeros((3, 6, 5)), np.zeros((2, 3, 5, 6)), np.zeros((2, 3, 6, 5), int)])
def test_bad_frames(wrong):
    with pytest.raises(InvalidValueError, match="expected a"):
        encoding("TF", LAYOUT).encode(wrong)


def expected(frames, k, fill):
    """Return the policy input of one environment, straight from the definition."""
    first = frames[0] if fill == "first" else np.zeros_like(frames[0])
    return np.concatenate([*[first] * max(0, k - len(frames)), *frames[-k:]])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fill", ["first", "zeros"])
@pytest.mark.parametrize("k", [1, 3])
def test_history_of_environments_that_reset_apart(name, fill, k, array):
    rng = np.random.default_rng(0)
    e = encoding(name, LAYOUT)
    history = History(e, k, fill=fill)
    episodes = [[] for _ in range(4)]
    for t in range(9):
        mask = rng.random(4) < 0.3
        if t:
            history.reset(array(mask))
        frame = force(4, seed=t)
        history.append(array(frame))
        for i, episode in enumerate(episodes):
            if mask[i]:
                episode.clear()
            episode.append(e.encode(frame[i]))
        read = history.read()
        assert tuple(read.shape) == (4, *e.shape(k=k))
        assert isinstance(read, type(array(frame)))
        np.testing.assert_allclose(np.asarray(read), [expected(ep, k, fill) for ep in episodes], atol=1e-6)


def test_history_of_one_environment():
    history = History(encoding("DT", LAYOUT), 2)
    with pytest.raises(InvalidValueError, match="no frame yet"):
        history.read()
    history.append(force(seed=1))
    history.append(force(seed=2))
    np.testing.assert_array_equal(history.read(), LAYOUT.to_policy(np.stack([force(seed=1), force(seed=2)])))
    history.reset()
    history.append(force(5, seed=3))  # another batch size
    assert history.read().shape == (5, 12, 6, 5)
    with pytest.raises(InvalidValueError, match=r"History: expected a frame that encodes to \(5, 6, 6, 5\)"):
        history.append(force(4))


def test_what_is_read_is_the_callers():
    history = History(encoding("DT", LAYOUT), 3)
    history.append(force(seed=1))
    read = history.read()
    kept = read.copy()
    history.append(force(seed=2))
    np.testing.assert_array_equal(read, kept)
    read[...] = 7
    assert not (history.read() == 7).any()


def test_two_resets_before_a_frame_add_up():
    history = History(encoding("TF", LAYOUT), 2)
    history.append(force(3, seed=1))
    history.reset([True, False, False])
    history.reset(np.array([False, True, False]))
    history.append(force(3, seed=2))
    new = encoding("TF", LAYOUT).encode(force(3, seed=2))
    read = history.read().reshape(3, 2, 6)
    np.testing.assert_array_equal(read[:2, 0], new[:2])
    np.testing.assert_array_equal(read[2, 0], encoding("TF", LAYOUT).encode(force(3, seed=1))[2])


def test_the_default_length_is_the_papers():
    assert History(encoding("GCS", LAYOUT)).k == 20
    for wrong in (0, 1.5):
        with pytest.raises(InvalidValueError, match="k must be"):
            History(encoding("GCS", LAYOUT), wrong)
    with pytest.raises(InvalidValueError, match="fill must be"):
        History(encoding("GCS", LAYOUT), fill="ones")  # type: ignore[arg-type]


@pytest.mark.skipif(torch is None, reason="needs torch")
def test_history_waits_for_no_device():
    """A tensor on the meta device has no values, so reading one would raise."""
    history = History(encoding("GCS", LAYOUT), 3)
    for _ in range(4):
        history.append(torch.empty(4, 2, 3, 6, 5, device="meta"))
        history.reset(torch.empty(4, dtype=torch.bool, device="meta"))
    assert history.read().shape == (4, 18, 6, 5)
