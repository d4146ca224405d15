"""Read Rerun files with whichever of its two readers the installed version has."""

import re
import warnings
from collections import defaultdict

import numpy as np
import pytest


def read_rrd(path):
    """Return ``{(entity, component): (times, values)}``; static components have no times and one value.

    Components are named by `name_of`, identically for all versions of Rerun.
    """
    try:
        from rerun.chunk import RrdReader
    except ImportError:
        return _read_with_dataframe(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about a file that is still being written
        return _read_chunks(RrdReader(path).stream())


def name_of(component):
    """Return the common name of a component: ``"Points2D:colors"`` and ``"Color"`` both give ``"color"``."""
    name = re.sub(r"[23]D$", "", component.split(":")[-1]).lower().removesuffix("s")
    return {"text": "label", "origin": "position", "radii": "radiu"}.get(name, name)


def _read_chunks(chunks):
    static, found = {}, defaultdict(list)
    for chunk in chunks:
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if ":" in name]
        columns = {name: batch.column(name).to_pylist() for name in names}
        for component in names:
            key = (chunk.entity_path, name_of(component))
            if chunk.is_static:
                static[key] = ([], [columns[component][-1]])
            elif "time" in batch.schema.names:
                times = np.array(batch.column("time").cast("int64").to_pylist()) / 1e9
                rows = [(at, row) for at, row in zip(times, columns[component], strict=True) if row is not None]
                found[key] += rows
    ordered = {key: sorted(rows, key=lambda row: row[0]) for key, rows in found.items()}
    return static | {key: ([at for at, _ in rows], [row for _, row in rows]) for key, rows in ordered.items()}


def _read_with_dataframe(path):
    dataframe = pytest.importorskip("rerun.dataframe", reason="needs a reader of .rrd files")
    recording = dataframe.load_recording(path)
    found = {}
    for static in (True, False):
        view = recording.view(index="time", contents="/**")
        table = (view.select_static() if static else view.select()).read_all()
        for column in (name for name in table.column_names if name.startswith("/")):
            entity, component = column.rsplit(":", 1)
            rows = table[column].to_pylist()
            if static:
                found[entity, name_of(component)] = ([], rows)
            elif (entity, name_of(component)) not in found:
                times = np.array(table["time"].cast("int64").to_pylist()) / 1e9
                kept = [(at, row) for at, row in zip(times, rows, strict=True) if row is not None]
                found[entity, name_of(component)] = ([at for at, _ in kept], [row for _, row in kept])
    return found


def rgba(packed):
    """Convert ``(N,)`` colours as Rerun stores them to ``(N, 4)`` uint8."""
    return np.array([[color >> shift & 255 for shift in (24, 16, 8, 0)] for color in packed], dtype=np.uint8)
