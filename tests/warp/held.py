"""A peg held between two pads, in worlds with their own bumps and loads: on MuJoCo Warp and on MuJoCo's own engine."""

import copy
import importlib.util

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim.layout import TaxelLayout
from paxisim.models.attach import attach
from paxisim.models.mount import Mount
from paxisim.models.pad import Pad
from paxisim.models.pads import find_pads, set_surface
from paxisim.models.readout import TactileReadout

needs_warp = [
    pytest.mark.skipif(
        any(importlib.util.find_spec(name) is None for name in ("mujoco_warp", "torch")),
        reason="needs the extra warp: mujoco-warp, warp-lang and torch",
    ),
    pytest.mark.timeout(900),  # Warp compiles its kernels for a minute or two, once
]

LAYOUT = TaxelLayout(4, 3, 5e-3)
# of each peg: its geom, and how far its surface is from the centre (m)
PEGS = {
    "box": ('<geom type="box" size="0.008 0.012 0.006"', 0.006),
    "sphere": ('<geom type="sphere" size="0.012"', 0.012),
    "cylinder": ('<geom type="cylinder" size="0.006 0.012" euler="90 0 0"', 0.006),
    "mesh": ('<geom type="mesh" mesh="wedge"', 0.006),
    "tilted": ('<geom type="box" size="0.008 0.012 0.006" euler="0.4 0.3 0"', 0.006),
}
WEDGE = """<asset><mesh name="wedge" inertia="convex" vertex="-.009 -.009 -.006  .009 -.009 -.006  .009 .009 -.006
  -.009 .009 -.006  -.009 -.009 .006  .009 -.009 .006  .0075 .0105 .006  -.009 .009 .006"/></asset>"""
AXES = {"object": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
OVERLAP = 0.1e-3  # how far the pads' flat surfaces reach into the peg at first, so that no taxel touches by a hair (m)


def held(peg="box", *, cone="elliptic", layout=LAYOUT, taxels="boxes", fixed=True, gel=True, free=True):
    """A peg of 30 g in gravity between a pad fixed to the world, or to a heavy body, and one on a motor.

    The peg is free, or slides without turning.

    Returns:
        Model, pads, and data at the start.
    """
    geom, reach = PEGS[peg]
    hand = "" if fixed else '<joint name="hand" type="slide" axis="1 0 0" damping="1e4"/>'
    weight = '<geom type="box" size="0.002 0.002 0.002" pos="0 0 0.05" mass="0.2" contype="0" conaffinity="0"/>'
    slides = "".join(f'<joint name="{n}" type="slide" axis="{a}"/>' for n, a in AXES.items())
    world = f"""<mujoco><option timestep="0.002" cone="{cone}" impratio="10"/>{WEDGE}<worldbody>
      <body name="fixed" quat="1 1 0 0">{hand}{weight}</body>
      <body name="moving" quat="1 1 0 0"><joint name="grip" type="slide" axis="0 0 1" damping="20"/>
        {weight}</body>
      <body name="object" pos="0 {reach - OVERLAP / 2} 0" quat="1 1 0 0">
        {'<freejoint name="object"/>' if free else slides}{geom} name="object" mass="0.03"/></body>
      </worldbody><actuator><motor name="grip" joint="grip"/></actuator></mujoco>"""
    mounts = [Mount("fixed"), Mount("moving", pos=(0, 0, OVERLAP - 2 * reach), quat=(0, 1, 0, 0))]
    gripper = attach(world, Pad(layout, taxels=taxels), mounts)
    model = gripper.compile()
    pads = gripper.bind(model) if gel else find_pads(model)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, pads, data


def bumps(worlds, pads, seed=0, height=0.2e-3):
    """Heights of the taxels (m), ``(worlds, pads, rows, cols)``: one bump of `height` a pad, each elsewhere."""
    rng = np.random.default_rng(seed)
    rows, cols = pads.layout.rows, pads.layout.cols
    at = rng.uniform((0, 0), (rows - 1, cols - 1), (worlds, len(pads), 1, 1, 2))
    cells = np.stack(np.meshgrid(np.arange(rows), np.arange(cols), indexing="ij"), axis=-1)
    wide = rng.uniform(2, 8, (worlds, len(pads), 1, 1))
    return pads.thickness[0] + height * np.exp(-((cells - at) ** 2).sum(axis=-1) / wide)


def loads(worlds, seed=1):
    """Forces of the motor (N), up to 10 N."""
    return np.random.default_rng(seed).uniform(1, 10, worlds)


class Engine:
    """The same worlds on MuJoCo's own engine, one after the other."""

    def __init__(self, model, pads, data, heights, forces, moved=0.0):
        """Put the object `moved` metres aside, in a direction of each world's own."""
        rng = np.random.default_rng(2)
        start = model.joint("object").qposadr[0]
        self.worlds = []
        for height, force in zip(heights, forces, strict=True):
            own, state = copy.copy(model), copy.copy(data)
            set_surface(own, pads, height)
            state.ctrl[0] = force
            state.qpos[start : start + 3] += moved * rng.choice([-1, 1], 3)
            self.worlds.append((own, state, TactileReadout(own, pads)))

    def step(self):
        """Step all worlds and return ``(worlds, pads, 3, rows, cols)``."""
        for model, data, _ in self.worlds:
            mujoco.mj_step(model, data)
        return self.read()

    def read(self):
        return np.stack([readout.read(data) for _, data, readout in self.worlds])


class Warped:
    """The same worlds on MuJoCo Warp's CPU device."""

    def __init__(self, model, pads, data, heights, forces, **sizes):
        """Give the worlds their surfaces, if any, and the forces of their motors (N)."""
        worlds = len(forces)
        self.model, self.pads = model, pads
        self.m, self.d = paxisim.warp.put_worlds(model, pads, worlds, data=data, device="cpu", **sizes)
        if heights is not None:
            paxisim.warp.set_surface(self.m, self.d, model, pads, heights)
        self.d.ctrl.assign(np.asarray(forces, np.float32)[:, None])
        self.readout = paxisim.warp.WarpTactileReadout(model, pads, worlds, device="cpu")

    def apply(self, gel, mask=None):
        paxisim.warp.apply_gel(self.m, self.model, self.pads, gel, mask)

    def surface(self, heights, mask=None):
        paxisim.warp.set_surface(self.m, self.d, self.model, self.pads, heights, mask)

    def step(self):
        import mujoco_warp

        mujoco_warp.step(self.m, self.d)
        return self.read()

    def read(self):
        return self.readout.read(self.m, self.d).numpy()


def warped(scene, worlds=2, *, flat=False, **sizes) -> Warped:
    """The scene in worlds on MuJoCo Warp, each with its own bumps, unless the pads stay flat, and its own load."""
    model, pads, data = scene
    return Warped(model, pads, data, None if flat else bumps(worlds, pads), loads(worlds), **sizes)


def differences(scene, worlds, steps, moved=1e-7):
    """Step the worlds on both engines, and on MuJoCo's own once more with the object `moved` (m).

    Returns:
        Largest difference of a taxel (N), ``(steps, worlds)``, of Warp and of the moved one, each from MuJoCo's own.
    """
    model, pads, data = scene
    heights, forces = bumps(worlds, pads), loads(worlds)
    on_warp = Warped(model, pads, data, heights, forces)
    engine, other = (Engine(model, pads, data, heights, forces, by) for by in (0.0, moved))
    found = np.empty((2, steps, worlds))
    for step in range(steps):
        expected = engine.step()
        for kind, reading in enumerate((on_warp.step(), other.step())):
            found[kind, step] = np.abs(reading - expected).max(axis=(1, 2, 3, 4))
    assert np.abs(expected).max() > 0.1
    return found
