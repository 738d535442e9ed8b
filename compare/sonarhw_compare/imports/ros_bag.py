"""Scans in bags of ROS 1 and ROS 2: messages `sensor_msgs/Range` and `sensor_msgs/LaserScan`, read by rosbags.

A LaserScan is one sweep, with an angle for each range. A Range has no angle: the topics are `meaning.step` degrees
apart, in the order of their names. By the definition of the messages, only ranges within their limits are echoes.
"""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sonarhw.errors import InputError, MissingExtra
from sonarhw.readings import Reading
from sonarhw_compare.imports.foreign_rows import ForeignRow, Meaning, readings_of

_RANGE, _SCAN = "sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan"
_MOST_BYTES = 1_000_000  # of a message; a LaserScan of 100 000 ranges has half of this
# what rosbags and its parsers raise for a damaged file, besides errors of their own
_DAMAGE = (OSError, ValueError, LookupError, TypeError, AttributeError, AssertionError, EOFError, struct.error)


def read_ros_bag(bag: Path, meaning: Meaning) -> list[Reading]:
    """Return the readings of a bag, at least one: a file of ROS 1, or the folder of ROS 2. Raises InputError.

    Raises MissingExtra if rosbags is not installed.
    """
    try:
        from apsw import Error as DatabaseError
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtra("ROS bags need rosbags", "ros") from error
    try:
        # bags of ROS 2 may contain no definitions; those of these two messages are the same in all versions
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            readings = readings_of(str(bag), _rows(bag, reader, meaning), meaning)
    except (AnyReaderError, DatabaseError, *_DAMAGE) as error:
        found = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(f"{bag}: is not a complete ROS bag: {found}") from error
    if not readings:
        raise InputError(f"{bag}: has no message of sensor_msgs/Range or LaserScan")
    return readings


def _rows(bag: Path, reader: Any, meaning: Meaning) -> Iterator[ForeignRow]:
    known = [one for one in reader.connections if one.msgtype in (_RANGE, _SCAN)]
    topics = sorted({one.topic for one in known})
    if meaning.topic is not None and meaning.topic not in topics:
        raise InputError(f"{bag}: no topic {meaning.topic!r}; topics with ranges: {', '.join(topics) or 'none'}")
    chosen = [one for one in known if meaning.topic in (None, one.topic)]
    if not chosen:
        return
    first: int | None = None
    for number, (connection, time, content) in enumerate(reader.messages(connections=chosen)):
        where = f"message {number + 1} of the topics with ranges"
        if len(content) > _MOST_BYTES:
            raise InputError(f"{bag}, {where}: {len(content)} bytes; expected at most {_MOST_BYTES}")
        message = reader.deserialize(content, connection.msgtype)
        first = time if first is None else first
        seconds = (time - first) * 1e-9
        if connection.msgtype == _RANGE:
            heading = topics.index(connection.topic) * meaning.step
            yield ForeignRow(where, heading, _echo(message.range, message.min_range, message.max_range), seconds)
            continue
        step = math.degrees(message.angle_increment)
        start = math.degrees(message.angle_min)
        if not (math.isfinite(start) and math.isfinite(step)):
            raise InputError(f"{bag}, {where}: an angle is not finite")
        for k, distance in enumerate(message.ranges.tolist()):
            echo = _echo(distance, message.range_min, message.range_max)
            yield ForeignRow(where, start + k * step, echo, seconds, number)


def _echo(distance: float, least: float, most: float) -> float | None:
    """Return a range, or None if it is outside the limits that its message states."""
    inside = math.isfinite(distance) and max(least, 0.0) <= distance <= most
    return distance if inside else None
