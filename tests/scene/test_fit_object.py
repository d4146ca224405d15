"""Which primitive a hand holds, and how thick it is, from the opening and the distribution of the force."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scene.rigs import path
from scene.test_grasps import HAND, MOUNTS

import paxisim
from paxisim.cli import main
from paxisim.errors import InvalidValueError, UnknownNameError

LAYOUT = paxisim.TaxelLayout(4, 3, (4e-3, 4e-3))
BOX = '<geom type="box" size="0.015 0.015 0.02" mass="0.1"/>'
SHAPES = {
    "box": (BOX, None),
    "box askew": ('<geom type="box" size="0.015 0.02 0.02" euler="0 0 0.02" mass="0.1"/>', None),
    "ball": ('<geom type="sphere" size="0.015" mass="0.1"/>', None),
    "cylinder upright": ('<geom type="cylinder" size="0.015 0.02" mass="0.1"/>', 90),
    "cylinder lying": ('<geom type="cylinder" size="0.015 0.02" euler="90 0 0" mass="0.1"/>', 0),
}


def held(geom, modulus=1e6):
    """Two grasps of an object 30 mm thick, in pads of other cubes than the taxels, with noise and counts."""
    rng = np.random.default_rng(0)
    fine = LAYOUT.subdivide(2, 2)
    model = mujoco.MjModel.from_xml_string(paxisim.attach(HAND.replace(BOX, geom), paxisim.Pad(fine), MOUNTS).to_xml())
    model.opt.gravity[:] = 0
    pads = paxisim.find_pads(model)
    paxisim.Gel(modulus=modulus).apply(model, pads)
    data, readout = mujoco.MjData(model), paxisim.TactileReadout(model, pads)
    steps = np.arange(round(6 / model.opt.timestep)) * model.opt.timestep
    grip = path(steps, [0, 1, 3, 3.5, 4, 4.5, 5.5, 6], [0, 1, 1, 0, 0, 1, 1, 0]) * 0.0205
    forces, opening = [], []
    for k in range(len(steps)):
        data.ctrl[2:] = grip[k]
        if k % 10 == 0:
            mujoco.mj_forward(model, data)
            force = fine.pool_force(readout.read(data), 2, 2)
            forces.append(0.02 * np.rint((force + rng.normal(0, 0.01, force.shape)) / 0.02))
            opening.append(abs(float(np.diff(data.xpos[pads.bodies], axis=0)[0, 0])))
        mujoco.mj_step(model, data)
    streams = {"opening": np.array(opening)}
    return paxisim.Recording(steps[::10], np.array(forces), covariates=streams, layout=LAYOUT, pads=("left", "right"))


@pytest.mark.parametrize("name", SHAPES)
def test_the_shape_is_found_with_its_thickness_whatever_the_gain_of_the_sensor(name):
    geom, angle = SHAPES[name]
    recording = held(geom)
    for gain in (1.0, 0.6):
        read = replace(recording, measured=gain * recording.measured)
        found = paxisim.fit_object(read, "opening", modulus=1e6)
        assert (found.shape, found.grasps, found.alternatives) == (name.split()[0], 2, ())
        assert abs(found.thickness - 0.03) < found.thickness_error < 2.5e-3
        assert found.errors[found.shape] < 0.3
        if angle is not None:
            off = np.degrees(found.angle) - angle
            assert abs((off + 90) % 180 - 90) < 5, "an axis is the same after half a turn"
        else:
            assert np.isnan(found.angle)


def test_what_is_no_primitive_is_said():
    ends = "".join(f'<geom type="sphere" size="0.015" pos="0 {y} 0" mass="0.1"/>' for y in (-0.006, 0.006))
    found = paxisim.fit_object(held(ends), "opening", modulus=1e6)
    assert found.errors[found.shape] > 0.3
    assert "no shape fits well" in str(found) or found.alternatives


def test_the_shell_prints_it_and_names_what_is_wrong(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    recording = held(SHAPES["ball"][0])
    millimetres = 1e3 * recording.covariates["opening"]
    replace(recording, covariates={"opening": millimetres}).save("grasps.mcap")
    words = ["scene", "object", "grasps.mcap", "--opening", "opening", "--modulus-kpa", "1000"]
    assert main([*words, "--unit", "mm"]) == 0
    said = capsys.readouterr().out
    assert "ball, 30" in said
    assert "--object ball:30" in said
    for more, match in [
        (["--unit", "inch"], "inch"),
        (["--opening", "width"], "did you mean|width"),
        (["--modulus-kpa", "-1"], "modulus"),
        ([], "'opening' is 29"),
    ]:
        assert main([*words, *more]) == 2, more
        error = capsys.readouterr().err
        assert error.count("\n") == 1, error
        assert re.search(match, error), error
    for wrong, kind, match in [
        (recording.select(pads=["left"]), InvalidValueError, "two opposite pads"),
        (replace(recording, metadata={"unit": "uT"}), InvalidValueError, "newtons"),
        (replace(recording, layout=None), InvalidValueError, "needs the pitch of the taxels"),
        (replace(recording, measured=0 * recording.measured), InvalidValueError, "no grasp"),
    ]:
        with pytest.raises(kind, match=match):
            paxisim.fit_object(wrong, "opening")
    with pytest.raises(UnknownNameError, match="width"):
        paxisim.fit_object(recording, "width")
