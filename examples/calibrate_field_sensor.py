"""From microtesla to newtons: calibrate an AnySkin against a load cell, and read it in newtons.

The sensor is made up: five magnetometers whose channels mix the axes of the load and follow it with a delay of 30 ms.
The example records it with a load cell, calibrates it, and then reads it live through an emulator on a pseudo-terminal
(Linux). Needs the extras viz and hw:

    python examples/calibrate_field_sensor.py
"""

from __future__ import annotations

import time as clock
import warnings

import numpy as np

import paxisim

LOADS = ("Fx", "Fy", "Fz")
DELAY = 0.03  # s
RATE = 80.0  # Hz
RNG = np.random.default_rng(0)
GAINS = RNG.normal(size=(3, 15)) * np.array([[20.0], [20.0], [10.0]])  # uT/N of each channel


def load(time: np.ndarray) -> np.ndarray:
    """Return the load (N), ``(T, 3)``: presses with peaks of 6 to 10 N that drag back and forth."""
    press = 8 * np.clip(np.sin(2 * np.pi * 0.3 * time), 0, None) ** 2 * (1 + 0.3 * np.sin(0.2 * time))
    return np.stack([0.3 * press * np.sin(3.1 * time), 0.3 * press * np.sin(4.7 * time), press], axis=1)


def field(loads: np.ndarray) -> np.ndarray:
    """Return the field (uT), ``(T, 1, 3, 1, 5)``, under loads ``(T, 3)``."""
    return np.moveaxis((loads @ GAINS).reshape(-1, 5, 3), 1, 2)[:, None, :, None]


def record(seconds: float = 60.0) -> paxisim.Recording:
    """Return a recording as from `paxisim record --udp`: the channels, and the load cell as covariates."""
    time = np.arange(0, seconds, 1 / RATE)
    cell = load(time) + RNG.normal(0, 0.02, (len(time), 3))
    measured = field(load(time - DELAY))
    measured = measured + RNG.normal(0, 0.5, measured.shape)
    return paxisim.Recording(time, measured, covariates=dict(zip(LOADS, cell.T, strict=True)), metadata={"unit": "uT"})


def main() -> None:
    """Calibrate, draw the fit, and read live."""
    raw = record()
    raw.save("raw.mcap")
    # in the shell: paxisim calibrate raw.mcap --loads Fx=Fx Fy=Fy Fz=Fz -o sensor.json
    calibration = paxisim.calibrate_sensor(raw, {name: name for name in LOADS})
    print(calibration)
    calibration.save("sensor.json")
    paxisim.plot_calibration(calibration.readout, raw).savefig("calibration.png")

    warnings.simplefilter("ignore", paxisim.UnverifiedProfileWarning)  # no one has tried this profile on a device
    pushed = np.array([[1.0, -0.5, 4.0]])
    began = clock.monotonic()

    def felt(now: float) -> np.ndarray:
        return field(pushed * (clock.monotonic() - began > 1.0))[0]

    calibration = paxisim.Calibration.load("sensor.json")
    with (
        paxisim.Emulator("anyskin", felt) as emulator,
        paxisim.open_sensor(emulator.port, profile="anyskin", calibration=calibration) as skin,
    ):
        skin.zero()  # nothing touches the sensor yet
        clock.sleep(max(0.0, began + 1.5 - clock.monotonic()))
        frame = skin.latest()
    print(f"\npushed with {pushed[0]} N, read {frame.resultant[0].round(2)} N")


if __name__ == "__main__":
    main()
