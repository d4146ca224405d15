"""The ``paxisim record`` command."""

from __future__ import annotations

import shutil
import sys
from contextlib import ExitStack, suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.calibrated import load_calibration
from paxisim.cli.output import check_output, printable, size_text
from paxisim.errors import InvalidValueError, PaxisimError
from paxisim.hw.capture.extra_streams import ENTER_KEY, MAX_CLOCK_OFF

if TYPE_CHECKING:
    from paxisim.hw.capture.capture import CaptureSummary


def record(
    port: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PORT...")],
    /,
    *,
    profile: str,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    seconds: float | None = None,
    reconnect: float = 10.0,
    calibration: Path | None = None,
    covariates: str | None = None,
    csv: Annotated[Literal["-"] | None, tyro.conf.arg(metavar="-")] = None,
    udp: tyro.conf.UseAppendAction[tuple[int, ...]] = (),
    stream: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    force: bool = False,
) -> None:
    """Record a sensor, and other streams with it, to an MCAP file.

    Samples are written as they arrive: after a crash, the file can still be read and misses at most the last second.
    Press Ctrl-C to stop. On a terminal, press Enter to begin a new episode.

    For example:

    paxisim record /dev/ttyACM0 --profile gen2-box-120 --seconds 30 -o press.mcap

    my_robot | paxisim record /dev/ttyACM0 --profile gen2-box-120 -o press.mcap --csv -

    Args:
        port: Serial port of the sensor; several ports are combined into one tensor.
        profile: Profile of the sensor: a name or a TOML file.
        output: Output file; default: paxisim-DATE-TIME.mcap.
        seconds: Duration in seconds; default: until Ctrl-C.
        reconnect: Seconds to wait for a port that has disappeared.
        calibration: Calibration or background of `paxisim calibrate`, for a sensor that does not measure newtons.
        covariates: Python function that returns the present values on which the background depends, by name, such as
            {"opening": 0.04}, as module:function.
        csv: With '-', also record numbers from standard input: a line of column names, then one line per sample.
            A column 'time' holds Unix seconds. Without it, samples get their time of arrival, so flush each line.
        udp: UDP port on 127.0.0.1; record the JSON objects of numbers that arrive there, such as {"gripper": 0.04}.
            A key 'time' holds Unix seconds.
        stream: Python function to call at a fixed rate and record, as module:function@HZ.
        force: Overwrite the output if it exists. Nothing is overwritten until the sensor is open.
    """
    from paxisim.hw.capture.capture import capture
    from paxisim.hw.device import open_sensor

    if not port:
        raise InvalidValueError("expected the serial port of the sensor, e.g. /dev/ttyACM0")
    if seconds is not None and not 0 < seconds < float("inf"):
        raise InvalidValueError(f"--seconds must be more than 0, got {seconds:g}")
    path = Path(f"paxisim-{datetime.now():%Y%m%d-%H%M%S}.mcap") if output is None else output
    check_output(path, force)
    if path.suffix != ".mcap":
        raise InvalidValueError(f"the output must end in .mcap, got {path}; paxisim convert writes other formats")
    with ExitStack() as open_things:
        extra = []
        for source in _sources(csv is not None, udp, stream):
            open_things.callback(source.close)
            extra.append(source)
        model, values = load_calibration(calibration, covariates)
        sensor = open_things.enter_context(
            open_sensor(port, profile, reconnect=reconnect, calibration=model, covariates=values)
        )
        pads = f"{len(sensor.pads)} pad{'s' * (len(sensor.pads) > 1)} of {sensor.layout.rows}x{sensor.layout.cols}"
        screen = _Screen()
        summary = capture(sensor, path, extra=extra, seconds=seconds, overwrite=force, on_status=screen.show)
        screen.end(summary)
    if summary.ended == "file":
        raise PaxisimError(f"{path} is not there: {summary.error}; the recording is lost unless the file was moved")
    for line in _report(summary, pads):
        print(line)
    if summary.error is not None:
        raise PaxisimError(f"{_what_ended(summary)}; {path} is valid and holds {_held(summary)}")
    if not summary.frames:
        nothing = f"no frame came from {', '.join(port)} in {summary.seconds:.4g} s"
        if any(source.samples for source in summary.extra):
            raise PaxisimError(f"{nothing}; {path} holds only the other streams")
        path.unlink()
        raise PaxisimError(f"{nothing}; nothing was recorded")
    for source in summary.extra:
        if source.bad and not source.samples:
            raise PaxisimError(
                f"nothing that could be used came from {source.problem}; {path} is valid and holds {_held(summary)}"
            )


def _sources(csv: bool, udp: tuple[int, ...], stream: tuple[str, ...]):
    """Open the extra streams one by one, so that the caller can close the open ones if a later one fails."""
    from paxisim.hw.capture.extra_streams import CsvLines, EnterKey, UdpJson, load_function

    if csv:
        yield CsvLines()
    elif sys.stdin is not None and sys.stdin.isatty():
        yield EnterKey()
    for port in udp:
        yield UdpJson(port)
    for text in stream:
        yield load_function(text)


class _Screen:
    """Output during a recording: a status line, on a terminal, and a warning for each source's first problem."""

    def __init__(self) -> None:
        self._live = sys.stderr.isatty()
        self._said: set[str] = set()

    def show(self, summary: CaptureSummary) -> None:
        with suppress(OSError):  # a closed terminal must not stop the recording
            self._warn(summary)
            if self._live:
                width = shutil.get_terminal_size().columns - 1
                print("\r" + printable(_status(summary))[:width].ljust(width), end="", file=sys.stderr, flush=True)

    def end(self, summary: CaptureSummary) -> None:
        with suppress(OSError):
            self._wipe()
            self._warn(summary)

    def _warn(self, summary: CaptureSummary) -> None:
        for source in summary.extra:
            if source.problem and source.label not in self._said:
                self._said.add(source.label)
                self._wipe()
                print(f"paxisim: warning: {printable(source.problem)}", file=sys.stderr, flush=True)

    def _wipe(self) -> None:
        if self._live:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _status(summary: CaptureSummary) -> str:
    parts = [
        f"{summary.seconds:7.1f} s",
        f"{summary.rate:6.1f} Hz",
        f"{summary.frames} frames",
        f"{summary.dropped} dropped",
        f"{size_text(summary.size)}",
        f"episode {max(0, summary.episodes - 1)}",
    ]
    return "  ".join(parts + [_source(source) for source in summary.extra if source.label != ENTER_KEY])


def _source(source) -> str:
    counts = [f"{source.samples} samples"]
    lost = ((source.bad, "bad"), (source.dropped, "dropped"), (source.missed, "calls skipped"))
    counts += [f"{count} {what}" for count, what in lost if count]
    return f"{source.label}: {', '.join(counts)}"


def _report(summary: CaptureSummary, pads: str) -> list[str]:
    lines = [
        f"{summary.path}: {_held(summary)} (median {summary.rate:.1f} Hz), {pads} taxels, {size_text(summary.size)}"
    ]
    if summary.dropped or summary.gaps:
        lines.append(
            f"  missing: {summary.dropped} frames dropped, {summary.gaps} gaps of more than half a second, "
            f"the longest {summary.longest_gap:.1f} s"
        )
    if summary.uncertain:
        lines.append(
            f"  warning: this program was held up, so the times of {summary.uncertain} frames may be wrong by up to "
            f"{summary.longest_stall:.1f} s (time_error in the file)"
        )
    counts = (
        (summary.bad_checksums, "bad checksums"),
        (summary.timeouts, "timeouts"),
        (summary.reconnects, "reconnects"),
    )
    if any(count for count, _ in counts):
        lines.append(f"  on the line: {', '.join(f'{count} {what}' for count, what in counts if count)}")
    if summary.episodes > 1:
        lines.append(f"  {summary.episodes} episodes")
    for source in summary.extra:
        if source.label != ENTER_KEY:
            last = f"; the last bad one: {source.problem.partition(': ')[2]}" if source.bad else ""
            lines.append(f"  {_source(source)}{last}")
            if abs(source.clock_off) > MAX_CLOCK_OFF:
                lines.append(
                    f"  warning: the times of {source.label} are up to {source.clock_off:+.1f} s off this machine's "
                    "clock, and its samples lie that far from the frames: set the sender's clock, or send no time"
                )
    return lines


def _held(summary: CaptureSummary) -> str:
    return f"{summary.frames} frames in {summary.seconds:.1f} s"


def _what_ended(summary: CaptureSummary) -> str:
    return (
        f"the file takes no more: {summary.error}"
        if summary.ended == "disk"
        else f"the sensor is gone: {summary.error}"
    )
