"""Topics, encodings and schemas of the decoded channels, for logs and for live viewers."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap_protobuf.schema import build_file_descriptor_set

from sonarhw.log.contents import READINGS, SWEEPS, TRACES
from sonarhw.log.viewer.trace_message import TraceMessage, trace_message
from sonarhw.readings import Reading

_READING_SCHEMA = {
    "type": "object",
    "properties": {
        "time": {"type": "number", "description": "start of transmission on the device's clock, s"},
        "sweep": {"type": "integer"},
        "ping": {"type": "integer"},
        "number": {"type": "integer"},
        "angle_deg": {"type": "number", "description": "turntable angle, counter-clockwise"},
        "range_m": {"type": ["number", "null"]},
        "echo_times_s": {"type": "array", "items": {"type": "number"}},
        "speed_of_sound": {"type": ["number", "null"], "description": "m/s"},
        "temperature_c": {"type": ["number", "null"]},
    },
}


@dataclass(frozen=True)
class Channel:
    """How the messages of a topic are encoded."""

    encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes


def _protobuf(message: Any) -> Channel:
    schema = build_file_descriptor_set(message).SerializeToString()
    return Channel(MessageEncoding.Protobuf, message.DESCRIPTOR.full_name, SchemaEncoding.Protobuf, schema)


DECODED = {
    READINGS: Channel(
        MessageEncoding.JSON, "sonarhw.Reading", SchemaEncoding.JSONSchema, json.dumps(_READING_SCHEMA).encode()
    ),
    SWEEPS: _protobuf(LaserScan),
    TRACES: _protobuf(TraceMessage),
}


def reading_messages(reading: Reading) -> Iterator[tuple[str, bytes]]:
    """Yield topic and message of a reading, and of its trace if it has one."""
    yield READINGS, json.dumps(_reading_record(reading)).encode()
    if reading.trace is not None:
        message = trace_message(reading.number, math.degrees(reading.angle), reading.trace)
        yield TRACES, message.SerializeToString()


def _reading_record(reading: Reading) -> dict[str, Any]:
    """Return the JSON fields of a reading, in degrees, metres, seconds and °C."""
    return {
        "time": reading.time,
        "sweep": reading.sweep,
        "ping": reading.ping,
        "number": reading.number,
        "angle_deg": math.degrees(reading.angle),
        "range_m": reading.range if reading.range is not None and math.isfinite(reading.range) else None,
        "echo_times_s": reading.echo_times,
        "speed_of_sound": reading.speed_of_sound if math.isfinite(reading.speed_of_sound) else None,
        "temperature_c": reading.temperature_c,
    }
