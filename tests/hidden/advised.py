"""Motions that a diagnosis may request, as a careful user performs them: lists of episodes at 500 Hz.

They have the names that the diagnosis uses and follow only its descriptions.
"""

import numpy as np

from hidden.motions import KINDS, RATE, Motion, episode, path

LIGHT, USUAL, HARD = 6.0, 12.0, 25.0  # N: a careful press, a usual one, over-range
WIDTH = 6e-3


def _made(curve, pads, *, at=(0.0, 0.0), drag=None, opening=0.02, width=WIDTH, indenter="ball"):
    """Return an episode with the total normal force `curve` (N) on all pads.

    `at` is the position (2,) or (T, 2), m, and `drag` (T, 2) the ratio of shear to normal force. Every other pad is
    mirrored along x.
    """
    length = len(curve)
    mirror = np.array([[1.0, 1.0], [-1.0, 1.0]])[np.arange(pads) % 2]
    drag = np.zeros((length, 2)) + [0.12, -0.08] if drag is None else drag
    shear = (drag * (curve > 0)[:, None])[:, None] * mirror
    centre = np.broadcast_to(np.asarray(at), (length, 2))[:, None] * mirror
    gap = np.broadcast_to(np.asarray(opening, dtype=float), (length,)) - 2e-5 * curve
    return Motion(np.repeat(curve[:, None], pads, axis=1), shear, centre, gap, width, indenter, 0.3)


def _places(size, count, reach=0.6):
    """Return (count, 2) positions on a ring around the pad's middle, m."""
    angle = 2 * np.pi * np.arange(count) / count + 0.4
    return reach * np.stack([np.cos(angle) * size[1] / 2, np.sin(angle) * size[0] / 2], axis=-1)


def triangles(rng, size, pads):
    """Ramps up and down in 0.4, 4 and 40 s, the quick ones twice, then 30 s holds on the way up and down."""
    quick = [path([(1.0, 0.0), (t, USUAL), (t, 0.0), (t, USUAL), (t, 0.0), (1.0, 0.0)], "linear") for t in (0.2, 2.0)]
    slow = path([(1.0, 0.0), (20.0, USUAL), (20.0, 0.0), (1.0, 0.0)], "linear")
    held = [(1.0, 0.0), (1.0, 6.0), (30.0, 6.0), (1.0, USUAL), (1.0, 6.0), (30.0, 6.0), (1.0, 0.0), (5.0, 0.0)]
    places = _places(size, 6, 0.3)
    curves = [*quick, *quick, slow, path(held, "linear")]
    return [_made(curve, pads, at=at) for curve, at in zip(curves, places, strict=True)]


def holds(rng, size, pads):
    """A quick press held for 30 s, followed by 60 s of rest, twice."""
    curve = path([(1.0, 0.0), (0.3, USUAL), (30.0, USUAL), (0.3, 0.0), (60.0, 0.0)], "linear")
    return [_made(curve, pads, at=at) for at in _places(size, 2, 0.3)]


def taps(rng, size, pads):
    """Quick taps, and oscillations from 0.3 to 8 Hz about a steady load."""
    tap = [(0.04, USUAL), (0.1, USUAL), (0.04, 0.0), (0.4, 0.0)]
    t = np.arange(round(9 * RATE)) / RATE
    swings = 8.0 - 4.0 * np.cos(2 * np.pi * (0.3 * t + (8 - 0.3) * t**2 / (2 * 9.0)))
    chirp = np.concatenate([path([(1.0, 0.0), (0.3, 4.0)], "linear"), swings, path([(0.3, 0.0)], "linear") + 4.0])
    chirp[-round(0.3 * RATE) :] = np.linspace(swings[-1], 0, round(0.3 * RATE))
    curves = [path([(1.0, 0.0), *tap * 14], "linear"), np.append(chirp, np.zeros(500))] * 2
    return [_made(curve, pads, at=at) for curve, at in zip(curves, _places(size, 4, 0.3), strict=True)]


def gripper(rng, size, pads):
    """The gripper opens and closes over its travel without contact, four times at different speeds."""
    out = []
    for period in (12.0, 8.0, 6.0, 4.0):
        t = np.arange(round(12 * RATE)) / RATE
        out.append(_made(np.zeros(len(t)), pads, opening=0.02 - 0.02 * np.cos(2 * np.pi * t / period)))
    return out


def staircase(rng, size, pads):
    """Eight steps up to over-range and down again, at five positions."""
    steps = HARD * np.arange(1, 9) / 8
    points = [(1.0, 0.0)]
    for level in [*steps, *steps[-2::-1], 0.0]:
        points += [(0.15, level), (0.35, level)]
    curve = path([*points, (1.0, 0.0)], "linear")
    return [_made(curve, pads, at=at) for at in [np.zeros(2), *_places(size, 4)]]


def free(rng, size, pads):
    """60 s without contact before and after presses, twice."""
    press = [(0.5, USUAL), (2.0, USUAL), (0.5, 0.0), (1.0, 0.0)]
    curve = path([(60.0, 0.0), *press * 3, (60.0, 0.0)], "linear")
    return [_made(curve, pads, at=at) for at in _places(size, 2, 0.3)]


def slides(rng, size, pads):
    """Slides along x, then along y, back and forth, at a light and at the usual load."""
    out = []
    for load in (LIGHT, USUAL):
        for axis in (0, 1):
            curve = path([(1.0, 0.0), (0.6, load), (8.0, load), (0.6, 0.0), (1.0, 0.0)], "linear")
            swing = np.interp(np.arange(len(curve)) / RATE, [0, 1.6, 2.6, 4.6, 6.6, 8.6, 9.6], [0, 0, 1, -1, 1, -1, 0])
            unit = np.eye(2)[axis]
            travel = 0.3 * np.array([size[1], size[0]])[axis] * swing[:, None] * unit
            out.append(_made(curve, pads, at=travel, drag=0.4 * swing[:, None] * unit))
    return out


def loads(rng, size, pads):
    """Slides past slip at two loads along both axes: as `slides`, with the maximum shear that friction allows."""
    out = slides(rng, size, pads)
    for move in out:
        move.shear = np.clip(2.5 * move.shear, -0.6, 0.6)
    return out


def probe(rng, size, pads):
    """A fine tip on eight single taxels, then a flat plate on all taxels, at two loads."""
    press = [(0.5, 1.0), (1.0, 1.0), (0.5, 0.0), (0.5, 0.0)]
    tip = path([(1.0, 0.0), *[(t, LIGHT * v) for t, v in press], *[(t, 0.5 * LIGHT * v) for t, v in press]], "linear")
    plate = path([(1.0, 0.0), *[(t, HARD * v) for t, v in press], *[(t, USUAL * v) for t, v in press]], "linear")
    fine = [_made(tip, pads, at=at, width=2.5e-3) for at in [*_places(size, 4, 0.3), *_places(size, 4, 0.65)]]
    return [*fine, *[_made(plate, pads, width=0.7 * max(size), indenter="flat") for _ in range(2)]]


def light(rng, size, pads):
    """Very slow ramps from zero to a light load and back, at four positions, with shear in both directions."""
    curve = path([(1.0, 0.0), (8.0, 2.5), (8.0, 0.0), (1.0, 0.0)], "linear")
    out = []
    for number, at in enumerate(_places(size, 4, 0.4)):
        drag = np.zeros((len(curve), 2)) + [0.3 * (-1) ** number, 0.3 * (-1) ** (number // 2)]
        out.append(_made(curve, pads, at=at, drag=drag))
    return out


def places(rng, size, pads):
    """Presses with some shear at twelve positions, which load each taxel."""
    curve = path([(0.7, 0.0), (0.5, USUAL), (1.0, USUAL), (0.5, 0.0), (0.7, 0.0)], "linear")
    where = [*_places(size, 4, 0.35), *_places(size, 8, 0.75)]
    return [_made(curve, pads, at=at) for at in where]


def corners(rng, size, pads):
    """Presses near the corners of one pad at a time, then slides along each axis."""
    curve = path([(0.7, 0.0), (0.5, USUAL), (1.0, USUAL), (0.5, 0.0), (0.7, 0.0)], "linear")
    out = []
    for pad in range(pads):
        for at in _places(size, 4, 0.6)[pad % 2 :: 2]:
            move = _made(curve, pads, at=at)
            move.normal = move.normal * (np.arange(pads) == pad)
            out.append(move)
    return out + slides(rng, size, pads)[2:]


def sessions(rng, size, pads):
    """Ten episodes of 20 s, free before and after each press; ten minutes including the pauses."""
    curve = path([(5.0, 0.0), (0.5, USUAL), (2.0, USUAL), (0.5, 0.0), (12.0, 0.0)], "linear")
    return [_made(curve, pads, at=at) for at in _places(size, 10, 0.3)]


def repeats(rng, size, pads):
    """The same press ten times, five slow and five quick."""
    return [
        _made(path([(1.0, 0.0), (t, USUAL), (1.0, USUAL), (t, 0.0), (1.0, 0.0)], "linear"), pads)
        for t in (1.5, 0.2) * 5
    ]


def varied(rng, size, pads):
    """Eight episodes of different motions, as in the family "development"."""
    return [episode(kind, "development", rng, size, pads) for kind in KINDS["development"]]


ADVISED = {
    f.__name__: f
    for f in (
        triangles, holds, taps, gripper, staircase, free, slides, loads, probe, light, places, corners, sessions,
        repeats, varied,
    )
}  # fmt: skip
