"""Fit of a background: how the readings of a sensor that nothing touches depend on the robot's joints."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.background import MAX_VALUES, Background, features, scaled, side_by_side
from paxisim.calibrate.linear import delayed
from paxisim.calibrate.loads import noise_of
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.recording import Recording

WIDTHS = (0.25, 0.5, 1.0)
"""Widths that are tried for the bumps of all values, times the root of their number; each is scaled to -1 to 1."""
LINE_BUMPS, LINE_WIDTH = 20, 0.15
"""Number and width of the bumps of each value by itself."""
RIDGES = (1e-8, 1e-6, 1e-4, 1e-2)
"""Regularisation strengths that are tried, relative to the number of samples."""
MOST_BUMPS = 150
"""Maximum number of bumps of all values together."""
MIN_SAMPLES = 100
MOST_SAMPLES = 20_000
"""Samples that a fit uses; of longer recordings, every nth."""
FOLDS = 5
BLOCKS = 20
"""Blocks of time of a recording with fewer episodes than folds."""
DRIFT_DEGREE = 2
"""Degree of the polynomial of time that stands for the drift of each channel."""
USELESS = 0.9
"""A background must leave less than this share of what the channels read without it."""
TOUCHED = 6.0
"""Ratio between the 99th percentile and the median of what is left of a sample beyond which a warning is given."""
SHIFTS = np.arange(-0.2, 0.21, 0.02)
"""Delays (s) between channels and covariates that are tried for the warning."""
LATE = 0.7
"""A shift in time that leaves less than this share of the error causes a warning."""
NOT_NOISE = 4.0
"""Ratio between what is left on held-out data and the noise beyond which a warning is given."""

_STILL = 1e-9  # range of a value that does not change, as a share of the covariate's largest

Array = NDArray[np.float64]


def fit_background(recording: Recording, covariates: str | Sequence[str]) -> Background:
    """Fit the field of a sensor without contact to covariates, for subtraction.

    Move the robot through its range with nothing at the sensor, slowly and back and forth, and record the joint
    positions with it: the opening of the gripper for the magnets of the other finger, the joints of the arm (or the
    quaternion of the hand) for the earth's field, a temperature for its drift.

    The fit is ridge regression on a constant, the covariates, their products, Gaussian bumps of each value by itself,
    and Gaussian bumps of all values together if they help. The width of the latter and the strength of the ridge are
    those with the smallest error on held-out episodes, or on held-out blocks of time of a recording with a few
    episodes. A slow drift is fitted with it and left out of the background: no joint explains it, and
    `TactileSensor.zero` removes it.

    Args:
        recording: Recording without contact, with the channels in `measured`, in any unit.
        covariates: Names of the covariates, with at most 16 values together.

    Warns:
        UserWarning: Something may have touched the sensor, the covariates lie at other times than the channels, a
            covariate moves with time only, so that its effect cannot be told from a drift, or what is left is far above
            the noise.

    Raises:
        UnknownNameError: There is no such covariate.
        InvalidValueError: `measured` is missing, a covariate does not vary, too few samples are known, or the
            covariates explain nothing of the channels.
    """
    names = (covariates,) if isinstance(covariates, str) else tuple(covariates)
    data = _prepare(recording, names)
    choices = [_Fit(data, *_bumps(data, width)) for width in (None, *(WIDTHS if len(data.low) > 1 else ()))]
    fit, ridge, left = min(
        ((fit, ridge, left) for fit in choices for ridge, left in zip(RIDGES, fit.held_out(), strict=True)),
        key=lambda choice: float(np.sum(choice[2] ** 2)),
    )
    error, before = (np.sqrt(np.mean(x**2, axis=0)) for x in (left, data.without_drift(data.channels)))
    total_before, total = (float(np.sqrt(np.mean(x**2))) for x in (before, error))
    if not total < USELESS * total_before:
        raise InvalidValueError(
            f"{', '.join(names)} do not explain what the channels read without contact, {total_before:.3g} "
            f"{recording.unit} about their mean: {total:.3g} {recording.unit} are left on held-out data; record other "
            "covariates, or a larger motion"
        )
    weights, drift = fit.solve(ridge)
    assert recording.measured is not None
    noise = noise_of(recording.measured[:, data.used].astype(np.float64))
    _warn(data, names, fit, ridge, left, noise)
    drift_range = np.ptp(data.drift @ drift, axis=0)
    weights[0] += np.mean(data.drift @ drift, axis=0)

    def tensor(own: Array) -> Array:
        whole = np.zeros(data.used.shape)
        whole[data.used] = own
        return whole

    return Background(
        covariates=names,
        sizes=data.sizes,
        low=data.low,
        high=data.high,
        bumps=fit.bumps,
        sharpness=fit.sharpness,
        weights=weights,
        used=data.used,
        unit=recording.unit,
        before=tensor(before),
        error=tensor(error),
        noise=tensor(noise),
        drift=tensor(drift_range),
        profile=str(recording.metadata.get("profile", "")),
    )


@dataclass(frozen=True, eq=False)
class _Data:
    """Known samples: channels ``(T, C)``, scaled covariates ``(T, V)``, drift terms ``(T, D)``, fold of each sample."""

    time: Array
    episode: NDArray[np.int64]
    channels: Array
    values: Array
    drift: Array
    fold: NDArray[np.intp]
    low: Array
    high: Array
    sizes: tuple[int, ...]
    used: NDArray[np.bool_]

    def without_drift(self, columns: Array) -> Array:
        """Return ``(T, columns)`` without a polynomial of time."""
        base = np.linalg.qr(self.drift)[0]
        return columns - base @ (base.T @ columns)


class _Fit:
    """Ridge regression of the channels on the features of one width, with the drift fitted free of any penalty."""

    def __init__(self, data: _Data, bumps: Array, sharpness: Array) -> None:
        self.data, self.bumps, self.sharpness = data, bumps, sharpness
        self.features = features(data.values, bumps, sharpness)

    def held_out(self) -> list[Array]:
        """Return what is left of each held-out sample, ``(T, C)``, for each of `RIDGES`."""
        left = [np.empty_like(self.data.channels) for _ in RIDGES]
        for fold in range(FOLDS):
            out = self.data.fold == fold
            for own, (weights, drift) in zip(left, self._solutions(~out, RIDGES), strict=True):
                own[out] = self.data.channels[out] - self.features[out] @ weights - self.data.drift[out] @ drift
        return left

    def solve(self, ridge: float) -> tuple[Array, Array]:
        """Return the weights of the features and of the drift, fitted to all samples."""
        return self._solutions(np.ones(len(self.data.time), dtype=bool), (ridge,))[0]

    def error_of_shift(self, values: Array, ridge: float) -> float:
        """Return the root mean square of what a fit to other covariates leaves."""
        shifted = _Fit(replace(self.data, values=values), self.bumps, self.sharpness)
        weights, drift = shifted.solve(ridge)
        left = self.data.channels - shifted.features @ weights - self.data.drift @ drift
        return float(np.sqrt(np.mean(left**2)))

    def _solutions(self, known: NDArray[np.bool_], ridges: Sequence[float]) -> list[tuple[Array, Array]]:
        x, y, drift = self.features[known], self.data.channels[known], self.data.drift[known]
        base = np.linalg.qr(drift)[0]
        centred, target = x - base @ (base.T @ x), y - base @ (base.T @ y)
        values, vectors = np.linalg.eigh(centred.T @ centred)
        pushed = vectors.T @ (centred.T @ target)
        found = []
        for ridge in ridges:
            weights = vectors @ (pushed / (np.maximum(values, 0) + ridge * len(x))[:, None])
            found.append((weights, np.linalg.lstsq(drift, y - x @ weights, rcond=None)[0]))
        return found


def _prepare(recording: Recording, names: tuple[str, ...]) -> _Data:
    if recording.measured is None:
        raise InvalidValueError("a background is fitted to the measured tensor, but the recording has none")
    if "background" in recording.metadata:
        raise InvalidValueError("a background was already subtracted from this recording")
    if not names or len(set(names)) < len(names):
        raise InvalidValueError(f"a background takes one or several different covariates, got {list(names)}")
    for name in names:
        if name not in recording.covariates:
            raise UnknownNameError("covariate", name, recording.covariates)
    sizes = tuple(recording.covariates[name].size // len(recording) for name in names)
    if not 1 <= sum(sizes) <= MAX_VALUES:
        raise InvalidValueError(f"a background takes 1 to {MAX_VALUES} values of covariates, got {sum(sizes)}")
    values = side_by_side(recording.covariates, names, sizes).reshape(len(recording), -1)
    channels = recording.measured.reshape(len(values), -1).astype(np.float64)
    used = np.isfinite(channels).any(axis=0)
    known = np.isfinite(values).all(axis=1) & np.isfinite(channels[:, used]).all(axis=1)
    if known.sum() < MIN_SAMPLES or not used.any():
        raise InvalidValueError(
            f"a background needs at least {MIN_SAMPLES} samples with known channels and covariates, got "
            f"{int(known.sum())}"
        )
    kept = np.flatnonzero(known)
    kept = kept[:: -(-len(kept) // MOST_SAMPLES)]
    values, low, high = values[kept], values[known].min(axis=0), values[known].max(axis=0)
    largest = [np.abs(own).max() for own in np.split(values, np.cumsum(sizes)[:-1], axis=1)]
    still = high - low <= _STILL * np.repeat(largest, sizes)
    for name, own in zip(names, np.split(still, np.cumsum(sizes)[:-1]), strict=True):
        if own.all():
            raise InvalidValueError(f"covariate {name!r} does not change in the recording: leave it out or move it")
    low, high = np.where(still, low - 1, low), np.where(still, high + 1, high)  # such as the last row of a pose
    episode = recording.episode[kept]
    elapsed = recording.elapsed[kept]
    values = scaled(values, low, high)
    return _Data(
        time=recording.time[kept],
        episode=episode,
        channels=channels[kept][:, used],
        values=values,
        drift=np.polynomial.legendre.legvander(2 * elapsed / max(elapsed[-1], 1e-9) - 1, DRIFT_DEGREE),
        fold=_folds(episode),
        low=low,
        high=high,
        sizes=sizes,
        used=used.reshape(recording.measured.shape[1:]),
    )


def _folds(episode: NDArray[np.int64]) -> NDArray[np.intp]:
    number = np.cumsum(np.diff(episode, prepend=episode[0]) != 0)
    if number[-1] + 1 < FOLDS:
        number = np.arange(len(episode)) * BLOCKS // len(episode)
    return number % FOLDS


def _bumps(data: _Data, width: float | None) -> tuple[Array, Array]:
    """Return centres and sharpness of the bumps of each value, and of all values together if their width is given."""
    count = data.values.shape[1]
    centers = np.zeros((count, LINE_BUMPS, count))
    sharpness = np.zeros_like(centers)
    for k in range(count):
        centers[k, :, k], sharpness[k, :, k] = np.linspace(-1, 1, LINE_BUMPS), 1 / LINE_WIDTH
    centers, sharpness = centers.reshape(-1, count), sharpness.reshape(-1, count)
    if width is None:
        return centers, sharpness
    joint = _spread_out(data.values, min(MOST_BUMPS, len(data.values) // 5))
    return np.concatenate([centers, joint]), np.concatenate([
        sharpness, np.full(joint.shape, 1 / (width * np.sqrt(count)))
    ])  # fmt: skip


def _spread_out(values: Array, count: int) -> Array:
    """Return up to `count` of the samples, each the farthest from those before it."""
    chosen, distance = [0], np.sum((values - values[0]) ** 2, axis=1)
    while len(chosen) < count and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.sum((values - values[chosen[-1]]) ** 2, axis=1))
    return values[chosen]


def _warn(data: _Data, names: tuple[str, ...], fit: _Fit, ridge: float, left: Array, noise: Array) -> None:
    moved = np.sum((data.values - data.values.mean(axis=0)) ** 2, axis=0)
    alone = np.sum(data.without_drift(data.values) ** 2, axis=0)
    for name, whole, own in zip(np.repeat(names, data.sizes), moved, alone, strict=True):
        if own < 0.05 * whole:
            warnings.warn(
                f"covariate {str(name)!r} changes with time only, so its effect cannot be told from a drift: move it "
                "back and forth",
                UserWarning,
                stacklevel=3,
            )
            return  # what follows would come from the same doubt
    size = np.sqrt(np.sum(left**2, axis=1))
    if np.quantile(size, 0.99) > TOUCHED * np.median(size):
        when = data.time[size.argmax()]
        warnings.warn(
            f"a few samples are far from the background, most at {when:.1f} s: something touched the sensor, or the "
            "motion is too short and passes there only once",
            UserWarning,
            stacklevel=3,
        )
        return
    errors = [fit.error_of_shift(delayed(data.time, data.episode, data.values, shift), ridge) for shift in SHIFTS]
    now, best = errors[len(SHIFTS) // 2], int(np.argmin(errors))
    if errors[best] < LATE * now:
        later = "later" if SHIFTS[best] > 0 else "earlier"
        warnings.warn(
            f"the channels come {1e3 * abs(SHIFTS[best]):.0f} ms {later} than {', '.join(names)}: shifted, they would "
            f"leave {errors[best] / now:.0%} of the error; check the clocks, and move slowly",
            UserWarning,
            stacklevel=3,
        )
    elif np.sqrt(np.mean(left**2)) > NOT_NOISE * np.sqrt(np.mean(noise**2)):
        warnings.warn(
            "what is left on held-out data is far above the noise: the channels depend on more than "
            f"{', '.join(names)}, or the motion is too short. Move all joints through their ranges several times, each "
            "at its own speed, and name all of them",
            UserWarning,
            stacklevel=3,
        )
