"""Recordings and files for the log tests."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.writer import Writer

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

START = 1_700_000_000_000_000_000
MS = 1_000_000
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_POINT = "float64 x\nfloat64 y\nfloat64 z\n"
_PARTS = {
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    "geometry_msgs/Vector3": _POINT,
    "geometry_msgs/Quaternion": _POINT + "float64 w\n",
}
TRANSFORMS = (
    "geometry_msgs/TransformStamped[] transforms\n"
    + "".join(f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in _PARTS.items())
    + JOINT_STATE[JOINT_STATE.index("=" * 80) :]
)
LAYOUT = TaxelLayout(4, 3, (0.002, 0.003), vendor_order=(3, 4, 5, 0, 1, 2, 6, 7, 8, 11, 10, 9))
METADATA = {"layout": LAYOUT, "pads": ("left", "right"), "sensor": "a sensor", "versions": {"paxisim": "1"}}


def counts(samples: int, seed: int = 0) -> np.ndarray:
    """Return forces as a board reports them, in whole counts of 0.1 N."""
    numbers = np.random.default_rng(seed).integers(-30, 120, (samples, 2, 3, 4, 3))
    return (numbers * 0.1).astype(np.float32)


def recording(samples: int = 50, **changes) -> Recording:
    """Return a recording with two episodes whose clocks restart, both tensors, covariates and metadata."""
    rng = np.random.default_rng(1)
    half = samples // 2
    fields = {
        "time": np.concatenate([np.arange(half), np.arange(samples - half)]) * 0.01 + rng.uniform(0, 1e-3, samples),
        "measured": counts(samples),
        "simulated": rng.normal(size=(samples, 2, 3, 4, 3)).astype(np.float32),
        "covariates": {"opening": rng.normal(size=samples), "arm/pose": rng.normal(size=(samples, 2, 3))},
        "episode": np.repeat([4, 2], [half, samples - half]),
        "layout": LAYOUT,
        "pads": ("left", "right"),
        "metadata": {"sensor": "a sensor", "start": 1.7e9, "scene": "<mujoco/>", "list": [1, 2.5, None]},
    }
    return Recording(**{**fields, **changes})


def assert_equal(a: Recording, b: Recording, atol: float = 1e-9) -> None:
    """Assert that two recordings are equal but for their metadata, with times that differ by at most `atol` (s)."""
    np.testing.assert_allclose(a.time, b.time, rtol=0, atol=atol)
    for name in ("measured", "simulated", "episode"):
        assert (getattr(a, name) is None) == (getattr(b, name) is None)
        if getattr(a, name) is not None:
            assert getattr(a, name).dtype == getattr(b, name).dtype
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.covariates.keys() == b.covariates.keys()
    for name, values in a.covariates.items():
        np.testing.assert_array_equal(values, b.covariates[name])
    assert (a.layout, a.pads) == (b.layout, b.pads)


def write_log(path: Path, force: np.ndarray, interval_ns: int = 10_000_000, **options) -> None:
    with LogWriter(path, METADATA, **options) as log:
        log.write_at("episode", START, 0)
        for i, sample in enumerate(force):
            log.write_at("measured", START + i * interval_ns, sample, sequence=i, status=(0, 0))


@contextmanager
def full_disk(limit: int) -> Iterator[None]:
    """Let no file become larger than `limit` bytes meanwhile, like on a disk that is full."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def refused(path: Path, word: str, **options) -> None:
    """Assert that loading a file fails with an error of ours in which `word` is found."""
    with pytest.raises(InvalidValueError, match=word):
        Recording.load(path, **options)


def write_json(path, messages, metadata=None, kinds=None, **options):
    """Write an MCAP file of messages (topic, log time, document or its bytes) and of paxisim's metadata.

    With `kinds`, topics have schemas with these names.
    """
    with open(path, "wb") as file:
        writer = Writer(file, **options)
        writer.start()
        if metadata is not None:
            writer.add_metadata("paxisim", metadata)
        channels = {}
        for topic, at, document in messages:
            if topic not in channels:
                kind = (kinds or {}).get(topic)
                schema = writer.register_schema(kind, "jsonschema", b"{}") if kind else 0
                channels[topic] = writer.register_channel(topic, "json", schema)
            data = document if isinstance(document, bytes) else json.dumps(document).encode()
            writer.add_message(channels[topic], at, data, at)
        writer.finish()


def joint_state(at, names, position, velocity=(), effort=()):
    stamp = SimpleNamespace(sec=at // 10**9, nanosec=at % 10**9)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id=""),
        name=names,
        position=position,
        velocity=velocity,
        effort=effort,
    )


def transforms(at, *frames):
    """Return a message of transforms (parent, child, position, quaternion x y z w)."""
    stamp = SimpleNamespace(sec=at // 10**9, nanosec=at % 10**9)
    return SimpleNamespace(
        transforms=[
            SimpleNamespace(
                header=SimpleNamespace(stamp=stamp, frame_id=parent),
                child_frame_id=child,
                transform=SimpleNamespace(
                    translation=SimpleNamespace(**dict(zip("xyz", map(float, place), strict=True))),
                    rotation=SimpleNamespace(**dict(zip("xyzw", map(float, turn), strict=True))),
                ),
            )
            for parent, child, place, turn in frames
        ]
    )


def write_ros2(path, messages, schema="sensor_msgs/msg/JointState", definition=JOINT_STATE, **options):
    """Write a file like ``ros2 bag record``, which logs each message 3 ms after its stamp."""
    writer_of = pytest.importorskip("mcap_ros2.writer").Writer
    with open(path, "wb") as file, writer_of(file, **options) as writer:
        registered = writer.register_msgdef(schema, definition)
        for topic, at, message in messages:
            writer.write_message(topic, registered, message, log_time=at + 3 * MS)
