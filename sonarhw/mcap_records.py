"""Takes an MCAP file apart record by record, as far as it goes: the container under a log, whole or torn.

Takes the bytes of a file; hands on its header, metadata and messages, and where it is cut or damaged. Nothing here
needs the index at the end of the file.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Metadata
from mcap.writer import MCAP0_MAGIC

_RECORD = struct.Struct("<BQ")  # opcode, length of the content
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_UNREADABLE = (McapError, struct.error, UnicodeDecodeError, OverflowError)  # the last from a damaged length


@dataclass(frozen=True)
class LoggedMessage:
    """One message of an MCAP file."""

    channel: int
    time: int  # ns since the epoch
    data: bytes


@dataclass
class McapContents:
    """What could be read of an MCAP file, filled while it is read."""

    profile: str | None = None  # None: the file ends before its header does
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    topics: dict[int, str] = field(default_factory=dict)  # by channel
    messages: list[LoggedMessage] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)  # what could not be read, with its place; empty: all could

    @property
    def cut(self) -> bool:
        """Whether anything could not be read."""
        return bool(self.damage)


class NotMcapError(ValueError):
    """Bytes that do not begin as an MCAP file."""


class _Cut(Exception):
    """The bytes end inside the record at offset `at`."""

    def __init__(self, at: int) -> None:
        super().__init__(at)
        self.at = at


def read_mcap(data: bytes) -> McapContents:
    """Everything readable in the bytes of an MCAP file. Raises NotMcapError where they do not begin as one."""
    if not data.startswith(MCAP0_MAGIC):
        raise NotMcapError
    contents = McapContents()
    try:
        _read_file(memoryview(data), contents)
    except _Cut as cut:
        inside = "" if cut.at == len(data) else f", in the record that begins at byte {cut.at}"
        contents.damage.append(f"the file ends too early at byte {len(data)}{inside}")
    return contents


def _read_file(data: memoryview, contents: McapContents) -> None:
    for at, opcode, content in _records(data, len(MCAP0_MAGIC)):
        if opcode == Opcode.FOOTER:
            if data[at + _RECORD.size + len(content) :] != MCAP0_MAGIC:
                raise _Cut(at)
            return
        try:
            _read_record(opcode, content, contents)
        except _Damaged as damaged:
            contents.damage.append(f"the record that begins at byte {at} is left out: {damaged}")
        except _UNREADABLE:
            contents.damage.append(f"the record that begins at byte {at} is left out: it is damaged")
    raise _Cut(len(data))


class _Damaged(Exception):
    """A record that is all there but not as it was written."""


def _records(data: memoryview, start: int) -> Iterator[tuple[int, int, memoryview]]:
    """Offset, opcode and content of each record from `start` on; raises _Cut where the last is not whole."""
    at = start
    while at < len(data):
        if at + _RECORD.size > len(data):
            raise _Cut(at)
        opcode, length = _RECORD.unpack_from(data, at)
        end = at + _RECORD.size + length
        # zeros are what a file system leaves of pages that did not reach the disk before the power failed
        if end > len(data) or opcode == 0:
            raise _Cut(at)
        yield at, opcode, data[at + _RECORD.size : end]
        at = end


def _read_record(opcode: int, content: memoryview, contents: McapContents) -> None:
    stream = ReadDataStream(BytesIO(content))
    if opcode == Opcode.CHUNK:
        _read_chunk(Chunk.read(stream), contents)
    elif opcode == Opcode.MESSAGE:
        channel, _, time, _ = _MESSAGE.unpack_from(content)
        contents.messages.append(LoggedMessage(channel, time, bytes(content[_MESSAGE.size :])))
    elif opcode == Opcode.CHANNEL:
        registered = Channel.read(stream)
        contents.topics[registered.id] = registered.topic
    elif opcode == Opcode.METADATA:
        metadata = Metadata.read(stream)
        contents.metadata[metadata.name] = metadata.metadata
    elif opcode == Opcode.HEADER:
        contents.profile = Header.read(stream).profile


def _read_chunk(chunk: Chunk, contents: McapContents) -> None:
    if chunk.compression:
        raise _Damaged(f"it is compressed with {chunk.compression}, which logs of this project never are")
    if chunk.uncompressed_crc and zlib.crc32(chunk.data) != chunk.uncompressed_crc:
        raise _Damaged("its CRC-32 does not match")
    try:
        for _, opcode, content in _records(memoryview(chunk.data), 0):
            _read_record(opcode, content, contents)
    except _Cut:
        raise _Damaged("what it holds does not fill it") from None
