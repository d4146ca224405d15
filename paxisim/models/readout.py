"""TactileReadout: MuJoCo's contact forces as the force tensor, by geom id."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.models.contact_checks import warn_of_contacts
from paxisim.models.gel import is_applied
from paxisim.models.pads import Pads, check_pads

_ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
_THREE = np.int32(3).tobytes()
SLEEP = int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0))
"""Flag that lets bodies sleep; 0 in versions of MuJoCo without it."""


class TactileReadout:
    """Reads the force tensor of a model's pads from the contacts of the last step.

    A contact on a taxel counts fully for that taxel, so the sum over the taxels is the total contact force on the pad.
    A read takes a few tens of microseconds and needs no sensor in the model. Call it once per control step.

    Example:
        ```python
        readout = TactileReadout(model, find_pads(model))
        mujoco.mj_step(model, data)
        force = readout.read(data)  # (pads, 3, rows, cols), newtons, pad frame
        ```
    """

    def __init__(self, model: mujoco.MjModel, pads: Pads) -> None:
        """Prepare the lookup.

        If the pads have no gel from `Gel.apply`, which warns too, a warning names what takes the gel of their file or
        the load away.

        Args:
            model: The compiled model. Its cone may be changed later.
            pads: Pads of the model.

        Raises:
            InvalidValueError: The pads belong to another model.
        """
        check_pads(model, pads)
        if not is_applied(model, pads.geoms):
            warn_of_contacts(model, pads)
        self._model = model
        self._pads = pads
        # one bin for x, y and z of each taxel, and three more for all other geoms and for -1, which MuJoCo writes
        # in place of a geom for contacts of a flex
        taxel = np.full(model.ngeom + 1, pads.geoms.size)
        taxel[pads.geoms.reshape(-1)] = np.arange(pads.geoms.size)
        self._bins = 3 * taxel[:, None] + np.arange(3)
        self._all_bins = 3 * (pads.geoms.size + 1)
        self._shape = pads.shape
        self._sum = np.zeros(self._shape)
        self._count = 0

    @property
    def pads(self) -> Pads:
        """Pads that the readout reads."""
        return self._pads

    def read(self, data: mujoco.MjData, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return the forces on the taxels at the last step.

        Args:
            data: State of the model, after ``mj_step`` or ``mj_forward``.
            out: Array to write into; default: a new one.

        Returns:
            Forces of the objects on the taxels, ``(pads, 3, rows, cols)`` float32, newtons, pad frame.

        Raises:
            InvalidValueError: `out` has another shape or dtype.
            UnsupportedError: The model lets bodies sleep, which removes their contacts.
        """
        force = self.read_exact(data)
        return force.astype(np.float32) if out is None else self._write(force, out)

    def read_exact(self, data: mujoco.MjData) -> NDArray[np.floating]:
        """Return the same forces as `read`, in float64."""
        if self._model.opt.enableflags & SLEEP:
            raise UnsupportedError(
                "the model lets bodies sleep, and MuJoCo removes the contacts of a sleeping body, so its load would "
                'read as 0 N: remove <flag sleep="enable"/> from <option>'
            )
        # this runs with cold caches, between milliseconds of physics, so every numpy call counts
        contacts = data.contact
        dim, address = contacts.dim, contacts.efc_address
        count = len(dim)
        if count == 0:
            return np.zeros(self._shape)
        start = int(address[0])
        if (
            start >= 0
            and int(address[-1]) - start == 3 * (count - 1)
            and dim.tobytes() == _THREE * count
            # with a pyramidal cone, contacts with four constraints and contacts with none may span as many rows
            and self._model.opt.cone == _ELLIPTIC
        ):
            # usual case: three constraints per contact, in the order of the contacts, so nothing to gather
            force = data.efc_force[start : start + 3 * count].reshape(count, 1, 3)
        else:
            force = self._contact_forces(data, contacts)[:, None]
        # the rows of a contact frame are its normal, from the first geom to the second, and its two tangents
        world = np.matmul(force, contacts.frame.reshape(count, 3, 3)).reshape(-1)
        # the force acts on the second geom, its reaction on the first; a contact of two taxels counts for both
        geoms = contacts.geom
        sums = np.bincount(self._bins.take(geoms[:, 1], axis=0).reshape(-1), world, self._all_bins)
        sums = sums - np.bincount(self._bins.take(geoms[:, 0], axis=0).reshape(-1), world, self._all_bins)
        to_pad = data.xmat.take(self._pads.bodies, axis=0).reshape(-1, 3, 3)
        per_taxel = sums[:-3].view(np.float64).reshape(len(to_pad), -1, 3)  # a view: bincount's type says int
        return np.matmul(per_taxel, to_pad).transpose(0, 2, 1).reshape(self._shape)

    def accumulate(self, data: mujoco.MjData) -> None:
        """Add the forces of this substep to the mean; call it once after each ``mj_step``."""
        self._sum += self.read_exact(data)
        self._count += 1

    def mean(self, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return the mean force over the substeps accumulated since the last call, and reset.

        Args:
            out: Array to write into; default: a new one.

        Returns:
            ``(pads, 3, rows, cols)`` float32, newtons, pad frame.

        Raises:
            InvalidValueError: Nothing was accumulated, or `out` has another shape or dtype.
        """
        if self._count == 0:
            raise InvalidValueError("there is no substep to average: call accumulate(data) after each mj_step")
        force = self._sum / self._count
        result = force.astype(np.float32) if out is None else self._write(force, out)
        self.reset()
        return result

    def reset(self) -> None:
        """Discard the accumulated forces, e.g. at the start of an episode."""
        self._sum[...] = 0
        self._count = 0

    def _write(self, force: NDArray[np.floating], out: NDArray[np.float32]) -> NDArray[np.float32]:
        if out.shape != self._shape or out.dtype != np.float32:
            raise InvalidValueError(f"out must be float32 of shape {self._shape}, got {out.dtype} of shape {out.shape}")
        out[...] = force
        return out

    def _contact_forces(self, data: mujoco.MjData, contacts) -> NDArray[np.floating]:
        """Return the forces in the contact frames, ``(contacts, 3)``: normal, tangent, tangent."""
        dim, address = contacts.dim, contacts.efc_address
        if data.nefc == 0:
            return np.zeros((len(dim), 3))
        if self._model.opt.cone == _ELLIPTIC:
            # rows that a contact lacks become 0; "clip" only keeps the index in range for the last contact
            force = data.efc_force.take(address[:, None] + np.arange(3), mode="clip")
            force[dim < 3, 1:] = 0
            force[address < 0] = 0  # a contact within its gap has no constraint
            return force
        # pyramidal: two edges per tangent; the normal force is the sum of all edges, a tangential force is the
        # difference of its two edges times mu
        own = np.maximum(2 * (dim - 1), 1)[:, None]
        rows = np.arange(max(4, int(own.max())))
        edges = data.efc_force.take(address[:, None] + rows, mode="clip")
        edges[(rows >= own) | (address < 0)[:, None]] = 0
        tangents = (edges[:, 0:4:2] - edges[:, 1:4:2]) * contacts.friction[:, :2]
        tangents[dim == 1] = 0
        return np.column_stack([edges.sum(axis=1), tangents])
