"""`sonarhw serve --foxglove`: viewers receive what the log holds, and no viewer disturbs the scan."""

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
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from mcap.reader import make_reader
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.foxglove import FoxgloveServer
from sonarhw.log import read_log
from sonarhw.readings import Reading, Trace
from sonarhw.wire.messages import StartScan
from tests.fixtures.commands import SIMPLE_ROOM, end, lines, sonarhw, started
from tests.fixtures.plain_echoes import PlainEchoes
from tests.hang_guard import HANG, wait_until

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
    options = (
        "--foxglove",
        "--tcp",
        "127.0.0.1:0",
        "--traces",
        "--step",
        "20",
        "--pings",
        "2",
        "--out",
        log,
        "--sweeps",
        "2",
        *WHERE,
    )
    watched = threading.Event()
    board = FakeBoard(PlainEchoes(), seed=2, ready=watched.is_set)
    with (
        serve(board, tcp="127.0.0.1:0", pace=2.0) as endpoint,
        started("serve", endpoint.url, *options) as process,
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
        assert channel["schema"].rstrip("=") in (schema.decode(errors="replace"), _base64(schema).rstrip("="))
        assert seen[topic] == held[topic]
    check_prediction(LaserScan.FromString(seen["/prediction"][-1]), LaserScan.FromString(seen["/scan"][-1]))


def _base64(data: bytes) -> str:
    from base64 import b64encode

    return b64encode(data).decode()


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


def test_the_missing_extra_is_named() -> None:
    program = "import sys; sys.modules['foxglove'] = None; from sonarhw_cli.entry import main; main()"
    command = [sys.executable, "-c", program, "serve", "fake:simple?place=figure9", "--foxglove"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    install = "run pip install '.[foxglove]' in the source folder of sonarhw"
    assert done.stderr == f"sonarhw: a server for Foxglove needs its SDK, which is not installed: {install}\n"


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
