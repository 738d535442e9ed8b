"""A log is a valid MCAP file, its channels match their published schemas, and each sweep is a LaserScan."""

import math
import struct
import zlib
from pathlib import Path

import pytest
from foxglove_schemas_protobuf import LaserScan_pb2
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC

from sonarhw.log import copy_log, read_log
from sonarhw.log.mcap_records import OpenFile, Record, read_records
from sonarhw.log.writer import laser_scan, write_scan
from sonarhw.readings import Reading
from tests.fixtures.example_logs import METADATA, example_reading, write_example
from tests.oracles.mcap_doctor import complaints


def test_logs_with_many_sweeps_copies_and_repaired_logs_are_healthy(tmp_path: Path) -> None:
    readings = [example_reading(n, trace=True, sweep=n // 20, angle=math.radians(n % 20)) for n in range(200)]
    write_scan(tmp_path / "scan.mcap", METADATA, readings)
    (tmp_path / "torn.mcap").write_bytes((tmp_path / "scan.mcap").read_bytes()[:-20_000])
    copy_log(read_log(tmp_path / "scan.mcap"), tmp_path / "copy.mcap")
    copy_log(read_log(tmp_path / "torn.mcap"), tmp_path / "repaired.mcap")
    for name in ("scan", "copy", "repaired"):
        assert complaints(tmp_path / f"{name}.mcap") == [], name


def test_sweeps_have_the_published_schema(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap")
    with (tmp_path / "scan.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
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


def test_a_chunk_may_end_with_an_empty_record_of_another_program(tmp_path: Path) -> None:
    """Operation codes from 0x80 on are free for any use, and a record may have no content."""
    records = b"\x80" + struct.pack("<Q", 3) + b"abc" + b"\x81" + struct.pack("<Q", 0)
    head = struct.pack("<QQQII", 0, 0, len(records), zlib.crc32(records), 0) + struct.pack("<Q", len(records))
    path = tmp_path / "other.mcap"
    path.write_bytes(MCAP0_MAGIC + b"\x06" + struct.pack("<Q", len(head + records)) + head + records)
    found = [record for record in read_records(OpenFile(path)) if isinstance(record, Record)]
    assert [(record.opcode, record.content) for record in found] == [(0x80, b"abc"), (0x81, b"")]


# sweeps


SPEED = 340.0


def readings(*rows: tuple[float, float]) -> list[Reading]:
    """Return readings of headings (degrees) and ranges (m; inf: no echo), in order of time."""
    return [
        Reading(k, 0, 0, math.radians(degrees), 0.1 * k, () if math.isinf(far) else (2 * far / SPEED,), SPEED)
        for k, (degrees, far) in enumerate(rows)
    ]


def test_of_several_pings_the_median_range_is_used() -> None:
    scan = laser_scan(readings((0, 1.0), (0, 9.0), (0, 2.0), (5, 3.0), (5, math.inf), (10, math.inf)), 0.0)
    # of two values, the smaller is the median that was measured
    assert [*scan.ranges] == pytest.approx([2.0, 3.0, math.inf])


def test_a_heading_without_a_reading_is_nan_and_one_without_an_echo_infinite() -> None:
    scan = laser_scan(readings((2, 1.0), (1, math.inf), (5, 4.0), (-1, 3.0)), 12.5)
    assert [*scan.ranges] == pytest.approx([3.0, math.nan, math.inf, 1.0, math.nan, math.nan, 4.0], nan_ok=True)
    assert (scan.start_angle, scan.end_angle) == pytest.approx((math.radians(-1), math.radians(5)))
    assert (scan.timestamp.seconds, scan.timestamp.nanos) == (12, 500_000_000)


def test_every_reading_of_a_fine_scan_is_at_its_own_heading() -> None:
    scan = laser_scan(readings(*((0.1 * k, 1.0 + k) for k in range(3600))), 0.0)
    assert [*scan.ranges] == pytest.approx([1.0 + k for k in range(3600)])


def test_headings_that_nearly_coincide_do_not_make_the_grid_huge() -> None:
    scan = laser_scan(readings((0, 1.0), (0.0001, 2.0), (360, 3.0)), 0.0)
    assert len(scan.ranges) == 36_001


def test_a_single_reading_is_a_scan_of_one_range() -> None:
    """The pose of the frame is the identity, a unit quaternion: headings are about the axis of the turntable."""
    scan = laser_scan(readings((30, 2.0)), 0.0)
    assert (scan.pose.orientation.w, scan.pose.orientation.z, scan.pose.position.x) == (1, 0, 0)
    assert [*scan.ranges] == pytest.approx([2.0])
    assert scan.start_angle == scan.end_angle == pytest.approx(math.radians(30))
