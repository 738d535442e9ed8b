"""The banner shows each message once; the current state comes first, then the newest error, then the newest warning."""

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.session.notices import Notice, NoticeButton, Notices
from sonarhw_gui.window.bars import Banner

from sonarhw.errors import InputError


def test_each_message_waits_once_and_the_newest_is_shown() -> None:
    notices = Notices()
    for message in ("first", "second", "first"):
        notices.warn(message)
    assert (notices.shown.text, notices.more) == ("first", 1)
    notices.dismiss()
    assert (notices.shown.text, notices.more) == ("second", 0)
    notices.dismiss()
    assert notices.shown.text == ""


def test_dismissing_removes_the_message_that_is_shown() -> None:
    notices = Notices()
    notices.set_state("the cable is out")
    notices.warn("the disk is nearly full")
    notices.fail("no such file")
    notices.show_next()
    assert notices.shown.text == "no such file"
    notices.dismiss()
    assert notices.shown.text == "the disk is nearly full"
    notices.show_next()
    assert notices.shown.text == "the cable is out"
    notices.dismiss()
    assert (notices.shown.text, notices.more) == ("the disk is nearly full", 0)


def test_the_current_state_comes_first_and_disappears_when_it_ends() -> None:
    notices = Notices()
    notices.warn("the disk is nearly full")
    notices.set_state("the cable is out")
    assert (notices.shown.text, notices.more) == ("the cable is out", 1)
    notices.set_state("")
    assert notices.shown.text == "the disk is nearly full"


def test_a_dismissed_state_is_shown_again_only_after_it_has_ended() -> None:
    notices = Notices()
    notices.set_state("the cable is out")
    notices.dismiss()
    notices.set_state("reconnecting")
    assert notices.shown.text == ""
    notices.set_state("")
    notices.set_state("the cable is out")
    assert notices.shown.text == "the cable is out"


def test_clear_removes_events_but_not_the_current_state() -> None:
    notices = Notices()
    notices.warn("the disk is nearly full")
    notices.set_state("the cable is out")
    notices.clear()
    assert (notices.shown.text, notices.more) == ("the cable is out", 0)


def test_the_banner_is_visible_only_with_messages(qtbot: QtBot) -> None:
    notices = Notices()
    banner = Banner(notices)
    qtbot.addWidget(banner)
    notices.set_state("the cable is out")
    notices.warn("the disk is nearly full")
    assert banner.message == "⚠ the cable is out"
    notices.set_state("")
    assert banner.message == "⚠ the disk is nearly full"
    qtbot.mouseClick(banner.close_button, Qt.MouseButton.LeftButton)
    assert banner.isHidden()


def test_an_error_hides_no_warning_and_a_click_on_more_shows_it(qtbot: QtBot) -> None:
    notices = Notices()
    banner = Banner(notices)
    qtbot.addWidget(banner)
    notices.fail("no such file")
    notices.warn("the sensor was moved only in the window")
    assert banner.message == "⚠ no such file"
    assert "1 more" in banner.more_button.text()
    for expected in ("⚠ the sensor was moved only in the window", "⚠ no such file"):
        qtbot.mouseClick(banner.more_button, Qt.MouseButton.LeftButton)
        assert banner.message == expected
    notices.fail("no such port")
    assert banner.message == "⚠ no such port"
    notices.clear()
    assert banner.isHidden()


def test_an_accepted_offer_is_carried_out_once_and_its_error_is_a_message(qtbot: QtBot) -> None:
    notices, answers = Notices(), []
    banner = Banner(notices)
    qtbot.addWidget(banner)

    def refuse(subject: object) -> None:
        raise InputError(f"{subject} is gone")

    for _ in range(2):  # the same offer again: one message
        notices.add(
            Notice(
                "the room has changed", NoticeButton("Reload", answers.append, 1), NoticeButton("Keep", refuse, "it")
            )
        )
    assert (banner.accept_button.text(), banner.decline_button.text(), notices.more) == ("Reload", "Keep", 0)
    qtbot.mouseClick(banner.accept_button, Qt.MouseButton.LeftButton)
    assert (answers, banner.isHidden()) == ([1], True)
    notices.add(
        Notice("the room has changed", NoticeButton("Reload", answers.append, 1), NoticeButton("Keep", refuse, "it"))
    )
    qtbot.mouseClick(banner.decline_button, Qt.MouseButton.LeftButton)
    assert (answers, banner.message) == ([1], "⚠ it is gone")


def test_what_ends_a_message_leaves_the_others() -> None:
    notices = Notices()
    notices.fail("no answer", "connected")
    notices.warn("the disk is nearly full")
    notices.end("search changed")
    assert notices.shown.text == "no answer"
    notices.end("connected")
    assert (notices.shown.text, notices.more) == ("the disk is nearly full", 0)
