"""Output on a terminal and in a log: progress of a long command, and names from files without escape sequences."""

import io

import numpy as np
import pytest

from paxisim.cli import main, stages
from paxisim.cli.output import printable
from paxisim.cli.stages import Stages
from paxisim.recording import Recording

EVIL = "\x1b[2J\x1b]0;owned\x07\u202e\r\x9b31m"


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """A monotonic clock (s) that the test advances."""
    now = [100.0]
    monkeypatch.setattr(stages.time, "monotonic", lambda: now[0])
    return now


def test_a_log_has_a_line_for_each_stage_and_few_within_one(clock):
    log = io.StringIO()
    with Stages(log) as say:
        say("reading", 0.0)
        for step in range(100):
            clock[0] += 0.3
            say("searching", 0.1 + 0.004 * step)
    lines = log.getvalue().splitlines()
    assert lines[0] == "  0% reading"
    assert lines[1].startswith(" 10% searching, about ")
    assert 3 <= len(lines) <= 5  # 30 s with one line every 10 s


def test_the_time_left_follows_from_the_share_which_never_falls(clock):
    log = io.StringIO()
    say = Stages(log)
    for stage, share in (("searching", 0.25), ("looking", 0.5), ("looking again", 0.3)):
        clock[0] += 30
        say(stage, share)
    assert log.getvalue().splitlines() == [
        " 25% searching, about 2 min left",
        " 50% looking, about 60 s left",
        " 50% looking again, about 2 min left",
    ]


def test_a_terminal_has_one_line_that_is_cleared(clock):
    terminal = Terminal()
    with Stages(terminal) as say:
        say("a long name of a stage", 0.05)
        clock[0] += 1
        say("short", 0.06)
        clock[0] += 0.01
        say("short", 0.07)  # too soon
    text = terminal.getvalue()
    assert "\n" not in text
    assert [line.rstrip() for line in text.split("\r")] == ["", "  5% a long name of a stage", "  6% short", "", ""]


@pytest.mark.parametrize("suffix", ["npz", "mcap"])
def test_no_verb_prints_an_escape_sequence_from_a_file(suffix, tmp_path, capsys):
    covariates = {"opening" + EVIL: np.arange(20.0)}
    force = np.random.default_rng(0).normal(size=(20, 1, 3, 2, 2))
    metadata = {"sensor": EVIL, EVIL: 3}
    recording = Recording(np.arange(20.0), force, force, covariates, pads=("left" + EVIL,), metadata=metadata)
    recording.save(tmp_path / "a.npz")
    path = tmp_path / f"b.{suffix}"
    for words, status in [
        (["convert", str(tmp_path / "a.npz"), str(path)], 0),
        (["info", str(path)], 0),
        (["convert", str(path), str(tmp_path / "c.npz"), "--pads", "right"], 2),
        (["info", str(tmp_path / f"none{EVIL}.npz")], 2),
    ]:
        assert main(words) == status
        said = "".join(capsys.readouterr())
        assert not set("\x1b\x07\u202e\r\x9b") & set(said)
        assert "\\x1b[2J" in said


def test_what_is_printable_stays_as_it_is():
    assert printable("Kraft 3 °C µT\n\tπ 力") == "Kraft 3 °C µT\n\tπ 力"
    assert printable("a\x1bb\udc80") == "a\\x1bb\\udc80"
