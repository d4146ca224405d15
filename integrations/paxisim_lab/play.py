"""``python -m paxisim_lab.play --run runs/SX-2mm_GCS_0``: film an episode, with the pads' readings beside the scene."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from paxisim_insertion.env import InsertionEnv
from paxisim_insertion.policy import Trained
from paxisim_insertion.run import Run
from paxisim_insertion.shell import command
from PIL import Image

import paxisim

HEIGHT = 480
"""Height (pixels) of the picture of the scene; the film has half of it."""

SUFFIXES = (".webp", ".gif")

LARGEST_NORMAL, LARGEST_SHEAR = 3.0, 2.0
"""Forces (N per taxel) at the ends of the colour scale and of the arrow scale; a grip of 30 N is 1 N per taxel."""


def play(run: Path, *, seed: int = 0, out: Path = Path("insertion.webp"), force: bool = False) -> None:
    """Film an episode of a trained policy.

    Args:
        run: Folder of a run; its policy plays the task of the run.
        seed: Random seed of the episode.
        out: Output file: an animated WebP or GIF.
        force: Overwrite an existing file.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise paxisim.InvalidValueError(f"expected a file name that ends with one of {', '.join(SUFFIXES)}, got {out}")
    if out.exists() and not force:
        raise paxisim.OutputExistsError(f"{out} exists already: choose another file, or pass --force")
    this = Run.open(run)
    env = this.insertion_env(terminate_on_success=True, render_mode="rgb_array")
    succeeded: list[bool] = []
    try:
        write_film(out, episode(env, this.policy(env), seed, succeeded), env.metadata["render_fps"])
    finally:
        env.close()
    print(f"{env.task.name} seed {seed}: {'inserted' if any(succeeded) else 'not inserted'}; {out}")


def episode(env: InsertionEnv, trained: Trained, seed: int, succeeded: list[bool]) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures of an episode; after each step, append to `succeeded` whether the peg is inserted."""
    observation, _ = env.reset(seed=seed)
    terminated = truncated = False
    while not (terminated or truncated):
        yield frame(env)
        observation, _, terminated, truncated, info = env.step(trained.act(observation))
        succeeded.append(bool(info["is_success"]))
    yield frame(env)


def write_film(path: Path, pictures: Iterator[NDArray[np.uint8]], rate: float) -> None:
    """Write pictures ``(height, width, 3)`` at half their size and `rate` frames per second."""
    small = (Image.fromarray(each).reduce(2) for each in pictures)
    next(small).save(path, save_all=True, append_images=small, duration=round(1000 / rate), loop=0, quality=60)


def frame(env: InsertionEnv) -> NDArray[np.uint8]:
    """Return a picture ``(480, width, 3)`` of the scene with the pads' newest reading to its right."""
    scene = env.render()
    assert scene is not None
    figure = paxisim.plot_pads(env.reading, env.layout, vmax=LARGEST_NORMAL, shear_max=LARGEST_SHEAR)
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=HEIGHT / figure.get_size_inches()[1])
    beside = Image.open(drawn).convert("RGB")
    return np.hstack([scene, np.asarray(beside.resize((beside.width * HEIGHT // beside.height, HEIGHT)))])


if __name__ == "__main__":
    sys.exit(command(play))
