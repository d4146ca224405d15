"""Engines of the tasks by name. robosuite, which the native engine does without, is imported where it is used."""

from __future__ import annotations

import paxisim

from .scene import Scene
from .tasks import Parameters, Task

ENGINES = ("robosuite", "native")
"""Engines that move the hand in `paxisim_insertion.InsertionEnv`: robosuite's, the reference, and plain MuJoCo."""


def check_engine(name: str) -> None:
    """Check the name of an engine.

    Raises:
        UnknownNameError: There is no such engine.
    """
    if name not in ENGINES:
        raise paxisim.UnknownNameError("engine", name, ENGINES)


def make_scene(engine: str, task: Task, parameters: Parameters) -> Scene:
    """Build the scene of a task in an engine.

    Raises:
        UnknownNameError: There is no such engine.
        MissingExtraError: robosuite is not installed.
    """
    check_engine(engine)
    if engine == "native":
        from .native_scene import NativeScene

        return NativeScene(task, parameters)
    try:
        from .robosuite_scene import InsertionScene
    except ImportError as error:
        raise paxisim.MissingExtraError(error.name or "robosuite", "robosuite", "robosuite's engine") from error
    return InsertionScene(task, parameters)
