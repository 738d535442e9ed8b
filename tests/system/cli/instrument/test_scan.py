"""`sonarhw scan`, `ping` and `serve`: output, log and exit status for every way to end; as a process for signals."""

import csv
import json
import math
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
from base64 import b64encode
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from io import StringIO
from pathlib import Path
from threading import main_thread
from typing import Literal

import numpy as np
import pytest
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from mcap.reader import make_reader
from sonarhw_cli.app import run
from sonarhw_gui.model.scene import scene_with
from sonarhw_gui.session.scanner import WHOLE_TURN, ScanSettings
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.export import HEADER
from sonarhw.foxglove import FoxgloveServer
from sonarhw.log import read_log
from sonarhw.readings import Ping, PingResult, Reading, Trace
from sonarhw.sound_speed import speed_of_sound
from sonarhw.wire.messages import StartScan, Zero
from tests.checkout import CHECKOUT
from tests.fixtures.commands import SIMPLE_ROOM, end, lines, printed, sonarhw, started
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import PlainEchoes, echo_time
from tests.fixtures.stuck_boards import EndlessHoming
from tests.fixtures.window_scan import recorded_scan
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
def test_an_interrupted_scan_leaves_a_whole_log(board: FakeBoard, log: Path, number: signal.Signals) -> None:
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
def test_doubtful_angles_warn(faults: str, pace: Literal["max"] | float, status: int, message: str, log: Path) -> None:
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
def test_a_refused_scan_leaves_no_log_and_keeps_an_old_one(force: tuple[str, ...], url: str, log: Path) -> None:
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


def test_a_full_disk_ends_a_scan_and_keeps_its_readings(url: str, board: FakeBoard, log: Path) -> None:
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


def test_a_disk_too_small_for_the_scan_gives_a_warning(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


# command and window record the same


ROOM = CHECKOUT / "rooms" / "simple.toml"
FOUR = replace(WHOLE_TURN, step=WHOLE_TURN.step * 18, headings=4)


@pytest.fixture
def hot_room(tmp_path: Path) -> Path:
    hot = tmp_path / "hot.toml"
    hot.write_text(ROOM.read_text(encoding="utf-8") + "\n[air]\ntemperature_c = 35.0\n", encoding="utf-8")
    return hot


def scanned(log: Path, thermometer: float | None, *options: str | Path) -> list[float | None]:
    """Return the ranges that `sonarhw scan` records, m."""
    with serve(FakeBoard(PlainEchoes(thermometer)), tcp="127.0.0.1:0", pace="max") as endpoint:
        assert run(["scan", endpoint.url, "--out", str(log), "--step", "90", *map(str, options)]) == 0
    return [reading.range for reading in read_log(log).readings]


def scanned_by_window(folder: Path, thermometer: float | None, room_file: Path | None) -> list[float | None]:
    """Return the ranges that the window records, m."""
    board = load_board("polaroid-6500")
    room = load_room(room_file) if room_file else None
    scene = scene_with(board, room, room.place("figure9")) if room else scene_with(board)
    log = recorded_scan(FakeBoard(PlainEchoes(thermometer)), scene, ScanSettings(folder, FOUR, traces=False))
    return [reading.range for reading in read_log(log).readings]


@pytest.mark.parametrize(
    ("thermometer", "in_room", "temperature"),
    [(10.0, True, 10.0), (None, True, 35.0), (None, False, 20.0)],
    ids=["thermometer first", "then the air of the room", "then 20"],
)
def test_command_and_window_use_the_same_speed_of_sound(
    thermometer: float | None, in_room: bool, temperature: float, hot_room: Path, tmp_path: Path
) -> None:
    room = hot_room if in_room else None
    options = ["--room", hot_room, "--place", "figure9"] if in_room else []
    log = tmp_path / "command.mcap"
    by_command = scanned(log, thermometer, *options)
    assert by_command == scanned_by_window(tmp_path, thermometer, room)
    (first, *_), settings = read_log(log).readings, read_log(log).settings
    assert settings.speed_of_sound / 1000 == pytest.approx(speed_of_sound(temperature), abs=0.001)
    assert first.range == pytest.approx(speed_of_sound(temperature) * 0.015 / 2, rel=1e-4)


# ping


SPEED = 344.5  # m/s, of humid air at the thermometer's 21.3 °C


def test_readings_are_printed_and_nothing_turns(url: str, board: FakeBoard) -> None:
    done = sonarhw("ping", url, "--count", "3")
    assert (done.returncode, done.stderr) == (0, "3 readings, 3 with an echo\n")
    rows = [re.fullmatch(r" *(\d+\.\d{3}) s  (\d\.\d{3}) (\d\.\d{3}) m", line) for line in done.stdout.splitlines()]
    assert [row and row[1] for row in rows] == ["0.000", "0.100", "0.200"]
    true_angle = board.turntable.true_angle(1e9)
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
    before = board.turntable.true_angle(1e9)
    done = sonarhw("scan", url, "--out", log, "--to", "30", "--step", "10", "--zero-here")
    assert done.returncode == 0, done.stderr
    readings = read_log(log).readings
    assert [round(math.degrees(reading.angle)) for reading in readings] == [0, 10, 20]
    expected = [echo_time(before + reading.angle) for reading in readings]
    assert [reading.echo_times[0] for reading in readings] == pytest.approx(expected, abs=1e-8)


# serve: viewers receive what the log holds, and no viewer disturbs the scan


DATA = struct.Struct("<BIQ")  # message data of Foxglove's protocol: 1, subscription, time in ns
WHERE = ("--room", str(SIMPLE_ROOM), "--place", "figure9")


@contextmanager
def viewer(url: str) -> Iterator[tuple[ClientConnection, dict[str, dict[str, str]]]]:
    """Yield a client that has subscribed to all channels, and the channels by topic."""
    with connect(url, subprotocols=["foxglove.sdk.v1"], max_queue=1, close_timeout=0) as socket:  # type: ignore[list-item]
        while (advertised := json.loads(socket.recv(timeout=HANG)))["op"] != "advertise":
            assert advertised["op"] == "serverInfo"
        channels = {channel["topic"]: channel for channel in advertised["channels"]}
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels.values()]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        yield socket, channels


def await_subscription(*viewers: ClientConnection) -> None:
    """Wait until the server has handled what these viewers have sent. Nothing may be published meanwhile."""
    for one in viewers:
        assert one.ping().wait(HANG)


def received(socket: ClientConnection, channels: dict[str, dict[str, str]]) -> dict[str, list[bytes]]:
    """Return the messages of each topic until the server ends."""
    topics = {channel["id"]: topic for topic, channel in channels.items()}
    messages = defaultdict(list)
    try:
        while True:
            data = socket.recv(timeout=HANG)
            kind, subscription, _ = DATA.unpack_from(data)
            assert kind == 1
            messages[topics[subscription]].append(data[DATA.size :])
    except ConnectionClosed:
        return messages


def recorded(log: Path) -> tuple[dict[str, list[bytes]], dict[str, tuple[str, str, str, bytes]]]:
    """Return the messages of each topic of a log, and encoding and schema of each topic."""
    messages, kinds = defaultdict(list), {}
    with log.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            messages[channel.topic].append(message.data)
            if schema:
                kinds[channel.topic] = (channel.message_encoding, schema.name, schema.encoding, schema.data)
    return messages, kinds


def test_a_viewer_receives_what_the_log_holds_whatever_others_do(tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    options = ("--foxglove", "--tcp", "127.0.0.1:0", "--traces", "--step", "20", "--pings", "2", "--sweeps", "2")
    watched = threading.Event()
    board = FakeBoard(PlainEchoes(), seed=2, ready=watched.is_set)
    with (
        serve(board, tcp="127.0.0.1:0", pace=2.0) as endpoint,
        started("serve", endpoint.url, *options, "--out", log, *WHERE) as process,
    ):
        [url] = lines(process, 1)
        with viewer(url.strip()) as (watching, channels), viewer(url.strip()) as (stalled, _):
            with viewer(url.strip()) as (leaving, _):
                await_subscription(watching, stalled, leaving)
                watched.set()
                leaving.recv(timeout=HANG)
                leaving.socket.shutdown(socket.SHUT_RDWR)  # without a goodbye
            seen = received(watching, channels)
            stalled.socket.shutdown(socket.SHUT_RDWR)
        assert end(process) == (0, f"72 readings published, in {log}\n")
    held, kinds = recorded(log)
    assert len(read_log(log).readings) == len(held["/readings"]) == 72
    for topic in ("/readings", "/traces", "/scan"):
        channel = channels[topic]
        *described, schema = kinds[topic]
        assert [channel["encoding"], channel["schemaName"], channel["schemaEncoding"]] == described
        # the schema is text in JSON, or base64
        assert channel["schema"].rstrip("=") in (
            schema.decode(errors="replace"),
            b64encode(schema).decode().rstrip("="),
        )
        assert seen[topic] == held[topic]
    check_prediction(LaserScan.FromString(seen["/prediction"][-1]), LaserScan.FromString(seen["/scan"][-1]))


def check_prediction(predicted: LaserScan, measured: LaserScan) -> None:
    """Compare a predicted sweep with `sonarhw simulate` at the same headings."""
    assert (predicted.timestamp, predicted.start_angle) == (measured.timestamp, measured.start_angle)
    rows = csv.DictReader(StringIO(sonarhw("simulate", SIMPLE_ROOM, "--place", "figure9", "--step", "20").stdout))
    expected = [float(row["range_m"] or "inf") for row in rows]
    assert [*predicted.ranges] == pytest.approx(expected, abs=1e-4)
    assert sum(map(math.isfinite, expected)) > 9


def test_a_log_is_published_too_and_ctrl_c_ends_the_server(tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    board = FakeBoard(PlainEchoes(), seed=2)
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        assert sonarhw("scan", endpoint.url, "--out", log, "--step", "1").returncode == 0
    with started("serve", log, "--foxglove", "--tcp", "127.0.0.1:0") as process:
        [url] = lines(process, 1)
        with viewer(url.strip()) as (watching, channels):
            first = watching.recv(timeout=HANG)
            process.send_signal(signal.SIGINT)
            seen = [first[DATA.size :], *received(watching, channels)["/readings"]]
        status, said = end(process)
    assert status == 130
    assert re.fullmatch(r"\d+ readings? published\n", said)
    shown = [(one["number"], one["range_m"]) for one in map(json.loads, seen)]
    assert shown == [(one.number, one.range) for one in read_log(log).readings[shown[0][0] : shown[-1][0] + 1]]


def test_a_stalled_viewer_neither_blocks_the_scan_nor_the_other_viewers() -> None:
    trace = Trace(np.ones(5000), 76923.0, 0.0)
    reading = Reading(0, 0, 0, 0.0, 1.0, (0.01,), 343.0, trace=trace)
    with FoxgloveServer("127.0.0.1:0") as server, viewer(server.url) as (stalled, _):
        await_subscription(stalled)
        for _ in range(2000):  # 20 MB, more than the buffers of any socket
            server.reading(reading)
        with viewer(server.url) as (watching, channels):
            await_subscription(watching)
            server.reading(reading)
            data = watching.recv(timeout=HANG)
            assert DATA.unpack_from(data)[1] == channels["/readings"]["id"]
        stalled.socket.shutdown(socket.SHUT_RDWR)


def test_viewers_receive_what_was_published_last_before_the_end() -> None:
    with ExitStack() as stack:
        with FoxgloveServer("127.0.0.1:0") as server:
            viewers = [stack.enter_context(viewer(server.url)) for _ in range(20)]
            await_subscription(*(socket for socket, _ in viewers))
            for number in range(5):
                server.reading(Reading(number, 0, 0, 0.0, 1.0, (0.01,), 343.0))
        assert [len(received(socket, channels)["/readings"]) for socket, channels in viewers] == [5] * 20


class Ordered(FakeBoard):
    """A board that keeps the number of sweeps of its newest scan."""

    sweeps = 0

    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        self.sweeps = order.sweeps
        return super().scanning(order, now)


@pytest.mark.parametrize("interrupted", [False, True])
def test_a_client_that_says_nothing_does_not_keep_the_server(interrupted: bool) -> None:
    options = ["--foxglove", "--tcp", "127.0.0.1:0", "--step", "90", *([] if interrupted else ["--sweeps", "1"])]
    board = Ordered(PlainEchoes(), seed=2)
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint, started("serve", endpoint.url, *options) as serving:
        host, _, port = lines(serving, 1)[0].strip().removeprefix("ws://").partition(":")
        with closing(socket.create_connection((host, int(port)))):
            if interrupted:
                wait_until(lambda: board.sweeps)
                serving.send_signal(signal.SIGINT)
            status, errors = end(serving)
    assert (status, "Traceback" in errors) == (130 if interrupted else 0, False)
    assert board.sweeps == (65535 if interrupted else 1)  # by default until Ctrl-C
