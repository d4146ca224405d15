"""Room for contacts: that of put_worlds is enough, and too little is an error that names the size to raise."""

import copy

import mujoco
import numpy as np
import pytest
from held import Warped, bumps, held, loads, needs_warp

from paxisim.errors import InvalidValueError, UnsupportedError

pytestmark = needs_warp


@pytest.mark.parametrize(("cone", "rows"), [("elliptic", 3), ("pyramidal", 4)])
def test_there_is_room_for_five_contacts_a_taxel(cone, rows):
    model, pads, data = held(cone=cone)
    warped = Warped(model, pads, data, bumps(2, pads), loads(2))
    assert warped.d.naconmax >= 2 * 5 * pads.geoms.size
    assert warped.d.njmax >= rows * 5 * pads.geoms.size
    for _ in range(3):
        warped.step()
    assert warped.d.nefc.numpy().max() < warped.d.njmax


def apart(model, data):
    """The state with the object away from the pads, where it has no contacts."""
    state = copy.copy(data)
    state.qpos[model.joint("object").qposadr[0]] += 1.0
    mujoco.mj_forward(model, state)
    assert state.ncon == 0
    return state


def bring_back(warped, data):
    warped.d.qpos.assign(np.tile(data.qpos, (warped.d.nworld, 1)).astype(np.float32))


@pytest.mark.parametrize(("size", "value"), [("njmax", 100), ("nconmax", 30)])
def test_too_little_room_is_an_error(size, value):
    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, apart(model, data), bumps(2, pads), loads(2), **{size: value})
    warped.step()
    bring_back(warped, data)
    with pytest.raises(UnsupportedError, match=rf"no room.*call put_worlds with a larger .*{size} \(now {value}; "):
        warped.step()
    with pytest.raises(UnsupportedError, match=size):
        paxisim.warp.check_overflow(warped.d)


def test_later_reads_without_room_are_nan():
    """Reads after the first do not wait for the device, so they cannot raise."""
    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, apart(model, data), bumps(2, pads), loads(2), njmax=100)
    for _ in range(12):
        assert not warped.step().any()
    bring_back(warped, data)
    assert np.isnan(warped.step()).all()
    with pytest.raises(UnsupportedError, match="forces are wrong in 2 of 2 worlds"):
        paxisim.warp.check_overflow(warped.d)


def test_a_state_that_does_not_fit_is_an_error():
    import paxisim.warp

    model, pads, data = held()
    with pytest.raises(InvalidValueError, match=r"the state has 96 contacts and 288 constraint rows"):
        paxisim.warp.put_worlds(model, pads, 2, data=data, device="cpu", njmax=100)


@pytest.mark.parametrize("device", ["cuda:99", "gpu"])
def test_a_device_that_the_machine_lacks(device):
    import paxisim.warp

    model, pads, _ = held()
    with pytest.raises(UnsupportedError, match=f"no device '{device}' here, only cpu.*pass 'cpu'"):
        paxisim.warp.put_worlds(model, pads, 2, device=device)
    with pytest.raises(UnsupportedError, match="NVIDIA's driver"):
        paxisim.warp.WarpTactileReadout(model, pads, 2, device=device)
