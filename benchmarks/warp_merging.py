"""What merging the contacts of each taxel changes on MuJoCo Warp: forces, constraint rows, memory and step time.

A peg is held between two pads, each world with bumps and a load (up to 10 N) of its own, 150 steps from the first
contact, with merged contacts and without. The script prints the largest difference of a pad's force vector, as a share
of the load, and of a taxel, as a share of the world's largest taxel force. The box collider switches between four
contacts and one on a tilted face, and two simulations do so in different steps. "Same contacts" leaves out the steps in
which it found different numbers of contacts on some taxel. Needs the extra warp:

    python benchmarks/warp_merging.py
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import mujoco
import mujoco_warp
import numpy as np
import warp

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "warp"))

from held import Warped, bumps, held, loads
from warp_pads import LAYOUTS, size_of, squeezed

import paxisim

SIX_BY_FIVE = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
SCENES = {
    "box that slides, 6x5": {"peg": "box", "free": False, "layout": SIX_BY_FIVE},
    "tilted box that slides, 6x5": {"peg": "tilted", "free": False, "layout": SIX_BY_FIVE},
    "box, 4x3": {"peg": "box"},
    "box, 6x5": {"peg": "box", "layout": SIX_BY_FIVE},
    "mesh, 4x3": {"peg": "mesh"},
}
WORLDS, STEPS = 8, 150
SETTLED = 50  # first step after the impact of the first contact
ROUNDS, STEPS_PER_ROUND = 7, 20


def contacts_of_geoms(warped: Warped, geoms: int) -> np.ndarray:
    """Numbers of contacts that the collider found, before merging, ``(worlds, geoms)``; each counts for both geoms."""
    found = np.zeros((warped.d.nworld, geoms), int)
    count = int(warped.d.nacon.numpy()[0])
    pairs, world = warped.d.contact.geom.numpy()[:count], warped.d.contact.worldid.numpy()[:count]
    np.add.at(found, (world[:, None], pairs), 1)
    return found


def agreement(scene: dict, cone: str) -> str:
    """Return the cells of one scene in the table."""
    model, pads, data = held(cone=cone, **scene)
    heights, forces = bumps(WORLDS, pads), loads(WORLDS)
    plain = Warped(model, pads, data, heights, forces)
    merged = Warped(model, pads, data, heights, forces, merge=True)
    sums, taxels, same = np.empty((STEPS, WORLDS)), np.empty((STEPS, WORLDS)), np.empty((STEPS, WORLDS), bool)
    for step in range(STEPS):
        expected, found = plain.step(), merged.step()
        total = np.linalg.norm((found - expected).sum(axis=(-2, -1)), axis=-1)
        sums[step] = total.max(axis=1) / forces
        peak = np.abs(expected).max(axis=(1, 2, 3, 4))
        taxels[step] = np.abs(found - expected).max(axis=(1, 2, 3, 4)) / peak
        same[step] = (contacts_of_geoms(plain, model.ngeom) == contacts_of_geoms(merged, model.ngeom)).all(axis=1)
    settled = same & (np.arange(STEPS) >= SETTLED)[:, None]
    rows = " to ".join(str(each.d.nefc.numpy().max()) for each in (plain, merged))
    worst = [f"{sums[where].max():.2%}, {taxels[where].max():.2%}" for where in (same, settled)]
    return " | ".join([rows, shares(sums), shares(taxels), f"{same.mean():.1%}", *worst])


def shares(values: np.ndarray) -> str:
    """Median, 99 % and worst."""
    return ", ".join(f"{each:.2%}" for each in (*np.quantile(values, (0.5, 0.99)), values.max()))


def cost() -> None:
    """Print rows, contacts, memory and step time of two 6x5 pads."""
    worlds = 16
    model, pads = squeezed(LAYOUTS["6x5"])
    pairs = {}
    for name, merge in (("not merged", False), ("merged", True)):
        m, d = paxisim.warp.put_worlds(model, pads, worlds, device="cpu", merge=merge)
        d.ctrl.fill_(6.0)
        pairs[name] = m, d
    taken = {name: [] for name in pairs}
    for _ in range(1 + ROUNDS):  # by turns, so that other work on the machine slows down both; the first settles
        for name, (m, d) in pairs.items():
            start = time.perf_counter()
            for _ in range(STEPS_PER_ROUND):
                mujoco_warp.step(m, d)
            taken[name].append((time.perf_counter() - start) / STEPS_PER_ROUND)
    print(f"two pads of 6x5, {worlds} worlds")
    for name, (m, d) in pairs.items():
        readout = paxisim.warp.WarpTactileReadout(model, pads, worlds, device="cpu")
        grip = readout.read(m, d)[:, :, 2].sum(dim=(-2, -1)).mean()
        active = d.contact.type.numpy()[: int(d.nacon.numpy()[0])].astype(bool).sum() / worlds
        print(
            f"{name}: {d.nefc.numpy().max()} rows of {d.njmax}, {active:.0f} contacts with rows, "
            f"{size_of(d) / worlds / 1e3:.0f} kB a world, {np.median(taken[name][1:]) * 1e3:.1f} ms a step, "
            f"pads read {float(grip):.4f} N"
        )
    ratio = np.median(np.divide(taken["not merged"][1:], taken["merged"][1:]))
    print(f"step time without merging over that with it: {ratio:.2f}")


def own_engine() -> None:
    """Print steps per second of MuJoCo's own engine with box and sphere taxels, which make one contact each."""
    speeds: dict[str, list[float]] = {"boxes": [], "spheres": []}
    scenes = {}
    for taxels in speeds:
        model, _ = squeezed(LAYOUTS["6x5"], taxels)
        data = mujoco.MjData(model)
        data.ctrl[:] = 6.0
        mujoco.mj_step(model, data, 200)
        scenes[taxels] = model, data
    for _ in range(ROUNDS):
        for taxels, (model, data) in scenes.items():
            start = time.perf_counter()
            mujoco.mj_step(model, data, 200)
            speeds[taxels].append(200 / (time.perf_counter() - start))
    contacts = {taxels: data.ncon for taxels, (_, data) in scenes.items()}
    ratio = np.median(np.divide(speeds["spheres"], speeds["boxes"]))
    print(f"MuJoCo's own engine: {contacts} contacts, spheres make {ratio:.2f} times the steps per second")


def main() -> None:
    warp.config.log_level = warp.LOG_WARNING
    print(f"mujoco {mujoco.__version__}, mujoco-warp {mujoco_warp.__version__}, warp-lang {warp.__version__}, CPU")
    print(f"{WORLDS} worlds of {STEPS} steps; differences as median, 99 % and worst")
    print(f"| peg, taxels | cone | rows | pad sum | taxel | same contacts | their worst | from step {SETTLED} |")
    for name, scene in SCENES.items():
        for cone in ("elliptic", "pyramidal"):
            print(f"| {name} | {cone} | {agreement(scene, cone)} |", flush=True)
    cost()
    own_engine()


if __name__ == "__main__":
    main()
