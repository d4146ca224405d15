"""``paxisim view``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro


def view(model: Annotated[Path, tyro.conf.Positional]) -> None:
    """Open a model with pads in MuJoCo's viewer, with its taxels coloured by force.

    Taxels turn red where they are pressed. Drag objects with the mouse (double click, then Ctrl and the right button)
    to press them.

    For example:

    paxisim view tactile_gripper.xml

    Args:
        model: MJCF file with pads, as `paxisim attach` writes it.
    """
    from paxisim.models.load import compile_spec, load_spec
    from paxisim.viz.view import view as open_viewer

    open_viewer(compile_spec(load_spec(model), str(model)))
