"""`sonarhw wiring` and `sonarhw turn --jog`, on a fake board with wiring faults."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from sonarhw.device.endpoint import serve
from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.wiring_faults import Wires, WiringFault
from tests.fixtures.plain_echoes import PlainEchoes
from tests.system.cli.instrument.test_scan_command import sonarhw


@contextmanager
def served(faults: WiringFault = WiringFault(0), minor: int = 2) -> Iterator[tuple[FakeBoard, str]]:
    """A fake board with these faults, and its URL."""
    board = FakeBoard(PlainEchoes(), seed=2, identity=BoardIdentity(minor=minor), wires=Wires(faults))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        yield board, endpoint.url


def test_levels_and_inverted_parts_are_printed() -> None:
    with served(WiringFault.ECHO_HIGH | WiringFault.CAM_INVERTED) as (board, url):
        assert math.degrees(board._turntable.initial) == pytest.approx(344.2, abs=0.1)  # the mark is dark, the cam high
        plain = sonarhw("wiring", url)
        assert plain.stdout.splitlines() == ["mark      low", "cam       low", "echo      high", "inverted  nothing"]
        assert "inverted  cam, motor\n" in sonarhw("wiring", url, "--invert", "cam", "--invert", "motor").stdout
        assert "inverted  cam\n" in sonarhw("wiring", url, "--normal", "motor").stdout


def test_an_inverted_cam_is_corrected_so_that_home_succeeds() -> None:
    with served(WiringFault.CAM_INVERTED) as (_, url):
        failed = sonarhw("home", url)
        assert failed.returncode == 1
        assert "the cam never changed" in failed.stderr
        assert sonarhw("wiring", url, "--invert", "cam").returncode == 0
        assert sonarhw("home", url).returncode == 0


@pytest.mark.parametrize(("fault", "sign"), [(WiringFault(0), 1), (WiringFault.MOTOR_REVERSED, -1)])
def test_a_jog_shows_the_direction_of_the_motor(fault: WiringFault, sign: int) -> None:
    with served(fault) as (board, url):
        before = board._turntable.true_angle(1e9)
        done = sonarhw("turn", url, "--jog", "5")
        assert (done.returncode, done.stderr) == (0, f"{url}: turned by 5.0°\n")
        assert math.degrees(board._turntable.true_angle(1e9) - before) == pytest.approx(5 * sign)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wiring", "--invert", "cam", "--normal", "cam"), "--invert, --normal: the same part is in both"),
        (("turn", "--jog", "11"), "11 degrees: expected a jog between -10 and 10"),
        (("turn", "--jog", "--zero-here", "5"), "--jog, --zero-here: give only one of them"),
    ],
)
def test_bad_options_are_refused_in_one_line(arguments: tuple[str, ...], message: str) -> None:
    command, *rest = arguments
    done = sonarhw(command, "socket://127.0.0.1:1", *rest)
    assert done.returncode == 2
    assert message in done.stderr


@pytest.mark.parametrize("arguments", [("wiring",), ("turn", "--jog", "5")])
def test_older_firmware_is_named(arguments: tuple[str, ...]) -> None:
    with served(minor=1) as (_, url):
        done = sonarhw(arguments[0], url, *arguments[1:])
    assert done.returncode == 1
    assert "its firmware uses protocol 1.1" in done.stderr
    assert done.stderr.count("\n") == 1
