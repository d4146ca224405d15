"""TactileReadout: MuJoCo's contact forces as the force tensor, by geom id."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.pads import Pads

_ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
_SIGN_OF_SIDE = np.array([[-1.0], [1.0]])
_ROWS = np.arange(10)[:, None]  # a contact has at most ten constraints: five pairs of edges


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
        # where each geom's forces along the world's x, y, z are summed: a bin a taxel, and one more for all other
        # geoms and for -1, which stands in the place of a geom where a flex touches
        bins = np.full((3, model.ngeom + 1), self._taxels)
        bins[:, pads.geoms.reshape(-1)] = np.arange(self._taxels)
        self._bins = bins + np.arange(3)[:, None] * (self._taxels + 1)
        self._shape = pads.shape
        self._sum = np.zeros(self._shape)
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

    def read_exact(self, data: mujoco.MjData) -> NDArray[np.floating]:
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

    def _deliver(self, force: NDArray[np.floating], out: NDArray[np.float32] | None) -> NDArray[np.float32]:
        if out is None:
            return force.astype(np.float32)
        if out.shape != self._shape or out.dtype != np.float32:
            raise InvalidValueError(f"out must be float32 of shape {self._shape}, got {out.dtype} of shape {out.shape}")
        out[...] = force
        return out

    def _world_forces(self, data: mujoco.MjData) -> NDArray[np.floating]:
        """``(3, taxels)`` forces on the taxels in the world frame."""
        if data.ncon == 0 or data.nefc == 0:
            return np.zeros((3, self._taxels))
        contacts = data.contact
        # the rows of a contact's frame are its normal, from the first geom to the second, and its tangents
        frames = contacts.frame.reshape(-1, 3, 3)
        force = np.einsum("kn,nkj->jn", self._contact_forces(data, contacts), frames)
        # it pushes the second geom along and the first one back; a contact between two taxels counts for both
        force = force[:, None] * _SIGN_OF_SIDE
        bins = self._bins.take(contacts.geom.T, axis=1)
        sums = np.bincount(bins.reshape(-1), force.reshape(-1), 3 * (self._taxels + 1))
        return sums.reshape(3, -1)[:, :-1].view(np.float64)  # as it is: numpy's annotations say int

    def _contact_forces(self, data: mujoco.MjData, contacts) -> NDArray[np.floating]:
        """``(3, contacts)`` forces in the contact frames: normal, tangent, tangent."""
        dim, address = contacts.dim, contacts.efc_address
        if self._model.opt.cone == _ELLIPTIC:
            first, last = int(address[0]), int(address[-1])
            if first >= 0 and last - first == 3 * (len(dim) - 1) and np.count_nonzero(dim != 3) == 0:
                # the usual case, three rows each in the order of the contacts: nothing to gather
                return data.efc_force[first : last + 3].reshape(-1, 3).T
            # of the rows that a contact lacks, those beyond the last constraint are clipped, all become 0
            force = data.efc_force.take(address + _ROWS[:3], mode="clip")
            force[1:, dim < 3] = 0
            force[:, address < 0] = 0  # within its gap a contact has no constraint
            return force
        # pyramidal: two edges a tangent; their sum is the normal force, their difference times mu the tangent's
        own = np.maximum(2 * (dim - 1), 1)
        rows = _ROWS[: max(4, int(own.max()))]
        edges = data.efc_force.take(address + rows, mode="clip")
        if own.min() < len(rows) or address.min() < 0:
            edges[(rows >= own) | (address < 0)] = 0
        tangents = (edges[0:4:2] - edges[1:4:2]) * contacts.friction[:, :2].T
        tangents[:, dim == 1] = 0
        return np.concatenate([edges.sum(axis=0, keepdims=True), tangents])

    def _in_pad_frames(self, world: NDArray[np.floating], data: mujoco.MjData) -> NDArray[np.floating]:
        to_pad = data.xmat.take(self._pads.bodies, axis=0).reshape(-1, 3, 3).transpose(0, 2, 1)
        return (to_pad @ world.reshape(3, len(to_pad), -1).transpose(1, 0, 2)).reshape(self._shape)
