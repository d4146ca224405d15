"""What pads cost on MuJoCo Warp: steps and readings per second, a read over a step, and memory, by number of worlds.

On a GPU each step and each read is a CUDA graph. The last line for each size of pad is MuJoCo's own engine with a world
in each of as many threads as there are cores. Needs the extra warp:

    python benchmarks/warp_pads.py                     # the GPU if there is one, 64 to 16,384 worlds
    python benchmarks/warp_pads.py --device cpu --worlds 16 64
"""

import argparse
import dataclasses
import os
import time
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files

import mujoco
import mujoco_warp
import torch
import warp

import paxisim

# claim of Genesis 1.4.5: 1000 geometric probes in 4096 environments, 100 steps in 2.9 s on a GPU
GENESIS = 1000 * 4096 * 100 / 2.9
LAYOUTS = {"6x5": (2, 2), "12x10": (1, 1)}
SETTLE, STEPS = 100, 100


def squeezed(pool: tuple[int, int], taxels: str = "boxes") -> tuple[mujoco.MjModel, paxisim.Pads]:
    """Two pads around a box peg, as in `examples/warp_pads.py`."""
    pad = paxisim.Pad(paxisim.sensor("paxini-gen1-l4629").layout.pool(*pool), taxels=taxels)
    gripper = paxisim.attach(files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(), pad)
    scene = gripper.spec
    scene.option.cone, scene.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10
    peg = scene.worldbody.add_body(name="peg", pos=[0, 0, -0.07])
    peg.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.012, 0.009, 0.03])
    model = gripper.compile()
    return model, gripper.bind(model)


def size_of(thing) -> int:
    """Bytes of the Warp arrays of a dataclass and of the dataclasses in it."""
    if isinstance(thing, warp.array):
        return thing.capacity
    if dataclasses.is_dataclass(thing):
        return sum(size_of(getattr(thing, item.name)) for item in dataclasses.fields(thing))
    return 0


def repeated(run, device):
    """What runs `run` once: a CUDA graph of it, or itself on the CPU."""
    if not device.is_cuda:
        return run
    with warp.ScopedCapture(device=device) as capture:
        run()
    return lambda: warp.capture_launch(capture.graph)


def seconds(run, device, times: int) -> float:
    """Seconds of one run, over several of them."""
    run()
    warp.synchronize_device(device)
    start = time.perf_counter()
    for _ in range(times):
        run()
    warp.synchronize_device(device)
    return (time.perf_counter() - start) / times


def measure(model, pads, worlds: int, device) -> str:
    m, d = paxisim.warp.put_worlds(model, pads, worlds, device=str(device))
    readout = paxisim.warp.WarpTactileReadout(model, pads, worlds, device=str(device))
    warp.to_torch(d.ctrl)[:] = torch.linspace(2, 10, worlds, device=warp.device_to_torch(device))[:, None]
    step = repeated(lambda: mujoco_warp.step(m, d), device)
    for _ in range(SETTLE):
        step()
    for _ in range(10):
        readout.read(m, d)  # those that check
    read = repeated(lambda: readout.read(m, d), device)
    of_step, of_read = seconds(step, device, STEPS), seconds(read, device, STEPS)
    readout.check(m, d)
    contacts = int(d.nacon.numpy()[0]) / worlds
    taxels = worlds * pads.geoms.size
    memory = size_of(d) / worlds
    return (
        f"{worlds:6d} worlds, {contacts:5.0f} contacts each: {worlds / of_step:10.0f} world-steps/s, "
        f"{taxels / (of_step + of_read):10.3g} taxel readings/s, read / step {of_read / of_step:.3f}, "
        f"{memory / 1e3:.0f} kB a world"
    )


def on_cores(model, pads, cores: int) -> str:
    """Step and read one world of MuJoCo's own engine in each thread."""

    def start(force: float) -> tuple[mujoco.MjData, paxisim.TactileReadout]:
        data = mujoco.MjData(model)
        data.ctrl[:] = force
        mujoco.mj_step(model, data, SETTLE)
        return data, paxisim.TactileReadout(model, pads)

    def step(world) -> None:
        data, readout = world
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
            readout.read(data)

    with ThreadPoolExecutor(cores) as pool:
        worlds = list(pool.map(start, torch.linspace(2, 10, cores).tolist()))
        begun = time.perf_counter()
        list(pool.map(step, worlds))
        rate = cores * STEPS / (time.perf_counter() - begun)
    taxels = rate * pads.geoms.size
    return f"MuJoCo on {cores} cores: {rate:.0f} world-steps/s with readings, {taxels:.3g} taxel readings/s"


def main() -> None:
    parser = argparse.ArgumentParser(description="What pads cost on MuJoCo Warp.")
    parser.add_argument("--device", help="Warp's name; default: its current device")
    parser.add_argument("--worlds", type=int, nargs="+", default=[64, 256, 1024, 4096, 16384])
    parser.add_argument("--layouts", nargs="+", choices=LAYOUTS, default=list(LAYOUTS))
    parser.add_argument("--cores", type=int, default=os.cpu_count(), help="threads of MuJoCo's own engine")
    options = parser.parse_args()
    warp.config.log_level = warp.LOG_WARNING
    device = warp.get_device(options.device)
    versions = f"mujoco {mujoco.__version__}, mujoco-warp {mujoco_warp.__version__}, warp-lang {warp.__version__}"
    print(f"{device.name}; {versions}, torch {torch.__version__}")
    for name in options.layouts:
        model, pads = squeezed(LAYOUTS[name])
        print(f"two pads of {name}")
        for worlds in options.worlds:
            print(measure(model, pads, worlds, device), flush=True)
        print(on_cores(model, pads, options.cores), flush=True)
    print(f"Genesis, as it claims: {GENESIS:.3g} probe readings/s, from geometry and without contact forces")


if __name__ == "__main__":
    main()
