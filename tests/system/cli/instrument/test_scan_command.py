"""`sonarhw scan`: its output, log and exit status for every way to end; as a process where a signal ends it."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from importlib.resources import files
from io import StringIO
from pathlib import Path
from threading import main_thread

import pytest
from sonarhw_cli.app import run
from sonarhw_cli.interruption import sigterm_exits

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.served import serve
from sonarhw.export import HEADER
from sonarhw.log import read_log
from sonarhw.readings import Ping, PingResult
from tests.checkout import CHECKOUT
from tests.fixtures.example_logs import write_example
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import PlainEchoes, echo_time
from tests.fixtures.stuck_boards import EndlessHoming
from tests.hang_guard import HANG, wait_until

COMMAND = (sys.executable, "-c", "from sonarhw_cli.entry import main; main()")
SIMPLE_ROOM = CHECKOUT / "rooms" / "simple.toml"
ENDLESS = ("--sweeps", "1000")  # tests interrupt it before it is complete


def sonarhw(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, which is faster; return its status and output."""
    command, out, err = [*map(str, arguments)], StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = run(command)
    return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())


@contextmanager
def started(*arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    """Yield a running command."""
    with subprocess.Popen(
        [*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def lines(process: subprocess.Popen[str], count: int) -> list[str]:
    """Return the next lines of the standard output of a command."""
    assert process.stdout is not None
    return [process.stdout.readline() for _ in range(count)]


def end(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for the end of a command; return its exit status and its standard error."""
    _, errors = process.communicate(timeout=HANG)
    return process.returncode, errors


@pytest.fixture
def board() -> FakeBoard:
    return FakeBoard(PlainEchoes(), seed=2)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "scan.mcap"


def test_printed_and_recorded_readings_are_the_same(board: FakeBoard, log: Path) -> None:
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        done = sonarhw("scan", endpoint.url, "--out", log, "--print", "--room", SIMPLE_ROOM, "--place", "figure9")
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
    assert recorded.info is not None
    assert recorded.settings is not None
    # 21.3 °C by the scanner's own thermometer
    assert recorded.settings.speed_of_sound == pytest.approx(344_500, abs=500)


def test_sector_range_temperature_and_traces_reach_the_board(board: FakeBoard, log: Path) -> None:
    options = [
        *("--from", "10", "--to", "40", "--step", "10", "--sweeps", "2", "--pings", "2"),
        *("--max-range", "3.43", "--temperature", "0", "--traces"),
    ]
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        done = sonarhw("scan", endpoint.url, "--out", log, *options)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == f"12 readings, 12 with an echo, in {log}\n"
    recorded = read_log(log)
    assert len(recorded.readings) == 12
    assert recorded.settings is not None
    assert recorded.settings.speed_of_sound == pytest.approx(331_500, abs=500)
    assert recorded.settings.listen_us == pytest.approx(2 * 3.43 / 331.5 * 1e6, rel=2e-3)
    assert all(reading.trace is not None for reading in recorded.readings)


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
    ("stop", "message"),
    [
        ("360", "72 readings requested, 4 received: a replay plays the readings of its log"),
        ("15", "3 readings requested, 4 received: a replay plays the readings of its log"),
    ],
)
def test_a_replay_of_another_length_than_requested_gives_a_warning(
    stop: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_example(tmp_path / "old.mcap", 4)
    assert run(["scan", str(tmp_path / "old.mcap"), "--out", str(tmp_path / "new.mcap"), "--to", stop]) == 0
    assert f"sonarhw: warning: {message}\n" in capsys.readouterr().err
    assert run(["scan", str(tmp_path / "old.mcap"), "--out", str(tmp_path / "same.mcap"), "--to", "20"]) == 0
    assert "warning" not in capsys.readouterr().err


def test_lost_steps_give_an_error_and_a_warning_of_every_command_that_reads_the_log(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with serve(faulty("wedge@r5"), tcp="127.0.0.1:0", pace="max") as endpoint:
        assert run(["scan", endpoint.url, "--out", str(log)]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "72 readings are kept; all 72 angles may be wrong, from 0° on" in err
    assert run(["log", "info", str(log)]) == 0
    out, err = capsys.readouterr()
    assert "72 of 72 readings" in out
    assert "; the turntable lost steps; all 72 angles may be wrong" in out
    assert err == f"sonarhw: warning: {log}: the turntable lost steps; all 72 angles may be wrong, from 0° on\n"


def test_angles_not_checked_for_lost_steps_give_a_warning_of_every_command_that_reads_the_log(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    message = "30 of 72 angles, from 0° on, could not be checked for lost steps"
    with serve(faulty("reset=0.1@r30"), tcp="127.0.0.1:0", pace=20) as endpoint:
        assert run(["scan", endpoint.url, "--out", str(log)]) == 0
    assert f"sonarhw: warning: {message}" in capsys.readouterr().err
    assert run(["log", "info", str(log)]) == 0
    out, err = capsys.readouterr()
    assert message in out
    assert message in err


def test_without_a_scanner_no_log_is_written(log: Path) -> None:
    done = sonarhw("scan", "no/such/port", "--out", log)
    assert done.returncode == 1
    assert re.fullmatch(r"sonarhw: no/such/port: there is no such port; .*\n", done.stderr)
    assert not log.exists()


def test_an_existing_log_is_kept_unless_forced(board: FakeBoard, log: Path) -> None:
    log.write_bytes(b"precious")
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        refused = sonarhw("scan", endpoint.url, "--out", log)
        assert (refused.returncode, log.read_bytes()) == (2, b"precious")
        forced = sonarhw("scan", endpoint.url, "--out", log, "--force", "--step", "90")
    assert forced.returncode == 0
    assert len(read_log(log).readings) == 4


BEYOND_THE_CABLE = ["--step", "170", "--to", "900"]


def test_a_scan_that_the_scanner_refuses_leaves_no_log(board: FakeBoard, log: Path) -> None:
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        refused = sonarhw("scan", endpoint.url, "--out", log, *BEYOND_THE_CABLE)
        assert refused.returncode == 1
        assert "850 degrees; the cable winds from -720 to 720 degrees" in refused.stderr
        assert not log.exists()
        assert sonarhw("scan", endpoint.url, "--out", log, "--step", "90").returncode == 0


def test_an_old_log_is_kept_if_the_scanner_refuses_a_forced_scan(board: FakeBoard, log: Path) -> None:
    log.write_bytes(b"precious")
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        assert sonarhw("scan", endpoint.url, "--out", log, "--force", *BEYOND_THE_CABLE).returncode == 1
    assert log.read_bytes() == b"precious"
    assert [*log.parent.iterdir()] == [log]


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
    assert log.read_bytes() == b"precious"
    assert [*log.parent.iterdir()] == [log]


SMALL_DISK = """
import resource, sys
from sonarhw_cli.entry import main

# a file at its size limit fails as on a full disk: with an OSError from write
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
sys.argv[0] = "sonarhw"
main()
"""


def test_a_full_disk_ends_a_scan_with_an_error_of_one_line_and_keeps_the_written_readings(
    board: FakeBoard, log: Path
) -> None:
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        arguments = ["scan", endpoint.url, "--out", str(log), "--step", "1", "--print"]
        done = subprocess.run(
            [sys.executable, "-c", SMALL_DISK, *arguments], capture_output=True, text=True, timeout=HANG
        )
        wait_until(lambda: not board.busy)
    recorded = read_log(log)
    kept = len(recorded.readings)
    assert done.returncode == 1
    assert done.stderr == (
        f"sonarhw: {log}: can no longer be written: File too large; {kept} readings are kept in it; "
        "delete other files or record to another disk\n"
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
    log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sonarhw.files.free_bytes", lambda _: 40_000_000)
    with serve(FakeBoard(Interrupting(), seed=2), tcp="127.0.0.1:0", pace=5.0) as endpoint:
        assert run(["scan", endpoint.url, "--out", str(log), "--sweeps", "600", "--traces"]) == 130
    line, _ = capsys.readouterr().err.splitlines()
    message = (
        r": the scan needs about \d+\.\d MB and its disk has 40.0 MB free, enough for \d+% of it; delete other files"
    )
    assert re.fullmatch(rf"sonarhw: warning: {log}{message}", line)


def test_a_log_contains_its_board_profile(
    board: FakeBoard, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = (files("sonarhw_sim.board.shipped") / "polaroid-6500.toml").read_text(encoding="utf-8")
    profile = tmp_path / "mine.toml"
    profile.write_text(shipped.replace('name = "polaroid-6500"', 'name = "mine"'), encoding="utf-8")
    room = ["--room", SIMPLE_ROOM, "--place", "figure9"]
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        done = sonarhw("scan", endpoint.url, "--out", log, "--step", "60", "--board", profile, *room)
    assert done.returncode == 0
    recorded = read_log(log)
    assert (recorded.metadata.board, recorded.metadata.board_text) == ("mine", profile.read_text(encoding="utf-8"))
    assert run(["compare", str(log), "--json", "--board", str(profile)]) == 0
    with_file = capsys.readouterr().out
    profile.unlink()
    assert run(["compare", str(log), "--json"]) == 0
    assert capsys.readouterr().out == with_file


def test_sighup_ignored_by_nohup_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with sigterm_exits():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            signal.raise_signal(signal.SIGHUP)  # would end the tests
    finally:
        signal.signal(signal.SIGHUP, before)


def test_traces_from_a_scanner_without_traces_give_a_warning(log: Path) -> None:
    board = FakeBoard(PlainEchoes(), identity=BoardIdentity(trace_rate=0))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        done = sonarhw("scan", endpoint.url, "--out", log, "--traces", "--step", "90")
    assert done.returncode == 0
    warning, summary = done.stderr.splitlines()
    assert re.fullmatch(
        r"sonarhw: warning: socket://.*: the scanner sends no traces; only echo times are recorded", warning
    )
    assert summary == f"4 readings, 4 with an echo, in {log}"


@pytest.mark.parametrize(
    "wrong",
    [
        ["--step", "0"],
        ["--step", "0.0000001"],
        ["--to", "0.0000001", "--step", "0.0000001"],
        ["--step", "0.01", "--sweeps", "60000", "--pings", "2"],
        ["--to", "-10"],
        ["--sweeps", "0"],
        ["--place", "somewhere"],
        ["--board", "nonesuch"],
        ["--max-range", "-1"],
        ["--max-range", "1001"],
        ["--max-range", "1e308"],
        ["--temperature", "1000"],
        ["--room", "no_such_room.toml"],
    ],
    ids=" ".join,
)
def test_bad_usage_gives_an_error_of_one_line_and_status_two(
    wrong: list[str], log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["scan", "socket://127.0.0.1:1", "--out", str(log), *wrong]) == 2
    printed = capsys.readouterr()
    assert (printed.out, len(printed.err.splitlines())) == ("", 1)
    assert not log.exists()


@pytest.mark.parametrize("out", ["-", "scan.csv", "scan.mcap.txt"])
def test_a_scan_needs_an_output_name_ending_in_mcap(
    out: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["scan", "socket://127.0.0.1:1", "--out", out]) == 2
    assert ".mcap" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_closed_pipe_ends_quietly(board: FakeBoard, log: Path) -> None:
    with serve(board, tcp="127.0.0.1:0", pace=5.0) as endpoint:
        with started("scan", endpoint.url, "--out", log, "--print", *ENDLESS) as process:
            lines(process, 3)
            assert process.stdout is not None
            process.stdout.close()
            assert process.stderr is not None
            assert process.stderr.read() == ""
            process.wait(timeout=HANG)
        wait_until(lambda: not board.busy)
    assert read_log(log).torn is None
