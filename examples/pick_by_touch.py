"""An arm picks an object of unknown weight by touch: the pads, not a script, decide how hard the gripper squeezes.

The arm is a UFACTORY xArm7 with its gripper, from MuJoCo Menagerie. It closes until both pads feel the box, grips it
with 1.5 N, and lifts. The weight comes onto the pads as shear, and whenever that exceeds half of a pad's normal force,
the grip tightens; the gel lets go at a ratio of 1. The controller sees only what a sensor drawn with `paxisim.GCS`
reads, whose axes are off by up to 10 % and whose taxels differ by 25 %. Then the arm lifts the heaviest box with a
fixed grip: the command of the gripper stays at the value that gave 1.5 N, and the box slips. A film, at twice the
speed, needs the extra viz and, without a display, MUJOCO_GL=egl or osmesa:

    git clone --depth 1 https://github.com/google-deepmind/mujoco_menagerie
    python examples/pick_by_touch.py mujoco_menagerie/ufactory_xarm7/xarm7.xml -o pick.webp
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
import tyro

import paxisim

NEED = "name ufactory_xarm7/xarm7.xml of MuJoCo Menagerie, https://github.com/google-deepmind/mujoco_menagerie"
LAYOUT = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)  # 6x5 taxels
X, TABLE = 0.45, 0.12  # m, of the box and the table's top
BOX = f"box:50x40x80mm:{{mass}}kg@{X},0,{TABLE + 0.04}"
ARM, FINGERS, TOOL = slice(7), 7, "link_tcp"  # joints and actuators of the arm, the gripper's actuator, a site
DOWN = np.diag([-1.0, 1.0, -1.0])  # orientation of the tool
RATE, STEPS = 100, 5  # Hz, of the sensor and the controller; steps of physics between two readings
ABOVE, GRASP, RISE, SPEED = 0.22, 0.155, 0.10, 0.05  # m: heights of the tool, how far it lifts; m/s
HALF_OPEN, CLOSE = 140.0, 0.2  # the gripper's command, of 255, before the grasp; its change per reading
TOUCH, GRIP = 0.2, 1.5  # N on each pad: felt as a contact, and the first grip
RATIO = 0.5  # of shear to normal force, above which the grip tightens
GAIN, INTEGRAL = 2.0, 0.3  # of the controller of the grip: command per N of error, and per N and reading
SIZE = 240  # pixels, height of the film


class Robot:
    """The arm at a table with a box, and the controller of its grip.

    Attributes:
        force: Latest reading of the sensor (N), ``(2, 3, rows, cols)``.
        normal: Normal force on each pad (N), from it.
        shear: Shear on each pad (N), from it.
        height: Where the tool should be (m).
        target: Normal force (N) that the controller keeps on each pad; 0 if it leaves the command alone.
        error: Target minus the mean of the last reading (N).
        by_touch: Whether shear raises the target.
    """

    def __init__(self, arm: Path, mass: float, unit: int, by_touch: bool) -> None:
        """Build the scene with a box of `mass` (kg) and sensor `unit`; `by_touch` lets the grip tighten."""
        scene = paxisim.compose_scene(arm, table=(X - 0.2, 0, TABLE), objects=[BOX.format(mass=mass)]).spec
        scene.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        scene.option.impratio = 10
        scene.worldbody.add_light(pos=[1, -1, 2], dir=[-0.4, 0.5, -1])
        scene.visual.headlight.ambient = [0.35, 0.35, 0.35]
        pale = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_FLAT, "rgb1": [0.8, 0.86, 0.92], "width": 8, "height": 48}
        scene.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, **pale)
        gripper = paxisim.attach(scene, paxisim.Pad(LAYOUT, taxels="spheres"))
        self.model = gripper.compile()
        self.pads = gripper.bind(self.model)
        self._readout = paxisim.TactileReadout(self.model, self.pads)
        gains = paxisim.GCS(paxisim.augment.Ranges(axis_gain=(0.9, 1.1), dropout=0.0))
        self._sensor = gains.sample(np.random.default_rng(unit), layout=LAYOUT)
        self.force, self.normal, self.shear = np.zeros(self.pads.shape), np.zeros(2), np.zeros(2)
        self.by_touch, self.height, self.target, self.error = by_touch, ABOVE, 0.0, 0.0
        self.data, self._plan = mujoco.MjData(self.model), mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, self._plan, 0)
        for _ in range(200):
            self._reach()
        self.data.qpos[ARM] = self._plan.qpos[ARM]
        self.data.ctrl[FINGERS] = HALF_OPEN

    @property
    def heights(self) -> np.ndarray:
        """True heights of the box and of the pads (m)."""
        return np.array([self.data.body("box").xpos[2], self.data.xpos[self.pads.bodies, 2].mean()])

    def _reach(self) -> None:
        """Move the planned joints towards the height of the tool, by damped least squares."""
        model, plan, tool = self.model, self._plan, self.model.site(TOOL).id
        mujoco.mj_kinematics(model, plan)
        mujoco.mj_comPos(model, plan)
        jacobian, error = np.zeros((6, model.nv)), np.zeros(6)
        mujoco.mj_jacSite(model, plan, jacobian[:3], jacobian[3:], tool)
        error[:3] = (X, 0, self.height) - plan.site_xpos[tool]
        error[3:] = np.cross(plan.site_xmat[tool].reshape(3, 3).T, DOWN.T).sum(axis=0) / 2
        j = jacobian[:, ARM]
        plan.qpos[ARM] += j.T @ np.linalg.solve(j @ j.T + 1e-4 * np.eye(6), error)

    def step(self, rise: float = 0.0, close: float = 0.0) -> None:
        """Raise the tool by `rise` (m) and the gripper's command by `close`, read the sensor and correct the grip."""
        data, self.height = self.data, self.height + rise
        self._reach()
        data.ctrl[ARM] = self._plan.qpos[ARM]
        data.ctrl[FINGERS] += close
        for _ in range(STEPS):
            data.qfrc_applied[ARM] = data.qfrc_bias[ARM]  # the arm carries its own weight, as real ones do
            mujoco.mj_step(self.model, data)
        self.force = self._sensor(self._readout.read(data))
        total = self.force.sum(axis=(-2, -1))
        self.normal, self.shear = total[:, 2], np.hypot(total[:, 0], total[:, 1])
        if self.target:
            if self.by_touch:
                self.target = max(self.target, self.shear.max() / RATIO)
            before, self.error = self.error, self.target - self.normal.mean()
            data.ctrl[FINGERS] += GAIN * (self.error - before) + INTEGRAL * self.error


def pick(robot: Robot) -> Iterator[bool]:
    """Grasp the box, lift it and hold it; after each reading, yield whether it is in the grasp."""

    def steps(seconds: float, grasped: bool, **motion: float) -> Iterator[bool]:
        for _ in range(round(seconds * RATE)):
            robot.step(**motion)
            yield grasped

    yield from steps((ABOVE - GRASP) / SPEED, False, rise=-SPEED / RATE)
    while robot.normal.min() < TOUCH:
        yield from steps(1 / RATE, False, close=CLOSE)
    robot.target, robot.error = GRIP, GRIP - robot.normal.mean()
    yield from steps(1.0, True)
    if not robot.by_touch:
        robot.target = 0.0  # the gripper's command stays as it is
    yield from steps(RISE / SPEED, True, rise=SPEED / RATE)
    yield from steps(1.0, True)


def picture(robot: Robot, renderer: mujoco.Renderer, title: str) -> Any:
    """Return a picture of the scene with the reading of the pads beside it."""
    from PIL import Image

    view = mujoco.MjvCamera()
    view.lookat, view.distance, view.azimuth, view.elevation = (X - 0.03, 0, 0.25), 0.6, 155, -14
    renderer.update_scene(robot.data, view)
    figure = paxisim.plot_pads(robot.force, LAYOUT, ("left", "right"), vmax=0.5, shear_max=0.15)
    figure.suptitle(f"{title}: {robot.normal.mean():.1f} N a pad, shear {robot.shear.mean():.1f} N")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=SIZE / figure.get_size_inches()[1])
    return Image.fromarray(np.hstack([renderer.render(), np.asarray(Image.open(drawn).convert("RGB"))]))


def main(
    arm: tyro.conf.Positional[Path | None] = None,
    film: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    masses: tuple[float, ...] = (0.1, 1.0),
    unit: int = 0,
) -> None:
    """Lift a box of each mass by touch, and the heaviest with a fixed grip.

    Args:
        arm: Model of the arm, ufactory_xarm7/xarm7.xml of MuJoCo Menagerie.
        film: Output file for a film, .webp or .gif.
        masses: Masses of the box (kg).
        unit: Random seed of the sensor.
    """
    if arm is None or arm.name != "xarm7.xml":
        raise paxisim.InvalidValueError(NEED)
    if film and film.suffix not in (".webp", ".gif"):
        raise paxisim.InvalidValueError(f"a film must end in .webp or .gif, got {film}")
    pictures = []
    for mass, by_touch in [*((mass, True) for mass in masses), (max(masses), False)]:
        robot = Robot(arm, mass, unit, by_touch)
        title, heights = f"{mass:g} kg, {'by touch' if by_touch else 'fixed grip'}", []
        with mujoco.Renderer(robot.model, SIZE, SIZE) if film else nullcontext() as renderer:
            for reading, grasped in enumerate(pick(robot)):
                if grasped:
                    heights.append(robot.heights)
                if renderer and reading % 12 == 0:
                    pictures.append(picture(robot, renderer, title))
        rose = 1e3 * (np.array(heights) - heights[0])  # mm, of the box and the pads
        if rose[-1, 0] < 0.9e3 * RISE:
            print(f"{title}: dropped, the box rose {rose[:, 0].max():.1f} mm")
            continue
        # y of both pads points from the palm to the fingertips, which is down here
        weight = f"weight read {robot.force[:, 1].sum():.2f} N, true {9.81 * mass:.2f} N"
        print(f"{title}: lifted, {weight}, slid {rose[-1, 1] - rose[-1, 0]:.1f} mm")
        print("  on the pads {:.1f} and {:.1f} N, shear {:.1f} and {:.1f} N".format(*robot.normal, *robot.shear))
    if film:
        pictures[0].save(film, save_all=True, append_images=pictures[1:], duration=60, loop=0, quality=50)


if __name__ == "__main__":
    try:
        tyro.cli(main)
    except (paxisim.PaxisimError, mujoco.FatalError, OSError) as error:
        print(f"pick_by_touch: error: {error}", file=sys.stderr)
        sys.exit(2)
