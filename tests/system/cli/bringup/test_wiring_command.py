"""`sonarhw wiring` and `sonarhw turn --jog`, on a fake board with wiring faults."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sonarhw.device.fake_board import BoardIdentity, FakeBoard, Wires, WiringFault
from sonarhw.device.served import serve
from sonarhw.log import read_log
from tests.fixtures.commands import sonarhw
from tests.fixtures.plain_echoes import PlainEchoes


@contextmanager
def served(faults: WiringFault = WiringFault(0), minor: int = 2) -> Iterator[tuple[FakeBoard, str]]:
    """A fake board with these faults, and its URL."""
    board = FakeBoard(PlainEchoes(), seed=2, identity=BoardIdentity(minor=minor), wires=Wires(faults))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        yield board, endpoint.url


def test_levels_and_inverted_parts_are_printed() -> None:
    with served(WiringFault.ECHO_HIGH | WiringFault.CAM_INVERTED) as (board, url):
        assert math.degrees(board.turntable.initial) == pytest.approx(344.2, abs=0.1)  # the mark is dark, the cam high
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


def test_one_switch_homes_without_a_cam_and_limits_the_scan(tmp_path: Path) -> None:
    with served(WiringFault.CAM_OPEN) as (_, url):
        assert sonarhw("home", url).returncode == 1
        chosen = sonarhw("wiring", url, "--one-switch")
        assert chosen.stdout.splitlines()[-2:] == ["inverted  nothing", "homes by  mark"]
        assert sonarhw("home", url).returncode == 0
        log = tmp_path / "around.mcap"
        around = sonarhw("scan", url, "--from", "-175", "--to", "185", "--step", "10", "--out", str(log))
        assert around.returncode == 0, around.stderr
        assert len(read_log(log).readings) == 36
        beyond = sonarhw("turn", url, "176")
        assert "176 degrees; the cable winds from -175 to 175 degrees" in beyond.stderr
        assert "homes by" not in sonarhw("wiring", url, "--no-one-switch").stdout
        assert "the cam never changed" in sonarhw("home", url).stderr


@pytest.mark.parametrize(("fault", "sign"), [(WiringFault(0), 1), (WiringFault.MOTOR_REVERSED, -1)])
def test_a_jog_shows_the_direction_of_the_motor(fault: WiringFault, sign: int) -> None:
    with served(fault) as (board, url):
        before = board.turntable.true_angle(1e9)
        done = sonarhw("turn", url, "--jog", "5")
        assert (done.returncode, done.stderr) == (0, f"{url}: turned by 5.0°\n")
        assert math.degrees(board.turntable.true_angle(1e9) - before) == pytest.approx(5 * sign)
