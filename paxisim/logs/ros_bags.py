"""Numeric streams in bags of ROS: ``.bag`` of ROS 1, ``.db3`` of ROS 2, and the folders of ``ros2 bag record``.

A folder may hold MCAP or SQLite files. `paxisim.logs.ros_messages` lists the messages. Their definitions are those of
ROS and of XELA's packages, never those in the file, because the library that decodes them compiles code from them.
"""

from __future__ import annotations

import bz2
import functools
import sqlite3
from collections.abc import Callable
from contextlib import closing
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.logs.limits import most_unpacked, refuse_unpacked
from paxisim.logs.ros_messages import XELA_TYPES, parser
from paxisim.logs.topic_streams import TopicStreams

_RATIO = 1000  # limit on the compression ratio of a chunk, as in MCAP files
_ZSTD = b"\x28\xb5\x2f\xfd"
_LINE = "=" * 80
_SENS_STREAM = f"""SensorFull[] sensors
{_LINE}
MSG: {{package}}/SensorFull
uint32 message
float64 time
string model
uint8 sensor_pos
Taxel[] taxels
Forces[] forces
{_LINE}
MSG: {{package}}/Taxel
int16 x
int16 y
int16 z
{_LINE}
MSG: {{package}}/Forces
float32 x
float32 y
float32 z
"""


def is_bag(path: Path) -> bool:
    """Return whether a path is that of a bag."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or any(path.glob("*.db3"))
    return path.suffix.lower() in (".bag", ".db3")


def read_bag(path: Path) -> TopicStreams:
    """Return the streams of a bag. If it is damaged, the intact part is read, with a warning.

    Raises:
        InvalidValueError: The bag is compressed in a way that is not read, damaged, or has no supported message; or it
            unpacks to more than `paxisim.logs.limits` allows.
        MissingExtraError: The package that reads the bag is not installed.
        FileNotFoundError: The file does not exist.
    """
    parts = _files(path)
    if parts[0].suffix == ".mcap":
        from paxisim.logs.mcap_topics import read_topics

        return read_topics(path, parts)
    found = TopicStreams(path, parts)
    try:
        import rosbags.rosbag1
        import rosbags.rosbag2  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError("rosbags", "ros", f"{path}, a bag of ROS,") from error
    for file in parts:
        _read(found, file)
    return found.check()


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    for suffix in (".mcap", ".db3"):
        if files := sorted(path.glob(f"*{suffix}")):
            return files
    if any(path.glob("*.zstd")):
        raise InvalidValueError(
            f"{path} is compressed: unpack its files with zstd -d, or rewrite it with ros2 bag convert"
        )
    raise InvalidValueError(f"{path} is the folder of a ROS 2 bag, but has no .mcap or .db3 file")


def _read(found: TopicStreams, file: Path) -> None:
    is_ros_1 = file.suffix.lower() == ".bag"
    before = found.count
    try:
        with _ros_1(file) if is_ros_1 else _ros_2(file) as bag:
            topics = {}
            for connection in bag.connections:
                found.types[connection.topic] = connection.msgtype
                samples = parser(connection.msgtype)
                if samples is not None:
                    topics[connection.id] = _decoder(connection.msgtype, is_ros_1), samples
            wanted = [connection for connection in bag.connections if connection.id in topics]
            for connection, log_time, data in bag.messages(wanted) if wanted else ():
                if bytes(data[:4]) == _ZSTD and not is_ros_1:
                    raise InvalidValueError(
                        f"{found.path}: its messages are compressed: rewrite it with ros2 bag convert"
                    )
                decode, samples = topics[connection.id]
                try:
                    found.add(connection.topic, log_time, samples(decode(data)))
                except InvalidValueError:
                    raise
                except Exception:  # a damaged message can raise anything in its decoder
                    found.bad += 1
    except InvalidValueError:
        raise
    except Exception as error:  # the library and its own libraries raise errors of many classes for damaged files
        found.is_whole = False
        if found.count == before and not found.bad:
            raise InvalidValueError(f"{file} is not a complete bag of ROS {1 if is_ros_1 else 2}: {error}") from error


def _ros_1(file: Path) -> Any:
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag1.reader import decompressors

    bag = Reader(file)
    bag.open()
    unpack, names = _Unpacking(file), {function: name for name, function in decompressors.items()}
    # those of the library unpack to any size
    for at, chunk in bag.chunks.items():
        bag.chunks[at] = chunk._replace(decompressor=unpack.function(names[chunk.decompressor]))
    return closing(bag)


def _ros_2(file: Path) -> Any:
    """Open an SQLite file after checking that what is read is stored in it, not computed by it."""
    from rosbags.rosbag2 import Reader

    with closing(sqlite3.connect(f"file:{quote(str(file))}?mode=ro&immutable=1", uri=True)) as base:
        tables = base.execute("SELECT name, type, sql FROM sqlite_master WHERE type IN ('table', 'view')").fetchall()
        for name, kind, sql in tables:
            columns = base.execute("SELECT hidden FROM pragma_table_xinfo(?)", (name,)).fetchall()
            if kind == "view" or "VIRTUAL" in sql.upper() or any(hidden for (hidden,) in columns):
                raise InvalidValueError(f"{file} is not a bag of ROS 2: its table {name!r:.40} is computed, not stored")
    return Reader(file)


class _Unpacking:
    """Unpacks chunks of one bag up to the limit on its unpacked size."""

    def __init__(self, file: Path) -> None:
        self._file, self._most, self._size = file, most_unpacked(file, _RATIO), 0

    def function(self, compression: str) -> Callable[[bytes], bytes]:
        """Return the function for one kind of compression: ``none``, ``bz2`` or ``lz4``."""
        return lambda data: self._unpack(compression, data)

    def _unpack(self, compression: str, data: bytes) -> bytes:
        import lz4.frame

        if compression != "none":
            unpacker = bz2.BZ2Decompressor() if compression == "bz2" else lz4.frame.LZ4FrameDecompressor()
            data = unpacker.decompress(data, self._most - self._size + 1)
        self._size += len(data)
        refuse_unpacked(self._file, self._size, self._most)
        return data


def _decoder(kind: str, is_ros_1: bool) -> Callable[[bytes], Any]:
    store = _store(is_ros_1)
    decode = store.deserialize_ros1 if is_ros_1 else store.deserialize_cdr
    return lambda data: decode(data, kind)


@functools.cache
def _store(is_ros_1: bool) -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros_1 else Stores.ROS2_HUMBLE)
    for kind in ("TactileLayout", "TactileFrame"):
        text = files("paxisim").joinpath(f"data/paxisim_msgs/msg/{kind}.msg").read_text(encoding="utf-8")
        store.register(get_types_from_msg(text, f"paxisim_msgs/msg/{kind}"))
    for kind in XELA_TYPES:
        package, name = kind.split("/")
        store.register(get_types_from_msg(_SENS_STREAM.format(package=package), f"{package}/msg/{name}"))
    return store
