"""Skip these tests if the packages that they integrate are not installed."""

from importlib.util import find_spec

NEEDED = ("robosuite", "gymnasium", "stable_baselines3")
collect_ignore_glob = [] if all(find_spec(name) for name in NEEDED) else ["test_*.py"]
