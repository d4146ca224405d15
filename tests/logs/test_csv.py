"""CSV files of boards, as their own recorder writes them, and plain tables."""

import dataclasses
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from log_files import LAYOUT, assert_equal, recording, refused

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.hw.profiles.load import load_profile
from paxisim.layout import TaxelLayout
from paxisim.logs.columns import to_columns
from paxisim.logs.csv_writer import write_csv
from paxisim.recording import Recording

HOST = """Timestamp,0-2-1x1-X,0-2-1x1-Y,0-2-1x1-Z,0-2-NxN-X[0],0-2-NxN-Y[0],0-2-NxN-Z[0],\
0-2-NxN-X[1],0-2-NxN-Y[1],0-2-NxN-Z[1]
23:59:59.990,1,2,3,-128,5,255,7,8,9
00:00:00.000,1,2,4,0,0,1,0,0,0
00:00:00.015,1,2,5,0,0,2,0,0,0
"""


def board_file(path, kind, modules=(2, 6), points=2, rows=4):
    """Write a file with paxini-sdk's recorder and return its counts, ``(rows, pads, points, 3)``."""
    pytest.importorskip("paxini_sdk")
    from paxini_sdk import registers
    from paxini_sdk.recording import CsvRecorder

    counts = np.random.default_rng(0).integers(-128, 128, (rows, len(modules), points, 3))
    counts[..., 2] += 128
    config = SimpleNamespace(
        active_modules=list(modules),
        has_resultant=True,
        has_distributed=True,
        point_counts=dict.fromkeys(modules, points),
    )
    with CsvRecorder(path, config, format=kind, firmware="v1", sensor_part="a part") as recorder:
        for row in counts:
            names = [registers.MODULE_NAMES[module] for module in modules]
            recorder.write(
                SimpleNamespace(
                    resultant_forces={name: tuple(pad.sum(0).tolist()) for name, pad in zip(names, row, strict=True)},
                    distributed_forces={
                        name: [tuple(p) for p in pad.tolist()] for name, pad in zip(names, row, strict=True)
                    },
                )
            )
    return counts


@pytest.mark.parametrize("kind", ["vendor", "native"])
def test_what_the_boards_recorder_writes(tmp_path, kind):
    counts = board_file(tmp_path / "a.csv", kind)
    loaded = Recording.load(tmp_path / "a.csv")
    assert loaded.measured.shape == (4, 2, 3, 1, 2)
    np.testing.assert_array_equal(loaded.measured[:, :, :, 0], (counts * 0.1).astype(np.float32).swapaxes(2, 3))
    np.testing.assert_allclose(loaded.covariates["resultant"], counts.sum(2) * 0.1)
    assert loaded.pads == (("0-2", "1-2") if kind == "vendor" else ("thumb_tip", "index_tip"))
    assert loaded.time[0] == 0
    assert loaded.metadata["source"] == "a.csv"
    if kind == "native":
        assert loaded.metadata["firmware"] == "v1"


def test_a_layout_or_a_profile_says_which_taxel_is_where(tmp_path):
    path = tmp_path / "a.csv"
    counts = board_file(path, "vendor", points=12)
    loaded = Recording.load(path, layout=LAYOUT, pads=["1-2"])
    assert (loaded.pads, loaded.layout) == (("1-2",), LAYOUT)
    flat = LAYOUT.to_flat(loaded.measured[:, 0]).reshape(4, 12, 3)
    np.testing.assert_array_equal(flat, (counts[:, 1] * 0.1).astype(np.float32))
    refused(path, "have 12 taxels, layout has 4", layout=TaxelLayout(2, 2, (1e-3, 1e-3)))
    turned = dataclasses.replace(load_profile("gen3-highspeed-mc-m2020"), axes=("-y", "+x", "+z"))
    refused(path, ".", profile=turned)
    recording().save(tmp_path / "a.npz")
    refused(tmp_path / "a.npz", "for the counts of a board's CSV file", profile=turned)
    counts = board_file(path, "vendor", points=9)
    loaded = Recording.load(path, profile=turned)
    assert loaded.layout == turned.layout
    np.testing.assert_array_equal(loaded.measured, turned.to_force(counts.astype(np.int16)))
    flat = turned.layout.to_flat(loaded.measured).reshape(4, 2, 9, 3)
    np.testing.assert_allclose(flat, counts[..., [1, 0, 2]] * [-0.1, 0.1, 0.1], atol=1e-5)
    refused(path, "not both", profile=turned, layout=LAYOUT)


def test_an_empty_cell_is_not_known_with_a_profile_too(tmp_path):
    path = tmp_path / "a.csv"
    board_file(path, "vendor", points=9)
    whole, lines = Recording.load(path).measured, path.read_text().splitlines()
    cells = lines[2].split(",")
    cells[lines[0].split(",").index("0-2-NxN-X[4]")] = ""
    path.write_text("\n".join([*lines[:2], ",".join(cells), *lines[3:], ""]))
    missing = np.zeros(whole.shape, dtype=bool)
    missing[1, 0, 0, 0, 4] = True
    np.testing.assert_array_equal(np.isnan(Recording.load(path).measured), missing)
    turned = dataclasses.replace(load_profile("gen3-highspeed-mc-m2020"), axes=("-y", "+x", "+z"))
    loaded = Recording.load(path, profile=turned).measured
    flat = turned.layout.to_flat(loaded).reshape(4, 2, 9, 3)
    assert np.argwhere(np.isnan(flat)).tolist() == [[1, 0, 4, 1]]


def test_the_host_programs_file_over_midnight(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(HOST)
    loaded = Recording.load(path)
    np.testing.assert_allclose(loaded.time, [0, 0.01, 0.025], atol=1e-9)
    np.testing.assert_allclose(loaded.measured[0, 0, :, 0], [[-12.8, 0.7], [0.5, 0.8], [25.5, 0.9]], rtol=1e-6)
    np.testing.assert_allclose(loaded.covariates["resultant"][:, 0, 2], [0.3, 0.4, 0.5])


def test_a_row_that_is_cut_off_is_left_out(tmp_path):
    path = tmp_path / "a.csv"
    for cut in range(1, 40):
        path.write_text(HOST[:-cut])
        rows = 2 if cut <= len(HOST.splitlines()[-1]) + 1 else 1
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            assert len(Recording.load(path)) == rows, f"cut off {cut}"
        expected = f"a.csv is cut off: its last line is incomplete; the intact part was read: {rows} sample"
        whole = HOST[:-cut].endswith("\n")
        assert [expected in str(warning.message) for warning in said] == [True] * (not whole), f"cut off {cut}"


def test_pads_of_different_kinds_are_chosen_by_name(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(HOST.replace("0-2-NxN-X[1],0-2-NxN-Y[1],0-2-NxN-Z[1]", "1-2-NxN-X[0],1-2-NxN-Y[0],1-2-NxN-Z[0]"))
    assert Recording.load(path).pads == ("0-2", "1-2")
    assert "resultant" not in Recording.load(path).covariates
    path.write_text(
        "Timestamp,0-2-NxN-X[0],0-2-NxN-Y[0],0-2-NxN-Z[0],"
        + ",".join(f"1-2-NxN-{axis}[{i}]" for i in range(2) for axis in "XYZ")
        + "\n10:00:00.000"
        + ",1" * 9
        + "\n"
    )
    refused(path, "differ in their taxels: 0-2 has 1, 1-2 has 2; choose with pads")
    assert Recording.load(path, pads=["1-2"]).layout.taxels == 2
    with pytest.raises(UnknownNameError, match="unknown pad '1-3'"):
        Recording.load(path, pads=["1-3"])


def test_a_plain_table_comes_back(tmp_path):
    original = recording(6)
    columns = to_columns(original.to_arrays())
    rows = [",".join(repr(value.item()) for value in row) for row in zip(*columns.values(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(columns), *rows, ""]))
    loaded = Recording.load(tmp_path / "a.csv", layout=LAYOUT)
    assert_equal(loaded, dataclasses.replace(original, metadata=loaded.metadata))
    assert Recording.load(tmp_path / "a.csv", pads=["right"]).pads == ("right",)


def test_what_paxisim_writes(tmp_path):
    path = tmp_path / "a.csv"
    original = recording(6, covariates={"pose": np.arange(36.0).reshape(6, 2, 3), "opening": np.full(6, np.nan)})
    write_csv(path, original.to_arrays())
    assert_equal(Recording.load(path), original)
    assert Recording.load(path).metadata == original.metadata
    text = path.read_text(encoding="utf-8")
    path.write_text(text[:-3], encoding="utf-8")
    with pytest.warns(UserWarning, match="cut off: its last line is incomplete; the intact part was read: 5 samples"):
        assert len(Recording.load(path)) == 5
    about, header, *rows = text.splitlines()  # as a spreadsheet of another language saves it
    rows = [header.replace(",", ";"), *(row.replace(",", ";").replace(".", ",") for row in rows)]
    path.write_text("\n".join([about, *rows, ""]), encoding="utf-8")
    assert_equal(Recording.load(path), original)
    dataclasses.replace(original, covariates={}).save(tmp_path / "b.npz")
    added = Recording.load(tmp_path / "b.npz", streams=path).covariates["pose"]
    assert added.shape == (6, 2, 3), "its covariates keep their shapes as streams, too"
    broken = recording(6, covariates={"a\nb": np.ones(6)})
    with pytest.raises(InvalidValueError, match=r"a name with a line break, 'a\\nb': write \.parquet or \.npz"):
        write_csv(path, broken.to_arrays())


def test_a_pitch_that_no_file_states_is_unknown(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(PLAIN)
    loaded = Recording.load(path)
    assert not loaded.layout.pitch_known
    assert "1 pad of 1x1 taxels (pitch unknown), 2 samples" in repr(loaded)
    for suffix in ("npz", "mcap", "csv"):
        write = write_csv if suffix == "csv" else lambda path, arrays: Recording(**vars(arrays)).save(path)
        write(tmp_path / f"b.{suffix}", loaded.to_arrays())
        assert not Recording.load(tmp_path / f"b.{suffix}").layout.pitch_known, suffix
    known = Recording.load(path, layout=TaxelLayout(1, 1, (1e-3, 1e-3)))
    assert known.layout.pitch_known
    assert "unknown" not in repr(known)
    path.write_text(HOST)
    assert not Recording.load(path).pool(1, 2).layout.pitch_known


PLAIN = "time,tactile.left.0_0.x,tactile.left.0_0.y,tactile.left.0_0.z,opening\n0,1,2,3,0.5\n0.1,1,2,3,\n"
WRONG = [
    (HOST, "255", "40000", r"line 2, column '0-2-NxN-Z\[0\]': a count must be .* -32768 to 32767, got 40000"),
    (HOST, "255", "2.5", "a count must be a whole number"),
    (HOST, "255", "inf", "a count must be a whole number"),
    (HOST, "255", "abc", r"line 2, column '0-2-NxN-Z\[0\]': 'abc' is not a number"),
    (HOST, "1,2,4,0", "1,2,4", "line 3: expected 10 values, got 9"),
    (HOST, "1,2,4,0", "1,2,4,0,0", "line 3: expected 10 values, got 11"),
    (HOST, "00:00:00.000", "noon", "line 3: the time of day must be HH:MM:SS.mmm, got 'noon'"),
    (HOST, "NxN-Y[1]", "NxN-Y[2]", "differ|has no y of taxel"),
    (HOST, "X[1]", "X[0]", "two columns"),
    (HOST, "NxN", "MxM", "has no taxels"),
    (PLAIN, "time", "when", "must have a column 'time'"),
    (PLAIN, "0_0.z", "0_1.z", "has no column tactile.left.0_1.x"),
    (PLAIN, "tactile", "tactil", "must have columns tactile.PAD"),
    (PLAIN, "0.5", "half", "line 2, column 'opening': 'half' is not a number"),
    (PLAIN, "0_0.z", "99999999_99999999.z", r"no column .*, because there is tactile\.left\.99999999_99999999\.z"),
    (PLAIN, "opening", "a.99999999_99999999", r"the column 'a\.99999999_99999999' makes 'a' an array"),
    (PLAIN, ",", "|", "expected columns separated by commas, semicolons or tabs"),
    (PLAIN, "opening", "\xe9", "expected a CSV file in UTF-8, got the byte 0xe9 after"),
    (PLAIN, "\n0.1,", "\n1e300,", "line 3, column 'time': a time must be in seconds and not .*2262, got 1e.300"),
    (PLAIN, "0.5", "inf", "line 2, column 'opening': a number must be finite"),
    (PLAIN, ",3,0", ",1e300,0", r"line 2, column 'tactile\.left\.0_0\.z': a number must be finite"),
    *((text, text, text, ".") for text in ("", "\xff\xfe\0", "just a line", "a,b\n", "# {}\n")),
]


def test_a_table_that_cannot_be_used(tmp_path):
    path = tmp_path / "a.csv"
    for text, old, new, word in WRONG:
        path.write_bytes(text.replace(old, new).encode("latin-1"))
        refused(path, word)


def test_a_plain_table_by_hand(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(PLAIN)
    loaded = Recording.load(path)
    assert loaded.measured.shape == (2, 1, 3, 1, 1)
    np.testing.assert_array_equal(loaded.covariates["opening"], [0.5, np.nan])
    path.write_text(PLAIN.replace("opening", '"a\u2028b"'), encoding="utf-8")
    assert Recording.load(path).covariates["a\u2028b"][0] == 0.5
