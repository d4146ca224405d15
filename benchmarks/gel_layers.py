"""What springs do in place of elastic layers, in figures: ``python benchmarks/gel_layers.py``.

The candidates are today's default gel and the springs that `paxisim.Gel.of` makes of layers of 0.1 to 1.2 MPa for three
contacts: a flat face over the pad, one taxel, and a ball of 20 mm at 5 N. The pad has 6x5 taxels. The script prints
three tables in Markdown:

- stiffness of a taxel (N/m) by layer and contact;
- flat faces: indentation at 8 and 30 N; on six surfaces of GCS, the share of taxels that carry a count (0.1 N) and the
  standard deviation of the loads over their mean, next to that of the elastic layer itself; creep under 8 N across half
  of the friction's limit;
- a box of 60 g in a gripper with 8 and 30 N at time steps of 2 and 5 ms, shaken along the pads by 5 N at 10 Hz: the
  ripple of a pad's normal force (standard deviation over mean); the impact of a ball of 0.5 kg at 0.1 m/s; and the time
  of a step and the solver's iterations in it, relative to the default gel.

`benchmarks/gel_shapes.py` compares them on round and edged objects.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import time
from dataclasses import dataclass

import mujoco
import numpy as np
import tyro
from numpy.typing import NDArray

import paxisim
from paxisim.layer.contact import pressed
from paxisim.layer.layer import Contact
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
LAYERS = {f"{modulus / 1e6:g} MPa": paxisim.Layer(modulus) for modulus in (0.1e6, 0.3e6, 0.5e6, 1.2e6)}
CONTACTS: dict[str, Contact] = {"flat": "flat", "taxel": "taxel", "ball": 20e-3}
FORCES, TIMESTEPS = (8.0, 30.0), (2e-3, 5e-3)
COUNT, SHAKE = 0.1, 5.0  # N
RADIUS = {"ball, 20 mm": 20e-3, "ball, 8 mm": 8e-3, "cylinder, 10 mm": 10e-3}
HALF = {"plate": (0.03, 0.03), "box, 12 x 10 mm": (6e-3, 5e-3), "edge over half of the pad": (0.02, 0.02)}
Place = tuple[float, float]  # of an object on the pad, x and y (m)


@dataclass(frozen=True)
class Candidate:
    """Springs to judge: their layer and contact, both empty for the default gel."""

    layer: str
    contact: str
    gel: paxisim.Gel

    @property
    def name(self) -> str:
        """Name in the tables."""
        return f"{self.layer}, {self.contact}" if self.layer else "default, 100 kPa springs"


def candidates() -> list[Candidate]:
    """Return the default gel and every layer's springs for every contact."""
    springs = [
        Candidate(name, key, paxisim.Gel.of(layer, LAYOUT, contact))
        for name, layer in LAYERS.items()
        for key, contact in CONTACTS.items()
    ]
    return [Candidate("", "", paxisim.Gel()), *springs]


# objects on a pad that lies face up


def bench(
    shape: str, gel: paxisim.Gel, *, kind: str = "boxes", timestep: float = 2e-3, at: Place = (0.0, 0.0)
) -> tuple[mujoco.MjModel, paxisim.Pads, mujoco.MjData]:
    """Return an object of 0.5 kg that slides down onto the pad and, on a second joint, along its x."""
    height = 10e-3
    if shape in RADIUS:
        height = RADIUS[shape]
        geom = f'type="cylinder" size="{height} 0.04" euler="0 90 0"'
        if "ball" in shape:
            geom = f'type="sphere" size="{height}"'
    else:
        x, y = HALF[shape]
        geom = f'type="box" size="{x} {y} {height}"'
        at = (at[0] + x, at[1]) if "edge" in shape else at
    text = f"""<mujoco><compiler angle="degree"/>
    <option timestep="{timestep}" cone="elliptic" impratio="10" gravity="0 0 0"/><worldbody><body name="plate"/>
    <body pos="{at[0]} {-at[1]} {height}"><joint type="slide" axis="0 0 -1"/><joint type="slide" axis="1 0 0"/>
    <geom {geom} mass="0.5"/></body></worldbody></mujoco>"""
    pad = paxisim.Pad(LAYOUT, gel=gel, taxels=kind, thickness=3.5e-3 if kind == "spheres" else 1e-3)  # type: ignore[arg-type]
    gripper = paxisim.attach(text, pad, [paxisim.Mount("plate", quat=(0, 1, 0, 0), name="pad")])
    model = gripper.compile()
    pads = gripper.bind(model)
    return model, pads, mujoco.MjData(model)


def settled(model: mujoco.MjModel, data: mujoco.MjData, force: tuple[float, float], seconds: float) -> float:
    """Push the object down and along x for some seconds and return the indentation (m)."""
    data.qfrc_applied[:2] = force
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return float(data.qpos[0])


def loads_of(model: mujoco.MjModel, pads: paxisim.Pads, data: mujoco.MjData) -> NDArray[np.float64]:
    """Return the normal forces (N), ``(30,)``."""
    return paxisim.TactileReadout(model, pads).read(data)[0, 2].astype(np.float64).ravel()


# the tables


def print_row(*cells: object) -> None:
    """Print a row of a table in Markdown."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def print_head(title: str, *cells: str) -> None:
    """Print the title and the head of a table."""
    print(f"\n{title}\n")
    print_row(*cells)
    print_row(*["---"] * len(cells))


def spread_of(loads: list[NDArray[np.float64]]) -> str:
    """Return the share of taxels that carry a count, and the standard deviation of the loads over their mean."""
    lit = np.mean([np.mean(each >= COUNT) for each in loads])
    uneven = np.mean([each.std() / each.mean() for each in loads])
    return f"{100 * lit:.0f} %, {uneven:.2f}"


def flat_faces(springs: list[Candidate], surfaces: list[NDArray[np.floating]]) -> None:
    """Print the table of flat faces."""
    print_head(
        "Flat faces",
        *("springs", "mm at 8 N", "mm at 30 N", "on bumps: lit, std/mean at 8 N", "at 30 N"),
        *("the layer itself at 8 N", "at 30 N", "creep (mm/s)"),
    )
    exact = {
        name: [
            spread_of([pressed(layer.compliance(LAYOUT), (-each).ravel(), force)[0] for each in surfaces])
            for force in FORCES
        ]
        for name, layer in LAYERS.items()
    }
    for each in springs:
        model, pads, data = bench("plate", each.gel)
        depths = [1e3 * settled(model, data, (force, 0.0), 0.6) for force in FORCES]
        found = []
        for force in FORCES:
            loads = []
            for surface in surfaces:
                mujoco.mj_resetData(model, data)
                paxisim.set_surface(model, pads, surface)
                data.qpos[0] = 1e-3 - surface.max()
                settled(model, data, (force, 0.0), 0.5)
                loads.append(loads_of(model, pads, data))
            found.append(spread_of(loads))
        model, _, data = bench("plate", each.gel)
        settled(model, data, (8.0, 4.0), 0.5)
        before = data.qpos[1]
        settled(model, data, (8.0, 4.0), 0.5)
        creep = 1e3 * (data.qpos[1] - before) / 0.5
        of_layer = exact[each.layer] if each.contact == "flat" else ["", ""]
        print_row(each.name, *(f"{depth:.3f}" for depth in depths), *found, *of_layer, f"{creep:.2f}")


def held_box(gel: paxisim.Gel, force: float, timestep: float) -> tuple[float, float, float]:
    """Return the ripple of a pad's force on a shaken box, and the solver's iterations and the time (s) of a step."""
    model = mujoco.MjModel.from_xml_string(str(ready.gripper(LAYOUT, peg=True).mjcf))
    model.opt.timestep = timestep
    model.actuator_ctrlrange[0] = (-100.0, 100.0)
    pads, data = paxisim.find_pads(model), mujoco.MjData(model)
    gel.apply(model, pads)
    readout, read, spent, iterations = paxisim.TactileReadout(model, pads), [], [], []
    for side in ("left", "right"):
        data.joint(f"gripper_{side}_slide").qpos = 0.034
    for now in np.arange(0, 2, timestep):
        data.ctrl[0] = np.interp(now, [0, 0.5, 1.0], [0.3, 0.8, force])
        data.body("peg").xfrc_applied[2] = SHAKE * np.sin(2 * np.pi * 10 * now) if now > 1 else 0.0
        begin = time.process_time_ns()
        mujoco.mj_step(model, data)
        if now > 1.5:
            spent.append(time.process_time_ns() - begin)
            iterations.append(data.solver_niter[0])
            read.append(readout.read(data)[0, 2].sum(dtype=np.float64))
    assert abs(np.mean(read) / force - 1) < 0.05, f"the pads carry {np.mean(read):.1f} N"
    return float(np.std(read) / np.mean(read)), float(np.mean(iterations)), 1e-9 * float(np.quantile(spent, 0.1))


def impact(gel: paxisim.Gel, timestep: float) -> str:
    """Return the speed back of a ball of 0.5 kg that hits at 0.1 m/s, over 0.1 m/s, and its depth (mm)."""
    model, _, data = bench("ball, 20 mm", gel, timestep=timestep)
    data.qpos[0], data.qvel[0] = -0.5e-3, 0.1
    depths, speeds = [], []
    for _ in range(round(0.3 / timestep)):
        mujoco.mj_step(model, data)
        depths.append(data.qpos[0])
        speeds.append(data.qvel[0])
    return f"{-min(speeds) / 0.1:.2f}, {1e3 * max(depths):.2f}"


def stability(springs: list[Candidate]) -> None:
    """Print the table of a held box and of an impact."""
    heads = [f"impact, {1e3 * step:g} ms: speed back, depth (mm)" for step in TIMESTEPS]
    print_head("Stability and cost", "springs", "largest ripple", *heads, "time of a step", "iterations of a step")
    usual: tuple[float, float] | None = None
    for each in springs:
        held = {(force, step): held_box(each.gel, force, step) for force in FORCES for step in TIMESTEPS}
        _, iterations, spent = held[8.0, 2e-3]
        usual = usual or (spent, iterations)
        ripple = max(ripple for ripple, _, _ in held.values())
        impacts = [impact(each.gel, step) for step in TIMESTEPS]
        print_row(each.name, f"{ripple:.0e}", *impacts, f"{spent / usual[0]:.2f}", f"{iterations / usual[1]:.2f}")


def main(seed: int = 0) -> None:
    """Print the tables.

    Args:
        seed: Random seed of the bumps.
    """
    rng = np.random.default_rng(seed)
    surfaces = [paxisim.GaussianBump.sample(LAYOUT, rng).heights(LAYOUT) for _ in range(6)]
    springs = candidates()
    print(f"paxisim {paxisim.__version__}, MuJoCo {mujoco.__version__}, seed {seed}")
    print_head("Stiffness of a taxel (N/m)", "layer", *CONTACTS)
    for name in LAYERS:
        print_row(name, *(f"{each.gel.stiffness(LAYOUT):.0f}" for each in springs if each.layer == name))
    flat_faces(springs, surfaces)
    stability(springs)


if __name__ == "__main__":
    tyro.cli(main)
