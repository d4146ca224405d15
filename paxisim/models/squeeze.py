"""squeeze: prove in MuJoCo that the pads of a gripper carry the load when it closes on an object.

The gripper closes with its own actuators on objects of several thicknesses, smaller and larger than its pads, until
the object carries a given force. Whatever else touches the object is named. Where pads do not hold an object between
them, as on a hand, each finger presses its pad on a fixed plate.

Everything but the closing end effector is locked, gravity is off, and the robot touches nothing but the object. The
object is rigid, so a geom that is level with a pad takes its share of the load at once.
"""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.attach import TactileGripper
from paxisim.models.bench import Bench, Loads
from paxisim.models.grip import Grip
from paxisim.models.load import compile_whole
from paxisim.models.mount import name_for_replaces
from paxisim.models.objects import Placed, place_objects
from paxisim.models.pads import Pads

GOOD_SHARE = 0.95
"""Smallest share of the load that the pads of a sound mount carry."""

_TOUCHES = 1e-4  # smallest share of the load that counts as touching
_COLUMNS = 100
_FEW = 0.5  # fewer taxels than this share of a pad are few
_PLURALS = {"box": "boxes", "plate": "plates", "cylinder": "cylinders"}
_AGREES = 1e-3  # largest difference of reading and solver, as a share of the force


@dataclass(frozen=True, eq=False)
class Squeeze:
    """One object, and the forces on it at rest.

    Attributes:
        pads: Names of the pads.
        opening: Thickness of the object as a share of the way from closed to open; on a plate, where on that way the
            finger presses.
        object: Shape and size of the object in mm.
        share: Share of the normal force on the object that these pads carry; NaN if nothing touches it.
        read: ``(pads,)`` normal force (N) that each pad reads.
        solver: ``(pads,)`` the same force from MuJoCo's ``mj_contactForce``.
        loaded: ``(pads,)`` number of taxels that carry load.
        others: Normal force (N) of everything else that touches the object, by name, the largest first. A geom without
            a name is ``BODY/INDEX``, its index among the body's geoms.
        note: What makes the numbers doubtful; empty if nothing does.
    """

    pads: tuple[str, ...]
    opening: float
    object: str
    share: float
    read: NDArray[np.float64]
    solver: NDArray[np.float64]
    loaded: NDArray[np.int64]
    others: dict[str, float]
    note: str = ""

    @property
    def is_doubtful(self) -> bool:
        """Whether something else carries load, a pad carries none, its reading is wrong, or there is a note."""
        wrong = bool(self.note or self.others) or not self.agrees
        return wrong or not self.share >= GOOD_SHARE or bool(np.any(self.read == 0))

    @property
    def agrees(self) -> bool:
        """Whether the reading of each pad equals the contact solver's force."""
        return bool(np.allclose(self.read, self.solver, rtol=_AGREES, atol=_AGREES))


@dataclass(frozen=True, eq=False)
class SqueezeResult:
    """Result of `squeeze`; printing it shows a table.

    Attributes:
        squeezes: The objects, in the order in which they were squeezed.
        untested: Why a pad was not tested, by its name.
        taxels: Number of taxels of a pad.
    """

    squeezes: tuple[Squeeze, ...]
    untested: dict[str, str]
    taxels: int

    @property
    def shares(self) -> dict[str, float]:
        """Smallest share of the load that each tested pad and those beside it carried; 0 if it touched nothing."""
        found: dict[str, float] = {}
        for one in self.squeezes:
            touched = one.read != 0  # negative if an object pulls at the sides of the taxels
            for pad, touches in zip(one.pads, touched, strict=True):
                found[pad] = min(found.get(pad, 1.0), one.share if touches else 0.0)
        return found

    @property
    def passed(self) -> bool:
        """Whether every pad was tested, carried at least `GOOD_SHARE` of each load and read what the solver says."""
        clean = all(one.agrees and not one.note for one in self.squeezes)
        return clean and not self.untested and min(self.shares.values(), default=0.0) >= GOOD_SHARE

    @property
    def touched(self) -> dict[str, int]:
        """Fewest taxels of each tested pad that carried load on any object."""
        found: dict[str, int] = {}
        for one in self.squeezes:
            for pad, loaded in zip(one.pads, one.loaded.tolist(), strict=True):
                found[pad] = min(found.get(pad, self.taxels), loaded)
        return found

    def __repr__(self) -> str:
        """One line with the number of objects and whether the pads passed."""
        count = len(self.squeezes)
        return f"SqueezeResult({count} object{'s' * (count != 1)}, {'passed' if self.passed else 'not passed'})"

    def __str__(self) -> str:
        """One line for each pad, the objects on which something is doubtful, and a verdict.

        Lines are at most 100 columns wide unless the names of the pads are very long.
        """
        rows = [("pad", "objects", "share", "force (N)", f"taxels touched, of {self.taxels}")] if self.squeezes else []
        for name, share in self.shares.items():
            on = [(one, one.pads.index(name)) for one in self.squeezes if name in one.pads]
            kinds = Counter(one.object.split()[0] for one, _ in on)
            objects = ", ".join(f"{count} {_PLURALS[kind] if count > 1 else kind}" for kind, count in kinds.items())
            force = _range([f"{one.read[i]:.2f}" for one, i in on])
            rows.append((name, objects, f"{100 * share:.0f} %", force, _range([str(one.loaded[i]) for one, i in on])))
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(map(str.ljust, row, wide)).rstrip() for row in rows]
        doubtful = [one for one in self.squeezes if one.is_doubtful]
        if doubtful:
            lines += ["", "doubtful:", *(line for one in doubtful for line in self._rows(one, wide[0])), ""]
        return "\n".join([*lines, *(f"{pad}: not tested, {why}" for pad, why in self.untested.items()), self._verdict])

    def _rows(self, one: Squeeze, wide: int) -> list[str]:
        """Return lines about one object."""
        share = "nothing on pads" if np.isnan(one.share) else f"{100 * one.share:.0f} % on pads"
        lines = [f"  {one.object} mm at {100 * one.opening:.0f} % of the opening: {share}"]
        for i, pad in enumerate(one.pads):
            row = f"    {pad:<{wide}}  reads {one.read[i]:.2f} N, MuJoCo {one.solver[i]:.2f} N, "
            lines.append(f"{row}{one.loaded[i]} of {self.taxels} taxels")
        if one.others:
            others = ", ".join(f"{name} ({newtons:.2f} N)" for name, newtons in one.others.items())
            lines += textwrap.wrap(
                f"also touches: {others}",
                _COLUMNS,
                initial_indent=" " * 4,
                subsequent_indent=" " * 6,
                break_on_hyphens=False,
            )
        return [*lines, *[f"    {one.note}"] * bool(one.note)]

    @property
    def _verdict(self) -> str:
        if not self.squeezes:
            return "no pad was tested"
        low = {pad: share for pad, share in self.shares.items() if share < GOOD_SHARE}
        if low:
            worst = ", ".join(f"{pad} {100 * share:.0f} %" for pad, share in low.items())
            return f"the pads carry less than {100 * GOOD_SHARE:.0f} % of the load: {worst}"
        least = min(self.shares.values())
        said = (
            "the pads carry all of the load"
            if least > 0.995
            else f"the pads carry at least {100 * least:.0f} % of the load"
        )
        few = [f"{pad} {count} of {self.taxels}" for pad, count in self.touched.items() if count < _FEW * self.taxels]
        return f"{said}, but some objects touch few taxels: {', '.join(few)}" if few else said


def _range(texts: list[str]) -> str:
    """Return the smallest and the largest of some numbers."""
    low, high = min(texts, key=float), max(texts, key=float)
    return low if low == high else f"{low}..{high}"


def squeeze(
    gripper: TactileGripper,
    grips: Sequence[Grip] | None = None,
    *,
    openings: Sequence[float] = (0.2, 0.5, 0.8),
    force: float = 5.0,
) -> SqueezeResult:
    """Close a gripper on objects and measure which share of the load its pads carry.

    Each thickness is tried with a small object, 0.8 times as large as the pads across the closing direction, and with
    a large one, 1.5 times as large.

    Args:
        gripper: The gripper, arm or hand with its pads.
        grips: How its end effectors close; default: ``gripper.grips``.
        openings: Thicknesses of the objects, as shares of the way from closed to open, each between 0 and 1.
        force: Normal force (N) on the object per pad at which the controls stay as they are. A gripper whose servos lag
            behind presses harder at rest, and a weak one never reaches it.

    Returns:
        The forces on each object.

    Raises:
        InvalidValueError: There are no grips, or an opening or the force is out of range.
    """
    grips = gripper.grips if grips is None else grips
    if not grips:
        raise InvalidValueError("there is nothing to squeeze with: no end effector of this gripper closes")
    if not openings or not all(0 < share < 1 for share in openings):
        raise InvalidValueError(f"openings must be shares between 0 and 1, got {tuple(openings)}")
    if not (np.isfinite(force) and force > 0):
        raise InvalidValueError(f"the force must be positive (N), got {force!r}")
    model = compile_whole(gripper.spec, "the gripper with pads")
    pads = gripper.bind(model)
    untested = dict.fromkeys(pads.names, "no end effector closes it")
    squeezes: list[Squeeze] = []
    for grip in grips:
        closing = Bench(gripper, grip).close()
        placed = place_objects(model, pads, grip, closing.qpos, openings)
        bench = Bench(gripper, grip, placed)
        for index, one in enumerate(placed):
            names = [pads.names[pad] for pad in one.pads]
            if not bench.actuators(closing, index):
                untested[names[0]] = "no actuator moves it, and it holds nothing together with another pad"
                continue
            squeezes.append(_squeeze(model, pads, one, bench.squeeze(closing, index, force)))
            for name in names:
                untested.pop(name, None)
    return SqueezeResult(tuple(squeezes), untested, pads.layout.taxels)


def _squeeze(model: mujoco.MjModel, pads: Pads, placed: Placed, loads: Loads) -> Squeeze:
    index = list(placed.pads)
    own = pads.geoms[index].reshape(-1)
    total = float(loads.normal.sum())
    pad_of = {int(geom): name for name, geoms in zip(pads.names, pads.geoms, strict=True) for geom in geoms}
    others: dict[str, float] = {}
    for geom in np.setdiff1d(np.flatnonzero(loads.normal > _TOUCHES * total), own):
        name = pad_of.get(int(geom)) or name_for_replaces(model, int(geom)) or f"geom {geom}"
        others[name] = others.get(name, 0.0) + float(loads.normal[geom])
    return Squeeze(
        pads=tuple(pads.names[pad] for pad in index),
        opening=placed.opening,
        object=placed.title,
        share=float(loads.normal[own].sum()) / total if total else np.nan,
        read=loads.read[index].sum(axis=1),
        solver=loads.solver[index],
        loaded=np.count_nonzero(loads.read[index] > 0, axis=1),
        others=dict(sorted(others.items(), key=lambda item: -item[1])),
        note=loads.note or ("" if total else "nothing touches it"),
    )
