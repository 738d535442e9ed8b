"""Scans complete under faults on real lines, with real threads and real time."""

import math
import os
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from sonarhw.device.faults import FaultyDevice, read_faults
from sonarhw.device.served import Endpoint, serve
from sonarhw.host.scanner import Scanner
from sonarhw.link import Link
from sonarhw.readings import ScanOrder
from tests.contract.relay import Relay
from tests.contract.scanners import emulated, emulated_uno, ser2net
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import assert_scanned
from tests.hang_guard import wait_until

ORDER = ScanOrder(start=0.0, step=math.radians(5), headings=20, sweeps=2)
MICROSTEP = math.tau / 3200
TICKS = 1e-6  # s; two ticks of the firmware's timer
PACE = 5.0  # times real time; the faults count the seconds of the board
FAULTS = [
    "drop=1/1000,flip=1/1000,insert=1/1000",
    "stall=10@r5",
    "deaf=10@r5",
    "mute=10@r5",
    "reset@r5,reset@r25",
    "nonsense=10@r5",
    "unplug=5@r5",
    "unplug=5@r5,reset=10@r5",
]


@contextmanager
def served(kind: str, device: FaultyDevice, folder: Path) -> Iterator[tuple[str, Endpoint]]:
    """Serve the device on this kind of line; yield its URL and its endpoint."""
    where = {"tcp": "127.0.0.1:0"} if kind == "tcp" else {"pty": folder / "scanner"}
    with serve(device, pace=PACE, **where) as endpoint:  # type: ignore[arg-type]
        if kind == "ser2net":
            with ser2net(endpoint.url) as url:
                yield url, endpoint
        else:
            yield endpoint.url, endpoint


CASES = [("tcp", faults) for faults in FAULTS]
# reconnecting through ser2net is slow
CASES += [(kind, faults) for kind in ("pty", "ser2net") for faults in (FAULTS[0], FAULTS[-1])]


@pytest.mark.parametrize(("kind", "faults"), CASES)
def test_a_scan_completes_over_every_line_under_every_fault(kind: str, faults: str, tmp_path: Path) -> None:
    with served(kind, faulty(faults), tmp_path) as (url, _), Scanner.open(url) as scanner:
        assert_scanned(list(scanner.scan(ORDER)), ORDER)


def test_bytes_waiting_in_ser2net_are_read_together() -> None:
    sent = bytes(range(256)) * 8
    master, slave = os.openpty()
    tty.setraw(slave)
    with ser2net(os.ttyname(slave)) as url, Link(url) as link:
        os.write(master, sent)
        wait_until(lambda: link.port.in_waiting == len(sent))
        assert link.read() == sent
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_a_scanner_that_returns_under_another_name_is_found(kind: str, tmp_path: Path) -> None:
    with (
        served(kind, faulty("move=5@r5"), tmp_path) as (url, endpoint),
        Scanner.open(url, find=lambda: endpoint.url) as scanner,
    ):
        assert_scanned(list(scanner.scan(ORDER)), ORDER)
        assert endpoint.url != url
        assert scanner.statistics.losses >= 1


@pytest.mark.parametrize("board", [emulated, emulated_uno])
def test_firmware_and_driver_complete_a_scan_over_a_bad_line(board: Callable[[], AbstractContextManager[str]]) -> None:
    faults = read_faults("drop=1/2000,flip=1/2000,insert=1/2000")
    with board() as url, Link(url) as link:
        relay = Relay(link, faults)
        try:
            with serve(relay, tcp="127.0.0.1:0") as endpoint, Scanner.open(endpoint.url) as scanner:
                readings = list(scanner.scan(ORDER))
                assert scanner.statistics.rejected_blocks > 0
        finally:
            relay.end()
    assert_scanned(readings, ORDER, angle=MICROSTEP, echoes=1, echo=TICKS)
