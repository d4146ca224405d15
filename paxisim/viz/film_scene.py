"""FilmedScene: pictures of a replayed scene from a camera that follows the pads, rendered without a window."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import UnsupportedError
from paxisim.models.pads import Pads
from paxisim.viz.posed import PosedRobot
from paxisim.viz.raster import triangles_of
from paxisim.viz.view import color_taxels

_HALF_VIEW = np.radians(22.5)  # half of the angle that the camera sees
_WALL = 20.0  # distance of the background behind the pads, as a multiple of the camera's
_PAPER = (1.0, 1.0, 1.0, 1.0)
_LIFT = 2e-4  # m by which taxels are drawn in front of what they replace, whose face is in the same plane
_POSES = 40  # poses from which the size of the hand is taken


class FilmedScene:
    """Pictures of a scene at the samples of a replay, with its taxels coloured by the simulated force."""

    def __init__(
        self,
        model: mujoco.MjModel,
        pads: Pads,
        qpos: NDArray[np.floating],
        force: NDArray[np.floating],
        vmax: float,
        size: tuple[int, int],
    ) -> None:
        """Place the camera so that it sees the pads at the sample with the largest force.

        Args:
            model: The compiled model; the colours of its taxels and its offscreen size are changed in place.
            pads: Its pads.
            qpos: ``(T, nq)`` positions; where they are NaN, the model stays where it was.
            force: ``(T, pads, 3, rows, cols)`` simulated forces (N), where `rows` and `cols` divide those of the pads.
            vmax: Normal force (N) of full red.
            size: Width and height of the pictures in pixels.

        Raises:
            UnsupportedError: MuJoCo cannot render here.
        """
        self._model, self._pads, self._vmax = model, pads, vmax
        self._data = mujoco.MjData(model)
        self._qpos = _filled(qpos)
        self._force = force
        self._repeats = pads.layout.rows // force.shape[-2], pads.layout.cols // force.shape[-1]
        total = np.nan_to_num(force[:, :, 2]).sum(axis=(1, 2, 3))
        self._pose(int(total.argmax()))
        robot = PosedRobot(model, self._data, pads, triangles_of(model, self._data, without=pads.bodies, replaced=()))
        self._view = robot.best_view(list(range(len(pads))))
        self._distance = 1.2 * self._reach(robot) / float(np.tan(_HALF_VIEW))
        glob = model.vis.global_
        glob.offwidth, glob.offheight = max(glob.offwidth, size[0]), max(glob.offheight, size[1])
        model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.45, 0.45
        self._renderer = renderer(model, size)

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()

    def picture(self, sample: int) -> NDArray[np.uint8]:
        """Return the picture ``(height, width, 3)`` of a sample."""
        self._pose(sample)
        force = self._force[sample].repeat(self._repeats[0], -2).repeat(self._repeats[1], -1)
        color_taxels(self._model, self._pads, force, self._vmax)
        camera, options = mujoco.MjvCamera(), mujoco.MjvOption()
        towards = self._view[2]
        camera.lookat = self._middle()
        camera.distance = self._distance
        camera.azimuth = np.degrees(np.arctan2(-towards[1], -towards[0]))
        camera.elevation = -np.degrees(np.arcsin(np.clip(towards[2], -1, 1)))
        options.sitegroup[:] = 0
        self._renderer.update_scene(self._data, camera, options)
        self._draw_wall(camera.lookat - _WALL * self._distance * towards)
        return self._renderer.render()

    def _draw_wall(self, middle: NDArray[np.float64]) -> None:
        """Put a bright wall behind everything, since MuJoCo's background is black without a sky."""
        scene = self._renderer.scene
        if scene.ngeom >= scene.maxgeom:
            return
        wall, half = scene.geoms[scene.ngeom], 3 * _WALL * self._distance
        box = mujoco.mjtGeom.mjGEOM_BOX
        mujoco.mjv_initGeom(
            wall, box, np.array([half, half, 1e-3]), middle, self._view.T.reshape(-1), np.array(_PAPER, np.float32)
        )
        wall.emission, wall.category = 1.0, int(mujoco.mjtCatBit.mjCAT_DECOR)
        scene.ngeom += 1

    def _pose(self, sample: int) -> None:
        model, data = self._model, self._data
        data.qpos[:] = self._qpos[sample]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        mujoco.mj_tendon(model, data)
        geoms = self._pads.geoms
        data.geom_xpos[geoms] -= _LIFT * data.geom_xmat[geoms].reshape(*geoms.shape, 3, 3)[..., 2]

    def _middle(self) -> NDArray[np.float64]:
        return self._data.geom_xpos[self._pads.geoms].mean(axis=(0, 1))

    def _reach(self, robot: PosedRobot) -> float:
        """Return the largest radius of what is seen around the pads, in some of the poses."""
        found = []
        for sample in np.linspace(0, len(self._qpos) - 1, _POSES).astype(int):
            self._pose(sample)
            robot.middle = self._data.geom_xpos[self._pads.geoms].mean(axis=1)
            found.append(robot.reach(list(range(len(self._pads)))))
        return max(found)


def renderer(model: mujoco.MjModel, size: tuple[int, int]) -> mujoco.Renderer:
    """Return a renderer of pictures of this width and height.

    Raises:
        UnsupportedError: MuJoCo cannot render here, for example without a display.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW reports its errors as warnings as well
            return mujoco.Renderer(model, size[1], size[0])
    except Exception as error:  # each OpenGL backend raises its own
        raise UnsupportedError(
            f"cannot draw the scene ({error}): without a display, set MUJOCO_GL=egl or MUJOCO_GL=osmesa"
        ) from error


def check_renderer() -> None:
    """Check before any work that MuJoCo can render here.

    Raises:
        UnsupportedError: It cannot.
    """
    renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), (16, 16)).close()


def _filled(qpos: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return positions whose unknown samples repeat the last known one, at the beginning the first."""
    known = np.isfinite(qpos).all(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(qpos)), -1))
    return qpos[np.where(last < 0, int(known.argmax()), last)]
