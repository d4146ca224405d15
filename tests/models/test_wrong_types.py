"""Arguments of a wrong type, and pads of another model, raise an error that says so."""

import mujoco
import numpy as np
import pytest
from scenes import OWN_GRIPPER, fingertips

import paxisim

LAYOUT = paxisim.TaxelLayout(3, 2, (5e-3, 5e-3))
MOUNT = fingertips()[0]


@pytest.fixture(scope="module")
def models():
    """Two models with their pads, of 3x2 and 4x4 taxels."""
    made = []
    for layout in (LAYOUT, paxisim.TaxelLayout(4, 4, (5e-3, 5e-3))):
        gripper = paxisim.attach(OWN_GRIPPER, layout, [MOUNT])
        model = gripper.compile()
        made.append((model, gripper.bind(model)))
    return made


def test_arguments_of_attach_and_find_mounts(models):
    for gripper in (3, None, b"<mujoco/>", ["a.xml"]):
        for use in (lambda text: paxisim.attach(text, LAYOUT), paxisim.find_mounts):
            with pytest.raises(paxisim.InvalidValueError, match="expected an MjSpec, the path of an MJCF file or its"):
                use(gripper)
    with pytest.raises(paxisim.InvalidValueError, match="got MjModel; pass the spec or file it was compiled from"):
        paxisim.attach(models[0][0], LAYOUT)
    for sensor in (3, None, (6, 5), paxisim.Gel()):
        with pytest.raises(paxisim.InvalidValueError, match="a Pad, a TaxelLayout or the name of a sensor"):
            paxisim.attach(OWN_GRIPPER, sensor, [MOUNT])
    with pytest.raises(paxisim.InvalidValueError, match=r"mounts must be paxisim.Mount, got 'left_finger'"):
        paxisim.attach(OWN_GRIPPER, LAYOUT, ["left_finger"])
    assert paxisim.attach(OWN_GRIPPER, LAYOUT, MOUNT).pad_names == ("left_finger_pad",), "a single mount is accepted"


@pytest.mark.parametrize("own", [0, 1])
def test_pads_of_another_model(models, own):
    (model, _), (_, other) = models[own], models[1 - own]
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
    with pytest.raises(paxisim.InvalidValueError, match=r"expected a compiled mujoco.MjModel, got MjData"):
        paxisim.TactileReadout(mujoco.MjData(model), other)
