"""Whether the driver keeps up with sensors at the line's full rate, its CPU load and its memory.

The sensors are two pads of 12x10 taxels on two of PaXini's boards, an AnySkin, and four uSkin patches of 4x4 behind
XELA's server.

The emulator runs in a separate process, so the measured CPU share covers only the driver (reading, checking and
conversion to newtons) and a consumer that takes every frame.

    python benchmarks/sensor_load.py --seconds 60
"""

from __future__ import annotations

import dataclasses
import resource
import subprocess
import sys
import time

import tyro

from paxisim.hw.device import open_sensor
from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.emulation.signals import press
from paxisim.hw.families.control_box.emulated import USB_SPEED
from paxisim.hw.profiles.load import load_profile
from paxisim.hw.profiles.profile import Profile, Slot

PAPER = dataclasses.replace(
    load_profile("gen1-pap-l4629"), verified="on the emulator", slots=(Slot("left", 0), Slot("right", 3))
)
SKIN = dataclasses.replace(load_profile("anyskin"), verified="on the emulator")
USKIN = dataclasses.replace(
    load_profile("xela-uspa44"), verified="on the emulator", slots=tuple(Slot(f"pad{i}", i) for i in range(1, 5))
)
# per pad: select a port, then read total and taxels with one request
BOX_BYTES = 2 * (17 + 17 + 6 + 30 + 360)
STREAM_BYTES = 7 + 2 * (6 + 360)
BURST_BYTES = 16 * 5 + 2
BEYOND = 1e6
"""A rate far beyond the line's capacity, so that the line limits the stream (Hz)."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One sensor.

    Attributes:
        profile: The sensor's profile.
        limit: Maximum frame rate of its line, or frame rate of its server (Hz).
        rate: The emulator's rate (Hz); None: a new measurement for each request.
    """

    profile: Profile
    limit: float
    rate: float | None


CASES = {
    # connected by USB, where the baud rate has no effect
    "control-box": Case(PAPER, USB_SPEED / BOX_BYTES, None),
    "high-speed": Case(
        dataclasses.replace(
            PAPER, family="high-speed", baud=921600, settings={}, slots=(Slot("left", 0), Slot("right", 1))
        ),
        92160.0 / STREAM_BYTES,
        BEYOND,
    ),
    "anyskin": Case(SKIN, SKIN.baud / 10 / BURST_BYTES, BEYOND),
    "uskin": Case(USKIN, 100.0, 100.0),
}
CPU_TARGET = 0.08
MEMORY_TARGET = 2.0
"""Largest growth of the peak memory after the first second (MB)."""


def peak_memory() -> float:
    """Return the largest resident memory of this process so far (MB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def emulate(case: Case) -> None:
    """Emulate the sensor until stdin closes, then print how many bytes nobody read."""
    with Emulator(case.profile, press(case.profile), rate=case.rate) as emulator:
        print(emulator.port, flush=True)
        sys.stdin.read()
    print(emulator.overruns)


def measure(name: str, seconds: float) -> bool:
    """Measure and print one case; return whether it met its targets."""
    case = CASES[name]
    command = [sys.executable, __file__, "--emulate-case", name]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    assert process.stdout is not None
    with open_sensor(process.stdout.readline().strip(), case.profile) as sensor:
        sensor.latest(10.0)
        settled = time.monotonic() + 1.0
        while time.monotonic() < settled:
            sensor.read(10.0)
        frames, gaps, worst, memory = 0, 0, 0.0, peak_memory()
        start, cpu = time.monotonic(), time.process_time()
        before = sensor.read(10.0)
        while time.monotonic() - start < seconds:
            frame = sensor.read(10.0)
            frames += 1
            gaps += frame.sequence - before.sequence - 1
            worst = max(worst, frame.arrival - before.arrival)
            before = frame
        wall, cpu = time.monotonic() - start, time.process_time() - cpu
        counters = f"{sensor.dropped} dropped, {gaps} missing, {sensor.bad_checksums} bad checksums"
        clean = not (sensor.dropped or gaps or sensor.bad_checksums or sensor.skipped)
    said, _ = process.communicate("")
    overruns = int(said)
    share, pads = cpu / wall, len(case.profile.slots)
    what = f"{frames} frames of {pads} pad{'s' * (pads > 1)} in {wall:.1f} s"
    print(f"{name}: {what}, {counters}, {overruns} bytes lost on the line")
    print(f"  rate {frames / wall:.1f} Hz, the line's limit {case.limit:.1f} Hz; longest gap {1e3 * worst:.1f} ms")
    verdict = "met" if share < CPU_TARGET else "NOT MET"
    print(f"  driver {100 * share:.1f} % of one core (target {100 * CPU_TARGET:.0f} %: {verdict})", flush=True)
    growth = peak_memory() - memory
    print(f"  peak memory grew by {growth:.2f} MB (target {MEMORY_TARGET:g} MB)", flush=True)
    return clean and not overruns and share < CPU_TARGET and growth < MEMORY_TARGET


def main(seconds: float = 60.0, cases: tuple[str, ...] = tuple(CASES), emulate_case: str = "") -> int:
    """Run all cases.

    Args:
        seconds: Duration of each measurement (s).
        cases: Sensors to measure, of `CASES`.
        emulate_case: Emulate the sensor of this case instead.
    """
    if emulate_case:
        emulate(CASES[emulate_case])
        return 0
    met = [measure(name, seconds) for name in cases]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
