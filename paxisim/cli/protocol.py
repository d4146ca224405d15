"""The ``paxisim protocol`` command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, check_output
from paxisim.cli.taxels import Taxels
from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    from paxisim.protocols.protocol import Protocol


def protocol(
    name: Annotated[Literal["press", "regrasp", "open-close"], tyro.conf.Positional],
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    depth_mm: float | None = None,
    stop_n: float | None = None,
    force: bool = False,
) -> None:
    """Write a motion (JSON) for a robot or a stage to follow while its sensor is recorded.

    The file holds times and positions by episode, the maximum speed, the force at which to stop, and the purpose of
    each part. `paxisim replay press.json --scene press.toml` rehearses the motion in a scene of `paxisim scene make`.

    For example:

    paxisim protocol press -o press.json

    Args:
        name: press: an indenter on one pad. regrasp: two pads and a peg. open-close: a gripper without contact.
        taxels: The pad for press; default: the size of paxini-gen1-l4629.
        output: Output file, .json; default: the name of the motion, with .json.
        depth_mm: Maximum depth in mm; default: 1.5 for press, 0.4 into each pad for regrasp.
        stop_n: Total normal force (N) on a pad at which the robot must stop.
            Default: 20 for press, 25 for regrasp, 2 for open-close.
        force: Overwrite the output if it exists.
    """
    from paxisim.protocols.ready import protocol as ready_made

    output = Path(f"{name}.json") if output is None else output
    check_output(output, force, ".json")
    options: dict[str, float | tuple[float, float]] = {}
    if depth_mm is not None:
        if name == "open-close":
            raise InvalidValueError("protocol open-close touches nothing: it takes no --depth-mm")
        options["depth"] = 1e-3 * depth_mm
    if stop_n is not None:
        options["stop_force"] = stop_n
    if taxels != Taxels():
        if name != "press":
            raise InvalidValueError(f"protocol {name} is the same for every pad: only press takes --sensor or a grid")
        height, width = taxels.layout().size
        options["pad"] = (width, height)
    made = ready_made(name, **options)
    made.save(output)
    print(f"{output}: {made.about}")
    print(f"{made.seconds / 60:.1f} min, moves {', '.join(made.streams)} at up to {1e3 * made.max_speed:g} mm/s")
    print(f"stop at a normal force of {made.stop_force:g} N on a pad\n")
    _print_segments(made)


def _print_segments(made: Protocol) -> None:
    """Print a line per kind of segment: number of repetitions, total duration, and the causes that it excites."""
    import textwrap

    begin, seconds = 0.0, {}
    for segment in made.segments:
        end = segment.waypoints[-1][0]
        seconds.setdefault(segment.name, []).append(end - begin)
        begin = end
    causes = {segment.name: segment.excites for segment in made.segments}
    for name, each in seconds.items():
        line = f"{len(each):2d} x {name:15}{sum(each):5.0f} s  {', '.join(causes[name]) or '-'}"
        print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent=" " * 29))
