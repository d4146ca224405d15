"""Ranges around the scene parameters that a diagnosis found, drawn into the model of another robot."""

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim.diagnose import Diagnosis, FittedParameter, FoundCause, HeldOut, Interval, Symptoms
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
GRIPPER = ready.gripper(LAYOUT, peg=True)
KNOWN = GRIPPER.parameters()
LEFT, RIGHT = paxisim.find_pads(mujoco.MjModel.from_xml_string(GRIPPER.mjcf)).names


def ranges(**ends):
    """Return ranges of the given parameters of the gripper."""
    return paxisim.SceneRanges(tuple(KNOWN[name] for name in ends), tuple(ends.values()), (LEFT, RIGHT))


def compiled(scene):
    model = mujoco.MjModel.from_xml_string(scene.mjcf)
    pads = paxisim.find_pads(model)
    scene.gel.apply(model, pads)
    return model, pads


VALUES = {
    "friction": 0.6,
    "gel_stiffness": 1.4,
    f"mount_offset_x_{LEFT}": 8e-4,
    f"mount_offset_y_{RIGHT}": -5e-4,
    f"mount_tilt_x_{LEFT}": 0.03,
    f"surface_20_{RIGHT}": 1e-4,
}


def test_a_drawn_model_is_the_one_that_a_scene_with_these_values_compiles_to():
    model, pads = compiled(GRIPPER)
    variation = ranges(**{name: (value, value) for name, value in VALUES.items()}).vary(model, pads, GRIPPER.gel)
    for _ in range(2):  # a draw must not add to the previous one
        drawn = variation.draw(np.random.default_rng(0))
    paxisim.set_surface(model, pads, np.reshape(pads.thickness, (-1, 1, 1)) + drawn.heights)
    wanted, _ = compiled(GRIPPER.with_parameters(**VALUES))
    assert drawn.values == pytest.approx(VALUES)
    for name in ("body_pos", "body_quat", "geom_friction", "geom_solref", "geom_solimp", "geom_pos", "geom_size"):
        np.testing.assert_allclose(getattr(model, name), getattr(wanted, name), atol=1e-6, err_msg=name)
    np.testing.assert_allclose(model.body_invweight0[pads.bodies], wanted.body_invweight0[pads.bodies], rtol=1e-6)


def test_draws_lie_within_their_ranges_and_a_seed_repeats_them():
    wide = ranges(friction=(0.5, 0.9), gel_stiffness=(0.8, 1.1))
    draws = [wide.sample(np.random.default_rng(seed)) for seed in range(200)]
    frictions = [draw["friction"] for draw in draws]
    assert min(frictions) >= 0.5
    assert max(frictions) <= 0.9
    assert np.ptp(frictions) > 0.35
    assert draws[3] == wide.sample(np.random.default_rng(3))


def test_no_ranges_leave_the_model_alone():
    model, pads = compiled(GRIPPER)
    before = model.body_pos.copy(), model.geom_friction.copy(), model.geom_solref.copy()
    drawn = paxisim.SceneRanges().vary(model, pads, GRIPPER.gel).draw(np.random.default_rng(0))
    assert drawn.values == {}
    assert drawn.gel == GRIPPER.gel
    assert not drawn.heights.any()
    for old, new in zip(before, (model.body_pos, model.geom_friction, model.geom_solref), strict=True):
        np.testing.assert_array_equal(old, new)


def diagnosis(scene):
    """Return a hand-made diagnosis that found a friction and an offset in mm."""
    own = [
        FittedParameter("friction", "1", Interval(0.7, 0.65, 0.8)),
        FittedParameter(f"mount_offset_x_{LEFT}", "mm", Interval(0.8)),
    ]
    causes = [
        FoundCause(name, (parameter,), Interval(0.3, 0.2, 0.4), (), "seen")
        for name, parameter in zip(("friction", "mount_offset"), own, strict=True)
    ]
    values = {"friction": 0.7, f"mount_offset_x_{LEFT}": 8e-4}
    return Diagnosis(
        verdict="explained", causes=tuple(causes), heldout=HeldOut(0.2, 0.1, 0.05, "repeated motions", None, ()),
        confidence={}, not_testable={}, symptoms=Symptoms(), advice=(), scene=scene, scene_values=values,
    )  # fmt: skip


def test_a_saved_diagnosis_gives_its_intervals_in_si_units_and_a_value_without_one_stays(tmp_path):
    diagnosis(GRIPPER.with_parameters(friction=0.7)).save(tmp_path)
    loaded = Diagnosis.load(tmp_path)
    found = paxisim.SceneRanges.around(loaded.scene, loaded.scene_intervals)
    by_name = {item.name: ends for item, ends in zip(found.parameters, found.intervals, strict=True)}
    assert by_name == {"friction": (0.65, 0.8), f"mount_offset_x_{LEFT}": (pytest.approx(8e-4), pytest.approx(8e-4))}
    assert paxisim.SceneRanges.around(None, {}) == paxisim.SceneRanges()


def test_bad_ranges_and_pads_that_are_not_there_are_named():
    for ends in ((0.9, 0.5), (np.nan, 1.0), (0.1, np.inf)):
        with pytest.raises(paxisim.InvalidValueError, match="friction"):
            ranges(friction=ends)
    one = ready.indenter(LAYOUT)
    model, pads = compiled(one)
    with pytest.raises(paxisim.UnsupportedError, match="one of the 2 pads of the recorded scene, but this model has 1"):
        ranges(**{f"mount_offset_x_{LEFT}": (0.0, 1e-3)}).vary(model, pads)
