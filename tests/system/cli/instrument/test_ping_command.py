"""`sonarhw ping`: readings without homing, live on standard output, and their log."""

import math
import re
import signal
from pathlib import Path

import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.log import read_log
from sonarhw.wire.messages import Zero
from tests.fixtures.commands import end, lines, sonarhw, started
from tests.fixtures.plain_echoes import echo_time

SPEED = 344.5  # m/s, of humid air at the thermometer's 21.3 °C


def test_readings_are_printed_and_nothing_turns(url: str, board: FakeBoard) -> None:
    done = sonarhw("ping", url, "--count", "3")
    assert (done.returncode, done.stderr) == (0, "3 readings, 3 with an echo\n")
    rows = [re.fullmatch(r" *(\d+\.\d{3}) s  (\d\.\d{3}) (\d\.\d{3}) m", line) for line in done.stdout.splitlines()]
    assert [row and row[1] for row in rows] == ["0.000", "0.100", "0.200"]
    true_angle = board._turntable.true_angle(1e9)
    expected = SPEED * echo_time(true_angle) / 2
    assert [float(row[2]) for row in rows if row] == pytest.approx([expected] * 3, abs=0.01)
    assert board.zero is Zero.UNKNOWN


def test_the_log_of_pings_can_be_replayed(url: str, log: Path) -> None:
    done = sonarhw("ping", url, "--count", "4", "--traces", "--out", log)
    assert (done.returncode, done.stderr) == (0, f"4 readings, 4 with an echo, in {log}\n")
    recorded = read_log(log)
    assert [(reading.angle, reading.trace is not None) for reading in recorded.readings] == [(0.0, True)] * 4
    again = sonarhw("ping", log, "--count", "4", "--traces")
    assert (again.returncode, again.stdout) == (0, done.stdout)
    assert sonarhw("log", "info", log).returncode == 0


def test_ctrl_c_ends_pings_without_a_count_and_closes_the_log(url: str, log: Path) -> None:
    with started("ping", url, "--out", log) as process:
        assert len(lines(process, 3)) == 3
        process.send_signal(signal.SIGINT)
        status, said = end(process)
    assert status == 130
    assert re.fullmatch(rf"\d+ readings, \d+ with an echo, in {re.escape(str(log))}\n", said)
    assert read_log(log).torn is None


def test_a_scan_with_the_zero_here_starts_where_the_table_is(url: str, board: FakeBoard, log: Path) -> None:
    sonarhw("ping", url, "--count", "1")
    before = board._turntable.true_angle(1e9)
    done = sonarhw("scan", url, "--out", log, "--to", "30", "--step", "10", "--zero-here")
    assert done.returncode == 0, done.stderr
    readings = read_log(log).readings
    assert [round(math.degrees(reading.angle)) for reading in readings] == [0, 10, 20]
    expected = [echo_time(before + reading.angle) for reading in readings]
    assert [reading.echo_times[0] for reading in readings] == pytest.approx(expected, abs=1e-8)
