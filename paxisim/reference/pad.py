"""MagneticPad: from forces on the taxels to what a magnetic sensor makes of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from array_api_compat import array_namespace, is_torch_array
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.reference.dipoles import field, jacobian, turned
from paxisim.reference.influence import influence
from paxisim.reference.parameters import PadParameters
from paxisim.reference.spread import Spread
from paxisim.reference.stiffening import finite_share

FloatArray = NDArray[np.float64]

NEAR = 1.5
"""Pitches within which a magnet's field at a sensor is computed in full; that of others is linear in how they move."""
PRESSES = (0.25, 0.5, 1.0)
"""Normal forces (N) by which a maker would calibrate a taxel, and shares of them that drag it along x and y."""
DRAGS = (-0.3, 0.0, 0.3)
TEMPERATURE = -1.2e-3
"""Change of a magnet's remanence per kelvin: NdFeB's data sheets have -0.11 to -0.12 % per kelvin."""


class MagneticPad:
    """One manufactured pad.

    Forces on the taxels press and drag a soft layer. The magnets in it move and turn, each by the loads on all taxels.
    Each Hall sensor below reads the sum of all magnets' fields. A calibration, fitted to presses of single taxels of
    the nominal design, turns the change of a sensor's field into the force on its taxel.

    Example::

        pad = MagneticPad.unit(layout, seed=7)
        reading = pad.read(force)  # (..., 3, rows, cols) newtons, as a sensor of this kind reports them

    Attributes:
        layout: Its taxels; a flat grid.
        parameters: What this unit is made of.
        seed: What makes it differ from the nominal design; None: nothing does.
    """

    def __init__(self, layout: TaxelLayout, parameters: PadParameters | None = None, seed: int | None = None) -> None:
        """Make the nominal pad, or with a seed the unit of that number; see `unit`.

        Raises:
            InvalidValueError: The layout is not a flat grid.
        """
        if not layout.is_grid or np.ptp(layout.positions[:, 2]) > 0:
            raise InvalidValueError("a magnetic pad needs a flat grid of taxels: a curved gel is another problem")
        self.layout, self.seed = layout, seed
        nominal = PadParameters() if parameters is None else parameters
        rng = np.random.default_rng(seed)
        spread = Spread(rng) if seed is not None else None
        self.parameters = nominal if spread is None else spread.of(nominal)
        count, taxels = layout.taxels, layout.positions[:, :2].astype(np.float64)
        magnets = np.column_stack([taxels, np.full(count, self.parameters.magnet_depth)])
        moments = np.tile([0.0, 0.0, self.parameters.moment], (count, 1))
        sensors = np.column_stack([taxels, np.full(count, self.parameters.magnet_depth + self.parameters.distance)])
        self._view = np.tile(np.eye(3), (count, 1, 1))
        earth = np.zeros(3)
        if spread is not None:
            magnets, moments = spread.magnets(magnets, moments, self.parameters)
            self._view, earth = spread.sensors(count, self.parameters), spread.earth(self.parameters)
        self._set_field(magnets, moments, sensors, earth)
        self._kinds: dict[Any, dict[str, Any]] = {}
        to_force = _calibration(self) if seed is None else MagneticPad(layout, nominal)._constants["to_force"]
        self._kinds.clear()
        self._constants["to_force"] = to_force

    @classmethod
    def unit(cls, layout: TaxelLayout, seed: int, parameters: PadParameters | None = None) -> MagneticPad:
        """One manufactured unit: what its parameters spread, it draws from the seed.

        Args:
            layout: Its taxels.
            seed: Its number.
            parameters: The nominal design.
        """
        return cls(layout, parameters, seed)

    def read(self, force: Any, *, warmer: float = 0.0, outside: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
        """What the pad reports of the forces on it, without noise.

        Args:
            force: ``(..., 3, rows, cols)`` newtons; numpy or torch.
            warmer: Kelvin by which the magnets are warmer than when the pad was zeroed.
            outside: Flux density (T, pad frame) of iron, a motor or a magnet outside, since it was zeroed.

        Returns:
            ``(..., 3, rows, cols)`` newtons.
        """
        flux = self.flux(force)
        if warmer or any(outside):
            like, loss = self._arrays(flux), TEMPERATURE * warmer
            field_outside = sum(part * like["view"][..., axis] for axis, part in enumerate(outside))
            flux = flux * (1 + loss) + loss * like["magnets"] + field_outside
        return self._newtons(flux)

    def measure(self, force: Any, rng: np.random.Generator) -> FloatArray:
        """As `read`, with noise and in the steps and the range of the Hall sensors; numpy."""
        own, rest = self.parameters, self._rest
        flux = self.flux(np.asarray(force, dtype=np.float64)) + rest
        flux = np.clip(flux + own.noise * rng.standard_normal(flux.shape), -own.range, own.range)
        return np.asarray(self._newtons(own.step * np.rint(flux / own.step) - rest))

    def flux(self, force: Any) -> Any:
        """``(..., N, 3)`` change of the flux density (T) at each Hall sensor, in the sensor's own axes."""
        moved, rotated = self.motion(force)
        like = self._arrays(moved)
        near = like["near"]
        there = field(turned(like["moments"], rotated[..., near, :]), like["offsets"] - moved[..., near, :])
        change = ((there - like["fields"]) * like["is_near"]).sum(-2)
        both = self._joined(moved, rotated)
        change = change + (both @ like["far"]).reshape(change.shape)
        return (like["view"] @ change[..., None])[..., 0]

    def motion(self, force: Any) -> tuple[Any, Any]:
        """``(..., N, 3)`` how far (m) and by how much (rad) each magnet moves and turns."""
        self.layout.check(force)
        count = self.layout.taxels
        like = self._arrays(force)
        flat = force.reshape((*force.shape[:-3], 3 * count))
        moved = (flat @ like["moves"]).reshape((*force.shape[:-3], count, 3))
        rotated = (flat @ like["turns"]).reshape(moved.shape)
        own = self.parameters
        share = finite_share(moved[..., 2:] / own.thickness)
        return moved * share, rotated * share

    def _newtons(self, flux: Any) -> Any:
        like = self._arrays(flux)
        taxels = (like["to_force"] @ flux[..., None])[..., 0]
        rows, cols = self.layout.rows, self.layout.cols
        xp = array_namespace(taxels)
        lead = taxels.ndim - 2
        out = xp.permute_dims(taxels, (*range(lead), lead + 1, lead))
        return out.reshape((*taxels.shape[:-2], 3, rows, cols))

    def _set_field(self, magnets: FloatArray, moments: FloatArray, sensors: FloatArray, earth: FloatArray) -> None:
        """Keep the near magnets of each sensor with their fields at rest, and the far ones' Jacobian."""
        count = len(magnets)
        offsets = sensors[:, None] - magnets
        apart = np.linalg.norm(offsets[..., :2] / np.array(self.layout.pitch)[::-1], axis=-1)
        nearest, is_near = _nearest(apart)
        row = np.arange(count)[:, None]
        all_moments = np.broadcast_to(moments, offsets.shape)
        far = jacobian(all_moments, offsets)  # (sensors, magnets, 3, 6)
        far[row, nearest] *= ~is_near[..., None, None]
        magnets_alone = np.einsum("nij,nj->ni", self._view, field(all_moments, offsets).sum(axis=1))
        self._rest = magnets_alone + self._view @ earth
        moves, turns = influence(self.layout, self.parameters)
        self._constants = {
            "near": nearest,
            "offsets": offsets[row, nearest],
            "moments": all_moments[row, nearest],
            "fields": field(all_moments[row, nearest], offsets[row, nearest]),
            "is_near": is_near[..., None].astype(np.float64),
            # (magnets x 6, sensors x 3)
            "far": far.transpose(1, 3, 0, 2).reshape(6 * count, 3 * count),
            "view": self._view,
            "magnets": magnets_alone,
            "moves": moves,
            "turns": turns,
        }

    def _joined(self, moved: Any, rotated: Any) -> Any:
        xp = array_namespace(moved)
        both = xp.concat([moved, rotated], axis=-1)
        return both.reshape((*both.shape[:-2], 6 * self.layout.taxels))

    def _arrays(self, like: Any) -> dict[str, Any]:
        """The constants as arrays of the kind of `like`, made once."""
        key = like.dtype, getattr(like, "device", None)
        if key not in self._kinds:
            self._kinds[key] = {name: _as(value, like) for name, value in self._constants.items()}
        return self._kinds[key]

    def __repr__(self) -> str:
        """Its grid and its number."""
        which = "nominal" if self.seed is None else f"unit {self.seed}"
        return f"MagneticPad({self.layout.rows}x{self.layout.cols}, {which})"


def _as(value: NDArray[Any], like: Any) -> Any:
    """An array of the kind of `like`; numbers of magnets stay whole."""
    is_float = np.issubdtype(value.dtype, np.floating)
    if not is_torch_array(like):
        return value.astype(np.float32) if is_float and like.dtype == np.float32 else value
    import torch

    return torch.as_tensor(value).to(like.device, like.dtype if is_float else None)


def _nearest(apart: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """``(sensors, k)`` the magnets near each sensor, as many for all, and which of them are near indeed."""
    near = apart <= NEAR
    order = np.argsort(~near, axis=1, kind="stable")[:, : int(near.sum(axis=1).max())]
    return order, np.take_along_axis(near, order, axis=1)


def _calibration(pad: MagneticPad) -> FloatArray:
    """``(N, 3, 3)`` newtons per tesla of each taxel: what fits presses of single taxels of that pad best."""
    loads = np.array([(p * a, p * b, p) for p in PRESSES for a in DRAGS for b in DRAGS])
    count = pad.layout.taxels
    maps = np.empty((count, 3, 3))
    for taxel in range(count):
        force = np.zeros((len(loads), 3, count))
        force[:, :, taxel] = loads
        flux = pad.flux(force.reshape(len(loads), *pad.layout.shape))[:, taxel]
        maps[taxel] = np.linalg.lstsq(flux, loads, rcond=None)[0].T
    return maps
