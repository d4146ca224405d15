"""Bags of ROS 1 and ROS 2, written with the library rosbags, for the tests of reading them."""

from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import paxisim

MSGS = Path(paxisim.__file__).parent / "data" / "paxisim_msgs" / "msg"
XELA = """SensorFull[] sensors
================================================================================
MSG: {0}/SensorFull
uint32 message
float64 time
string model
uint8 sensor_pos
Taxel[] taxels
Forces[] forces
================================================================================
MSG: {0}/Taxel
int16 x
int16 y
int16 z
================================================================================
MSG: {0}/Forces
float32 x
float32 y
float32 z
"""


class Messages:
    """Builds messages of one version of ROS."""

    def __init__(self, version):
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        self.xela = "xela_server_ros" if version == 1 else "xela_server_ros2"
        self.store.register(get_types_from_msg(XELA.format(self.xela), f"{self.xela}/msg/SensStream"))
        self.has_seq = version == 1
        for kind in ("TactileLayout", "TactileFrame"):
            text = (MSGS / f"{kind}.msg").read_text()
            self.store.register(get_types_from_msg(text, f"paxisim_msgs/msg/{kind}"))

    def make(self, kind, **fields):
        return self.store.types[kind](**fields)

    def xyz(self, values, kind="geometry_msgs/msg/Vector3"):
        return self.make(kind, **dict(zip("xyz", values, strict=True)))

    def header(self, at):
        stamp = self.make("builtin_interfaces/msg/Time", sec=at // 10**9, nanosec=at % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="", **({"seq": 0} if self.has_seq else {}))

    def joints(self, at, names, position):
        arrays = {name: np.array(values) for name, values in (("position", position), ("velocity", []), ("effort", []))}
        arrays = {name: values.astype(np.float64) for name, values in arrays.items()}
        return self.make("sensor_msgs/msg/JointState", header=self.header(at), name=names, **arrays)

    def wrench(self, at, force):
        wrench = self.make("geometry_msgs/msg/Wrench", force=self.xyz(force), torque=self.xyz([0.0, 0.0, 1.0]))
        return self.make("geometry_msgs/msg/WrenchStamped", header=self.header(at), wrench=wrench)

    def field(self, at, tesla):
        covariance = np.zeros(9)
        return self.make(
            "sensor_msgs/msg/MagneticField",
            header=self.header(at),
            magnetic_field=self.xyz(tesla),
            magnetic_field_covariance=covariance,
        )

    def array(self, values, shape=()):
        dims = [self.make("std_msgs/msg/MultiArrayDimension", label="", size=size, stride=0) for size in shape]
        layout = self.make("std_msgs/msg/MultiArrayLayout", dim=dims, data_offset=0)
        return self.make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.asarray(values, np.float64).ravel())

    def sensors(self, at, number, sensors):
        """Return a message of XELA's server; each sensor is model, position, counts ``(N, 3)`` and forces or None."""
        return self.make(
            f"{self.xela}/msg/SensStream",
            sensors=[
                self.make(
                    f"{self.xela}/msg/SensorFull",
                    message=number,
                    time=at * 1e-9,
                    model=model,
                    sensor_pos=position,
                    taxels=[self.xyz(np.int16(row.astype(np.uint16)), f"{self.xela}/msg/Taxel") for row in counts],
                    forces=[] if forces is None else [self.xyz(row, f"{self.xela}/msg/Forces") for row in forces],
                )
                for model, position, counts, forces in sensors
            ],
        )

    def tactile_layout(self, pads, layout, unit="N"):
        curved = [] if layout.is_grid else [self.xyz(row, "geometry_msgs/msg/Point") for row in layout.positions]
        return self.make(
            "paxisim_msgs/msg/TactileLayout",
            pads=list(pads),
            unit=unit,
            rows=layout.rows,
            cols=layout.cols,
            pitch=np.array(layout.pitch),
            positions=curved,
            normals=[self.xyz(row) for row in layout.normals] if curved else [],
        )

    def tactile_frame(self, at, tensor, status=()):
        return self.make(
            "paxisim_msgs/msg/TactileFrame",
            header=self.header(at),
            sequence=0,
            shape=np.array(tensor.shape, np.uint32),
            force=np.asarray(tensor, np.float32).ravel(),
            status=np.array(status, np.uint8),
        )


def write_bag(path, kind, messages):
    """Write ``messages(Messages)``, which yields topic, log time (ns) and message.

    Args:
        path: The file of a bag of ROS 1, or the folder of one of ROS 2.
        kind: ``bag``, ``bz2`` or ``lz4`` (compressed bags of ROS 1), ``sqlite`` or ``mcap``.
        messages: A function.
    """
    if kind in ("bag", "bz2", "lz4"):
        from rosbags.rosbag1 import Writer

        build, bag = Messages(1), Writer(path)
        if kind != "bag":
            bag.set_compression(Writer.CompressionFormat[kind.upper()])
        serialize = build.store.serialize_ros1
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        build, bag = Messages(2), Writer(path, version=9, storage_plugin=plugin)
        serialize = build.store.serialize_cdr
    connections = {}
    with bag:
        for topic, at, message in messages(build):
            name = message.__msgtype__
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, name, typestore=build.store)
            bag.write(connections[topic], at, serialize(message, name))
    return path
