"""``paxisim record`` as a process against an emulated board: the file contents, however the process ends."""

import os
import random
import re
import shutil
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

from paxisim.cli import main
from paxisim.errors import InvalidValueError
from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.signals import press
from paxisim.logs.mcap_reader import read_log
from paxisim.logs.mcap_writer import LogWriter

PROFILE = "gen3-highspeed-mc-m2020"
RECORD = [sys.executable, "-m", "paxisim.cli", "record"]
DEADLINE = 60.0

pytestmark = [pytest.mark.real_time, pytest.mark.filterwarnings("ignore:.*:UserWarning")]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def signals():
    """Restore the handlers of a terminal: background tests ignore Ctrl-C, and their child processes inherit that."""
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
    before = [signal.signal(number, signal.default_int_handler) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.fixture
def board():
    with Emulator(PROFILE, press(PROFILE)) as emulator:
        yield emulator


@contextmanager
def recording(board, *words, output="press.mcap", stdin=subprocess.DEVNULL, command=RECORD):
    """Run ``paxisim record`` with its outputs in files; kill it at the end if it still runs."""
    with open("out.txt", "w") as out, open("err.txt", "w") as err:
        process = subprocess.Popen(
            [*command, board.port, "--profile", PROFILE, "-o", output, *words],
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


class Scheduling:
    """Measure how late this machine wakes a thread after a 10 ms wait: the longest interval (s) while this runs."""

    def __enter__(self):
        self.longest, self._stop = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()

    def _watch(self):
        last = time.monotonic()
        while not self._stop.wait(0.01):
            now = time.monotonic()
            self.longest, last = max(self.longest, now - last), now


@pytest.mark.parametrize("attempt", range(2))
def test_killed_at_any_moment_it_lacks_the_last_second_at_most(board, attempt):
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    with Scheduling() as machine, recording(board) as process:
        wait_for(has("measured"), process, "frame")
        time.sleep(random.Random(seed).uniform(0, 1.5))
        killed = time.time()
        process.kill()
        process.wait()
    log = read_log("press.mcap")
    measured = log.streams["measured"]
    assert not log.complete
    assert len(measured.time) > 10
    assert np.all(np.diff(measured.sequence) == 1)
    # a busy machine may also delay the recorder
    busy = machine.longest + float(np.diff(measured.time).max())
    assert killed - measured.time[-1] < 1.0 + busy


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_an_asked_end(board, number):
    with recording(board) as process:
        wait_for(has("measured"), process, "frame")
        process.send_signal(number)
        assert process.wait(DEADLINE) == 0, said("err.txt")
    log = read_log("press.mcap")
    assert log.complete
    line = re.match(
        r"press.mcap: (\d+) frames in [\d.]+ s \(median [\d.]+ Hz\), 1 pad of 3x3 taxels, ", said("out.txt")
    )
    assert int(line[1]) == len(log.streams["measured"].time)


def test_it_ends_after_the_seconds_asked_for_and_says_what_it_has(board):
    with recording(board, "--seconds", "0.7") as process:
        assert process.wait(DEADLINE) == 0, said("err.txt")
    assert " frames in 0.7 s (" in said("out.txt")
    measured = read_log("press.mcap").streams["measured"]
    assert len(measured.time) > 0


def test_what_was_damaged_on_the_line_is_said(capsys):
    with Emulator(PROFILE, press(PROFILE), faults=Faults(garble=0.01), seed=1) as board:
        assert main(["record", board.port, "--profile", PROFILE, "-o", "press.mcap", "--seconds", "1"]) == 0
    assert re.search(r"\n  on the line: [1-9]\d* bad checksums", capsys.readouterr().out)


def test_a_port_that_vanishes_is_one_line_and_status_2(board):
    with recording(board, "--reconnect", "0") as process:
        wait_for(has("measured"), process, "frame")
        board.unplug()
        assert process.wait(DEADLINE) == 2
    log = read_log("press.mcap")
    assert log.complete
    last = said("err.txt").splitlines()[-1]
    frames = len(log.streams["measured"].time)
    assert re.fullmatch(
        rf"paxisim: error: the sensor is gone: .*; press.mcap is valid and holds {frames} frames in [\d.]+ s", last
    )
    assert "Traceback" not in said("err.txt")


def limited(size):
    """Return the command for a process that may not write a file of more than `size` bytes."""
    code = f"""
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))
from paxisim.cli import main
sys.exit(main(["record", *sys.argv[1:]]))
"""
    return [sys.executable, "-c", code]


def check_that_the_file_took_no_more(says, path="press.mcap"):
    measured = read_log(path).streams["measured"]
    assert len(measured.time) > 0
    assert np.all(np.diff(measured.sequence) == 1)
    last = said("err.txt").splitlines()[-1]
    match = re.match(
        rf"paxisim: error: the file takes no more: .*{says}.*; {path} is valid and holds (\d+) frames", last
    )
    assert match, last
    assert int(match[1]) == len(measured.time)
    assert f"{path}: {match[1]} frames in " in said("out.txt")
    assert "Traceback" not in said("err.txt")


def test_a_file_that_takes_no_more_is_kept_and_status_2(board):
    pytest.importorskip("resource")
    with recording(board, command=limited(12_000)) as process:
        assert process.wait(DEADLINE) == 2
    check_that_the_file_took_no_more("File too large")


def test_a_full_disk_is_one_line_and_status_2(board, folder):
    disk = folder / "disk"
    disk.mkdir()
    mount = [shutil.which("mount") or "false", "-t", "tmpfs", "-o", "size=12k", "tmpfs", disk]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("needs to mount a file system")
    try:
        with recording(board, output="disk/press.mcap") as process:
            assert process.wait(DEADLINE) == 2
        check_that_the_file_took_no_more("No space left", "disk/press.mcap")
    finally:
        subprocess.run(["umount", disk], check=True)


@pytest.mark.parametrize("what", ["deleted", "moved", "replaced"])
def test_a_file_that_is_no_longer_there_is_one_line_and_status_2(board, folder, what):
    with recording(board) as process:
        wait_for(has("measured"), process, "frame")
        if what == "deleted":
            (folder / "press.mcap").unlink()
        else:
            (folder / "press.mcap").rename("elsewhere.mcap")
        if what == "replaced":
            (folder / "press.mcap").write_text("mine")
        assert process.wait(DEADLINE) == 2
    (line,) = [line for line in said("err.txt").splitlines() if "warning" not in line]
    assert re.match(r"paxisim: error: press.mcap is not there: it was deleted, moved or replaced meanwhile", line), line
    assert said("out.txt") == ""
    if what != "deleted":
        log = read_log("elsewhere.mcap")
        assert log.complete
        assert len(log.streams["measured"].time) > 0


def test_a_function_that_always_fails_is_one_line_and_status_2(board, folder):
    (folder / "robot_that_fails.py").write_text("def opening():\n    raise OSError('no robot')\n")
    words = ["--stream", "robot_that_fails:opening@50", "--seconds", "0.8"]
    with recording(board, *words) as process:
        assert process.wait(DEADLINE) == 2
    log = read_log("press.mcap")
    assert log.complete
    frames = len(log.streams["measured"].time)
    last = said("err.txt").splitlines()[-1]
    assert re.fullmatch(
        "paxisim: error: nothing that could be used came from opening: the call failed: OSError: no robot; "
        rf"press.mcap is valid and holds {frames} frames in [\d.]+ s",
        last,
    ), last


def test_info_and_record_agree_on_the_rate(board, capsys):
    assert main(["record", board.port, "--profile", PROFILE, "-o", "press.mcap", "--seconds", "1.5"]) == 0
    rate = float(re.search(r"\(median ([\d.]+) Hz\)", capsys.readouterr().out)[1])
    assert main(["info", "press.mcap"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("measured "))
    assert float(row.split()[3]) == pytest.approx(rate, abs=0.11)


def test_two_recorders_do_not_share_a_port(board, folder):
    """The second reports that the port is in use and makes no file; the recording of the first has no gap."""
    with recording(board) as first:
        wait_for(has("measured", 10), first, "10 frames")
        words = [board.port, "--profile", PROFILE, "-o", "second.mcap", "--seconds", "0.5"]
        second = subprocess.run([*RECORD, *words], capture_output=True, text=True, check=False)
        first.send_signal(signal.SIGINT)
        assert first.wait(DEADLINE) == 0, said("err.txt")
    assert second.returncode == 2
    assert second.stderr.splitlines()[-1].startswith("paxisim: error: ")
    assert "Traceback" not in second.stderr
    assert not (folder / "second.mcap").exists()
    log = read_log("press.mcap")
    assert log.complete
    assert np.all(np.diff(log.streams["measured"].sequence) == 1)


INTERRUPTED = """
import runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "tyro":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
runpy.run_module("paxisim", run_name="__main__")
"""


def test_ctrl_c_while_it_loads_is_one_line():
    run = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr, run.stdout) == (130, "paxisim: interrupted\n", "")


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


def test_a_closed_standard_input_ends_only_its_stream(board):
    with recording(board, "--csv", "-", stdin=subprocess.DEVNULL) as process:
        wait_for(has("measured", 50), process, "50 frames")
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE) == 0, said("err.txt")
    assert "stdin: 0 samples" in said("out.txt")


def test_enter_on_a_terminal_begins_an_episode(board):
    user, terminal = pytest.importorskip("pty").openpty()
    with recording(board, stdin=terminal) as process:
        for episode in (1, 2):
            wait_for(has("episode", episode), process, f"episode {episode}")
            os.write(user, b"\n")
        wait_for(has("episode", 3), process, "episode 3")
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE) == 0, said("err.txt")
    os.close(user)
    os.close(terminal)
    assert read_log("press.mcap").streams["episode"].values.tolist() == [0, 1, 2]
    assert "3 episodes" in said("out.txt")


def test_a_terminal_shows_how_it_goes(board):
    user, terminal = pytest.importorskip("pty").openpty()
    shown = b""
    process = subprocess.Popen(
        [*RECORD, board.port, "--profile", PROFILE, "-o", "press.mcap", "--seconds", "1.5"],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
    )
    os.close(terminal)
    try:
        while data := os.read(user, 4096):
            shown += data
    except OSError:  # Linux raises this once the other side is closed
        pass
    os.close(user)
    assert process.wait(DEADLINE) == 0, shown
    assert re.search(rb"\r +[\d.]+ s +[\d.]+ Hz  \d+ frames  0 dropped  [\d.]+ [kM]B  episode 0", shown), shown


def test_an_existing_file_is_replaced_only_if_asked_and_only_by_a_sensor_that_answers(board, folder, capsys):
    with LogWriter("press.mcap", {"layout": board.profile.layout, "pads": ["pad"]}) as old:
        old.write("covariate/old", 1.0, 2.0)
    before = (folder / "press.mcap").read_bytes()
    words = ["--profile", PROFILE, "-o", "press.mcap", "--seconds", "0.3"]
    assert main(["record", board.port, *words]) == 2
    assert "press.mcap exists; --force overwrites it" in capsys.readouterr().err
    assert main(["record", "/dev/no-such-port", *words, "--force"]) == 2
    assert "/dev/no-such-port" in capsys.readouterr().err
    assert (folder / "press.mcap").read_bytes() == before
    assert main(["record", board.port, *words, "--force"]) == 0
    assert "covariate/old" not in read_log("press.mcap").streams


def test_without_a_name_the_file_is_called_after_the_time(board, folder):
    assert main(["record", board.port, "--profile", PROFILE, "--seconds", "0.3"]) == 0
    (made,) = folder.glob("*.mcap")
    assert re.fullmatch(r"paxisim-\d{8}-\d{6}\.mcap", made.name)
    assert read_log(made).complete


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "expected the serial port"),
        (["nowhere", "--seconds", "0"], "--seconds must be more than 0, got 0"),
        (["nowhere", "--seconds", "nan"], "--seconds must be more than 0, got nan"),
        (["nowhere", "-o", "/proc/a.mcap"], "cannot write /proc/a.mcap|folder does not exist"),
        (["PORT", "--seconds", "1e-6"], "no frame came from .* in 1e-06 s; nothing was recorded"),
        (["PORT", "--reconnect", "-1"], "reconnect must be"),
        (["PORT", "-o", "press.csv"], "must end in .mcap, got press.csv"),
        (["PORT", "-o", "no/such/folder/press.mcap"], "folder does not exist"),
        (["PORT", "--udp", "70000"], "udp must be a port number"),
        (["PORT", "--csv", "file.csv"], "--csv"),
        (["PORT", "--stream", "no_such_module_x:f@5"], "cannot import 'no_such_module_x'"),
        (["PORT", "--stream", "time:time"], "module:function@HZ"),
        (["/dev/no-such-port"], "/dev/no-such-port"),
    ],
)
def test_bad_input_is_one_line_status_2_and_no_file(board, words, says, capsys, folder):
    words = [board.port if word == "PORT" else word for word in words]
    assert main(["record", "--profile", PROFILE, *words]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if "warning" not in line]
    assert len(errors) == 1
    assert re.search(says, errors[0]), errors[0]
    assert list(folder.iterdir()) == []
