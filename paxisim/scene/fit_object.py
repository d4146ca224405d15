"""Fit of an unknown object: a box, a cylinder or a ball, from what two opposite pads measure while they hold it.

The opening of the gripper says how thick the object is where the pads touch it. A box of that thickness loads a whole
pad, a cylinder a strip of it, and a ball a spot: with the thickness as diameter, each shape predicts how the force is
distributed over the taxels, with nothing left to fit but where and how deep the object sits in the soft layer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models.gel import Gel
from paxisim.presses import MIN_SAMPLES
from paxisim.recording import Recording
from paxisim.scene.closing import pad_normal
from paxisim.scene.doubt import find_grasps
from paxisim.scene.units import LENGTH

MAX_GRASPS = 8
HELD = 0.7
"""Share of a grasp's peak force on both pads above which the object is held."""
LEAST_FORCE = 0.5
"""Total normal force (N) on each pad below which a grasp is not used."""
LEAST_THICKNESS, MOST_THICKNESS = 1e-4, 0.5
"""Openings (m) between which a hand can hold something."""
ALIKE = 1.25
"""Ratio of the errors of two shapes below which the measurement does not tell them apart."""
POOR = 0.5
"""Error of the best shape above which none is likely."""
_SPLIT = 3  # points along each side of a taxel
_STARTS = (0.5, 2.0, 6.0)  # depths where a fit starts, as shares of what the force and the stiffness say
_DEEPEST = 30.0  # largest depth, as such a share
_MOST_FORCE = 5.0  # ratio of the force at the modulus of the layer and the measured one: a deep ball looks like a box

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FittedObject:
    """An object as two pads feel it.

    Attributes:
        shape: ``"box"``, ``"cylinder"`` or ``"ball"``.
        thickness: Size along the closing direction (m), the diameter of a cylinder or ball.
        thickness_error: How far it may be off (m): twice the depth in the soft layers, whose stiffness is known to a
            factor of about 2, the step between openings, and half the spread over the grasps.
        angle: Angle (rad) of a cylinder's axis from the pads' x, between -pi/2 and pi/2; NaN for other shapes.
        errors: Error of each shape: difference of the distributions over the taxels, relative to the measured one.
        grasps: Number of grasps that were used.
    """

    shape: str
    thickness: float
    thickness_error: float
    angle: float
    errors: dict[str, float]
    grasps: int

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Shapes that fit nearly as well."""
        best = self.errors[self.shape]
        return tuple(name for name, error in self.errors.items() if name != self.shape and error < ALIKE * best)

    def __str__(self) -> str:
        """What was found, its errors, and the option of ``paxisim scene compose``."""
        size = f"{1e3 * self.thickness:.3g}"
        others = {"box": f"box:{size}xBxCmm:MASSkg", "cylinder": f"cylinder:{size}xHEIGHTmm:MASSkg"}
        option = others.get(self.shape, f"ball:{size}mm:MASSkg")
        lines = [
            f"{self.shape}, {size} mm thick where the pads touch it, give or take {1e3 * self.thickness_error:.2g} mm "
            f"({self.grasps} grasps)",
            "distribution of the force over the taxels off by: "
            + ", ".join(f"{name} {error:.0%}" for name, error in self.errors.items()),
        ]
        if self.shape == "cylinder":
            lines.append(f"its axis is turned by {np.degrees(self.angle):.0f} degrees from the pads' x axis")
        if self.alternatives:
            lines.append(f"the measurement hardly tells it from a {' or a '.join(self.alternatives)}")
        if self.errors[self.shape] > POOR:
            lines.append("no shape fits well: the object may be of another one, or its edge lies within the pads")
        return "\n".join([*lines, f"as a start: --object {option}, with its other sizes and mass"])


def fit_object(recording: Recording, opening: str, *, unit: str = "m", modulus: float | None = None) -> FittedObject:
    """Fit a box, a cylinder and a ball to an object that two opposite pads hold.

    Args:
        recording: Recording of a sensor with two pads, in newtons, with at least one grasp.
        opening: Covariate with the distance between the surfaces of the pads.
        unit: Unit of the opening: ``"m"``, ``"mm"`` or ``"um"``.
        modulus: Modulus of the pads' soft layer (Pa); default: that of `Gel`. It gives the depth of the pads in it, by
            which the object is thicker than the opening.

    Raises:
        UnknownNameError: There is no such covariate or unit.
        InvalidValueError: The recording has no measured forces in newtons, not two pads with a flat grid of known
            pitch, or no grasp in which both pads are loaded; or the opening is not a distance between two pads.
    """
    if recording.measured is None or recording.unit != "N":
        raise InvalidValueError("fitting an object needs measured forces in newtons")
    if len(recording.pads) != 2 or not recording.layout.is_grid:
        raise InvalidValueError(
            f"fitting an object needs two opposite pads with a flat grid of taxels, got {len(recording.pads)} pads"
        )
    if not recording.layout.pitch_known:
        raise InvalidValueError(
            "fitting an object needs the pitch of the taxels, which this recording does not state: load it with "
            "layout, such as that of paxisim.sensor(NAME)"
        )
    if opening not in recording.covariates:
        raise UnknownNameError("covariate", opening, recording.covariates)
    if unit not in LENGTH:
        raise UnknownNameError("unit", unit, LENGTH)
    gel = Gel() if modulus is None else Gel(modulus=modulus)
    stiffness = gel.stiffness(recording.layout)
    grasps = [
        grasp
        for part in recording.episodes()
        for grasp in _grasps(part, LENGTH[unit] * part.covariates[opening].reshape(len(part), -1)[:, 0])
    ][:MAX_GRASPS]
    if not grasps:
        raise InvalidValueError(
            f"no grasp loads both pads with more than {LEAST_FORCE:g} N at a known opening, so there is nothing to fit"
        )
    openings, steps = (np.array([getattr(grasp, name) for grasp in grasps]) for name in ("opening", "step"))
    if not LEAST_THICKNESS < float(np.median(openings)) < MOST_THICKNESS:
        raise InvalidValueError(
            f"{opening!r} is {float(np.median(openings)):.3g} m while the object is held: expected the distance "
            "between the pads, and its unit, m, mm or um"
        )
    felt = [_Felt(image, stiffness, recording.layout) for grasp in grasps for image in grasp.images]
    fits = {}
    for name, shape in _SHAPES.items():
        radius = float(np.median(openings)) / 2
        fitted = [shape(own, radius) for own in felt]
        radius += float(np.median([fit.depth for fit in fitted]))  # it is thicker than the opening by both depths
        fits[name] = [shape(own, radius) for own in felt]
    errors = {name: float(np.median([fit.error for fit in own])) for name, own in fits.items()}
    best = min(errors, key=lambda name: errors[name])
    depths = np.array([fit.depth for fit in fits[best]]).reshape(-1, 2).sum(axis=1)
    thickness = openings + depths
    turned = np.exp(2j * np.array([fit.angle for fit in fits[best]]))  # an axis is the same after half a turn
    return FittedObject(
        shape=best,
        thickness=float(np.median(thickness)),
        thickness_error=float(2 * np.median(depths) + np.median(steps) + np.ptp(thickness) / 2),
        angle=float(np.angle(turned.mean()) / 2),
        errors=errors,
        grasps=len(grasps),
    )


@dataclass(frozen=True)
class _Grasp:
    """Mean normal forces ``(2, rows, cols)`` (N) of a held object, the opening (m), and by how much it changes (m)."""

    images: Array
    opening: float
    step: float


@dataclass(frozen=True)
class _Fit:
    """Error of a shape on one pad, its depth in the soft layer (m), and the angle of its axis (rad), if it has one."""

    error: float
    depth: float
    angle: float = float("nan")


def _grasps(part: Recording, opening: Array) -> list[_Grasp]:
    """Return the grasps of an episode in which both pads are loaded."""
    assert part.measured is not None
    force = np.nan_to_num(part.measured[:, :, 2].astype(np.float64))
    totals = pad_normal(np.nan_to_num(part.measured))
    found = []
    for span in find_grasps(part.time, part.measured):
        own = totals[span]
        held = (own > HELD * own.max(axis=0)).all(axis=1) & np.isfinite(opening[span])
        if (own.max(axis=0) > LEAST_FORCE).all() and held.sum() >= MIN_SAMPLES:
            width = opening[span][held]
            image = np.maximum(np.median(force[span][held], axis=0), 0.0)
            if (image.sum(axis=(1, 2)) > 0).all():
                middle, step = float(np.median(width)), float(np.ptp(np.quantile(width, [0.25, 0.75])))
                found.append(_Grasp(image, middle, step))
    return found


class _Felt:
    """Normal forces on the taxels of one pad, to which the distribution of a shape is fitted."""

    def __init__(self, image: Array, stiffness: float, layout: TaxelLayout) -> None:
        taxels = np.asarray(layout.positions, dtype=np.float64)[:, :2]
        self.points = np.asarray(layout.subdivide(_SPLIT, _SPLIT).positions, dtype=np.float64)[:, :2]
        self.middle = image.ravel() @ taxels / image.sum()
        self.depth = float(image.max()) / stiffness
        self.total = float(image.sum()) / stiffness  # as a sum of depths
        self._measured = image / image.sum()

    def fit(
        self,
        depth: Callable[[Array], Array],
        starts: Sequence[Sequence[float]],
        bounds: Sequence[float],
        metric: bool = True,
    ) -> tuple[float, Array]:
        """Return the error of a shape's distribution and its parameters; independent springs carry the shape.

        Args:
            depth: Depth of the shape at `points`, from its parameters.
            starts: Parameters to start from.
            bounds: Largest size of each parameter.
            metric: Whether `depth` is in m, and its force must not exceed the measured one by far.
        """
        from scipy.optimize import least_squares

        rows, cols = self._measured.shape

        def residual(at: Array) -> Array:
            pressed = np.maximum(depth(at), 0.0).reshape(rows, _SPLIT, cols, _SPLIT).sum(axis=(1, 3))
            total = pressed.sum()
            wrong = pressed / total - self._measured if total > 0 else -self._measured
            excess = total / _SPLIT**2 / self.total - _MOST_FORCE if metric else 0.0
            return np.append(wrong.ravel(), max(excess, 0.0))

        most = np.array(bounds)
        fits = [least_squares(residual, start, bounds=(-most, most), x_scale=most, max_nfev=60) for start in starts]
        best = min(fits, key=lambda fit: fit.cost)
        return float(np.linalg.norm(best.fun) / np.linalg.norm(self._measured)), best.x


def _box(felt: _Felt, radius: float) -> _Fit:
    """Return the error of a flat face, which may be askew."""
    scale = 1 / np.abs(felt.points).max()
    error, _ = felt.fit(lambda tilt: 1 + scale * felt.points @ tilt, [(0.0, 0.0)], (2.0, 2.0), metric=False)
    return _Fit(error, felt.depth)


def _ball(felt: _Felt, radius: float) -> _Fit:
    """Return the error of a ball that may touch the pad anywhere."""

    def depth(at: Array) -> Array:
        return at[2] - np.sum((felt.points - at[:2]) ** 2, axis=1) / (2 * radius)

    reach = 2 * float(np.abs(felt.points).max())
    starts = [(*felt.middle, share * felt.depth) for share in _STARTS]
    error, at = felt.fit(depth, starts, (reach, reach, _DEEPEST * felt.depth))
    return _Fit(error, float(at[2]))


def _cylinder(felt: _Felt, radius: float) -> _Fit:
    """Return the error and the angle of a cylinder that may touch the pad anywhere, and be askew."""
    reach = 2 * float(np.abs(felt.points).max())

    def depth(at: Array) -> Array:
        along, across = (felt.points @ axis for axis in _axes(at[2]))
        return at[1] + felt.depth / reach * at[3] * along - (across - at[0]) ** 2 / (2 * radius)

    starts = [
        (float(felt.middle @ _axes(angle)[1]), share * felt.depth, angle, 0.0)
        for angle in np.radians([-45, 0, 45, 90])
        for share in _STARTS
    ]
    error, at = felt.fit(depth, starts, (reach, _DEEPEST * felt.depth, np.pi, 2.0))
    return _Fit(error, float(at[1]), float(at[2]))


def _axes(angle: float) -> Array:
    """Return the directions along and across a cylinder in the pad's plane."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


_SHAPES = {"box": _box, "cylinder": _cylinder, "ball": _ball}
