"""Arguments of a wrong type, and pads of another model, raise an error that says so."""

from importlib.resources import files

import mujoco
import numpy as np
import pytest

import paxisim

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
LAYOUT = paxisim.TaxelLayout(3, 2, (5e-3, 5e-3))
MOUNT = paxisim.Mount("left_finger", (0, 0, -0.019), (0.5, -0.5, -0.5, 0.5), ("left_fingertip",))


@pytest.fixture(scope="module")
def models():
    """Two models with their pads, of 3x2 and 4x4 taxels."""
    made = []
    for layout in (LAYOUT, paxisim.TaxelLayout(4, 4, (5e-3, 5e-3))):
        gripper = paxisim.attach(GRIPPER, layout, [MOUNT])
        model = gripper.compile()
        made.append((model, gripper.bind(model)))
    return made


@pytest.mark.parametrize("gripper", [3, None, b"<mujoco/>", ["a.xml"]])
def test_a_gripper_that_is_none(gripper):
    with pytest.raises(
        paxisim.InvalidValueError, match="expected an MjSpec, the path of an MJCF file or its text, got"
    ):
        paxisim.attach(gripper, LAYOUT)
    with pytest.raises(paxisim.InvalidValueError, match="expected an MjSpec"):
        paxisim.find_mounts(gripper)


def test_a_compiled_model_is_no_gripper(models):
    with pytest.raises(paxisim.InvalidValueError, match="got MjModel; pass the spec or file it was compiled from"):
        paxisim.attach(models[0][0], LAYOUT)


@pytest.mark.parametrize("sensor", [3, None, (6, 5), paxisim.Gel()])
def test_a_sensor_that_is_none(sensor):
    with pytest.raises(paxisim.InvalidValueError, match="a Pad, a TaxelLayout or the name of a sensor"):
        paxisim.attach(GRIPPER, sensor, [MOUNT])


def test_mounts_that_are_none():
    with pytest.raises(paxisim.InvalidValueError, match=r"mounts must be paxisim.Mount, got 'left_finger'"):
        paxisim.attach(GRIPPER, LAYOUT, ["left_finger"])
    assert paxisim.attach(GRIPPER, LAYOUT, MOUNT).pad_names == ("left_finger_pad",), "a single mount is accepted"


@pytest.mark.parametrize("own", [0, 1])
def test_pads_of_another_model(models, own):
    (model, pads), (_, other) = models[own], models[1 - own]
    for use in (
        lambda pads: paxisim.TactileReadout(model, pads),
        lambda pads: paxisim.TouchGridReadout(model, pads),
        lambda pads: paxisim.Gel().apply(model, pads),
        lambda pads: paxisim.set_surface(model, pads, np.full((3, 2), 1e-3)),
    ):
        with pytest.raises(paxisim.InvalidValueError, match="'left_finger_pad' is not one of this model"):
            use(other)
        with pytest.raises(paxisim.InvalidValueError, match="expected the pads that find_pads or bind give, got str"):
            use("left_finger_pad")
    paxisim.TactileReadout(model, pads)
    with pytest.raises(paxisim.InvalidValueError, match=r"expected a compiled mujoco.MjModel, got MjData"):
        paxisim.TactileReadout(mujoco.MjData(model), pads)


def test_a_pitch_in_millimetres_is_asked_about():
    with pytest.raises(
        paxisim.InvalidValueError, match=r"got 4\.0: taxels of 4 m; were millimetres meant, \(0\.004, 0\.004\)\?"
    ):
        paxisim.TaxelLayout(6, 5, 4.0)
    with pytest.raises(paxisim.InvalidValueError, match=r"\(0\.00435, 0\.00452\)"):
        paxisim.TaxelLayout(6, 5, (4.35, 4.52))
    assert paxisim.TaxelLayout(6, 5, 1.0).pitch == (1.0, 1.0)
