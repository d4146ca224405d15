"""The ``paxisim view`` command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro


def view(model: Annotated[Path, tyro.conf.Positional]) -> None:
    """Open a model with pads in MuJoCo's viewer, with the taxels coloured by force.

    Pressed taxels turn red. To press them, drag an object with the mouse: double-click it, then hold Ctrl and drag with
    the right button.

    For example:

    paxisim view tactile_gripper.xml

    Args:
        model: MJCF file with pads, as `paxisim attach` writes it.
    """
    from paxisim.models.load import compile_spec, load_spec
    from paxisim.viz.view import view as open_viewer

    open_viewer(compile_spec(load_spec(model), str(model)))
