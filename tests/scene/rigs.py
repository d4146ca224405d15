"""Motions of the ready-made scenes, and recordings of them."""

import mujoco
import numpy as np

import paxisim
from paxisim import Recording, TaxelLayout

LAYOUT = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
ENCODER = 5e-5  # m


def path(time, knots, values):
    """Return minimum-jerk moves between `values`, at rest at each knot."""
    knots, values = np.asarray(knots, float), np.asarray(values, float)
    i = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    u = np.clip((time - knots[i]) / (knots[i + 1] - knots[i]), 0, 1)
    return values[i] + u**3 * (10 - 15 * u + 6 * u**2) * (values[i + 1] - values[i])


def steps_of(values, step=ENCODER):
    """Return `values` as an encoder with a resolution of `step` reads them."""
    return np.round(values / step) * step


def recording(time, covariates, pads=1, measured=None, **more):
    """Return a recording of the streams `covariates`, with zero forces unless `measured` is given."""
    if measured is None:
        measured = np.zeros((len(time), pads, *LAYOUT.shape), np.float32)
    return Recording(time, measured, covariates=covariates, layout=LAYOUT, **more)


def press(rate=100.0, seconds=8.0, depth=1.7e-3):
    """Return times and streams of the indenter: a held press, a tap and a staircase at two places; lengths in m."""
    time = np.arange(round(seconds * rate)) / rate
    knots = np.array([0, 0.3, 1, 2, 2.6, 3.2, 3.4, 3.6, 4.4, 5, 5.6, 6.2, 6.8, 7.4, 8])
    shares = np.array([0, 0, 1, 1, 0, 0, 0.5, 0, 0, 0.4, 0.4, 0.8, 0.8, 0, 0])
    place = path(time, [0, 3.7, 4.3, 8], [0, 0, 1, 1])
    return time, {
        "x": 3e-3 * place,
        "y": -4e-3 * place,
        "depth": -0.5e-3 + (depth + 0.5e-3) * path(time, knots, shares),
    }


def total(tensor):
    """Return the sum of all normal forces, ``(T,)``."""
    return tensor[:, :, 2].astype(float).sum(axis=(1, 2, 3))


def simulated_press(mjcf, time, streams, rate=100.0, gel=None):
    """Simulate the indenter moved by its own servos, in MuJoCo alone.

    Returns:
        Forces ``(T, 1, 3, rows, cols)`` (N) and the true joint positions x, y and depth ``(T, 3)`` (m).
    """
    model = mujoco.MjModel.from_xml_string(mjcf)
    pads = paxisim.find_pads(model)
    (gel or paxisim.Gel()).apply(model, pads)
    readout, data = paxisim.TactileReadout(model, pads), mujoco.MjData(model)
    every = round(1 / rate / model.opt.timestep)
    fine = np.arange(len(time) * every) * model.opt.timestep
    commands = np.column_stack([np.interp(fine, time, values) for values in streams.values()])
    data.qpos[:] = data.ctrl[:] = commands[0]
    mujoco.mj_step(model, data, 500)
    forces, joints = [], []
    for step, command in enumerate(commands):
        data.ctrl[:] = command
        before = data.qpos.copy()
        mujoco.mj_step(model, data)
        if step % every == 0:
            forces.append(readout.read(data))
            joints.append(before)
    return np.array(forces), np.array(joints)


def with_servos(scene):
    """Return the indenter's MJCF with a heavier ball and a position servo on each joint."""
    servos = "".join(f'<position name="{joint}" joint="{joint}" kp="20000" kv="400"/>' for joint in ("x", "y", "depth"))
    mjcf = str(scene.mjcf).replace("</mujoco>", f"<actuator>{servos}</actuator></mujoco>")
    return mjcf.replace('mass="0.1"', 'mass="2"')


def squeezed(mjcf, seconds=6.0, rate=100.0):
    """Simulate the gripper closing on the peg with its motor, in MuJoCo alone.

    Returns:
        Times ``(T,)``, forces ``(T, 2, 3, rows, cols)`` (N), positions ``(T, nq)`` and motor forces ``(T,)``.
    """
    model = mujoco.MjModel.from_xml_string(mjcf)
    pads = paxisim.find_pads(model)
    paxisim.Gel().apply(model, pads)
    readout, data = paxisim.TactileReadout(model, pads), mujoco.MjData(model)
    for side in ("left", "right"):
        data.joint(f"gripper_{side}_slide").qpos = 0.034
    mujoco.mj_step(model, data, 100)
    every = round(1 / rate / model.opt.timestep)
    rows = []
    for step in range(round(seconds / model.opt.timestep)):
        now = step * model.opt.timestep
        data.ctrl[0] = np.interp(now, [0, 0.2, 1.2, 1.6, 2.4, 2.7, 4, 4.4, 5], [0.2, 0.4, 0.8, 6, 6, 10, 10, 0.5, -1])
        before = data.qpos.copy()
        mujoco.mj_step(model, data)
        if step % every == 0:
            rows.append((now, readout.read(data), before, data.ctrl[0]))
    return tuple(np.array(column) for column in zip(*rows, strict=True))
