"""The native engine against robosuite's: dynamics of the fingertip, readings of the taxels, episodes."""

import re

import numpy as np
import pytest
from paxisim_insertion import TASKS, InsertionEnv, Parameters
from paxisim_insertion.engines.arm import find_arm, measure_arm
from paxisim_insertion.engines.native import NativeScene
from paxisim_insertion.engines.robosuite import InsertionScene
from paxisim_insertion.engines.scene import Grasp
from paxisim_insertion.shell import command
from paxisim_insertion.transfer import uneven_surface
from paxisim_lab.engines import engines

import paxisim

ENGINES = (InsertionScene, NativeScene)
START = np.array([0.004, -0.003, 0.012])
AWAY = [2.0, 2.0, 0.3]
SOFT, STIFF = Parameters(gel_modulus=100e3), Parameters(gel_modulus=0.7e6)


@pytest.fixture(scope="module")
def scenes():
    """One scene per engine, robosuite's first."""
    return [scene(TASKS["SX-2mm"]) for scene in ENGINES]


@pytest.fixture(scope="module")
def gels():
    """The same scenes, with a soft gel and with one as stiff as the layers of the magnetic pads."""
    return {gel: [scene(TASKS["SX-2mm"], gel) for scene in ENGINES] for gel in (SOFT, STIFF)}


def placed(scene, *, holding):
    """Position of the fingertip after a restart, with the peg in its fingers or far from them."""
    scene.place(START)
    model, data = scene.model_and_data
    data.xfrc_applied[:] = 0
    home = scene.fingertip[0]
    if not holding:
        joint = model.joint("peg").qposadr[0]
        data.qpos[joint : joint + 3] = AWAY
        for _ in range(30):
            scene.move(home)
            data.qpos[joint : joint + 3] = AWAY  # otherwise it falls
    return home


def body(scene, name):
    model, _ = scene.model_and_data
    return next(index for index in range(model.nbody) if model.body(index).name.endswith(name))


def test_the_arm_is_robosuite_s():
    measured, stored = measure_arm(Parameters()), find_arm(Parameters())
    for name in ("inertia", "rates", "friction", "damping"):
        np.testing.assert_allclose(getattr(stored, name), getattr(measured, name), atol=1e-6, err_msg=name)
    light = find_arm(Parameters(armature=0.1))
    assert [arm.inertia[2, 2] for arm in (stored, light)] == pytest.approx([32.6, 12.3], abs=0.1)
    gains = [arm.impedance for arm in (stored, light)]
    assert [gain[0, 2] / gain[2, 2] for gain in gains] == pytest.approx([-0.54, -0.30], abs=0.01), "couples x and z"


def yields(scene, axis, push, **tuned):
    """Displacement of the fingertip between constant forces in both directions along an axis."""
    home = placed(scene, holding=False)
    scene.tune(**({"stiffness": 1.0, "friction": 1.0} | tuned))
    _, data = scene.model_and_data
    at = []
    for force in (-push, push):
        data.xfrc_applied[body(scene, "eef"), axis] = force
        for _ in range(40):
            scene.move(home)
        at.append(scene.fingertip[0])
    data.xfrc_applied[:] = 0
    return at[1] - at[0]


def test_the_fingertips_stiffness(scenes):
    expected, found = (np.array([yields(scene, axis, 20.0) for axis in range(3)]) for scene in scenes)
    largest = np.abs(np.diag(expected))
    assert largest.min() > 1e-3
    np.testing.assert_allclose(found / largest[:, None], expected / largest[:, None], atol=0.05)


@pytest.mark.parametrize("engine", [0, 1], ids=["robosuite", "native"])
def test_a_controller_that_is_off(scenes, engine):
    scene = scenes[engine]
    plain = yields(scene, 2, 20.0)[2]
    assert yields(scene, 2, 20.0, stiffness=0.5)[2] > 1.6 * plain
    assert yields(scene, 2, 20.0, friction=20.0)[2] < 0.7 * plain, "joints with friction yield less"
    placed(scene, holding=False)
    assert yields(scene, 2, 20.0)[2] == pytest.approx(plain, rel=1e-6), "no change persists"


@pytest.mark.parametrize("armature", [5.0, 0.1])
def test_step_responses_in_free_space(armature):
    """A step of 1 cm, sampled every 50 ms for half a second, agrees to 0.3 mm along all axes, even coupled ones."""
    scenes = [scene(TASKS["SX-2mm"], Parameters(armature=armature)) for scene in ENGINES]
    for axis in range(3):
        paths = []
        for scene in scenes:
            home = placed(scene, holding=False)
            path = []
            for _ in range(10):
                scene.move(home + 0.01 * np.eye(3)[axis])
                path.append(scene.fingertip[0] - home)
            paths.append(path)
        expected, found = np.array(paths)
        assert expected[-1, axis] > 8e-3
        np.testing.assert_allclose(found, expected, atol=3e-4, err_msg=f"axis {axis}")


@pytest.mark.parametrize("engine", [0, 1], ids=["robosuite", "native"])
def test_the_fingers_hold_the_handle_where_they_are_to(scenes, engine):
    scene = scenes[engine]
    scene.place(START)
    unmoved = scene.fingertip[0] - scene.hole_top - START
    for grasp in (Grasp(), Grasp((2e-3, 1e-3, -3e-3), 0.03), Grasp((0, -2e-3, 1e-3), -0.05)):
        scene.place(START, grasp)
        peg, rotation = scene.peg
        assert np.arctan2(rotation[0, 2], rotation[2, 2]) == pytest.approx(grasp.lean, abs=1e-3)
        np.testing.assert_allclose(peg, scene.hole_top + START, atol=2e-4)
        middle = peg + rotation @ [0, 0, scene.parameters.peg_length + scene.parameters.handle_height / 2]
        apart = scene.fingertip[0] - middle
        np.testing.assert_allclose(apart[:2], grasp.offset[:2], atol=2e-4)
        assert apart[2] - grasp.offset[2] == pytest.approx(unmoved[2] - 0.0525, abs=2e-4)
        normal = scene.tactile.read()[:, 2].sum(axis=(-2, -1))
        assert normal[0] == pytest.approx(normal[1], rel=1e-3), "both fingers push equally"


def felt(scene, wrench, surface):
    """Reading of the pads and axis of the peg after a wrench has acted on the held peg for half a second."""
    scene.tactile.set_surface(surface)
    home = placed(scene, holding=True)
    _, data = scene.model_and_data
    data.xfrc_applied[body(scene, "peg")] = wrench
    for _ in range(10):
        scene.move(home)
    data.xfrc_applied[:] = 0
    return scene.tactile.read(), scene.peg[1][:, 2]


@pytest.mark.parametrize("gel", [SOFT, STIFF], ids=["soft", "stiff"])
@pytest.mark.parametrize(
    ("wrench", "leans"),
    [
        ((0, 0, 0, 0, 0, 0), False),
        ((3, 0, 3, 0, 0, 0), False),
        ((0, 0, 0, 0.4, 0, 0), True),
        ((0, 0, 0, 0, 0.2, 0), True),
    ],
    ids=["held", "pushed", "tilted between the fingers", "turned along them"],
)
def test_what_the_taxels_feel_of_a_held_peg(gels, gel, wrench, leans):
    """On the stiff gel a peg leans less, and loads depend more on how it has settled in steps of 2 or 5 ms."""
    scenes = gels[gel]
    for bumps in (False, True):
        surface = paxisim.GCS(geometry=bumps).sample_surface(
            np.random.default_rng(3), layout=scenes[0].tactile.pads.layout, pads=2
        )
        (expected, axis), (found, other) = (felt(scene, wrench, surface) for scene in scenes)
        assert (np.hypot(*axis[:2]) > (0.02 if gel is SOFT else 0.003)) == leans
        np.testing.assert_allclose(other, axis, atol=5e-3)
        np.testing.assert_allclose(found.sum(axis=(-2, -1)), expected.sum(axis=(-2, -1)), atol=0.5)
        assert np.abs(found - expected).sum() < (0.05 if gel is SOFT else 0.08) * np.abs(expected).sum()
        assert np.abs(expected[:, 2]).sum(axis=(-2, -1)).min() > 20, "both pads are pressed"


def test_a_surface_beyond_the_compiled_one_loses_no_contacts(scenes):
    _, native = scenes
    high = np.full((2, 6, 5), 3.5e-3)
    native.place(START, surface=high)
    assert native.model_and_data[1].ncon == 60
    high[:, :3] = 1e-3
    native.place(START, surface=high)
    normal = native.tactile.read()[:, 2]
    assert normal[:, :3].max() == 0
    assert normal[:, 3:].min() > 0.5


@pytest.mark.parametrize(("gel", "low", "high"), [(SOFT, 0.05, 0.13), (STIFF, 0.17, 0.35)], ids=["soft", "stiff"])
def test_bumps_change_the_loads_of_a_flat_handle(gels, gel, low, high):
    """On the soft gel less than the gains of taxels do, whose deviation is 0.25, on the stiff one as much."""
    _, scene = gels[gel]
    layout = scene.tactile.pads.layout
    rng = np.random.default_rng(0)
    for draw in (lambda _: paxisim.GCS().sample_surface(rng, layout=layout), lambda s: uneven_surface(s, layout)):
        spreads = []
        for seed in range(10):
            scene.place(START, surface=draw(seed))
            normal = scene.tactile.read()[:, 2]
            assert normal.min() > 0.1, "every taxel touches"
            spreads.append(normal.std(axis=(1, 2)) / normal.mean(axis=(1, 2)))
        assert low < np.mean(spreads) < high


def test_episodes_are_alike_in_both_engines():
    """From the same seed, and with other parameters after a push down onto the base."""
    envs = [InsertionEnv("SQ-2mm", "DT", engine=engine) for engine in ("robosuite", "native")]
    for seed in (1, 2):
        first, second = (env.reset(seed=seed)[0] for env in envs)
        np.testing.assert_allclose(second["privileged"], first["privileged"], atol=3e-4)
        last = [observation["tactile"][-6:] for observation in (first, second)]
        assert np.abs(last[1] - last[0]).sum() < 0.05 * np.abs(last[0]).sum()
        assert envs[0].scene.opening == pytest.approx(envs[1].scene.opening, abs=1e-4)
    other = Parameters(grip_force=15, kp=100, floor=0.02, handle_size=0.025)
    readings = []
    for engine in ("robosuite", "native"):
        env = InsertionEnv("SX-2mm", "DT", engine=engine, parameters=other)
        env.reset(seed=0)
        for _ in range(30):
            observation, *_ = env.step(np.array([0.0, -0.4]))
        readings.append((observation["privileged"][:3], env.reading.sum(axis=(-2, -1))))
    (peg, total), (other_peg, other_total) = readings
    assert total[:, 2].max() < 16
    np.testing.assert_allclose(other_peg, peg, atol=1e-3)
    np.testing.assert_allclose(other_total[:, 2], total[:, 2], rtol=0.1)


def test_the_table_of_the_engines(tmp_path, trained_run, capsys):
    (tmp_path / "SY").symlink_to(trained_run)
    words = ["--tasks", "SX-2mm", "--episodes", "1"]
    assert command(engines, [*words, "--policies", str(tmp_path), "--trials", "1"]) == 0
    shown = capsys.readouterr().out
    assert "-16.2 between them" in shown
    assert "pushes with 49 N down and 26 N along x, and with 24 N down once" in shown
    assert re.search(r"\| SY-2mm GCS, seed 0 \| [01] \(0\..*\) \| [01] \(0\..*\) \|", shown)
    row = next(line for line in shown.splitlines() if line.startswith("| SX-2mm | "))
    median, most, peg = (float(cell) for cell in row.split(" | ")[1:4])
    assert median < 0.1
    assert median < most < 0.5
    assert 0 < peg < 1
    assert command(engines, [*words, "--other", "nudged"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("| SX-2mm | "))
    assert 0 < float(row.split(" | ")[1]) < 0.1
    for wrong in (["--trials", "0"], ["--episodes", "0"], ["--policies", str(tmp_path / "SY")]):
        assert command(engines, wrong) == 2
        assert capsys.readouterr().err.count("\n") == 1
