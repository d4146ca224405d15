"""Simulator, driver, emulator and recording share one layout: a press gives the same tensor in each of them."""

import mujoco
import numpy as np
import pytest

from paxisim import Gel, Mount, Pad, Profile, Recording, Slot, TactileReadout, TaxelLayout, attach
from paxisim.hw.emulation.signals import from_recording

pytest.importorskip("serial")

from paxisim import Emulator, open_sensor

pytestmark = pytest.mark.real_time

LAYOUT = TaxelLayout(5, 3, (3e-3, 4e-3))
HALF_A_COUNT = 0.05  # N
# per pad, in the pad frame: position of the object (m) and force applied to it (N)
PLACES = np.array([[2.1e-3, -3.3e-3], [-2.4e-3, 1.2e-3]])
PUSHES = np.array([[2.0, 1.1, 9.0], [-0.9, 2.6, 11.0]])
OBJECT = """<body name="object{0}" pos="0 0 0"><joint name="object{0}" type="free" damping="5"/>
  <geom type="box" size="0.003 0.0025 0.003" mass="0.05"/></body>"""
# a device that differs from the tensor in order, axes and signs
DEVICE = Profile(
    "device",
    "high-speed",
    TaxelLayout(
        LAYOUT.rows, LAYOUT.cols, LAYOUT.pitch, vendor_order=(4, 9, 14, 3, 8, 13, 2, 7, 12, 1, 6, 11, 0, 5, 10)
    ),
    (Slot("left", 3), Slot("right", 1)),
    ("-y", "+x", "+z"),
    rate=50.0,
    verified="in a test",
)


@pytest.fixture(scope="module")
def force():
    """``(2, 3, 5, 3)`` forces (N) of two pads, each pressed off-centre and dragged in a direction of its own."""
    world = f"""<mujoco><option timestep="0.002" cone="elliptic" gravity="0 0 0"/><worldbody>
      <body name="left" pos="0 0 0.3"/><body name="right" pos="0.2 0.1 0.1"/>
      {OBJECT.format(0)}{OBJECT.format(1)}</worldbody></mujoco>"""
    mounts = [Mount("left"), Mount("right", quat=(0.3, 0.5, -0.2, 0.8))]
    tactile = attach(world, Pad(LAYOUT, gel=Gel(modulus=3e6, thickness=1e-3)), mounts)
    model = tactile.compile()
    pads, data = tactile.bind(model), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for i, body in enumerate(pads.bodies):
        start = model.joint(f"object{i}").qposadr[0]
        to_world = data.xmat[body].reshape(3, 3)
        data.qpos[start : start + 3] = data.xpos[body] + to_world @ [*PLACES[i], -0.003 + 5e-5]
        mujoco.mju_mat2Quat(data.qpos[start + 3 : start + 7], data.xmat[body])
    mujoco.mj_forward(model, data)
    for _ in range(300):
        for i, body in enumerate(pads.bodies):
            data.body(f"object{i}").xfrc_applied[:3] = data.xmat[body].reshape(3, 3) @ PUSHES[i]
        mujoco.mj_step(model, data)
    force = TactileReadout(model, pads).read(data)
    # the tests are meaningless unless the applied forces arrive, and any flip or swap changes the tensor noticeably
    np.testing.assert_allclose(force.sum(axis=(-2, -1)), PUSHES, atol=0.1)
    for changed in (force[::-1], force[:, [1, 0, 2]], force[..., ::-1, :], force[..., ::-1], force[..., ::-1, ::-1]):
        assert np.abs(changed - force).max() > 0.5
    return force


def measured(signal):
    """A frame of the emulated device, and the layout of its sensor."""
    with Emulator(DEVICE, signal, gate=0) as emulator, open_sensor(emulator.port, DEVICE) as sensor:
        return sensor.read(20.0), sensor.layout


def test_the_driver_gives_what_the_simulator_gives(force):
    frame, layout = measured(lambda now: force)
    assert frame.force.shape == force.shape == (2, *layout.shape)
    assert frame.force.dtype == force.dtype == np.float32
    assert np.abs(frame.force - force).max() <= HALF_A_COUNT + 1e-6
    np.testing.assert_array_equal(layout.positions, LAYOUT.positions)
    assert np.abs(frame.resultant - force.sum(axis=(-2, -1))).max() <= 15 * HALF_A_COUNT


@pytest.mark.parametrize("suffix", [".mcap", ".npz"])
def test_a_recording_gives_back_what_it_was_given_and_can_be_felt_again(suffix, force, tmp_path):
    path = tmp_path / f"press{suffix}"
    scale = np.array([0.5, 1.0, 0.75], dtype=np.float32)
    samples = scale[:, None, None, None, None] * force
    times = np.array([0.0, 0.1, 0.2])
    Recording(time=times, measured=samples, simulated=samples[::-1], layout=LAYOUT, pads=("left", "right")).save(path)
    loaded = Recording.load(path)
    np.testing.assert_array_equal(loaded.measured, samples)
    np.testing.assert_array_equal(loaded.simulated, samples[::-1])
    assert (loaded.measured.dtype, loaded.layout, loaded.pads) == (np.float32, LAYOUT, ("left", "right"))
    signal = from_recording(loaded, DEVICE)
    frame, _ = measured(lambda now: signal(0.1))
    assert np.abs(frame.force - force).max() <= HALF_A_COUNT + 1e-6
