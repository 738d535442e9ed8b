"""A scanner with real threads, mostly at maximum pace: what its caller gets, and what a stop or a lost link ends."""

import math
import os
import re
import socket
import subprocess
import sys
import termios
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import Disturbance, RoomEchoes
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.served import Endpoint, Pace, serve
from sonarhw.errors import DeviceError, InputError, LinkBusy, LinkError, LinkLost, NoAnswer
from sonarhw.host.driver import SILENCE
from sonarhw.host.scanner import LinkThread, Scanner, TurnSettings
from sonarhw.host.session import Connection
from sonarhw.link import Link
from sonarhw.readings import EchoSource, Reading, ScanOrder, sector
from sonarhw.sound_speed import speed_of_sound
from sonarhw.wire.limits import MAX_ECHOES
from sonarhw.wire.messages import (
    Approach,
    Configure,
    ConfigureTurntable,
    Outcome,
    Settings,
    TraceKind,
    TurntableSettings,
)
from tests.checkout import CHECKOUT
from tests.fixtures.plain_echoes import PlainEchoes, assert_scanned, echo_time
from tests.fixtures.stuck_boards import EndlessHoming
from tests.hang_guard import HANG, wait_until

ORDER = ScanOrder(start=0.0, step=math.radians(5), headings=72)
LONG = replace(ORDER, sweeps=1000)  # always stopped early
Serve = Callable[..., AbstractContextManager[Endpoint]]


@pytest.fixture
def served() -> Serve:
    """Return a function that serves a board. The kind of line makes no difference; `tests/contract` tests all."""

    def serve_board(board: FakeBoard | None = None, pace: Pace = "max") -> AbstractContextManager[Endpoint]:
        return serve(board or FakeBoard(PlainEchoes(), seed=5), pace=pace, tcp="127.0.0.1:0")

    return serve_board


def check_scan(readings: list[Reading]) -> None:
    """Assert that all readings of ORDER are present, in their order."""
    assert [reading.number for reading in readings] == sorted(reading.number for reading in readings)
    assert_scanned(readings, ORDER)


class AskedBoard(FakeBoard):
    """A board that keeps the last ping settings that were asked for."""

    asked = Configure(1, 0, 0, 1)
    asked_turntable = ConfigureTurntable(0, 0, 0, 0)

    def configure(self, request: Configure, sequence: int) -> Settings:
        """Keep the request."""
        self.asked = request
        return super().configure(request, sequence)

    def configure_turntable(self, request: ConfigureTurntable, sequence: int) -> TurntableSettings:
        """Keep the request, and confirm it."""
        self.asked_turntable = request
        return TurntableSettings(sequence, request.speed, request.acceleration, request.settle_us, request.approach)


def test_ping_settings_are_sent_in_the_units_of_the_protocol() -> None:
    board = AskedBoard(PlainEchoes())
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        scanner.configure(speed_of_sound=340.5)
        # by default the device decides on the number of cycles, the re-arming time, the rate and the size of samples
        assert board.asked == Configure(62_500, 2_380, 0, 340_500, 0, MAX_ECHOES, 0, 0, 0)
        scanner.configure(
            0.05, 0.001, TraceKind.CARRIER, 330.0, pulses=8, echoes=3, rearm=0.002, trace_rate=40_000.4, trace_bits=16
        )
        assert board.asked == Configure(50_000, 1_000, 2, 330_000, 8, 3, 2_000, 40_000, 16)


def test_settings_of_the_turntable_are_sent_in_the_units_of_the_protocol_and_returned_in_si_units() -> None:
    board = AskedBoard(PlainEchoes())
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        assert scanner.configure_turntable() == TurnSettings(0.0, 0.0, 0.02, Approach.EITHER)
        assert board.asked_turntable == ConfigureTurntable(0, 0, 20_000, 0)
        found = scanner.configure_turntable(math.radians(90), math.radians(450), 0.05, Approach.CLOCKWISE)
        assert board.asked_turntable == ConfigureTurntable(90_000_000, 450_000_000, 50_000, 2)
        assert (found.speed, found.acceleration) == pytest.approx((math.radians(90), math.radians(450)))
        assert found.settling == pytest.approx(0.05)
        assert found.approach is Approach.CLOCKWISE


def test_stop_ends_homing_and_an_idle_scanner_can_be_stopped(served: Serve) -> None:
    with served(EndlessHoming(PlainEchoes()), pace=1.0) as endpoint, Scanner.open(endpoint.url) as scanner:
        scanner.stop()
        outcomes: list[Outcome] = []
        homing = threading.Thread(target=lambda: outcomes.append(scanner.home()))
        homing.start()
        wait_until(lambda: scanner.state is Connection.MOVING)
        scanner.stop()
        homing.join()
        assert outcomes == [Outcome.STOPPED]


def test_a_stop_between_two_steps_of_a_sequence_ends_the_later_ones(served: Serve) -> None:
    with served() as endpoint, Scanner.open(endpoint.url) as scanner:
        with scanner.sequence():
            assert scanner.home() is Outcome.DONE
            scanner.stop()
            assert list(scanner.scan(ORDER)) == []
            assert scanner.home() is Outcome.STOPPED
        check_scan(list(scanner.scan(ORDER)))


def test_a_scanner_does_one_thing_at_a_time(served: Serve) -> None:
    refused: list[str] = []

    def home_while_busy() -> None:
        with pytest.raises(DeviceError) as error:
            scanner.home()
        refused.append(str(error.value))

    with served() as endpoint, Scanner.open(endpoint.url) as scanner, scanner.sequence():
        other = threading.Thread(target=home_while_busy)
        other.start()
        other.join()
        next(iter(readings := scanner.scan(ORDER)))
        home_while_busy()
        readings.close()
    assert len(refused) == 2


def test_an_interrupt_in_the_middle_stops_the_board(served: Serve) -> None:
    board = FakeBoard(PlainEchoes(), seed=5)

    def interrupted(scanner: Scanner) -> None:
        for reading in scanner.scan(LONG):
            if reading.number == 3:
                raise KeyboardInterrupt

    with served(board, pace=20.0) as endpoint:
        with Scanner.open(endpoint.url) as scanner:
            scanner.home()
            with pytest.raises(KeyboardInterrupt):
                interrupted(scanner)
        wait_until(lambda: not board.busy)


def test_a_stop_without_an_action_does_not_wait_for_a_lost_device(served: Serve) -> None:
    with served() as endpoint:
        scanner = Scanner.open(endpoint.url, reconnect=10 * HANG)
    wait_until(lambda: scanner.state is Connection.LOST)
    with pytest.raises(LinkLost, match="link was lost"):
        scanner.stop()
    scanner.close()


def test_a_slow_caller_loses_no_reading(served: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonarhw.host.scanner.MOST_WAITING", 4)
    with served() as endpoint, Scanner.open(endpoint.url) as scanner:
        scanner.configure(trace=True)
        scanner.home()
        scan = scanner.scan(ORDER)
        first = next(scan)
        received: list[int] = []

        def waits() -> bool:
            """Return whether nothing was read from the link between many looks."""
            received.append(scanner.statistics.bytes_received)
            return len(received) > 20 and len({*received[-20:]}) == 1

        wait_until(waits)
        check_scan([first, *scan])
        assert scanner.statistics.bytes_received > 2 * received[-1]
        assert scanner.statistics.missing_frames == 0


@pytest.mark.parametrize("silent", [1, 3])
def test_a_stop_of_the_process_is_no_loss(served: Serve, monkeypatch: pytest.MonkeyPatch, silent: int) -> None:
    """Bytes may wait that arrived meanwhile, or none for some reads, because the device was stopped too."""
    really_read, really_now = Link.read, LinkThread.now
    stopped: list[float] = []  # s of each read that found nothing

    def read(link: Link) -> bytes:
        if len(stopped) == silent:
            return really_read(link)
        stopped.append(0.0 if stopped else 2 * SILENCE)
        return b""

    with served(pace=1.0) as endpoint, Scanner.open(endpoint.url) as scanner:
        monkeypatch.setattr(LinkThread, "now", lambda thread: really_now(thread) + sum(stopped))
        monkeypatch.setattr(Link, "read", read)
        wait_until(lambda: len(stopped) == silent)
        assert scanner.turn(0.0) is Outcome.DONE
        assert scanner.statistics.losses == 0


class InterruptedRecorder:
    """A recorder with a lock, as that of a log, and with a signal handler that stops the scanner at the first frame."""

    def __init__(self, scanner: Scanner) -> None:
        self._scanner = scanner
        self._lock = threading.RLock()
        self.frames = 0

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        with self._lock:
            self.frames += 1
            if self.frames == 1:
                self._scanner.stop()

    def reading(self, reading: Reading) -> None:
        """Do nothing."""


def test_a_stop_by_a_signal_handler_while_a_recording_begins_does_not_block(served: Serve) -> None:
    with served() as endpoint, Scanner.open(endpoint.url) as scanner:
        recorder = InterruptedRecorder(scanner)
        recording = threading.Thread(target=scanner.record, args=(recorder,), daemon=True)
        recording.start()
        recording.join(HANG)
        assert not recording.is_alive()
        assert recorder.frames == 3  # Hello, Info, Capabilities
        scanner.record(None)
        assert scanner.turn(0.1) is Outcome.DONE


def test_an_order_that_the_protocol_cannot_state_is_refused_before_it_is_sent(served: Serve) -> None:
    impossible = {
        "headings: expected a whole number from 1 to 65535, got 70000": ScanOrder(0.0, 0.1, headings=70_000),
        "headings: expected a whole number from 1 to 65535, got 0": ScanOrder(0.0, 0.1, headings=0),
        "pings: expected a whole number from 1 to 255, got 256": ScanOrder(0.0, 0.1, headings=2, pings=256),
        "step: expected a finite number": ScanOrder(0.0, math.nan, headings=2),
        "too fine; expected 0.000001° or more": ScanOrder(0.0, 1e-9, headings=2),
        "are possible; reduce one of them": ScanOrder(0.0, 0.1, headings=65_535, sweeps=65_535, pings=2),
    }
    with served() as endpoint, Scanner.open(endpoint.url) as scanner:
        scanner.home()
        for message, order in impossible.items():
            with pytest.raises(InputError, match=re.escape(message)):
                list(scanner.scan(order))
        check_scan(list(scanner.scan(ORDER)))


def test_a_wrong_argument_is_named_before_anything_is_sent(served: Serve) -> None:
    with served() as endpoint, Scanner.open(endpoint.url) as scanner:
        mistakes: list[tuple[str, Callable[[], object]]] = [
            ("listen: expected a finite number", lambda: scanner.configure(listen=math.nan)),
            ("trace: expected True, False or a TraceKind, got 'raw'", lambda: scanner.configure(trace="raw")),  # type: ignore[arg-type]
            ("pulses: expected a whole number from 0 to 255, got 2.5", lambda: scanner.configure(pulses=2.5)),  # type: ignore[arg-type]
            ("angle: expected a finite number (rad) from -37 to 37, got 90.0", lambda: scanner.turn(90.0)),
            ("order: expected a ScanOrder", lambda: scanner.scan(5)),  # type: ignore[arg-type]
            ("recorder: expected None, or an object", lambda: scanner.record("scan.mcap")),  # type: ignore[arg-type]
        ]
        for message, call in mistakes:
            with pytest.raises(InputError, match=re.escape(message)):
                call()
        check_scan(list(scanner.scan(ORDER)))


def test_a_line_with_a_settable_speed_uses_its_highest_speed(tmp_path: Path) -> None:
    board = FakeBoard(PlainEchoes(), identity=BoardIdentity(bauds=(250_000, 500_000, 1_000_000)))
    with serve(board, pty=tmp_path / "scanner", pace=20.0) as endpoint, Scanner.open(endpoint.url) as scanner:
        assert scanner.baud == board.line.baud == 1_000_000
        with open(os.open(endpoint.url, os.O_RDONLY | os.O_NOCTTY), "rb", buffering=0) as terminal:
            assert termios.tcgetattr(terminal)[4] == termios.B1000000
        check_scan(list(scanner.scan(ORDER)))


def test_an_unanswered_greeting_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(NoAnswer, match="no scanner answered"):
        Scanner.open(f"socket://127.0.0.1:{silent.getsockname()[1]}", patience=0.2)


def test_a_closed_port_and_what_is_no_port_are_named(tmp_path: Path) -> None:
    (tmp_path / "room.toml").touch()
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # does not listen, and no other program can take it
        for url, message in {
            f"socket://127.0.0.1:{closed.getsockname()[1]}": "connection refused",
            "no/such/port": "no such port",
            "localhost:4000": r"did you mean socket://localhost:4000\?",
            str(tmp_path): "is not a serial port",
            str(tmp_path / "room.toml"): "is not a serial port",
        }.items():
            with pytest.raises(LinkError, match=message):
                Scanner.open(url)


def test_a_port_held_by_this_program_is_reported_as_busy(tmp_path: Path) -> None:
    with (
        serve(FakeBoard(PlainEchoes()), pty=tmp_path / "scanner") as endpoint,
        Scanner.open(endpoint.url),
        pytest.raises(LinkBusy, match="this program holds the port"),
    ):
        Scanner.open(endpoint.url)


def test_the_error_of_a_busy_port_names_the_other_program(tmp_path: Path) -> None:
    hold = "import sys; from sonarhw.link import Link\n"
    hold += "x = Link(sys.argv[1]); print('held', flush=True); input()"
    with serve(FakeBoard(PlainEchoes()), pty=tmp_path / "scanner") as endpoint:
        command = [sys.executable, "-c", hold, endpoint.url]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
            assert other.stdout.readline() == b"held\n"
            with pytest.raises(LinkBusy, match=rf"python\S* \({other.pid}\) holds the port"):
                Scanner.open(endpoint.url)
            other.communicate(b"\n")


def test_a_peer_that_closes_at_once_is_a_lost_link() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=lambda: listener.accept()[0].close())
        thread.start()
        with pytest.raises(LinkLost):
            Scanner.open(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        thread.join()


# ranges in air of any temperature, without configure


ONE = ScanOrder(0.0, 1.0, 1)
ANY_AIR = Disturbance(0.0, 20.0, 0.0, 0.0, 0.0, 0.0, False)  # only the temperature differs from that of the room file
BOARD = replace(load_board("polaroid-6500"), max_range=3.0)


def scanned(echoes: EchoSource, order: ScanOrder, **settings: float) -> list[Reading]:
    with serve(FakeBoard(echoes), tcp="127.0.0.1:0", pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        if settings:
            scanner.configure(**settings)
        return list(scanner.scan(order))


def test_the_median_error_of_a_scan_is_below_a_millimetre() -> None:
    room = load_room(CHECKOUT / "rooms" / "simple.toml")
    place = room.place("figure9")
    echoes = RoomEchoes(room, place, BOARD, 1, ANY_AIR)
    echoes.prepare()
    assert echoes.temperature_c is not None
    assert abs(echoes.temperature_c - room.air.temperature_c) > 3
    readings = scanned(echoes, sector())
    true_ranges = predict_scan(room, place, BOARD, np.radians(np.arange(0, 360, 5))).ranges
    measured = np.array([math.nan if reading.range is None else reading.range for reading in readings])
    assert np.nanmedian(np.abs(measured - true_ranges)) < 1e-3


@pytest.mark.parametrize(("thermometer", "assumed"), [(5.0, 5.0), (35.0, 35.0), (None, 20.0)])
@pytest.mark.parametrize("settings", [{}, {"listen": 0.05}], ids=["not configured", "configured"])
def test_a_scan_has_a_temperature(thermometer: float | None, assumed: float, settings: dict[str, float]) -> None:
    (reading,) = scanned(PlainEchoes(thermometer), ONE, **settings)
    assert reading.range == pytest.approx(speed_of_sound(assumed) * echo_time(0.0) / 2, rel=1e-5)
