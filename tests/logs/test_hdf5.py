"""Demonstrations in the HDF5 layout of robosuite and robomimic."""

import json
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

h5py = pytest.importorskip("h5py")

SCENE = """
<mujoco>
  <worldbody>
    <body name="arm">
      <joint name="shoulder" type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" contype="0" conaffinity="0"/>
      <body name="hand" pos=".3 0 0">
        <joint name="finger" type="slide" axis="0 0 1"/>
        <geom size=".02" contype="0" conaffinity="0"/>
      </body>
    </body>
    <body name="cube" pos="1 0 0"><freejoint name="cube_joint"/><geom type="box" size=".02 .02 .02"/></body>
    <body name="ball" pos="-1 0 0"><joint name="ball" type="ball"/><geom size=".02" pos=".1 0 0"/></body>
  </worldbody>
  <actuator><motor joint="shoulder"/><motor joint="finger"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("how", ["storage", "link", "a group's link", "a link behind a link", "virtual"])
def test_what_is_in_another_file_is_not_read(tmp_path, how):
    secret = tmp_path / "secret"
    secret.write_bytes(b"password" * 100)
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        file["values"] = np.arange(100.0)
        file["obs/values"] = np.arange(100.0)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        group = file.create_group("data/demo_0")
        file["data"].attrs["env_args"] = '{"env_kwargs": {"control_freq": 20}}'
        group["actions"] = np.zeros(100)
        if how == "storage":
            group.create_dataset("obs/x", (100,), "u1", external=[(str(secret), 0, 100)])
        elif how == "link":
            group["obs/x"] = h5py.ExternalLink("other.hdf5", "/values")
        elif how == "a group's link":
            group["obs"] = h5py.ExternalLink("other.hdf5", "/obs")
        elif how == "a link behind a link":
            file["away"] = h5py.ExternalLink("other.hdf5", "/values")
            group["obs/x"] = h5py.SoftLink("/away")
        else:
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.hdf5"), "values", (100,))
            group.create_virtual_dataset("obs/x", layout)
    np.savez(tmp_path / "b.npz", time=np.arange(100) / 20, measured=np.zeros((100, 1, 3, 1, 1)))
    with pytest.raises(
        InvalidValueError, match=r"a.hdf5: data/demo_0/obs\S* is not in this file but refers to another"
    ):
        Recording.load(tmp_path / "b.npz", streams=tmp_path / "a.hdf5")


def demonstration(samples, seed):
    """Return flattened states as in robosuite, the actions, and position and velocity of each joint by name."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.time = 5.0 * seed  # the simulation has run before
    rng = np.random.default_rng(seed)
    states, actions, joints = [], [], []
    for _ in range(samples):
        actions.append(rng.uniform(-1, 1, model.nu))
        states.append(np.concatenate([[data.time], data.qpos, data.qvel]))
        joints.append({name: data.joint(name).qpos.copy() for name in ("shoulder", "finger", "cube_joint", "ball")})
        joints[-1] |= {f"{name}.velocity": data.joint(name).qvel.copy() for name in list(joints[-1])}
        data.ctrl[:] = actions[-1]
        for _ in range(25):
            mujoco.mj_step(model, data)
    return np.array(states), np.array(actions), joints


def write(path, demos, attributes=None, **obs):
    """Write ``demos`` of (number, states or None, actions); `obs` are functions of the number of samples."""
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs.update(attributes or {})
        for number, states, actions in demos:
            group = data.create_group(f"demo_{number}")
            group.attrs["num_samples"] = len(actions)
            group.create_dataset("actions", data=actions)
            if states is not None:
                group.attrs["model_file"] = SCENE
                group.create_dataset("states", data=states, compression="gzip")
            for name, values in obs.items():
                group.create_dataset(f"obs/{name}", data=values(len(actions)))


def tactile(samples):
    return np.arange(samples * 2 * 3 * 2 * 4, dtype=np.float32).reshape(samples, 2, 3, 2, 4)


def test_a_simulated_demonstration_is_a_recording(tmp_path):
    first, second = demonstration(8, 1), demonstration(5, 2)
    images = {"image": lambda n: np.zeros((n, 4, 4, 3), np.uint8)}
    opening = {"opening": lambda n: np.arange(n) * 0.001}
    write(
        tmp_path / "demo.hdf5",
        [(10, *second[:2]), (2, *first[:2])],
        robot0_tactile=tactile,
        **opening,
        **images,
    )
    recording = Recording.load(tmp_path / "demo.hdf5")
    assert recording.episode.tolist() == [2] * 8 + [10] * 5  # sorted as numbers, not as text
    np.testing.assert_allclose(recording.time[:8], np.arange(8) * 0.05, atol=1e-9)
    assert recording.time[8] == 0
    assert recording.measured is None
    np.testing.assert_array_equal(recording.simulated[8:], tactile(5))
    assert recording.metadata["scene"] == SCENE
    joints = [*first[2], *second[2]]
    expected = {*joints[0], "actions", "opening"}
    assert set(recording.covariates) == expected
    for name in joints[0]:
        values = np.array([sample[name] for sample in joints])
        np.testing.assert_array_equal(recording.covariates[name], values[:, 0] if values.shape[1] == 1 else values)
    np.testing.assert_array_equal(recording.covariates["actions"], np.concatenate([first[1], second[1]]))
    recording.save(tmp_path / "a.mcap")
    np.testing.assert_array_equal(Recording.load(tmp_path / "a.mcap").simulated, recording.simulated)


def test_a_robots_demonstration_has_its_time_from_the_control_rate(tmp_path):
    actions = np.ones((6, 7))
    about = {"env_args": json.dumps({"env_name": "Real", "env_kwargs": {"control_freq": 20}})}
    write(tmp_path / "real.h5", [(0, None, actions)], about, tactile=tactile)
    recording = Recording.load(tmp_path / "real.h5")
    np.testing.assert_allclose(recording.time, np.arange(6) * 0.05)
    np.testing.assert_array_equal(recording.measured, tactile(6))
    assert recording.simulated is None
    write(tmp_path / "real.h5", [(0, None, actions)], tactile=tactile)
    with pytest.raises(InvalidValueError, match="demo_0 has no time: expected states, or a control_freq in env_args"):
        Recording.load(tmp_path / "real.h5")


def test_states_of_another_scene_stay_together(tmp_path):
    states, actions, _ = demonstration(4, 1)
    write(tmp_path / "demo.hdf5", [(0, states[:, :-1], actions)], tactile=tactile)
    recording = Recording.load(tmp_path / "demo.hdf5")
    np.testing.assert_array_equal(recording.covariates["states"], states[:, :-1])


def test_joints_are_added_episode_by_episode(tmp_path):
    states, actions, joints = demonstration(21, 1)
    write(tmp_path / "demo.hdf5", [(3, states, actions)])
    time = 100 + np.arange(11) * 0.1  # at half the rate, on a separate clock
    Recording(time, np.zeros((11, 1, 3, 1, 1)), episode=np.full(11, 3)).save(tmp_path / "press.npz")
    covariates = Recording.load(tmp_path / "press.npz", streams=tmp_path / "demo.hdf5").covariates
    np.testing.assert_allclose(covariates["shoulder"], [sample["shoulder"][0] for sample in joints[::2]], atol=1e-6)
    assert covariates["cube_joint"].shape == (11, 7)
    with pytest.raises(
        InvalidValueError, match=r"has no tensor: expected a dataset of shape \(T, pads, 3, rows, cols\)"
    ):
        Recording.load(tmp_path / "demo.hdf5")


def test_files_that_are_none_are_named(tmp_path):
    path = tmp_path / "a.hdf5"
    path.write_text("time,joint")
    with pytest.raises(InvalidValueError, match=r"a.hdf5 is not a complete HDF5 file"):
        Recording.load(path)
    with h5py.File(path, "w") as file:
        file["observations/qpos"] = np.zeros(3)
    with pytest.raises(
        InvalidValueError, match="no demonstrations: expected groups data/demo_N, it holds observations"
    ):
        Recording.load(path)
    states, actions, _ = demonstration(4, 1)
    write(path, [(0, states, actions[:3])], tactile=tactile)
    with pytest.raises(InvalidValueError, match="demo_0: actions has 3 samples, time has 4"):
        Recording.load(path)
    write(path, [(0, states, actions), (1, states, actions[:, :1])], tactile=tactile)
    with pytest.raises(InvalidValueError, match=r"demo_1 differs from .*demo_0 in actions"):
        Recording.load(path)
    write(path, [(0, states, actions)], left=tactile, right=tactile)
    with pytest.raises(InvalidValueError, match="two tensors, obs/left and obs/right"):
        Recording.load(path)
    with h5py.File(path, "w") as file:
        file["data/demo_0/states/what"] = states
    with pytest.raises(InvalidValueError, match=r"a.hdf5 is not a complete HDF5 file of robosuite or robomimic"):
        Recording.load(path)
    with h5py.File(path, "w") as file:  # a declared size whose values are not stored
        file.create_dataset("data/demo_0/states", shape=(10**9, 50), dtype=float)
    with pytest.raises(InvalidValueError, match=r"states has shape \(1000000000, 50\), but its values are not stored"):
        Recording.load(path)
    whole = tmp_path / "b.hdf5"
    write(whole, [(0, states, actions)], tactile=tactile)
    path.write_bytes(whole.read_bytes()[:3000])
    with pytest.raises(InvalidValueError, match=r"a.hdf5 is not a complete HDF5 file"):
        Recording.load(path)


def test_a_small_file_that_becomes_large_or_has_many_names_is_refused(tmp_path):
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        part = file.create_dataset("data/demo_0/obs/x", (2**18, 600), "u1", chunks=(2**9, 600))
        part[: 2**9] = 1  # the rest is not stored
    assert path.stat().st_size < 2**20
    with pytest.raises(InvalidValueError, match=r"unpacks to \d{10} bytes or more, expected at most 2147483648"):
        Recording.load(path)
    with h5py.File(path, "w") as file:
        file["one"] = np.zeros(3)
        for number in range(2001):
            file[f"data/demo_0/obs/{number}"] = file["one"]
    with pytest.raises(InvalidValueError, match=r"a.hdf5 has more than 2000 streams"):
        Recording.load(path)


def test_a_damaged_heap_of_texts_does_not_hang(tmp_path):
    states, actions, _ = demonstration(4, 1)
    write(tmp_path / "a.hdf5", [(0, states, actions)], {"env_args": '{"a": 1}'}, tactile=tactile)
    content = bytearray((tmp_path / "a.hdf5").read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 16 : heap + 32] = bytes(16)  # an object of size 0
    (tmp_path / "a.hdf5").write_bytes(content)
    with pytest.raises(InvalidValueError, match="a heap of texts is damaged"):
        Recording.load(tmp_path / "a.hdf5")


def test_without_h5py_the_error_names_the_extra(tmp_path):
    states, actions, _ = demonstration(4, 1)
    write(tmp_path / "demo.hdf5", [(0, states, actions)], tactile=tactile)
    code = f"""
import sys
sys.modules["h5py"] = None  # as if it were not installed
from paxisim.cli import main
sys.exit(main(["info", {str(tmp_path / "demo.hdf5")!r}]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "needs h5py, which is not installed: pip install 'paxisim[hdf5]'" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.robosuite
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # robosuite leaves a file open
def test_states_of_robosuite_have_its_joints(tmp_path):
    robosuite = pytest.importorskip("robosuite")
    env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False)
    env.reset()
    states, positions = [], []
    for _ in range(3):
        states.append(env.sim.get_state().flatten())
        positions.append(env.sim.data.get_joint_qpos("robot0_joint4"))
        env.step(np.full(env.action_dim, 0.3))
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        group = file.create_group("data/demo_1")
        group.attrs["model_file"] = env.sim.model.get_xml()
        group["states"] = states
        group["obs/tactile"] = tactile(3)
    env.close()
    covariates = Recording.load(tmp_path / "demo.hdf5").covariates
    np.testing.assert_array_equal(covariates["robot0_joint4"], positions)
    assert covariates["cube_joint0"].shape == (3, 7)
    assert "gripper0_right_finger_joint1.velocity" in covariates
