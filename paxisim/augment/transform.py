"""Transform: the base class of all transforms: a frozen dataclass of parameters, a pure call and optional memory.

Shape conventions: a frame is ``(*batch, pads, 3, rows, cols)`` in newtons; a sequence has a leading time dimension,
``(time, *batch, pads, 3, rows, cols)``, with times ``(time,)`` in seconds. numpy in, numpy out; torch in, torch out, on
the input's device, differentiable where the physics is.

| | one frame | a stream, frame by frame | a whole sequence |
|---|---|---|---|
| without memory | ``t(x)`` | ``t.step(x, state, dt)`` | ``t.run(x, time)`` |
| with memory | an error | ``t.step(x, state, dt)`` | ``t.run(x, time)`` |

The state of a stream is a tuple of arrays with leading batch dimensions. It starts as ``t.initial_state(x)``, which
treats the first frame x as having been constant before the stream. ``t.reset(state, mask, x)`` restarts single
environments of a batch. ``run`` and stepping agree to floating-point rounding, and ``dt`` may vary between frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import (
    AXES,
    Parameter,
    as_like,
    check,
    is_floating,
    is_torch,
    lift,
    namespace,
    parameters,
)
from paxisim.errors import InvalidValueError

State = tuple[Any, ...]
Covariates = Mapping[str, Any]

STAGES = ("gel", "magnets", "electronics", "firmware")
"""Physical stages in the order in which they act on a force: the gel before the magnets and Hall sensors, and so on."""


class Transform:
    """Base class of the transforms; the module docstring describes the shapes and the three ways to apply one.

    Subclasses are frozen dataclasses. Those without memory implement `apply`; those with memory derive from
    `StatefulTransform`.

    Attributes:
        stage: Position in the physical chain, one of `STAGES`.
        covariate_names: Names of the covariates it needs.
        has_memory: Whether the output depends on earlier frames.
    """

    stage: ClassVar[str] = "magnets"
    has_memory: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check every parameter."""
        for name, about in parameters(self).items():
            value = getattr(self, name)
            if isinstance(value, (int, float)) and about.core and set(about.core) <= set(AXES):
                for _ in about.core:  # one number for all pads, axes and taxels
                    value = (value,)
                object.__setattr__(self, name, value)
            check(type(self).__name__, name, getattr(self, name), about)

    @property
    def name(self) -> str:
        """Name of the class."""
        return type(self).__name__

    @property
    def flattened(self) -> tuple[Transform, ...]:
        """The transforms that it applies one after another: itself, or the members of a chain and of chains in it."""
        return (self,)

    def between_frames(self, step: float) -> Transform | None:
        """The transform for points `step` seconds apart, if it needs points between frames 20 to 50 ms apart.

        Returns:
            None for a transform whose effect is slow compared with such frames, or that has no memory.
        """
        return None

    @property
    def covariate_names(self) -> tuple[str, ...]:
        """Names of the covariates it needs, taken from its field ``covariate``."""
        return tuple(getattr(self, f.name) for f in fields(self) if f.name == "covariate" and getattr(self, f.name))  # type: ignore[arg-type]

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """Transform a checked frame: ``(*batch, pads, 3, rows, cols)`` in and out."""
        raise NotImplementedError

    def __call__(self, x: Any, covariates: Covariates | None = None) -> Any:
        """Transform a frame or a stack of frames.

        Args:
            x: ``(*batch, pads, 3, rows, cols)`` forces (N), floating point.
            covariates: Values by name, each of the batch's shape or broadcastable to it.

        Returns:
            Array with the same array library, dtype and shape; if `x` is one frame and the parameters have a batch,
            one frame for each of them, ``(*batch, pads, 3, rows, cols)``.

        Raises:
            InvalidValueError: The shape is wrong, the values are integers, a parameter does not fit, a covariate is
                missing, or the transform has memory and needs `step` or `run`.
        """
        if self.has_memory:
            raise InvalidValueError(f"{self.name} remembers earlier frames: use step(x, state, dt) or run(x, time)")
        self._check_frame(x)
        return self._checked(self.apply(x, covariates or {}), x)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the state of a stream that starts with frame `x`, treated as constant before the stream."""
        return ()

    def step(self, x: Any, state: State, dt: Any, covariates: Covariates | None = None) -> tuple[Any, State]:
        """Transform the next frame of a stream.

        Args:
            x: ``(*batch, pads, 3, rows, cols)`` forces (N).
            state: State from `initial_state` or the previous step.
            dt: Time since the previous frame (s), a number or an array of the batch's shape; 0 for the first frame.
            covariates: Values by name at this frame.

        Returns:
            The transformed frame and the state for the next step.

        Raises:
            InvalidValueError: As for a call; or time runs backwards.
        """
        self._check_dt(dt)
        return self(x, covariates), state

    def run(self, x: Any, time: Any, covariates: Covariates | None = None) -> Any:
        """Transform a whole sequence.

        Args:
            x: ``(time, *batch, pads, 3, rows, cols)`` forces (N).
            time: ``(time,)`` times (s), not decreasing; or ``(time, *batch)`` for a batch of streams with separate
                clocks.
            covariates: Sequences by name, each ``(time, ...)``; covariates that are not needed are ignored.

        Returns:
            Array with the same shape, array library and dtype, with the parameters' batch dimensions after time if `x`
            has none. It equals stepping frame by frame from ``initial_state(x[0])`` to floating-point rounding.

        Raises:
            InvalidValueError: As for a call; or `time` has the wrong shape or runs backwards.
        """
        xp = namespace(x)
        steps = self._time_steps(x, time)
        self._check_frame(x[0])
        given = covariates or {}
        found = {name: self._covariate(name, given) for name in self.covariate_names}
        series = {name: as_like(values, x) for name, values in found.items() if values is not None}
        for name, values in series.items():
            if values.ndim < 1 or values.shape[0] != x.shape[0]:
                raise InvalidValueError(
                    f"{self.name} expected the covariate {name!r} at each of {x.shape[0]} frames, got shape "
                    f"{tuple(values.shape)}"
                )
        if not self.has_memory:
            # one sequence, a batch of parameters: their batch dimensions go between time and pads
            dims = [np.ndim(getattr(self, name)) - len(about.core) for name, about in parameters(self).items()]
            batch = max([x.ndim - 5, *dims, *(values.ndim - 1 for values in series.values())])
            widened = {name: _widen(values, 1 + batch) for name, values in series.items()}
            return self(_widen(x, 5 + batch), widened)
        swept = self.sweep(x, steps) if type(x) is np.ndarray else None
        if swept is not None and np.isfinite(swept[-1]).all():  # else a sweep may have spread NaN to earlier frames
            return swept
        state = self.initial_state(x[0], {name: values[0] for name, values in series.items()})
        frames = []
        for index, dt in enumerate(steps.tolist() if steps.ndim == 1 else steps):
            frame, state = self.step(x[index], state, dt, {name: values[index] for name, values in series.items()})
            frames.append(frame)
        return xp.stack(frames)

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """Transform a whole checked numpy sequence if that is faster than stepping; otherwise return None.

        Args:
            x: ``(time, *batch, pads, 3, rows, cols)`` forces (N).
            steps: ``(time,)`` or ``(time, *batch)`` time since the previous frame (s), 0 for the first.
        """
        return None

    def reset(self, state: State, mask: Any, x: Any, covariates: Covariates | None = None) -> State:
        """Restart some environments of a batch.

        Args:
            state: Current state.
            mask: Boolean array of the batch's shape, True where a stream restarts.
            x: ``(*batch, pads, 3, rows, cols)`` first frames of the restarted streams, or one frame for all; only the
                masked ones are used.
            covariates: Values by name at those frames.

        Returns:
            The state, with the masked environments as after ``initial_state(x)``.
        """
        xp = namespace(x)
        mask = xp.asarray(mask)
        # if only the parameters have a batch, all its elements begin with the same frame
        batch = np.broadcast_shapes(tuple(mask.shape), tuple(x.shape[:-4]))
        mask, x = xp.broadcast_to(mask, batch), xp.broadcast_to(x, (*batch, *x.shape[-4:]))

        def choose(new: Any, old: Any) -> Any:
            return xp.where(xp.reshape(mask, (*batch, *[1] * (new.ndim - len(batch)))), new, old)

        return tuple(choose(new, old) for new, old in zip(self.initial_state(x, covariates), state, strict=True))

    def broadcast_parameter(self, name: str, x: Any) -> Any:
        """Return parameter `name` as an array that broadcasts against frame `x`.

        Raises:
            InvalidValueError: The shapes of the parameter and `x` do not broadcast.
        """
        about: Parameter = parameters(self)[name]
        lifted = lift(getattr(self, name), about.core, x)
        if not _fits(lifted.shape, x.shape):
            raise InvalidValueError(
                f"{self.name}: {name} of shape {tuple(np.shape(getattr(self, name)))} does not fit a tensor of "
                f"shape {tuple(x.shape)}{_of_other_pads(about.core, lifted.shape, tuple(x.shape))}"
            )
        return lifted

    def broadcast_covariate(self, name: str, covariates: Covariates, x: Any) -> Any:
        """Return covariate `name` as an array that broadcasts against frame `x`.

        Args:
            name: Name of the covariate, or ``"joints[3]"`` for index 3 of the last dimension of ``"joints"``.
            covariates: Values by name.
            x: The frame.

        Raises:
            InvalidValueError: The covariate is missing, or its shape and that of `x` do not broadcast.
        """
        values = self._covariate(name, covariates)
        if values is None:
            have = ", ".join(covariates) or "none"
            raise InvalidValueError(f"{self.name} needs the covariate {name!r}; available: {have}")
        lifted = lift(values, "", x)
        if not _fits(lifted.shape, x.shape):
            raise InvalidValueError(
                f"{self.name}: the covariate {name!r} of shape {tuple(np.shape(values))} does not fit a "
                f"tensor of shape {tuple(x.shape)}"
            )
        return lifted

    def _covariate(self, name: str, covariates: Covariates) -> Any:
        """Return the values of a covariate, or of one element of it; None if there is no such covariate."""
        whole, bracket, number = name.removesuffix("]").rpartition("[")
        if name in covariates or not (bracket and number.isdigit() and whole in covariates):
            return covariates.get(name)
        values = covariates[whole]
        return values[..., int(number)] if int(number) < (np.shape(values) or (0,))[-1] else None

    def _check_frame(self, x: Any) -> None:
        shape = tuple(getattr(x, "shape", ()))
        if len(shape) < 4 or shape[-3] != 3:
            raise InvalidValueError(f"{self.name} expected a tensor of shape (..., pads, 3, rows, cols), got {shape}")
        if not is_floating(x):
            raise InvalidValueError(f"{self.name} expected a floating point tensor in newtons, got {x.dtype}")

    def _checked(self, out: Any, x: Any) -> Any:
        """Return the transformed frames; one of another shape would later broadcast against others without a word."""
        shape = tuple(getattr(out, "shape", ()))
        if shape[-4:] != tuple(x.shape[-4:]):
            raise InvalidValueError(
                f"{self.name} returned shape {shape} for a tensor of shape {tuple(x.shape)}: pads, axes, rows and "
                "columns must stay as they are"
            )
        return out

    def _check_dt(self, dt: Any) -> None:
        if not isinstance(dt, (int, float)):
            check(self.name, "dt", dt, _DT)
        elif not 0 <= dt < float("inf"):
            raise InvalidValueError(f"{self.name}: dt must be finite and must not be negative, got {dt!r}")

    def _time_steps(self, x: Any, time: Any) -> NDArray[np.float64]:
        times = np.asarray(time, dtype=np.float64)
        own = times.ndim in (1, x.ndim - 4) and times.shape == tuple(x.shape[: times.ndim])
        if not own or not len(times):
            raise InvalidValueError(
                f"{self.name} expected one time for each of {x.shape[0]} frames, got shape {times.shape}"
            )
        steps = np.diff(times, prepend=times[:1], axis=0)
        if not np.all(np.isfinite(times)) or steps.min() < 0:
            raise InvalidValueError(f"{self.name}: time must be finite and must not run backwards")
        return steps


_DT = Parameter(unit="s", low=0.0)


class StatefulTransform(Transform):
    """Base class of transforms with memory, which implement `initial_state` and `advance`.

    Copy a frame with `keep` before storing it in a state.
    """

    has_memory: ClassVar[bool] = True

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """Advance by one checked frame; `dt` broadcasts against it."""
        raise NotImplementedError

    def step(self, x: Any, state: State, dt: Any, covariates: Covariates | None = None) -> tuple[Any, State]:
        """See `Transform.step`."""
        self._check_frame(x)
        self._check_dt(dt)
        out, state = self.advance(x, state, lift(dt, "", x), covariates or {})
        return self._checked(out, x), state


def keep(x: Any) -> Any:
    """Return a copy of `x` for a state, because the caller may read the next frame into the same memory."""
    return x.clone() if is_torch(x) else x.copy()


def _widen(x: Any, ndim: int) -> Any:
    """Insert dimensions of length 1 after the first dimension of `x`, up to `ndim` dimensions in all."""
    return x.reshape((x.shape[0], *[1] * (ndim - x.ndim), *x.shape[1:]))


def _of_other_pads(core: str, ours: tuple[int, ...], theirs: tuple[int, ...]) -> str:
    """Return what to do about a lifted parameter that fits a tensor but for the number of pads."""
    if "p" not in core or ours[-4] in (1, theirs[-4]) or not _fits(ours[-3:], theirs[-3:]):
        return ""
    pads = f"{ours[-4]} pad{'s' * (ours[-4] != 1)}"
    return f": it was drawn for {pads} and the tensor has {theirs[-4]}; draw it with pads={theirs[-4]}"


def _fits(ours: tuple[int, ...], theirs: tuple[int, ...]) -> bool:
    """Whether a lifted parameter broadcasts against a tensor: batches either way, frames never widened."""
    pairs = list(zip(ours[::-1], theirs[::-1], strict=False))
    return all(a in (1, b) for a, b in pairs[:4]) and all(a == b or a == 1 or (b == 1 and a) for a, b in pairs[4:])
