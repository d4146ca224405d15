"""A sensor with five magnetometers under repeated presses; its readings are made without paxisim."""

import numpy as np

from paxisim.recording import Recording

PITCH = 3


def press(seed=0, cycles=8, bend=0.2, lead=0.0, fresh=0.0, periods=(12.0,), rate=10.0, noise=1.5):
    """Return a recording of one episode in microtesla, with the covariate ``load``.

    Args:
        seed: Random seed of the noise; the sensor is the same for every seed.
        cycles: Number of presses to 30 N, separated by rests; their durations cycle through `periods` (s).
        bend: Relative size of the non-linear part of the field.
        lead: Delay of the load cell (s).
        fresh: Fraction by which the first press reads low; it halves with every further press.
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
