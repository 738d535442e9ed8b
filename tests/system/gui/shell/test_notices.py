"""What the banner says: each message once and in turn, what stands before what happened, and gone when it is over."""

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.bars.banner import Banner
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.shown.notices import Notices


def test_messages_wait_behind_one_another() -> None:
    notices = Notices()
    for message in ("first", "second", "first"):
        notices.add(message)
    assert (notices.now, notices.more) == ("first", 1)
    notices.dismiss()
    assert (notices.now, notices.more) == ("second", 0)
    notices.dismiss()
    assert notices.now == ""


def test_what_stands_comes_first_and_goes_by_itself() -> None:
    notices = Notices()
    notices.add("the disk is nearly full")
    notices.set_state("the cable is out")
    assert (notices.now, notices.more) == ("the cable is out", 1)
    notices.set_state("")
    assert notices.now == "the disk is nearly full"


def test_what_stands_and_was_put_away_comes_back_only_when_it_is_so_again() -> None:
    notices = Notices()
    notices.set_state("the cable is out")
    notices.dismiss()
    notices.set_state("reconnecting")
    assert notices.now == ""
    notices.set_state("")
    notices.set_state("the cable is out")
    assert notices.now == "the cable is out"


def test_a_new_scan_forgets_what_happened_but_not_what_stands() -> None:
    notices = Notices()
    notices.add("the disk is nearly full")
    notices.set_state("the cable is out")
    notices.clear()
    assert (notices.now, notices.more) == ("the cable is out", 0)


def test_the_banner_is_there_only_while_there_is_something_to_say(qtbot: QtBot) -> None:
    banner = Banner()
    qtbot.addWidget(banner)
    banner.show_state(Status(trouble="the cable is out"))
    banner.show_message("the disk is nearly full")
    assert banner.message == "⚠ the cable is out"
    banner.show_state(Status())
    assert banner.message == "⚠ the disk is nearly full"
    qtbot.mouseClick(banner.close_button, Qt.MouseButton.LeftButton)
    assert banner.isHidden()
