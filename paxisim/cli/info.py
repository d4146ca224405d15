"""The ``paxisim info`` command."""

from __future__ import annotations

import textwrap
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, progress, size_text

if TYPE_CHECKING:
    from paxisim.logs.stream import Log

# ns; the times of a log that begins before the year 2000 do not count from 1970
_EARLIEST = 946_684_800 * 10**9


def info(recording: Annotated[Path, tyro.conf.Positional]) -> None:
    """Describe a recording: its pads, streams, rates, gaps, value ranges and episodes.

    For example:

    paxisim info press.mcap

    Args:
        recording: Recording: .mcap, .npz, .parquet, .csv or .hdf5 (robosuite, robomimic).
            Or the folder of a LeRobotDataset (v3).
    """
    from paxisim.logs.describe import HEADER, describe_episodes, describe_stream
    from paxisim.logs.recording_arrays import unit_of
    from paxisim.logs.resample import describe_bursts

    progress(f"reading {recording}")
    log = _read(recording)
    files = recording.rglob("*") if recording.is_dir() else [recording]
    size = sum(file.stat().st_size for file in files if file.is_file())
    print(f"{recording}: {size_text(size)}" + ("" if log.complete else ", CUT OFF or damaged: the intact part follows"))
    for line in _about(log):
        print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent="  "))
    first = min((stream.nanoseconds[0] for stream in log.streams.values()), default=0)
    streams = {name: stream for name, stream in log.streams.items() if name != "episode"}
    if not streams:
        print("no samples")
        return
    width = max(6, *(min(len(name), TERMINAL_COLUMNS - len(HEADER)) for name in streams))
    print(f"\n{'stream':{width}}{HEADER}")
    for name, stream in streams.items():
        print(describe_stream(name, stream, width))
    for name, stream in streams.items():
        if said := describe_bursts(name, stream):
            print(textwrap.fill(said, TERMINAL_COLUMNS, subsequent_indent="  "))
    print()
    for name, stream in streams.items():
        for line in _ranges(name, stream.values, unit_of(log.metadata)):
            print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent="  "))
    if "episode" in log.streams:
        print()
        for line in describe_episodes(log, int(first)):
            print(line)


def _read(path: Path) -> Log:
    """Read a file as a log. Files other than MCAP are tables, whose streams share one time column."""
    if path.suffix.lower() == ".mcap":
        from paxisim.logs.mcap_reader import read_log

        return read_log(path)
    from paxisim.logs.describe import log_of
    from paxisim.recording import Recording

    return log_of(Recording.load(path).to_arrays())


def _about(log: Log) -> list[str]:
    metadata = dict(log.metadata)
    lines = []
    layout = metadata.pop("layout", None)
    pads = metadata.pop("pads", None)
    if layout:
        row, col = (1e3 * pitch for pitch in layout["pitch"])
        pitch = f"{row:.3g}x{col:.3g} mm"
        if not layout.get("pitch_known", True):
            pitch = f"pitch unknown, drawn as {pitch}; state it with Recording.load(..., layout=...)"
        lines.append(f"pads: {', '.join(pads or ())} of {layout['rows']}x{layout['cols']} taxels, {pitch}")
    start = min((stream.nanoseconds[0] for stream in log.streams.values()), default=0)
    if start >= _EARLIEST:
        lines.append(f"start: {datetime.fromtimestamp(start * 1e-9, timezone.utc):%Y-%m-%d %H:%M:%S} UTC")
    if "scene" in metadata:
        metadata["scene"] = f"MJCF of {len(metadata['scene'])} characters"
    for key in ("time_zero_ns", "episode_clocks", "start"):
        metadata.pop(key, None)
    return lines + [f"{name}: {value}" for name, value in metadata.items() if value not in (None, "", [], {})]


def _ranges(name: str, values: Any, tensor_unit: str) -> list[str]:
    """Describe the minimum and maximum of a stream; those of a tactile stream by axis."""
    import numpy as np

    from paxisim.logs.schemas import RESULTANT

    def span(part: Any) -> str:
        part = part[~np.isnan(part)] if np.isnan(part).any() else part
        return f"{part.min():.4g} to {part.max():.4g}" if part.size else "unknown"

    unknown = int(np.isnan(values).reshape(len(values), -1).any(axis=1).sum())
    without = f"; {unknown} sample{'s' * (unknown != 1)} with unknown values" if unknown else ""
    if name not in ("measured", "simulated"):
        unit = " (N)" if name == RESULTANT else ""
        return [f"{name.removeprefix('covariate/')}{unit}: {span(values)}{without}"]
    axes = [f"{axis} {span(values[:, :, i])}" for i, axis in enumerate("xyz")]
    head = f"{name} ({tensor_unit} a taxel)"
    line = f"{head}: " + ", ".join(axes) + without
    return [line] if len(line) <= TERMINAL_COLUMNS else [f"{head}{without}:", *(f"  {axis}" for axis in axes)]
