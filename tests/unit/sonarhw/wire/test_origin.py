"""The origin of readings, from the writer of a log and the identity of its device."""

from pathlib import Path

import pytest

from sonarhw.device.fake_board import BoardIdentity
from sonarhw.log import LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Origin, origin_of
from tests.fixtures.example_logs import STARTED, example_reading


@pytest.mark.parametrize(
    ("made_by", "firmware", "serial", "origin"),
    [
        ("scan", "sonarhw-mega 0.1.0", "SONAR-0A1B2C", Origin.MEASURED),
        ("scan", BoardIdentity().firmware, "FAKE-0001", Origin.FAKE),
        ("scan", "sonarhw-mega 0.1.0", "EMULATED", Origin.FAKE),
        ("simulate", "", "", Origin.SIMULATED),
        ("import", "", "", Origin.IMPORTED),
        ("unknown", "", "", Origin.MEASURED),  # a torn log
    ],
)
def test_origin_follows_from_writer_and_device(made_by: str, firmware: str, serial: str, origin: Origin) -> None:
    assert origin_of(made_by, firmware, serial) is origin


@pytest.mark.parametrize(("writer", "origin"), [("simulate", Origin.SIMULATED), ("import", Origin.IMPORTED)])
def test_a_scan_of_a_replayed_log_has_the_origin_of_that_log(tmp_path: Path, writer: str, origin: Origin) -> None:
    path = tmp_path / "log.mcap"
    write_scan(path, LogMetadata(writer, STARTED), [example_reading(0)])
    log = read_log(path)
    assert log.origin is origin
    assert log.info is not None
    # the replay reports the recorded identity, and the scan of the replay is made by `scan`
    assert origin_of("scan", log.info.firmware, log.info.serial) is origin
