"""Program for an interpreter that has lerobot; see `test_lerobot_loader`.

python lerobot_loader.py look FOLDER OUT: load a dataset with lerobot and save its arrays as npz.
python lerobot_loader.py append FOLDER: add one episode with lerobot.
python lerobot_loader.py merge FOLDER OTHER OUT: merge two datasets with lerobot.
python lerobot_loader.py create FOLDER: record a dataset with lerobot.
"""

import json
import sys

import numpy as np
import torch
from lerobot.datasets.dataset_tools import merge_datasets
from lerobot.datasets.lerobot_dataset import LeRobotDataset

NAME = "me/press"


def look(folder, out):
    whole = LeRobotDataset(NAME, root=folder)
    items = [whole[i] for i in range(len(whole))]
    found = {key: np.stack([item[key].numpy() for item in items]) for key in items[0] if key != "task"}
    found |= {f"stats/{key}": value["mean"] for key, value in whole.meta.stats.items()}
    deltas = {"observation.tactile.left": [-2 / whole.fps, -1 / whole.fps, 0.0], "action": [0.0, 1 / whole.fps]}
    windows = LeRobotDataset(NAME, root=folder, delta_timestamps=deltas)
    batches = torch.utils.data.DataLoader(windows, batch_size=len(windows))
    batch = next(iter(batches))
    for key in deltas:
        found |= {f"window/{key}": batch[key].numpy(), f"is_pad/{key}": batch[f"{key}_is_pad"].numpy()}
    last = LeRobotDataset(NAME, root=folder, episodes=[whole.num_episodes - 1])
    found["last"] = np.stack([last[i]["index"].numpy() for i in range(len(last))])
    said = {
        "fps": whole.fps,
        "episodes": whole.num_episodes,
        "bounds": [[episode["dataset_from_index"], episode["dataset_to_index"]] for episode in whole.meta.episodes],
        "tasks": [item["task"] for item in items],
        "shapes": {key: list(shape) for key, shape in whole.meta.shapes.items()},
        "names": whole.meta.names["action"],
        "stats": {key: sorted(value) for key, value in whole.meta.stats.items()},
    }
    np.savez(out, said=json.dumps(said), **found)


def append(folder):
    dataset = LeRobotDataset(NAME, root=folder)
    for i in range(4):
        numbers = {
            key: np.full(feature["shape"], i, np.float32)
            for key, feature in dataset.features.items()
            if key.startswith(("observation", "action"))
        }
        dataset.add_frame({**numbers, "task": "added"})
    dataset.save_episode()
    dataset.finalize()


def merge(folder, other, out):
    datasets = [LeRobotDataset(NAME, root=folder), LeRobotDataset(NAME, root=other)]
    merge_datasets(datasets, output_repo_id="me/merged", output_dir=out)


def create(folder):
    features = {
        "observation.tactile": {"dtype": "float32", "shape": (2, 3, 6, 5), "names": ["pad", "axis", "row", "column"]},
        "observation.tactile.palm": {"dtype": "float32", "shape": (3, 6, 5), "names": ["axis", "row", "column"]},
        "observation.state": {"dtype": "float32", "shape": (2,), "names": ["shoulder", "elbow"]},
        "observation.opening": {"dtype": "float32", "shape": (1,), "names": ["opening"]},
        "action": {"dtype": "float32", "shape": (3,), "names": None},
    }
    dataset = LeRobotDataset.create(NAME, fps=25, features=features, root=folder, robot_type="arm", use_videos=False)
    for episode, length in enumerate((7, 5)):
        for frame in range(length):
            at = 10 * episode + frame
            dataset.add_frame(
                {
                    "observation.tactile": np.arange(180, dtype=np.float32).reshape(2, 3, 6, 5) + at,
                    "observation.tactile.palm": np.arange(90, dtype=np.float32).reshape(3, 6, 5) - at,
                    "observation.state": np.array([at, -at], np.float32),
                    "observation.opening": np.array([at / 2], np.float32),
                    "action": np.array([at, 1, 2], np.float32),
                    "task": ("press", "pull")[episode],
                }
            )
        dataset.save_episode()
    dataset.finalize()


if __name__ == "__main__":
    {"look": look, "append": append, "merge": merge, "create": create}[sys.argv[1]](*sys.argv[2:])
