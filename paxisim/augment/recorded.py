"""Recorded: what a sensor model reads of a recording's simulated forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.clocked import Clocked
from paxisim.augment.transform import Transform
from paxisim.errors import InvalidValueError
from paxisim.logs.memory import at_rest, in_one_piece, peak_of
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording


def read_recording(sensor: Transform, recording: Recording) -> Recording:
    """Return a recording with its simulated tensor as a model of the sensor reads it.

    The sensor remembers earlier episodes as in `read_through`. Unknown samples (NaN) stay unknown.

    Args:
        sensor: Model of the sensor, such as ``paxisim.Chain.load("model.json")``.
        recording: The recording.

    Raises:
        InvalidValueError: There is no simulated tensor, or the sensor has other pads or taxels.
        MissingCovariateError: The recording lacks a covariate that the sensor needs.
    """
    if recording.simulated is None:
        raise InvalidValueError("the recording has no simulated tensor that a sensor could read: replay it first")
    episodes = episode_spans(recording.episode)
    read = read_through(sensor, recording.simulated, recording.time, recording.covariates, episodes)
    return recording.with_simulated(read)


def read_through(
    sensor: Transform,
    force: NDArray[np.floating],
    time: NDArray[np.float64],
    covariates: Mapping[str, NDArray[np.float64]],
    episodes: Sequence[slice],
) -> NDArray[np.float32]:
    """Return what a sensor reads of forces.

    Memory continues from one episode to the next without a break, or over a short pause at rest. Otherwise the sensor
    begins as if it had felt the episode's first frame for long. Drift and failures follow the clock.

    Args:
        sensor: Model of the sensor.
        force: ``(T, pads, 3, rows, cols)`` N, NaN at unknown samples, which stay NaN.
        time: ``(T,)`` seconds.
        covariates: ``(T, ...)`` arrays by name.
        episodes: Samples of each episode.

    Raises:
        InvalidValueError: The sensor has other pads or taxels.
        MissingCovariateError: A covariate that the sensor needs is missing.
    """
    out = np.full(force.shape, np.nan, dtype=np.float32)
    finite = np.isfinite(force).all(axis=(1, 2, 3, 4))
    rest = np.zeros(len(force), dtype=bool)
    if finite.any():
        rest[finite] = at_rest(force[finite], peak_of(force[finite]))
    for span in in_one_piece(time, episodes, rest):
        own = np.arange(span.start, span.stop)[finite[span]]
        if not len(own):
            continue
        here = _later(sensor, float(time[span.start] - time[0]))
        read = np.asarray(here.run(force[own], time[own], {name: values[own] for name, values in covariates.items()}))
        if read.shape != force[own].shape:
            raise InvalidValueError(
                f"the given sensor reads {read.shape[1:]} of frames {force.shape[1:]}: expected one sensor of this "
                "recording's pads, not a batch of sensors"
            )
        out[own] = read
    return out


def _later(member: Transform, elapsed: float) -> Transform:
    """Return a transform advanced by `elapsed` seconds."""
    if isinstance(member, Chain):
        return Chain([_later(own, elapsed) for own in member], member.names)
    return member.later(elapsed) if isinstance(member, Clocked) else member
