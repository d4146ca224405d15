"""What the tests share: a tiny training. The tests of what is not installed are skipped."""

from importlib.util import find_spec

import pytest

NEEDED = ("robosuite", "gymnasium", "stable_baselines3")
# MuJoCo Warp and robosuite need different versions of MuJoCo: an environment with Warp has robosuite's files at most
if find_spec("mujoco_warp"):
    collect_ignore_glob = ["test_[!w]*.py"]
elif all(find_spec(name) for name in NEEDED):
    collect_ignore_glob = ["test_warp_*.py"]
else:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """Threads of torch that wait for each other cost more than they save."""
    import torch

    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def trained_run(tmp_path_factory):
    """Folder of a run of 240 steps of GCS on SY-2mm, in two environments; copy it to change it."""
    from paxisim_insertion.train import train

    folder = tmp_path_factory.mktemp("runs") / "SY-2mm_GCS_0"
    train("SY-2mm", "GCS", envs=2, buffer=3000, steps=240, out=folder, device="cpu")
    return folder
