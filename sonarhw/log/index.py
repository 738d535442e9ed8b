"""The index at the end of a closed log: its readings without traces, and the position of each in the file.

It contains the result of a `ScanDecoder`, so that the frames need not be decoded again to open a log. It is an MCAP
attachment, an .npz file of plain columns. The index is ignored if it has another version, if its contents are invalid,
or if another tool has copied it into another file. The frames are then decoded.
"""

import json
import re
import struct
import zipfile
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sonarhw.log.contents import RecordedScan
from sonarhw.log.reading_columns import Columns, check_columns
from sonarhw.log.recorded_scans import DecodedScan, ScanDecoder
from sonarhw.wire.messages import Finished, Info, Message, MessageError, Settings

NAME = "sonarhw.index.npz"
MEDIA_TYPE = "application/x-npz"
_VERSION = 2
_HEAD = "head"  # the JSON text beside the columns, as bytes
_ARRAY_HEAD = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '(?P<kind>[<|][fiu][18])', 'fortran_order': False, "
    rb"'shape': \((?P<size>\d{1,15}),\), \} *\n",
    re.DOTALL,
)
_UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, struct.error, NotImplementedError, RuntimeError, MessageError),
    *(LookupError, ValueError, TypeError, AttributeError, OverflowError, OSError, EOFError),
)

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
    """Return the index in an attachment at offset `at`. None if it has another version or belongs to another file.

    None also if its contents are invalid, although the checksums of the file are correct.
    """
    try:
        arrays = _arrays(data)
        head = json.loads(arrays.pop(_HEAD).tobytes())
        if (head["version"], head["at"]) != (_VERSION, at):
            return None
        columns: list[Columns] = [{} for _ in head["scans"]]
        for name, array in arrays.items():
            number, _, column = name.partition("/")
            columns[int(number)][column] = array
        scans = tuple(_scan(scan, mine, at) for scan, mine in zip(head["scans"], columns, strict=True))
        return LogIndex(_unpacked(Info, head["info"]), _unpacked(Settings, head["settings"]), _count(head), scans)
    except _UNREADABLE:
        return None


def _arrays(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the one-dimensional arrays of an .npz file without compression. Raises the errors in _UNREADABLE."""
    with zipfile.ZipFile(BytesIO(data)) as archive:
        members = archive.infolist()
        if any(member.compress_type != zipfile.ZIP_STORED for member in members):
            raise ValueError("a compressed index")  # its size is unlimited
        if sum(member.file_size for member in members) > len(data):
            raise ValueError("members of the index share bytes")
        return {member.filename.removesuffix(".npy"): _array(archive.read(member)) for member in members}


def _array(stored: bytes) -> NDArray[Any]:
    # np.load would allocate as much as the file declares, and evaluates the text of its header
    head = _ARRAY_HEAD.match(stored)
    if head is None:
        raise ValueError("a header that numpy does not write for these columns")
    array = np.frombuffer(stored, head["kind"].decode(), offset=head.end())
    if array.shape != (int(head["size"]),):
        raise ValueError(f"declared size {int(head['size'])}, {array.shape} stored")
    return array


def _count(head: dict[str, Any]) -> int:
    if not (isinstance(head["frames"], int) and head["frames"] >= 0):
        raise ValueError("no number of frames")
    return head["frames"]


def _scan(scan: dict[str, Any], columns: Columns, end: int) -> IndexedScan:
    settings, finished = _unpacked(Settings, scan["settings"]), _unpacked(Finished, scan["finished"])
    began, expected, homed = float(scan["began"]), scan["expected"], tuple(map(float, scan["homed"]))
    if not np.isfinite((began, *homed)).all() or not (expected is None or isinstance(expected, int)):
        raise ValueError("no times or number of readings")
    check_columns(columns, end)
    return IndexedScan(RecordedScan(began, expected, settings, (), finished, homed), columns)


def _packed(message: Message | None) -> str | None:
    return None if message is None else message.pack().hex()


def _unpacked(kind: type[_M], packed: str | None) -> _M | None:
    return None if packed is None else kind.unpack(bytes.fromhex(packed))
