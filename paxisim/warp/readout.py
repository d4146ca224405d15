"""WarpTactileReadout: the force tensor of all worlds from MuJoCo Warp's contacts, without leaving the device."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.models.pads import Pads, check_pads
from paxisim.warp import gel, kernels, overflow
from paxisim.warp.engine import device_of, warp
from paxisim.warp.fields import taxel_lookup

_CHECKED_READS = 10


class WarpTactileReadout:
    """Reads the force tensor of the pads in all worlds from the contacts of the last step.

    The counterpart of `paxisim.TactileReadout`, with both friction cones. A read starts three kernels, one of which
    adds each contact to its taxels, and waits for nothing. The first reads are an exception: they call `check`.

    A world whose forces would be wrong reads NaN: after it ran out of room for contacts, until it is reset, and while
    `mujoco_warp.set_const` has undone its gel. `check` says what is wrong.

    Example:
        ```python
        m, d = paxisim.warp.put_worlds(model, pads, 4096)
        readout = paxisim.warp.WarpTactileReadout(model, pads, 4096)
        mujoco_warp.step(m, d)
        force = readout.read(m, d)  # (4096, pads, 3, rows, cols), newtons, pad frame
        ```
    """

    def __init__(self, model: mujoco.MjModel, pads: Pads, worlds: int, *, device: str | None = None) -> None:
        """Prepare the lookup and the tensor.

        Args:
            model: The compiled model.
            pads: Pads of the model.
            worlds: Number of worlds.
            device: Warp's name of the device, as for `put_worlds`; default: Warp's current device.

        Raises:
            InvalidValueError: The pads belong to another model, or there is less than one world.
            UnsupportedError: This machine has no such device.
        """
        check_pads(model, pads)
        if worlds < 1:
            raise InvalidValueError(f"there must be at least one world, got {worlds}")
        self._pads = pads
        self._worlds = worlds
        self._device = device_of(device)
        self._taxel_of_geom = taxel_lookup(model, pads.geoms, self._device)
        self._bodies = warp.array(pads.bodies.astype(np.int32), dtype=int, device=self._device)
        self._out = warp.zeros((worlds, int(np.prod(pads.shape))), dtype=float, device=self._device)
        self._none_applied = warp.full((worlds, model.nbody), np.nan, dtype=float, device=self._device)
        self._force = warp.to_torch(self._out).view(worlds, *pads.shape)
        self._reads = 0

    @property
    def pads(self) -> Pads:
        """Pads that the readout reads."""
        return self._pads

    def read(self, m: Any, d: Any) -> Any:
        """Return the forces on the taxels at the last step.

        After a masked `mujoco_warp.reset_data` all contacts are gone until the next step or `mujoco_warp.forward`.

        Args:
            m: The Warp model, from `put_worlds` or `mujoco_warp.put_model`.
            d: The Warp data, after ``step`` or ``forward``.

        Returns:
            Forces of the objects on the taxels, a torch tensor ``(worlds, pads, 3, rows, cols)`` float32 on the device,
            newtons, pad frame. The next read overwrites it: ``clone()`` what you keep.

        Raises:
            InvalidValueError: The data has another number of worlds or is on another device.
            UnsupportedError: In the first reads, see `check`.
        """
        if d.nworld != self._worlds:
            raise InvalidValueError(f"the readout was made for {self._worlds} worlds, but the data has {d.nworld}")
        if d.nacon.device != self._device:
            raise InvalidValueError(
                f"the data is on {d.nacon.device}, but the readout on {self._device}: pass its device"
            )
        # a graph that is being captured must not wait; what it replays is checked by NaN alone
        if self._reads < _CHECKED_READS and not self._device.is_capturing:
            self._reads += 1
            self.check(m, d)
        contact = d.contact
        self._out.zero_()
        warp.launch(
            kernels.sum_contacts,
            dim=d.naconmax,
            inputs=[
                int(m.opt.cone) == int(mujoco.mjtCone.mjCONE_PYRAMIDAL),
                d.njmax,
                self._pads.geoms.shape[1],
                self._taxel_of_geom,
                self._bodies,
                d.nacon,
                contact.geom,
                contact.frame,
                contact.friction,
                contact.dim,
                contact.efc_address,
                contact.worldid,
                d.efc.force,
                d.xmat,
            ],
            outputs=[self._out],
            device=self._device,
        )
        warp.launch(
            kernels.mark_wrong,
            dim=self._worlds,
            inputs=[
                overflow.DROPS,
                d.njmax,
                d.naconmax,
                gel.TOLERANCE,
                d.overflow,
                d.nefc,
                d.nacon,
                d.ncollision,
                m.body_invweight0,
                getattr(m, gel.RECORD, self._none_applied),
                self._bodies,
            ],
            outputs=[self._out],
            device=self._device,
        )
        return self._force

    def check(self, m: Any, d: Any) -> None:
        """Check that forces can be trusted, as `check_overflow` and `check_gel` do. This waits for the device.

        Args:
            m: The Warp model, from `put_worlds`.
            d: The Warp data.

        Raises:
            UnsupportedError: A world has run out of room for contacts, or its gel is undone.
        """
        overflow.check_overflow(d)
        gel.check_gel(m)
