"""Archives of numpy: made by hand, made wrongly, and damaged."""

import numpy as np
import pytest
from log_files import recording

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

GOOD = {"time": np.arange(5.0), "measured": np.zeros((5, 1, 3, 2, 2))}
WRONG = [
    ({"measured": np.zeros(5)}, "measured must have shape"),
    ({"measured": np.float64(3)}, "measured must have shape"),
    ({"measured": np.full((5, 1, 3, 2, 2), "x")}, "measured must be an array of numbers"),
    ({"measured": np.full((5, 1, 3, 2, 2), np.inf)}, "'measured' holds an infinite value"),
    ({"time": np.arange(4.0)}, "measured has 5 samples, time has 4"),
    ({"time": np.full(5, np.nan)}, "time must be finite"),
    ({"simulated": np.zeros((5, 2, 3, 2, 2))}, "measured and simulated must have one shape"),
    ({"covariate/opening": np.zeros(3)}, "covariates.* must have shape .* to match time"),
    ({"covariate/resultant": np.float64(2)}, "covariates.* must have shape"),
    ({"about": np.array("[1]")}, "'about' must be a JSON object"),
    ({"about": np.array('{"pads": 3}')}, "'about' must be a JSON object"),
    ({"about": np.array('{"metadata": []}')}, "'about' must be a JSON object"),
    ({"about": np.array('{"layout": 3}')}, "'layout' in 'about': expected an object"),
    ({"about": np.array('{"layout": {"rows": 2}}')}, "'layout' in 'about': expected the fields"),
]


def test_an_archive_made_by_hand(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **GOOD, **{"covariate/opening": np.arange(5)})
    assert Recording.load(path).covariates["opening"].tolist() == [0, 1, 2, 3, 4]
    np.savez(path, time=np.arange(3), forces=np.zeros(3))
    with pytest.raises(InvalidValueError, match="got time, forces"):
        Recording.load(path)


@pytest.mark.parametrize("options", [{}, {"missing": "drop"}, {"pads": "pad0"}])
def test_an_archive_made_by_hand_wrongly_is_refused_by_name(tmp_path, options):
    path = tmp_path / "a.npz"
    for changed, word in WRONG:
        np.savez(path, **{**GOOD, **changed})
        with pytest.raises(InvalidValueError, match=f"a.npz: {word}"):
            Recording.load(path, **options)


def test_a_damaged_archive_is_called_so(tmp_path):
    path = tmp_path / "a.npz"
    recording().save(path)
    data = path.read_bytes()
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, time=np.array([object()]), allow_pickle=True)
    for content in (b"", b"abc", data[:200], data[:-30], b"{}", pickled.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(InvalidValueError, match="not a complete npz file"):
            Recording.load(path)
