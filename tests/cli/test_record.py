"""``paxisim record`` against an emulated board: the file contents, however the recording ends."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

pytest.importorskip("serial")
pytest.importorskip("termios")  # the emulator is a pseudo-terminal

import paxisim
from paxisim.cli import main
from paxisim.errors import InvalidValueError
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.signals import press
from paxisim.logs.mcap_reader import read_log
from paxisim.logs.mcap_writer import LogWriter

PROFILE = "gen3-highspeed-mc-m2020"
RECORD = [sys.executable, "-m", "paxisim.cli", "record"]
DEADLINE = 60.0

pytestmark = [pytest.mark.real_time, pytest.mark.filterwarnings("ignore:.*:UserWarning")]
slow = pytest.mark.slow


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder to work in, with a terminal's handlers of signals.

    Background tests ignore Ctrl-C, and their child processes inherit that.
    """
    monkeypatch.chdir(tmp_path)
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
    before = [signal.signal(number, signal.default_int_handler) for number in numbers]
    yield tmp_path
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.fixture
def board():
    with paxisim.Emulator(PROFILE, press(PROFILE)) as emulator:
        yield emulator


@contextmanager
def recording(board, *words, stdin=subprocess.DEVNULL, command=RECORD):
    """Run ``paxisim record`` with its outputs in files; kill it at the end if it still runs."""
    with open("out.txt", "w") as out, open("err.txt", "w") as err:
        process = subprocess.Popen(
            [*command, board.port, "--profile", PROFILE, "-o", "press.mcap", *words],
            stdin=stdin,
            stdout=out,
            stderr=err,
            start_new_session=True,
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def said(name):
    with open(name) as file:
        return file.read()


def streams():
    """Return the streams that can be read from the file so far, by name."""
    try:
        return read_log("press.mcap").streams
    except (FileNotFoundError, InvalidValueError):  # still empty
        return {}


def wait_for(condition, process, what):
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert process.poll() is None, f"it ended before {what}: {said('err.txt')}"
        assert time.monotonic() < deadline, f"no {what} within {DEADLINE:g} s: {said('err.txt')}"
        time.sleep(0.02)


def has(stream, count=1):
    return lambda: stream in (found := streams()) and len(found[stream].time) >= count


# how it ends


@slow
@pytest.mark.parametrize("delay", [0.2, 1.1])
def test_killed_at_any_moment_it_lacks_the_last_second_at_most(board, delay):
    with recording(board) as process:
        wait_for(has("measured"), process, "frame")
        time.sleep(delay)
        killed = time.time()
        process.kill()
        process.wait()
    log = read_log("press.mcap")
    measured = log.streams["measured"]
    assert not log.complete
    assert len(measured.time) > 10
    assert np.all(np.diff(measured.sequence) == 1)
    # a busy machine delays the recorder, too
    assert killed - measured.time[-1] < 1.0 + 2 * float(np.diff(measured.time).max())


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=slow)])
def test_a_signal_is_an_asked_end_and_a_closed_standard_input_is_not(board, number):
    with recording(board, "--csv", "-", stdin=subprocess.DEVNULL) as process:
        wait_for(has("measured", 50), process, "50 frames")
        process.send_signal(number)
        assert process.wait(DEADLINE) == 0, said("err.txt")
    log = read_log("press.mcap")
    assert log.complete
    line = re.match(
        r"press.mcap: (\d+) frames in [\d.]+ s \(median [\d.]+ Hz\), 1 pad of 3x3 taxels, ", said("out.txt")
    )
    assert int(line[1]) == len(log.streams["measured"].time)
    assert "stdin: 0 samples" in said("out.txt")


def check_that_it_ended_early(says):
    """Check that the last line of the errors says why, and that the file holds the frames that it says."""
    log = read_log("press.mcap")
    measured = log.streams["measured"]
    assert log.complete
    assert np.all(np.diff(measured.sequence) == 1)
    last = said("err.txt").splitlines()[-1]
    match = re.fullmatch(rf"paxisim: error: {says}; press.mcap is valid and holds (\d+) frames in [\d.]+ s", last)
    assert match, last
    assert int(match[1]) == len(measured.time) > 0
    assert f"press.mcap: {match[1]} frames in " in said("out.txt")
    assert "Traceback" not in said("err.txt")


def test_a_port_that_vanishes_is_one_line_and_status_2(board):
    with recording(board, "--reconnect", "0") as process:
        wait_for(has("measured"), process, "frame")
        board.unplug()
        assert process.wait(DEADLINE) == 2
    check_that_it_ended_early("the sensor is gone: .*")


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000))
import paxisim
from paxisim.cli import main
sys.exit(main(["record", *sys.argv[1:]]))
"""


def test_a_file_that_takes_no_more_is_kept_and_status_2(board):
    pytest.importorskip("resource")
    with recording(board, command=[sys.executable, "-c", LIMITED]) as process:
        assert process.wait(DEADLINE) == 2
    check_that_it_ended_early("the file takes no more: .*File too large.*")


@pytest.mark.parametrize("replaced", [True, pytest.param(False, marks=slow)])
def test_a_file_that_is_no_longer_there_is_one_line_and_status_2(board, folder, replaced):
    with recording(board) as process:
        wait_for(has("measured"), process, "frame")
        (folder / "press.mcap").rename("elsewhere.mcap")
        if replaced:
            (folder / "press.mcap").write_text("mine")
        assert process.wait(DEADLINE) == 2
    (line,) = [line for line in said("err.txt").splitlines() if "warning" not in line]
    assert re.match(r"paxisim: error: press.mcap is not there: it was deleted, moved or replaced meanwhile", line), line
    assert said("out.txt") == ""
    assert not replaced or (folder / "press.mcap").read_text() == "mine"
    log = read_log("elsewhere.mcap")
    assert log.complete
    assert len(log.streams["measured"].time) > 0


def test_it_ends_after_the_seconds_asked_for_and_says_what_it_has(board, folder, capsys):
    assert main(["record", board.port, "--profile", PROFILE, "--seconds", "1.2"]) == 0
    out = capsys.readouterr().out
    assert " frames in 1.2 s (" in out
    (made,) = folder.glob("*.mcap")
    assert re.fullmatch(r"paxisim-\d{8}-\d{6}\.mcap", made.name), "without a name it is called after the time"
    assert read_log(made).complete
    assert main(["info", made.name]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("measured "))
    assert float(row.split()[3]) == pytest.approx(float(re.search(r"\(median ([\d.]+) Hz\)", out)[1]), abs=0.11)


def test_what_was_damaged_on_the_line_is_said(capsys):
    with paxisim.Emulator(PROFILE, press(PROFILE), faults=Faults(garble=0.01), seed=1) as board:
        assert main(["record", board.port, "--profile", PROFILE, "-o", "press.mcap", "--seconds", "1"]) == 0
    assert re.search(r"\n  on the line: [1-9]\d* bad checksums", capsys.readouterr().out)


def test_an_existing_file_is_replaced_if_asked_and_nothing_is_left_without_a_frame(board, folder, capsys):
    with LogWriter("press.mcap", {"layout": board.profile.layout, "pads": ["pad"]}) as old:
        old.write("covariate/old", 1.0, 2.0)
    words = ["record", board.port, "--profile", PROFILE, "-o", "press.mcap", "--force"]
    assert main([*words, "--seconds", "0.3"]) == 0
    assert "covariate/old" not in read_log("press.mcap").streams
    assert main([*words, "--seconds", "1e-6"]) == 2
    assert re.search("no frame came from .* in 1e-06 s; nothing was recorded", capsys.readouterr().err)
    assert not (folder / "press.mcap").exists()


def test_two_recorders_do_not_share_a_port(board, folder, capsys):
    """The second reports that the port is in use and makes no file; the recording of the first has no gap."""
    with recording(board) as first:
        wait_for(has("measured", 10), first, "10 frames")
        words = [board.port, "--profile", PROFILE, "-o", "second.mcap", "--seconds", "0.5"]
        assert main(["record", *words]) == 2
        first.send_signal(signal.SIGINT)
        assert first.wait(DEADLINE) == 0, said("err.txt")
    assert capsys.readouterr().err.splitlines()[-1].startswith("paxisim: error: ")
    assert not (folder / "second.mcap").exists()
    log = read_log("press.mcap")
    assert log.complete
    assert np.all(np.diff(log.streams["measured"].sequence) == 1)


# what is recorded beside the frames


def test_lines_datagrams_and_a_function_land_beside_the_frames(board, folder):
    two_hours_late = "import time\n\ndef opening():\n    return {'opening': 0.04, 'time': time.time() - 7200}\n"
    (folder / "robot_for_record.py").write_text(two_hours_late)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    reader, writer = os.pipe()
    words = ["--csv", "-", "--udp", str(port), "--stream", "robot_for_record:opening@100"]
    with (
        recording(board, *words, stdin=reader) as process,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        os.close(reader)
        wait_for(has("measured"), process, "frame")
        os.write(writer, b"time,current\n" + b"%.3f,1.5\n" % time.time() + b"oops\n")
        wanted = {"covariate/current", "covariate/tool", "covariate/opening"}

        def all_there():
            sender.sendto(b'{"tool": 7, "note": "no number"}', ("127.0.0.1", port))
            return wanted <= set(streams())

        wait_for(all_there, process, "sample of each stream")
        process.send_signal(signal.SIGINT)  # while the standard input is still open
        assert process.wait(DEADLINE) == 0, said("err.txt")
    os.close(writer)
    found = read_log("press.mcap").streams
    assert found["covariate/current"].values.tolist() == [1.5]
    assert set(found["covariate/tool"].values) == {7.0}
    assert set(found["covariate/opening"].values) == {0.04}
    assert "stdin: line 3 must have 2 numbers" in said("err.txt")
    assert "stdin: 1 samples, 1 bad" in said("out.txt")
    assert "warning: the times of opening are up to -7200.0 s off this machine's clock" in said("out.txt")
    assert said("out.txt").count("off this machine's clock") == 1
    assert f"UDP {port}: {len(found['covariate/tool'].time)} samples" in said("out.txt")


def test_a_function_that_always_fails_is_one_line_and_status_2(board, folder, capsys):
    (folder / "robot_that_fails.py").write_text("def opening():\n    raise OSError('no robot')\n")
    words = ["--stream", "robot_that_fails:opening@50", "--seconds", "0.5"]
    assert main(["record", board.port, "--profile", PROFILE, "-o", "press.mcap", *words]) == 2
    log = read_log("press.mcap")
    assert log.complete
    frames = len(log.streams["measured"].time)
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.fullmatch(
        "paxisim: error: nothing that could be used came from opening: the call failed: OSError: no robot; "
        rf"press.mcap is valid and holds {frames} frames in [\d.]+ s",
        last,
    ), last


def test_a_terminal_shows_how_it_goes_and_enter_begins_an_episode(board):
    user, terminal = pytest.importorskip("pty").openpty()
    words = [board.port, "--profile", PROFILE, "-o", "press.mcap"]
    process = subprocess.Popen([*RECORD, *words], stdin=terminal, stdout=terminal, stderr=terminal)
    os.close(terminal)
    shown = []

    def read():
        try:
            while data := os.read(user, 4096):
                shown.append(data)
        except OSError:  # Linux raises this once the other side is closed
            pass

    reader = threading.Thread(target=read)
    reader.start()
    try:
        for episode in (1, 2):
            wait_for(has("episode", episode), process, f"episode {episode}")
            os.write(user, b"\n")
        wait_for(has("episode", 3), process, "episode 3")
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE) == 0, shown
    finally:
        process.kill()
        reader.join()
        os.close(user)
    screen = b"".join(shown)
    assert read_log("press.mcap").streams["episode"].values.tolist() == [0, 1, 2]
    assert b"3 episodes" in screen
    assert re.search(rb"\r +[\d.]+ s +[\d.]+ Hz  \d+ frames  0 dropped  [\d.]+ [kM]B  episode \d", screen), screen
