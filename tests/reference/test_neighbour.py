"""The field of the facing pad: against an independent package, by symmetry, and in a sensor."""

import numpy as np
import pytest

import paxisim
from paxisim import MagneticSensor
from paxisim.reference.neighbour import Facing, facing_field
from paxisim.reference.pad import MagneticPad

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))


@pytest.fixture(scope="module")
def units():
    return [MagneticPad.unit(LAYOUT, seed).made for seed in (7000, 7001)]


@pytest.mark.parametrize("opening", [0.0, 18e-3])
def test_the_field_is_magpylibs_of_a_pad_turned_by_half_a_turn(units, opening):
    magpylib = pytest.importorskip("magpylib", reason="needs magpylib; install the test extra")
    from scipy.spatial.transform import Rotation

    unit, other = units
    pad = magpylib.Collection(
        [magpylib.misc.Dipole(moment=m, position=p) for m, p in zip(other.moments.T, other.magnets.T, strict=True)]
    )
    pad.rotate(Rotation.from_euler("y", 180, degrees=True), anchor=(0, 0, 0)).move((0, 0, -opening))
    np.testing.assert_allclose(facing_field(unit, other, opening).T, pad.getB(unit.sensors.T), rtol=1e-6, atol=1e-12)


def test_pads_of_a_gripper_face_each_other_so():
    """The pads differ by half a turn about y, as in the gripper scene: x and z are opposite, y is the same."""
    import mujoco

    from paxisim.scene import ready

    model = mujoco.MjModel.from_xml_string(str(ready.gripper(LAYOUT).mjcf))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pads = paxisim.find_pads(model)
    left, right = (data.body(name).xmat.reshape(3, 3) for name in pads.bodies)
    np.testing.assert_allclose(left.T @ right, np.diag([-1.0, 1.0, -1.0]), atol=1e-9)


def test_nominal_pads_read_each_other_as_symmetrically_as_they_face(units):
    nominal = MagneticPad(LAYOUT).made
    field = facing_field(nominal, nominal, 20e-3).reshape(3, 6, 5)
    np.testing.assert_allclose(field[:, :, ::-1], field * np.array([-1, 1, 1])[:, None, None], atol=1e-12)
    np.testing.assert_allclose(field[:, ::-1], field * np.array([1, -1, 1])[:, None, None], atol=1e-12)
    assert np.all(field[2] < 0)  # the other pad's magnets point the other way


def test_the_polynomial_is_the_field_at_any_opening(units):
    facing = Facing(units)
    openings = np.array([0.0, 0.3e-3, 4e-3, 18e-3, 24e-3, 80e-3, 1.0])
    change = facing.change(openings)
    largest = np.abs(facing_field(*units, 0.0)).max()
    for index, opening in enumerate(openings):
        for pad, (unit, other) in enumerate((units, units[::-1])):
            exact = facing_field(unit, other, opening)
            np.testing.assert_allclose(change[pad, index], exact, atol=1e-4 * largest)
            far = np.abs(exact).max()
            if opening <= 0.1:
                assert np.abs(change[pad, index] - exact).max() < 0.01 * far


def test_a_sensor_reads_its_neighbour_from_where_it_was_zeroed():
    sensor = MagneticSensor(LAYOUT, unit=7, covariate="gripper_opening", zeroed_at=0.08)
    alone = MagneticSensor(LAYOUT, unit=7)
    force = np.random.default_rng(0).uniform(0, 0.3, (4, 2, 3, 6, 5))
    assert sensor.covariate_names == ("gripper_opening",)
    np.testing.assert_allclose(sensor(force, {"gripper_opening": 0.08}), alone(force), atol=1e-12)
    closed = sensor(force, {"gripper_opening": 0.018}) - alone(force)
    assert 0.01 < np.abs(closed).max() < 1.0
    np.testing.assert_allclose(closed, closed[:1].repeat(4, 0), atol=1e-9)  # independent of the load
    openings = np.array([0.08, 0.05, 0.018, 0.0])
    each = sensor(force, {"gripper_opening": openings})
    np.testing.assert_allclose(each[2], sensor(force[2], {"gripper_opening": 0.018}), atol=1e-12)
    spread = sensor(force[0], {"gripper_opening": openings})  # one frame at many openings
    np.testing.assert_allclose(spread[3], sensor(force[0], {"gripper_opening": 0.0}), atol=1e-12)
    series = sensor.run(force, np.arange(4) / 10, {"gripper_opening": openings})
    np.testing.assert_allclose(series, each, atol=1e-12)
    torch = pytest.importorskip("torch")
    tensor = sensor(torch.as_tensor(force), {"gripper_opening": torch.as_tensor(openings)})
    np.testing.assert_allclose(tensor.numpy(), each, atol=1e-9)


def test_what_has_no_neighbour_is_told():
    sensor = MagneticSensor(LAYOUT, unit=7, covariate="gripper_opening")
    for make, words in (
        (lambda: sensor(np.zeros((2, 3, 6, 5))), "needs the covariate"),
        (lambda: sensor(np.zeros((3, 3, 6, 5)), {"gripper_opening": 0.02}), "got 3"),
        (lambda: MagneticSensor(LAYOUT, unit=7, zeroed_at=-1.0), "zeroed_at"),
    ):
        with pytest.raises(paxisim.InvalidValueError, match=words):
            make()
