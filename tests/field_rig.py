"""A board of magnetometers on a moving robot, with fields by magpylib, independent of paxisim's own models."""

import magpylib
import numpy as np
from scipy.spatial.transform import Rotation

from paxisim.recording import Recording

CHIPS = 1e-3 * np.array([[0, 0, 0], [7, 0, 0], [-7, 0, 0], [0, 7, 0], [0, -7, 0]])
EARTH = np.array([20.0, 0.0, -45.0])  # uT
NOISE = 0.5  # uT
GAP = 0.006  # m between chips and the other finger's magnet when the gripper is closed


def field(opening, wrist):
    """``(T, 1, 3, 1, 5)`` uT of five chips: the magnet of a finger at a distance, and the earth in a turning hand."""
    magnet = magpylib.magnet.Cuboid(polarization=(0, 0, 0.02), dimension=(0.02, 0.02, 0.002))
    places = (CHIPS[None] - np.outer(np.asarray(opening) + GAP, [0, 0, 1])[:, None]).reshape(-1, 3)
    other = 1e6 * magnet.getB(places).reshape(-1, len(CHIPS), 3)
    earth = Rotation.from_euler("xy", wrist).inv().apply(EARTH)
    return np.moveaxis(other + earth[:, None], 1, 2)[:, None, :, None]


def moving(seed, seconds=60.0, rate=50.0, drift=0.3, delay=0.0):
    """Return a recording without contact: the gripper opens and closes, and the wrist turns about two axes.

    Args:
        seed: Random seed of the motion, the drift and the noise.
        seconds: Duration (s).
        rate: Sampling rate (Hz).
        drift: Standard deviation over channels of their drift (uT per minute).
        delay: Time (s) by which the channels lag the joint positions.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / rate)
    phase = rng.uniform(0, 6, 3)

    def joints(time):
        opening = 0.03 + 0.03 * np.sin(2 * np.pi * 0.11 * time + phase[0])
        turn = [1.2 * np.sin(2 * np.pi * 0.07 * time + phase[1]), 0.8 * np.sin(0.3 * time + phase[2])]
        return opening, np.stack(turn, axis=1)

    clean = field(*joints(time - delay))
    slow = drift * rng.normal(size=clean.shape[1:]) * (time / 60).reshape(-1, 1, 1, 1, 1)
    channels = clean + slow + rng.normal(0, NOISE, clean.shape) + 100
    opening, wrist = joints(time)
    hand = Rotation.from_euler("xy", wrist)
    pose = np.tile(np.eye(4)[:3], (len(time), 1, 1))
    pose[:, :, :3] = hand.as_matrix()
    covariates = {"opening": opening, "wrist": wrist, "hand": hand.as_quat(), "pose": pose[:, :, :3]}
    return Recording(time, channels, covariates=covariates, metadata={"unit": "uT"})
