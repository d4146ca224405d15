"""Force balance of a held object on every gripper; prints the table in the documentation.

For each gripper that robosuite ships: attach pads of 4x3 taxels, close the gripper on an object, load the object
with a force, wait until it rests, and compare the sum over all taxels of all pads with the force that keeps the
object in place. Parallel grippers hold a free box with nothing but their pads, and the wiping tool carries a plate.
Hands and grippers with compliant fingers press on an object with one plate per pad, carried by springs of known force.

    python benchmarks/gripper_table.py
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models.attach import attach
from paxisim.models.find_mounts import find_mounts
from paxisim.models.gel import Gel
from paxisim.models.grip import Grip
from paxisim.models.grippers import known_gripper, known_grippers, robosuite_gripper_path
from paxisim.models.mount import Mount
from paxisim.models.pad import Pad
from paxisim.models.pads import find_pads
from paxisim.models.readout import TactileReadout

ROWS, COLS = 4, 3
LOAD = (0.3, -0.4, -0.5)  # N, world frame, in addition to the weight
MASS = 0.1  # kg
GEL = Gel(modulus=1e6)  # ten times the default, since some pads are small
GRIP = 2.0  # N; the gripper closes until the force on every pad exceeds this
STIFFNESS, DAMPING = 2e4, 80  # N/m and N s/m of each of the three slides that carry an object
# frame of the stroke at which the object is placed between the pads; other grippers start open
START = {"bd": 25, "fourier_left": 15, "fourier_right": 15, "inspire_left": 10, "inspire_right": 10}
HANDS = ("fourier_left", "fourier_right", "inspire_left", "inspire_right")
CARRIED = (
    *HANDS,
    "jaco_three_finger",
    "robotiq_140",
    "robotiq_85",
    "robotiq_s",
)  # compliant fingers: springs carry the object


@dataclass(frozen=True)
class Balance:
    """The forces on an object at rest, in the world frame (N).

    Attributes:
        taxels: ``(3,)`` force of all taxels of all pads on the object.
        needed: ``(3,)`` force that keeps the object in place: minus the sum of weight, load and spring force.
        pressed: ``(pads,)`` normal force on each pad.
        others: Number of contacts of the object with anything but taxels.
        speed: Speed of the object (m/s), its largest component.
    """

    taxels: np.ndarray
    needed: np.ndarray
    pressed: np.ndarray
    others: int
    speed: float

    @property
    def error(self) -> float:
        """Distance between the two forces, relative to the magnitude of the needed force."""
        return float(np.linalg.norm(self.taxels - self.needed) / np.linalg.norm(self.needed))


def hold(name: str, mounts: tuple[Mount, ...] | None = None) -> Balance:
    """Let a gripper hold an object, and return the balance of forces.

    Args:
        name: Name of the gripper, one of `known_grippers()`.
        mounts: Mounts of its pads; default: the known mounts.
    """
    gripper = known_gripper(name)
    layout = TaxelLayout(ROWS, COLS, (gripper.face_mm[0] * 1e-3 / ROWS, gripper.face_mm[1] * 1e-3 / COLS))
    tactile = attach(robosuite_gripper_path(name), Pad(layout, gel=GEL), mounts or gripper.mounts)
    grip = tactile.grips[0] if name != "wiping" else None
    spec, frame = tactile.spec, START.get(name, 0)
    _add_object(spec, name, tactile.compile(), grip, frame)
    _carry(spec)
    if name in HANDS:  # otherwise the heavy links would make the weak servos sag
        for body in spec.bodies:
            body.gravcomp = float(body.name != "object")
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = (0, 0, -9.81)
    model = spec.compile()
    return _Simulation(model, TactileReadout(model, tactile.bind(model)), grip, frame).run(name not in CARRIED)


def _carry(spec: mujoco.MjSpec) -> None:
    """Put the gripper on a nearly immovable slide.

    On the end of an arm, MuJoCo excludes collisions between a body and its parent. If the base were fixed to the world,
    it would collide with the fingers and push them aside.
    """
    root = spec.worldbody.first_body()
    root.add_joint(
        name="carrier", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1), armature=1e4, stiffness=1e8, damping=1e6
    )


def _add_object(spec: mujoco.MjSpec, name: str, model: mujoco.MjModel, grip: Grip | None, frame: int) -> None:
    """Place the object between the open pads."""
    pads = find_pads(model)
    data = mujoco.MjData(model)
    if grip is not None:
        data.qpos[:] = grip.qpos[frame]
    mujoco.mj_kinematics(model, data)
    centres, frames = data.xpos[pads.bodies], data.xmat[pads.bodies].reshape(-1, 3, 3)
    outward, height, width = -frames[:, :, 2], pads.layout.size[0], pads.layout.size[1]
    body = spec.worldbody.add_body(name="object")
    if name in CARRIED:
        body.mass, body.inertia, body.explicitinertial = MASS, (1e-4, 1e-4, 1e-4), True
        body.pos = centres.mean(axis=0)
        for i, axis in enumerate(np.eye(3)):
            body.add_joint(
                name=f"slide{i}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, stiffness=STIFFNESS, damping=DAMPING
            )
        for centre, axes, normal in zip(centres, frames, outward, strict=True):
            plate = centre + 3.5e-3 * normal - centres.mean(axis=0)
            size = (0.4 * width, 0.25 * height, 3e-3)
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=plate, quat=_quat(axes), mass=0)
        return
    body.add_freejoint()
    axes = frames[0]
    local = (centres - centres[0]) @ axes
    thick = 0.85 * float(np.ptp(local[:, 2])) if grip is not None else 0.02
    body.pos = centres[0] + axes @ ((local.min(axis=0) + local.max(axis=0)) / 2)
    if grip is None:
        body.pos = centres[0] + (thick / 2 - 1e-4) * outward[0]
    body.quat = _quat(axes)
    size = (0.4 * width, 0.3 * height, thick / 2)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, mass=MASS)


def _quat(axes: np.ndarray) -> np.ndarray:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(axes).ravel())
    return quat


class _Simulation:
    def __init__(self, model: mujoco.MjModel, readout: TactileReadout, grip: Grip | None, frame: int) -> None:
        self.model, self.readout, self.grip, self.frame = model, readout, grip, frame
        self.data = mujoco.MjData(model)
        self.object = model.body("object").id
        self.dofs = np.flatnonzero(model.dof_bodyid == self.object)
        self.first = int(model.jnt_qposadr[model.body_jntadr[self.object]])

    def run(self, free: bool) -> Balance:
        self._close(free)
        self.data.xfrc_applied[self.object, :3] = LOAD
        self._wait(2.0)
        return self._balance()

    def _close(self, free: bool) -> None:
        """Close until every pad is pressed; a free object is held in place until the first pad presses on it."""
        model, data = self.model, self.data
        if self.grip is None:
            return
        data.qpos[1 : 1 + self.grip.qpos.shape[1]] = self.grip.qpos[self.frame]
        data.ctrl[:] = data.actuator_length if self.frame else self.grip.open_ctrl
        mujoco.mj_forward(model, data)
        # start without force: the servos of some hands push even at their target position
        start = data.ctrl - (data.actuator_force / model.actuator_gainprm[:, 0] if self.frame else 0)
        home = data.qpos[self.first :].copy()
        for alpha in np.linspace(0, 1, 2000):
            data.ctrl[:] = start + alpha * (self.grip.close_ctrl - start)
            mujoco.mj_step(model, data)
            pressed = self._pressed()
            if free and pressed.max() < GRIP / 2:
                data.qpos[self.first :], data.qvel[self.dofs] = home, 0
            else:
                free = False
            if pressed.min() > GRIP:
                return

    def _pressed(self) -> np.ndarray:
        return self.readout.read_exact(self.data)[:, 2].sum(axis=(1, 2))

    def _wait(self, seconds: float) -> None:
        for _ in range(round(seconds / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)

    def _balance(self) -> Balance:
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        pads = self.readout.pads
        force = self.readout.read_exact(data).sum(axis=(2, 3))
        frames = data.xmat[pads.bodies].reshape(-1, 3, 3)
        weight = model.body_mass[self.object] * model.opt.gravity
        springs = data.qfrc_passive[self.dofs[:3]]
        touching = np.any(model.geom_bodyid[data.contact.geom] == self.object, axis=1)
        on_taxels = np.any(np.isin(data.contact.geom, pads.geoms), axis=1)
        return Balance(
            taxels=-np.einsum("pij,pj->i", frames, force),
            needed=-(weight + data.xfrc_applied[self.object, :3] + springs),
            pressed=force[:, 2],
            others=int(np.sum(touching & ~on_taxels)),
            speed=float(np.abs(data.qvel[self.dofs[:3]]).max()),
        )


def agreement(name: str) -> str:
    """Return how many of the known mounts agree with the proposals of `find_mounts`, as text."""
    try:
        found = {mount.name: mount for mount in find_mounts(robosuite_gripper_path(name)).mounts}
    except InvalidValueError:
        return "refused"
    known = known_gripper(name).mounts
    apart = [difference(mount, found[mount.name]) for mount in known if mount.name in found]
    same = sum(distance < 3e-3 and angle < np.radians(10) for distance, angle in apart)
    return f"{same} of {len(known)}"


def difference(a: Mount, b: Mount) -> tuple[float, float]:
    """Return the distance (m) and the angle (rad) between two mounts on one body."""
    cosine = min(1.0, abs(float(np.dot(a.quat, b.quat))))
    return float(np.linalg.norm(np.subtract(a.pos, b.pos))), 2 * float(np.arccos(cosine))


def main() -> None:
    """Print the table."""
    warnings.filterwarnings("ignore", message=".*is not sound MJCF")
    print("| gripper | pads | find_mounts agrees (3 mm, 10 deg) | object | pads pressed with (N) | balance error |")
    print("|---|---|---|---|---|---|")
    for name in known_grippers():
        result = hold(name)
        carried = "carried by springs" if name in CARRIED else "free"
        pressed = ", ".join(f"{force:.1f}" for force in result.pressed)
        pads = len(result.pressed)
        print(f"| {name} | {pads} | {agreement(name)} | {carried} | {pressed} | {result.error:.2%} |", flush=True)


if __name__ == "__main__":
    main()
