"""``paxisim protocol``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.output import WIDTH, check_output
from paxisim.cli.taxels import Taxels
from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    from paxisim.protocols.protocol import Protocol


def protocol(
    name: Annotated[Literal["press", "regrasp", "open-close"], tyro.conf.Positional],
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    depth_mm: float | None = None,
    stop_n: float | None = None,
    force: bool = False,
) -> None:
    """Write a motion for a robot or a stage to follow while its sensor is recorded, as JSON.

    It holds times and positions, the episode of each, the speed that is not exceeded, the force at which to stop, and
    what each part is for. `paxisim replay press.json --scene press.toml` rehearses it in a scene of `paxisim scene
    make`.

    For example:

    paxisim protocol press -o press.json

    Args:
        name: press (an indenter on one pad), regrasp (two pads and a peg), open-close (a gripper without contact).
        taxels: The pad that is pressed; default: as large as paxini-gen1-l4629.
        output: The JSON file to write.
        depth_mm: How deep it presses at most; default: 1.5 for press, 0.4 into each pad for regrasp.
        stop_n: Total normal force (N) on a pad at which the robot must stop; default: 20, 25 or 2.
        force: Overwrite the file.
    """
    from paxisim.protocols.ready import protocol as ready_made

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
    """A line for each kind of segment that serves a cause: how often, how long, and which causes it shows."""
    import textwrap

    begin, seconds = 0.0, {}
    for segment in made.segments:
        end = segment.waypoints[-1][0]
        seconds.setdefault(segment.name, []).append(end - begin)
        begin = end
    causes = {segment.name: segment.excites for segment in made.segments}
    for name, each in seconds.items():
        line = f"{len(each):2d} x {name:15}{sum(each):5.0f} s  {', '.join(causes[name]) or '-'}"
        print(textwrap.fill(line, WIDTH, subsequent_indent=" " * 29))
