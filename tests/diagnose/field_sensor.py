"""A sensor of five magnetometers that is pressed again and again: no part of paxisim makes its readings."""

import numpy as np

from paxisim.recording import Recording

PITCH = 3


def press(seed=0, cycles=8, bend=0.2, lead=0.0, fresh=0.0, periods=(12.0,), rate=10.0, noise=1.5):
    """A recording of one episode in microtesla, with the covariate ``load``.

    Args:
        seed: Of the sensor and its noise; the sensor is the same for each.
        cycles: Presses to 30 N, each of the next of `periods` (s), with rests between them.
        bend: How much of the field is not straight.
        lead: Seconds by which the load cell is late.
        fresh: Share that the first press reads less; half of it at the second, and so on.
    """
    rng = np.random.default_rng(seed)
    loads, factors = [np.zeros(30)], [np.ones(30)]
    for number in range(cycles):
        count = round(periods[number % len(periods)] * rate)
        loads += [15 * (1 - np.cos(2 * np.pi * np.arange(count) / count)), np.zeros(30)]
        factors += [np.full(count + 30, 1 - fresh * 0.5**number)]
    load, factor = np.concatenate(loads), np.concatenate(factors)
    time = np.arange(len(load)) / rate
    sensor = np.random.default_rng(99)
    gain = sensor.choice([-1, 1], 15) * sensor.uniform(10, 90, 15)
    shape = bend * sensor.uniform(-1, 1, (15, 1))
    share = load / 30
    field = gain[:, None] * 30 * (share * factor + shape * (share * factor) * (1 - share))
    field = field.T + noise * rng.standard_normal((len(load), 15))
    late = np.interp(time - lead, time, load)
    return Recording(time, np.moveaxis(field.reshape(-1, 5, 3), 1, 2)[:, None, :, None], covariates={"load": late})
