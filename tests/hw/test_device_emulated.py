"""The whole driver against the emulator, over a real port: what every family passes with a profile of its own.

The force read is the force applied, in the pad's order and axes, also after unplugging and through two ports.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from emulated import small
from numpy.typing import NDArray

from paxisim import (
    InvalidValueError,
    Profile,
    ProtocolError,
    Slot,
    TactileSensor,
    TaxelLayout,
    UnsupportedError,
    load_profile,
)
from paxisim.hw.families.load import board_class
from paxisim.hw.families.table import FAMILIES

pytest.importorskip("serial")

from serial_peers import PATIENCE, reader_threads, wait_for

from paxisim import Emulator, open_sensor

pytestmark = pytest.mark.real_time


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    yield
    wait_for(lambda: not reader_threads())


def shuffled(rows: int, cols: int) -> TaxelLayout:
    """A grid with a random vendor order."""
    order = np.random.default_rng(rows * cols).permutation(rows * cols)
    return TaxelLayout(rows, cols, (2e-3, 3e-3), vendor_order=tuple(order.tolist()))


PROFILES = {
    "control-box": small(
        "control-box",
        [("left", 2), ("right", 5)],
        wire_layout=shuffled(12, 10),
        pool=(2, 2),
        settings={"mode": 5, "resultant_address": 1008},
    ),
    "hand-board": small("hand-board", [("tip", 1), ("pulp", 0)], wire_layout=shuffled(5, 3)),
    "serial-converter": small("serial-converter", [("pad", 3)], wire_layout=shuffled(4, 13), baud=921600),
    "high-speed": small(
        "high-speed", [("thumb", 9), ("index", 2)], wire_layout=shuffled(4, 13), baud=921600, rate=83.0
    ),
    "magnetometer-board": small("magnetometer-board", [("skin", 0)], wire_layout=shuffled(1, 5), baud=115200),
    "magnetometer-board, text": small(
        "magnetometer-board", [("skin", 0)], wire_layout=shuffled(1, 5), baud=115200, settings={"text": True}
    ),
    "xela-counts": replace(
        load_profile("xela-uspa44"),
        wire_layout=shuffled(4, 4),
        slots=(Slot("left", 2), Slot("right", 1)),
        axes=("-y", "+x", "+z"),
        verified="emulated",
    ),
    "xela-forces": replace(
        load_profile("xela-uspa44-calibrated"),
        wire_layout=shuffled(4, 4),
        slots=(Slot("left", 7),),
        axes=("-y", "+x", "+z"),
        verified="emulated",
    ),
}


def pattern(profile: Profile) -> NDArray[np.float64]:
    """Forces that vary over taxels and axes and span most of the range of a taxel's bytes."""
    shape = (len(profile.slots), *profile.wire_layout.shape)
    counts = (np.arange(np.prod(shape)).reshape(shape) * 37) % 125 + 2
    counts[:, :2] *= np.where(counts[:, :2] % 2 == 0, 1, -1)
    counts[:, 2] *= 2
    return counts * profile.resolution


def pressed(profile: Profile) -> NDArray[np.float32]:
    """The forces that the driver should read from `pattern`."""
    counts = np.rint(pattern(profile) / profile.resolution)
    if profile.pool != (1, 1):
        counts = profile.wire_layout.pool_force(counts, *profile.pool)
    return np.asarray(counts * profile.resolution, dtype=np.float32)


def first_good(pads: TactileSensor):
    """The first frame without an error byte."""
    while any((frame := pads.read(PATIENCE)).status):
        pass
    return frame


@pytest.fixture(params=PROFILES)
def profile(request: pytest.FixtureRequest) -> Profile:
    return PROFILES[request.param]


def test_what_is_pressed_is_read_and_the_port_may_go_away_and_come_back(profile: Profile, tmp_path: Path) -> None:
    force = pattern(profile)
    # a serial port returns under another name, hidden by a link; a server returns under the same one
    is_serial = FAMILIES[profile.family].transport == FAMILIES["control-box"].transport
    link = tmp_path / "ttySensor" if is_serial else None
    with Emulator(profile, lambda time: force, link=link) as emulator, open_sensor(emulator.port, profile) as pads:
        frames = [pads.read(PATIENCE) for _ in range(20)]
        assert pads.layout == profile.layout
        assert pads.pads == tuple(slot.name for slot in profile.slots)
        for frame in frames:
            assert (frame.force.dtype, frame.unit) == (np.float32, profile.unit)
            np.testing.assert_allclose(frame.force, pressed(profile), rtol=1e-6)
            assert not any(frame.status)
            assert frame.time <= frame.arrival
        assert [frame.sequence for frame in frames] == list(range(20))
        assert np.all(np.diff([frame.time for frame in frames]) >= 0)
        assert (pads.dropped, pads.reconnects, pads.timeouts, pads.bad_checksums) == (0, 0, 0, 0)
        assert bool(pads.version()) == bool(board_class(profile.family).questions)
        first_good(pads)
        emulator.unplug()
        wait_for(lambda: pads._readers[0].fault)
        emulator.plug()
        wait_for(lambda: pads.reconnects == 1)
        pads.latest(PATIENCE)
        after = first_good(pads)
        assert after.sequence > frames[-1].sequence
        np.testing.assert_allclose(after.force, pressed(profile), rtol=1e-6)


def test_frames_follow_the_signal_until_it_is_zeroed(profile: Profile) -> None:
    # small enough not to be clipped, so that zeroing leaves nothing
    force = np.rint(pattern(profile) / (4 * profile.resolution)) * profile.resolution

    def growing(time: float) -> NDArray[np.float64]:
        return force * min(1.0, time)

    with Emulator(profile, growing) as emulator, open_sensor(emulator.port, profile) as pads:
        totals = [0.0]
        while totals[-1] < force[:, 2].sum() * 0.999:
            totals.append(float(pads.read(PATIENCE).force[:, 2].sum()))
        assert totals == sorted(totals)
        if not board_class(profile.family).questions:
            with pytest.raises(UnsupportedError, match="in software"):
                pads.zero(software=False)
        pads.zero()
        np.testing.assert_allclose(first_good(pads).force, 0, atol=1e-5)


def test_two_ports_are_one_tensor(profile: Profile) -> None:
    left = pattern(profile)
    step = profile.resolution
    right = np.rint(left / (2 * step)) * step
    right[np.abs(right) < 1.5 * step] = 0
    with (
        Emulator(profile, lambda time: left) as first,
        Emulator(profile, lambda time: right) as second,
        open_sensor([first.port, second.port], profile) as pads,
    ):
        frames = [pads.read(PATIENCE) for _ in range(5)]
        half = len(profile.slots)
        assert pads.pads == tuple(f"{slot.name}{port}" for port in (0, 1) for slot in profile.slots)
        first_version, second_version = pads.version().split("\n")
        assert first_version == second_version
        expected = right if profile.pool == (1, 1) else profile.wire_layout.pool_force(right, *profile.pool)
        for frame in frames:
            np.testing.assert_allclose(frame.force[:half], pressed(profile), rtol=1e-6)
            np.testing.assert_allclose(frame.force[half:], expected, atol=1e-5)


def check_named(spoken: str, others: list[str]) -> None:
    """Check that drivers of other families name the family that is spoken, and leave the port free."""
    force = pattern(PROFILES[spoken])
    with Emulator(PROFILES[spoken], lambda time: force) as emulator:
        for expected in others:
            if board_class(expected).heard == board_class(spoken).heard:
                continue
            if FAMILIES[expected].transport != FAMILIES[spoken].transport:
                with pytest.raises(InvalidValueError, match=r"not a serial port|WebSocket server"):
                    open_sensor(emulator.port, PROFILES[expected])
                continue
            # the hand board's driver sends no requests of its own; the error must still name the family
            with pytest.raises(ProtocolError, match=f"family '{spoken}'"):
                open_sensor(emulator.port, PROFILES[expected])
            assert not reader_threads()
        open_sensor(emulator.port, PROFILES[spoken]).close()


@pytest.mark.parametrize("place", range(len(FAMILIES)), ids=list(FAMILIES))
def test_another_family_is_recognised_and_named(place: int) -> None:
    names = list(FAMILIES)
    check_named(names[place], [names[place - 1], names[place - 4]])


@pytest.mark.slow
@pytest.mark.parametrize("spoken", FAMILIES)
def test_all_other_families_are_recognised_and_named(spoken: str) -> None:
    check_named(spoken, list(FAMILIES))
