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


def refused(match, scene=SCENE, recorded=None, kind=InvalidValueError, **options):
    with pytest.raises(kind, match=match) as caught:
        scene.simulate(recording(TIME, STREAMS) if recorded is None else recorded, **options)
    assert "\n" not in str(caught.value)


def driven(**changed):
    return Scene(MJCF, [Drive("depth", **{"joint": "depth", "unit": "m", **changed})])


def test_a_joint_that_the_mjcf_lacks():
    refused(
        r"unknown joint of the drive of 'depth' 'dept'; did you mean 'depth'\?; the MJCF's joints are: x, y, depth",
        driven(joint="dept"),
        kind=UnknownNameError,
    )


def test_a_body_or_actuator_that_cannot_be_driven():
    refused("unknown actuator of the drive of 'depth' 'z'", driven(joint="", actuator="z"), kind=UnknownNameError)
    refused("'ball' cannot be driven by a pose", driven(joint="", body="ball"))


def test_a_stream_that_is_not_recorded():
    missing = {name: STREAMS[name] for name in ("x", "y")}
    refused("unknown stream 'depth'", recorded=recording(TIME, missing), kind=UnknownNameError)


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "mm"), (1e6, "um")])
def test_units_that_are_off_are_recognised(factor, unit):
    scaled = {name: values * factor for name, values in STREAMS.items()}
    refused(f'its values are {unit}, not m: set unit = "{unit}"', recorded=recording(TIME, scaled))


def test_metres_that_are_taken_for_millimetres_are_recognised():
    refused('look like m, not mm: set unit = "m"', driven(unit="mm"))


def test_degrees_are_recognised():
    hinge = """<mujoco><worldbody><body name="b"><joint name="h" range="-90 90" limited="true"/><geom size=".03"/>
      </body></worldbody></mujoco>"""
    model = paxisim.attach(hinge, LAYOUT, [paxisim.Mount("b", replaces=(0,))]).to_xml()
    turned = recording(TIME, {"angle": np.linspace(0, 60, len(TIME))})
    refused('are deg, not rad: set unit = "deg"', Scene(model, [Drive("angle", joint="h", unit="rad")]), turned)


def test_a_motion_beyond_the_limits_of_its_joint():
    far = {**STREAMS, "depth": STREAMS["depth"] + 0.02}
    refused("moves joint 'depth' from 0.0195 to 0.02.*beyond its limits -0.1 to 0.004", recorded=recording(TIME, far))


def test_streams_that_drive_nothing():
    still = {name: np.zeros_like(TIME) for name in STREAMS}
    refused("nothing would move: the driving streams", recorded=recording(TIME, still))
    unknown = {**STREAMS, "depth": np.full_like(TIME, np.nan)}
    refused("'depth' holds no number", recorded=recording(TIME, unknown))
    refused(r"must be \(T,\) to drive joint 'depth'", recorded=recording(TIME, {"depth": np.zeros((len(TIME), 7))}),
            scene=driven())  # fmt: skip


def test_a_gap():
    gap = STREAMS["depth"].copy()
    gap[40:60] = np.nan
    refused(
        r"'depth' has a gap in episode 0, from 0.390 s to 0.600 s", recorded=recording(TIME, {**STREAMS, "depth": gap})
    )


def test_an_episode_without_a_start_pose():
    episode = np.repeat([4, 7], len(TIME) // 2)
    lost = STREAMS["depth"].copy()
    lost[episode == 7] = np.nan
    refused(
        "episode 7 is without a start pose: stream 'depth'",
        recorded=recording(TIME, {**STREAMS, "depth": lost}, episode=episode),
    )


def test_samples_before_and_after_the_streams_are_not_simulated():
    late = STREAMS["depth"].copy()
    late[:10] = late[90:] = np.nan
    simulated = SCENE.simulate(recording(TIME, {**STREAMS, "depth": late})).simulated
    known = np.isfinite(simulated).all(axis=(1, 2, 3, 4))
    np.testing.assert_array_equal(np.flatnonzero(known), np.arange(10, 90))


def test_pads_that_are_not_the_recordings():
    two = recording(TIME, STREAMS, pads=2)
    refused("the recording has 2 pads of 6x5 taxels, the scene 1 of 6x5: name", recorded=two)
    fine = Recording(TIME, np.zeros((len(TIME), 1, 3, 12, 10), np.float32), covariates=STREAMS)
    refused(r"pool the recording with Recording.pool\(2, 2\)", recorded=fine)


def test_a_model_without_pads_or_that_is_none(tmp_path):
    refused("the model has no pads", Scene("<mujoco><worldbody><body name='b'><joint name='j' type='slide'/><geom "
            "size='.1'/></body></worldbody></mujoco>", [Drive("depth", joint="j", unit="m")]))  # fmt: skip
    refused("no such model file", Scene(tmp_path / "none.xml", [Drive("depth", joint="j")]))


def test_a_parameter_that_is_none():
    refused("unknown parameter of a scene 'modulos'; did you mean 'modulus'", kind=UnknownNameError, modulos=1.0)
    refused("modulus must be positive", modulus=-1.0)


def test_objects_that_cannot_be_placed():
    held = ready.gripper(LAYOUT, peg=True)
    opening = {"opening": 0.03 + 0.001 * np.sin(TIME)}
    recorded = recording(TIME, opening, pads=2)
    nowhere = Scene(held.mjcf, held.drives, start=[ObjectStart("pge", (0, 0, 0))])
    refused("unknown body to start 'pge'; did you mean 'peg'", nowhere, recorded, UnknownNameError)
    refused(
        "it has no free joint", Scene(held.mjcf, held.drives, start=[ObjectStart("gripper_hand", (0, 0, 0))]), recorded
    )
    streamed = Scene(held.mjcf, held.drives, start=[ObjectStart("peg", stream="peg")])
    refused("unknown stream 'peg'", streamed, recorded, UnknownNameError)
    lost = recording(TIME, {**opening, "peg": np.full((len(TIME), 7), np.nan)}, pads=2)
    refused("episode 0 is without a start pose of 'peg'", streamed, lost)


def test_a_simulation_that_becomes_unstable():
    held = ready.gripper(LAYOUT, peg=True)
    wild = str(held.mjcf).replace('timestep="0.002"', 'timestep="0.02"')
    opening = 0.0233 + 0.01 * np.sin(40 * TIME)
    with pytest.raises((UnsupportedError, InvalidValueError)) as caught:
        Scene(wild, held.drives, start=held.start).simulate(recording(TIME, {"opening": opening}, pads=2))
    assert "\n" not in str(caught.value)
