"""The window names readings by their origin: only those of a scanner are called measured."""

from pathlib import Path

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_cli.app import run
from sonarhw_gui.model.rows import Column
from sonarhw_gui.views.marks import reading_tip
from sonarhw_gui.window.window import MainWindow

from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import until


def legend_texts(window: MainWindow) -> set[str]:
    return {entry.text() for entry in window.legend.entries.values()}


def test_title_legend_table_and_tooltip_name_the_origin_of_a_log(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    simulated = tmp_path / "simulated.mcap"
    assert run(["simulate", str(ROOM), "--place", "figure9", "--step", "30", "--out", str(simulated)]) == 0
    window = open_with()
    assert "measured: match" in legend_texts(window)
    for path, origin, count in ((simulated, "simulated", 12), (recorded, "fake", ORDER.readings)):
        window.session.show_log(read_log(path), path.name, path)
        until(qtbot, lambda count=count: len(window.session.shown.readings) == count)
        until(qtbot, lambda origin=origin: f" · {origin} readings — " in window.windowTitle())
        assert {f"{origin}: match", f"{origin} trace"} <= legend_texts(window)
        assert "measured: match" not in legend_texts(window)
        assert reading_tip(window.session.shown, 0).splitlines()[1].startswith(f"{origin} ")
        window.views.table.show_state(window.session.shown)
        header = window.views.table.model.headerData(Column.MEASURED, Qt.Orientation.Horizontal)
        assert header == f"{origin} (m)"
        window.views.side_by_side.show_state(window.session.shown)
        assert window.views.side_by_side.title.text() == origin.capitalize()
        fake = origin == "fake"
        until(qtbot, lambda fake=fake: window.status_bar.fake.isVisible() == fake)
        assert ("hides one post" in window.hint.labels[0].text()) == fake
        assert origin in window.hint.labels[0].text()
        assert "measured" not in window.hint.labels[0].text()


def test_readings_of_a_fake_scanner_have_their_name_from_the_first_paint(open_with: OpenWith) -> None:
    """Before the scanner has identified itself: its URL says what it is."""

    def never() -> Scanner:
        raise AssertionError("nothing connects")

    window = open_with(source=never, url="fake:simple?place=figure9")
    assert {"fake: match", "fake trace"} <= legend_texts(window)
    assert "none yet" in window.hint.labels[0].text()
    real = open_with(source=never, url="socket://localhost:4000")
    assert {"measured: match", "measured trace"} <= legend_texts(real)
