"""MuJoCo's touch_grid plugin on a pad, as in the paper: build it, read it as the same tensor, or refuse wrong readings.

A comparison of the plugin with the contacts (MuJoCo 3.5, 3.9 and 4.0) shows:

- The plugin sorts contact points into bins of equal angle. With contiguous cubes, the corner contacts lie on the edges
  of the bins, and about half of the force falls into a neighbour's bin. With a `CUBE_GAP` between the cubes and a site
  `STANDOFF` behind them, contacts lie well inside their own bin, and each taxel agrees. (A round object catches in the
  gaps.) A contact deep in the side of a cube, or far out of the plane, can still be in a wrong bin; each reading is
  checked for this.
- Before MuJoCo 4.0, its sign is right only for contacts whose *first* geom is the taxel. This depends on the types and
  the order of the geoms: a cylinder on a cube always has the wrong sign.
- The plugin sums all contacts of everything welded to the pad, such as the finger's own geoms or a second pad.
"""

from __future__ import annotations

import mujoco
import numpy as np
from lxml import etree
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.layout import TaxelLayout
from paxisim.models import names
from paxisim.models.mjcf import numbers
from paxisim.models.pads import Pads, check_pads
from paxisim.models.readout import SLEEP

PLUGIN = "mujoco.sensor.touch_grid"
CUBE_GAP = 50e-6
"""Gap between the cubes of a pad with this sensor (m)."""
STANDOFF = 0.5
"""Distance (m) of the sensor's site behind the surface. Equal angles are then equal lengths to 3 um, and a taxel
0.4 mm out of the plane stays in its bin."""

_CHANNELS = [1, 2, 0]  # the plugin's order is normal, x, y
_SIGN_IS_SOUND = tuple(int(part) for part in mujoco.__version__.split(".")[:2]) >= (4, 0)


def check_layout(layout: TaxelLayout) -> None:
    """Raise `UnsupportedError` unless the layout is a flat grid, as the plugin requires."""
    if not layout.is_grid:
        raise UnsupportedError(
            "touch_grid needs a flat grid, but this layout has explicit positions: use TactileReadout"
        )


def add_extension(root: etree._Element) -> None:
    """Declare the plugin in an MJCF document."""
    etree.SubElement(etree.SubElement(root, "extension"), "plugin", plugin=PLUGIN)


def add_site(body: etree._Element, pad: str, layout: TaxelLayout) -> None:
    """Add the sensor's site, behind the pad and facing out of it along its own -z."""
    etree.SubElement(
        body, "site", name=names.touch_grid(pad), pos=f"0 0 {STANDOFF}", size="0.001", group="4", rgba="0 0 0 0"
    )


def add_sensor(parent: etree._Element, pad: str, layout: TaxelLayout) -> None:
    """Add the plugin's sensor, with one bin per taxel and three channels."""
    fov = np.degrees(_half_angles(layout))[::-1]
    name = names.touch_grid(pad)
    plugin = etree.SubElement(parent, "plugin", name=name, plugin=PLUGIN, objtype="site", objname=name)
    config = {
        "size": f"{layout.cols} {layout.rows}",
        "fov": numbers(fov),
        "gamma": "0",
        "nchannel": "3",
    }
    for key, value in config.items():
        etree.SubElement(plugin, "config", key=key, value=value)


class TouchGridReadout:
    """Reads the force tensor from the pads' touch_grid sensors, to reproduce the setting of the paper.

    For all other purposes, use `TactileReadout`, which is always exact and faster.
    """

    def __init__(self, model: mujoco.MjModel, pads: Pads) -> None:
        """Find the sensors.

        Args:
            model: The compiled model.
            pads: Pads of the model, built with ``Pad(sensors="touch_grid")``.

        Raises:
            InvalidValueError: A pad has no touch_grid sensor.
            UnsupportedError: The plugin would sort forces into the wrong taxels, because the layout is not a flat grid
                or the cubes are contiguous.
        """
        check_pads(model, pads)
        self._model, self._pads = model, pads
        self._slices = [self._sensor(pad) for pad in pads.names]
        for pad, layout, geoms in zip(pads.names, pads.layouts, pads.geoms, strict=True):
            check_layout(layout)
            cube = 2 * model.geom_size[geoms, :2].max(axis=0)
            gap = np.array([layout.pitch[1], layout.pitch[0]]) - cube
            if np.any(gap < 0.9 * CUBE_GAP):
                raise UnsupportedError(
                    f"pad {pad!r} has contiguous cubes, whose corner contacts lie on touch_grid's bin edges: build it "
                    f"with Pad(sensors='touch_grid'), which leaves gaps of {CUBE_GAP * 1e6:.0f} um, or "
                    "use TactileReadout"
                )
        self._sites = [self._id(mujoco.mjtObj.mjOBJ_SITE, pad) for pad in pads.names]
        self._weld_of_geom = model.body_weldid[model.geom_bodyid]
        # index of each geom's taxel in `pads.geoms`, -1 for other geoms
        self._taxel_of_geom = np.full(model.ngeom, -1)
        self._taxel_of_geom[pads.geoms.reshape(-1)] = np.arange(pads.geoms.size)

    def _id(self, kind: mujoco.mjtObj, pad: str) -> int:
        found = mujoco.mj_name2id(self._model, kind, names.touch_grid(pad))
        if found < 0:
            raise InvalidValueError(f"pad {pad!r} has no touch_grid sensor: build it with Pad(sensors='touch_grid')")
        return found

    def _sensor(self, pad: str) -> slice:
        sensor = self._id(mujoco.mjtObj.mjOBJ_SENSOR, pad)
        start = int(self._model.sensor_adr[sensor])
        return slice(start, start + int(self._model.sensor_dim[sensor]))

    def read(self, data: mujoco.MjData, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return the forces on the taxels at the last step, as `TactileReadout.read` does.

        Args:
            data: State of the model, after ``mj_step`` or ``mj_forward``.
            out: Array to write into; default: a new one.

        Returns:
            ``(pads, 3, rows, cols)`` float32, newtons, pad frame.

        Raises:
            UnsupportedError: Sensors are disabled, or for one of the contacts the plugin has the wrong sign (MuJoCo
                before 4.0), counts a contact of another geom, or counts it for the wrong taxel.
            InvalidValueError: `out` has another shape or dtype.
        """
        self._check_contacts(data)
        if out is None:
            out = np.empty(self._pads.shape, dtype=np.float32)
        elif out.shape != self._pads.shape or out.dtype != np.float32:
            raise InvalidValueError(
                f"out must be float32 of shape {self._pads.shape}, got {out.dtype} of shape {out.shape}"
            )
        for pad, where in enumerate(self._slices):
            out[pad] = data.sensordata[where].reshape(self._pads.layout.shape)[_CHANNELS]
        return out

    def _check_contacts(self, data: mujoco.MjData) -> None:
        if self._model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_SENSOR):
            raise UnsupportedError("this model's sensors are disabled: enable them or use TactileReadout")
        if self._model.opt.enableflags & SLEEP:
            raise UnsupportedError("the model lets bodies sleep, and their contacts vanish: disable the flag sleep")
        active = self._pushing(data)
        geoms, points = data.contact.geom[active], data.contact.pos[active]
        if np.any(geoms < 0):
            raise UnsupportedError("touch_grid does not support flexes, and one is in contact: use TactileReadout")
        taxels, welds = self._taxel_of_geom[geoms], self._weld_of_geom[geoms]
        if not _SIGN_IS_SOUND and np.any(taxels[:, 1] >= 0):
            first, second = (self._model.geom(int(g)).name for g in geoms[taxels[:, 1] >= 0][0])
            raise UnsupportedError(
                f"touch_grid has the wrong sign before MuJoCo 4.0 (this is {mujoco.__version__}) if the taxel is the "
                f"second geom of a contact, as in {first or 'a geom'!r} on {second!r}: use TactileReadout"
            )
        for pad, body in enumerate(self._pads.bodies):
            # the plugin counts all contacts of the body that the pad is welded to
            contact, side = np.nonzero(welds == self._model.body_weldid[body])
            place = taxels[contact, side] - pad * self._pads.layout.taxels
            if np.any((place < 0) | (place >= self._pads.layout.taxels)):
                raise UnsupportedError(
                    "touch_grid also counts contacts of other geoms on the pad's finger, another pad's included, and "
                    "there is one: disable their collisions or use TactileReadout"
                )
            wrong = np.flatnonzero(self._bins(data, pad, points[contact]) != place)
            if wrong.size:
                row, col = divmod(int(place[wrong[0]]), self._pads.layout.cols)
                raise UnsupportedError(
                    f"touch_grid sorts a contact of taxel ({row}, {col}) of pad {self._pads.names[pad]!r} into another "
                    "taxel's bin, because it lies too deep, too far out or at a distance: use TactileReadout"
                )

    def _pushing(self, data: mujoco.MjData) -> NDArray[np.bool_]:
        """Return whether each contact carries force, ``(contacts,)``; other contacts do not affect the plugin."""
        address = data.contact.efc_address
        rows = np.arange(1 if int(self._model.opt.cone) == int(mujoco.mjtCone.mjCONE_ELLIPTIC) else 4)
        if data.nefc == 0:
            return np.zeros(len(address), dtype=bool)
        return (address >= 0) & np.any(data.efc_force.take(address[:, None] + rows, mode="clip") != 0, axis=1)

    def _bins(self, data: mujoco.MjData, pad: int, points: NDArray[np.floating]) -> NDArray[np.int64]:
        """Return the taxel whose bin the plugin uses for contacts at these points (world frame), -1 for none."""
        layout, site = self._pads.layouts[pad], self._sites[pad]
        x, y, z = ((points - data.site_xpos[site]) @ data.site_xmat[site].reshape(3, 3)).T
        angles = np.stack([np.arctan2(y, np.hypot(x, z)), np.arctan2(x, -z)])
        count = np.array([[layout.rows], [layout.cols]])
        row, col = index = np.floor((angles / _half_angles(layout)[:, None] + 1) / 2 * count).astype(int)
        return np.where(np.all((index >= 0) & (index < count), axis=0), row * layout.cols + col, -1)


def _half_angles(layout: TaxelLayout) -> NDArray[np.floating]:
    """Return half of the sensor's field of view (rad), along the rows and along the columns."""
    return np.arctan2(np.array(layout.size) / 2, STANDOFF)
