"""Effects outside the vocabulary of causes, each clearly visible."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from hidden.exam.world import RATE, Effect, size

NEEDS_TWO_PADS = ("other_pad", "held_pad")
NEEDS_WARMTH = ("warm_gain",)


def warm_gain(rng, world, strength):
    """A gain that depends on the temperature, by 10 to 30 % over the range of the recording."""
    share = size(strength, 0.1, 0.3) * rng.choice([-1, 1])
    t = world.temperature
    gain = 1 + share * (t - t[0, 0]) / np.abs(t - t[0, 0]).max()
    return Effect({"share": share}, lambda force: force * gain[..., None, None, None])


def other_pad(rng, world, strength):
    """Crosstalk from one pad to the other, 5 to 20 %."""
    share = size(strength, 0.05, 0.2)
    giver = int(rng.integers(2))

    def apply(force):
        out = force.copy()
        out[:, :, 1 - giver] += share * force[:, :, giver]
        return out

    return Effect({"share": share, "from": giver}, apply)


def speed_gain(rng, world, strength):
    """A gain that depends on the rate of change of the taxel's force, by up to 15 to 45 %."""
    share = size(strength, 0.15, 0.45) * rng.choice([-1, 1])
    fast = rng.uniform(1, 3) * world.peak[2]

    def apply(force):
        speed = np.abs(np.gradient(force[..., 2, :], axis=1)) * RATE
        return force * (1 + share * np.tanh(speed / fast))[..., None, :]

    return Effect({"share": share, "fast": fast}, apply)


def wear(rng, world, strength):
    """A gain that falls with the cumulative load of a pad, by 15 to 40 % by the end."""
    share = size(strength, 0.15, 0.4)

    def apply(force):
        carried = force[..., 2, :].sum(axis=-1)
        so_far = np.cumsum(carried.reshape(-1, world.pads), axis=0)
        gain = 1 - share * so_far / np.maximum(so_far[-1], 1e-9)
        return force * gain.reshape(carried.shape)[..., None, None]

    return Effect({"share": share}, apply)


def softening(rng, world, strength):
    """A taxel that is softer below its largest past load, 40 to 75 % at small forces. Each pause recovers a part."""
    share, keeps = size(strength, 0.4, 0.75), rng.uniform(0.2, 0.7)

    def apply(force):
        load = force[..., 2, :]
        most = np.maximum.accumulate(load, axis=1)
        for i in range(1, len(load)):
            most[i] = np.maximum(most[i], keeps * most[i - 1, -1])
        below = 1 - np.divide(load, most, out=np.ones_like(load), where=most > 1e-6)
        gain = 1 - share * np.minimum(most / world.peak[2], 1) * below
        return force * gain[..., None, :]

    return Effect({"share": share}, apply)


def loose_row(rng, world, strength):
    """A row with an intermittent connection, lost 5 to 30 % of the time; a column if the sensor has one row only."""
    away = size(strength, 0.05, 0.3)
    load = world.load.reshape(world.pads, world.rows, world.cols)
    lines = load.sum(axis=2) if world.rows > 1 else load[:, 0]
    pad, line = np.unravel_index(np.argmax(lines * rng.uniform(0.7, 1, lines.shape)), lines.shape)
    grid = np.arange(world.rows * world.cols).reshape(world.rows, world.cols)
    taxels = grid[line] if world.rows > 1 else grid[:, line]
    steps, lasts = world.opening.shape, rng.uniform(0.05, 0.2)
    change = rng.random(steps) < 1 / (lasts * RATE)
    last = np.maximum.accumulate(np.where(change, np.arange(steps[1]), 0), axis=1)
    gone = np.take_along_axis(rng.random(steps), last, axis=1) < away

    def apply(force):
        out = force.copy()
        for taxel in taxels:
            out[:, :, pad, :, taxel] *= ~gone[..., None]
        return out

    return Effect({"away": away, "pad": int(pad), "line": int(line)}, apply)


def held_pad(rng, world, strength):
    """One pad that occasionally freezes for 0.1 to 0.6 s while the other goes on."""
    often = size(strength, 0.4, 1.5)
    pad = int(rng.integers(2))
    shape = world.opening.shape
    index = np.broadcast_to(np.arange(shape[1]), shape).copy()
    begins, lengths = rng.random(shape) < often / RATE, rng.uniform(0.1, 0.6, shape)
    for episode, step in np.argwhere(begins):
        stop = step + int(lengths[episode, step] * RATE)
        index[episode, step:stop] = index[episode, step]

    def apply(force):
        out = force.copy()
        out[:, :, pad] = np.take_along_axis(force[:, :, pad], index[..., None, None], axis=1)
        return out

    return Effect({"a_second": often, "pad": pad}, apply)


def auto_zero(rng, world, strength):
    """A sensor that adapts its zero to steady readings, with a time constant of 15 down to 3 s."""
    tau = size(strength, 15, 3)
    steady = rng.uniform(0.1, 0.3) * world.peak[2]

    def apply(force):
        slow = np.abs(np.gradient(force, axis=1)) * RATE < steady
        out = np.empty_like(force)
        zero = np.zeros_like(force[:, 0])
        for i in range(force.shape[1]):
            zero = zero + slow[:, i] * (force[:, i] - zero) / (tau * RATE)
            out[:, i] = force[:, i] - zero
        return out

    return Effect({"tau": tau}, apply)


def mains(rng, world, strength):
    """Mains hum with its third harmonic, 0.5 to 2 counts."""
    height = size(strength, 0.05, 0.2)
    frequency = float(rng.choice([50.0, 60.0])) + rng.uniform(-0.1, 0.1)
    each = rng.uniform(0.5, 1.5, world.channels) * rng.choice([-1, 1], world.channels)
    angle = 2 * np.pi * frequency * world.clock
    wave = (np.sin(angle) + 0.2 * np.sin(3 * angle))[..., None, None, None]
    return Effect({"height": height, "frequency": frequency}, lambda force: force + height * each * wave)


def product(rng, world, strength):
    """Shear that rotates with the normal force, and a normal force from both shears, 60 to 150 % at the peak."""
    share = size(strength, 0.6, 1.5) * rng.choice([-1, 1])

    def apply(force):
        out = force.copy()
        press = force[..., 2, :] / world.peak[2]
        out[..., 0, :] += share * press * force[..., 1, :]
        out[..., 1, :] -= share * press * force[..., 0, :]
        out[..., 2, :] += share * force[..., 0, :] * force[..., 1, :] / world.peak[0]
        return out

    return Effect({"share": share}, apply)


def swapped_packets(rng, world, strength):
    """Packets in the wrong order: 4 to 25 % of them swap places with a packet two or three frames later."""
    share = size(strength, 0.04, 0.25)
    frames = world.frames
    order = np.arange(len(frames))
    far = int(rng.integers(2, 4))
    first = np.flatnonzero(rng.random(len(frames) - far) < share)
    for i in first:
        if frames[i] == frames[i + far]:
            order[[i, i + far]] = order[[i + far, i]]
    return Effect({"share": share, "far": far}, lambda reading: reading[order], on_frames=True)


def ranges(rng, world, strength):
    """A sensor with two ranges that differ in gain by 8 to 25 %, switched by a smoothed reading of the pad."""
    share = size(strength, 0.08, 0.25) * rng.choice([-1, 1])
    level = rng.uniform(0.3, 0.5)

    def apply(force):
        total = gaussian_filter1d(force[..., 2, :].sum(axis=-1), 0.02 * RATE, axis=1)
        high = total > level * total.max(axis=(0, 1), keepdims=True)
        return force * (1 + share * high)[..., None, None]

    return Effect({"share": share, "level": level}, apply)


OUTSIDERS = {
    f.__name__: f
    for f in (warm_gain, other_pad, speed_gain, wear, softening, loose_row, held_pad, auto_zero, mains, product,
              swapped_packets, ranges)
}  # fmt: skip
"""Effects by name: (rng, world, strength) -> Effect."""
