"""Logs with nonsense behind correct checksums: everything readable is read, and no declared size is believed."""

import json
import math
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonarhw.log.reader
from sonarhw.errors import NotALog
from sonarhw.log import copy_log, read_log
from sonarhw.log.reader import unpack_index
from tests.fixtures.example_logs import METADATA, write_example

COUNT = 6
Arrays = dict[str, Any]


def log_with_index(
    path: Path, patch: pytest.MonkeyPatch, change: Callable[[Arrays, Arrays], None], compressed: bool = False
) -> None:
    """Write a log whose index is changed before it gets its checksum. `change` gets its columns and its head."""
    pack = sonarhw.log.reader.pack_index

    def changed(*arguments: Any) -> bytes:
        columns = dict(np.load(BytesIO(pack(*arguments))))
        head = json.loads(columns.pop("head").tobytes())
        change(columns, head)
        packed = BytesIO()
        save = np.savez_compressed if compressed else np.savez
        save(packed, head=np.frombuffer(json.dumps(head).encode(), np.uint8), **columns)
        return packed.getvalue()

    patch.setattr(sonarhw.log.reader, "pack_index", changed)
    write_example(path, COUNT, trace=True)


def at(column: str, value: float) -> Callable[[Arrays, Arrays], None]:
    """Return a change of one value in a column."""

    def change(columns: Arrays, _head: Arrays) -> None:
        columns[f"0/{column}"][2] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        at("angle", np.nan),
        at("angle", 1e9),
        at("time", np.inf),
        at("echo_times", -1.0),
        at("echo_times", np.nan),
        at("echoes", 10**12),
        at("echoes", -1),
        at("number", -1),
        at("first_chunk", 10**15),
        at("last_chunk", 10**15),
        lambda columns, _: columns.pop("0/angle"),
        lambda columns, _: columns.update({"0/angle": columns["0/angle"][:3]}),
        lambda columns, _: columns.update({"0/angle": columns["0/angle"].reshape(-1, 1)}),
        lambda columns, _: columns.update({"0/angle": columns["0/angle"].astype(str)}),
        lambda columns, _: columns.update({"7/angle": columns["0/angle"]}),
        lambda columns, _: columns.update({"x": columns["0/angle"]}),
        lambda _, head: head.update(scans=None),
        lambda _, head: head.update(info="zz"),
        lambda _, head: head.update(settings="00"),
        lambda _, head: head.update(frames=-1),
        lambda _, head: head.update(frames="many"),
        lambda _, head: head["scans"][0].update(began=None),
        lambda _, head: head["scans"][0].update(began=math.nan),
        lambda _, head: head["scans"][0].update(homed=3),
        lambda _, head: head["scans"][0].update(homed=[math.inf]),
        lambda _, head: head["scans"][0].update(expected="six"),
        lambda _, head: head.pop("version"),
    ],
)
def test_an_invalid_index_is_replaced_by_the_frames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Arrays, Arrays], None]
) -> None:
    write_example(tmp_path / "whole.mcap", COUNT, trace=True)
    whole = read_log(tmp_path / "whole.mcap")
    log_with_index(tmp_path / "scan.mcap", monkeypatch, change)
    log = read_log(tmp_path / "scan.mcap")
    assert [(reading.angle, reading.range) for reading in log.readings] == [
        (reading.angle, reading.range) for reading in whole.readings
    ]
    assert len(log.frames) == len(whole.frames)
    assert len(log.readings[4].trace.samples) == 600


def peak(action: Callable[[], object]) -> int:
    """Return how many bytes an action allocates at most."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_compressed_index_is_not_decompressed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def large(columns: Arrays, _head: Arrays) -> None:
        columns["0/angle"] = np.zeros(4_000_000)

    path = tmp_path / "scan.mcap"
    log_with_index(path, monkeypatch, large, compressed=True)
    assert path.stat().st_size < 1e6
    assert peak(lambda: read_log(path)) < 20e6
    assert len(read_log(path).readings) == COUNT


def test_the_declared_shape_of_an_index_is_not_believed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    header = BytesIO()
    declared = {"descr": "<f8", "fortran_order": False, "shape": (10**15,)}
    np.lib.format.write_array_header_1_0(header, declared)
    pack = sonarhw.log.reader.pack_index

    def declaring(*arguments: Any) -> bytes:
        packed = BytesIO()
        with zipfile.ZipFile(BytesIO(pack(*arguments))) as before, zipfile.ZipFile(packed, "w") as after:
            for name in before.namelist():
                after.writestr(name, header.getvalue() if name == "0/angle.npy" else before.read(name))
        return packed.getvalue()

    monkeypatch.setattr(sonarhw.log.reader, "pack_index", declaring)
    write_example(tmp_path / "scan.mcap", COUNT)
    assert len(read_log(tmp_path / "scan.mcap").readings) == COUNT


@pytest.mark.parametrize("header", ["'''", "(" * 60, "{\n  1\n 2", "{'descr': ((", "[" * 9000])
def test_the_header_of_a_column_is_not_evaluated(header: str) -> None:
    columns = [BytesIO(), BytesIO()]
    np.lib.format.write_array(columns[0], np.zeros(3))
    text = header.encode().ljust(118)
    columns[1].write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text)
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number, column in enumerate(columns):
            archive.writestr(f"{number}/angle.npy", column.getvalue())
    assert unpack_index(packed.getvalue(), 0) is None


def test_an_index_that_lists_the_same_bytes_many_times_is_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("head.npy", bytes(100_000))
        archive.filelist *= 1000
    read: list[str] = []
    monkeypatch.setattr(zipfile.ZipFile, "read", lambda _, member: read.append(member.filename) or b"")
    assert unpack_index(packed.getvalue(), 0) is None
    assert read == []


@pytest.mark.parametrize("length", [2**29, 10**15, 2**64 - 1])
def test_a_declared_length_of_a_record_is_not_allocated(tmp_path: Path, length: int) -> None:
    path = tmp_path / "scan.mcap"
    write_example(path, COUNT)
    content = path.read_bytes()
    record = content.index(b"\x06", 2000)
    damaged = content[: record + 1] + struct.pack("<Q", length) + content[record + 9 :]
    path.write_bytes(damaged)
    assert peak(lambda: read_log(path)) < 20e6
    log = read_log(path)
    assert log.damaged
    assert len(log.readings) >= COUNT - 2


def test_a_huge_record_in_a_sparse_file_is_left_out_with_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    write_example(path, COUNT)
    content = path.read_bytes()
    with path.open("wb") as file:
        file.write(content[:-1])
        file.write(struct.pack("<BQ", 0x09, 1 << 30))
        file.truncate((1 << 30) + len(content) + 100)
    found: list[Any] = []
    assert peak(lambda: found.append(read_log(path))) < 600e6
    assert len(found[0].readings) == COUNT


def test_a_chunk_of_many_short_records_needs_little_memory(tmp_path: Path) -> None:
    import zlib

    path = tmp_path / "scan.mcap"
    write_example(path, COUNT)
    content = path.read_bytes()
    data = struct.pack("<BQ", 0x0F, 0) * 60_000
    head = struct.pack("<QQQIIQ", 0, 0, len(data), zlib.crc32(data), 0, len(data))
    chunk = struct.pack("<BQ", 0x06, len(head) + len(data)) + head + data
    path.write_bytes(content[:8] + chunk + content[8:])
    assert peak(lambda: read_log(path)) < 5 * len(chunk)
    assert len(read_log(path).readings) == COUNT


@pytest.mark.parametrize(
    ("field", "text", "warned"),
    [
        ("started", "yesterday", "the start time in its sonarhw metadata is invalid: 'yesterday'"),
        ("started", "0001-01-01T00:00:00+23:59", "the start time in its sonarhw metadata is invalid"),
        ("started", "9999-12-31T00:00:00+00:00", "the start time in its sonarhw metadata is invalid"),
        ("format_version", "one", "the format in its sonarhw metadata is invalid"),
        ("format_version", 5000 * "9", "the format in its sonarhw metadata is invalid"),
        ("place", None, "its sonarhw metadata has no field 'place'"),
    ],
)
def test_damaged_metadata_is_reported_and_the_readings_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, field: str, text: str | None, warned: str
) -> None:
    record = sonarhw.log.writer.metadata_record

    def damaged(metadata: Any) -> dict[str, str]:
        fields = record(metadata)
        del fields[field]
        return fields if text is None else fields | {field: text}

    monkeypatch.setattr(sonarhw.log.writer, "metadata_record", damaged)
    write_example(tmp_path / "scan.mcap", COUNT)
    log = read_log(tmp_path / "scan.mcap")
    assert warned in str(log.torn)
    assert log.damaged
    assert len(log.readings) == COUNT
    assert log.metadata.room_file == METADATA.room_file
    monkeypatch.undo()
    copy_log(log, tmp_path / "recovered.mcap")
    recovered = read_log(tmp_path / "recovered.mcap")
    assert recovered.torn is None
    assert len(recovered.readings) == COUNT


def test_a_newer_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record = sonarhw.log.writer.metadata_record
    monkeypatch.setattr(sonarhw.log.writer, "metadata_record", lambda made: record(made) | {"format_version": "99"})
    write_example(tmp_path / "scan.mcap", COUNT)
    with pytest.raises(NotALog, match="has format 99; this version reads up to 1: update sonarhw"):
        read_log(tmp_path / "scan.mcap")
