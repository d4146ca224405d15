"""Ready-made protocols: presses of an indenter, two pads that regrasp a peg, a gripper that moves in the air."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.protocols import moves
from paxisim.protocols.moves import STAIRCASE_LEVELS, UNLOADED_SECONDS, Path
from paxisim.protocols.protocol import Protocol

RECORDING_RATE = 100.0
PAD = (0.0226, 0.0261)
"""Default size (m) of the pressed pad along x and y: that of paxini-gen1-l4629."""
_PEG = 0.024  # m, width of the peg in the ready-made scene
_PLACES = ((0, 0), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5), (0.5, 0), (0, -0.5), (-0.5, 0))
"""Place pressed in each episode, as fractions of half the pad."""


def press(depth: float = 1.5e-3, stop_force: float = 20.0, pad: tuple[float, float] = PAD) -> Protocol:
    """Return a protocol in which a ball on a stage presses, holds, taps and slides on a pad, face up, at eight places.

    Args:
        depth: Maximum depth (m) of the press.
        stop_force: Total normal force (N) at which the stage must stop.
        pad: Size (m) of the pad along its x and y.

    Raises:
        InvalidValueError: A number is out of range.
    """
    _check_depth(depth)
    if not all(0 < size < 1 for size in pad):
        raise InvalidValueError(f"a pad's size must be two lengths in m, got {pad!r}")
    high = -2e-3
    path = Path(0.025, "depth", -5e-4, x=0.0, y=0.0, depth=high)
    for path.episode, (along, across) in enumerate(_PLACES):
        x, y = 0.5 * along * pad[0], 0.5 * across * pad[1]
        path.to(depth=high)
        path.to(x=x, y=y)
        path.lift()
        path.end("approach", "go above the place, not touching")
        moves.free(path, UNLOADED_SECONDS if path.episode == 0 else 3.0)
        moves.taps(path, 0.6 * depth)
        if path.episode in (0, 3, 4, 7):
            moves.staircase(path, 0.0, depth, "places", "corners")
        if path.episode in (1, 5):
            moves.hold(path, 0.8 * depth)
        if path.episode in (2, 6):
            moves.waves(path, depth)
        if path.episode == 4:
            moves.hold_both_ways(path, 0.5 * depth, depth)
        if path.episode in (3, 6):
            moves.light(path, 0.0, 0.15 * depth)
        if path.episode in (0, 1, 3, 5, 7):
            _slides(path, x, y, 0.25 * min(pad), (0.5 * depth, 0.9 * depth))
    path.to(depth=high)
    moves.free(path, UNLOADED_SECONDS)
    return Protocol(
        "press",
        "a ball of 20 mm radius, on a stage or in a robot's hand, presses one pad that lies face up",
        "indenter",
        ("x", "y", "depth"),
        "x and y along the pad's own axes from its middle; depth is 0 where the ball touches the flat pad and positive "
        "where it is pressed in",
        0.025,
        stop_force,
        RECORDING_RATE,
        tuple(path.segments),
    )


def regrasp(depth: float = 4e-4, stop_force: float = 25.0) -> Protocol:
    """Return a protocol in which two pads close on a peg, hold it, press harder, let go and grasp again.

    Args:
        depth: Maximum depth (m) of the peg in each pad.
        stop_force: Total normal force (N) on a pad at which the gripper must stop.

    Raises:
        InvalidValueError: A number is out of range.
    """
    _check_depth(depth)
    wide, near = _PEG + 0.010, _PEG + 0.001

    def closed(share: float) -> float:
        return _PEG - 2 * share * depth

    path = Path(0.025, "opening", near, opening=wide)
    for path.episode in range(8):
        moves.free(path, UNLOADED_SECONDS if path.episode == 0 else 3.0)
        for seconds in (1.0, 3.0):
            path.to(seconds, opening=near)
            path.to(seconds, opening=wide)
        path.end("open and close", "close to 1 mm before the peg and open, at two speeds", "gripper")
        path.lift()
        path.end("approach", "close to 1 mm before the peg")
        moves.taps(path, closed(0.6))
        if path.episode % 2 == 0:
            moves.staircase(path, closed(0.0), closed(1.0), "places")
        if path.episode in (1, 5):
            moves.hold(path, closed(0.8))
        if path.episode in (3, 7):
            moves.waves(path, closed(1.0))
        for share in (0.5, 1.0, 0.7):
            path.press(0.6, closed(share))
            path.rest(2.0)
            path.to(0.6, opening=wide)
        path.end("regrasp", "grasp, hold for 2 s and let go, three times with different squeezes", "varied")
    moves.free(path, UNLOADED_SECONDS)
    return Protocol(
        "regrasp",
        "a gripper with two pads and a peg of 24 mm width that stands between them",
        "peg",
        ("opening",),
        "opening is the distance between the pads' surfaces; they touch the peg at 0.024",
        0.025,
        stop_force,
        RECORDING_RATE,
        tuple(path.segments),
    )


def open_close(stop_force: float = 2.0) -> Protocol:
    """Return a protocol in which a gripper opens and closes in the air, so its pads' readings are not forces.

    Args:
        stop_force: Total normal force (N) on a pad at which the gripper must stop.

    Raises:
        InvalidValueError: A number is out of range.
    """
    narrow, wide = 0.030, 0.090
    path = Path(0.06, "opening", wide, opening=wide)
    for path.episode in range(8):
        moves.free(path, UNLOADED_SECONDS if path.episode == 0 else 8.0)
        for seconds in (2.0, 4.0, 10.0):
            path.press(seconds, narrow)
            path.lift(seconds)
        path.end("open and close", "close to 30 mm and open to 90 mm, at three speeds", "gripper")
        for step in range(1, STAIRCASE_LEVELS):
            path.press(1.0, wide + step / (STAIRCASE_LEVELS - 1) * (narrow - wide))
            path.rest(3.0)
        path.lift()
        path.end("stops", "hold each of five openings for 3 s", "gripper")
    moves.free(path, UNLOADED_SECONDS)
    return Protocol(
        "open-close",
        "a gripper with two pads, with nothing between them",
        "gripper",
        ("opening",),
        "opening is the distance between the pads' surfaces",
        0.06,
        stop_force,
        RECORDING_RATE,
        tuple(path.segments),
    )


def _slides(path: Path, x: float, y: float, reach: float, depths: tuple[float, float]) -> None:
    for depth in depths:
        path.press(0.5, depth)
        for name, middle in (("x", x), ("y", y)):
            for goal in (middle + reach, middle - reach, middle):
                path.to(1.5, **{name: goal})
        path.lift(0.5)
    path.end("slides", "slide along x and y, to and fro, at two depths", "slides", "loads")


def _check_depth(depth: float) -> None:
    if not 0 < depth <= 4e-3:
        raise InvalidValueError(f"a protocol's depth must lie between 0 and 4 mm, got {1e3 * depth:g} mm")


READY: Mapping[str, Callable[..., Protocol]] = {"press": press, "regrasp": regrasp, "open-close": open_close}


def known_protocols() -> tuple[str, ...]:
    """Return the names of the ready-made protocols."""
    return tuple(READY)


def protocol(name: str, **options: float | tuple[float, float]) -> Protocol:
    """Return a ready-made protocol.

    Args:
        name: One of `known_protocols`: ``"press"``, ``"regrasp"`` or ``"open-close"``.
        options: ``stop_force`` (N) for all, ``depth`` (m) for those that press, ``pad`` (m, m) for ``"press"``.

    Raises:
        UnknownNameError: There is no such protocol, or it has no such option.
        InvalidValueError: A number is out of range.

    Example:
        ```python
        paxisim.protocol("press", depth=1.2e-3, stop_force=15.0).save("press.json")
        ```
    """
    from inspect import signature

    if name not in READY:
        raise UnknownNameError("protocol", name, READY)
    known = list(signature(READY[name]).parameters)
    for option in options:
        if option not in known:
            raise UnknownNameError(f"option of protocol {name!r}", option, known)
    return READY[name](**options)
