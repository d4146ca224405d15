"""The paper's six blind insertion tasks in robosuite, as gymnasium environments.

Importing this package registers ``paxisim/RY-2mm-v0``, ``RU-2mm``, ``SQ-2mm``, ``SQ-1mm``, ``SX-2mm`` and ``SY-2mm``:
``gymnasium.make("paxisim/SX-2mm-v0", method="GCS")``. ``gymnasium.make_vec("paxisim/SX-2mm-warp-v0", num_envs=4096)``
makes worlds of MuJoCo Warp.
"""

import gymnasium

from .env import InsertionEnv as InsertionEnv
from .methods import METHODS as METHODS
from .methods import Method as Method
from .tasks import TASKS as TASKS
from .tasks import Parameters as Parameters
from .tasks import Task as Task


def _register() -> None:
    for name in TASKS:
        task = {"task": name}
        gymnasium.register(f"paxisim/{name}-v0", entry_point="paxisim_insertion.env:InsertionEnv", kwargs=task)
        worlds = "paxisim_insertion.warp_env:InsertionWarpEnv"
        gymnasium.register(f"paxisim/{name}-warp-v0", vector_entry_point=worlds, kwargs=task)


_register()
