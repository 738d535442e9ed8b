"""Read the records of an MCAP file, whole or torn. Logs are MCAP files.

Damaged places are reported, and reading continues at the next chunk with a correct CRC-32. The index at the end of the
file is not needed. Only one record at a time is in memory.
"""

import math
import re
import struct
import threading
import weakref
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Channel, Footer, Header, Metadata
from mcap.writer import MCAP0_MAGIC

_RECORD = struct.Struct("<BQ")  # opcode, length of the content
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK = struct.Struct("<QQQIIQ")  # start and end time, size, CRC-32, length of the compression's name, stored size
_NAME_AT = 32
_CHUNK_HEAD = re.compile(rb"\x06.{4}\x00{4}.{20}\x00{4}.{4}\x00{4}.{4}\x00{4}", re.DOTALL)  # uncompressed, below 4 GiB
_HEAD_SIZE = _RECORD.size + _CHUNK.size
_DATA_END_SIZE = _RECORD.size + 4
_FOOTER_SIZE = _RECORD.size + 20
WINDOW = 1 << 20
_NEAR = 1 << 20
_MOST = 1 << 28  # bytes of a record that are read; a chunk has less than 1 MB, the index about 100 bytes a reading
UNREADABLE = (McapError, struct.error, UnicodeDecodeError, OverflowError)  # OverflowError: a damaged length


class OpenFile:
    """A file for random access from any thread. It is closed when it is garbage-collected.

    If another process replaces the file, the old contents are still read.
    """

    def __init__(self, path: Path) -> None:
        """Open the file. Raises OSError."""
        self.path = path
        self._file: IO[bytes] = path.open("rb", buffering=0)
        weakref.finalize(self, self._file.close)
        self.size = self._file.seek(0, 2)
        self._lock = threading.Lock()
        self._at, self._window = 0, b""

    def read(self, offset: int, size: int) -> bytes:
        """Return `size` bytes from offset `offset`, fewer at the end of the file. Raises OSError."""
        if offset >= self.size:
            return b""
        with self._lock:
            start = offset - self._at
            if not 0 <= start <= start + size <= len(self._window):
                self._file.seek(offset)
                self._at, self._window, start = offset, self._file.read(max(size, WINDOW)), 0
            return self._window[start : start + size]


class Record(NamedTuple):
    """One record of an MCAP file."""

    at: int  # offset in the file; for a record inside a chunk, offset of the chunk
    opcode: int
    content: bytes


class McapMessage(NamedTuple):
    """One message of an MCAP file."""

    at: int  # offset of its chunk
    channel: int
    time: int  # ns since the epoch
    data: bytes


@dataclass(frozen=True)
class Damage:
    """A place in the file that cannot be read, as a clause."""

    text: str
    at_end: bool = False  # only the end of the file is missing


def is_mcap(file: OpenFile) -> bool:
    """Return whether a file starts like an MCAP file, or has an undamaged chunk near its start. Raises OSError."""
    if file.read(0, len(MCAP0_MAGIC)) == MCAP0_MAGIC:
        return True
    chunk = _next_chunk(file, 0, _NEAR)
    return chunk is not None


Unpack = Callable[[str, bytes, int], bytes]  # method, compressed bytes, size: bytes of a chunk; raises ValueError


def read_records(
    file: OpenFile, start: int = len(MCAP0_MAGIC), *, unpack: Unpack | None = None
) -> Iterator[Record | McapMessage | Damage]:
    """Yield every readable record and message from offset `start`, and the damage between them. Raises OSError.

    Without `unpack`, compressed chunks are damage.
    """
    if start == len(MCAP0_MAGIC) and file.read(0, start) != MCAP0_MAGIC:
        yield Damage("its first bytes are not those of an MCAP file")
    offset = read_until = start  # all readable chunks before `read_until` have been yielded
    last = False  # whether there are no more readable chunks
    while offset < file.size:
        record = _record_at(file, offset)
        if record is None:
            again = None if last else _next_chunk(file, read_until)
            large = _too_large(file, offset)
            if large is not None:
                yield Damage(large)
            if again is None:
                break
            yield Damage(f"bytes {offset if offset < again else read_until} to {again} are damaged and left out")
            offset = read_until = again
            continue
        end = offset + _RECORD.size + len(record.content)
        if record.opcode == Opcode.FOOTER:
            if file.read(end, len(MCAP0_MAGIC) + 1) == MCAP0_MAGIC:
                return
            break
        if record.opcode != Opcode.CHUNK:
            yield record
        elif isinstance(inside := _unpacked(record, unpack), Damage):
            yield inside
            # its length may be damaged too, so that undamaged chunks would be skipped
            again = None if last else _next_chunk(file, offset + 1)
            last = again is None
            read_until = end = again or end
        else:
            yield from inside
            read_until = end
        offset = end
    where = f", in the record that begins at byte {offset}" if offset < file.size else ""
    yield Damage(f"the file ends too early at byte {file.size}{where}", at_end=True)


def _record_at(file: OpenFile, offset: int) -> Record | None:
    """Return the record at offset `offset`; None if there is none, or if it is incomplete."""
    head = file.read(offset, _RECORD.size)
    if len(head) < _RECORD.size:
        return None
    opcode, length = _RECORD.unpack(head)
    # after a power failure a file system leaves zeros for pages that did not reach the disk
    end = offset + _RECORD.size + length
    if not Opcode.HEADER <= opcode <= Opcode.DATA_END or end > file.size or length > _MOST:
        return None
    return Record(offset, opcode, file.read(offset + _RECORD.size, length))


def _too_large(file: OpenFile, offset: int) -> str | None:
    """Return a clause about the record at offset `offset` if it is larger than the limit; None for other damage."""
    head = file.read(offset, _RECORD.size)
    length = _RECORD.unpack(head)[1] if len(head) == _RECORD.size else 0
    if not _MOST < length <= file.size - offset:
        return None
    return f"the record that begins at byte {offset} has {length} bytes; at most {_MOST} bytes are read"


def _unpacked(chunk: Record, unpack: Unpack | None = None) -> Iterator[Record | McapMessage] | Damage:
    """Return the contents of a chunk, or the damage that makes them unreadable."""

    def left_out(why: str) -> Damage:
        return Damage(f"the record that begins at byte {chunk.at} is left out: {why}")

    if len(chunk.content) < _CHUNK.size:
        return left_out("it is damaged")
    _, _, size, crc, name, stored = _CHUNK.unpack_from(chunk.content)
    method = chunk.content[_NAME_AT : _NAME_AT + name]
    if method in (b"lz4", b"zstd") and unpack is None:
        return left_out("it is compressed, but logs of sonarhw are not")
    if name and unpack is not None:
        try:
            data = unpack(method.decode("ascii", "replace"), chunk.content[_CHUNK.size + name :], size)
        except ValueError as error:
            return left_out(str(error))
    elif name or not size == stored == len(chunk.content) - _CHUNK.size:
        return left_out("it is damaged")
    else:
        data = chunk.content[_CHUNK.size :]
    if crc and zlib.crc32(data) != crc:
        return left_out("its CRC-32 does not match")
    if not _is_filled(data):
        return left_out("its records do not fill it")
    return _contents(chunk.at, data)


def _is_filled(data: bytes) -> bool:
    """Return whether a chunk ends with the end of a record."""
    offset = 0
    while offset + _RECORD.size <= len(data):
        offset += _RECORD.size + _RECORD.unpack_from(data, offset)[1]
    return offset == len(data)


def _contents(chunk_at: int, data: bytes) -> Iterator[Record | McapMessage]:
    """Yield the records of a chunk one by one: a list of millions of short ones would need much memory."""
    offset = 0
    while offset < len(data):
        opcode, length = _RECORD.unpack_from(data, offset)
        offset += _RECORD.size
        end = offset + length
        if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
            channel, _, time, _ = _MESSAGE.unpack_from(data, offset)
            yield McapMessage(chunk_at, channel, time, data[offset + _MESSAGE.size : end])
        else:
            yield Record(chunk_at, opcode, data[offset:end])
        offset = end


def _next_chunk(file: OpenFile, start: int, stop: float = math.inf) -> int | None:
    """Return the offset of the next chunk from `start` with a correct CRC-32; None if none starts before `stop`."""
    offset = start
    while offset < min(file.size, stop):
        window = file.read(offset, WINDOW)
        match = _CHUNK_HEAD.search(window)
        while match:
            if _is_chunk(file, offset + match.start()):
                return offset + match.start()
            match = _CHUNK_HEAD.search(window, match.start() + 1)
        offset += max(1, len(window) - _HEAD_SIZE + 1)
    return None


def _is_chunk(file: OpenFile, offset: int) -> bool:
    record = _record_at(file, offset)
    return record is not None and not isinstance(_unpacked(record), Damage)


def checked_attachments(file: OpenFile) -> dict[str, int] | None:
    """Return the offsets of the attachments by name, if checksums prove that the file is undamaged.

    Empty if the file was not closed or has no checksums; None if a checksum does not match.
    """
    footer_at = file.size - len(MCAP0_MAGIC) - _FOOTER_SIZE
    if footer_at < len(MCAP0_MAGIC) or file.read(file.size - len(MCAP0_MAGIC), len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        return {}
    tail = file.read(footer_at, _FOOTER_SIZE)
    footer = Footer.read(ReadDataStream(BytesIO(tail[_RECORD.size :])))
    end = footer.summary_start - _DATA_END_SIZE
    if tail[0] != Opcode.FOOTER or not len(MCAP0_MAGIC) <= end < footer_at or footer_at - end > _MOST:
        return {}
    summary = file.read(footer.summary_start, footer_at - footer.summary_start)
    data_end = file.read(end, _DATA_END_SIZE)
    data_crc = int.from_bytes(data_end[_RECORD.size :], "little")
    intact = footer.summary_crc in (0, zlib.crc32(tail[:-4], zlib.crc32(summary))) and (
        data_end[0] == Opcode.DATA_END and data_crc in (0, _crc(file, end))
    )
    attachments = _attachments(summary) if intact else None
    checked = footer.summary_crc and data_crc
    return attachments if attachments is None or checked else {}


def _crc(file: OpenFile, size: int) -> int:
    crc = 0
    for offset in range(0, size, WINDOW):
        crc = zlib.crc32(file.read(offset, min(WINDOW, size - offset)), crc)
    return crc


def _attachments(summary: bytes) -> dict[str, int] | None:
    """Return the offsets of the attachments by name; None if the summary is damaged."""
    offsets: dict[str, int] = {}
    position = 0
    try:
        while position < len(summary):
            opcode, length = _RECORD.unpack_from(summary, position)
            position += _RECORD.size
            if opcode == Opcode.ATTACHMENT_INDEX:
                index = AttachmentIndex.read(ReadDataStream(BytesIO(summary[position : position + length])))
                offsets[index.name] = index.offset
            position += length
    except UNREADABLE:
        return None
    return offsets


def attachment(file: OpenFile, offset: int) -> bytes | None:
    """Return the data of the attachment at offset `offset`; None if there is none."""
    record = _record_at(file, offset)
    if record is None or record.opcode != Opcode.ATTACHMENT:
        return None
    try:
        data: bytes = Attachment.read(_stream(record)).data
    except UNREADABLE:
        return None
    return data


def profile_of(record: Record) -> str | None:
    """Return the profile in a header; None for other records. Raises the errors in UNREADABLE."""
    return str(Header.read(_stream(record)).profile) if record.opcode == Opcode.HEADER else None


def metadata_of(record: Record) -> tuple[str, dict[str, str]] | None:
    """Return name and fields of a metadata record; None for other records. Raises the errors in UNREADABLE."""
    if record.opcode != Opcode.METADATA:
        return None
    metadata = Metadata.read(_stream(record))
    return metadata.name, metadata.metadata


def channel_of(record: Record) -> dict[int, str]:
    """Return number and topic of a channel record; empty for other records. Raises the errors in UNREADABLE."""
    if record.opcode != Opcode.CHANNEL:
        return {}
    channel = Channel.read(_stream(record))
    return {channel.id: channel.topic}


def _stream(record: Record) -> ReadDataStream:
    return ReadDataStream(BytesIO(record.content))
