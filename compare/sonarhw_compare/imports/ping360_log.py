"""Profiles of a Ping360 in the sensor logs (`.bin`) of Ping Viewer.

Ping Viewer writes big-endian: a header (its `src/link/logsensorstruct.cpp`), then pairs of texts and arrays, each after
its length in bytes: the time `hh:mm:ss.zzz`, in UTF-16 or UTF-8, and one message of the Ping protocol
(its `examples/decode_sensor_binary_log.py`). The
messages `device_data` (2300) and `auto_device_data` (2301) contain one profile each.
"""

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from sonarhw.errors import InputError
from sonarhw.readings import Reading, Trace
from sonarhw_compare.imports.foreign_rows import ForeignRow, Meaning, readings_of

_TEXTS = 5  # of the program that wrote the log, after title and version
_MOST_BYTES = 65_536  # of one text or message
_DAY = 86_400.0  # s
_TICK = 25e-9  # s, unit of the sample period
_DEGREES = 0.9  # of one gradian
_START = b"BR"
_FRAME = struct.Struct("<2sHHBB")  # start, length of the payload, message, sender, receiver
_PROFILES = {2300: struct.Struct("<BBHHHHHH"), 2301: struct.Struct("<BBHHHHHHBBHH")}
_TIME = re.compile(r"(\d\d):(\d\d):(\d\d)\.(\d{3})", re.ASCII)


def read_ping360_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the profiles of a log as traces, at least one. Raises InputError.

    A log that ends within a profile gives those before.
    """
    try:
        with file.open("rb") as data:
            readings = readings_of(str(file), _rows(file, data), meaning)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected a log of Ping Viewer") from error
    if not readings:
        raise InputError(f"{file}: has no profile of a Ping360; expected a log of Ping Viewer with one")
    return readings


def _rows(file: Path, data: BinaryIO) -> Iterator[ForeignRow]:
    _check_header(file, data)
    before, days, number = 0.0, 0.0, 0
    while (text := _array(file, data)) is not None and (frame := _array(file, data)) is not None:
        number += 1
        where = f"message {number}"
        seconds = _seconds(file, where, text)
        # a log over midnight begins again at 0
        days += _DAY if seconds < before - _DAY / 2 else 0.0
        before = seconds
        profile = _profile(file, where, frame)
        if profile is not None:
            gradians, trace = profile
            yield ForeignRow(where, _DEGREES * gradians, None, seconds + days, trace=trace)


def _check_header(file: Path, data: BinaryIO) -> None:
    """Skip the header. Raises InputError if there is none."""
    title = _array(file, data)
    if title is None or "ping" not in _decoded(title).lower():
        raise InputError(f"{file}: has no header of Ping Viewer; expected one of its sensor logs")
    data.read(4)
    for _ in range(_TEXTS):
        _array(file, data)
    data.read(8)


def _array(file: Path, data: BinaryIO) -> bytes | None:
    """Return the next text or message; None at the end of the log."""
    start = data.read(4)
    if len(start) < 4:
        return None
    (count,) = struct.unpack(">I", start)
    if count == 0xFFFFFFFF:  # a null text of Qt
        return b""
    if count > _MOST_BYTES:
        raise InputError(f"{file}: a text or message of {count} bytes; expected a log of Ping Viewer")
    content = data.read(count)
    return content if len(content) == count else None


def _decoded(text: bytes) -> str:
    """Return a text in UTF-16 or UTF-8; other characters than those of ASCII are replaced."""
    return text.replace(b"\0", b"").decode("ascii", "replace")


def _seconds(file: Path, where: str, text: bytes) -> float:
    found = _TIME.fullmatch(_decoded(text))
    if found is None:
        raise InputError(f"{file}, {where}: has no time hh:mm:ss.zzz; expected a log of Ping Viewer")
    hours, minutes, seconds, milliseconds = map(int, found.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds + milliseconds / 1000


def _profile(file: Path, where: str, frame: bytes) -> tuple[int, Trace] | None:
    """Return angle (gradians) and trace of a message; None for another message. Raises InputError if it is damaged."""
    if len(frame) < _FRAME.size + 2:
        raise InputError(f"{file}, {where}: {len(frame)} bytes; expected a message of the Ping protocol")
    start, length, message, _, _ = _FRAME.unpack_from(frame)
    payload, checksum = frame[_FRAME.size : -2], int.from_bytes(frame[-2:], "little")
    if start != _START or length != len(payload) or checksum != sum(frame[:-2]) & 0xFFFF:
        raise InputError(f"{file}, {where}: start, length or checksum is wrong; the log is damaged")
    if message not in _PROFILES:
        return None
    layout = _PROFILES[message]
    if len(payload) < layout.size:
        raise InputError(f"{file}, {where}: a profile of {len(payload)} bytes; expected at least {layout.size}")
    fields = layout.unpack_from(payload)
    samples = np.frombuffer(payload[layout.size :], np.uint8) / 255.0
    period = fields[4] * _TICK
    if not period or len(samples) != fields[-1] or not len(samples):
        raise InputError(f"{file}, {where}: a profile of {len(samples)} samples, expected {fields[-1]} and a period")
    return fields[2], Trace(samples, 1.0 / period, 0.0)
