"""After kill -9 during a recording, the log opens and contains every reading that was printed."""

import math
import random
import signal
import threading
from pathlib import Path

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.log import Log, read_log
from tests.conftest import Count
from tests.fixtures.commands import lines, sonarhw, started
from tests.fixtures.plain_echoes import PlainEchoes

LONG = ("--step", "1", "--sweeps", "400")  # always killed early
TAIL = 4096  # bytes


def test_every_reading_delivered_before_the_kill_is_in_the_log(tmp_path: Path, count: Count) -> None:
    chance = random.Random(11)
    for kill in range(count(2, 200)):
        log = tmp_path / f"{kill}.mcap"
        with serve(FakeBoard(PlainEchoes(), seed=2), tcp="127.0.0.1:0", pace=20.0) as endpoint:
            traces = ("--traces",) if kill % 2 else ()
            with started("scan", endpoint.url, "--out", log, "--print", *LONG, *traces) as process:
                printed = lines(process, chance.randrange(1, 400))
                threading.Event().wait(chance.uniform(0, 0.05))
                process.send_signal(signal.SIGKILL)
                printed += process.stdout.readlines()
                assert process.wait() == -signal.SIGKILL
        headings = [line.split(",")[1] for line in printed[1:] if line.endswith("\n")]
        assert_contains(read_log(log), headings)


def assert_contains(log: Log, headings: list[str]) -> None:
    """Assert that the log begins with readings at these headings."""
    recorded = [f"{math.degrees(reading.angle):.9g}" for reading in log.readings]
    assert recorded[: len(headings)] == headings


def test_a_log_cut_at_each_byte_of_its_tail_opens(tmp_path: Path, count: Count) -> None:
    whole, torn = tmp_path / "whole.mcap", tmp_path / "torn.mcap"
    with serve(FakeBoard(PlainEchoes(), seed=2), tcp="127.0.0.1:0", pace="max") as endpoint:
        assert sonarhw("scan", endpoint.url, "--out", whole, "--step", "30", "--traces").returncode == 0
    data, before = whole.read_bytes(), 0
    assert read_log(whole).torn is None
    for at in range(len(data) - TAIL, len(data), count(101, 1)):
        torn.write_bytes(data[:at])
        log = read_log(torn)
        assert log.torn is not None
        assert before <= len(log.readings) <= 12
        before = len(log.readings)
    assert before == 12
