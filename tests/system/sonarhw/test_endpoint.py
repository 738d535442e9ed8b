"""An endpoint and the system: addresses, links, time and bounded memory."""

import os
import socket
import threading
import time
from pathlib import Path

import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Clock, Pace, TcpServerPort, open_server_port, serve
from sonarhw.errors import InputError, LinkBusy, LinkError
from sonarhw.host.scanner import Scanner
from sonarhw.readings import Ping, PingResult, pings_in_place
from sonarhw.wire.messages import Outcome
from tests.fixtures.plain_echoes import PlainEchoes
from tests.hang_guard import HANG, wait_until

_PING = 0.1  # s from one ping to the next


class EndlessSender:
    """A device that always has bytes to send."""

    busy = True
    plug = 0
    speedup = 1.0

    def __init__(self) -> None:
        self.sent = 0
        self.hung_up = threading.Event()

    def receive(self, data: bytes, now: float) -> None:
        """Ignore the data."""

    def next_event(self) -> float | None:
        """Return a time that has always passed."""
        return 0.0

    def advance(self, now: float) -> bytes:
        """Return 4096 bytes."""
        self.sent += 4096
        return bytes(4096)

    def hang_up(self) -> None:
        """Record the disconnect."""
        self.hung_up.set()


class Failing(EndlessSender):
    """A device that raises an exception."""

    def advance(self, now: float) -> bytes:
        """Raise an exception."""
        raise ZeroDivisionError("broken device")


def test_a_link_left_behind_is_replaced_and_anything_else_is_kept(tmp_path: Path) -> None:
    dangling, file, folder = tmp_path / "dangling", tmp_path / "file", tmp_path / "folder"
    dangling.symlink_to("/dev/pts/gone")
    file.write_text("precious")
    folder.mkdir()
    with serve(FakeBoard(PlainEchoes()), pty=dangling, pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        assert scanner.info.serial == "FAKE-0000"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.symlink_to(tmp_path / "gone")
    for taken in (file, folder, elsewhere):
        with pytest.raises(InputError, match="exists already"), serve(FakeBoard(PlainEchoes()), pty=taken):
            pass
    assert file.read_text() == "precious"
    with (
        pytest.raises(InputError, match="cannot create the link"),
        serve(FakeBoard(PlainEchoes()), pty=folder / "no" / "x"),
    ):
        pass


def test_a_link_to_a_terminal_that_another_program_has_opened_since_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "scanner"
    link.symlink_to("/dev/pts/0")
    with open_server_port(pty=tmp_path / "other") as other:
        # as if a killed fake had used this terminal before
        link.unlink()
        link.symlink_to(os.readlink(other.url))
        taken = link.lstat().st_ctime
        with pytest.raises(InputError, match="exists already"), open_server_port(pty=link):
            pass
        wait_until(lambda: time.time() > taken + 0.1)
        os.chmod(os.readlink(other.url), 0o600)  # the terminal is newer than the link now
        with open_server_port(pty=link):
            assert os.readlink(link) != os.readlink(other.url)


def test_a_second_client_over_tcp_is_told_that_the_scanner_is_busy() -> None:
    with serve(FakeBoard(PlainEchoes()), tcp="127.0.0.1:0") as endpoint:
        with Scanner.open(endpoint.url) as first:
            for _ in range(6):
                with pytest.raises(LinkBusy, match="is busy: another program is connected"):
                    Scanner.open(endpoint.url)
            assert first.home() is Outcome.DONE
        with Scanner.open(endpoint.url) as next_one:
            assert next_one.home() is Outcome.DONE


def test_tcp_listens_on_the_loopback_only() -> None:
    with serve(FakeBoard(PlainEchoes()), tcp=":0") as endpoint:
        assert endpoint.url.startswith("socket://127.0.0.1:")


def test_a_tcp_port_in_use_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(LinkError, match="cannot listen"), serve(FakeBoard(PlainEchoes()), tcp=address):
            pass


@pytest.mark.parametrize("pace", [0, -1.0, float("nan"), float("inf"), "quick"])
def test_a_pace_is_real_max_or_a_factor(pace: float) -> None:
    with pytest.raises(InputError, match="pace"), serve(FakeBoard(PlainEchoes()), pace=pace):
        pass


@pytest.mark.parametrize("line", ["pty", "tcp"])
def test_a_client_that_does_not_read_blocks_the_device(line: str, tmp_path: Path) -> None:
    device = EndlessSender()
    options = {"pty": tmp_path / "scanner"} if line == "pty" else {"tcp": "127.0.0.1:0"}
    with serve(device, pace="max", **options) as endpoint:  # type: ignore[arg-type]
        client = None
        if line == "tcp":
            host, _, port = endpoint.url.removeprefix("socket://").partition(":")
            client = socket.create_connection((host, int(port)))
        idle_checks, before = 0, -1
        while idle_checks < 5:  # until nothing was sent between five checks
            idle_checks = idle_checks + 1 if device.sent == before else 0
            before = device.sent
            threading.Event().wait(0.02)
        assert device.sent < 16_000_000
        if client:
            client.close()
            assert device.hung_up.wait(timeout=HANG)


def test_an_exception_in_the_device_reaches_the_caller_and_disconnects_the_client() -> None:
    def serve_until_it_fails() -> None:
        with serve(Failing(), tcp="127.0.0.1:0") as endpoint:
            name = f"serve {endpoint.url}"
            wait_until(lambda: name not in [thread.name for thread in threading.enumerate()])

    with pytest.raises(ZeroDivisionError, match="broken device"):
        serve_until_it_fails()


def test_time_runs_at_its_pace_and_stops_while_held(monkeypatch: pytest.MonkeyPatch) -> None:
    real = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: real)
    clock = Clock(4.0)
    real += 0.05
    clock.tick(held=False)
    assert clock.step(None) == pytest.approx(0.2)
    assert clock.real_until(0.6) == pytest.approx(0.1)
    real += 0.05
    clock.tick(held=True)
    assert clock.step(None) == pytest.approx(0.2)
    real += 3600  # after the machine has slept, the clock of the device does not jump by an hour
    clock.tick(held=False)
    assert clock.step(None) < 2.0


class SlowEchoes(PlainEchoes):
    """Echoes that take longer to compute than a ping lasts."""

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of a ping, late."""
        time.sleep(3.5 * _PING)
        return super().receive(ping)


@pytest.mark.parametrize("pace", ["real", "max"])
def test_a_device_that_computes_for_long_is_not_taken_for_lost(pace: Pace) -> None:
    board = FakeBoard(SlowEchoes())
    with serve(board, tcp="127.0.0.1:0", pace=pace) as endpoint, Scanner.open(endpoint.url) as scanner:
        assert len(list(scanner.scan(pings_in_place(8)))) == 8


def test_a_port_never_waits_for_its_client() -> None:
    """With nothing to read, and with a client that reads nothing."""
    port = TcpServerPort("127.0.0.1:0")
    sent: list[int | None] = []

    def converse() -> None:
        assert port.read() == b""  # accepts the client
        assert port.read() == b""
        while sent[-1:] != [0]:
            sent.append(port.write(bytes(65_536)))

    with socket.create_connection(("127.0.0.1", int(port.url.rpartition(":")[2]))):
        thread = threading.Thread(target=converse, daemon=True)
        thread.start()
        thread.join(HANG)
        assert not thread.is_alive()
    assert sent[-1] == 0
    port.close()
