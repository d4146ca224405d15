"""Gel: the compliance of the sensor's soft layer in physical units, turned into MuJoCo contact parameters.

The layer is a bed of independent Kelvin-Voigt springs (a Winkler foundation): a taxel of area A pushed in by r
answers with ``F = modulus * A / thickness * (r + relaxation * dr/dt)``. That holds to 2 % for r up to 0.4 of the
thickness; from there the spring stiffens, `STIFFENING` times at the full thickness, as a compressed layer does.

How MuJoCo gets there. A frictional contact at rest with impedance d carries ``f = kappa * r / R``, with
``kappa = k d / d_max^2`` for ``solref = (-k, -b)`` and, for the elliptic cone, ``R = (1 - d) / d * W``; W is the
sum of the two bodies' ``body_invweight0``. The pyramidal cone divides R by
``2 * impratio / (mu^2 * (1 + mu^2))``. (Read off MuJoCo's constraint model and checked by pressing.) Whatever
is touched, the contact moves no faster than a damped oscillator with ``kappa`` and ``beta = b / d_max`` per unit mass.
So beta is set as high as the time step resolves, kappa = beta / relaxation, and R then makes the stiffness.

W contains the mass of whatever is touched, so the same numbers in a file would be stiff for a heavy object and
soft for a light one. `Gel.apply` therefore gives the pad's body an inverse weight that dwarfs any object's; only
the contacts of the taxels use it. In a file, where this cannot be written, W is that of a nominal object.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    import mujoco

    from paxisim.layout import TaxelLayout
    from paxisim.models.pads import Pads

CONTACTS: Mapping[str, int] = {"boxes": 4, "spheres": 1}
"""Contacts MuJoCo makes between a flat face and one taxel of each kind; they share the taxel's stiffness."""

NOMINAL_INVERSE_WEIGHT = 10.0
"""Inverse weight (1/kg) assumed in files: an object of 0.1 kg held against a heavy finger."""

STIFFENING = 100.0
"""How much stiffer the layer is when it is pressed through its whole thickness."""

_STIFFENS_FROM = (0.5, 16.0)  # solimp's midpoint and power: the impedance is constant to 0.4 of the thickness
_APPLIED_IMPEDANCE = 0.99  # the pad's inverse weight is then 99 R, for the default gel 4000 1/kg: 0.1 kg adds 0.3 %
_DAMPING_PER_STEP = 0.5  # beta * timestep: the share of an impact's speed that one step may take away
_STEPS_PER_RELAXATION = 2
_NOMINAL_TIMESTEP = 2e-3


@dataclass(frozen=True)
class Gel:
    """The soft layer under the taxels.

    The default, 100 kPa over 3.3 mm, is 596 N/m for a taxel of 4.35 x 4.52 mm: soft enough that most taxels of a
    pad with 0.2 mm of unevenness take part under 5 N, as they do on the real sensor (paper, Fig. 1).
    The paper gives no material data; this is our choice.

    The stiffness is that of a taxel under a flat face, on which MuJoCo's box collider makes four contacts. Where
    an object makes but one, as a sphere does, a box taxel is four times softer, until the layer stiffens; taxels that
    are spheres make one contact with whatever touches them.

    Attributes:
        modulus: Stiffness of the layer (Pa): pressure = modulus * indentation / thickness.
        thickness: Thickness of the layer (m), not of the taxel cubes, which only carry the contacts.
        relaxation: Damping over stiffness (s), the Kelvin-Voigt time constant. MuJoCo's friction creeps at a
            rate inversely proportional to it, so very short times let a held object slide.
        friction: Sliding friction coefficient of the surface; it wins over the object's own.

    Raises:
        InvalidValueError: A value that is not positive and finite.
    """

    modulus: float = 100e3
    thickness: float = 3.3e-3
    relaxation: float = 0.04
    friction: float = 1.0

    def __post_init__(self) -> None:
        """Check the values."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not (np.isfinite(value) and value > 0):
                raise InvalidValueError(f"a gel's {item.name} must be positive and finite, got {value!r}")

    @classmethod
    def per_taxel(
        cls, stiffness: float, layout: TaxelLayout, *, relaxation: float = 0.04, friction: float = 1.0
    ) -> Gel:
        """The gel of which one taxel of `layout` has `stiffness` (N/m)."""
        area = layout.pitch[0] * layout.pitch[1]
        return cls(stiffness * cls.thickness / area, cls.thickness, relaxation, friction)

    def stiffness(self, layout: TaxelLayout) -> float:
        """Stiffness of one taxel of `layout` (N/m)."""
        return self.modulus * layout.pitch[0] * layout.pitch[1] / self.thickness

    def file_parameters(
        self, layout: TaxelLayout, contacts: int = CONTACTS["boxes"]
    ) -> tuple[tuple[float, float], tuple[float, ...]]:
        """``solref`` and ``solimp`` for a file: exact for elliptic cones, 2 ms and `NOMINAL_INVERSE_WEIGHT`."""
        kappa, beta = self._oscillator(_NOMINAL_TIMESTEP)
        regularisation = self._regularisation(layout, kappa, contacts)
        impedance = NOMINAL_INVERSE_WEIGHT / (NOMINAL_INVERSE_WEIGHT + regularisation)
        return self._solver_parameters(kappa, beta, impedance)

    def apply(self, model: mujoco.MjModel, pads: Pads) -> None:
        """Give the taxels of a compiled model this gel, whatever they touch.

        Writes ``geom_solref``, ``geom_solimp``, ``geom_friction`` and ``geom_priority`` of the taxels and
        ``body_invweight0`` of the pad bodies, for the model's current time step, cone and ``impratio``.
        ``mj_setConst`` and recompiling undo the last; call this again after them.

        Args:
            model: The compiled model.
            pads: Its pads, from `find_pads` or `attach(...).bind(model)`.

        Raises:
            InvalidValueError: The relaxation time is too short for the model's time step, or the pads are those of
                another model.
        """
        import mujoco

        from paxisim.models.pads import check_pads

        check_pads(model, pads)
        shortest = _STEPS_PER_RELAXATION * model.opt.timestep
        if self.relaxation < shortest * (1 - 1e-9):
            raise InvalidValueError(
                f"a gel's relaxation must be at least {_STEPS_PER_RELAXATION} time steps "
                f"({shortest:g} s here), got {self.relaxation:g} s"
            )
        kappa, beta = self._oscillator(model.opt.timestep)
        solref, solimp = self._solver_parameters(kappa, beta, _APPLIED_IMPEDANCE)
        model.geom_solref[pads.geoms] = solref
        model.geom_solimp[pads.geoms] = solimp
        model.geom_friction[pads.geoms, 0] = self.friction
        model.geom_priority[pads.geoms] = 1
        softening = 1.0
        if int(model.opt.cone) == int(mujoco.mjtCone.mjCONE_PYRAMIDAL):
            squared = self.friction**2
            softening = 2 * model.opt.impratio / (squared * (1 + squared))
        for body, geoms, layout in zip(pads.bodies, pads.geoms, pads.layouts, strict=True):
            round_ones = int(model.geom_type[geoms[0]]) == int(mujoco.mjtGeom.mjGEOM_SPHERE)
            contacts = CONTACTS["spheres" if round_ones else "boxes"]
            regularisation = softening * self._regularisation(layout, kappa, contacts)
            odds = _APPLIED_IMPEDANCE / (1 - _APPLIED_IMPEDANCE)
            model.body_invweight0[body, 0] = regularisation * odds

    def _oscillator(self, timestep: float) -> tuple[float, float]:
        """Kappa (1/s^2) and beta (1/s)."""
        beta = _DAMPING_PER_STEP / timestep
        return beta / self.relaxation, beta

    def _regularisation(self, layout: TaxelLayout, kappa: float, contacts: int) -> float:
        """R of one contact (1/kg), of so many a taxel."""
        return kappa * contacts / self.stiffness(layout)

    def _solver_parameters(
        self, kappa: float, beta: float, impedance: float
    ) -> tuple[tuple[float, float], tuple[float, ...]]:
        impedance = float(np.clip(impedance, 1e-4, 0.99))
        odds = STIFFENING * impedance / (1 - impedance)
        stiffest = odds / (1 + odds)
        solref = (-kappa * stiffest**2 / impedance, -beta * stiffest)
        return solref, (impedance, stiffest, self.thickness, *_STIFFENS_FROM)
