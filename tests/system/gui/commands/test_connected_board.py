"""A scanner states its ranging board. The window predicts, scans and records for it, unless the user has a profile."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest
from pytestqt.qtbot import QtBot
from sonarhw_cli.window import _Scanners
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import ScannerFinder
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.room_echoes import RoomEchoes

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.served import serve
from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import ended, until

STATED = "hc-sr04"


@pytest.fixture
def url(echoes: RoomEchoes) -> Iterator[str]:
    """Serve a scanner with an HC-SR04 at a port, as a real one is."""
    board = FakeBoard(echoes, 2, identity=BoardIdentity(serial="FAKE-0002", profile=STATED))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        yield endpoint.url


@pytest.fixture
def finder() -> Iterator[ScannerFinder]:
    """Return the function with which `sonarhw gui` finds scanners."""
    with ExitStack() as exit_stack:
        yield _Scanners(exit_stack).find


def of(scene: Scene, board: Board) -> Scene:
    return replace(scene, board=board)


def scan(qtbot: QtBot, window: MainWindow) -> str:
    """Scan, and return the board that the log names."""
    before = window.session.status.job.recording
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and window.session.status.job.recording not in (None, before))
    return read_log(window.session.status.job.recording).metadata.board


def shown_board(window: MainWindow) -> str:
    return window.session.shown.scene.board.name


def test_the_first_scan_is_compared_and_recorded_with_the_board_of_the_scanner(
    qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder, url: str, scene: Scene
) -> None:
    window = open_with(
        scene=of(scene, load_board("polaroid-6500")),
        source=finder(url).opener,
        url=url,
        find_scanner=finder,
        takes_board=True,  # as `sonarhw gui URL` without --board
    )
    assert scan(qtbot, window) == STATED
    assert shown_board(window) == STATED
    assert f"board {STATED}" in window.banner.message


def test_a_board_that_the_user_chooses_afterwards_is_kept(
    qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder, url: str, scene: Scene
) -> None:
    window = open_with(scene=of(scene, load_board("polaroid-6500")), find_scanner=finder)
    window.session.scanners.choose(url)  # in the dialog Connect
    until(qtbot, lambda: shown_board(window) == STATED)
    window.commands.undo.trigger()
    assert shown_board(window) == "polaroid-6500"
    assert scan(qtbot, window) == "polaroid-6500"
    assert shown_board(window) == "polaroid-6500"


def test_a_profile_of_the_user_is_kept(
    qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder, url: str, scene: Scene
) -> None:
    calibrated = replace(load_board(STATED), name="mine", threshold_db=-21.0)
    window = open_with(scene=of(scene, calibrated), find_scanner=finder)
    window.session.scanners.choose(url)
    until(qtbot, lambda: ended(window) and window.session.status.link is not None)
    assert scan(qtbot, window) == "mine"
    assert shown_board(window) == "mine"
