"""TactileReadout: MuJoCo's contact forces as the force tensor, by geom id."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.pads import Pads


class TactileReadout:
    """Reads the force tensor of a model's pads from the contacts of its last step.

    A contact on a taxel counts in full for that taxel, so the taxels sum to what the pad is pushed with. The
    read costs a few tens of microseconds, needs no sensor in the model, and is wanted once a control step.

    Example:
        ```python
        readout = TactileReadout(model, find_pads(model))
        mujoco.mj_step(model, data)
        force = readout.read(data)  # (pads, 3, rows, cols), newtons, pad frame
        ```
    """

    def __init__(self, model: mujoco.MjModel, pads: Pads) -> None:
        """Prepare the lookup.

        Args:
            model: The compiled model. Its cone may be changed later.
            pads: Its pads.
        """
        self._model = model
        self._pads = pads
        self._taxels = pads.geoms.size
        # taxel number of each geom; all others count into one bin behind the last taxel
        self._taxel_of_geom = np.full(model.ngeom, self._taxels)
        self._taxel_of_geom[pads.geoms.reshape(-1)] = np.arange(self._taxels)
        self._sum = np.zeros(pads.shape)
        self._count = 0

    @property
    def pads(self) -> Pads:
        """The pads that are read."""
        return self._pads

    def read(self, data: mujoco.MjData, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """The forces on the taxels at the last step.

        Args:
            data: State of the model, after ``mj_step`` or ``mj_forward``.
            out: Array to write into instead of a new one.

        Returns:
            ``(pads, 3, rows, cols)`` float32, newtons, pad frame: what touches the pads pushes with this.

        Raises:
            InvalidValueError: `out` has another shape or dtype.
        """
        return self._deliver(self.read_exact(data), out)

    def read_exact(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """As `read`, in float64."""
        return self._in_pad_frames(self._world_forces(data), data)

    def accumulate(self, data: mujoco.MjData) -> None:
        """Add the forces of this substep to the mean; call once after each ``mj_step``."""
        self._sum += self.read_exact(data)
        self._count += 1

    def mean(self, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """The mean force over the substeps accumulated since the last call, and begin anew.

        Args:
            out: Array to write into instead of a new one.

        Returns:
            ``(pads, 3, rows, cols)`` float32, newtons, pad frame.

        Raises:
            InvalidValueError: Nothing was accumulated, or `out` has another shape or dtype.
        """
        if self._count == 0:
            raise InvalidValueError("no substep to take the mean of: call accumulate(data) after each mj_step")
        result = self._deliver(self._sum / self._count, out)
        self.reset()
        return result

    def reset(self) -> None:
        """Forget what was accumulated, as at the start of an episode."""
        self._sum[...] = 0
        self._count = 0

    def _deliver(self, force: NDArray[np.float64], out: NDArray[np.float32] | None) -> NDArray[np.float32]:
        if out is None:
            return force.astype(np.float32)
        if out.shape != self._pads.shape or out.dtype != np.float32:
            raise InvalidValueError(
                f"out must be float32 of shape {self._pads.shape}, got {out.dtype} of shape {out.shape}"
            )
        out[...] = force
        return out

    def _world_forces(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """``(3, taxels)`` forces on the taxels in the world frame."""
        contacts = data.contact
        address = contacts.efc_address
        taxels = self._taxel_of_geom[contacts.geom]
        touched = (taxels < self._taxels) & (address >= 0)[:, None]
        # a contact between two taxels counts for both
        index, side = np.nonzero(touched)
        if index.size == 0:
            return np.zeros((3, self._taxels))
        force = self._contact_forces(data, contacts, index)
        frames = contacts.frame.reshape(-1, 3, 3)[index]
        # the contact frame's first axis points from the first geom to the second, which the force pushes on
        world = np.matmul(force[:, None, :], frames)[:, 0] * (2.0 * side - 1.0)[:, None]
        bins = taxels[index, side]
        return np.stack([np.bincount(bins, world[:, axis], self._taxels) for axis in range(3)])

    def _contact_forces(self, data: mujoco.MjData, contacts, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """``(n, 3)`` forces in the contact frames: normal, tangent, tangent."""
        address, dim = contacts.efc_address[index], contacts.dim[index]
        efc = np.append(data.efc_force, 0.0)
        tangential = dim > 1
        if int(self._model.opt.cone) == int(mujoco.mjtCone.mjCONE_ELLIPTIC):
            rows = address[:, None] + np.arange(3)
            rows[:, 1:][~tangential] = -1
            return efc[rows]
        # pyramidal: each tangent has two edges, the normal force is the sum over all edges
        edges = address[:, None] + np.arange(10)
        count = np.where(tangential, 2 * (dim - 1), 1)
        edges[np.arange(10) >= count[:, None]] = -1
        force = efc[edges]
        friction = contacts.friction[index, :2] * tangential[:, None]
        tangents = (force[:, 0:4:2] - force[:, 1:4:2]) * friction
        return np.column_stack([force.sum(axis=1), tangents])

    def _in_pad_frames(self, world: NDArray[np.float64], data: mujoco.MjData) -> NDArray[np.float64]:
        pads, _, rows, cols = self._pads.shape
        per_pad = world.reshape(3, pads, -1).transpose(1, 0, 2)
        rotation = data.xmat[self._pads.bodies].reshape(-1, 3, 3).transpose(0, 2, 1)
        return (rotation @ per_pad).reshape(pads, 3, rows, cols)
