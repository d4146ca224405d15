"""Simulator, driver, emulator and recording share one layout: a press gives the same tensor in each of them."""

import contextlib

import numpy as np
import pytest
from pressed_pads import LAYOUT, pressed_force

from paxisim.hw.emulation.signals import from_recording
from paxisim.hw.families.table import FAMILIES
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

pytest.importorskip("serial")

from paxisim.hw.device import open_sensor
from paxisim.hw.emulation.emulator import Emulator

pytestmark = pytest.mark.real_time

# a device that differs from the tensor in order, axes and signs
ORDER = (4, 9, 14, 3, 8, 13, 2, 7, 12, 1, 6, 11, 0, 5, 10)
AXES = ("-y", "+x", "+z")
NAMES = ("left", "right")
HALF_A_COUNT = 0.05  # N


@pytest.fixture(scope="module")
def force():
    pressed = pressed_force()
    # any flip, swap or wrong sign changes the tensor noticeably
    for changed in (
        pressed[::-1],
        pressed[:, [1, 0, 2]],
        pressed[..., ::-1, :],
        pressed[..., ::-1],
        pressed[..., ::-1, ::-1],
        pressed * np.array([-1, 1, 1])[:, None, None],
        pressed * np.array([1, -1, 1])[:, None, None],
    ):
        assert np.abs(changed - pressed).max() > 0.5
    return pressed


def device(family: str) -> Profile:
    """A profile of two pads on one board; serial converter and magnetometer board have only one."""
    wire = TaxelLayout(LAYOUT.rows, LAYOUT.cols, LAYOUT.pitch, vendor_order=ORDER)
    slots = (Slot("left", 3), Slot("right", 1))
    if family in ("serial-converter", "magnetometer-board"):
        slots = (Slot("pad", 1),)
    settings = {"mode": 5} if family == "control-box" else {}
    return Profile("device", family, wire, slots, AXES, rate=50.0, settings=settings, verified="in a test")


def measure(profile: Profile, signal):
    """Return a frame and the sensor's layout, read through as many ports as two pads require."""
    pads = len(profile.slots)
    with contextlib.ExitStack() as stack:
        ports = []
        for first in range(0, 2, pads):
            part = slice(first, first + pads)
            emulator = Emulator(profile, lambda now, part=part: signal(now)[part], gate=0)
            ports.append(stack.enter_context(emulator).port)
        sensor = stack.enter_context(open_sensor(ports if len(ports) > 1 else ports[0], profile))
        return sensor.read(20.0), sensor.layout


@pytest.mark.parametrize("family", FAMILIES)
def test_the_driver_gives_what_the_simulator_gives(family, force):
    frame, layout = measure(device(family), lambda now: force)
    assert frame.force.shape == force.shape == (2, *layout.shape)
    assert frame.force.dtype == force.dtype == np.float32
    assert np.abs(frame.force - force).max() <= HALF_A_COUNT + 1e-6
    np.testing.assert_array_equal(layout.positions, LAYOUT.positions)
    if frame.resultant is not None:
        assert np.abs(frame.resultant - force.sum(axis=(-2, -1))).max() <= 15 * HALF_A_COUNT


@pytest.mark.parametrize("suffix", [".mcap", ".npz"])
def test_a_recording_gives_back_what_it_was_given_and_can_be_felt_again(suffix, force, tmp_path):
    path = tmp_path / f"press{suffix}"
    scale = np.array([0.5, 1.0, 0.75], dtype=np.float32)
    samples = scale[:, None, None, None, None] * force
    Recording(
        time=np.array([0.0, 0.1, 0.2]), measured=samples, simulated=samples[::-1], layout=LAYOUT, pads=NAMES
    ).save(path)
    loaded = Recording.load(path)
    np.testing.assert_array_equal(loaded.measured, samples)
    np.testing.assert_array_equal(loaded.simulated, samples[::-1])
    assert loaded.measured.dtype == np.float32
    assert loaded.layout == LAYOUT
    assert loaded.pads == NAMES

    profile = device("high-speed")
    signal = from_recording(loaded, profile)
    frame, _ = measure(profile, lambda now: signal(0.1))
    assert np.abs(frame.force - force).max() <= HALF_A_COUNT + 1e-6
