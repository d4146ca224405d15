"""Record a sensor, read the recording, and convert it for the live view and for pandas.

An emulator replaces the sensor: it speaks the protocol of PaXini's control box on a pseudo-terminal (Linux). With your
own sensor, leave out the emulator and use the sensor's port. Needs the extras hw, live and parquet:

    python examples/record_and_live.py
"""

from __future__ import annotations

import warnings

import numpy as np

import paxisim
from paxisim.cli import main as paxisim_command
from paxisim.hw.capture.capture import capture

PROFILE = "gen2-box-120"  # 12x10 taxels
SECONDS = 3.0


def press(now: float) -> np.ndarray:
    """Return the forces on the emulated pad: one press per second, hardest in the middle, that drags along x.

    Args:
        now: Time since the emulator started (s).

    Returns:
        ``(1, 3, 12, 10)`` newtons.
    """
    row, col = np.meshgrid(np.linspace(-1, 1, 12), np.linspace(-1, 1, 10), indexing="ij")
    normal = 2.0 * np.sin(np.pi * (now % 1.0)) * np.exp(-2 * (row**2 + col**2))
    return np.stack([0.3 * normal * np.sin(6 * now), 0 * normal, normal])[None]


def main() -> None:
    """Record, describe, convert."""
    warnings.simplefilter("ignore", paxisim.UnverifiedProfileWarning)  # no one has tried this profile on a device
    with paxisim.Emulator(PROFILE, press) as emulator, paxisim.open_sensor(emulator.port, PROFILE) as sensor:
        frame = sensor.read()
        print(f"one frame: {frame.force.shape} {frame.unit}, normal force {frame.force[0, 2].sum():.1f} N")
        summary = capture(sensor, "press.mcap", seconds=SECONDS, overwrite=True)  # as `paxisim record` does
    print(f"{summary.path}: {summary.frames} frames at {summary.rate:.0f} Hz, {summary.dropped} dropped")

    recording = paxisim.Recording.load("press.mcap").select(known=True)
    total = recording.measured.sum(axis=(-2, -1))[:, 0, 2]
    print(f"normal force from {total.min():.1f} to {total.max():.1f} N in {recording.duration:.1f} s")

    # as in the shell; without --save, `paxisim live press.mcap` opens Rerun's viewer
    paxisim_command(["live", "press.mcap", "--save", "press.rrd", "--force"])
    paxisim_command(["convert", "press.mcap", "press.parquet", "--force"])


if __name__ == "__main__":
    main()
