"""The live view of a simulation: colours in the model, forces in the corner, and a window or an explanation."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager

import mujoco
import numpy as np
import pytest

from paxisim import InvalidValueError, Pad, TaxelLayout, UnsupportedError, find_pads
from paxisim.viz import view as live

LAYOUT = TaxelLayout(3, 4, 4e-3)
BALL = '<body pos="0 0 -0.0101"><freejoint/><geom type="sphere" size="0.01" mass="0.05"/></body>'


@pytest.fixture(scope="module")
def model():
    """Two pads; gravity pulls a ball into the first."""
    spec = mujoco.MjSpec.from_string(f'<mujoco><option gravity="0 0 9.81"/><worldbody>{BALL}</worldbody></mujoco>')
    for side, x in (("left_", 0.0), ("right_", 0.1)):
        pad = mujoco.MjSpec.from_string(Pad(LAYOUT).to_xml())
        spec.worldbody.add_frame(pos=[x, 0, 0]).attach_body(pad.bodies[1], side, "")
    return spec.compile()


class FakeViewer:
    """Replacement for MuJoCo's window that runs for a number of frames and records what it is shown."""

    def __init__(self, model, data, frames):
        self.model, self.data, self.left = model, data, frames
        self.colors, self.texts, self.times, self.clock = [], [], [], []

    def is_running(self):
        self.left -= 1
        return self.left >= 0

    def set_texts(self, texts):
        self.texts.append(texts)

    def sync(self):
        self.colors.append(self.model.geom_rgba.copy())
        self.times.append(self.data.time)
        self.clock.append(time.perf_counter())


@pytest.fixture
def viewer(monkeypatch):
    opened = []

    @contextmanager
    def window(model, data):
        opened.append(FakeViewer(model, data, frames=40))
        yield opened[-1]

    monkeypatch.setattr(live, "_window", window)
    return opened


def test_the_pressed_taxel_is_the_red_one(model):
    pads = find_pads(model)
    before = model.geom_rgba.copy()
    force = np.zeros(pads.shape)
    force[1, 2, 2, 1] = 0.5
    live.color_taxels(model, pads, force, vmax=0.5)
    after, model.geom_rgba[:] = model.geom_rgba.copy(), before
    pressed = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "right_pad_taxel_2_1")
    saturation = np.ptp(after[pads.geoms, :3], axis=-1)
    assert pads.geoms[saturation > 0.1].tolist() == [pressed]
    others = np.setdiff1d(np.arange(model.ngeom), pads.geoms)
    np.testing.assert_array_equal(after[others], before[others])
    at_rest = after[pads.geoms[0], 0]
    assert at_rest[0] > at_rest[1] == at_rest[4]  # the grid of taxels is visible


def test_the_view_shows_the_forces_in_real_time_and_puts_the_colours_back(model, viewer):
    before = model.geom_rgba.copy()
    live.view(model, mujoco.MjData(model))
    (shown,) = viewer
    np.testing.assert_array_equal(model.geom_rgba, before)
    left, right = (np.ptp(shown.colors[-1][geoms, :3], axis=1) for geoms in find_pads(model).geoms)
    assert left.max() > 0.5
    assert right.max() < 0.1
    # it never runs ahead of the clock; on a busy machine it may fall behind
    assert 0 < shown.times[-1] - shown.times[0] <= shown.clock[-1] - shown.clock[0] + 0.1
    names, values = shown.texts[-1][2:]
    assert names.split("\n") == ["force (N)", "left_pad", "right_pad", "full red"]
    assert float(values.split("\n")[1].split()[2]) > 0
    assert values.split("\n")[2].split() == ["0.00", "0.00", "0.00"]


def test_a_given_scale_stays_and_an_interruption_puts_the_colours_back(model, viewer, monkeypatch):
    before = model.geom_rgba.copy()
    live.view(model, pads=find_pads(model, names=["right_pad"]), vmax=3.0)
    assert viewer[0].texts[-1][3].split()[-1] == "3.00"
    assert viewer[0].data.time > 0

    def interrupt(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(FakeViewer, "sync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        live.view(model)
    np.testing.assert_array_equal(model.geom_rgba, before)


def test_wrong_input_is_refused_before_a_window_opens(model, viewer):
    with pytest.raises(InvalidValueError, match="no pads"):
        live.view(mujoco.MjModel.from_xml_string("<mujoco/>"))
    with pytest.raises(InvalidValueError, match="vmax must be"):
        live.view(model, vmax=0.0)
    with pytest.raises(InvalidValueError, match=r"\(2, 3, 3, 4\), got \(3, 3, 4\)"):
        live.color_taxels(model, find_pads(model), np.zeros((3, 3, 4)), vmax=1.0)
    assert not viewer


def test_a_viewer_that_refuses_to_start_is_reported(model, monkeypatch):
    import mujoco.viewer

    def refuse(model, data):
        raise RuntimeError("`launch_passive` requires that the Python script be run under `mjpython` on macOS")

    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(mujoco.viewer, "launch_passive", refuse)
    with pytest.raises(UnsupportedError, match="mjpython"):
        live.view(model)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
@pytest.mark.parametrize(
    ("display", "message"),
    [({}, "needs a display, but neither DISPLAY nor WAYLAND_DISPLAY is set"), ({"DISPLAY": ":987"}, "OpenGL")],
)
def test_without_a_display_the_view_says_so(tmp_path, display, message):
    (tmp_path / "pad.xml").write_text(Pad(LAYOUT).to_xml())
    code = """
import sys, mujoco
from paxisim.errors import UnsupportedError
from paxisim.viz.view import view
try:
    view(mujoco.MjModel.from_xml_path(sys.argv[1]))
except UnsupportedError as error:
    print(error)
"""
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")} | display
    command = [sys.executable, "-W", "error", "-c", code, str(tmp_path / "pad.xml")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=True)
    assert message in done.stdout
    assert "plot_tactile" in done.stdout
    assert done.stdout.count("\n") == 1
