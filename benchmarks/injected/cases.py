"""Cases: real signals with one effect each, unchanged real signals (nulls), and streams that do not correspond.

A case is a random run of presses from both recordings. All eFlesh presses have the same speed, at which memory, filters
and delays cannot be told apart. Therefore the **clock of each press runs faster** by a random factor of `SPEEDS`, and
frames are dropped until all presses have the same frame rate. Values stay as they are, and both streams are treated
alike: slow effects of the real sensor stay the same in both, and only the injected effect, in seconds of the new clock,
depends on the speed. One null in four keeps its own clock.

The effect acts on the real signal, so it also acts on the sensor's noise: a filter smooths it, a limit clips it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from injected.effects import KINDS, Floats, Scene, drawn
from injected.real import Real, load_both, regressions, simulate
from paxisim.recording import Recording

SPEEDS = {3: 2, 6: 4, 12: 8}
"""Speed-up of the clock, and the number of frames of which one is kept."""
SLOW = {1: 3}
FEWEST = 8  # fewest presses of a case


@dataclass(frozen=True, eq=False)
class Case:
    """A recording to be diagnosed, with its ground truth.

    Attributes:
        name: Name, such as ``injected:3``.
        group: ``injected``, ``null`` or ``broken``.
        kind: Kind of effect, null or broken stream.
        words: Description of the random draw.
        recording: The recording that a user would have.
        ideal: ``(T, 1, 3, 1, 5)`` newtons, simulation with the effect; None for broken streams.
        signal: Energy of the effect on the real signal, relative to that of the regression's residual.
        shift: Delay of the measured clock (s), for shifted streams.
    """

    name: str
    group: str
    kind: str
    words: str
    recording: Recording
    ideal: Floats | None = None
    signal: float = 0.0
    shift: float = 0.0


@dataclass(frozen=True, eq=False)
class Base:
    """A run of presses: the real signal and its regression.

    Attributes:
        recording: Measured and simulated streams, with the robot's pose and, if drawn, a joint angle.
        scene: The same signal, for drawing an effect.
        words: Description of the presses, the regression and the clock.
    """

    recording: Recording
    scene: Scene
    words: str


class Source:
    """Both recordings and their regressions, each computed once."""

    def __init__(self, folder: Path):
        """Load the recordings from `folder`, see `load_both`."""
        self.both = load_both(folder)
        self._simulated: dict[tuple[int, str], Floats] = {}

    def simulated(self, which: int, name: str) -> Floats:
        """``(T, 3, 5)`` newtons, regression of a recording."""
        if (which, name) not in self._simulated:
            self._simulated[which, name] = simulate(self.both[which], name)
        return self._simulated[which, name]

    def base(self, rng: np.random.Generator, *, own_clock: bool = False, joint: bool | None = None) -> Base:
        """Draw presses, a regression, clocks and possibly a moving joint.

        Args:
            rng: Random generator.
            own_clock: Whether the clocks stay unchanged.
            joint: Whether the recording has a joint angle; by default with probability 0.5.
        """
        name = regressions()[int(rng.integers(len(regressions())))]
        pool = [(which, press) for which, real in enumerate(self.both) for press in _used(real)]
        count = int(rng.integers(FEWEST, len(pool) + 1))
        taken = [pool[i] for i in np.sort(rng.choice(len(pool), count, replace=False))]
        kinds = list((SLOW if own_clock else SPEEDS).items())
        pace = [kinds[i] for i in rng.permutation(np.resize(np.arange(len(kinds)), count))]
        joint = bool(rng.random() < 0.5) if joint is None else joint
        parts: dict[str, list[np.ndarray]] = {key: [] for key in ("time", "force", "simulated", "episode")}
        poses: dict[str, list[np.ndarray]] = {key: [] for key in self.both[0].covariates}
        end = 0.0
        for number, ((which, press), (speed, keep)) in enumerate(zip(taken, pace, strict=True)):
            real = self.both[which]
            frames = np.flatnonzero(real.press == press)
            frames = frames[int(rng.integers(keep)) :: keep]
            time = (real.time[frames] - real.time[frames[0]]) / speed
            parts["time"].append(end + time)
            end += float(time[-1] + np.median(np.diff(time)))
            parts["force"].append(real.force[frames])
            parts["simulated"].append(self.simulated(which, name)[frames])
            parts["episode"].append(np.full(len(frames), number))
            for key, values in real.covariates.items():
                poses[key].append(values[frames])
        time, force, simulated, episode = (np.concatenate(part) for part in parts.values())
        angle = _joint(rng, time)
        covariates = {key: np.concatenate(values) for key, values in poses.items()}
        peak = float(np.quantile(np.abs(simulated), 0.995, axis=0).max())
        recording = Recording(
            time, tensor(force), tensor(simulated), covariates | ({"joint_angle": angle} if joint else {}), episode
        )
        numbers = " ".join(f"{which + 1}.{press}" for which, press in taken)
        clock = "own clock" if own_clock else "clocks times " + " ".join(str(speed) for speed, _ in pace)
        return Base(
            recording, Scene(time, force, peak, episode, angle), f"presses {numbers}, {clock}, regression {name}"
        )


def _used(real: Real) -> range:
    return range(real.used.start, real.used.stop)


def _joint(rng: np.random.Generator, time: Floats) -> Floats:
    """``(T,)`` rad, angle of a joint that swings independently of the presses."""
    periods, phases = rng.uniform(4.0, 25.0, 3), rng.uniform(0, 2 * np.pi, 3)
    return 0.6 * np.sin(2 * np.pi * time[:, None] / periods + phases).sum(axis=1) / np.sqrt(1.5)


def tensor(force: Floats) -> np.ndarray:
    """Convert ``(T, 3, 5)`` to ``(T, 1, 3, 1, 5)`` float32."""
    return force[:, None, :, None, :].astype(np.float32)


def injected(source: Source, seed: int, number: int) -> Case:
    """Return a real signal with an effect; the numbers cycle through the kinds."""
    kind = KINDS[number % len(KINDS)]
    rng = np.random.default_rng([seed, 1, number])
    base = source.base(rng, joint=True if kind == "interference" else None)
    words, apply = drawn(kind, rng, base.scene)
    force, simulated = base.scene.force, np.asarray(base.recording.simulated, dtype=float)[:, 0, :, 0]
    changed = apply(force)
    signal = float(np.sum((changed - force) ** 2) / np.sum((force - simulated) ** 2))
    made = replace(base.recording, measured=tensor(changed))
    ideal = apply(simulated)[:, None, :, None]
    return Case(f"injected:{number}", "injected", kind, f"{words}; {base.words}", made, ideal, signal)


def null(source: Source, seed: int, number: int) -> Case:
    """Return the real signal paired with its own regression, without an effect."""
    own_clock = number % 4 == 3
    base = source.base(np.random.default_rng([seed, 2, number]), own_clock=own_clock)
    ideal = np.asarray(base.recording.simulated, dtype=float)
    kind = "own clock" if own_clock else "faster clocks"
    return Case(f"null:{number}", "null", kind, base.words, base.recording, ideal)
