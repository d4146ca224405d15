"""Spherical taxels: they are found again, act like a bed of springs, and can be raised like boxes."""

import mujoco
import numpy as np
import pytest
from pressing import attached

import paxisim

LAYOUT = paxisim.TaxelLayout(4, 5, (4e-3, 3e-3))
GEL = paxisim.Gel(modulus=200e3)
DEPTH = 0.8e-3
PLATE = ('type="box" size="0.05 0.05 0.01"', 0.01)
BALL = ('type="sphere" size="0.02"', 0.02)


def sphere_pad(layout=LAYOUT, thickness=3e-3, **more):
    return paxisim.Pad(layout, thickness=thickness, taxels="spheres", gel=GEL, **more)


def pressed(pad, shape, heights=None):
    """Return the normal forces (N) under an object held at a depth of `DEPTH`."""
    geom, half = shape
    text = f"""<mujoco><option timestep="0.001" cone="elliptic" impratio="10" gravity="0 0 0"/><worldbody>
    <body name="plate"/><body pos="0 0 {half - DEPTH}"><joint type="slide" axis="0 0 1" armature="1e6"/><geom {geom}/>
    </body></worldbody></mujoco>"""
    model, pads, data = attached(text, pad, paxisim.Mount("plate", quat=(0, 1, 0, 0), name="pad"))
    if heights is not None:
        paxisim.set_surface(model, pads, heights)
    for _ in range(400):
        data.qpos[0] = data.qvel[0] = 0.0
        mujoco.mj_step(model, data)
    return paxisim.TactileReadout(model, pads).read(data)[0, 2]


def test_a_saved_pad_of_spheres_is_found_again():
    model = mujoco.MjModel.from_xml_string(sphere_pad().to_xml())
    pads = paxisim.find_pads(model)
    assert pads.layout == LAYOUT
    assert pads.thickness[0] == pytest.approx(3e-3)
    assert set(model.geom_type[pads.geoms[0]]) == {int(mujoco.mjtGeom.mjGEOM_SPHERE)}


def test_a_plate_loads_every_sphere_with_the_gels_stiffness_and_a_raised_one_more():
    stiffness = GEL.stiffness(LAYOUT)
    np.testing.assert_allclose(pressed(sphere_pad(), PLATE), stiffness * DEPTH, rtol=0.02)
    heights = np.full((4, 5), 3e-3)
    heights[1, 2] += 2e-4
    compiled, raised = pressed(sphere_pad(heights=heights), PLATE), pressed(sphere_pad(), PLATE, heights)
    np.testing.assert_allclose(raised, compiled, rtol=1e-3)
    assert compiled[1, 2] == pytest.approx(stiffness * (DEPTH + 2e-4), rel=0.02)


def test_under_a_ball_spheres_add_up_to_the_bed_and_boxes_do_not():
    fine = paxisim.TaxelLayout(16, 20, (1e-3, 0.75e-3))
    bed = pressed(sphere_pad(fine), BALL).sum()
    assert pressed(sphere_pad(), BALL).sum() == pytest.approx(bed, rel=0.08)
    # a ball makes one contact with a box instead of four, at its nearest corner, so the box is four times softer
    assert pressed(paxisim.Pad(LAYOUT, gel=GEL), BALL).sum() < 0.7 * bed


def test_only_boxes_and_spheres_and_no_touch_grid_of_spheres():
    with pytest.raises(ValueError, match="boxes"):
        paxisim.Pad(LAYOUT, taxels="cubes")
    with pytest.raises(ValueError, match="touch_grid"):
        sphere_pad(sensors="touch_grid")
