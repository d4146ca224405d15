"""The engines that move the hand: robosuite's, the reference, plain MuJoCo and MuJoCo Warp.

`scene.Scene` is what robosuite's and the native engine have in common; `warp.WarpScene` has many worlds of the native
one. robosuite's code, which the native engine does without, is imported where it is used.
"""

from __future__ import annotations

import paxisim

from ..tasks import Parameters, Task
from .arm import robosuite_scene
from .native import NativeScene
from .scene import Scene

ENGINES = ("robosuite", "native")
"""Engines of `paxisim_insertion.InsertionEnv`."""


def make_scene(engine: str, task: Task, parameters: Parameters) -> Scene:
    """Build the scene of a task in an engine.

    Raises:
        UnknownNameError: There is no such engine.
        MissingExtraError: robosuite is not installed.
    """
    if engine not in ENGINES:
        raise paxisim.UnknownNameError("engine", engine, ENGINES)
    return NativeScene(task, parameters) if engine == "native" else robosuite_scene(task, parameters)
