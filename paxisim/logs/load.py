"""Recording files by their suffix."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.align import check_max_gap
from paxisim.logs.aligned import Aligned, CountsToForce, Method


def load_aligned(
    path: Path,
    *,
    align: Method | Mapping[str, Method] = "linear",
    max_gap: float | None = None,
    layout: TaxelLayout | None = None,
    pads: tuple[str, ...] | None = None,
    profile: CountsToForce | None = None,
) -> Aligned:
    """See `paxisim.Recording.load`; nothing is checked yet, and only a CSV file is read for some of its pads."""
    suffix = path.suffix.lower()
    check_max_gap(max_gap)
    is_eflesh = path.name.endswith(".sensor.csv")
    if suffix == ".csv" and not is_eflesh:
        from paxisim.logs.csv import read_csv

        found, is_cut = read_csv(path, layout=layout, pads=pads, profile=profile)
        if is_cut:
            _warn_of_part(path, "cut off: its last line is not whole", found)
        return found
    if profile is not None:
        raise InvalidValueError(f"profile is for the counts of a board's CSV file; {path} holds none")
    if is_eflesh:
        from paxisim.logs.eflesh import read_eflesh

        found = read_eflesh(path, align, max_gap)
    elif suffix == ".npz":
        from paxisim.logs.npz import read_npz

        found = read_npz(path)
    elif suffix == ".mcap":
        from paxisim.logs.align import align as align_log
        from paxisim.logs.mcap_reader import read_log

        log = read_log(path)
        found = align_log(log, align, max_gap)
        if not log.complete:
            _warn_of_part(path, "cut off or damaged", found)
    else:
        raise InvalidValueError(f"a recording is read from a .mcap, .npz or .csv file, got {path}")
    return found if layout is None else replace(found, layout=layout)


def save_aligned(path: Path, recording: Aligned) -> None:
    """See `paxisim.Recording.save`."""
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        from paxisim.logs.mcap_save import write_mcap

        write_mcap(path, recording)
    elif suffix == ".npz":
        from paxisim.logs.npz import write_npz

        write_npz(path, recording)
    else:
        raise InvalidValueError(f"a recording is saved as .mcap or .npz, got {path}")


def _warn_of_part(path: Path, what: str, found: Aligned) -> None:
    samples = f"{len(found.time)} sample{'s' * (len(found.time) != 1)}"
    text = f"{path} is {what}; what is whole was read: {samples}, the last at {found.time[-1]:.3f} s"
    warnings.warn(text, stacklevel=4)  # at the caller of Recording.load
