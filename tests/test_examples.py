"""The examples run as they are and as printed on the pages."""

import json
import os
import re
import runpy
import socket
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import offscreen
import pytest

pytest.importorskip("serial")
pytest.importorskip("termios")  # the emulator is a pseudo-terminal

import paxisim

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))
XARM = ROOT.parent / "shared" / "data" / "hands" / "ufactory_xarm7" / "xarm7.xml"


@pytest.fixture
def printed(tmp_path, monkeypatch, capsys):
    """Return a function that runs an example in a folder of its own and returns its output."""

    def run(script, *words):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [script, *words])
        runpy.run_path(str(EXAMPLES / script), run_name="__main__")
        return capsys.readouterr().out

    return run


def in_process(command, folder):
    """Run a command like a reader with an active environment, in a folder with the examples; return both outputs."""
    (folder / "examples").symlink_to(EXAMPLES)
    environment = os.environ | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]),
    }
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=280)


def test_hello_pad_reads_the_weight(printed):
    pytest.importorskip("matplotlib")
    weight, read = map(float, re.search(r"weight ([\d.]+) N, read ([\d.]+) N", printed("hello_pad.py")).groups())
    assert read == pytest.approx(weight, rel=0.01)
    assert Path("hello_pad.png").exists()


@pytest.mark.slow
def test_custom_gripper_presses_with_its_torque(printed):
    pytest.importorskip("matplotlib")
    read = [float(force) for force in re.findall(r"normal force ([\d.]+) N", printed("custom_gripper.py"))]
    assert read == pytest.approx([0.5 / 0.074] * 3, rel=0.1), "torque over the distance from the hinge to the pad"
    assert Path("custom_gripper.png").exists()


def test_the_gymnasium_environment_keeps_its_contract_and_draws_another_sensor_an_episode(printed):
    pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    example = runpy.run_path(str(EXAMPLES / "gcs_in_gymnasium.py"))
    check_env(example["Squeeze"](), skip_render_check=True)
    env = example["make_env"]()
    readings = []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        for _ in range(5):
            observation, *_, info = env.step(np.zeros(1, np.float32))
        assert info["pressed"] == pytest.approx(5.0, rel=0.02), "half of the range of 10 N"
        readings.append(observation["tactile"])
    assert np.abs(readings[0] - readings[1]).max() > 0.1
    np.testing.assert_array_equal(readings[0], readings[2])
    assert "episode 1" in printed("gcs_in_gymnasium.py")


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_training_by_touch_gets_better(printed):
    pytest.importorskip("stable_baselines3")
    out = printed("sb3_minimal.py", "--steps", "2000")
    before, after = map(float, re.search(r"(-[\d.]+) before, (-[\d.]+) after 2000", out).groups())
    assert after > before + 1


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_record_and_live_makes_files_that_hold_the_presses(printed):
    for module in ("pyarrow", "rerun"):
        pytest.importorskip(module)
    printed("record_and_live.py")
    recording = paxisim.Recording.load("press.mcap").select(known=True)
    total = recording.measured.sum(axis=(-2, -1))[:, 0, 2]
    assert recording.duration == pytest.approx(3, abs=0.3)
    assert total.max() > 50
    assert total.min() < 5
    assert Path("press.rrd").exists()
    assert len(paxisim.Recording.load("press.parquet")) >= len(recording)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_replay_and_diagnose_finds_what_is_hidden(printed):
    for module in ("sklearn", "jinja2"):
        pytest.importorskip(module)
    out = printed("replay_and_diagnose.py")
    assert "The replay met what was measured." in out
    found = paxisim.diagnose.Diagnosis.load("diagnosis")
    assert {cause.name for cause in found.causes} == {"axis_gain", "creep"}
    before, after = map(float, re.search(r"seen: ([\d.]+) N, through the model ([\d.]+) N", out).groups())
    assert after < 0.5 * before


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_a_field_sensor_reads_newtons(printed):
    pytest.importorskip("matplotlib")
    groups = re.search(r"with \[(.*?)\] N, read \[(.*?)\]", printed("calibrate_field_sensor.py")).groups()
    pushed, read = (np.array(text.split(), float) for text in groups)
    np.testing.assert_allclose(read, pushed, atol=0.1)


@pytest.mark.slow
@pytest.mark.real_time
def test_slip_is_found_on_other_skins_and_through_the_driver(printed):
    rates = re.findall(r"finds (\d+)% of (\d+) frames with slip, false alarm in (\d+)%", printed("anyskin_slip.py"))
    assert len(rates) == 5
    *units, live = np.array(rates, int)
    for found, frames, false in units:
        assert found > 80
        assert frames > 100
        assert false < 10
    found, frames, false = live
    assert found > 60, "a busy machine repeats frames"
    assert frames > 50
    assert false < 20


def test_a_box_is_picked_by_touch_whatever_its_weight(printed):
    if not XARM.is_file():
        pytest.skip("the public hands are not here")
    out = printed("pick_by_touch.py", str(XARM))
    lifted = re.findall(
        r"by touch: lifted, weight read (.+?) N, true (.+?) N, slid (.+?) mm\n"
        r"  on the pads (.+?) and (.+?) N, shear (.+?) and (.+?) N",
        out,
    )
    light, heavy = np.array(lifted, float)
    for read, true, slid, *normal, left, right in (light, heavy):
        assert read == pytest.approx(true, rel=0.15), "an axis of the sensor is off by up to 10 %"
        assert left + right == pytest.approx(read, abs=0.11)
        assert slid < 3
        assert min(normal) > 1.9 * max(left, right), "the grip follows the shear"
    np.testing.assert_allclose(light[3:5], 1.5, atol=0.15)
    assert heavy[3:5].min() > 5 * light[3:5].max()
    (rose,) = re.findall(r"1 kg, fixed grip: dropped, the box rose (.+?) mm", out)
    assert float(rose) < 30, "it slips when the table no longer carries it"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], r"name .+ of MuJoCo Menagerie, https://\S+"),
        (["so_arm100.xml"], r"name .+ of MuJoCo Menagerie, https://\S+"),
        (["xarm7.xml"], "no such model file: xarm7.xml"),
        (["xarm7.xml", "-o", "pick.avi"], "a film must end in .webp or .gif, got pick.avi"),
    ],
)
def test_without_its_arm_the_pick_says_where_to_get_one(printed, capsys, words, said):
    with pytest.raises(SystemExit) as stop:
        printed("pick_by_touch.py", *words)
    assert stop.value.code == 2
    assert re.fullmatch(rf"pick_by_touch: error: {said}\n", capsys.readouterr().err)


def test_a_picture_of_the_pick_shows_the_arm_and_the_pads(tmp_path):
    pytest.importorskip("matplotlib")
    from PIL import Image

    if not XARM.is_file():
        pytest.skip("the public hands are not here")
    code = """
import itertools, runpy, sys, mujoco
example = runpy.run_path(sys.argv[1])
robot = example["Robot"](sys.argv[2], mass=0.1, unit=0, by_touch=True)
with mujoco.Renderer(robot.model, example["SIZE"], example["SIZE"]) as renderer:
    for number, _ in enumerate(itertools.islice(example["pick"](robot), 340)):
        if number in (0, 339):
            example["picture"](robot, renderer, "0.1 kg").save(f"{number}.png")
"""
    done = offscreen.python("-c", code, EXAMPLES / "pick_by_touch.py", XARM, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, last = (np.asarray(Image.open(tmp_path / f"{n}.png")).astype(int) for n in (0, 339))
    assert first.shape == last.shape
    assert first[:, :240].std() > 30, "the scene is not blank"
    assert (np.abs(last - first)[:, :240].max(axis=-1) > 60).sum() > 500, "the arm moves"
    red = [(picture[20:210, 270:640, 0] - picture[20:210, 270:640, 1] > 20).sum() for picture in (first, last)]
    assert red[0] < 1000 < red[1], "the pads turn red while they are pressed"


def test_a_notebook_is_kept_without_its_outputs():
    for notebook in NOTEBOOKS:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        assert len(code) >= 5
        assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code), notebook


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs(notebook, tmp_path):
    for module in ("nbclient", "ipykernel", "matplotlib", "sklearn", "jinja2"):
        pytest.importorskip(module)
    code = (
        "import sys, nbformat; from nbclient import NotebookClient; "
        "NotebookClient(nbformat.read(sys.argv[1], 4), timeout=250).execute()"
    )
    done = in_process([sys.executable, "-c", code, str(notebook)], tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.slow
@pytest.mark.real_time
def test_the_joints_of_a_simulated_arm_are_recorded_beside_its_sensor(tmp_path):
    page = (ROOT / "docs" / "guides" / "streams.md").read_text(encoding="utf-8")
    (block,) = [block for block in re.findall(r"```bash\n(.*?)```", page, re.DOTALL) if "simulated_arm.py" in block]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    script = block.replace("5005", str(port)) + "\nkill %1; wait"  # end the background job
    done = in_process(["bash", "-mc", script], tmp_path)
    assert "press.mcap" in done.stdout, done.stdout + done.stderr
    (samples,) = re.findall(rf"UDP {port}: (\d+) samples", done.stdout)
    assert int(samples) > 50 * 6, "datagrams at 100 Hz, or half as many on a slow machine"
    assert "Traceback" not in done.stderr

    recording = paxisim.Recording.load(tmp_path / "press.mcap").select(known=True)
    assert recording.duration > 5
    # the joints match the recorded forces: the pad is loaded if and only if they press it into the ball
    arm = runpy.run_path(str(EXAMPLES / "simulated_arm.py"))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    depth = np.empty(len(recording))
    for i in range(len(recording)):
        for name in arm["JOINTS"]:
            data.joint(name).qpos[:] = recording.covariates[name][i]
        mujoco.mj_kinematics(model, data)
        depth[i] = 0.03 - data.body("hand").xpos[2]
    force = recording.measured.sum(axis=(-2, -1))[:, 0, 2]
    pressed = depth > 0.4e-3
    assert 0.3 < pressed.mean() < 0.9
    # the readings lag by a few ms, during which the hand moves by tenths of a millimetre
    assert np.mean(force[pressed] > 1) > 0.9
    assert np.abs(force[depth < -3e-3]).max() < 0.2 * force.max(), "noise of 120 taxels"
    assert np.corrcoef(np.clip(depth, 0, None), force)[0, 1] > 0.9


def test_the_simulated_arm_wears_a_magnetic_skin():
    arm = runpy.run_path(str(EXAMPLES / "simulated_arm.py"))
    skin = paxisim.MagneticSkin("eflesh")
    worn = arm["Arm"](skin.design.cells, paxisim.Chain(), skin)
    assert worn.reading.shape == (1, 3, 1, 5)
    at_rest = np.abs(worn.reading).max()
    worn.run_until(1.0)  # the first press is held
    assert 1 < worn.load[2] < 10
    assert np.abs(worn.reading).max() > 10 * at_rest
    worn.run_until(sum(arm["PRESSES"][0][1:]) + 2 * arm["MOVE"] + 0.5)
    assert abs(worn.load[2]) < 0.1, "it is lifted again"


@pytest.mark.slow
def test_a_magnetic_unit_is_recorded_and_reads_what_no_simulation_says(printed):
    made = runpy.run_path(str(EXAMPLES / "reference_robot.py"))["recording"]
    first, other = made(7, 2), made(8, 2)
    assert first.measured.shape == first.simulated.shape
    assert len(np.unique(first.episode)) == 2
    np.testing.assert_array_equal(first.simulated, other.simulated)
    assert np.abs(first.measured - other.measured).max() > 0.1, "two units differ"
    # it follows the force, but reads too little of a broad press
    follows = np.corrcoef(first.measured.sum(axis=(1, 3, 4))[:, 2], first.simulated.sum(axis=(1, 3, 4))[:, 2])[0, 1]
    assert follows > 0.8
    assert "measured, simulated" in printed("reference_robot.py", "--out", "robot.mcap", "--episodes", "2")
    assert len(paxisim.Recording.load("robot.mcap")) == len(first)
