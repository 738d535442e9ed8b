"""A log is a valid MCAP file, and its channels match their published schemas."""

import json
import math
import struct
import zlib
from dataclasses import replace
from pathlib import Path

from foxglove_schemas_protobuf import LaserScan_pb2
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC

from sonarhw.log import LogWriter, copy_log, read_log
from sonarhw.log.mcap_records import OpenFile, Record, read_records
from sonarhw.log.writer import write_scan
from tests.fixtures.example_logs import METADATA, example_reading, write_example
from tests.oracles.mcap_doctor import complaints
from tests.unit.sonarhw.log.test_log_index import CONVERSATIONS, record


def test_a_closed_log_is_a_healthy_mcap_file(tmp_path: Path) -> None:
    for name, frames in CONVERSATIONS.items():
        if frames():
            record(tmp_path / f"{name}.mcap", frames())
            assert complaints(tmp_path / f"{name}.mcap") == [], name


def test_logs_with_many_sweeps_copies_and_repaired_logs_are_healthy(tmp_path: Path) -> None:
    readings = [example_reading(n, trace=True, sweep=n // 20, angle=math.radians(n % 20)) for n in range(200)]
    write_scan(tmp_path / "scan.mcap", METADATA, readings)
    (tmp_path / "torn.mcap").write_bytes((tmp_path / "scan.mcap").read_bytes()[:-20_000])
    copy_log(read_log(tmp_path / "scan.mcap"), tmp_path / "copy.mcap")
    copy_log(read_log(tmp_path / "torn.mcap"), tmp_path / "repaired.mcap")
    for name in ("scan", "copy", "repaired"):
        assert complaints(tmp_path / f"{name}.mcap") == [], name


def test_the_doctor_reports_damage(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap")
    content = (tmp_path / "scan.mcap").read_bytes()
    room = content.index(b"Simple")
    (tmp_path / "scan.mcap").write_bytes(content[:room] + b"S" + content[room + 1 :])
    assert complaints(tmp_path / "scan.mcap") == []
    (tmp_path / "scan.mcap").write_bytes(content[:room] + b"s" + content[room + 1 :])
    (complaint,) = complaints(tmp_path / "scan.mcap")
    assert "crc validation failed in DataEnd" in complaint


def test_sweeps_have_the_published_schema(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap")
    with (tmp_path / "scan.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    (channel,) = (channel for channel in summary.channels.values() if channel.topic == "/scan")
    schema = summary.schemas[channel.schema_id]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("foxglove.LaserScan", "protobuf", "protobuf")
    carried = {file.name: file for file in FileDescriptorSet.FromString(schema.data).file}
    published = LaserScan_pb2.DESCRIPTOR
    for file_descriptor in (published, *published.dependencies):
        assert carried[file_descriptor.name].SerializeToString() == file_descriptor.serialized_pb
    assert [(field.name, field.number) for field in carried[published.name].message_type[0].field] == [
        ("timestamp", 1),
        ("frame_id", 2),
        ("pose", 3),
        ("start_angle", 4),
        ("end_angle", 5),
        ("ranges", 6),
        ("intensities", 7),
    ]


def test_decoded_readings_match_their_schema(tmp_path: Path) -> None:
    readings = [example_reading(number) for number in range(3)]
    readings[1] = replace(readings[1], temperature_c=None)
    with LogWriter(tmp_path / "scan.mcap", METADATA) as log:
        for reading in readings:
            log.reading(reading)
    kinds = {"number": (int, float), "integer": int, "array": list, "null": type(None)}
    with (tmp_path / "scan.mcap").open("rb") as file:
        messages = [*make_reader(file).iter_messages(topics=["/readings"])]
    assert len(messages) == 3
    for schema, channel, message in messages:
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        published = json.loads(schema.data)
        decoded = json.loads(message.data)
        assert published["type"] == "object"
        assert decoded.keys() == published["properties"].keys()
        for name, value in decoded.items():
            wanted = published["properties"][name]["type"]
            allowed = wanted if isinstance(wanted, list) else [wanted]
            assert any(isinstance(value, kinds[kind]) for kind in allowed), name


def test_a_chunk_may_end_with_an_empty_record_of_another_program(tmp_path: Path) -> None:
    """Operation codes from 0x80 on are free for any use, and a record may have no content."""
    records = b"\x80" + struct.pack("<Q", 3) + b"abc" + b"\x81" + struct.pack("<Q", 0)
    head = struct.pack("<QQQII", 0, 0, len(records), zlib.crc32(records), 0) + struct.pack("<Q", len(records))
    path = tmp_path / "other.mcap"
    path.write_bytes(MCAP0_MAGIC + b"\x06" + struct.pack("<Q", len(head + records)) + head + records)
    found = [record for record in read_records(OpenFile(path)) if isinstance(record, Record)]
    assert [(record.opcode, record.content) for record in found] == [(0x80, b"abc"), (0x81, b"")]
