"""Damaged logs. Many have correct checksums: their frames, index, metadata or record lengths state nonsense."""

import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import MISSING, fields, replace
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np
from mcap.opcode import Opcode

from sonarhw.log import LogWriter, reader, writer
from sonarhw.log.writer import write_scan
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.limits import MAX_PAYLOAD
from tests.fixtures.example_logs import METADATA, example_reading
from tests.soak.fuzz.boundaries import NAMES, NUMBERS
from tests.soak.fuzz.damage import damaged_bytes

_MAGIC = 8  # bytes
_HEAD = struct.Struct("<BQ")
_HUGE = (0, 1, 2**16, 2**31, 2**32 - 1, 2**40, 10**15, 2**62, 2**63, 2**64 - 1)
_JUNK: tuple[Any, ...] = (None, -1, 0, 1e308, 2**70, "", "x", [], {}, True, [1], {"a": 1}, "00", "ff" * 40)
_FLOATS = (np.nan, np.inf, -np.inf, 1e308, -1e308, 0.0, -1.0, 1e18)
_INTEGERS = (-1, 0, 2**62, -(2**63), 2**63 - 1, 10**12, 1)


def damaged_log(chance: Random, folder: Path, whole: bytes, room: str, board: str) -> bytes:
    """Return the bytes of a damaged log. `folder` is for temporary files."""
    path = folder / "damaged.part"
    kinds: tuple[Callable[[], bytes], ...] = (
        lambda: damaged_bytes(chance, whole),
        lambda: _other_records(chance, whole),
        lambda: _other_frames(chance, path, room, board),
        lambda: _other_index(chance, path, room, board),
        lambda: _other_metadata(chance, path, room, board),
    )
    try:
        return chance.choice(kinds)()
    finally:
        path.unlink(missing_ok=True)


def log_bytes(path: Path, room: str, board: str, *, traces: bool = False) -> bytes:
    """Return the bytes of a log of 12 readings with its room and board."""
    metadata = replace(METADATA, room_text=room, board_text=board, board="paper")
    write_scan(path, metadata, [example_reading(number, trace=traces) for number in range(12)], overwrite=True)
    return path.read_bytes()


# records with lengths and checksums


def _other_records(chance: Random, data: bytes) -> bytes:
    records = [*_records(data)]
    for _ in range(chance.randrange(1, 3)):
        at = chance.randrange(len(records))
        opcode, content = records[at]
        match chance.randrange(6):
            case 0:
                records[at] = chance.randrange(256), content
            case 1:
                records.insert(at, records[chance.randrange(len(records))])
            case 2:
                del records[at]
            case 3:
                chance.shuffle(records)
            case _:
                records[at] = opcode, _other_number(chance, content)
    written = data[:_MAGIC] + b"".join(_sealed(opcode, content) for opcode, content in records) + data[:_MAGIC]
    if chance.random() < 0.3:  # a length that is longer than the file
        at = chance.randrange(_MAGIC, len(written) - 9)
        written = written[: at + 1] + struct.pack("<Q", chance.choice(_HUGE)) + written[at + 9 :]
    return _with_checksums(written)


def _records(data: bytes) -> list[tuple[int, bytes]]:
    found, at = [], _MAGIC
    while at < len(data) - _MAGIC:
        opcode, length = _HEAD.unpack_from(data, at)
        found.append((opcode, data[at + _HEAD.size : at + _HEAD.size + length]))
        at += _HEAD.size + length
    return found


def _other_number(chance: Random, content: bytes) -> bytes:
    """Return a record with a boundary value in place of one of its numbers, 2, 4 or 8 bytes wide."""
    size, code = chance.choice(((2, "<H"), (4, "<I"), (8, "<Q")))
    if len(content) < size:
        return content
    at = chance.randrange(min(len(content) - size + 1, 80))
    value = chance.choice(_HUGE) % 256**size
    return content[:at] + struct.pack(code, value) + content[at + size :]


def _sealed(opcode: int, content: bytes) -> bytes:
    if opcode == Opcode.CHUNK and len(content) > 40:
        content = content[:24] + struct.pack("<I", zlib.crc32(content[40:])) + content[28:]
    if opcode == Opcode.ATTACHMENT and len(content) > 4:
        content = content[:-4] + struct.pack("<I", zlib.crc32(content[:-4]))
    return _HEAD.pack(opcode % 256, len(content)) + content


def _with_checksums(data: bytes) -> bytes:
    """Return a file whose checksums of data and summary match, if it has a footer and a DataEnd."""
    footer = len(data) - _MAGIC - _HEAD.size - 20
    if footer < _MAGIC or data[footer] != Opcode.FOOTER:
        return data
    (start,) = struct.unpack_from("<Q", data, footer + _HEAD.size)
    end = start - _HEAD.size - 4
    if not _MAGIC <= end < footer or data[end] != Opcode.DATA_END:
        return data
    data = data[: start - 4] + struct.pack("<I", zlib.crc32(data[:end])) + data[start:]
    tail = data[footer : footer + _HEAD.size + 16]
    crc = struct.pack("<I", zlib.crc32(tail, zlib.crc32(data[start:footer])))
    return data[: footer + _HEAD.size + 16] + crc + data[-_MAGIC:]


# frames with correct checksums


def _other_frames(chance: Random, path: Path, room: str, board: str) -> bytes:
    metadata = replace(METADATA, room_text=room, board_text=board, board="paper")
    usual: tuple[type[msg.Message], ...] = (
        msg.Settings,
        msg.Started,
        msg.ReadingMessage,
        msg.ReadingMessage,
        msg.Finished,
    )
    with path.open("wb") as file, LogWriter(file, metadata) as log:
        for number in range(chance.randrange(1, 25)):
            kind = usual[number] if number < len(usual) and chance.random() < 0.8 else None
            sent = chance.random() < 0.2
            kind = kind or chance.choice(msg.FROM_HOST if sent else msg.FROM_DEVICE)
            message = _any_message(chance, kind, number)
            time_us = chance.choice((number * 100_000, 0, 2**63, 2**64 - 1))
            frame = encode_frame(Frame(message.TYPE, chance.choice((0, 1, 2)), time_us, message.pack()[:MAX_PAYLOAD]))
            readings = _take(log, not sent, chance.choice((METADATA.started, 0.0, 1e9, 9e9)) + number, frame)
            if chance.random() < 0.5:
                for reading in readings:
                    log.reading(reading)
    return path.read_bytes()


def _take(log: LogWriter, received: bool, time: float, wire: bytes) -> list[Any]:
    from sonarhw.log import RecordedFrame

    return log.take(RecordedFrame(time, received, wire))


def _any_message(chance: Random, kind: type[msg.Message], number: int) -> msg.Message:
    plain = {"command": 2, "readings": 12, "number": number, "listen_us": 60_000, "speed_of_sound": 343_000}
    values = {}
    for item in fields(kind):
        if item.default is not MISSING and chance.random() < 0.8:
            continue
        usual = plain.get(item.name)
        values[item.name] = usual if usual is not None and chance.random() < 0.8 else _any_field(chance, item.metadata)
    return kind(**values)


def _any_field(chance: Random, metadata: Any) -> Any:
    match metadata["wire"]:
        case msg.Scalar(code=code):
            size = struct.calcsize("<" + code)
            low, high = (-(256**size) // 2, 256**size // 2 - 1) if code.islower() else (0, 256**size - 1)
            return chance.choice((low, high, 0, 1, high // 2, chance.randrange(low, high + 1)))
        case msg.Counted(name="text"):
            return chance.choice(NAMES).encode("ascii", "replace").decode()[:255]
        case msg.Counted(name="u32[]"):
            return tuple(
                chance.choice((0, 1, 2**31, 2**32 - 1, 11_000_000)) for _ in range(chance.choice((0, 1, 3, 122)))
            )
        case msg.Counted(name="u8[]"):
            return chance.randbytes(chance.choice((0, 1, 255, 256)))
    raise AssertionError(metadata)


# the index and the metadata


def _other_index(chance: Random, path: Path, room: str, board: str) -> bytes:
    pack = reader.pack_index

    def packed(*arguments: Any) -> bytes:
        return _other_npz(chance, pack(*arguments))

    with patch.object(reader, "pack_index", packed):
        return log_bytes(path, room, board, traces=chance.random() < 0.5)


def _other_npz(chance: Random, data: bytes) -> bytes:
    arrays = dict(np.load(BytesIO(data)))
    head = json.loads(arrays.pop("head").tobytes())
    for _ in range(chance.randrange(1, 3)):
        name = chance.choice([*arrays])
        match chance.randrange(8):
            case 0:
                part = chance.choice((head, head["scans"][0] if isinstance(head.get("scans"), list) else head))
                part[chance.choice([*part])] = chance.choice(_JUNK)
            case 1:
                del arrays[name]
                return _npz(arrays, head)
            case 2:
                arrays[name] = arrays[name][: chance.randrange(len(arrays[name]) + 1)]
            case 3:
                arrays[name] = chance.choice(
                    (arrays[name].astype(str), arrays[name] == 0, np.full(arrays[name].shape, 1j))
                )
            case 4:
                arrays[name] = chance.choice(
                    (arrays[name].reshape(-1, 1), np.array(1), np.zeros((0, 3)), np.zeros(10**6))
                )
            case 5:
                return _declaring(chance, _npz(arrays, head))
            case _:
                values = _FLOATS if arrays[name].dtype.kind == "f" else _INTEGERS
                if arrays[name].size and arrays[name].dtype.kind in "if":
                    arrays[name].flat[chance.randrange(arrays[name].size)] = chance.choice(values)
    return _npz(arrays, head)


def _npz(arrays: dict[str, Any], head: Any) -> bytes:
    packed = BytesIO()
    np.savez_compressed(packed, head=np.frombuffer(json.dumps(head).encode(), np.uint8), **arrays)
    return packed.getvalue()


def _declaring(chance: Random, data: bytes) -> bytes:
    """Return an .npz file in which one array declares a huge shape, or is huge when it is decompressed."""
    rows = chance.choice((10**9, 10**15, 2**62))
    with zipfile.ZipFile(BytesIO(data)) as before:
        contents = {name: before.read(name) for name in before.namelist()}
    name = chance.choice([*contents])
    member = BytesIO()
    np.lib.format.write_array_header_2_0(member, {"descr": "<f8", "fortran_order": False, "shape": (rows,)})
    contents[name] = member.getvalue() + bytes(8)
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as after:
        for part, content in contents.items():
            after.writestr(part, content)
    return packed.getvalue()


def _other_metadata(chance: Random, path: Path, room: str, board: str) -> bytes:
    record = writer.metadata_record

    def damaged(metadata: Any) -> dict[str, str]:
        found = record(metadata)
        for _ in range(chance.randrange(1, 3)):
            name = chance.choice([*found])
            dates = (
                "0001-01-01T00:00:00",
                "9999-12-31T23:59:59+00:00",
                "1600-01-01T00:00:00+00:00",
                "2026-13-01",
                "nan",
            )
            found[name] = chance.choice((*NAMES[:40], *NUMBERS, *dates, 'name = "x"', 300_000 * "x"))
            found[name] = found[name].encode("utf-8", "replace").decode()
            if chance.random() < 0.2:
                del found[name]
                break
        return found

    with patch.object(writer, "metadata_record", damaged):
        return log_bytes(path, room, board, traces=chance.random() < 0.3)
