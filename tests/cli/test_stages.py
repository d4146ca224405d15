"""Progress of a long command: one changing line on a terminal, plain lines in a log."""

import io
import re

import pytest

from paxisim.cli import stages
from paxisim.cli.stages import Stages


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


def test_the_time_left_follows_from_the_share(clock):
    log = io.StringIO()
    say = Stages(log)
    clock[0] += 30
    say("searching", 0.25)
    clock[0] += 30
    say("looking", 0.5)
    assert log.getvalue().splitlines() == [
        " 25% searching, about 2 min left",
        " 50% looking, about 60 s left",
    ]


def test_the_share_never_falls(clock):
    log = io.StringIO()
    say = Stages(log)
    say("predicting", 0.6)
    say("searching again", 0.3)
    assert [line[:4] for line in log.getvalue().splitlines()] == [" 60%", " 60%"]


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
    shown = [line.rstrip() for line in re.split("\r", text)]
    assert shown == ["", "  5% a long name of a stage", "  6% short", "", ""]
