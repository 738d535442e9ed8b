"""`sonarhw scan`: its output, log and exit status for every way to end; as a process where a signal ends it."""

import re
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from threading import main_thread
from typing import Literal

import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.export import HEADER
from sonarhw.log import read_log
from sonarhw.readings import Ping, PingResult
from tests.fixtures.commands import SIMPLE_ROOM, end, lines, printed, sonarhw, started
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import PlainEchoes, echo_time
from tests.fixtures.stuck_boards import EndlessHoming
from tests.hang_guard import HANG, wait_until

ENDLESS = ("--sweeps", "1000")  # tests interrupt it before it is complete


def test_printed_and_recorded_readings_are_the_same(url: str, log: Path) -> None:
    done = sonarhw("scan", url, "--out", log, "--print", "--room", SIMPLE_ROOM, "--place", "figure9")
    assert (done.returncode, done.stderr) == (0, f"72 readings, 72 with an echo, in {log}\n")
    header, *rows = done.stdout.splitlines()
    assert header == HEADER
    recorded = read_log(log)
    assert recorded.torn is None
    assert len(rows) == len(recorded.readings) == 72
    for row, reading in zip(rows, recorded.readings, strict=True):
        time, heading, distance, echoes = row.split(",")
        assert float(time) >= 0
        assert float(heading) == pytest.approx(5 * reading.number)
        assert float(distance) == pytest.approx(reading.range, rel=1e-8)
        assert float(echoes.split(";")[0]) == pytest.approx(echo_time(reading.angle), abs=1e-9)
    assert (recorded.metadata.place, recorded.metadata.board) == ("figure9", "polaroid-6500")
    assert recorded.metadata.room_text == SIMPLE_ROOM.read_text(encoding="utf-8")
    # 21.3 °C by the scanner's own thermometer
    assert recorded.settings.speed_of_sound == pytest.approx(344_500, abs=500)


def test_sector_range_temperature_and_traces_reach_the_board(url: str, log: Path) -> None:
    sector = ("--from", "10", "--to", "40", "--step", "10", "--sweeps", "2", "--pings", "2")
    printed("scan", url, "--out", log, *sector, "--max-range", "3.43", "--temperature", "0", "--traces")
    recorded = read_log(log)
    assert recorded.settings.speed_of_sound == pytest.approx(331_500, abs=500)
    assert recorded.settings.listen_us == pytest.approx(2 * 3.43 / 331.5 * 1e6, rel=2e-3)
    assert [reading.trace is not None for reading in recorded.readings] == [True] * 12


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_scan_stops_the_board_and_leaves_a_whole_log(
    board: FakeBoard, log: Path, number: signal.Signals
) -> None:
    with serve(board, tcp="127.0.0.1:0", pace=5.0) as endpoint:
        with started("scan", endpoint.url, "--out", log, "--print", *ENDLESS) as process:
            lines(process, 6)
            process.send_signal(number)
            status, errors = end(process)
        wait_until(lambda: not board.busy)
    recorded = read_log(log)
    assert recorded.torn is None
    assert 5 <= len(recorded.readings) < 72_000
    assert (status, errors) == (130, f"sonarhw: interrupted; {len(recorded.readings)} readings are kept in {log}\n")


def test_a_lost_link_gives_an_error_of_one_line_and_a_whole_log(board: FakeBoard, log: Path) -> None:
    with ExitStack() as outside:
        with serve(board, tcp="127.0.0.1:0", pace=5.0) as endpoint:
            command = ("scan", endpoint.url, "--out", log, "--print", "--reconnect", "1", *ENDLESS)
            process = outside.enter_context(started(*command))
            lines(process, 6)
        status, errors = end(process)
    recorded = read_log(log)
    assert status == 1
    assert re.fullmatch(rf"sonarhw: .*link was lost.*; {len(recorded.readings)} readings are kept in .*\n", errors)
    assert recorded.torn is None
    assert 5 <= len(recorded.readings) < 72_000


@pytest.mark.parametrize(
    ("faults", "pace", "status", "message"),
    [
        ("wedge@r5", "max", 1, "the turntable lost steps; all 72 angles may be wrong, from 0° on"),
        ("reset=0.1@r30", 20, 0, "30 of 72 angles, from 0° on, could not be checked for lost steps"),
    ],
)
def test_doubtful_angles_give_a_warning_of_every_command_that_reads_the_log(
    faults: str, pace: Literal["max"] | float, status: int, message: str, log: Path
) -> None:
    with serve(faulty(faults), tcp="127.0.0.1:0", pace=pace) as endpoint:
        done = sonarhw("scan", endpoint.url, "--out", log)
    assert (done.returncode, done.stdout) == (status, "")
    assert message.removeprefix("the turntable lost steps; ") in done.stderr
    info = sonarhw("log", "info", log)
    assert "72 of 72 readings" in info.stdout
    assert message.removesuffix(", from 0° on") in info.stdout
    assert info.stderr.startswith(f"sonarhw: warning: {log}: {message}")
    assert info.stderr.count("\n") == 1


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_a_scan_that_the_scanner_refuses_leaves_no_log_and_keeps_an_old_one(
    force: tuple[str, ...], url: str, log: Path
) -> None:
    if force:
        log.write_bytes(b"precious")
    refused = sonarhw("scan", url, "--out", log, *force, "--step", "170", "--to", "900")
    assert refused.returncode == 1
    assert "850 degrees; the cable winds from -720 to 720 degrees" in refused.stderr
    assert [path.read_bytes() for path in log.parent.iterdir()] == [b"precious"] * len(force)
    printed("scan", url, "--out", log, *force, "--step", "90")
    assert len(read_log(log).readings) == 4


def test_an_old_log_is_kept_if_a_forced_scan_is_interrupted_while_homing(log: Path) -> None:
    log.write_bytes(b"precious")
    with (
        serve(EndlessHoming(PlainEchoes()), tcp="127.0.0.1:0") as endpoint,
        started("scan", endpoint.url, "--out", log, "--force", "--print") as process,
    ):
        # until the new log exists beside the old one
        wait_until(lambda: len([*log.parent.iterdir()]) > 1 or process.poll() is not None)
        process.send_signal(signal.SIGINT)
        assert end(process)[0] == 130
    assert [path.read_bytes() for path in log.parent.iterdir()] == [b"precious"]


SMALL_DISK = """
import resource, sys
from sonarhw_cli.entry import main

# a file at its size limit fails as on a full disk: with an OSError from write
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
sys.argv[0] = "sonarhw"
main()
"""


def test_a_full_disk_ends_a_scan_with_an_error_of_one_line_and_keeps_the_written_readings(
    url: str, board: FakeBoard, log: Path
) -> None:
    command = [sys.executable, "-c", SMALL_DISK, "scan", url, "--out", str(log), "--step", "1", "--print"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG)
    wait_until(lambda: not board.busy)
    recorded = read_log(log)
    kept = len(recorded.readings)
    assert (done.returncode, done.stderr) == (
        1,
        f"sonarhw: {log}: can no longer be written: File too large; {kept} readings are kept in it; "
        "delete other files or record to another disk\n",
    )
    # every printed reading had been written before
    assert 5 < len(done.stdout.splitlines()) - 1 <= kept
    assert recorded.torn == f"the file ends too early at byte {log.stat().st_size}"


class Interrupting(PlainEchoes):
    """Echoes that send Ctrl-C to the main thread at the third ping."""

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of a ping."""
        if len(self.pings) == 2:
            signal.pthread_kill(main_thread().ident or 0, signal.SIGINT)
        return super().receive(ping)


def test_a_disk_too_small_for_the_scan_gives_a_warning_before_it_starts(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sonarhw.files.free_bytes", lambda _: 40_000_000)
    with serve(FakeBoard(Interrupting(), seed=2), tcp="127.0.0.1:0", pace=5.0) as endpoint:
        done = sonarhw("scan", endpoint.url, "--out", log, "--sweeps", "600", "--traces")
    message = r"the scan needs about \d+\.\d MB and its disk has 40.0 MB free, enough for \d+% of it; delete .*"
    assert done.returncode == 130
    assert re.fullmatch(rf"sonarhw: warning: {log}: {message}", done.stderr.splitlines()[0])


def test_a_closed_pipe_ends_quietly(board: FakeBoard, log: Path) -> None:
    with serve(board, tcp="127.0.0.1:0", pace=5.0) as endpoint:
        with started("scan", endpoint.url, "--out", log, "--print", *ENDLESS) as process:
            lines(process, 3)
            process.stdout.close()
            assert process.stderr.read() == ""
            process.wait(timeout=HANG)
        wait_until(lambda: not board.busy)
    assert read_log(log).torn is None
