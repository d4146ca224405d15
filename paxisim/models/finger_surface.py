"""finger_surface: the surface under a pad on a curved finger, from the gripper's own geoms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models.faces import shape_of
from paxisim.models.load import compile_whole, load_spec
from paxisim.models.mount import Mount, replaced_in_model

if TYPE_CHECKING:
    import trimesh


def finger_surface(gripper: mujoco.MjSpec | str | Path, mount: Mount) -> trimesh.Trimesh:
    """Return the geoms that a mount replaces as one mesh in the pad frame, for `conform`.

    Meshes are used as they are, not as the convex hulls that MuJoCo collides.

    Example:
        ```python
        mount = paxisim.find_mounts("hand.xml").mounts[0]
        layout = paxisim.conform(grid, paxisim.finger_surface("hand.xml", mount))
        tactile = paxisim.attach("hand.xml", layout, [mount])
        ```

    Args:
        gripper: A spec, an MJCF file or MJCF text.
        mount: Mount of the pad; its `replaces` are the finger's geoms.

    Raises:
        InvalidValueError: The gripper cannot be read, or the mount replaces no geom that has a surface.
        UnknownNameError: The gripper has no such body or geom.
    """
    import trimesh

    model = compile_whole(load_spec(gripper), "the gripper")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, mount.body)
    if body < 0:
        raise UnknownNameError("body", mount.body, [model.body(i).name for i in range(model.nbody)])
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array(mount.quat))
    axes = data.xmat[body].reshape(3, 3)
    origin = data.xpos[body] + axes @ np.array(mount.pos)
    pad_rotation = axes @ rotation.reshape(3, 3)
    parts = []
    for geom in replaced_in_model(model, mount):
        shape = _mesh_of(model, geom) or shape_of(model, geom)
        if shape is not None:
            vertices, faces = shape
            world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            parts.append(trimesh.Trimesh((world - origin) @ pad_rotation, faces))
    if not parts:
        raise InvalidValueError(f"the mount on {mount.body!r} replaces no geom that has a surface")
    return trimesh.util.concatenate(parts)  # type: ignore[return-value]


def _mesh_of(model: mujoco.MjModel, geom: int) -> tuple[NDArray[np.floating], NDArray[np.int64]] | None:
    if int(model.geom_type[geom]) != int(mujoco.mjtGeom.mjGEOM_MESH):
        return None
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.array(model.mesh_vert[first : first + count], dtype=float)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return vertices, np.array(model.mesh_face[first : first + count], dtype=np.int64)
