"""Recordings keep their unit, and functions that need newtons reject other units."""

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.hw.commissioning.quality import measure_quality
from paxisim.hw.emulation.signals import from_recording
from paxisim.hw.frame import Frame
from paxisim.hw.profiles.load import load_profile


def field(unit="uT", **metadata):
    force = np.linspace(0, 300, 5 * 15, dtype=np.float32).reshape(5, 1, 3, 1, 5)
    metadata = metadata if unit is None else {"unit": unit, **metadata}
    return paxisim.Recording(np.arange(5) / 100, measured=force, metadata=metadata)


def test_a_recording_is_in_newtons_unless_it_says_otherwise():
    assert field(None).unit == "N"
    assert field().unit == "uT"
    assert "uT" in repr(field())
    assert "uT" not in repr(field(None))


@pytest.mark.parametrize("suffix", [".mcap", ".npz"])
def test_a_file_keeps_the_unit(suffix, tmp_path):
    field().save(path := tmp_path / f"field{suffix}")
    assert paxisim.Recording.load(path).unit == "uT"


@pytest.mark.parametrize("suffix", [".mcap", ".npz"])
def test_a_unit_that_is_no_text_is_refused(suffix, tmp_path):
    field(3).save(path := tmp_path / f"field{suffix}")
    with pytest.raises(paxisim.InvalidValueError, match="unit in its metadata must be a text"):
        paxisim.Recording.load(path)


def test_recordings_of_different_units_are_not_joined():
    with pytest.raises(paxisim.InvalidValueError, match=r"different units .* uT, number 1 .* in N"):
        paxisim.Recording.concatenate([field(), field(None)])
    assert paxisim.Recording.concatenate([field(), field()]).unit == "uT"


def test_a_field_is_not_felt_as_newtons():
    profile = load_profile("gen1-box-ip-s2516")
    with pytest.raises(paxisim.InvalidValueError, match=r"in uT, but profile 'gen1-box-ip-s2516' feels N"):
        from_recording(field(), profile)


def test_info_prints_the_unit(tmp_path, capsys):
    field().save(path := tmp_path / "field.mcap")
    assert main(["info", str(path)]) == 0
    assert "measured (uT a taxel)" in capsys.readouterr().out


def test_quality_prints_the_unit_of_its_frames():
    rng = np.random.default_rng(0)
    layout = paxisim.TaxelLayout(1, 5, (1e-2, 1e-2))
    frames = [
        Frame(rng.normal(0, 1, (1, 3, 1, 5)).astype(np.float32), i / 100, i / 100, i, (0,), unit="uT")
        for i in range(100)
    ]
    table = str(measure_quality(frames, layout, ("skin",)))
    assert " uT" in table
    assert "uT/min" in table
    assert " N " not in table
