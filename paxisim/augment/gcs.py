"""GCS: the paper's domain randomisation, with G as heights for the simulator and C and S as a chain of transforms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from paxisim.augment.around import check_intervals, drawn
from paxisim.augment.chain import Chain
from paxisim.augment.draws import normal, uniform
from paxisim.augment.gains import AxisGain, PadAxisGain, TaxelGain
from paxisim.augment.gel_operator import KINDS, SKEWED, GelOperator
from paxisim.augment.offset import Offset
from paxisim.augment.parameter_spec import as_like
from paxisim.augment.poisson import Poisson
from paxisim.augment.transform import Transform
from paxisim.bump import GaussianBump, bump_heights
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

PAPER_LAYOUT = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
"""The paper's sensor, PX6AX-GEN1-PAP-L4629, pooled to 6x5."""


@dataclass(frozen=True)
class Ranges:
    """Distributions that GCS draws from (paper, Table I).

    Attributes:
        axis_gain: Bounds of the uniform distribution of alpha_k, the gain of an axis.
        taxel_gain: Mean and spread of the normal distribution of beta_ij, the gain of a taxel.
        dropout: Probability that a taxel is dropped.
        convolution: Bounds of the uniform distribution of c_x and c_y.
        deviation: Bounds of the uniform distribution of s_x and s_y, the bump's deviations in taxels.
        offset: Largest magnitude (N) of a constant shared by all taxels of a pad, uniform for each pad and axis. It
            models a sensor that was zeroed in another field. The paper has none; 0 draws none.
        operator: Half-width of the uniform distribution of each number of `GCS.operator`, as a share of it. Ours: over
            twelve units of the magnetic pad the standard deviation of the large numbers is 0.10 to 0.14 of their mean.

    Raises:
        InvalidValueError: Bounds are in the wrong order, not finite or negative, or a probability is outside [0, 1].
    """

    axis_gain: tuple[float, float] = (0.5, 1.5)
    taxel_gain: tuple[float, float] = (1.0, 0.25)
    dropout: float = 0.2
    convolution: tuple[float, float] = (0.1, 0.3)
    deviation: tuple[float, float] = (1.0, 3.0)
    offset: float = 0.0
    operator: float = 0.25

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("axis_gain", "convolution", "deviation"):
            low, high = getattr(self, name)
            least = "above 0" if name == "deviation" else "at least 0"
            if not (0 <= low <= high < math.inf) or (name == "deviation" and low == 0):
                raise InvalidValueError(f"GCS: {name} must be finite bounds, {least} and in order, got {(low, high)}")
        if not all(0 <= value < math.inf for value in self.taxel_gain):
            raise InvalidValueError(f"GCS: taxel_gain must be a finite mean and spread, got {self.taxel_gain}")
        if not 0 <= self.dropout <= 1:
            raise InvalidValueError(f"GCS: dropout must be a probability, got {self.dropout!r}")
        if not 0 <= self.offset < math.inf:
            raise InvalidValueError(f"GCS: offset must be finite and at least 0 N, got {self.offset!r}")
        if not 0 <= self.operator <= 1:
            raise InvalidValueError(f"GCS: operator must be a share from 0 to 1, got {self.operator!r}")


@dataclass(frozen=True)
class GCS:
    """The paper's GCS: surface with Gaussian bumps, convolution for the Poisson effect, force scaling.

    Draw one chain per episode (``batch_shape=()``), per environment (``(environments,)``) or per sample of recorded
    data (``(samples,)``), and a surface for the simulator with `sample_surface`. Where the paper's text and its Table I
    are ambiguous, the default is our reading and a parameter selects the other:

    - N(1, 0.25): 0.25 is the **standard deviation**. As a variance (standard deviation 0.5), it would make one gain in
      44 negative.
    - Negative gains become 0, as no taxel reads backwards. This affects 3 in 100,000 draws and shifts the mean by 2e-6
      (with 0.25 as the variance, 2.3 % and 4e-3).
    - 20 % dropout: a dropped **taxel** reads 0 on all axes for the lifetime of the chain.
    - alpha_k is for "each axis of all taxels": **both pads share it**, as they share c_x and c_y. beta_ij and the
      surfaces are drawn for each pad.

    Switching a part off, as in the paper's ablation, does not change what the others draw from the same seed.

    Attributes:
        ranges: Distributions to draw from.
        geometry: Whether to draw bumps (G); otherwise `sample_surface` gives flat pads.
        convolution: Whether to put a `Poisson` in the chain (C), or an operator.
        scaling: Whether to put gains in the chain (S).
        taxel_gain_is_variance: Whether 0.25 is the variance.
        dropout_of: ``"taxel"``, or ``"gain"``: a dropped taxel keeps the gain 1.
        axis_gain_per_pad: Whether to draw alpha_k for each pad.
        reach: Reach of the convolution kernel, see `Poisson`.
        falloff: Falloff of the convolution kernel, see `Poisson`.
        operator: Operator of the product's soft layer, such as `paxisim.nominal_operator`, to draw around in place of
            the paper's convolution, which is one of its parts. Default: the paper's.

    Raises:
        InvalidValueError: `dropout_of` is neither of its options, or `reach` or `falloff` is out of range.
    """

    ranges: Ranges = field(default_factory=Ranges)
    geometry: bool = True
    convolution: bool = True
    scaling: bool = True
    taxel_gain_is_variance: bool = False
    dropout_of: Literal["taxel", "gain"] = "taxel"
    axis_gain_per_pad: bool = False
    reach: float = 1.5
    falloff: float = 1.0
    operator: GelOperator | None = None

    def __post_init__(self) -> None:
        """Check the options."""
        if self.dropout_of not in ("taxel", "gain"):
            raise InvalidValueError(f"GCS: dropout_of must be 'taxel' or 'gain', got {self.dropout_of!r}")
        Poisson(reach=self.reach, falloff=self.falloff)

    @staticmethod
    def around(model: Chain, intervals: Mapping[str, Any]) -> FittedGCS:
        """Return a randomisation around a fitted model, to be used like any other GCS.

        Args:
            model: The fitted chain, e.g. ``diagnosis.model``.
            intervals: Intervals to draw its parameters from, e.g. ``diagnosis.intervals``; see `FittedGCS`.

        Raises:
            UnknownNameError: There is no such member or parameter.
            InvalidValueError: Bounds are not finite, not in order, or not of the parameter's shape.
        """
        return FittedGCS(model=model, intervals=intervals)

    def sample(
        self, rng: Any, batch_shape: tuple[int, ...] = (), *, layout: TaxelLayout = PAPER_LAYOUT, pads: int = 2
    ) -> Chain:
        """Draw C and S.

        Args:
            rng: A ``numpy.random.Generator``, a ``torch.Generator``, or a ``torch.device``, which stands for its
                default generator. With torch, the parameters are created as tensors on that device, without passing
                through the host.
            batch_shape: Leading batch dimensions; each element gets its own parameters.
            layout: Layout of the pads' taxels.
            pads: Number of pads, ``len(pads)`` of those on your gripper.

        Returns:
            Chain of those of ``poisson`` (or ``gel_operator``), ``axis_gain`` (or ``pad_axis_gain``) and ``taxel_gain``
            that are switched on, and ``offset`` if its range is not 0. Parameters are float32: ``cx, cy (*batch)`` (or
            the operator's ``(*batch, M)``), ``(*batch, 3)`` (or ``(*batch, pads, 3)``), ``(*batch, pads, rows, cols)``
            and ``(*batch, pads, 3, rows, cols)``.
        """
        positions = None if layout.is_grid else layout
        return self.sample_taxels(rng, tuple(batch_shape), (pads, layout.rows, layout.cols), positions)

    def sample_taxels(
        self, rng: Any, batch_shape: tuple[int, ...], taxels: tuple[int, int, int], positions: TaxelLayout | None
    ) -> Chain:
        """`sample` for ``(pads, rows, cols)`` taxels, on a grid or at `positions`; ``torch.compile`` can trace it."""
        ranges, taxels_shape = self.ranges, (*batch_shape, *taxels)
        cx = uniform(rng, batch_shape, ranges.convolution)
        cy = uniform(rng, batch_shape, ranges.convolution)
        axes = (*batch_shape, taxels[0], 3) if self.axis_gain_per_pad else (*batch_shape, 3)
        axis_gain = uniform(rng, axes, ranges.axis_gain)
        mean, spread = ranges.taxel_gain
        deviation = math.sqrt(spread) if self.taxel_gain_is_variance else spread
        taxel_gain = (mean + deviation * normal(rng, taxels_shape)).clip(min=0)
        kept = uniform(rng, taxels_shape, (0.0, 1.0)) >= ranges.dropout
        taxel_gain = taxel_gain * kept if self.dropout_of == "taxel" else taxel_gain * kept + ~kept
        members: list[Transform] = []
        if self.convolution and self.operator is None:
            members.append(Poisson(cx, cy, reach=self.reach, falloff=self.falloff, layout=positions))
        if self.scaling:
            members.append(PadAxisGain(axis_gain) if self.axis_gain_per_pad else AxisGain(axis_gain))
            members.append(TaxelGain(taxel_gain))
        if ranges.offset:
            shared = uniform(rng, (*batch_shape, taxels[0], 3), (-ranges.offset, ranges.offset))[..., None, None]
            reads = taxel_gain > 0 if self.scaling else taxel_gain >= 0  # a dropped taxel stays at 0
            members.append(Offset(shared * reads[..., None, :, :]))
        if self.convolution and self.operator is not None:  # drawn last: the others stay what they are without it
            members.insert(0, self._drawn_operator(self.operator, rng, batch_shape, positions))
        return Chain(members)

    def _drawn_operator(
        self, operator: GelOperator, rng: Any, batch: tuple[int, ...], positions: TaxelLayout | None
    ) -> GelOperator:
        """Return the operator with each of its numbers multiplied by a factor around 1."""
        reach = self.ranges.operator
        drawn = {}
        for name in ("own_shear", "own_normal", *KINDS, *SKEWED):
            value = np.asarray(getattr(operator, name), dtype=np.float32)
            factor = uniform(rng, (*batch, *value.shape), (1 - reach, 1 + reach))
            drawn[name] = factor * as_like(value, factor)
        return replace(operator, **drawn, layout=positions)

    def sample_surface(
        self,
        rng: Any,
        batch_shape: tuple[int, ...] = (),
        *,
        layout: TaxelLayout = PAPER_LAYOUT,
        pads: int = 2,
        **fixed: Any,
    ) -> Any:
        """Draw G: the heights of the taxels' cubes, for ``paxisim.set_surface``.

        Args:
            rng: As for `sample`.
            batch_shape: Leading batch dimensions; each element gets its own surface for each pad.
            layout: Layout of the pads' taxels.
            pads: Number of pads, ``len(pads)`` of those on your gripper.
            **fixed: Fields of `paxisim.GaussianBump` to fix, e.g. ``h_max=1.2e-3``.

        Returns:
            ``(*batch, pads, rows, cols)`` heights (m), an array; with torch, a tensor on the generator's device. If
            geometry is switched off, they are flat, at the mean of ``h_min`` and ``h_max``.
        """
        shape = (*batch_shape, pads, 2)
        share, deviation = uniform(rng, shape, (0.0, 1.0)), uniform(rng, shape, self.ranges.deviation)
        model = GaussianBump(**{"center": (0.0, 0.0), **fixed})
        if isinstance(rng, np.random.Generator):
            share, deviation = np.asarray(share, dtype=np.float64), np.asarray(deviation, dtype=np.float64)
        if not self.geometry:
            flat = np.full((*shape[:-1], layout.rows, layout.cols), (model.h_min + model.h_max) / 2)
            return as_like(flat, share)
        bump = {"center": share * as_like(np.array([layout.cols, layout.rows]), share), "deviation": deviation}
        bump |= {name: as_like(np.broadcast_to(fixed[name], shape), share) for name in bump if name in fixed}
        return bump_heights(model, layout, **bump)


@dataclass(frozen=True)
class FittedGCS(GCS):
    """GCS that samples chains around a fitted model, with parameters drawn from their uncertainty intervals.

    The fit determines what the paper's C and S have to guess, so `convolution`, `scaling` and their ranges are ignored.
    The surfaces (G) are drawn as in `GCS`, because no fit determines them. Each number with an interval is drawn
    independently from the uniform distribution over it, and each seed of noise or jitter from all seeds; all others
    keep the model's values. The intervals are meant
    to be the 90 % intervals of a diagnosis. The distribution is uniform so that a policy sees the ends of an interval
    as often as its middle.

    Hysteresis weights that sum to more than 1 are shrunk towards their lower bounds until they sum to 1.

    A negative latency describes how the streams of a recording were aligned in time, not the sensor. It is left out, so
    the chains can be stepped.

    Example:
        ```python
        found = paxisim.diagnose(recording)
        gcs = paxisim.GCS.around(found.model, found.intervals)
        chain = gcs.sample(np.random.default_rng(0), (4096,))  # one for each environment
        ```

    Attributes:
        model: The fitted chain.
        intervals: Lower and upper bounds by member and parameter, each with the parameter's own shape:
            ``{"creep": {"amplitude": ([0.1, 0.0], [0.2, 0.1])}}``. For a member that is itself a chain, a mapping of
            the same form over its members.

    Raises:
        UnknownNameError: There is no such member or parameter.
        InvalidValueError: Bounds are not finite, not in order, or not of the parameter's shape; a parameter with an
            interval is a whole number; or the lower bounds of hysteresis weights sum to more than 1.
    """

    model: Chain = field(default_factory=Chain)
    intervals: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the options and the intervals."""
        super().__post_init__()
        if not isinstance(self.model, Chain):
            raise InvalidValueError(f"GCS.around: the model must be a Chain, got {type(self.model).__name__}")
        check_intervals(self.model, self.intervals)

    def sample(
        self, rng: Any, batch_shape: tuple[int, ...] = (), *, layout: TaxelLayout = PAPER_LAYOUT, pads: int = 2
    ) -> Chain:
        """Draw a chain around the model.

        Args:
            rng: As for `GCS.sample`.
            batch_shape: Leading batch dimensions; each element gets its own parameters.
            layout: Ignored: the model fixes the layout.
            pads: Ignored.

        Returns:
            The model's members under their names; drawn parameters are float32 of shape ``(*batch, ...)``, followed by
            the parameter's own shape.
        """
        return drawn(self.model, self.intervals, rng, tuple(batch_shape))

    def sample_taxels(
        self, rng: Any, batch_shape: tuple[int, ...], taxels: tuple[int, int, int], positions: TaxelLayout | None
    ) -> Chain:
        """Draw a chain as `sample` does; called by ``paxisim.augment.torch.GCS``."""
        return drawn(self.model, self.intervals, rng, tuple(batch_shape))
