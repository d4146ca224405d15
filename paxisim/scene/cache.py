"""Cache: simulated episodes on disk, each in a file named after everything that its forces depend on."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from paxisim._version import __version__
from paxisim.files import whole_file
from paxisim.scene.replay import Replay, SimulatedEpisode

_NAME = re.compile(r"[0-9a-f]{32}\.npz|\.[0-9a-f]{32}\.npz\.[0-9a-f]{8}")  # also of a file that was being written

_ARRAYS = ("force", "qpos", "pressed")


class EpisodeCache:
    """A folder of simulated episodes, which several programs can share.

    An episode is found again only if the version of paxisim and MuJoCo, the compiled model with its meshes, the scene,
    the recording and the closings are the same, because its file is named by a hash of them.
    """

    def __init__(self, folder: Path) -> None:
        """Use a folder, which is created when the first episode is written."""
        self._folder = folder

    def read(self, replay: Replay, number: int, closings: Sequence[float] | None = None) -> SimulatedEpisode | None:
        """Return what `replay.run(number, closings)` returned before; None if it is missing or damaged."""
        try:
            with np.load(self._path(replay, number, closings), allow_pickle=False) as kept:
                about = json.loads(str(kept["about"]))
                arrays = [np.asarray(kept[name], dtype=np.float32) for name in _ARRAYS]
                force, qpos, pressed = arrays
                closed, notes = tuple(about["closings"]), tuple(about["notes"])
                return SimulatedEpisode(number, force, qpos, pressed, closed, notes)
        except FileNotFoundError:
            return None
        except Exception:  # zipfile and numpy raise many kinds of errors for a damaged file
            return None

    def run(self, replay: Replay, number: int, closings: Sequence[float] | None = None) -> SimulatedEpisode:
        """Return `replay.run(number, closings)`, from the folder if possible; otherwise the result is kept there."""
        kept = self.read(replay, number, closings)
        if kept is None:
            kept = replay.run(number, closings)
            self.write(replay, kept, closings)
        return kept

    def write(self, replay: Replay, episode: SimulatedEpisode, closings: Sequence[float] | None = None) -> None:
        """Keep what `replay.run(episode.number, closings)` returned.

        Raises:
            OSError: The file cannot be written.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        with whole_file(self._path(replay, episode.number, closings)) as temporary, temporary.open("wb") as file:
            about = json.dumps({"closings": episode.closings, "notes": episode.notes})
            arrays = {name: getattr(episode, name) for name in _ARRAYS}
            np.savez_compressed(file, **arrays, about=np.array(about))

    def _path(self, replay: Replay, number: int, closings: Sequence[float] | None) -> Path:
        digest = hashlib.sha256(f"{__version__} {mujoco.__version__} ".encode())
        for part in replay.inputs(number, closings):
            # the length tells where a part ends
            digest.update(f"{len(part)} ".encode() + part)
        return self._folder / f"{digest.hexdigest()[:32]}.npz"


def is_cache(folder: Path) -> bool:
    """Return whether a path is a folder that holds nothing but what an `EpisodeCache` writes."""
    return folder.is_dir() and all(_NAME.fullmatch(path.name) for path in folder.iterdir())
