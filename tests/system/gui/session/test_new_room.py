"""A new room in the window: its walls, a fake scanner in it, what the log states, and the start page afterwards."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from pytestqt.qtbot import QtBot
from sonarhw_cli.window import _Scanners
from sonarhw_gui.window.dialogs import NewRoomDialog, open_dialog

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import ended, predicted, until


@pytest.fixture
def scanners() -> Iterator[_Scanners]:
    with ExitStack() as during:
        yield _Scanners(during)


def test_a_new_room_is_scanned_by_a_fake_scanner_and_closed_again(
    qtbot: QtBot, open_with: OpenWith, scanners: _Scanners
) -> None:
    window = open_with(find_scanner=scanners.find)
    session = window.session
    window.commands.new_room.trigger()
    dialog = open_dialog(window, NewRoomDialog)
    assert dialog is not None
    dialog.name.setText("Cellar")
    dialog.width_field.setValue(1.2)
    dialog.depth_field.setValue(0.9)
    dialog.buttons.accepted.emit()
    until(qtbot, lambda: predicted(window))
    assert session.shown.scene.room is not None
    assert session.shown.scene.room.walls.reshape(-1, 2).max(axis=0).tolist() == [1.2, 0.9]
    assert session.shown.scene.pose.position == (0.6, 0.45)

    window.commands.connect_fake.trigger()
    until(qtbot, lambda: session.status.can_scan)
    window.commands.scan.trigger()
    until(qtbot, lambda: len(session.shown.readings) > 3)
    window.commands.stop.trigger()
    until(qtbot, lambda: ended(window))
    metadata = read_log(session.log_file).metadata
    assert metadata.room_text == session.shown.scene.room.text
    assert not window.start_page.isVisible()

    window.commands.close_readings.trigger()
    until(qtbot, lambda: not session.shown.readings)
    window.commands.close_room.trigger()
    assert session.shown.scene.room is None
    until(qtbot, window.start_page.isVisible)
    assert not window.views.isVisible()
