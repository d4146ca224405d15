"""Recordings and scenes that do not fit each other are refused in one line, before anything is simulated."""

import numpy as np
import pytest
from scene.rigs import LAYOUT, press, recording

import paxisim
from paxisim import Drive, InvalidValueError, ObjectStart, Recording, Scene, UnknownNameError, UnsupportedError
from paxisim.scene import ready

TIME, STREAMS = press(seconds=1.0)
SCENE = ready.indenter(LAYOUT)
MJCF = SCENE.mjcf


def refused(match, scene=SCENE, recorded=None, **options):
    """Assert that a replay is refused in one line in which `match` is found."""
    with pytest.raises((InvalidValueError, UnknownNameError, UnsupportedError), match=match) as caught:
        scene.simulate(recording(TIME, STREAMS) if recorded is None else recorded, **options)
    assert "\n" not in str(caught.value)


def changed(**streams):
    """Return the press with some of its streams replaced."""
    return recording(TIME, {**STREAMS, **streams})


def without(begin, end):
    """Return the depth with a gap."""
    depth = STREAMS["depth"].copy()
    depth[begin:end] = np.nan
    return depth


def driven(**changed):
    return Scene(MJCF, [Drive("depth", **{"joint": "depth", "unit": "m", **changed})])


HINGE = """<mujoco><worldbody><body name="b"><joint name="h" range="-90 90" limited="true"/><geom size=".03"/>
  </body></worldbody></mujoco>"""
NO_PADS = """<mujoco><worldbody><body name='b'><joint name='j' type='slide'/><geom size='.1'/></body></worldbody>
  </mujoco>"""


def test_a_drive_that_the_mjcf_lacks_or_cannot_move():
    refused(
        r"unknown joint of the drive of 'depth' 'dept'; did you mean 'depth'\?; the MJCF's joints are: x, y, depth",
        driven(joint="dept"),
    )
    refused("unknown actuator of the drive of 'depth' 'z'", driven(joint="", actuator="z"))
    refused("'ball' cannot be driven by a pose", driven(joint="", body="ball"))
    refused("the model has no pads", Scene(NO_PADS, [Drive("depth", joint="j", unit="m")]))
    refused("no such model file", Scene("none.xml", [Drive("depth", joint="j")]))
    refused("unknown parameter of a scene 'modulos'; did you mean 'modulus'", modulos=1.0)
    refused("modulus must be positive", modulus=-1.0)


def test_units_that_are_off_are_recognised():
    for factor, unit in ((1e3, "mm"), (1e6, "um")):
        scaled = {name: values * factor for name, values in STREAMS.items()}
        refused(f'its values are {unit}, not m: set unit = "{unit}"', recorded=recording(TIME, scaled))
    refused('look like m, not mm: set unit = "m"', driven(unit="mm"))
    model = paxisim.attach(HINGE, LAYOUT, [paxisim.Mount("b", replaces=(0,))]).to_xml()
    turned = recording(TIME, {"angle": np.linspace(0, 60, len(TIME))})
    refused('are deg, not rad: set unit = "deg"', Scene(model, [Drive("angle", joint="h", unit="rad")]), turned)


def test_a_stream_beyond_the_ends_of_its_curve_is_refused_and_a_better_unit_named():
    refused(
        r"gives the curve of joint 'depth' from .* beyond its limits -0.0005 to 0.001; check unit, scale and offset",
        driven(curve=[(-5e-4, 0.0), (1e-3, 1e-3)]),
    )
    millimetres = changed(depth=1e3 * STREAMS["depth"])
    refused('its values are mm, not m: set unit = "mm"', driven(curve=[(-1e-3, 0.0), (2e-3, 1e-3)]), millimetres)


def test_streams_that_cannot_drive_the_scene():
    missing = {name: STREAMS[name] for name in ("x", "y")}
    refused("unknown stream 'depth'", recorded=recording(TIME, missing))
    far = changed(depth=STREAMS["depth"] + 0.02)
    refused("moves joint 'depth' from 0.0195 to 0.02.*beyond its limits -0.1 to 0.004", recorded=far)
    still = {name: np.zeros_like(TIME) for name in STREAMS}
    refused("nothing would move: the driving streams", recorded=recording(TIME, still))
    refused("'depth' holds no number", recorded=changed(depth=without(0, 100)))
    wide = recording(TIME, {"depth": np.zeros((len(TIME), 7))})
    refused(r"must be \(T,\) to drive joint 'depth'", driven(), wide)
    refused(r"'depth' has a gap in episode 0, from 0.390 s to 0.600 s", recorded=changed(depth=without(40, 60)))
    lost = {**STREAMS, "depth": without(50, 100)}
    two = recording(TIME, lost, episode=np.repeat([4, 7], 50))
    refused("episode 7 is without a start pose: stream 'depth'", recorded=two)
    pads = recording(TIME, STREAMS, pads=2)
    refused("the recording has 2 pads of 6x5 taxels, the scene 1 of 6x5: name", recorded=pads)
    fine = Recording(TIME, np.zeros((len(TIME), 1, 3, 12, 10), np.float32), covariates=STREAMS)
    refused(r"pool the recording with Recording.pool\(2, 2\)", recorded=fine)


def test_samples_before_and_after_the_streams_are_not_simulated():
    late = STREAMS["depth"].copy()
    late[:10] = late[90:] = np.nan
    simulated = SCENE.simulate(recording(TIME, {**STREAMS, "depth": late})).simulated
    known = np.isfinite(simulated).all(axis=(1, 2, 3, 4))
    np.testing.assert_array_equal(np.flatnonzero(known), np.arange(10, 90))


def test_objects_that_cannot_be_placed():
    held = ready.gripper(LAYOUT, peg=True)
    opening = {"opening": 0.03 + 0.001 * np.sin(TIME)}
    recorded = recording(TIME, opening, pads=2)
    nowhere = Scene(held.mjcf, held.drives, start=[ObjectStart("pge", (0, 0, 0))])
    refused("unknown body to start 'pge'; did you mean 'peg'", nowhere, recorded)
    refused(
        "it has no free joint", Scene(held.mjcf, held.drives, start=[ObjectStart("gripper_hand", (0, 0, 0))]), recorded
    )
    streamed = Scene(held.mjcf, held.drives, start=[ObjectStart("peg", stream="peg")])
    refused("unknown stream 'peg'", streamed, recorded)
    lost = recording(TIME, {**opening, "peg": np.full((len(TIME), 7), np.nan)}, pads=2)
    refused("episode 0 is without a start pose of 'peg'", streamed, lost)


def test_a_simulation_that_becomes_unstable():
    held = ready.gripper(LAYOUT, peg=True)
    wild = str(held.mjcf).replace('timestep="0.002"', 'timestep="0.02"')
    opening = 0.0233 + 0.01 * np.sin(40 * TIME)
    with pytest.raises((UnsupportedError, InvalidValueError)) as caught:
        Scene(wild, held.drives, start=held.start).simulate(recording(TIME, {"opening": opening}, pads=2))
    assert "\n" not in str(caught.value)
