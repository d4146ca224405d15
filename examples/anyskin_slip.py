"""A slip detector for AnySkin, trained in simulation, judged on other simulated units, and run on the driver's frames.

A ball is pressed onto a skin and dragged sideways by a spring until it slips. The detector is a logistic regression on
how the field of the chips changed lately; it is trained on one unit and judged on units with another magnetisation and
thickness, and on new loads, speeds and frictions. At last it runs on what the driver reads from a serial port, on which
one of these units is emulated (Linux). Needs the extra hw, and takes about 30 s:

    python examples/anyskin_slip.py
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace

import mujoco
import numpy as np

import paxisim

SCENE = """
<mujoco>
  <option timestep=".004" cone="elliptic" impratio="100"/>
  <worldbody>
    <body name="skin" euler="180 0 0"/>
    <body name="ball" pos="0 0 .0201">
      <joint name="x" type="slide" axis="1 0 0"/> <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="z" type="slide" axis="0 0 1" damping="2"/>
      <geom name="ball" type="sphere" size=".02" mass=".05"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="x" kp="400" kv="2"/> <position joint="y" kp="400" kv="2"/> <motor joint="z"/>
  </actuator>
</mujoco>
"""
STEPS, FRAMES, PRESSED = 5, 50, 15  # steps of 4 ms in a frame, frames of an episode, frames before the drag begins
LAG = 3  # frames between the fields that the detector compares


def episode(model: mujoco.MjModel, pads: paxisim.Pads, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces on the cells ``(T, 1, 3, 10, 10)`` and whether the ball slips ``(T,)``."""
    model.geom_friction[:, 0] = rng.uniform(0.3, 0.9)
    press, speed, angle = rng.uniform(1.0, 4.0), rng.uniform(8e-3, 25e-3), rng.uniform(0, 2 * np.pi)
    data, readout = mujoco.MjData(model), paxisim.TactileReadout(model, pads)
    forces, slips = [], []
    for frame in range(FRAMES):
        dragged = speed * max(0, frame - PRESSED) * STEPS * model.opt.timestep
        data.ctrl[:] = dragged * np.cos(angle), dragged * np.sin(angle), -press
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
        forces.append(readout.read(data))
        slips.append(np.hypot(*data.qvel[:2]) > speed / 2)
        if np.hypot(*data.qpos[:2]) > 5e-3:  # it leaves the skin soon
            break
    return np.array(forces), np.array(slips)


def features(flux: np.ndarray) -> np.ndarray:
    """Return what the detector sees of each frame of the drag, ``(T - PRESSED, 2)``, from fields ``(T, 1, 3, 1, 5)``.

    While the ball sticks, the field of all chips keeps changing along one direction; when it slips, it turns. The two
    features are the cosines of the last change with the one before and with that since the press. They do not depend on
    the size of the field, and thus not on the magnetisation.
    """
    flux = flux.reshape(len(flux), -1)
    last = flux[LAG:] - flux[:-LAG]
    since = flux - flux[PRESSED - 5 : PRESSED].mean(axis=0)
    return np.stack(
        [
            _cosine(last[PRESSED - LAG :], last[PRESSED - 2 * LAG : -LAG]),
            _cosine(last[PRESSED - LAG :], since[PRESSED:]),
        ],
        axis=1,
    )


def _cosine(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.sum(first * second, axis=1) / (np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1) + 1e-9)


def seen(
    skin: paxisim.MagneticSkin, model: mujoco.MjModel, pads: paxisim.Pads, rng: np.random.Generator, episodes: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the features and labels of new episodes on a unit, while the ball is dragged."""
    inputs, labels = [], []
    for _ in range(episodes):
        force, slips = episode(model, pads, rng)
        inputs.append(features(skin.measure(force, rng)))
        labels.append(slips[PRESSED:])
    return np.concatenate(inputs), np.concatenate(labels)


def trained(inputs: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return the weights of a logistic regression, by Newton's method with a small ridge."""
    x, weights = np.column_stack([inputs, np.ones(len(inputs))]), np.zeros(inputs.shape[1] + 1)
    for _ in range(20):
        chance = 1 / (1 + np.exp(-x @ weights))
        slope = x.T @ (chance - labels) + weights
        weights -= np.linalg.solve((x.T * (chance * (1 - chance))) @ x + np.eye(len(weights)), slope)
    return weights


def read_live(fields: np.ndarray) -> np.ndarray:
    """Return the fields of an episode ``(T, 1, 3, 1, 5)`` as the driver reads them, one frame after another."""
    warnings.simplefilter("ignore", paxisim.UnverifiedProfileWarning)  # no one has tried this profile on a device
    interval, began = STEPS * 4e-3, np.inf

    def felt(now: float) -> np.ndarray:
        frame = int(np.clip((time.monotonic() - began) / interval, -1, len(fields) - 1))
        return fields[frame] if frame >= 0 else np.zeros_like(fields[0])

    read = []
    with paxisim.Emulator("anyskin", felt) as emulator, paxisim.open_sensor(emulator.port, profile="anyskin") as skin:
        skin.zero()  # nothing touches the skin yet
        began = time.monotonic()
        for frame in range(len(fields)):
            # in the middle of a frame, when the emulator has sent it
            time.sleep(max(0.0, began + (frame + 0.7) * interval - time.monotonic()))
            read.append(skin.latest().force)
    return np.array(read)


def main() -> None:
    """Train on one unit and judge on others."""
    rng = np.random.default_rng(0)
    gripper = paxisim.attach(SCENE, "anyskin", [paxisim.Mount("skin")])
    model = gripper.compile()
    pads = gripper.bind(model)
    design = paxisim.SkinDesign.named("anyskin")
    layer = design.layer
    units = {
        "the unit it was trained on": design,
        "half the magnetisation": replace(design, remanence=0.5 * design.remanence),
        "thicker by a quarter": replace(design, layer=replace(layer, thickness=1.25 * layer.thickness)),
        "thinner by a quarter": replace(design, layer=replace(layer, thickness=0.75 * layer.thickness)),
    }
    weights = trained(*seen(paxisim.MagneticSkin(design), model, pads, rng, 20))
    for name, unit in units.items():
        inputs, slips = seen(paxisim.MagneticSkin(unit), model, pads, rng, 15)
        tell(name, weights, inputs, slips)

    unit = paxisim.MagneticSkin(units["thinner by a quarter"])
    episodes = [episode(model, pads, rng) for _ in range(5)]
    inputs = np.concatenate([features(read_live(unit.measure(force, rng))) for force, _ in episodes])
    tell("through the driver", weights, inputs, np.concatenate([slips[PRESSED:] for _, slips in episodes]))


def tell(name: str, weights: np.ndarray, inputs: np.ndarray, slips: np.ndarray) -> None:
    """Print how the detector does on frames with known slips."""
    said = np.column_stack([inputs, np.ones(len(inputs))]) @ weights > 0
    found, false = np.mean(said[slips]), np.mean(said[~slips])
    print(f"{name}: finds {found:.0%} of {slips.sum()} frames with slip, false alarm in {false:.0%} of the others")


if __name__ == "__main__":
    main()
