"""The index at the end of a closed log: its readings without traces, and the position of each in the file.

It contains the result of a `ScanDecoder`, so that the frames need not be decoded again to open a log. It is an MCAP
attachment, an .npz file of plain columns. The index is ignored if it has another version, or if another tool has copied
it into another file. The frames are then decoded.
"""

import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any, TypeVar

import numpy as np

from sonarhw.log.contents import RecordedScan
from sonarhw.log.reading_columns import Columns
from sonarhw.log.recorded_scans import DecodedScan, ScanDecoder
from sonarhw.wire.messages import Finished, Info, Message, MessageError, Settings

NAME = "sonarhw.index.npz"
MEDIA_TYPE = "application/x-npz"
_VERSION = 2
_HEAD = "head"  # the JSON text beside the columns, as bytes
_UNREADABLE = (zipfile.BadZipFile, KeyError, ValueError, TypeError, OSError, EOFError, MessageError)

_M = TypeVar("_M", bound=Message)


@dataclass(frozen=True)
class IndexedScan:
    """A scan in the index, with its readings in columns."""

    scan: RecordedScan  # without readings
    columns: Columns


@dataclass(frozen=True)
class LogIndex:
    """The decoded contents of the frames of a log."""

    info: Info | None
    settings: Settings | None
    frames: int
    scans: tuple[IndexedScan, ...]


def index_of(decoder: ScanDecoder) -> LogIndex:
    """Return the index of the frames that `decoder` has processed."""
    return LogIndex(decoder.info, decoder.settings, decoder.frames, tuple(map(_indexed, decoder.scans())))


def _indexed(scan: DecodedScan) -> IndexedScan:
    recorded = RecordedScan(scan.began, scan.expected, scan.settings, (), scan.finished, tuple(scan.homed))
    return IndexedScan(recorded, scan.readings.columns())


def pack_index(index: LogIndex, at: int) -> bytes:
    """Return the bytes of an index that will be at offset `at` of the file."""
    head = {
        "version": _VERSION,
        "at": at,
        "info": _packed(index.info),
        "settings": _packed(index.settings),
        "frames": index.frames,
        "scans": [
            {
                "began": indexed.scan.began,
                "expected": indexed.scan.expected,
                "settings": _packed(indexed.scan.settings),
                "finished": _packed(indexed.scan.finished),
                "homed": indexed.scan.homed,
            }
            for indexed in index.scans
        ],
    }
    arrays = {
        f"{number}/{name}": column for number, scan in enumerate(index.scans) for name, column in scan.columns.items()
    }
    packed = BytesIO()
    np.savez(packed, allow_pickle=False, **{_HEAD: np.frombuffer(json.dumps(head).encode(), np.uint8)}, **arrays)
    return packed.getvalue()


def unpack_index(data: bytes, at: int) -> LogIndex | None:
    """Return the index in an attachment at offset `at`. None if it has another version or belongs to another file."""
    try:
        with np.load(BytesIO(data)) as arrays:
            head = json.loads(arrays[_HEAD].tobytes())
            if (head["version"], head["at"]) != (_VERSION, at):
                return None
            columns: Sequence[Columns] = [{} for _ in head["scans"]]
            for name in arrays.files:
                if name != _HEAD:
                    number, _, column = name.partition("/")
                    columns[int(number)][column] = arrays[name]
    except _UNREADABLE:
        return None
    return LogIndex(
        _unpacked(Info, head["info"]),
        _unpacked(Settings, head["settings"]),
        head["frames"],
        tuple(_scan(scan, mine) for scan, mine in zip(head["scans"], columns, strict=True)),
    )


def _scan(scan: dict[str, Any], columns: Columns) -> IndexedScan:
    settings, finished = _unpacked(Settings, scan["settings"]), _unpacked(Finished, scan["finished"])
    recorded = RecordedScan(scan["began"], scan["expected"], settings, (), finished, tuple(scan["homed"]))
    return IndexedScan(recorded, columns)


def _packed(message: Message | None) -> str | None:
    return None if message is None else message.pack().hex()


def _unpacked(kind: type[_M], packed: str | None) -> _M | None:
    return None if packed is None else kind.unpack(bytes.fromhex(packed))
