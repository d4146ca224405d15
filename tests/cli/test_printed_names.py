"""Names in a file are plain text: no verb prints escape sequences from them."""

import numpy as np
import pytest

from paxisim.cli import main
from paxisim.cli.output import printable
from paxisim.recording import Recording

EVIL = "\x1b[2J\x1b]0;owned\x07\u202e\r\x9b31m"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.npz"
    rng = np.random.default_rng(0)
    covariates = {"opening" + EVIL: np.arange(20.0)}
    force = rng.normal(size=(20, 1, 3, 2, 2))
    metadata = {"sensor": EVIL, EVIL: 3}
    Recording(np.arange(20.0), force, force, covariates, pads=("left" + EVIL,), metadata=metadata).save(path)
    return path


def said(capsys):
    out, err = capsys.readouterr()
    assert not set("\x1b\x07\u202e\r\x9b") & set(out + err)
    return out + err


@pytest.mark.parametrize("suffix", ["npz", "mcap"])
def test_no_verb_prints_an_escape_sequence(file, suffix, tmp_path, capsys):
    path = tmp_path / f"b.{suffix}"
    assert main(["convert", str(file), str(path)]) == 0
    assert "\\x1b[2J" in said(capsys)
    assert main(["info", str(path)]) == 0
    assert "\\x1b[2J" in said(capsys)
    assert main(["convert", str(path), str(tmp_path / "c.npz"), "--pads", "right"]) == 2
    assert "\\x1b[2J" in said(capsys)
    assert main(["info", str(tmp_path / f"none{EVIL}.npz")]) == 2
    assert "\\x1b[2J" in said(capsys)


def test_what_is_printable_stays_as_it_is():
    assert printable("Kraft 3 °C µT\n\tπ 力") == "Kraft 3 °C µT\n\tπ 力"
    assert printable("a\x1bb\udc80") == "a\\x1bb\\udc80"
