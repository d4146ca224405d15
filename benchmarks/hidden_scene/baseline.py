"""The baseline: least squares over all numbers of the scene at once, as in system identification.

It uses the same replays as the diagnosis, interpolated linearly, but no poses per episode, no causes of the sensor, no
tolerances and no held-out episodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import paxisim
from paxisim.diagnose.data.responses import SHOWN
from paxisim.diagnose.inside.study import Study
from paxisim.scene.replays import Replays

EVERY = 4  # every n-th frame is fitted
NORMAL_90 = 1.645  # half-width of a 90 % interval, in standard deviations


@dataclass(frozen=True)
class Fitted:
    """Result of the least squares.

    Attributes:
        named: Causes with a number that is materially off and whose 90 % interval excludes the scene's value.
        intervals: 90 % interval ``(low, high)`` of each number by name, in SI units.
    """

    named: tuple[str, ...]
    intervals: dict[str, tuple[float, float]]


def fit(recording: paxisim.Recording, scene: paxisim.Scene, replays: Path) -> Fitted:
    """Fit all numbers of the scene to a recording.

    Args:
        recording: Measured forces and the streams that drive the scene.
        scene: The scene.
        replays: Folder in which replays are kept.
    """
    replay = scene.prepare(recording)
    recording = replay.paired([replay.run(number) for number in replay.episodes])
    with Replays(scene, recording, folder=replays) as made:
        study = Study(made)
        study.glance(lambda stage, share: None)  # the poses
        study.screen(lambda stage, share: None)  # all others
        responses = study.responses().select(np.arange(0, len(recording), EVERY))
    assert recording.measured is not None
    lacking = (recording.measured - study.base)[::EVERY].astype(np.float64)
    numbers = [one.parameter for one in responses.each]
    groups = list(dict.fromkeys(item.group for item in numbers))

    def residual(steps: np.ndarray) -> np.ndarray:
        values = {item.name: item.nominal + item.step * s for item, s in zip(numbers, steps, strict=True)}
        left = lacking.copy()
        for group in groups:
            own = [values[one.parameter.name] * SHOWN[one.parameter.unit][1] for one in responses.of(group)]
            left -= responses.change(group, own)
        return left.ravel()

    low = [(item.low - item.nominal) / item.step for item in numbers]
    high = [(item.high - item.nominal) / item.step for item in numbers]
    found = least_squares(residual, np.zeros(len(numbers)), bounds=(low, high), diff_step=1e-3, max_nfev=20)
    variance = 2 * found.cost / max(len(found.fun) - len(numbers), 1)
    spread = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)) * variance)
    named, intervals = [], {}
    for item, steps, own in zip(numbers, found.x, spread, strict=True):
        value, half = item.nominal + item.step * steps, NORMAL_90 * item.step * own
        intervals[item.name] = value - half, value + half
        if abs(value - item.nominal) > max(item.material, half) and item.group != "impratio":
            named.append(item.group)
    return Fitted(tuple(dict.fromkeys(named)), intervals)
