"""Known: a sensor model known beforehand, through which a diagnosis looks at the simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.recorded import read_through
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.vocabulary import known_causes
from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording

MEMBER = "known_sensor"
"""Name of the known sensor in the extended model."""
LASTING = ("gel", "magnets")
"""Stages that belong to a unit. Those of its electronics, such as a zero offset, change from session to session."""


@dataclass(frozen=True, eq=False)
class KnownSensor:
    """The part of a sensor model that is taken as known.

    Attributes:
        chain: What the layer and the magnets do to the forces.
        left_out: Names of the members that are not taken over.
    """

    chain: Chain
    left_out: tuple[str, ...]

    @classmethod
    def of(cls, sensor: Transform) -> KnownSensor:
        """Return the known part of a chain or of a single transform.

        Raises:
            InvalidValueError: It is no transform, or nothing of it is known to last.
        """
        if not isinstance(sensor, Transform):
            raise InvalidValueError(
                f"sensor must be a paxisim.Chain or a transform, got {type(sensor).__name__}: Chain.load reads a file"
            )
        whole = sensor if isinstance(sensor, Chain) else Chain([sensor])
        kept = {n: m for n, m in zip(whole.names, whole, strict=True) if _stages(m) <= set(LASTING)}
        if not kept:
            raise InvalidValueError(
                "nothing of the given sensor model belongs to the unit itself: expected what a gel or magnets do, such "
                f"as gel_operator or axis_gain, got {', '.join(whole.names) or 'an empty chain'}"
            )
        return cls(Chain(kept.values(), kept), tuple(name for name in whole.names if name not in kept))

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the causes that it accounts for."""
        return tuple(name for name in self.chain.names if name in known_causes())

    def seen(self, force: NDArray[np.floating], recording: Recording) -> NDArray[np.float32]:
        """Return what the sensor reads of simulated forces.

        Args:
            force: ``(T, pads, 3, rows, cols)`` N, NaN at samples that were not simulated.
            recording: Recording with the samples' times, episodes and covariates.

        Raises:
            InvalidValueError: The sensor has other pads or taxels.
            MissingCovariateError: The recording lacks a covariate that the sensor needs.
        """
        spans = episode_spans(recording.episode)
        return read_through(self.chain, force, recording.time, recording.covariates, spans)

    def before(self, model: Chain) -> Chain:
        """Return the whole model of the sensor: the known part, then what a diagnosis found beside it."""
        return Chain([self.chain, *model], [MEMBER, *model.names])

    def __str__(self) -> str:
        """What was taken as known, as a sentence."""
        rest = f"; {', '.join(self.left_out)} of the same model may change and is fitted anew" if self.left_out else ""
        return f"Taken as known: {', '.join(self.chain.names)}{rest}."


def _stages(member: Transform) -> set[str]:
    if isinstance(member, Chain):
        return set().union(*map(_stages, member))
    return {member.stage}
