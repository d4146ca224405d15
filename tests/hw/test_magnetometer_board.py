"""AnySkin, ReSkin and eFlesh: bursts without header, checksum or counter, in microtesla."""

import contextlib
import io
import struct
from dataclasses import replace

import numpy as np
import pytest
from byte_streams import bursts

import paxisim
from paxisim import DeviceTimeoutError, InvalidValueError, ProtocolError, Slot, TaxelLayout, load_profile
from paxisim.cli import main
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.signals import press
from paxisim.hw.families.magnetometer_board.wire import Burst, BurstDecoder, TextDecoder
from paxisim.hw.link.recognise import describe

pytest.importorskip("serial")

from serial_peers import PATIENCE

from paxisim import Emulator, open_sensor

pytestmark = pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")

CHIPS = 5
FOUR_CHIPS = TaxelLayout(1, 4, (1e-2, 1e-2))
FIELD = np.linspace(-300, 2000, 3 * CHIPS).reshape(1, 3, 1, CHIPS)
# a float whose two lowest bytes are CR LF; a constant field may repeat it in every burst
CR_LF_INSIDE = struct.unpack("<f", b"\r\n\x12\x43")[0]


def stream(sent):
    return b"".join(burst.encode() for burst in sent)


def numbers(found, sent):
    """The index in `sent` of each burst found; -1 if it was never sent."""
    known = {burst.encode(): number for number, burst in enumerate(sent)}
    return [known.get(burst.encode(), -1) for burst in found]


# ---- bursts and lines of text, without a port


def test_a_stream_that_is_joined_anywhere_gives_no_wrong_burst():
    for chips in (1, 5, 10):
        sent, size = bursts(5, seed=1, chips=chips), 16 * chips + 2
        assert len(sent[0].encode()) == size
        for cut in range(size):
            found = numbers(BurstDecoder(chips).feed(stream(sent)[cut:]), sent)
            assert found == ([1, 2, 3, 4] if cut <= size - 2 else [2, 3, 4]), (chips, cut)


def test_cr_lf_inside_a_float_is_no_end():
    for chip in range(CHIPS):
        for axis in range(4):
            sent, decoder = bursts(40, seed=2), BurstDecoder(CHIPS)
            for burst in sent:
                burst.values[chip, axis] = CR_LF_INSIDE
            found = decoder.feed(stream(sent)) + decoder.flush()
            assert numbers(found, sent) == list(range(1, 40)), (chip, axis)


def test_random_bytes_are_no_burst():
    rng, decoder = np.random.default_rng(4), BurstDecoder(CHIPS)
    for _ in range(100):
        assert decoder.feed(rng.bytes(5000)) == []
        assert decoder.pending < 2 * 82
    # even with CR LF in all the right places, the numbers are not plausible for a chip
    assert decoder.feed(b"".join(rng.bytes(80) + b"\r\n" for _ in range(200))) == []


def test_text_as_the_sketch_prints_it():
    line = b"25.10\t1.00\t-2.50\t300.2525.20\t-4.00\t5.00\t-6.7525.30\t0.00\t-0.50\t1234.00\r\n"
    (burst,) = TextDecoder(3).feed(b"0\t1.00\r\n" + line)
    expected = [[25.1, 1, -2.5, 300.25], [25.2, -4, 5, -6.75], [25.3, 0, -0.5, 1234]]
    np.testing.assert_array_equal(burst.values, np.float32(expected))
    assert burst.encode_text() == line


def test_lines_that_lost_their_end_are_left_out():
    sent = [Burst(np.round(burst.values, 2)) for burst in bursts(6, seed=5)]
    lines = [burst.encode_text() for burst in sent]
    lines[2] = lines[2].removesuffix(b"\r\n")
    assert numbers(TextDecoder(CHIPS).feed(b"".join(lines)), sent) == [1, 4, 5]
    assert TextDecoder(4).feed(b"".join(lines)) == []
    decoder = TextDecoder(CHIPS)
    decoder.feed(b"1" * 100_000)
    assert decoder.pending == 0


def test_what_is_heard_is_named_with_its_chips():
    assert "9 bursts of 4 chips of the family 'magnetometer-board'" in describe(stream(bursts(10, chips=4)))
    text = b"".join(burst.encode_text() for burst in bursts(10))
    assert "lines of text of 5 chips of the family 'magnetometer-board' (setting text = true)" in describe(text)


# ---- over a port


@pytest.mark.real_time
def test_a_lossy_line_gives_no_wrong_field():
    profile = load_profile("anyskin")
    lossy = Faults(drop=1e-3, split=0.2, merge=0.1)
    with Emulator(profile, lambda now: FIELD, faults=lossy, seed=6) as one, open_sensor(one.port, profile) as skin:
        for _ in range(150):
            np.testing.assert_allclose(skin.read(PATIENCE).force, FIELD, atol=0.0051)
        assert skin.skipped > 0


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("speaks", "expects", "faults", "error", "says"),
    [
        ({"wire_layout": FOUR_CHIPS}, {}, Faults(), ProtocolError, "from 5 chips, .* bursts of 4 chips"),
        ({"settings": {"text": True}}, {}, Faults(), ProtocolError, "lines of text of 5 chips .*setting text = true"),
        ({}, {}, Faults(stall=1.0, stall_seconds=60.0), DeviceTimeoutError, "nothing came within 2 s"),
        ({}, {"slots": (Slot("left", 0), Slot("right", 1))}, Faults(), InvalidValueError, "slots must list one pad"),
    ],
    ids=["missing chips", "another sketch", "silence", "a second pad"],
)
def test_what_the_profile_does_not_expect_is_named(speaks, expects, faults, error, says):
    profile = load_profile("anyskin")
    other = replace(profile, **speaks)
    field = FIELD[..., : other.wire_layout.cols]
    with Emulator(other, lambda now: field, faults=faults) as emulator, pytest.raises(error, match=says):
        open_sensor(emulator.port, replace(profile, **expects))


@pytest.mark.real_time
def test_the_verbs_keep_and_print_the_unit(tmp_path, capsys):
    pytest.importorskip("rerun")
    profile, path, drawn = load_profile("anyskin"), tmp_path / "skin.mcap", tmp_path / "skin.rrd"
    with Emulator(profile, press(profile)) as emulator:
        common = [emulator.port, "--profile", "anyskin"]
        assert main(["record", *common, "--seconds", "1", "-o", str(path)]) == 0
        assert main(["live", *common, "--seconds", "0.5", "--save", str(drawn)]) == 0
    assert b"(uT)" in drawn.read_bytes()
    assert b"(N)" not in drawn.read_bytes()
    recording = paxisim.Recording.load(path)
    assert recording.unit == "uT"
    assert np.abs(recording.measured).max() > 1
    capsys.readouterr()
    # the recording can be played back
    playback = ["--signal", str(path), "--seconds", "0"]
    assert main(["emulate", "--profile", "anyskin", *playback]) == 0
    assert main(["emulate", "--profile", "gen2-box-120", *playback]) == 2
    assert "in uT, but profile" in capsys.readouterr().err


@pytest.mark.real_time
def test_the_authors_own_client_reads_the_emulator():
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
