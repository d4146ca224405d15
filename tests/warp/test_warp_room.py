"""Room for contacts: that of put_worlds is enough, and too little is an error that names the size to raise."""

import copy

import mujoco
import numpy as np
import pytest
from held import held, needs_warp, warped

import paxisim
from paxisim.errors import InvalidValueError, UnsupportedError

pytestmark = needs_warp


@pytest.mark.parametrize(("cone", "rows"), [("elliptic", 3), ("pyramidal", 4)])
def test_there_is_room_for_five_contacts_a_taxel(cone, rows):
    scene = held(cone=cone)
    worlds, taxels = warped(scene), scene[1].geoms.size
    assert worlds.d.naconmax >= 2 * 5 * taxels
    assert worlds.d.njmax >= rows * 5 * taxels
    for _ in range(3):
        worlds.step()
    assert worlds.d.nefc.numpy().max() < worlds.d.njmax


def apart(model, pads, data):
    """The scene with the object away from the pads, where it has no contacts."""
    state = copy.copy(data)
    state.qpos[model.joint("object").qposadr[0]] += 1.0
    mujoco.mj_forward(model, state)
    assert state.ncon == 0
    return model, pads, state


def bring_back(worlds, data):
    worlds.d.qpos.assign(np.tile(data.qpos, (worlds.d.nworld, 1)).astype(np.float32))


@pytest.mark.parametrize(("size", "value"), [("njmax", 100), ("nconmax", 30)])
def test_too_little_room_is_an_error(size, value):
    scene = held()
    worlds = warped(apart(*scene), **{size: value})
    worlds.step()
    bring_back(worlds, scene[2])
    with pytest.raises(UnsupportedError, match=rf"no room.*call put_worlds with a larger .*{size} \(now {value}; "):
        worlds.step()
    with pytest.raises(UnsupportedError, match=size):
        paxisim.warp.check_overflow(worlds.d)


def test_later_reads_without_room_are_nan():
    """Reads after the first do not wait for the device, so they cannot raise."""
    scene = held()
    worlds = warped(apart(*scene), njmax=100)
    for _ in range(12):
        assert not worlds.step().any()
    bring_back(worlds, scene[2])
    assert np.isnan(worlds.step()).all()
    with pytest.raises(UnsupportedError, match="forces are wrong in 2 of 2 worlds"):
        paxisim.warp.check_overflow(worlds.d)


def test_states_and_devices_that_do_not_fit_are_errors():
    model, pads, data = held()
    with pytest.raises(InvalidValueError, match=r"the state has 96 contacts and 288 constraint rows"):
        paxisim.warp.put_worlds(model, pads, 2, data=data, device="cpu", njmax=100)
    for device in ("cuda:99", "gpu"):
        with pytest.raises(UnsupportedError, match=f"no device '{device}' here, only cpu.*pass 'cpu'"):
            paxisim.warp.put_worlds(model, pads, 2, device=device)
        with pytest.raises(UnsupportedError, match="NVIDIA's driver"):
            paxisim.warp.WarpTactileReadout(model, pads, 2, device=device)
