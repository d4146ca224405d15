"""Effects outside the vocabulary: a diagnosis must report that something is left, not name a similar cause."""

import numpy as np

from hidden.effects import COUNT, DT, between, sign


def mullins(rng, pad, strength):
    """Rubber that softens permanently with its largest past load."""
    soft = between(0.10, 0.35, strength)
    seen = np.zeros((pad.pads, 1, len(pad.where)))

    def apply(f, e):
        nonlocal seen
        most = np.maximum.accumulate(np.concatenate([seen[None], np.abs(f[:, :, 2:])]), axis=0)[1:]
        seen = most[-1]
        return f * (1 - soft * (1 - np.exp(-most / (0.3 * pad.peak))) * np.exp(-np.abs(f[:, :, 2:]) / most.clip(1e-9)))

    return apply, {"soft": soft}


def hum(rng, pad, strength):
    """Mains hum, or its alias, on all channels."""
    size = between(0.5, 3.0, strength) * COUNT
    frequency = rng.uniform(2.0, 9.0)
    mix = rng.uniform(0.4, 1.0, (pad.pads, 3, len(pad.where)))

    def apply(f, e):
        t = e.start + DT * np.arange(len(f))
        return f + size * np.sin(2 * np.pi * frequency * t)[:, None, None, None] * mix

    return apply, {"frequency": frequency}


def gain_control(rng, pad, strength):
    """An amplifier that lowers its gain under a large load and recovers within a second or two."""
    depth = between(0.15, 0.5, strength)
    tau = rng.uniform(0.5, 2.0)

    def apply(f, e):
        total = np.abs(f[:, :, 2]).sum(axis=-1) / (6 * pad.peak)
        level, slow = np.zeros(total.shape[1]), np.empty_like(total)
        for i in range(len(total)):
            level = level + (total[i] - level) * DT / np.where(total[i] > level, 0.15, tau)
            slow[i] = level
        return f / (1 + depth * 3 * slow[:, :, None, None])

    return apply, {"depth": depth}


def row_scan(rng, pad, strength):
    """Rows are read in sequence: each is later than the one above."""
    whole = between(0.04, 0.2, strength)

    def apply(f, e):
        grid = f.reshape(*f.shape[:3], pad.rows, pad.cols).copy()
        for row in range(pad.rows):
            late = round(whole * row / max(1, pad.rows - 1) / DT)
            grid[late:, ..., row, :] = grid[: len(grid) - late, ..., row, :] if late else grid[..., row, :]
        return grid.reshape(f.shape)

    return apply, {"whole": whole}


def swapped_neighbours(rng, pad, strength):
    """Some pairs of neighbouring taxels are swapped."""
    count = 1 + round(3 * strength)
    near = np.argsort(np.linalg.norm(pad.where, axis=1))
    pairs = [(int(near[2 * i]), int(near[2 * i + 1])) for i in range(count)]

    def apply(f, e):
        order = np.arange(f.shape[-1])
        for a, b in pairs:
            order[[a, b]] = order[[b, a]]
        return f[..., order]

    return apply, {"pairs": pairs}


def bursts(rng, pad, strength):
    """All taxels occasionally jump for a moment, as in an electrostatic discharge."""
    size = between(3.0, 20.0, strength) * COUNT
    seed = int(rng.integers(2**31))

    def apply(f, e):
        own = np.random.default_rng([seed, round(e.start)])
        out = f.copy()
        for _ in range(4):
            at = own.integers(len(f) - 60)
            out[at : at + 50] += size * sign(own, pad.pads, 3, len(pad.where))
        return out

    return apply, {"size": size}


def rate_gain(rng, pad, strength):
    """A gel that reads more under fast loading, in proportion to the square root of the speed."""
    size = between(0.1, 0.4, strength)

    def apply(f, e):
        speed = np.abs(np.gradient(f[:, :, 2].sum(axis=-1), DT, axis=0)) / (20 * pad.peak)
        return f * (1 + size * np.sqrt(speed))[:, :, None, None]

    return apply, {"size": size}


def loose_wire(rng, pad, strength):
    """A row with an intermittent connection."""
    row = int(rng.integers(1, pad.rows - 1)) if pad.rows > 2 else 0
    share = between(0.15, 0.6, strength)
    seed = int(rng.integers(2**31))

    def apply(f, e):
        own = np.random.default_rng([seed, round(e.start)])
        blocks = own.random(len(f) // 100 + 1) < share
        out = f.reshape(*f.shape[:3], pad.rows, pad.cols).copy()
        out[np.repeat(blocks, 100)[: len(f)], 0, :, row] = 0
        return out.reshape(f.shape)

    return apply, {"row": row}


def shear_softening(rng, pad, strength):
    """Slip: shear beyond a share of the normal force of the whole pad is lost."""
    limit = between(0.35, 0.12, strength)

    def apply(f, e):
        total = f.sum(axis=-1, keepdims=True)
        size = np.linalg.norm(total[:, :, :2], axis=2, keepdims=True)
        most = limit * np.abs(total[:, :, 2:])
        out = f.copy()
        out[:, :, :2] *= np.where(size > most, most / np.maximum(size, 1e-9), 1.0)
        return out

    return apply, {"limit": limit}


def warm_gain(rng, pad, strength):
    """A gain that follows the temperature."""
    share = between(0.02, 0.08, strength) * sign(rng)
    return lambda f, e: f * (1 + share * (e.temperature - 25))[:, None, None, None], {"per_degree": share}


def other_pad(rng, pad, strength):
    """Crosstalk from one pad to the next."""
    share = between(0.05, 0.2, strength)
    given = (np.arange(pad.pads) == rng.integers(pad.pads))[:, None, None]
    return lambda f, e: f + share * np.roll(f * given, 1, axis=1), {"share": share}


def held_pad(rng, pad, strength):
    """A pad that freezes for some tenths of a second now and then, while the other goes on."""
    often, one = between(0.4, 1.5, strength), int(rng.integers(pad.pads))
    seed = int(rng.integers(2**31))

    def apply(f, e):
        own = np.random.default_rng([seed, round(e.start)])
        at = np.arange(len(f))
        for begin in np.flatnonzero(own.random(len(f)) < often * DT):
            at[begin : begin + int(own.uniform(0.1, 0.6) / DT)] = at[begin]
        out = f.copy()
        out[:, one] = f[at, one]
        return out

    return apply, {"per_second": often, "pad": one}


def auto_zero(rng, pad, strength):
    """A sensor that takes steady readings for its zero."""
    tau, steady = between(15.0, 3.0, strength), rng.uniform(0.1, 0.3) * pad.peak

    def apply(f, e):
        slow = np.abs(np.gradient(f, DT, axis=0)) < steady
        zero, out = np.zeros_like(f[0]), np.empty_like(f)
        for i in range(len(f)):
            zero = zero + slow[i] * (f[i] - zero) * DT / tau
            out[i] = f[i] - zero
        return out

    return apply, {"tau": tau}


OUTSIDERS = {
    f.__name__: f
    for f in (
        mullins, hum, gain_control, row_scan, swapped_neighbours, bursts, rate_gain, loose_wire, shear_softening,
    )
}  # fmt: skip

FURTHER = {f.__name__: f for f in (warm_gain, other_pad, held_pad, auto_zero)}
"""Outsiders that came later; fixed sets of recordings, which take `OUTSIDERS` in turn, do not contain them."""

LEARNT = {"swapped_neighbours": "swapped_taxels"}
"""Outsiders that were added to the vocabulary later, with the names of their causes."""
