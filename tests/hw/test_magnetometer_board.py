"""AnySkin, ReSkin and eFlesh: bursts without header, checksum or counter, in microtesla."""

from __future__ import annotations

import contextlib
import io
import struct
from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.signals import press
from paxisim.hw.families.magnetometer_board.wire import Burst, BurstDecoder, TextDecoder
from paxisim.hw.link.recognise import describe
from paxisim.hw.profiles.load import load_profile
from paxisim.hw.profiles.profile import Slot
from paxisim.layout import TaxelLayout

pytest.importorskip("serial")

from paxisim.hw.device import open_sensor
from paxisim.hw.emulation.emulator import Emulator

pytestmark = pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")

CHIPS = 5
PATIENCE = 20.0
FIELD = np.linspace(-300, 2000, 3 * CHIPS).reshape(1, 3, 1, CHIPS)
# a float whose two lowest bytes are CR LF; a constant field may repeat it in every burst
CR_LF_INSIDE = struct.unpack("<f", b"\r\n\x12\x43")[0]


def bursts(count: int, seed: int = 0, chips: int = CHIPS, still: bool = False) -> list[Burst]:
    """Readings in multiples of the chips' resolution: all different, or equal if `still`, as on an untouched board."""
    rng = np.random.default_rng(seed)
    steps = rng.integers(-800, 800, (count, chips, 4))
    steps[:, :, 0] = 550
    if still:
        steps[:] = steps[0]
    return [Burst((one * np.array([0.0452, 0.15, 0.15, 0.242])).astype(np.float32)) for one in steps]


def same(found: list[Burst], expected: list[Burst]) -> bool:
    return len(found) == len(expected) and all(
        np.array_equal(a.values, b.values) for a, b in zip(found, expected, strict=True)
    )


def numbers(found: list[Burst], sent: list[Burst]) -> list[int]:
    """The index in `sent` of each burst found; -1 if it was never sent."""
    known = {burst.encode(): number for number, burst in enumerate(sent)}
    return [known.get(burst.encode(), -1) for burst in found]


@pytest.mark.parametrize("piece", [1, 7, 82, 83, 1000])
@pytest.mark.parametrize("chips", [1, 5, 10])
def test_bursts_come_out_of_any_pieces(piece: int, chips: int) -> None:
    sent = bursts(12, chips=chips)
    data = b"".join(burst.encode() for burst in sent)
    assert len(sent[0].encode()) == 16 * chips + 2
    decoder = BurstDecoder(chips)
    found = [burst for i in range(0, len(data), piece) for burst in decoder.feed(data[i : i + piece])]
    # the first burst is lost: only a CR LF shows where a burst begins
    assert same(found, sent[1:])
    assert decoder.pending == 0


@pytest.mark.parametrize("cut", range(1, 82))
def test_a_stream_that_is_joined_anywhere_gives_no_wrong_burst(cut: int) -> None:
    sent = bursts(5, seed=1)
    found = BurstDecoder(CHIPS).feed(b"".join(burst.encode() for burst in sent)[cut:])
    assert same(found, sent[1:] if cut <= 80 else sent[2:])


@pytest.mark.parametrize("chip", range(CHIPS))
@pytest.mark.parametrize("axis", range(4))
def test_cr_lf_inside_a_float_is_no_end(chip: int, axis: int) -> None:
    sent = bursts(40, seed=2)
    for burst in sent:
        burst.values[chip, axis] = CR_LF_INSIDE
    decoder = BurstDecoder(CHIPS)
    found = decoder.feed(b"".join(burst.encode() for burst in sent))
    assert same(found + decoder.flush(), sent[1:])


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize("lost", [1, 2, 3, 4])
def test_lost_bytes_cost_their_burst_and_make_no_wrong_one(lost: int, still: bool) -> None:
    sent = bursts(8, seed=3, still=still)
    for i, burst in enumerate(sent):
        burst.values[0, 1] = 20 + i  # makes the bursts distinguishable even if all else is constant
    data = b"".join(burst.encode() for burst in sent)
    for place in range(3 * 82, 4 * 82):
        found = numbers(BurstDecoder(CHIPS).feed(data[:place] + data[place + lost :]), sent)
        first, last = place // 82, (place + lost - 1) // 82
        # the beginning of a burst is unknown without the CR LF before it
        also = {last + 1} if (place + lost - 1) % 82 >= 80 else set()
        assert found == [n for n in range(1, 8) if n not in {first, last} | also], place


def test_random_bytes_are_no_burst() -> None:
    rng = np.random.default_rng(4)
    decoder = BurstDecoder(CHIPS)
    for _ in range(200):
        assert decoder.feed(rng.bytes(5000)) == []
        assert decoder.pending < 2 * 82
    # even with CR LF in all the right places, the numbers are not plausible for a chip
    assert decoder.feed(b"".join(rng.bytes(80) + b"\r\n" for _ in range(200))) == []


def test_text_as_the_sketch_prints_it() -> None:
    line = b"25.10\t1.00\t-2.50\t300.2525.20\t-4.00\t5.00\t-6.7525.30\t0.00\t-0.50\t1234.00\r\n"
    (burst,) = TextDecoder(3).feed(b"0\t1.00\r\n" + line)
    expected = [[25.1, 1, -2.5, 300.25], [25.2, -4, 5, -6.75], [25.3, 0, -0.5, 1234]]
    np.testing.assert_array_equal(burst.values, np.float32(expected))
    assert burst.encode_text() == line


def test_lines_that_lost_their_end_are_left_out() -> None:
    sent = [Burst(np.round(burst.values, 2)) for burst in bursts(6, seed=5)]
    lines = [burst.encode_text() for burst in sent]
    lines[2] = lines[2].removesuffix(b"\r\n")
    assert same(TextDecoder(CHIPS).feed(b"".join(lines)), [sent[1], sent[4], sent[5]])
    assert TextDecoder(4).feed(b"".join(lines)) == []
    decoder = TextDecoder(CHIPS)
    decoder.feed(b"1" * 100_000)
    assert decoder.pending == 0


def test_what_is_heard_is_named_with_its_chips() -> None:
    binary = b"".join(burst.encode() for burst in bursts(10, chips=4))
    assert "9 bursts of 4 chips of the family 'magnetometer-board'" in describe(binary)
    text = b"".join(burst.encode_text() for burst in bursts(10))
    assert "lines of text of 5 chips of the family 'magnetometer-board' (setting text = true)" in describe(text)


@pytest.mark.real_time
@pytest.mark.parametrize("name", ["anyskin", "reskin", "eflesh"])
@pytest.mark.parametrize("text", [False, True])
def test_a_field_is_read_in_microtesla_and_zeroed_in_software(name: str, text: bool) -> None:
    profile = replace(load_profile(name), settings={"text": text})
    with Emulator(profile, lambda now: FIELD) as emulator, open_sensor(emulator.port, profile) as skin:
        frame = skin.read(PATIENCE)
        assert frame.unit == profile.unit == "uT"
        assert frame.force.shape == (1, 3, 1, CHIPS)
        assert frame.force.dtype == np.float32
        np.testing.assert_allclose(frame.force, FIELD, atol=0.0051)
        assert frame.resultant is None
        skin.zero()
        frame = skin.read(PATIENCE)
        assert frame.unit == "uT"
        np.testing.assert_allclose(frame.force, 0, atol=1e-3)
        assert skin.version() == ""
        with pytest.raises(paxisim.UnsupportedError, match="takes no commands"):
            skin.zero(software=False)


@pytest.mark.real_time
def test_a_lossy_line_gives_no_wrong_field() -> None:
    profile = load_profile("anyskin")
    with (
        Emulator(profile, lambda now: FIELD, faults=Faults(drop=1e-3, split=0.2, merge=0.1), seed=6) as emulator,
        open_sensor(emulator.port, profile) as skin,
    ):
        for _ in range(150):
            np.testing.assert_allclose(skin.read(PATIENCE).force, FIELD, atol=0.0051)
        assert skin.skipped > 0


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("speaks", "says"),
    [
        ({"wire_layout": TaxelLayout(1, 4, (1e-2, 1e-2))}, "from 5 chips, .* bursts of 4 chips"),
        ({"settings": {"text": True}}, r"lines of text of 5 chips .*setting text = true"),
    ],
)
def test_missing_chips_and_another_sketch_are_named(speaks: dict, says: str) -> None:
    profile = load_profile("anyskin")
    other = replace(profile, **speaks)
    field = FIELD[..., : other.wire_layout.cols]
    with Emulator(other, lambda now: field) as emulator, pytest.raises(ProtocolError, match=says):
        open_sensor(emulator.port, profile)


@pytest.mark.real_time
def test_a_stream_that_stops_is_a_timeout_and_one_that_begins_again_is_read_on() -> None:
    profile = load_profile("anyskin")
    with (
        Emulator(profile, lambda now: FIELD, faults=Faults(stall=0.05, stall_seconds=3.0), seed=1) as emulator,
        open_sensor(emulator.port, profile) as skin,
    ):
        with pytest.raises(DeviceTimeoutError, match=r"no frame from .* within 1 s"):
            deque(skin.stream(1.0), maxlen=0)
        np.testing.assert_allclose(skin.read(PATIENCE).force, FIELD, atol=0.0051)


@pytest.mark.real_time
def test_a_board_that_says_nothing_is_a_timeout() -> None:
    profile = load_profile("anyskin")
    silent = Faults(stall=1.0, stall_seconds=60.0)
    with (
        Emulator(profile, lambda now: FIELD, faults=silent) as emulator,
        pytest.raises(DeviceTimeoutError, match="nothing came within 2 s"),
    ):
        open_sensor(emulator.port, profile)


def test_a_second_pad_is_refused() -> None:
    profile = replace(load_profile("anyskin"), slots=(Slot("left", 0), Slot("right", 1)))
    with (
        Emulator(profile, lambda now: np.repeat(FIELD, 2, axis=0)) as emulator,
        pytest.raises(InvalidValueError, match="slots must list one pad"),
    ):
        open_sensor(emulator.port, profile)


@pytest.mark.real_time
def test_the_verbs_keep_and_print_the_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profile = load_profile("anyskin")
    path = tmp_path / "skin.mcap"
    with Emulator(profile, press(profile)) as emulator:
        assert main(["record", emulator.port, "--profile", "anyskin", "--seconds", "1", "-o", str(path)]) == 0
        assert main(["device", "quality", emulator.port, "--profile", "anyskin", "--seconds", "1"]) == 0
        said = capsys.readouterr().out
        assert "uT/min" in said
    recording = paxisim.Recording.load(path)
    assert recording.unit == "uT"
    assert recording.measured is not None
    assert np.abs(recording.measured).max() > 1
    assert main(["info", str(path)]) == 0
    assert "uT a taxel" in capsys.readouterr().out
    # the recording can be played back
    assert main(["emulate", "--profile", "anyskin", "--signal", str(path), "--seconds", "0"]) == 0
    assert main(["emulate", "--profile", "gen2-box-120", "--signal", str(path), "--seconds", "0"]) == 2
    assert "in uT, but profile" in capsys.readouterr().err


@pytest.mark.real_time
def test_the_authors_own_client_reads_the_emulator() -> None:
    client = pytest.importorskip("anyskin", reason="the public client is not installed")
    profile = load_profile("anyskin")
    with Emulator(profile, lambda now: FIELD) as emulator, contextlib.redirect_stdout(io.StringIO()):
        skin = client.AnySkinBase(num_mags=CHIPS, port=emulator.port)
        try:
            samples = [sample for _, sample in (skin.get_sample() for _ in range(20))]
        finally:
            skin.close()
    for sample in samples[1:]:
        np.testing.assert_allclose(sample, FIELD[0, :, 0].T.ravel(), atol=0.0051)


@pytest.mark.real_time
def test_live_draws_it_with_its_unit(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    profile = load_profile("anyskin")
    path = tmp_path / "skin.rrd"
    with Emulator(profile, press(profile)) as emulator:
        assert main(["live", emulator.port, "--profile", "anyskin", "--seconds", "0.5", "--save", str(path)]) == 0
    said = path.read_bytes()
    assert b"(uT)" in said
    assert b"(N)" not in said
