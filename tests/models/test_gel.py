"""Gel: pressing measures the stiffness, damping and friction that were specified."""

import itertools

import mujoco
import numpy as np
import pytest
from scenes import PAPER, POOLED, compiled, plate_under_pad, set_options, settle, with_pad

from paxisim import GaussianBump, Gel, InvalidValueError, Layer, Pad, TactileReadout, TaxelLayout, find_pads
from paxisim.layer.contact import pressed
from paxisim.models.gel import STIFFENING

CONES = ["elliptic", "pyramidal"]


def pressed_stiffness(pad, force, seconds=0.4, **scene):
    """Return force over indentation (N/m) of a plate pressed onto the whole pad."""
    model, _, data = plate_under_pad(pad, **scene)
    settle(model, data, force, seconds)
    assert abs(data.qvel[0]) < 1e-5, "not at rest"
    return force / data.qpos[0]


def stated_stiffness(pad):
    return pad.layout.taxels * pad.gel.stiffness(pad.layout)


# stiffness


def test_units():
    layout = TaxelLayout(2, 2, (4e-3, 5e-3))
    assert Gel(modulus=30e3, thickness=1e-3).stiffness(layout) == pytest.approx(600)
    assert Gel(modulus=30e3, thickness=2e-3).stiffness(layout) == pytest.approx(300)
    gel = Gel.per_taxel(750, layout, relaxation=0.03, friction=0.6)
    assert gel.stiffness(layout) == pytest.approx(750)
    assert (gel.relaxation, gel.friction) == (0.03, 0.6)
    assert Gel().stiffness(POOLED) == pytest.approx(596, abs=1)
    assert Gel() == Gel(100e3, 3.3e-3, 0.04, 1.0) != Gel(friction=0.9)
    assert hash(Gel()) == hash(Gel())


def test_springs_of_a_layer_sink_under_a_plate_as_the_layer_does():
    layer = Layer(0.2e6, 0.48, 3e-3)
    gap, fine = np.zeros(24 * 20), TaxelLayout(24, 20, (26.1e-3 / 24, 22.6e-3 / 20))
    _, depth = pressed(layer.compliance(fine), gap, 8.0)
    assert 8.0 / pressed_stiffness(Pad(POOLED, gel=Gel.of(layer, POOLED)), 8.0) == pytest.approx(depth, rel=0.02)
    one = Pad(TaxelLayout(1, 1, POOLED.pitch), gel=Gel.of(layer, POOLED, "taxel"))
    alone = layer.compliance(one.layout)[0, 0]  # under an even load, which yields a little more than under a face
    assert 0.85 < 1 / (alone * pressed_stiffness(one, 0.5)) < 1


ALL_SCENES = list(itertools.product([0.1, 0.5, 5.0], [1e-3, 2e-3], CONES, [1, 10], [1.0, 20.0]))
SOME_SCENES = [ALL_SCENES[i] for i in (0, 13, 22, 27, 34, 47)]  # every value of each


@pytest.mark.parametrize("scenes", [SOME_SCENES, pytest.param(ALL_SCENES, marks=pytest.mark.slow)], ids=["some", "all"])
def test_pressing_measures_the_stated_stiffness(scenes):
    pad = Pad(POOLED)
    for mass, timestep, cone, impratio, force in scenes:
        measured = pressed_stiffness(pad, force, mass=mass, timestep=timestep, cone=cone, impratio=impratio)
        where = f"{mass} kg, {timestep} s, {cone}, impratio {impratio}, {force} N"
        assert measured == pytest.approx(stated_stiffness(pad), rel=0.01), where
    # a file is for an object of 0.1 kg
    as_filed = pressed_stiffness(pad, 2.0, mass=0.1, apply=False, timestep=2e-3)
    assert as_filed == pytest.approx(stated_stiffness(pad), rel=0.05)


@pytest.mark.parametrize(
    ("layout", "gel"),
    [
        (POOLED, Gel(modulus=40e3)),
        (POOLED, Gel(modulus=1e6, relaxation=0.02)),
        (POOLED, Gel(modulus=60e3, thickness=2e-3, friction=0.3)),
        (POOLED, Gel(relaxation=0.1)),
        (POOLED, Gel.per_taxel(5000.0, POOLED, relaxation=0.01, friction=0.5)),
        (POOLED, Gel(friction=2.0)),
        (PAPER, Gel()),
    ],
)
@pytest.mark.parametrize("cone", CONES)
def test_every_gel_has_its_own_stiffness_whatever_the_number_of_taxels(layout, gel, cone):
    pad = Pad(layout, gel=gel)
    assert stated_stiffness(pad) == pytest.approx(stated_stiffness(Pad(POOLED, gel=gel)))
    seconds = max(0.4, 12 * gel.relaxation)
    assert pressed_stiffness(pad, 4.9, seconds, cone=cone) == pytest.approx(stated_stiffness(pad), rel=0.01)


@pytest.mark.parametrize("taxels", ["boxes", "spheres"])
@pytest.mark.parametrize(("modulus", "timestep"), [(100e3, 5e-3), (1.09e6, 2e-3), (1.09e6, 5e-3)])
def test_a_stiff_gel_is_no_softer_under_a_light_object(taxels, modulus, timestep):
    """MuJoCo adds the inverse weight of the object to that of the pad."""
    pad = Pad(POOLED, gel=Gel(modulus=modulus), taxels=taxels)
    for mass in (0.02, 0.5):
        measured = pressed_stiffness(pad, 4.9, 0.6, mass=mass, timestep=timestep)
        within = 0.03 if taxels == "spheres" or mass > 0.02 else 0.06
        assert measured == pytest.approx(stated_stiffness(pad), rel=within), f"{mass} kg"


def test_what_the_object_is_made_of_does_not_matter():
    pad = Pad(POOLED)
    for attributes in (
        'solref="0.001 1" friction="0.01 0.1 0.1"',
        'condim="6" friction="3 1 1" margin="0"',
        'solref="-100 -1" solimp="0.1 0.2 0.01" priority="1"',
        'condim="1" friction="0.01 0.1 0.1" solmix="1000" priority="7"',
    ):
        measured = pressed_stiffness(pad, 4.9, attributes=attributes)
        assert measured == pytest.approx(stated_stiffness(pad), rel=0.01), attributes


def test_a_pad_on_a_finger_is_as_stiff_as_one_on_the_world():
    """The pad presses on a fixed plate, or on a heavy one that is free in all directions."""
    pad = Pad(POOLED)
    for plate in ("", "<freejoint/>"):
        world = f"""<mujoco><option gravity='0 0 0'/><worldbody><body name='finger' pos='0 0 0.5' quat='0 1 0 0'>
          <joint name='slide' type='slide' axis='0 0 1' armature='0.3' damping='5'/>
          <geom type='box' size='0.01 0.01 0.01' mass='0.1' contype='0' conaffinity='0'/></body>
          <body pos='0 0 0.51'>{plate}<geom name='plate' type='box' size='0.05 0.05 0.01' mass='20'/></body>
          </worldbody></mujoco>"""
        model = with_pad(world, pad, body="finger").compile()
        pads = find_pads(model)
        pad.gel.apply(model, pads)
        data = mujoco.MjData(model)
        # the finger is upside down: its +z is the world's -z, and its pad faces up to the plate
        settle(model, data, -6.0, 0.5)
        normal = TactileReadout(model, pads).read_exact(data)[0, 2].sum()
        depth = data.site("p_pad_gel").xpos[2] + 0.5e-3 - (data.geom("plate").xpos[2] - 0.01)
        assert normal / depth == pytest.approx(stated_stiffness(pad), rel=0.02)
        assert plate or normal == pytest.approx(6.0, rel=1e-3)


def test_linear_to_two_fifths_of_the_thickness_then_ever_stiffer():
    for thickness in (2e-3, 3.3e-3):
        pad = Pad(POOLED, gel=Gel(modulus=50e3, thickness=thickness))
        linear = 30 * pad.gel.stiffness(POOLED) * thickness
        assert pressed_stiffness(pad, 0.4 * linear) == pytest.approx(stated_stiffness(pad), rel=0.02)
        assert pressed_stiffness(pad, linear) > 1.5 * stated_stiffness(pad)
        through = pressed_stiffness(pad, 4 * linear, mass=20.0)
        assert 5 * stated_stiffness(pad) < through < STIFFENING * stated_stiffness(pad)


@pytest.mark.parametrize("layout", [POOLED, PAPER], ids=["6x5", "12x10"])
@pytest.mark.parametrize("shape", ['type="sphere" size="0.008"', 'type="ellipsoid" size="0.012 0.01 0.006"'])
def test_a_round_object_under_20_newtons_does_not_go_through(layout, shape):
    pad = Pad(layout)
    world = f"""<mujoco><worldbody><body name='probe' pos='0.0003 0.0002 -0.0081'>
      <joint type='slide' axis='0 0 1'/><geom {shape} mass='0.1'/></body></worldbody></mujoco>"""
    model = with_pad(world, pad).compile()
    set_options(model, impratio=10)
    pads = find_pads(model)
    pad.gel.apply(model, pads)
    data = mujoco.MjData(model)
    settle(model, data, 20.0, 1.0)
    assert TactileReadout(model, pads).read_exact(data)[0, 2].sum() == pytest.approx(20, rel=1e-3)


# damping


def pressed_over_time(pad, force, seconds, **scene):
    """Return indentation over its final value, after each step under a load applied at once."""
    model, _, data = plate_under_pad(pad, **scene)
    data.qfrc_applied[0] = force
    depths = []
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        depths.append(data.qpos[0])
    return np.array(depths) / (force / stated_stiffness(pad))


def kelvin_voigt(pad, mass, timestep, steps):
    """Return the same from the equation of motion, in steps too small for the integration scheme to matter."""
    stiffness, fine = stated_stiffness(pad), 100
    position = speed = 0.0
    shares = []
    for _ in range(steps):
        for _ in range(fine):
            pull = 1 - position - pad.gel.relaxation * speed  # net force over the final force
            speed += timestep / fine * pull * stiffness / mass
            position += timestep / fine * speed
        shares.append(position)
    return np.array(shares)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize(("relaxation", "timestep"), [(0.01, 1e-3), (0.02, 2e-3), (0.1, 2e-3)])
def test_a_step_load_is_answered_as_by_springs_and_dampers(relaxation, timestep, cone):
    pad = Pad(POOLED, gel=Gel(relaxation=relaxation))
    shares = pressed_over_time(pad, 5.0, 4 * relaxation, mass=2.0, timestep=timestep, cone=cone)
    expected = kelvin_voigt(pad, 2.0, timestep, len(shares))
    np.testing.assert_allclose(shares, expected, atol=0.07)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("mass", [0.1, 0.5, 5.0])
def test_a_load_is_approached_and_kept(mass, cone):
    """A light plate outruns the time step at first: 5 N throw 0.1 kg past the equilibrium."""
    shares = pressed_over_time(Pad(POOLED), 5.0, 0.5, mass=mass, cone=cone)
    assert shares.max() < (1.5 if mass < 0.5 else 1.02), "overshoot"
    np.testing.assert_allclose(shares[100:], 1, atol=0.02)
    after_peak = shares[shares.argmax() :]
    assert np.abs(np.diff(after_peak)).sum() < 2 * (after_peak[0] - after_peak[-1]) + 0.02, "no ringing"


@pytest.mark.parametrize("timestep", [1e-3, 2e-3])
def test_an_impact_is_caught_without_tunnelling(timestep):
    model, _, data = plate_under_pad(Pad(POOLED), timestep=timestep)
    data.qpos[0], data.qvel[0] = -0.5e-3, 0.2
    depths = []
    for _ in range(round(0.3 / timestep)):
        mujoco.mj_step(model, data)
        depths.append(data.qpos[0])
    assert 0 < max(depths) < 1e-3
    assert depths[-1] < max(depths)


# friction


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("friction", [0.5, 1.0])
def test_friction_holds_below_its_limit_and_slides_with_its_coefficient_above(friction, cone):
    pad = Pad(POOLED, gel=Gel(friction=friction))
    scene = {"joint": "zx", "cone": cone, "impratio": 10.0, "attributes": 'friction="3 0.1 0.1"', "size": 0.3}
    model, pads, data = plate_under_pad(pad, **scene)
    readout = TactileReadout(model, pads)
    settle(model, data, (4.9, 0.0), 0.4)
    settle(model, data, (4.9, 0.8 * friction * 4.9), 0.4)
    held = data.qvel[1]
    assert readout.read_exact(data)[0, 0].sum() == pytest.approx(0.8 * friction * 4.9, rel=0.01)
    assert 0 < held < (1e-3 if cone == "elliptic" else 50e-3)
    settle(model, data, (4.9, 1.5 * friction * 4.9), 0.2)
    assert data.qvel[1] - held == pytest.approx(0.5 * friction * 4.9 / 0.5 * 0.2, rel=0.25)
    # dragged at 0.2 m/s
    settle(model, data, (4.9, 0.0), 0.1)
    for _ in range(200):
        data.qvel[1] = 0.2
        mujoco.mj_step(model, data)
        readout.accumulate(data)
    force = readout.mean()[0].sum(axis=(1, 2))
    assert force[2] == pytest.approx(4.9, rel=0.03)
    assert force[0] == pytest.approx(friction * force[2], rel=0.02)
    assert abs(force[1]) < 0.01


def creep(gel=None, **options):
    """Return the creep speed (m/s) of a plate that is pressed with 4.9 N and sheared with 1 N."""
    model, _, data = plate_under_pad(Pad(POOLED, gel=gel or Gel()), joint="zx", **options)
    settle(model, data, (4.9, 1.0), 0.3)
    before = data.qpos[1]
    settle(model, data, (4.9, 1.0), 0.2)
    return (data.qpos[1] - before) / 0.2


def test_a_held_object_creeps_slowly_with_the_inverse_of_stiffness_times_relaxation():
    """As the docstring of `Gel` warns, a gel that relaxes fast lets a held object slide."""
    base = creep()
    assert 0 <= creep(impratio=10) < 0.2e-3
    assert base < 2e-3
    assert creep(cone="pyramidal") < 5e-3
    assert creep(Gel(relaxation=0.01)) == pytest.approx(4 * base, rel=0.1)
    assert creep(Gel(modulus=200e3)) == pytest.approx(base / 2, rel=0.1)


# the default gel: most taxels of a gently bumped pad carry load


@pytest.mark.parametrize(("layout", "depth_is"), [(POOLED, "thickness"), (PAPER, "recess")], ids=["6x5", "12x10"])
def test_a_flat_load_lights_most_taxels_of_a_bumped_pad_unevenly(layout, depth_is):
    for seed in range(3):
        bump = GaussianBump.sample(layout, np.random.default_rng(seed), depth_is=depth_is)
        pad = Pad(layout, heights=bump.heights(layout))
        # without `apply`, the gel in the file assumes an object of 0.1 kg, so it is too stiff for a peg of 0.5 kg
        for apply, share in ((True, 0.8), (False, 0.6)):
            model, pads, data = plate_under_pad(pad, apply=apply)
            data.qpos[0] = 1e-3 - pad.heights.max()
            settle(model, data, 4.9, 0.4)
            normal = TactileReadout(model, pads).read(data)[0, 2]
            assert normal.sum() == pytest.approx(4.9, rel=0.01)
            assert np.mean(normal > 5e-3) >= share, f"seed {seed}"
            assert normal.max() > 1.5 * normal.min()


# what apply writes


def test_apply_changes_the_taxels_and_nothing_else_and_twice_is_once():
    model, pads, _ = plate_under_pad(Pad(POOLED), apply=False)
    before = {n: getattr(model, n).copy() for n in dir(model) if isinstance(getattr(model, n), np.ndarray)}
    gel = Gel(modulus=1e5, friction=0.4)
    gel.apply(model, pads)
    changed = {n for n, value in before.items() if not np.array_equal(value, getattr(model, n))}
    assert changed == {"geom_solref", "geom_solimp", "geom_friction", "body_invweight0"}
    kept = {"geom": np.setdiff1d(np.arange(model.ngeom), pads.geoms)}
    kept["body"] = np.setdiff1d(np.arange(model.nbody), pads.bodies)
    for name in changed:
        rows = kept[name[:4]]
        np.testing.assert_array_equal(getattr(model, name)[rows], before[name][rows])
    np.testing.assert_array_equal(model.geom_friction[pads.geoms[0], 0], 0.4)
    once = {name: getattr(model, name).copy() for name in changed}
    gel.apply(model, pads)
    for name, value in once.items():
        np.testing.assert_array_equal(getattr(model, name), value)


# bad input


def test_bad_values():
    for value in (0, -1.0, float("nan"), float("inf"), "1e5", True):
        for name in ("modulus", "thickness", "relaxation", "friction"):
            with pytest.raises(InvalidValueError, match=f"a gel's {name} must be positive and finite, got"):
                Gel(**{name: value})
    for value in (0, -590.0, float("nan")):
        with pytest.raises(InvalidValueError, match="positive and finite"):
            Gel.per_taxel(value, POOLED)


def test_a_relaxation_that_the_time_step_cannot_resolve():
    model, pads = compiled(Pad(POOLED), timestep=2e-3)
    before = model.geom_solref.copy()
    with pytest.raises(InvalidValueError, match=r"at least 2 time steps \(0\.004 s here\), got 0\.0039 s"):
        Gel(relaxation=3.9e-3).apply(model, pads)
    np.testing.assert_array_equal(model.geom_solref, before)
    Gel(relaxation=4e-3).apply(model, pads)
    model.opt.timestep = 1e-3
    Gel(relaxation=2e-3).apply(model, pads)
