"""Pictures of the window at 1280 × 800: the demo room live and in replay, from a real scan with traces.

They go to the folder in SONARHW_SCREENSHOTS (docs/screenshots holds such a pair), else to a temporary one.
"""

import os
from math import radians
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from gui.main_window import MainWindow
from gui.scene import Scene
from sim.board import load_board
from sim.room import load_room
from sim.truth import RoomEchoes
from sonarhw.board import Board
from sonarhw.endpoint import Pace, serve
from sonarhw.log import read_log
from sonarhw.readings import ScanOrder
from sonarhw.scanner import Scanner
from tests.gui.conftest import ROOM, OpenWith
from tests.gui.driving import ended, predicted, until

SIZE = (1280, 800)
ASKED_FOR = "SONARHW_SCREENSHOTS"
HEADINGS = 120
ORDER = ScanOrder(0.0, radians(3), HEADINGS, sweeps=2)  # the second leaves time for the picture of the first
LIVE_UP_TO = 84  # readings in the picture of the running scan
ASKED_LIVE, ASKED_IN_REPLAY = 74, 15  # the readings that the pictures explain


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(os.environ.get(ASKED_FOR, tmp_path))


@pytest.fixture
def at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recordings folder that the status bar shows as it would a person's own."""
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    return tmp_path / ".local" / "share" / "sonarhw" / "recordings"


def test_pictures_of_the_demo_live_and_in_replay(
    qtbot: QtBot, open_with: OpenWith, folder: Path, at_home: Path
) -> None:
    room = load_room(ROOM.with_name("laboratory.toml"))
    scene = Scene(room, room.place("bench"), load_board("polaroid-6500"), "laboratory.toml")
    echoes = RoomEchoes(room, room.place("bench"), scene.board, seed=1)
    echoes.prepare()
    # a picture to keep is taken at the pace of a real board
    pace: Pace = "real" if ASKED_FOR in os.environ else 4.0
    with serve(Board(echoes, 1, scene.board.blanking), tcp="127.0.0.1:0", pace=pace) as endpoint:
        window = open_with(scene=scene, order=ORDER, source=lambda: Scanner.open(endpoint.url), recordings=at_home)
        until(qtbot, lambda: predicted(window))
        window.commands.scan.trigger()
        until(qtbot, lambda: len(window.session.shown.readings) >= LIVE_UP_TO)
        window.session.choose(ASKED_LIVE)
        until(qtbot, lambda: window.session.shown.chosen_row is not None)
        save(window, folder / "live.png")
        assert window.status_bar.badge.text() == "● live"
        until(qtbot, lambda: len(window.session.shown.readings) >= HEADINGS)
        window.commands.stop.trigger()
        until(qtbot, lambda: ended(window))
        recording = window.session.status.recording
        window.close()
    show_replay(
        qtbot, open_with(scene=scene, source=read_log(recording), source_name=recording.name), folder / "replay.png"
    )


def show_replay(qtbot: QtBot, window: MainWindow, picture: Path) -> None:
    until(qtbot, lambda: predicted(window))
    window.session.replay.seek(0.75 * window.session.replay.state.duration)
    window.session.choose(ASKED_IN_REPLAY)
    window.session.replay.toggle()
    until(qtbot, lambda: window.status_bar.badge.text() == "replay" and window.session.status.rate > 5)
    save(window, picture)


def save(window: MainWindow, picture: Path) -> None:
    picture.parent.mkdir(parents=True, exist_ok=True)
    image = window.grab().toImage()
    assert (image.width(), image.height()) == SIZE
    assert image.save(str(picture))
