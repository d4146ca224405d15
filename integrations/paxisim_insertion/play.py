"""``python -m paxisim_insertion.play --task SX-2mm``: film an episode, with the pads' readings beside the scene."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import paxisim

from .env import InsertionEnv
from .expert import expert_action
from .run import Run
from .shell import command
from .trained import Trained

HEIGHT = 480
"""Height (pixels) of the film and of the picture of the scene."""

SUFFIXES = (".mp4", ".gif", ".webp")

LARGEST_NORMAL, LARGEST_SHEAR = 3.0, 2.0
"""Forces (N per taxel) at the ends of the colour scale and of the arrow scale; a grip of 30 N is 1 N per taxel."""


def play(
    task: str = "SX-2mm",
    *,
    run: Path | None = None,
    seed: int = 0,
    out: Path = Path("insertion.mp4"),
    force: bool = False,
    other_versions: bool = False,
) -> None:
    """Film an episode of a trained policy, or of the scripted expert that sees the poses.

    Args:
        task: Name of the task, for the expert.
        run: Folder of a run; its policy plays the task of the run. Default: the expert plays.
        seed: Random seed of the episode.
        out: Output file: an MP4 film, or an animated GIF or WebP of half the height.
        force: Overwrite an existing file.
        other_versions: Accept a run made with other software versions.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise paxisim.InvalidValueError(f"expected a file name that ends with one of {', '.join(SUFFIXES)}, got {out}")
    if out.exists() and not force:
        raise paxisim.OutputExistsError(f"{out} exists already: choose another file, or pass --force")
    trained = None
    shown: dict[str, Any] = {"terminate_on_success": True, "render_mode": "rgb_array"}
    if run is None:
        env = InsertionEnv(task, "GCS", **shown)
    else:
        this = Run.open(run, other_versions=other_versions)
        env = this.insertion_env(**shown)
        trained = this.policy(env)
    succeeded: list[bool] = []
    try:
        write_film(out, episode(env, trained, seed, succeeded), env.metadata["render_fps"])
    finally:
        env.close()
    print(f"{env.task.name} seed {seed}: {'inserted' if any(succeeded) else 'not inserted'}; {out}")


def episode(
    env: InsertionEnv, trained: Trained | None, seed: int, succeeded: list[bool]
) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures of an episode; after each step, append to `succeeded` whether the peg is inserted."""
    observation, _ = env.reset(seed=seed)
    terminated = truncated = False
    while not (terminated or truncated):
        yield frame(env)
        action = expert_action(env) if trained is None else trained.act(observation)
        observation, _, terminated, truncated, info = env.step(action)
        succeeded.append(bool(info["is_success"]))
    yield frame(env)


def write_film(path: Path, pictures: Iterator[NDArray[np.uint8]], rate: float) -> None:
    """Write pictures ``(height, width, 3)`` at `rate` frames per second, in the format of the file's suffix."""
    import cv2  # installed with robosuite
    from PIL import Image

    first = next(pictures)
    height, width, _ = first.shape
    if path.suffix.lower() != ".mp4":
        small = (Image.fromarray(cv2.resize(each, (width // 2, height // 2))) for each in chain([first], pictures))
        next(small).save(path, save_all=True, append_images=small, duration=round(1000 / rate), loop=0, quality=60)
        return
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate, (width, height))
    try:
        for picture in chain([first], pictures):
            film.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    finally:
        film.release()


def frame(env: InsertionEnv) -> NDArray[np.uint8]:
    """Return a picture ``(480, width, 3)`` of the scene with the pads' newest reading to its right."""
    import cv2

    scene = env.render()
    assert scene is not None
    assert env.scene.tactile is not None
    figure = paxisim.plot_pads(env.reading, env.scene.tactile.pads.layout, vmax=LARGEST_NORMAL, shear_max=LARGEST_SHEAR)
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=HEIGHT / figure.get_size_inches()[1])
    beside = cv2.imdecode(np.frombuffer(drawn.getvalue(), np.uint8), cv2.IMREAD_COLOR)
    assert beside is not None
    width = 2 * round(beside.shape[1] * HEIGHT / beside.shape[0] / 2)  # video codecs need even sizes
    return np.hstack([scene, cv2.resize(beside, (width, HEIGHT))[:, :, ::-1]]).astype(np.uint8)


if __name__ == "__main__":
    sys.exit(command(play))
