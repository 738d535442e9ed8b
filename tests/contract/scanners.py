"""The scanners under test: over each kind of line, and without one. Each is a context manager.

To test another scanner, add it to SCANNERS.
"""

import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from sonarhw_compare.scanner_url import resolve

from sonarhw.device.emulated_board import emulated_board
from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.served import serve
from tests.checkout import CHECKOUT
from tests.contract.talk import DirectLine
from tests.fixtures.plain_echoes import PlainEchoes
from tests.fixtures.portable_board import PortableBoard, PortableDevice
from tests.free_port import free_port
from tests.hang_guard import HANG, wait_until

ROOM = CHECKOUT / "rooms" / "simple.toml"
FIRMWARE = CHECKOUT / "firmware"
PACE = 10.0  # times real time; a fake at pace max would never detect a silent host
_SER2NET = """%YAML 1.1
---
connection: &scanner
  accepter: telnet(rfc2217),tcp,127.0.0.1,{port}
  connector: serialdev,{device},1000000n81,local
"""

Scanner = Callable[[], AbstractContextManager[str]]


@contextmanager
def in_this_process() -> Iterator[str]:
    """Provide the fake at a `fake:` URL, in this process."""
    with resolve(f"fake:{ROOM}?place=figure9&seed=5&pace={PACE:g}") as find:
        yield find()


@contextmanager
def on_a_pseudo_terminal() -> Iterator[str]:
    """Serve a fake board on a pseudo-terminal."""
    with TemporaryDirectory() as folder, serve(_board(), pty=Path(folder) / "scanner", pace=PACE) as endpoint:
        yield endpoint.url


@contextmanager
def over_tcp() -> Iterator[str]:
    """Serve a fake board at a socket:// URL."""
    with serve(_board(), tcp="127.0.0.1:0", pace=PACE) as endpoint:
        yield endpoint.url


@contextmanager
def behind_ser2net() -> Iterator[str]:
    """Serve a fake board on a pseudo-terminal, and this over the network with ser2net."""
    with on_a_pseudo_terminal() as device, ser2net(device) as url:
        yield url


@contextmanager
def ser2net(device: str) -> Iterator[str]:
    """Serve a serial port on the network with ser2net."""
    with TemporaryDirectory() as folder:
        port = free_port()
        config = Path(folder) / "ser2net.yaml"
        config.write_text(_SER2NET.format(port=port, device=device))
        with _running("ser2net", "-n", "-u", "-c", str(config)):
            wait_until(lambda: _listens(port))
            # a pseudo-terminal has no DTR, and ser2net does not answer requests to set it
            yield f"rfc2217://127.0.0.1:{port}?ign_set_control"


@contextmanager
def emulated() -> Iterator[str]:
    """Build the firmware and the emulator, and run the firmware on the emulated board."""
    with _emulated("mega") as url:
        yield url


@contextmanager
def emulated_uno() -> Iterator[str]:
    """Run the firmware of an Arduino Uno with a 6500, which sends no traces, on the emulated board."""
    with _emulated("uno") as url:
        yield url


@contextmanager
def emulated_pi() -> Iterator[str]:
    """Run the firmware as a Linux program on an emulated GPIO chip."""
    with _emulated("linux") as url:
        yield url


@contextmanager
def fake() -> Iterator[DirectLine]:
    """Provide a fake board without a port."""
    board = FakeBoard(PlainEchoes(), seed=5, identity=BoardIdentity(bauds=(250_000, 1_000_000)))
    yield DirectLine(board, lambda: board.line.baud)


@contextmanager
def portable() -> Iterator[DirectLine]:
    """Build the portable part of the firmware for this machine, and provide it on its test board."""
    _make("host")
    board = PortableBoard(FIRMWARE / "build" / "libsonar.so")
    yield DirectLine(PortableDevice(board), board.c.host_baud)


DIRECT: dict[str, Callable[[], AbstractContextManager[DirectLine]]] = {
    "fake without a port": fake,
    "portable firmware without a port": portable,
}
SCANNERS: dict[str, Scanner] = {
    "fake in this process": in_this_process,
    "fake on a pseudo-terminal": on_a_pseudo_terminal,
    "fake over TCP": over_tcp,
    "fake behind ser2net": behind_ser2net,
    "firmware on the emulated board": emulated,
    "firmware on an emulated Uno": emulated_uno,
    "firmware on an emulated Raspberry Pi": emulated_pi,
}
LONG = ("firmware on an emulated Uno",)  # only with --soak
ONE_LINE = "firmware on the emulated board"  # with tests of single messages, beside the devices without a port


@contextmanager
def _emulated(chip: str) -> Iterator[str]:
    _make(f"CHIP={chip}", "all", "emulator")
    with emulated_board(PlainEchoes(), pace=2.0, combination=f"{chip}-polaroid-step-dir") as board:
        yield board.url


def _make(*targets: str) -> None:
    subprocess.run(["make", "-C", FIRMWARE, *targets], check=True, stdout=subprocess.DEVNULL)


def _board() -> FakeBoard:
    return FakeBoard(PlainEchoes(), seed=5)


@contextmanager
def _running(*command: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(timeout=HANG)
            except subprocess.TimeoutExpired:
                process.kill()


def _listens(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port)).close()
    except ConnectionRefusedError:
        return False
    return True
