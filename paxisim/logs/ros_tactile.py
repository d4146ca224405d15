"""The tactile sensor in the topics of a bag of ROS; every other numeric topic becomes a covariate.

| topic of type | becomes |
|---|---|
| ``SensStream`` of XELA's server | a pad ``MODEL_N`` for each sensor: its forces (N), or its counts if it has none |
| ``paxisim_msgs/TactileFrame`` | its pads, as its ``TactileLayout`` on ``TOPIC_layout`` describes them |
| ``sensor_msgs/MagneticField``, one topic a magnetometer | one pad, whose taxels are the topics in the order of their \
names, in microtesla |
| ``std_msgs/Float64MultiArray``, ``Float32MultiArray`` | one pad or several, see below |
| ``geometry_msgs/WrenchStamped`` | a pad of one taxel: the force (N) |

Without a choice of topics, these are tactile: ``TactileFrame``, ``SensStream``, several topics of ``MagneticField``,
and arrays with "tactile" in the name of their topic. The axes of an array are those that the caller states, in words of
`paxisim.logs.axes.WORDS`, or the only ones that fit its shape. The first pad gives the clock; the others are
interpolated to it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.axes import FORMS, fits, given_axes, on_grid, tensor_of
from paxisim.logs.resample import resample
from paxisim.logs.ros_messages import ARRAY, COUNTS, FIELD, FORCES, TENSOR, WRENCH, XELA_TYPES, type_name
from paxisim.logs.stream import Log, Stream
from paxisim.logs.topic_streams import TopicStreams
from paxisim.sensors import known_sensors

_FIELD_TYPE = "sensor_msgs/MagneticField"
_ARRAY_TYPES = ("std_msgs/Float64MultiArray", "std_msgs/Float32MultiArray")
_FRAME_TYPE = "paxisim_msgs/TactileFrame"
_WRENCH_TYPE = "geometry_msgs/WrenchStamped"
_MICROTESLA = 1e6  # per tesla


@dataclass(frozen=True)
class _Pads:
    """Pads of one stream, whose values are ``(T, pads, 3, rows, cols)``."""

    names: tuple[str, ...]
    stream: Stream
    unit: str | None = None
    layout: TaxelLayout | None = None


def tactile_log(
    found: TopicStreams,
    topics: Sequence[str] = (),
    axes: Mapping[str, str] | None = None,
    pads: Sequence[str] | None = None,
    layout: TaxelLayout | None = None,
    max_gap: float | None = None,
) -> Log:
    """Return the tactile sensor and the covariates.

    Args:
        found: The streams of a bag.
        topics: The tactile topics; default: see above.
        axes: Axes of arrays by topic, in words of `paxisim.logs.axes.WORDS`.
        pads: Names of the pads to read; default: all.
        layout: Layout of the taxels; default: that of XELA's model if it is known, otherwise one row.
        max_gap: Longest gap (s) that is interpolated, see `paxisim.Recording.load`.

    Raises:
        InvalidValueError: No topic or topics of several kinds are tactile, the axes of one cannot be told, or the pads
            differ in their taxels.
        UnknownNameError: A topic does not exist, or none of its pads has a requested name.
    """
    for topic in (*topics, *(axes or ())):
        if topic not in found.types:
            raise UnknownNameError("topic", topic, found.types)
    chosen = list(topics) or _recognised(found)
    parts: list[_Pads] = []
    fields = [topic for topic in chosen if type_name(found.types[topic]) == _FIELD_TYPE]
    for topic in chosen:
        if topic in fields[1:]:
            continue
        streams = found.of_topic(topic)
        if not streams:
            raise InvalidValueError(f"{found.path}: no message of topic {topic} ({found.types[topic]}) could be read")
        if topic in fields:
            parts.append(_field_pad(found, fields, max_gap))
        elif TENSOR in streams:
            parts.append(_described_pads(found, topic, streams[TENSOR], layout))
        elif ARRAY in streams:
            parts.append(_array_pads(found, topic, streams[ARRAY], (axes or {}).get(topic), layout))
        elif WRENCH in streams:
            force = streams[WRENCH]
            parts.append(_Pads((topic.strip("/"),), Stream(force.nanoseconds, force.values[:, None, :, None, None])))
        elif type_name(found.types[topic]) in XELA_TYPES:
            parts += _xela_pads(streams, layout)
        else:
            raise InvalidValueError(
                f"{found.path}: topic {topic} ({found.types[topic]}) cannot be a tactile sensor: choose others with "
                f"topics among {found.listed()}"
            )
    return _joined(found, parts, chosen, pads, max_gap)


def _recognised(found: TopicStreams) -> list[str]:
    kinds = {topic: type_name(kind) for topic, kind in found.types.items() if found.of_topic(topic)}
    xela = [topic for topic, kind in kinds.items() if kind in XELA_TYPES]
    fields = sorted((topic for topic, kind in kinds.items() if kind == _FIELD_TYPE), key=_natural)
    arrays = [topic for topic, kind in kinds.items() if kind in _ARRAY_TYPES and "tactile" in topic.lower()]
    frames = [topic for topic, kind in kinds.items() if kind == _FRAME_TYPE]
    groups = [group for group in (frames, xela, fields if len(fields) > 1 else [], arrays) if group]
    if len(groups) != 1:
        what = "has several kinds of tactile topics" if groups else "has no topic that is tactile beyond doubt"
        raise InvalidValueError(
            f"{found.path} {what}: choose with topics (paxisim convert --topics) among its topics {found.listed()}"
        )
    return groups[0]


def _described_pads(found: TopicStreams, topic: str, stream: Stream, layout: TaxelLayout | None) -> _Pads:
    shape = stream.values.shape[1:]
    said = found.described.get(f"{topic}_layout")
    if len(shape) != 4 or shape[1] != 3 or (said is not None and said.layout.shape != shape[1:]):
        expected = "(pads, 3, rows, cols)" if said is None else f"pads of {said.layout.shape}"
        raise InvalidValueError(f"{found.path}: the frames of topic {topic} must be {expected}, got shape {shape}")
    name = topic.strip("/")
    pads = (said.pads if said is not None else ()) or tuple(f"{name}{i}" for i in range(shape[0]))
    if len(pads) != shape[0]:
        raise InvalidValueError(f"{found.path}: {topic}_layout names {len(pads)} pads, its frames have {shape[0]}")
    unit = None if said is None or said.unit == "N" else said.unit
    return _Pads(tuple(pads), stream, unit, layout or (None if said is None else said.layout))


def _xela_pads(streams: Mapping[str, Stream], layout: TaxelLayout | None) -> list[_Pads]:
    has_forces = any(name.endswith(FORCES) for name in streams)
    end, unit = (FORCES, None) if has_forces else (COUNTS, "counts")
    pads = []
    for name, stream in streams.items():
        if not name.endswith(end):
            continue
        sensor = name.removeprefix("/").removesuffix(end)
        model = f"xela-{sensor.rpartition('_')[0]}".lower()
        known = next((one.layout for one in known_sensors() if one.name == model and one.pitch is not None), None)
        grid = layout or (known if known is not None and known.taxels == stream.values.shape[1] else None)
        tensor = on_grid(tensor_of(stream.values, ("taxels", "xyz")), grid)
        pads.append(_Pads((sensor,), Stream(stream.nanoseconds, tensor), unit, grid))
    return pads


def _field_pad(found: TopicStreams, topics: Sequence[str], max_gap: float | None) -> _Pads:
    streams = [found.of_topic(topic).get(FIELD) for topic in topics]
    missing = [topic for topic, stream in zip(topics, streams, strict=True) if stream is None]
    if missing:
        raise InvalidValueError(f"{found.path}: no message of topic {missing[0]} could be read")
    there = [stream for stream in streams if stream is not None]
    at = there[0].nanoseconds
    values = np.stack([resample(stream, at, "linear", max_gap) for stream in there], axis=2)[:, None, :, None]
    return _Pads(("magnetometers",), Stream(at, (values * _MICROTESLA).astype(np.float32)), "uT")


def _array_pads(found: TopicStreams, topic: str, stream: Stream, text: str | None, layout: TaxelLayout | None) -> _Pads:
    shape = stream.values.shape[1:]
    possible = [axes for axes in FORMS if fits(axes, shape)]
    if text is not None:
        axes = given_axes(topic, shape, text)
    elif len(possible) == 1:
        axes = possible[0]
    else:
        example = ",".join(possible[0]) if possible else "taxels"
        raise InvalidValueError(
            f"{found.path}: the axes of topic {topic}, of shape {shape}, cannot be told; state them with axes (paxisim "
            f"convert --axes {topic}={example})"
        )
    tensor = tensor_of(stream.values, axes)
    name = topic.strip("/")
    names = tuple(f"{name}{i}" for i in range(tensor.shape[1])) if "pads" in axes else (name,)
    return _Pads(names, Stream(stream.nanoseconds, on_grid(tensor, layout) if "taxels" in axes else tensor))


def _joined(
    found: TopicStreams,
    parts: Sequence[_Pads],
    chosen: Sequence[str],
    pads: Sequence[str] | None,
    max_gap: float | None,
) -> Log:
    names = [name for part in parts for name in part.names]
    for pad in pads or ():
        if pad not in names:
            raise UnknownNameError("pad", pad, names)
    parts = [part for part in parts if pads is None or set(part.names) & set(pads)]
    grids = {part.names[0]: part.stream.values.shape[3:] for part in parts}
    if len(set(grids.values())) > 1:
        listed = ", ".join(f"{name} has {rows}x{cols}" for name, (rows, cols) in grids.items())
        raise InvalidValueError(
            f"a recording holds pads of one kind, but those of {found.path} differ in their taxels: {listed}; choose "
            "with pads (paxisim convert --pads)"
        )
    if len({part.unit for part in parts}) > 1:
        raise InvalidValueError(f"{found.path}: its tactile topics have different units: choose one kind with topics")
    first = parts[0]
    at, shape = first.stream.nanoseconds, first.stream.values.shape
    tensors: list[NDArray[np.float32]] = [
        resample(part.stream, at, "linear", max_gap).astype(np.float32, copy=False) for part in parts
    ]
    layout = first.layout or TaxelLayout(shape[3], shape[4], (1e-2, 1e-2), pitch_known=False)
    about = {
        "source": found.path.name,
        "layout": layout.to_dict(),
        "pads": tuple(name for part in parts for name in part.names),
        **({} if first.unit is None else {"unit": first.unit}),
    }
    streams = {"measured": Stream(at, np.concatenate(tensors, axis=1))}
    others = found.streams(without=chosen)
    return Log(streams | {schemas.COVARIATE + name: stream for name, stream in others.items()}, about)


def _natural(topic: str) -> list[str]:
    """Return a key that sorts ``/mag2`` before ``/mag10``."""
    return [part.zfill(9) if part.isdigit() else part for part in re.split(r"(\d+)", topic)]
