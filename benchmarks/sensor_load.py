"""Does the driver keep up with two 12x10 pads at the line's full rate, and what does it cost?

The emulator runs in a process of its own, so the CPU share is that of the driver alone: reading, checking, turning
into newtons, and a consumer that takes every frame.

    python benchmarks/sensor_load.py --seconds 60
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import time

import tyro

from paxisim.hw.device import open_sensor
from paxisim.hw.emulation.control_box import USB_SPEED
from paxisim.hw.emulator import Emulator
from paxisim.hw.profile import Profile, Slot, load_profile
from paxisim.hw.signals import press

PAPER = dataclasses.replace(
    load_profile("gen1-pap-l4629"), verified="on the emulator", slots=(Slot("left", 0), Slot("right", 3))
)
# a message for each pad: it selects a port and reads total and taxels in one go
BOX_BYTES = 2 * (17 + 17 + 6 + 30 + 360)
STREAM_BYTES = 7 + 2 * (6 + 360)
# bytes a second: the box hangs on USB, where its baud rate means nothing
SPEEDS = {"control-box": USB_SPEED, "high-speed": 92160.0}
CASES = {
    "control-box": (PAPER, BOX_BYTES),
    "high-speed": (
        dataclasses.replace(
            PAPER, family="high-speed", baud=921600, settings={}, slots=(Slot("left", 0), Slot("right", 1))
        ),
        STREAM_BYTES,
    ),
}
CPU_TARGET = 0.08


def emulate(profile: Profile) -> None:
    """Be the sensor until stdin closes, then say how many bytes nobody fetched."""
    # far beyond the line: what leaves is what the line carries
    rate = 1e6 if profile.family == "high-speed" else None
    with Emulator(profile, press(profile), rate=rate) as emulator:
        print(emulator.port, flush=True)
        sys.stdin.read()
    print(emulator.overruns)


def measure(name: str, seconds: float) -> bool:
    """Print one case; whether it met its targets."""
    profile, size = CASES[name]
    command = [sys.executable, __file__, "--emulate-case", name]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    assert process.stdout is not None
    with open_sensor(process.stdout.readline().strip(), profile) as sensor:
        sensor.latest(10.0)
        frames, gaps, worst = 0, 0, 0.0
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
    limit = SPEEDS[name] / size
    share = cpu / wall
    print(f"{name}: {frames} frames of 2 pads in {wall:.1f} s, {counters}, {overruns} bytes lost on the line")
    print(f"  rate {frames / wall:.1f} Hz, the line's limit {limit:.1f} Hz; longest gap {1e3 * worst:.1f} ms")
    verdict = "met" if share < CPU_TARGET else "NOT MET"
    print(f"  driver {100 * share:.1f} % of one core (target {100 * CPU_TARGET:.0f} %: {verdict})", flush=True)
    return clean and not overruns and share < CPU_TARGET


def main(seconds: float = 60.0, emulate_case: str = "") -> int:
    """Run both cases.

    Args:
        seconds: How long each is measured.
        emulate_case: Be the emulator of that case instead.
    """
    if emulate_case:
        emulate(CASES[emulate_case][0])
        return 0
    met = [measure(name, seconds) for name in CASES]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
