"""Scans in bags of ROS 1 and ROS 2 and in other MCAP files: messages `Range`, `LaserScan` and `PointCloud`, or JSON.

A LaserScan or PointCloud is one sweep. A Range has no angle: its direction is that of its frame in `/tf_static`, else
topics are `meaning.step` degrees apart, in the order of their names. By the definition of the messages, only ranges
within their limits are echoes. Poses are those of `Odometry`, else of the robot's frame in `/tf`, at the times of the
ranges.
"""

import math
import sqlite3
import struct
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.records import Message as McapRecordOfMessage

from sonarhw.errors import InputError, MissingExtra, counted
from sonarhw.log.mcap_records import UNREADABLE, Damage, McapMessage, OpenFile, Record, is_mcap, read_records
from sonarhw.readings import Reading, RobotPose, moved_by
from sonarhw_compare.foreign_rows import MOST_READINGS, ForeignRow, Meaning, at_poses, readings_of
from sonarhw_compare.processes import parse_apart

_RANGE, _SCAN, _CLOUD = "sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud"
_FRAMES = "tf2_msgs/msg/TFMessage"
_ODOMETRY = "nav_msgs/msg/Odometry"
_BASES = ("base_footprint", "base_link")  # usual names of the frame of a robot
_MOST_BYTES = 1_000_000  # of a message; a LaserScan of 100 000 ranges has half of this
_MOST_CHUNK = 1 << 28  # bytes of an unpacked chunk
# what rosbags and its parsers raise for a damaged file, besides errors of their own
_DAMAGE = (
    *(OSError, ValueError, LookupError, TypeError, AttributeError, AssertionError, EOFError, struct.error),
    *(sqlite3.Error, RecursionError, OverflowError, MemoryError),
)


@dataclass(frozen=True)
class _Message:
    topic: str
    kind: str  # such as sensor_msgs/msg/Range; "json" for JSON
    time: int  # ns
    content: bytes
    schema: str = ""  # definition of the kind; empty: the usual one


@dataclass
class _Bag:
    """The messages of a bag, and how they are decoded."""

    messages: Callable[[], Iterator[_Message]]
    decode: Callable[[_Message], Any]
    damage: list[str] = field(default_factory=list)


def read_ros_bag(bag: Path, meaning: Meaning) -> list[Reading]:
    """Return the readings of a bag, at least one: a file of ROS 1, or a file or folder of ROS 2. Raises InputError.

    Warns about damaged parts, which are left out. Raises MissingExtra if rosbags is not installed.
    """
    if find_spec("rosbags") is None:
        raise MissingExtra("ROS bags need rosbags", "ros")
    rows, doubts = parse_apart(_parsed, bag, "a complete ROS bag", meaning)
    readings = readings_of(str(bag), iter(rows), meaning)
    if not readings:
        hint = "; if it is no bag, give one file of it" if bag.is_dir() else ""
        raise InputError(f"{bag}: has no message of sensor_msgs/Range, LaserScan or PointCloud{hint}")
    for doubt in doubts:
        warnings.warn(f"{bag}: {doubt}", stacklevel=2)
    return readings


def _parsed(bag: Path, meaning: Meaning) -> tuple[list[ForeignRow], list[str]]:
    """Return the readings of a bag, and what may be wrong with them. Raises any error of a parser."""
    opened = _opened(bag)
    unknown: set[str] = set()
    rows = [*islice(_rows(bag, opened, meaning, unknown), MOST_READINGS + 1)]
    stamped = _poses(opened)
    rows = [*at_poses(rows, [time for time, _ in stamped], [pose for _, pose in stamped])]
    began = rows[0].time or 0.0 if rows else 0.0
    rows = [replace(row, time=(row.time or 0.0) - began) for row in rows]
    doubts = []
    if opened.damage:
        doubts.append(f"{counted(len(opened.damage), 'damaged part')} left out, the first: {opened.damage[0]}")
    if len(unknown) > 1 and not meaning.step:
        listed = ", ".join(sorted(unknown))
        step = "add step=DEGREES, the angle from one sensor to the next, or topic=NAME"
        raise InputError(f"{bag}: the directions of {listed} are unknown; {step}")
    if unknown and not meaning.step:
        doubts.append(f"the direction of {', '.join(unknown)} is unknown, so its angle is 0")
    return rows, doubts


def json_messages(file: Path) -> bytes:
    """Return the JSON messages of an MCAP file, one a line; empty without any. Raises InputError."""
    try:
        return b"\n".join(
            message.content.replace(b"\n", b" ") for message in _mcap_messages(file, []) if message.kind == "json"
        )
    except _DAMAGE as error:
        raise InputError(f"{file}: is not a complete MCAP file: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    return str(error).partition("\n")[0] or type(error).__name__


def _opened(bag: Path) -> _Bag:
    if bag.is_dir():
        files = sorted(file for file in bag.iterdir() if file.suffix in (".mcap", ".db3"))
        if not files:
            raise ValueError("the folder has no file .mcap or .db3; unpack compressed ones")
        return _ros2(files)
    with bag.open("rb") as file:
        start = file.read(16)
    return _ros1(bag) if start.startswith(b"#ROSBAG") or bag.suffix == ".bag" else _ros2([bag])


def _ros1(bag: Path) -> _Bag:
    from rosbags.rosbag1 import Reader, ReaderError
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _FRAMES))  # the store lacks it

    def messages() -> Iterator[_Message]:
        try:
            with Reader(bag) as reader:
                kinds = (_RANGE, _SCAN, _CLOUD, _FRAMES, _ODOMETRY)
                chosen = [connection for connection in reader.connections if connection.msgtype in kinds]
                for connection, time, content in reader.messages(connections=chosen) if chosen else ():
                    yield _Message(connection.topic, connection.msgtype, time, bytes(content))
        except ReaderError as error:
            raise ValueError(_reason(error)) from error

    return _Bag(messages, lambda message: store.deserialize_ros1(message.content, message.kind))


def _ros2(files: list[Path]) -> _Bag:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    stores: dict[str, Any] = {}

    def decode(message: _Message) -> Any:
        if message.schema not in stores:
            usual = get_typestore(Stores.ROS2_HUMBLE).fielddefs
            own = get_types_from_msg(message.schema, message.kind) if message.schema else {}
            stores[message.schema] = get_typestore(Stores.EMPTY)
            stores[message.schema].register({**usual, **own})
        return stores[message.schema].deserialize_cdr(message.content, message.kind)

    damage: list[str] = []

    def messages() -> Iterator[_Message]:
        damage.clear()
        for file in files:
            yield from _mcap_messages(file, damage) if file.suffix != ".db3" else _database_messages(file, damage)

    return _Bag(messages, decode, damage)


def _database_messages(file: Path, damage: list[str]) -> Iterator[_Message]:
    with sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True) as database:
        try:
            yielded = 0
            query = "SELECT name, type, timestamp, data FROM messages JOIN topics ON topic_id = topics.id"
            for topic, kind, time, content in database.execute(query):
                yielded += 1
                if isinstance(content, bytes) and isinstance(time, int):
                    yield _Message(str(topic), str(kind), time, content)
        except sqlite3.Error as error:
            if not yielded:
                raise
            damage.append(_reason(error))
        finally:
            database.rollback()
    database.close()


def _mcap_messages(file: Path, damage: list[str]) -> Iterator[_Message]:
    """Yield the messages of an MCAP file with known encodings. Raises ValueError if it is none."""
    opened = OpenFile(file)
    if not is_mcap(opened):
        raise ValueError("its first bytes are not those of an MCAP file")
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    for record in read_records(opened, unpack=_unpacked):
        if isinstance(record, Damage):
            damage.append(record.text)
        elif isinstance(record, Record):
            try:
                if record.opcode == Opcode.SCHEMA:
                    schema = Schema.read(ReadDataStream(BytesIO(record.content)))
                    schemas[schema.id] = schema
                elif record.opcode == Opcode.CHANNEL:
                    channel = Channel.read(ReadDataStream(BytesIO(record.content)))
                    channels[channel.id] = channel
                elif record.opcode == Opcode.MESSAGE:  # outside a chunk
                    message = McapRecordOfMessage.read(ReadDataStream(BytesIO(record.content)), len(record.content))
                    if (owner := channels.get(message.channel_id)) is not None:
                        plain = McapMessage(record.at, message.channel_id, message.log_time, message.data)
                        yield _message(plain, owner, schemas.get(owner.schema_id))
            except UNREADABLE as error:
                damage.append(_reason(error))
        elif (channel := channels.get(record.channel)) is not None:
            yield _message(record, channel, schemas.get(channel.schema_id))


def _message(record: McapMessage, channel: Channel, schema: Schema | None) -> _Message:
    kind, text = "", ""
    if channel.message_encoding == "json":
        kind = "json"
    elif channel.message_encoding == "cdr" and schema is not None:
        kind = schema.name
        text = schema.data.decode("utf-8", "replace") if schema.encoding == "ros2msg" else ""
    return _Message(channel.topic, kind, record.time, record.data, text)


def _unpacked(compression: str, data: bytes, size: int) -> bytes:
    """Return a chunk that was compressed by one of the two methods of MCAP. Raises ValueError."""
    if size > _MOST_CHUNK:
        raise ValueError(f"{size} bytes are too many")
    try:
        if compression == "zstd":
            return bytes(import_module("zstandard").ZstdDecompressor().decompress(data, max_output_size=size))
        return bytes(import_module("lz4.frame").decompress(data))
    except (ImportError, RuntimeError) as error:
        raise ValueError(f"{compression}: {_reason(error)}") from error
    except Exception as error:  # the errors of these libraries derive from Exception alone
        if type(error).__module__.split(".")[0] not in ("zstandard", "zstd", "lz4"):
            raise
        raise ValueError(f"{compression}: {_reason(error)}") from error


def _rows(bag: Path, opened: _Bag, meaning: Meaning, unknown: set[str]) -> Iterator[ForeignRow]:
    kinds = {message.topic: message.kind for message in opened.messages()}
    topics = sorted(topic for topic, kind in kinds.items() if kind in (_RANGE, _SCAN, _CLOUD))
    if meaning.topic is not None and meaning.topic not in topics:
        raise InputError(f"{bag}: no topic {meaning.topic!r}; topics with ranges: {', '.join(topics) or 'none'}")
    chosen = topics if meaning.topic is None else [meaning.topic]
    yaws = _yaws_of_frames(opened)
    chosen_messages = [message for message in opened.messages() if message.topic in chosen]
    for number, message in enumerate(sorted(chosen_messages, key=lambda message: message.time)):
        where = f"message {number + 1} of the topics with ranges"
        if len(message.content) > _MOST_BYTES:
            raise InputError(f"{bag}, {where}: {len(message.content)} bytes; expected at most {_MOST_BYTES}")
        try:
            content = opened.decode(message)
        except _DAMAGE as error:
            opened.damage.append(f"{where}: {_reason(error)}")
            continue
        seconds = message.time * 1e-9
        if message.kind == _RANGE:
            yaw = yaws.get(content.header.frame_id)
            if yaw is None or meaning.step:
                unknown.add(message.topic)
                yaw = topics.index(message.topic) * meaning.step
            yield ForeignRow(where, yaw, _echo(content.range, content.min_range, content.max_range), seconds)
        elif message.kind == _SCAN:
            yield from _scan_rows(bag, where, content, seconds, number)
        else:
            yield from _cloud_rows(where, content, seconds, number)


def _scan_rows(bag: Path, where: str, content: Any, seconds: float, number: int) -> Iterator[ForeignRow]:
    step, start = math.degrees(content.angle_increment), math.degrees(content.angle_min)
    if not (math.isfinite(start) and math.isfinite(step)):
        raise InputError(f"{bag}, {where}: an angle is not finite")
    for k, distance in enumerate(content.ranges.tolist()):
        yield ForeignRow(
            where, start + k * step, _echo(distance, content.range_min, content.range_max), seconds, number
        )


def _cloud_rows(where: str, content: Any, seconds: float, number: int) -> Iterator[ForeignRow]:
    """Yield a ring of sensors as points around the robot."""
    for point in content.points:
        distance = math.hypot(point.x, point.y)
        if math.isfinite(distance):
            heading = math.degrees(math.atan2(point.y, point.x))
            yield ForeignRow(where, heading, distance or None, seconds, number)


def _echo(distance: float, least: float, most: float) -> float | None:
    """Return a range, or None if it is outside the limits that its message states."""
    inside = math.isfinite(distance) and max(least, 0.0) <= distance <= most
    return distance if inside else None


def _yaws_of_frames(opened: _Bag) -> dict[str, float]:
    """Return the directions of the fixed frames in that of the robot, degrees, from `/tf_static`."""
    parents: dict[str, tuple[str, float]] = {}
    for message in opened.messages():
        if message.kind != _FRAMES or not message.topic.endswith("tf_static"):
            continue
        try:
            transforms = opened.decode(message).transforms
        except _DAMAGE as error:
            opened.damage.append(_reason(error))
            continue
        for stamped in transforms:
            yaw = math.degrees(_yaw(stamped.transform.rotation))
            parents[stamped.child_frame_id.lstrip("/")] = stamped.header.frame_id.lstrip("/"), yaw
    yaws = {}
    for frame in parents:
        total, at, seen = 0.0, frame, set[str]()
        while at in parents and at not in seen:
            seen.add(at)
            at, yaw = parents[at][0], parents[at][1]
            total += yaw
        yaws[frame] = total
        yaws[f"/{frame}"] = total
    return yaws


def _yaw(turn: Any) -> float:
    """Return the turn of a quaternion about the vertical, rad, counter-clockwise."""
    return math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))


def _poses(opened: _Bag) -> list[tuple[float, RobotPose]]:
    """Return times (s) and poses of the robot: of the first topic with odometry, else of its frame in `/tf`."""
    odometry: dict[str, list[tuple[float, RobotPose]]] = {}
    frames: dict[str, tuple[str, RobotPose]] = {}  # newest transform of each frame, by its name
    of_frames: dict[str, list[tuple[float, RobotPose]]] = {base: [] for base in _BASES}
    for message in sorted(
        (message for message in opened.messages() if _has_pose(message)), key=lambda message: message.time
    ):
        try:
            content = opened.decode(message)
        except _DAMAGE as error:
            opened.damage.append(_reason(error))
            continue
        seconds = message.time * 1e-9
        if message.kind == _ODOMETRY:
            pose = content.pose.pose
            placed = float(pose.position.x), float(pose.position.y), _yaw(pose.orientation)
            odometry.setdefault(message.topic, []).append((seconds, placed))
            continue
        for stamped in content.transforms:
            move = stamped.transform
            placed = float(move.translation.x), float(move.translation.y), _yaw(move.rotation)
            frames[stamped.child_frame_id.lstrip("/")] = stamped.header.frame_id.lstrip("/"), placed
        for base in _BASES:
            if any(stamped.child_frame_id.lstrip("/") == base for stamped in content.transforms):
                of_frames[base].append((seconds, _in_root(base, frames)))
    known = [odometry[topic] for topic in sorted(odometry)] + [of_frames[base] for base in _BASES]
    return next((stamped for stamped in known if stamped), [])


def _has_pose(message: _Message) -> bool:
    return message.kind == _ODOMETRY or (message.kind == _FRAMES and not message.topic.endswith("tf_static"))


def _in_root(frame: str, frames: dict[str, tuple[str, RobotPose]]) -> RobotPose:
    """Return the pose of a frame in the last of its parents, such as `map` or `odom`."""
    parent, pose = frames[frame]
    seen = {frame}
    while parent in frames and parent not in seen:
        seen.add(parent)
        parent, of_parent = frames[parent]
        pose = moved_by(of_parent, pose)
    return pose
