"""A strict check of an MCAP file, with the list of checks of the MCAP command line's doctor.

Reads the file from front to back with the published library, which checks every CRC-32, and compares index, statistics
and summary with the records.
"""

import struct
import zlib
from collections import Counter
from dataclasses import replace
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk, get_chunk_data_stream

Placed = tuple[int, int, McapRecord]  # offset and length in the file


def placed_records(path: Path) -> list[Placed]:
    """Return every record of a file with its position. Raises McapError for a wrong CRC-32."""
    data = path.read_bytes()
    with path.open("rb") as file:
        records = [*StreamReader(file, emit_chunks=True, validate_crcs=True).records]
    placed, at = [], 8
    for record in records:
        (length,) = struct.unpack_from("<Q", data, at + 1)
        placed.append((at, 9 + length, record))
        at += 9 + length
    assert at == len(data) - 8
    return placed


def complaints(path: Path) -> list[str]:
    """Return the errors that the doctor would report; empty for a valid file."""
    try:
        placed = placed_records(path)
    except (McapError, CRCValidationError) as error:
        return [str(error)]
    end = next(number for number, (_, _, record) in enumerate(placed) if isinstance(record, DataEnd))
    data, summary = placed[:end], [record for _, _, record in placed[end + 1 :]]
    return [
        *_order(placed),
        *_checksums(path, placed, end),
        *_chunks(data),
        *_indexes(data, summary),
        *_statistics(data, summary),
        *_summary_offsets(placed[end + 1 :]),
    ]


def _order(placed: list[Placed]) -> list[str]:
    kinds = [type(record) for _, _, record in placed]
    wrong = [] if kinds[0] is Header and kinds[-1] is Footer else ["header or footer is misplaced"]
    if Counter(kinds)[Header] != 1 or Counter(kinds)[DataEnd] != 1 or Counter(kinds)[Footer] != 1:
        wrong.append("header, data end or footer is missing or repeated")
    return wrong


def _checksums(path: Path, placed: list[Placed], end: int) -> list[str]:
    data = path.read_bytes()
    at, _, data_end = placed[end]
    footer_at, footer_length, footer = placed[-1]
    wrong = [] if data_end.data_section_crc == zlib.crc32(data[:at]) else ["CRC-32 of the data section"]
    summary = data[footer.summary_start : footer_at + footer_length - 4]
    return wrong if footer.summary_crc == zlib.crc32(summary) else [*wrong, "CRC-32 of the summary"]


def _chunks(data: list[Placed]) -> list[str]:
    wrong: list[str] = []
    channels: dict[int, Channel] = {}
    schemas: dict[int, Schema] = {}
    for at, _, record in data:
        if not isinstance(record, Chunk):
            continue
        if not record.uncompressed_crc:
            wrong.append(f"chunk at {at} has no CRC-32")
        times = []
        for inner in breakup_chunk(record, validate_crc=True):
            if isinstance(inner, Schema):
                schemas[inner.id] = inner
            elif isinstance(inner, Channel):
                channels[inner.id] = inner
                if inner.schema_id and inner.schema_id not in schemas:
                    wrong.append(f"channel {inner.topic} has schema {inner.schema_id}, which is not yet defined")
            elif isinstance(inner, Message):
                times.append(inner.log_time)
                if inner.channel_id not in channels:
                    wrong.append(f"a message of channel {inner.channel_id}, which is not yet defined")
        if times and (min(times), max(times)) != (record.message_start_time, record.message_end_time):
            wrong.append(f"chunk at {at}: start or end time differs from its messages")
        if times != sorted(times):
            wrong.append(f"chunk at {at}: times decrease")
    return wrong


def _indexes(data: list[Placed], summary: list[McapRecord]) -> list[str]:
    wrong: list[str] = []
    by_offset = {at: (length, record) for at, length, record in data}
    indexed = set()
    for index in summary:
        if isinstance(index, ChunkIndex):
            wrong += _chunk_index(index, data, by_offset)
            indexed.add(index.chunk_start_offset)
        elif isinstance(index, AttachmentIndex):
            length, record = by_offset[index.offset]
            assert isinstance(record, Attachment)
            if (index.length, index.name, index.data_size) != (length, record.name, len(record.data)):
                wrong.append(f"index of attachment {index.name}")
        elif isinstance(index, MetadataIndex):
            length, record = by_offset[index.offset]
            assert isinstance(record, Metadata)
            if (index.length, index.name) != (length, record.name):
                wrong.append(f"index of metadata {index.name}")
    missing = {at for at, _, record in data if isinstance(record, Chunk)} - indexed
    return [*wrong, *(f"chunk at {at} has no index" for at in missing)]


def _chunk_index(index: ChunkIndex, data: list[Placed], by_offset: dict[int, tuple[int, McapRecord]]) -> list[str]:
    length, chunk = by_offset[index.chunk_start_offset]
    where = f"index of the chunk at {index.chunk_start_offset}"
    wrong = []
    if (index.chunk_length, index.compressed_size, index.uncompressed_size) != (
        (length, len(chunk.data), chunk.uncompressed_size)
    ):
        wrong.append(f"{where}: sizes")
    if (index.message_start_time, index.message_end_time) != (chunk.message_start_time, chunk.message_end_time):
        wrong.append(f"{where}: times")
    begin = index.chunk_start_offset + index.chunk_length
    following = [r for at, _, r in data if begin <= at < begin + index.message_index_length]
    if {one.channel_id for one in following if isinstance(one, MessageIndex)} != {*index.message_index_offsets}:
        wrong.append(f"{where}: message indexes")
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    content = stream.read(size)
    counted = 0
    for channel, offset in index.message_index_offsets.items():
        _, entries = by_offset[offset]
        assert isinstance(entries, MessageIndex)
        for time, at in entries.records:
            opcode, inner = content[at], ReadDataStream(_Bytes(content[at + 9 :]))
            message = Message.read(inner, struct.unpack_from("<Q", content, at + 1)[0])
            counted += 1
            if opcode != Opcode.MESSAGE or (message.channel_id, message.log_time) != (channel, time):
                wrong.append(f"{where}: an entry of channel {channel} has a wrong offset")
    held = sum(isinstance(record, Message) for record in breakup_chunk(chunk))
    return wrong if counted == held else [*wrong, f"{where}: {counted} of {held} messages"]


class _Bytes:
    """Bytes to read from, for a ReadDataStream."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def read(self, size: int) -> bytes:
        self._at += size
        return self._data[self._at - size : self._at]


def _statistics(data: list[Placed], summary: list[McapRecord]) -> list[str]:
    (listed,) = (record for record in summary if isinstance(record, Statistics))
    chunks = [record for _, _, record in data if isinstance(record, Chunk)]
    inner = [record for chunk in chunks for record in breakup_chunk(chunk)]
    messages = [record for record in inner if isinstance(record, Message)]
    times = [message.log_time for message in messages]
    counted = Statistics(
        attachment_count=sum(isinstance(record, Attachment) for _, _, record in data),
        channel_count=len({record.id for record in inner if isinstance(record, Channel)}),
        channel_message_counts=Counter(message.channel_id for message in messages),
        chunk_count=len(chunks),
        message_count=len(messages),
        metadata_count=sum(isinstance(record, Metadata) for _, _, record in data),
        message_start_time=min(times, default=0),
        message_end_time=max(times, default=0),
        schema_count=len({record.id for record in inner if isinstance(record, Schema)}),
    )
    wrong = [] if replace(listed) == counted else [f"statistics: {listed} instead of {counted}"]
    for kind in (Schema, Channel):
        repeated = {record.id: record for record in summary if isinstance(record, kind)}
        if repeated != {record.id: record for record in inner if isinstance(record, kind)}:
            wrong.append(f"{kind.__name__} records of the summary differ from the data")
    return wrong


def _summary_offsets(placed: list[Placed]) -> list[str]:
    opcodes = {
        Schema: Opcode.SCHEMA,
        Channel: Opcode.CHANNEL,
        Statistics: Opcode.STATISTICS,
        ChunkIndex: Opcode.CHUNK_INDEX,
        AttachmentIndex: Opcode.ATTACHMENT_INDEX,
        MetadataIndex: Opcode.METADATA_INDEX,
    }
    wrong = []
    for offset in (record for _, _, record in placed if isinstance(record, SummaryOffset)):
        begin, end = offset.group_start, offset.group_start + offset.group_length
        group = [opcodes.get(type(record)) for at, _, record in placed if begin <= at < end]
        if {*group} - {offset.group_opcode}:
            wrong.append(f"summary offset of {offset.group_opcode}")
    return wrong
