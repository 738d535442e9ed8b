"""The banner shows each message once; the current state comes first, then the newest error, then the newest warning."""

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.session.notices import Notice, Notices
from sonarhw_gui.session.status import Status
from sonarhw_gui.window.bars import Banner


def test_each_message_waits_once_and_the_newest_is_shown() -> None:
    notices = Notices()
    for message in ("first", "second", "first"):
        notices.add(message)
    assert (notices.now, notices.more) == ("first", 1)
    notices.dismiss()
    assert (notices.now, notices.more) == ("second", 0)
    notices.dismiss()
    assert notices.now == ""


def test_dismissing_removes_the_message_that_is_shown() -> None:
    notices = Notices()
    notices.set_state("the cable is out")
    notices.add("the disk is nearly full")
    notices.add(Notice("no such file", error=True))
    notices.show_next()
    assert notices.now == "no such file"
    notices.dismiss()
    assert notices.now == "the disk is nearly full"
    notices.show_next()
    assert notices.now == "the cable is out"
    notices.dismiss()
    assert (notices.now, notices.more) == ("the disk is nearly full", 0)


def test_the_current_state_comes_first_and_disappears_when_it_ends() -> None:
    notices = Notices()
    notices.add("the disk is nearly full")
    notices.set_state("the cable is out")
    assert (notices.now, notices.more) == ("the cable is out", 1)
    notices.set_state("")
    assert notices.now == "the disk is nearly full"


def test_a_dismissed_state_is_shown_again_only_after_it_has_ended() -> None:
    notices = Notices()
    notices.set_state("the cable is out")
    notices.dismiss()
    notices.set_state("reconnecting")
    assert notices.now == ""
    notices.set_state("")
    notices.set_state("the cable is out")
    assert notices.now == "the cable is out"


def test_clear_removes_events_but_not_the_current_state() -> None:
    notices = Notices()
    notices.add("the disk is nearly full")
    notices.set_state("the cable is out")
    notices.clear()
    assert (notices.now, notices.more) == ("the cable is out", 0)


def test_the_banner_is_visible_only_with_messages(qtbot: QtBot) -> None:
    banner = Banner()
    qtbot.addWidget(banner)
    banner.show_state(Status(trouble="the cable is out"))
    banner.show_message("the disk is nearly full")
    assert banner.message == "⚠ the cable is out"
    banner.show_state(Status())
    assert banner.message == "⚠ the disk is nearly full"
    qtbot.mouseClick(banner.close_button, Qt.MouseButton.LeftButton)
    assert banner.isHidden()


def test_an_error_hides_no_warning_and_a_click_on_more_shows_it(qtbot: QtBot) -> None:
    banner = Banner()
    qtbot.addWidget(banner)
    banner.show_error("no such file")
    banner.show_message("the sensor was moved only in the window")
    assert banner.message == "⚠ no such file"
    assert "1 more" in banner.more_button.text()
    for expected in ("⚠ the sensor was moved only in the window", "⚠ no such file"):
        qtbot.mouseClick(banner.more_button, Qt.MouseButton.LeftButton)
        assert banner.message == expected
    banner.show_error("no such port")
    assert banner.message == "⚠ no such port"
    banner.show_message("")
    assert banner.isHidden()
