"""A log and its disk: warnings before the disk is full, full and removed disks, and replaced logs."""

import errno
import os
import queue
import sys
import threading
from io import FileIO
from pathlib import Path
from typing import Any

import pytest

import sonarhw.files
import sonarhw.log.writer
from sonarhw.errors import LogError
from sonarhw.files import DiskSpaceMonitor, log_size
from sonarhw.log import LogWriter, read_log
from tests.fixtures.example_logs import METADATA, STARTED, example_reading, write_example
from tests.hang_guard import HANG
from tests.unit.sonarhw.log.test_log import reading_frame


class Disk:
    """A disk with a given number of free bytes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, free: float) -> None:
        self.free = free
        self.checks = 0
        monkeypatch.setattr(sonarhw.files, "free_bytes", self._free_bytes)

    def _free_bytes(self, _: Path) -> int:
        self.checks += 1
        return round(self.free)


def test_warnings_come_ten_minutes_and_one_minute_before_the_disk_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    pace, lines = 1e6, []  # bytes a second
    disk = Disk(monkeypatch, 3600 * pace)
    monitor = DiskSpaceMonitor(Path("scan.mcap"), lines.append)
    seconds = []
    for second in range(3600):
        monitor.written(round(second * pace), STARTED + second)
        disk.free -= pace
        if len(lines) > len(seconds):
            seconds.append(second)
    assert seconds == pytest.approx([3000, 3540], abs=10)
    assert lines[0].startswith("scan.mcap: its disk is nearly full: 599.0 MB are free, enough for about 10 minutes of ")
    assert " s of this scan; delete other files" in lines[1]


@pytest.mark.parametrize("trace", [False, True])
def test_the_predicted_size_of_a_log_is_within_a_third(tmp_path: Path, trace: bool) -> None:
    write_example(tmp_path / "scan.mcap", 200, trace=trace)
    assert log_size(200, 600 if trace else 0) == pytest.approx((tmp_path / "scan.mcap").stat().st_size, rel=0.35)


class Drive:
    """A drive that can be removed; after that, fsync fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
        self.removed = False
        self._path = path
        self._synchronised = queue.Queue[int]()
        self._fsync = os.fsync
        monkeypatch.setattr(os, "fsync", self._synchronise)

    def _synchronise(self, descriptor: int) -> None:
        if self.removed:
            self._synchronised.put(sys.maxsize)
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        size = os.fstat(descriptor).st_size
        self._fsync(descriptor)
        self._synchronised.put(size)

    def wait(self) -> int:
        """Wait until everything written is synchronised, or an attempt on a removed drive fails; return the size."""
        least = sys.maxsize if self.removed else self._path.stat().st_size
        while (done := self._synchronised.get(timeout=HANG)) < least:
            pass
        return done


def test_each_reading_of_a_live_log_is_synchronised_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Drive(monkeypatch, tmp_path / "scan.mcap")
    with LogWriter(tmp_path / "scan.mcap", METADATA) as log:
        drive.wait()
        for number in range(3):
            log.reading(example_reading(number))
            assert drive.wait() == (tmp_path / "scan.mcap").stat().st_size


def record_one(log: LogWriter, number: int) -> None:
    log.frame(True, STARTED, reading_frame(number))
    log.reading(example_reading(number))


@pytest.mark.parametrize(
    ("fault", "copied"), [("full", True), ("full", False), ("deleted", True), ("removed", True), ("removed", False)]
)
def test_a_log_that_can_no_longer_be_written_is_continued_in_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, copied: bool
) -> None:
    if not copied:
        monkeypatch.setattr(sonarhw.log.writer, "_MOST_COPIED", 0)
    first, warnings = tmp_path / "drive" / "scan.mcap", list[str]()
    first.parent.mkdir()
    drive = Drive(monkeypatch, first) if fault == "removed" else None
    full = [False]

    class Disk(FileIO):
        def write(self, data: Any) -> int:
            if full[0] and Path(str(self.name)).parent == first.parent:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return super().write(data)

    monkeypatch.setattr(sonarhw.log.writer, "FileIO", Disk)
    with LogWriter(first, METADATA, warn=warnings.append, fallback=tmp_path / "kept") as log:
        for number in range(3):
            record_one(log, number)
            if drive:
                drive.wait()
        if fault == "deleted":
            first.unlink()
        elif drive:
            drive.removed = True
            record_one(log, 3)
            drive.wait()
            drive.removed = False
        else:
            full[0] = True
        for number in range(4 if drive else 3, 6):
            record_one(log, number)
    whole = read_log(log.path)
    assert log.path == tmp_path / "kept" / "scan.mcap"
    assert [reading.number for reading in whole.readings] == [*range(6)]
    assert whole.torn is None
    (warning,) = warnings
    assert f"the recording continues in {log.path}, with all readings so far" in warning


# logs that are written as a whole


def test_a_disk_that_never_answers_does_not_hold_the_end_of_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = threading.Event()
    monkeypatch.setattr(os, "fsync", lambda _: answers.wait(HANG))
    monkeypatch.setattr("sonarhw.log.writer.SYNCED_WITHIN", 0.1)
    log = LogWriter(tmp_path / "scan.mcap", METADATA)
    with pytest.raises(LogError, match=r"its disk has not answered for 0\.1 s; nothing is recorded"):
        log.close()
    answers.set()


# replacing an old log


def old_log(path: Path) -> bytes:
    write_example(path, 5)
    return path.read_bytes()


def test_an_old_log_is_kept_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    before = old_log(path)
    path.chmod(0o640)
    with LogWriter(path, METADATA, overwrite=True) as log:
        log.frame(True, STARTED, b"\x01\x00")
        assert path.read_bytes() == before
        log.frame(True, STARTED, reading_frame(0))
        log.reading(example_reading(0))
        assert path.read_bytes() == before
        (unfinished,) = {*path.parent.iterdir()} - {path}  # a killed program leaves this
        assert len(read_log(unfinished).readings) == 1
    assert len(read_log(path).readings) == 1
    assert [*path.parent.iterdir()] == [path]
    assert read_log(path).torn is None
    assert path.stat().st_mode & 0o777 == 0o640
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize("how", ["dropped", "failed"])
def test_a_new_log_without_readings_keeps_the_old_one(tmp_path: Path, how: str) -> None:
    path = tmp_path / "scan.mcap"
    before = old_log(path)
    log = LogWriter(path, METADATA, overwrite=True)
    log.frame(True, STARTED, b"\x01\x00")
    if how == "dropped":
        log.drop()
    else:
        with pytest.raises(KeyError), log:
            raise KeyError
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


def test_a_dropped_log_is_deleted_but_a_device_is_kept(tmp_path: Path) -> None:
    for deleted in (False, True):
        log = LogWriter(tmp_path / "scan.mcap", METADATA)
        if deleted:
            (tmp_path / "scan.mcap").unlink()
        log.drop()
        assert [*tmp_path.iterdir()] == []
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        LogWriter(pipe, METADATA).drop()
    finally:
        os.close(reader)
    assert pipe.exists()


def test_a_log_that_cannot_be_started_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class FullDisk(FileIO):
        def write(self, _: object) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sonarhw.log.writer, "FileIO", FullDisk)
    with pytest.raises(LogError, match="No space left on device; nothing is recorded"):
        LogWriter(tmp_path / "scan.mcap", METADATA)
    assert [*tmp_path.iterdir()] == []


def test_a_nearly_full_disk_is_reported_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    Disk(monkeypatch, 20e6)
    with LogWriter(tmp_path / "scan.mcap", METADATA, warn=lines.append) as log:
        record_one(log, 0)
    assert lines == [f"{tmp_path / 'scan.mcap'}: its disk is nearly full: 20.0 MB are free; delete other files"]
