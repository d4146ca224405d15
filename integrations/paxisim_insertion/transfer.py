"""Transfer: a stand-in for the paper's real robot, with sensors and robots that no training has seen.

No real robot and no real sensor is involved. The sensors of ``"pads"`` are magnetic pads from first principles, which
share no formula with GCS: each has a layer, magnets and an uneven surface of its own, and presses on the handle as
softly as its layer is. Those of ``"surrogates"`` are chains of effects outside the ranges of GCS, on the gel of the
training.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import paxisim

from .surrogates import OPEN, PADS, draw_surrogate, uneven_surface

COUNT = 25
"""Number of sensors of each kind of transfer; every second one was zeroed with the gripper open."""

FIRST_UNIT = 100
"""Number of the first unit of the magnetic pad. Lower ones were used to develop paxisim."""

IN_GRASP, WHILE_OPEN = "zeroed in the grasp", "zeroed while open"

MODULUS, THICKNESS, POISSON, DEPTH = (0.3e6, 0.8e6), (0.8, 1.3), (0.45, 0.49), (0.3, 0.5)
"""Ranges of the layers: modulus (Pa), thickness relative to `paxisim.PadParameters.for_layout`, Poisson's ratio, and
depth of the magnets relative to the thickness."""

POSE_OFFSET = np.repeat([1.5e-3, 4e-3], 3)
"""Largest error of p_t that is constant over an episode, along each axis (m) and about each (rad)."""

POSE_NOISE = np.repeat([0.3e-3, 1e-3], 3)
"""Standard deviation of the additional error of p_t at each step (m, rad)."""

STIFFNESS, FRICTION = (0.7, 1.3), (1.0, 4.0)
"""Smallest and largest factors of the controller's stiffness and of the joints' dry friction."""


@dataclass(frozen=True, eq=False)
class StandIn:
    """A sensor in place of the simulated one.

    Attributes:
        chain: Chain applied to the simulator's readings.
        surface: ``(pads, rows, cols)`` heights of the taxels (m); None for flat pads.
        gel: Gel of the pads in the simulator; None for that of the task's parameters.
        kind: How the sensor was zeroed.
    """

    chain: paxisim.Chain
    surface: NDArray[np.floating] | None = None
    gel: paxisim.Gel | None = None
    kind: str = ""


def of_unit(sensor: paxisim.MagneticSensor, kind: str = "") -> StandIn:
    """Return a unit of the magnetic pad, read in counts of 0.1 N, with its surface and the springs of its layer.

    The springs are those of a taxel that is pressed alone, as the highest taxels of an uneven surface are.
    """
    gel = paxisim.Gel.of(sensor.parameters.layer, sensor.layout, "taxel")
    return StandIn(paxisim.Chain([sensor, paxisim.augment.Firmware()]), sensor.heights(PADS), gel, kind)


def magnetic_pad(number: int, layout: paxisim.TaxelLayout) -> StandIn:
    """Draw a magnetic pad: a unit of a design with a layer and a depth of the magnets of its own.

    Args:
        number: Number of the pad; the same number gives the same pad. Odd ones were zeroed with the gripper open, and
            read the magnets of the other finger.
        layout: Taxel layout of the pads.
    """
    rng = np.random.default_rng([number, 3])
    usual = paxisim.PadParameters.for_layout(layout)
    modulus = float(np.exp(rng.uniform(*np.log(MODULUS))))
    thickness = float(rng.uniform(*THICKNESS) * usual.layer.thickness)
    layer = paxisim.Layer(modulus, float(rng.uniform(*POISSON)), thickness)
    design = replace(usual, layer=layer, magnet_depth=float(rng.uniform(*DEPTH) * thickness))
    unit = FIRST_UNIT + number
    if number % 2 == 0:
        return of_unit(paxisim.MagneticSensor(layout, unit, design), IN_GRASP)
    opened = paxisim.MagneticSensor(layout, unit, design, covariate="gripper_opening", zeroed_at=OPEN)
    return of_unit(opened, WHILE_OPEN)


def surrogate(number: int, layout: paxisim.TaxelLayout) -> StandIn:
    """Draw a surrogate; odd numbers were zeroed with the gripper open, see `draw_surrogate`."""
    is_open = number % 2 == 1
    chain = draw_surrogate(number, field=is_open)
    return StandIn(chain, uneven_surface(number, layout), None, WHILE_OPEN if is_open else IN_GRASP)


KINDS: dict[str, Callable[[int, paxisim.TaxelLayout], StandIn]] = {"pads": magnetic_pad, "surrogates": surrogate}
"""How the sensors of each kind of transfer are drawn."""


def sensors(transfer: str, layout: paxisim.TaxelLayout, episodes: int = COUNT) -> list[StandIn]:
    """Return the sensors that take turns in a number of episodes of a kind of transfer, at most `COUNT`.

    Raises:
        UnknownNameError: There is no such kind.
    """
    if transfer not in KINDS:
        raise paxisim.UnknownNameError("transfer", transfer, KINDS)
    return [KINDS[transfer](number, layout) for number in range(min(episodes, COUNT))]


@dataclass(frozen=True, eq=False)
class Gap:
    """How the robot of one episode of an evaluation differs from the simulated one, as no training has seen it.

    The paper blames the failures of a policy without touch on "pose tracking noise and OSC dynamics gap due to friction
    in physical motors" and gives no figures. The ranges are ours: a camera that locates the base's markers to about
    1.5 mm and a quarter of a degree, and an arm with up to four times the joint friction of robosuite's (0.1 N m each).

    Attributes:
        offset: ``(6,)`` error of p_t that is constant over the episode (m, rad).
        stiffness: Factor of the controller's stiffness; its damping ratio is unchanged.
        friction: Factor of the joints' dry friction.
    """

    offset: NDArray[np.floating]
    stiffness: float
    friction: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Gap:
        """Draw the gap of one episode."""
        offset = rng.uniform(-POSE_OFFSET, POSE_OFFSET)
        return cls(offset, float(rng.uniform(*STIFFNESS)), float(rng.uniform(*FRICTION)))

    def believed(self, pose: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
        """Return the pose ``(6,)`` (m, rad) that the robot measures for a true pose."""
        return (pose + self.offset + POSE_NOISE * rng.standard_normal(6)).astype(np.float32)
