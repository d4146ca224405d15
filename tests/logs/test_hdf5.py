"""Demonstrations in the HDF5 layout of robosuite and robomimic."""

import json
import sys

import mujoco
import numpy as np
import pytest
from log_files import refused

from paxisim.cli import main
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
    write(
        tmp_path / "demo.hdf5",
        [(10, *second[:2]), (2, *first[:2])],
        robot0_tactile=tactile,
        opening=lambda n: np.arange(n) * 0.001,
        image=lambda n: np.zeros((n, 4, 4, 3), np.uint8),
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


def test_a_robots_demonstration_has_its_time_from_the_control_rate(tmp_path):
    actions = np.ones((6, 7))
    about = {"env_args": json.dumps({"env_name": "Real", "env_kwargs": {"control_freq": 20}})}
    write(tmp_path / "real.h5", [(0, None, actions)], about, tactile=tactile)
    recording = Recording.load(tmp_path / "real.h5")
    np.testing.assert_allclose(recording.time, np.arange(6) * 0.05)
    np.testing.assert_array_equal(recording.measured, tactile(6))
    assert recording.simulated is None
    write(tmp_path / "real.h5", [(0, None, actions)], tactile=tactile)
    refused(tmp_path / "real.h5", "demo_0 has no time: expected states, or a control_freq in env_args")


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
    refused(tmp_path / "demo.hdf5", r"has no tensor: expected a dataset of shape \(T, pads, 3, rows, cols\)")


def outside(file, how, folder):
    """Make ``data/demo_0/obs`` or a data set in it lie in another file."""
    name = "data/demo_0/obs/x"
    if how == "storage":
        file.create_dataset(name, (100,), "u1", external=[(str(folder / "secret"), 0, 100)])
    elif how == "link":
        file[name] = h5py.ExternalLink("other.hdf5", "/values")
    elif how == "a group's link":
        file["data/demo_0/obs"] = h5py.ExternalLink("other.hdf5", "/obs")
    elif how == "a link behind a link":
        file["away"] = h5py.ExternalLink("other.hdf5", "/values")
        file[name] = h5py.SoftLink("/away")
    else:
        layout = h5py.VirtualLayout((100,), "f8")
        layout[:] = h5py.VirtualSource(str(folder / "other.hdf5"), "values", (100,))
        file.create_virtual_dataset(name, layout)


@pytest.mark.parametrize("how", ["storage", "link", "a group's link", "a link behind a link", "virtual"])
def test_what_is_in_another_file_is_not_read(tmp_path, how):
    (tmp_path / "secret").write_bytes(b"password" * 100)
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        for name in ("values", "obs/values"):
            file[name] = np.arange(100.0)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["data/demo_0/actions"] = np.zeros(100)
        file["data"].attrs["env_args"] = '{"env_kwargs": {"control_freq": 20}}'
        outside(file, how, tmp_path)
    np.savez(tmp_path / "b.npz", time=np.arange(100) / 20, measured=np.zeros((100, 1, 3, 1, 1)))
    word = r"a.hdf5: data/demo_0/obs\S* is not in this file but refers to another"
    refused(tmp_path / "b.npz", word, streams=tmp_path / "a.hdf5")


def hdf5(path, **values):
    """Write a file of data sets, whose names have double underscores for slashes."""
    with h5py.File(path, "w") as file:
        for name, array in values.items():
            file[name.replace("__", "/")] = array


def damaged_heap(path):
    """Write a file whose heap of texts holds an object of size 0, in which HDF5's own reader hangs."""
    states, actions, _ = demonstration(4, 1)
    write(path, [(0, states, actions)], {"env_args": '{"a": 1}'}, tactile=tactile)
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 16 : heap + 32] = bytes(16)
    path.write_bytes(content)


def test_files_that_are_none_are_named(tmp_path):
    states, actions, _ = demonstration(4, 1)
    write(tmp_path / "whole.hdf5", [(0, states, actions)], tactile=tactile)
    whole = (tmp_path / "whole.hdf5").read_bytes()
    short = [(0, states, actions[:3])]
    both = [(0, states, actions), (1, states, actions[:, :1])]
    for make, word in (
        (lambda path: path.write_text("time,joint"), "a.hdf5 is not a complete HDF5 file"),
        (lambda path: path.write_bytes(whole[:3000]), "a.hdf5 is not a complete HDF5 file"),
        (damaged_heap, "a heap of texts is damaged"),
        (lambda path: hdf5(path, episodes__qpos=np.zeros(3)), "no demonstrations: .*, it holds episodes"),
        (lambda path: hdf5(path, data__demo_0__states__what=states), "complete HDF5 file of robosuite, robomimic"),
        (lambda path: write(path, short, tactile=tactile), "demo_0: actions has 3 samples, time has 4"),
        (lambda path: write(path, both, tactile=tactile), "demo_1 differs from .*demo_0 in actions"),
        (lambda path: write(path, both[:1], left=tactile, right=tactile), "two tensors, obs/left and obs/right"),
    ):
        make(tmp_path / "a.hdf5")
        refused(tmp_path / "a.hdf5", word)


def test_a_small_file_that_becomes_large_or_has_many_names_is_refused(tmp_path):
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:  # a declared size whose values are not stored
        file.create_dataset("data/demo_0/states", shape=(10**9, 50), dtype=float)
    refused(path, r"states has shape \(1000000000, 50\), but its values are not stored")
    with h5py.File(path, "w") as file:
        part = file.create_dataset("data/demo_0/obs/x", (2**18, 600), "u1", chunks=(2**9, 600))
        part[: 2**9] = 1  # the rest is not stored
    assert path.stat().st_size < 2**20
    refused(path, r"unpacks to \d{10} bytes or more, expected at most 2147483648")
    with h5py.File(path, "w") as file:
        file["one"] = np.zeros(3)
        for number in range(2001):
            file[f"data/demo_0/obs/{number}"] = file["one"]
    refused(path, "a.hdf5 has more than 2000 streams")


def test_without_h5py_the_error_names_the_extra(tmp_path, monkeypatch, capsys):
    hdf5(tmp_path / "demo.hdf5", data__demo_0__actions=np.zeros(3))
    monkeypatch.setitem(sys.modules, "h5py", None)  # as if it were not installed
    assert main(["info", str(tmp_path / "demo.hdf5")]) == 2
    assert "needs h5py, which is not installed: pip install 'paxisim[hdf5]'" in capsys.readouterr().err


@pytest.mark.slow
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
