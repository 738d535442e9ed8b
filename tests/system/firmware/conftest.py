"""Fixtures of the firmware tests. They build the firmware first, which is quick if nothing has changed."""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.predict.room_echoes import RoomEchoes

from sonarhw import Scanner
from sonarhw.device.emulated_board import EmulatedBoard, emulated_board
from sonarhw.readings import Ping, PingResult, Trace
from tests.checkout import CHECKOUT
from tests.fixtures.portable_board import PortableBoard

FIRMWARE = CHECKOUT / "firmware"
# Times real time. Above 2.4, the board slows down before each sign of life of the host, which comes every 0.5 s.
PACE = 2.0


@pytest.fixture(scope="session", autouse=True)
def built() -> Path:
    """The folder with up-to-date builds of firmware, emulator and the library of the portable part."""
    make = ["make", "-C", FIRMWARE, "WERROR=-Werror", "combinations", "emulator", "host"]
    made = subprocess.run(make, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return FIRMWARE / "build"


@pytest.fixture
def board(built: Path) -> PortableBoard:
    """The portable part on the test board, just switched on."""
    return PortableBoard(built / "libsonar.so")


class Echoes:
    """Echo source with the same echoes at every heading and a sine as trace."""

    temperature_c = 21.3

    def __init__(self, *times: float) -> None:
        self._times = times
        self.pings: list[Ping] = []

    def receive(self, ping: Ping) -> PingResult:
        """Return the given echoes and the trace."""
        self.pings.append(ping)
        time = np.arange(0, 0.0655, 2e-6)
        return PingResult(self._times, Trace(envelope(time), 500_000.0, 0.0))


class Mishap(Echoes):
    """Echo source that does something to the board in the instruction that begins a ping, however late the host is."""

    act: Callable[[], None]

    def __init__(self, *times: float, before: int) -> None:
        super().__init__(*times)
        self._before = before  # pings

    def receive(self, ping: Ping) -> PingResult:
        """Return the given echoes."""
        if len(self.pings) == self._before:
            self.act()
        return super().receive(ping)


def envelope(time: np.ndarray) -> np.ndarray:
    """Return a sine of 50 Hz, so slow that a level identifies its time to a hundredth."""
    return 0.5 + 0.5 * np.sin(2 * np.pi * 50 * time)


@contextmanager
def scanner_on(echoes: Echoes | RoomEchoes, **options: object) -> Iterator[tuple[EmulatedBoard, Scanner]]:
    """A board with these echoes, and a scanner that is connected to it."""
    with emulated_board(echoes, pace=PACE, **options) as board, Scanner.open(board.url) as scanner:  # type: ignore[arg-type]
        yield board, scanner
