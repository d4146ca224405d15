"""Gel: the compliance of the sensor's soft layer in physical units, turned into MuJoCo contact parameters.

The layer is a bed of independent Kelvin-Voigt springs (a Winkler foundation): a taxel of area A with indentation r
carries ``F = modulus * A / thickness * (r + relaxation * dr/dt)``. This holds to 2 % for r up to 0.4 of the thickness.
Beyond that, the spring stiffens, up to `STIFFENING` times at the full thickness, as a compressed layer does. Stiff gels
stiffen less.

MuJoCo's contact parameters follow from its constraint model; presses confirm them. A frictional contact at rest with
impedance d carries ``f = kappa * r / R``, with ``kappa = k d / d_max^2`` for ``solref = (-k, -b)`` and, for the
elliptic cone, ``R = (1 - d) / d * W``. W is the sum of the two bodies' ``body_invweight0``. The pyramidal cone divides
R by ``2 * impratio / (mu^2 * (1 + mu^2))``. Whatever the object, the contact moves no faster than a damped oscillator
with ``kappa`` and ``beta = b / d_max`` per unit mass. Therefore beta is as high as the time step resolves,
kappa = beta / relaxation, and R sets the stiffness.

W contains the mass of the object, so the same numbers in a file would be stiff for a heavy object and soft for a light
one. `Gel.apply` therefore gives the pad's body an inverse weight much larger than that of any object; only the contacts
of the taxels use it. For the same R, d has to be the closer to 1 the stiffer the gel is, and less is left to stiffen it
up to MuJoCo's largest d of 0.9999. A file cannot store this weight, so there W is that of a nominal object.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layer.layer import STATED_FORCE

if TYPE_CHECKING:
    import mujoco

    from paxisim.layer.layer import Contact, Layer
    from paxisim.layout import TaxelLayout
    from paxisim.models.pads import Pads

CONTACTS: Mapping[str, int] = {"boxes": 4, "spheres": 1}
"""Contacts MuJoCo makes between a flat face and one taxel of each kind; they share the taxel's stiffness."""

NOMINAL_INVERSE_WEIGHT = 10.0
"""Inverse weight (1/kg) assumed in files: an object of 0.1 kg held against a heavy finger."""

STIFFENING = 100.0
"""Largest factor by which the layer is stiffer at an indentation of its whole thickness."""

_STIFFENS_FROM = (0.5, 16.0)  # solimp's midpoint and power: the impedance is constant to 0.4 of the thickness
_LEAST_INVERSE_WEIGHT = 4000.0  # of a pad of spheres (1/kg), where d can be large enough: 0.1 kg adds 0.3 %
_LEAST_ODDS, _MOST_ODDS = 0.99 / (1 - 0.99), 9999.0  # d / (1 - d); MuJoCo's largest impedance is 0.9999
_DAMPING_PER_STEP = 0.5  # beta * timestep: largest share of an impact's speed lost in one step
_STEPS_PER_RELAXATION = 2
_NOMINAL_TIMESTEP = 2e-3


@dataclass(frozen=True)
class Gel:
    """The soft layer under the taxels.

    The default, 100 kPa over 3.3 mm, gives 596 N/m for a taxel of 4.35 x 4.52 mm. This is soft enough that most taxels
    of a pad with 0.2 mm of unevenness carry load at 5 N, as on the real sensor (paper, Fig. 1). The paper gives no
    material data; these values are our choice, softer than a layer of any silicone: `Gel.of` makes stiffer ones.

    The stiffness is that of a taxel under a flat face, for which MuJoCo's box collider makes four contacts. If an
    object makes only one contact, as a sphere does, a box taxel is four times softer until the layer stiffens. Sphere
    taxels make one contact with every object.

    Attributes:
        modulus: Stiffness of the layer (Pa): pressure = modulus * indentation / thickness.
        thickness: Thickness of the layer (m), not of the taxel cubes, which only carry the contacts.
        relaxation: Damping over stiffness (s), the Kelvin-Voigt time constant. MuJoCo's friction creeps at a
            rate inversely proportional to it, so very short times let a held object slide.
        friction: Sliding friction coefficient of the surface; it overrides that of the object.

    Raises:
        InvalidValueError: A value is not a positive finite number.
    """

    modulus: float = 100e3
    thickness: float = 3.3e-3
    relaxation: float = 0.04
    friction: float = 1.0

    def __post_init__(self) -> None:
        """Check the values."""
        for item in fields(self):
            value = getattr(self, item.name)
            is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
            if not (is_number and np.isfinite(value) and value > 0):
                raise InvalidValueError(f"a gel's {item.name} must be positive and finite, got {value!r}")

    @classmethod
    def per_taxel(
        cls, stiffness: float, layout: TaxelLayout, *, relaxation: float = 0.04, friction: float = 1.0
    ) -> Gel:
        """Return the gel with which one taxel of `layout` has `stiffness` (N/m)."""
        area = layout.pitch[0] * layout.pitch[1]
        return cls(stiffness * cls.thickness / area, cls.thickness, relaxation, friction)

    @classmethod
    def of(
        cls,
        layer: Layer,
        layout: TaxelLayout,
        contact: Contact = "flat",
        *,
        force: float = STATED_FORCE,
        relaxation: float = 0.04,
        friction: float = 1.0,
    ) -> Gel:
        """Return the springs that carry what an elastic layer carries at the same indentation, for one contact.

        Taxels of a layer push on their neighbours, and springs do not: for other contacts, and for how a load is shared
        between taxels, the springs are off; docs/measurements/pads.md states by how much. With box taxels the stiffness
        holds for flat faces only, see `Gel`; use sphere taxels with a radius.

        Args:
            layer: The elastic layer.
            layout: Layout of the taxels.
            contact: ``"flat"``, ``"taxel"`` or the radius of a sphere (m), see `Layer.stiffness`.
            force: Force (N) that presses the sphere.
            relaxation: See `Gel`.
            friction: See `Gel`.

        Raises:
            InvalidValueError: As for `Layer.stiffness`, or a value is not positive and finite.
        """
        stiffness = layer.stiffness(layout, contact, force=force)
        area = layout.pitch[0] * layout.pitch[1]
        return cls(stiffness * layer.thickness / area, layer.thickness, relaxation, friction)

    def stiffness(self, layout: TaxelLayout) -> float:
        """Return the stiffness of one taxel of `layout` (N/m)."""
        return self.modulus * layout.pitch[0] * layout.pitch[1] / self.thickness

    def file_parameters(
        self, layout: TaxelLayout, contacts: int = CONTACTS["boxes"]
    ) -> tuple[tuple[float, float], tuple[float, ...]]:
        """Return ``solref`` and ``solimp`` for a file; exact for elliptic cones, 2 ms and `NOMINAL_INVERSE_WEIGHT`."""
        kappa, beta = self._oscillator(_NOMINAL_TIMESTEP)
        regularisation = self._regularisation(layout, kappa, contacts)
        impedance = NOMINAL_INVERSE_WEIGHT / (NOMINAL_INVERSE_WEIGHT + regularisation)
        return self._solver_parameters(kappa, beta, float(np.clip(impedance, 1e-4, 0.99)))

    def apply(self, model: mujoco.MjModel, pads: Pads) -> None:
        """Give the taxels of a compiled model this gel, independently of the objects they touch.

        Writes ``geom_solref``, ``geom_solimp``, ``geom_friction`` and ``geom_priority`` of the taxels and
        ``body_invweight0`` of the pad bodies, for the model's current time step, cone and ``impratio``.
        ``mj_setConst`` and recompiling reset ``body_invweight0``; call this method again after them.

        The priority becomes higher than that of everything the taxels can touch, so that MuJoCo takes the stiffness,
        friction and condim (3) of the taxels. A warning names what would still take the gel or the load away: see
        `paxisim.models.contact_checks`.

        Args:
            model: The compiled model.
            pads: Pads of the model, from `find_pads` or `attach(...).bind(model)`.

        Raises:
            InvalidValueError: The relaxation time is too short for the model's time step, or the pads belong to another
                model.
        """
        import mujoco

        from paxisim.models.contact_checks import warn_of_contacts
        from paxisim.models.pads import check_pads, highest_priority_met

        check_pads(model, pads)
        shortest = _STEPS_PER_RELAXATION * model.opt.timestep
        if self.relaxation < shortest * (1 - 1e-9):
            raise InvalidValueError(
                f"a gel's relaxation must be at least {_STEPS_PER_RELAXATION} time steps "
                f"({shortest:g} s here), got {self.relaxation:g} s"
            )
        kappa, beta = self._oscillator(model.opt.timestep)
        model.geom_friction[pads.geoms, 0] = self.friction
        model.geom_priority[pads.geoms] = 1 + highest_priority_met(model, pads)
        softening = 1.0
        if int(model.opt.cone) == int(mujoco.mjtCone.mjCONE_PYRAMIDAL):
            squared = self.friction**2
            softening = 2 * model.opt.impratio / (squared * (1 + squared))
        for body, geoms, layout in zip(pads.bodies, pads.geoms, pads.layouts, strict=True):
            round_ones = int(model.geom_type[geoms[0]]) == int(mujoco.mjtGeom.mjGEOM_SPHERE)
            contacts = CONTACTS["spheres" if round_ones else "boxes"]
            regularisation = softening * self._regularisation(layout, kappa, contacts)
            # leaves a factor of 2 to stiffen; where paxisim.warp merges a taxel's contacts, their odds add up
            most = _MOST_ODDS / (2 * contacts)
            odds = float(np.clip(_LEAST_INVERSE_WEIGHT / contacts / regularisation, _LEAST_ODDS, most))
            model.geom_solref[geoms], model.geom_solimp[geoms] = self._solver_parameters(kappa, beta, odds / (1 + odds))
            model.body_invweight0[body, 0] = regularisation * odds
        warn_of_contacts(model, pads)

    def _oscillator(self, timestep: float) -> tuple[float, float]:
        """Return kappa (1/s^2) and beta (1/s)."""
        beta = _DAMPING_PER_STEP / timestep
        return beta / self.relaxation, beta

    def _regularisation(self, layout: TaxelLayout, kappa: float, contacts: int) -> float:
        """Return R of one contact (1/kg), for a taxel with this number of contacts."""
        return kappa * contacts / self.stiffness(layout)

    def _solver_parameters(
        self, kappa: float, beta: float, impedance: float
    ) -> tuple[tuple[float, float], tuple[float, ...]]:
        odds = min(STIFFENING * impedance / (1 - impedance), _MOST_ODDS)
        stiffest = odds / (1 + odds)
        solref = (-kappa * stiffest**2 / impedance, -beta * stiffest)
        return solref, (impedance, stiffest, self.thickness, *_STIFFENS_FROM)


def is_applied(model: mujoco.MjModel, geoms: NDArray[np.int64]) -> bool:
    """Tell whether the taxels of a pad have a gel from `Gel.apply`, not that of their file."""
    return bool(np.all(model.geom_solimp[geoms, 0] >= _LEAST_ODDS / (1 + _LEAST_ODDS)))
