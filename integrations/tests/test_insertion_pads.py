"""Spherical taxels under flat and round objects, compared with a bed of springs computed by hand."""

import mujoco
import numpy as np
import pytest
from paxisim_insertion.engines.pads import PAD, ScenePads
from paxisim_insertion.tasks import PARAMETERS, Parameters
from paxisim_robosuite.gripper import DEFAULT_SENSOR
from scipy.integrate import quad
from scipy.optimize import brentq

import paxisim

RADIUS = 15e-3
THICKNESS = 3.3e-3
SOFT, STIFF = (Parameters(gel_modulus=100e3), 8.0), (Parameters(gel_modulus=1.09e6), 30.0)
"""A gel, and a load (N) small enough that no spring reaches the range where the gel stiffens."""

OBJECTS = {
    "flat": 'type="box" size="0.015 0.0175 0.015"',
    "round": f'type="cylinder" size="{RADIUS} 0.0175" euler="90 0 0"',
}
SCENE = """
<mujoco>
  <option timestep="0.005" cone="elliptic" impratio="20"/>
  <worldbody>
    <frame name="pad"/>
    <body name="object" pos="0 0 -0.0155">
      <joint type="slide" axis="0 0 1" damping="200"/>
      <geom {} mass="0.5"/>
    </body>
  </worldbody>
</mujoco>
"""


def felt(kind, pad, parameters, load):
    """Normal forces (N) of the taxels of a pad under an object with a load."""
    spec = mujoco.MjSpec.from_string(SCENE.format(OBJECTS[kind]))
    spec.attach(mujoco.MjSpec.from_string(pad.to_xml()), frame=spec.frame("pad"), prefix="")
    model = spec.compile()
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)  # as in the scenes
    tactile = ScenePads(model, data, paxisim.find_pads(model), parameters)
    data.qfrc_applied[0] = load
    mujoco.mj_step(model, data, 400)
    return tactile.read()[0, 2]


def of_springs(kind, parameters, load):
    """Normal forces (N) of a bed of springs that fills the pad, with the object's axis along its rows."""
    layout, stiffness = PAD.layout, parameters.gel_modulus / THICKNESS

    def column(middle, depth):
        def pressure(x):
            rise = 0.0 if kind == "flat" else RADIUS - np.sqrt(RADIUS**2 - x**2)
            return stiffness * max(depth - rise, 0.0)

        half = layout.pitch[1] / 2
        return layout.pitch[0] * quad(pressure, middle - half, middle + half, limit=200)[0]

    middles = layout.positions[: layout.cols, 0]
    depth = brentq(lambda d: layout.rows * sum(column(x, d) for x in middles) - load, 1e-6, 3e-3)
    return np.tile([column(x, depth) for x in middles], (layout.rows, 1))


def error(kind, pad, gel):
    """Return how far the loads of the taxels are from those of springs, as a share of the load."""
    _, load = gel
    found = felt(kind, pad, *gel)
    assert found.sum() == pytest.approx(load, rel=1e-3)
    return np.abs(found - of_springs(kind, *gel)).sum() / load


@pytest.mark.parametrize("kind", OBJECTS)
def test_balls_feel_what_a_bed_of_springs_feels(kind):
    assert error(kind, PAD, SOFT) < 0.03


def test_on_the_gel_of_the_tasks_balls_feel_most_of_what_springs_feel():
    """At the tasks' grip, cubes are off by almost half of the load."""
    assert error("flat", PAD, (PARAMETERS, 30.0)) < 0.01
    assert error("round", PAD, (PARAMETERS, 30.0)) < 0.1
    assert error("round", DEFAULT_SENSOR, (PARAMETERS, 30.0)) > 0.4


def test_cubes_feel_a_round_object_worse():
    """The tasks use balls because a cube makes a single contact there, for which the gel is too soft."""
    assert error("round", DEFAULT_SENSOR, SOFT) > 0.1


def test_on_a_stiff_gel_taxels_beside_the_axis_of_a_round_object_feel_too_little():
    """A ball has one spring, at the middle of its taxel; the object presses the near edge of the taxel deeper."""
    assert error("flat", PAD, STIFF) < 0.01
    assert 0.2 < error("round", PAD, STIFF) < 0.35
    assert error("round", DEFAULT_SENSOR, STIFF) > 0.6
