"""Skip the tests of what is not installed: MuJoCo Warp and robosuite need different versions of MuJoCo."""

from importlib.util import find_spec

NEEDED = ("robosuite", "gymnasium", "stable_baselines3")
# an environment with MuJoCo Warp has robosuite's files at most, without what its code needs
if find_spec("mujoco_warp"):
    collect_ignore_glob = ["test_[!w]*.py"]
elif all(find_spec(name) for name in NEEDED):
    collect_ignore_glob = ["test_warp_*.py"]
else:
    collect_ignore_glob = ["test_*.py"]
