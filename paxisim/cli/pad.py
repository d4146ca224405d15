"""The ``paxisim pad`` command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from paxisim.cli.output import check_output, write_output
from paxisim.cli.taxels import Taxels


def pad(
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    name: str = "pad",
    thickness_mm: float = 1.0,
    sensors: Literal["none", "contact", "touch_grid"] = "none",
    force: bool = False,
) -> None:
    """Write one pad as an MJCF file that MuJoCo loads on its own.

    For example:

    paxisim pad --sensor paxini-gen1-l4629 --pool 2 -o pad.xml

    paxisim pad --rows 6 --cols 5 --pitch-mm 4.35,4.52 -o pad.xml

    Args:
        taxels: The pad's taxels.
        output: Output MJCF file, .xml; default: standard output.
        name: Name of the pad; prefix of all names in the file.
        thickness_mm: Thickness of the taxels in mm.
        sensors: MuJoCo sensors to embed; paxisim's own reader needs none.
        force: Overwrite the output if it exists.
    """
    from paxisim.models.pad import Pad

    if output is not None:
        check_output(output, force, ".xml")
    built = Pad(
        taxels.layout(),
        name=name,
        thickness=thickness_mm * 1e-3,
        mass=taxels.mass,
        sensors=None if sensors == "none" else sensors,
    )
    if output is None:
        print(built.to_xml(), end="")
        return
    write_output(output, built.to_xml(), force)
    height, width = (1e3 * length for length in built.layout.size)
    print(f"{output}: {built.layout.rows}x{built.layout.cols} taxels on {height:.4g} x {width:.4g} mm")
