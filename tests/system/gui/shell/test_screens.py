"""The window on every screen: nothing larger than the screen, no label or button cut, views in tabs where it is low."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, QRect, QSize, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QAbstractButton, QApplication, QLabel, QTabBar, QToolButton, QWidget
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import DARK, Look
from sonarhw_gui.widgets import ElidedLabel
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

FRAME = QSize(16, 48)
SCREENS = {  # and the number of stacks of small views
    "1024x600": (QSize(1024, 600), 1, Look()),
    "1024x600, dark, text a third larger": (QSize(1024, 600), 1, Look(palette=DARK, scale=4 / 3)),
    "2560x1440 at 200 %": (QSize(1280, 720), 2, Look()),
    "1280x800": (QSize(1280, 800), 2, Look()),
    "1920x1080": (QSize(1920, 1080), 3, Look()),
}


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    window.session.showing.choose(27)
    return window


def on_screen(window: MainWindow, size: QSize, monkeypatch: pytest.MonkeyPatch) -> QSize:
    """Lay the window out as on a screen of this size; return the size of the window."""
    monkeypatch.setattr(window.views, "screen", lambda: SimpleNamespace(availableSize=lambda: size))
    window.commands.reset_layout.trigger()
    window.resize(size - FRAME)
    return size - FRAME


def cut(window: MainWindow) -> list[str]:
    """Return the labels, buttons and tabs whose text is cut, or that lie outside the window."""
    parts = [part for part in window.findChildren(QWidget) if isinstance(part, QLabel | QAbstractButton | QTabBar)]
    shown = [part for part in parts if part.isVisible() and not part.visibleRegion().isEmpty()]
    found = [part for part in shown if isinstance(part, QLabel | QAbstractButton) and _is_cut(part)]
    tabs = [text for bar in shown if isinstance(bar, QTabBar) for text in _cut_tabs(bar)]
    return [f"{type(part).__name__} {part.text()!r}" for part in found] + [f"tab {text!r}" for text in tabs]


def _cut_tabs(bar: QTabBar) -> list[str]:
    """Return the names that are wider than their tabs."""
    names = [(bar.tabText(tab), bar.tabRect(tab).width()) for tab in range(bar.count())]
    return [text for text, width in names if bar.fontMetrics().horizontalAdvance(text) > width]


def _is_cut(part: QLabel | QAbstractButton) -> bool:
    if isinstance(part, ElidedLabel):
        return False  # its tooltip has the whole text
    if isinstance(part, QLabel) and part.wordWrap():
        return part.heightForWidth(part.width()) > part.height()
    text = part.text()
    if isinstance(part, QToolButton) and part.toolButtonStyle() == Qt.ToolButtonStyle.ToolButtonIconOnly:
        text = ""
    if not text:
        return False
    needed = part.minimumSizeHint().width() if isinstance(part, QLabel) else part.fontMetrics().horizontalAdvance(text)
    window = part.window()
    scrolled = any(type(parent).__name__ == "_VerticalScrollArea" for parent in _ancestors(part))
    across = QRect(part.mapTo(window, QPoint()), part.size())
    outside = across.left() < 0 or across.right() >= window.width() or across.bottom() >= window.height()
    return part.width() < needed or (outside and not scrolled)


def _ancestors(part: QWidget) -> list[QWidget]:
    parent = part.parentWidget()
    return [] if parent is None else [parent, *_ancestors(parent)]


def tops(window: MainWindow) -> set[int]:
    """Return where the stacks of small views begin."""
    return {dock.geometry().top() for dock in window.views.docks if dock.in_front}


def drag_line(views: QWidget, line: QPoint, by: QPoint) -> None:
    """Drag the line between two views with the left button held down."""
    left, none = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
    kinds = QEvent.Type.MouseButtonPress, QEvent.Type.MouseMove, QEvent.Type.MouseButtonRelease
    for kind, at, held in zip(kinds, (line, line + by, line + by), (left, left, none), strict=True):
        QApplication.processEvents()  # Qt moves the line between events
        button = none if kind is QEvent.Type.MouseMove else left
        places = QPointF(at), QPointF(views.mapToGlobal(at))
        QApplication.sendEvent(views, QMouseEvent(kind, *places, button, held, Qt.KeyboardModifier.NoModifier))


@pytest.mark.parametrize("screen", SCREENS)
def test_nothing_is_cut_or_off_screen_with_any_view_or_panel(
    qtbot: QtBot, window: MainWindow, screen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    available, stacks, look = SCREENS[screen]
    window.session.showing.set_look(look)
    size, problems = on_screen(window, available, monkeypatch), []

    def check(what: str) -> None:
        qtbot.wait(20)
        texts = cut(window)
        if window.size() != size or texts:
            qtbot.wait(200)  # wrapped text may need a second layout
            texts = cut(window)
        problems.extend(f"{what}: {text}" for text in texts)
        if window.size() != size:
            problems.append(f"{what}: {window.size().toTuple()}")
            window.resize(size)

    qtbot.wait(50)
    assert len(tops(window)) == stacks
    for view in window.commands.views:
        view.trigger()
        check(view.text())
        for panel in window.dock_openers:
            panel.trigger()
            check(f"{view.text()} with {panel.text()}")
            panel.trigger()
    for view in window.views.docks:
        view.raise_()
        check(view.windowTitle())
    panels = window.dock_openers
    for panel in panels:
        panel.trigger()
    for step in (window.commands.play_sound, window.commands.show_first_steps):
        step.trigger()
        check(f"{len(panels)} panels, and {step.text()}")
    window.session.notices.warn("a long message about a scanner that does not answer; check its cable and its supply")
    check(f"{len(panels)} panels, sound, hint and message")
    assert window.hint.isHidden() == (size.height() < 640)  # where both do not fit, the message is more important
    window.session.notices.clear()
    assert not window.hint.isHidden()
    assert problems == []
    for panel in reversed(panels):
        panel.trigger()


def test_each_large_view_keeps_its_share_of_the_width(qtbot: QtBot, window: MainWindow) -> None:
    views, (plan, beside, _) = window.views, window.commands.views

    def share() -> float:
        qtbot.wait(20)
        return views.stage.width() / views.width()

    beside.trigger()
    wide = share()
    assert wide > 0.7
    plan.trigger()
    narrow = share()
    assert narrow == pytest.approx(0.54, abs=0.02)
    frame = views.plan.drawing.plot.vb.viewRect()
    for panel in window.dock_openers[:2]:
        panel.trigger()
        assert share() == pytest.approx(narrow, abs=0.02)
    for size in (window.size() + QSize(300, 0), window.size()):
        window.resize(size)
        assert share() == pytest.approx(narrow, abs=0.02)
    for panel in reversed(window.dock_openers[:2]):
        until(qtbot, panel.isChecked)
        panel.trigger()
    until(qtbot, lambda: views.width() == window.width())
    assert share() == pytest.approx(narrow, abs=0.02)
    now = views.plan.drawing.plot.vb.viewRect()  # the room has its size again
    assert (now.width(), now.height()) == pytest.approx((frame.width(), frame.height()), rel=0.05)
    drag_line(views, views.stage.geometry().topRight() + QPoint(2, 100), QPoint(-100, 0))
    dragged = share()
    assert dragged < narrow - 0.04
    beside.trigger()
    assert share() == pytest.approx(wide, abs=0.02)
    plan.trigger()
    assert share() == pytest.approx(dragged, abs=0.02)
    kept, size = views.saveState(), window.size()
    for _ in range(3):  # a maximised window is restored in its normal size, and maximised afterwards
        window.resize(size - QSize(500, 0))
        assert views.restoreState(kept)
        window.resize(size)
        assert share() == pytest.approx(dragged, abs=0.02)
        kept = views.saveState()


def test_a_low_window_has_one_line_of_legend_until_more_is_pressed(
    qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    legend = window.legend

    def lines() -> int:
        qtbot.wait(50)
        return len({button.y() for button in legend.findChildren(QToolButton) if button.isVisible()})

    on_screen(window, QSize(1280, 800), monkeypatch)
    assert (lines(), legend.more.isVisible()) == (2, False)
    every = [button for button in legend.findChildren(QToolButton) if button.isVisible()]
    on_screen(window, QSize(1024, 600), monkeypatch)
    window.dock_openers[1].trigger()  # the room
    assert lines() == 1
    hidden = [button for button in every if not button.isVisible()]
    assert legend.more.text() == f"{len(hidden)} more"
    qtbot.mouseClick(legend.more, Qt.MouseButton.LeftButton)
    assert lines() > 2
    assert all(button.isVisible() for button in every)
    qtbot.mouseClick(legend.more, Qt.MouseButton.LeftButton)
    assert lines() == 1
    on_screen(window, QSize(1280, 800), monkeypatch)
    window.dock_openers[1].trigger()
    assert (lines(), legend.more.isVisible()) == (2, False)


def test_numbers_of_bounces_are_within_a_low_plan(
    qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    size, _, look = SCREENS["1024x600, dark, text a third larger"]
    window.session.showing.set_look(look)
    on_screen(window, size, monkeypatch)
    drawing = window.views.plan.drawing
    view = drawing.plot.vb.sceneBoundingRect
    until(qtbot, lambda: view().height() < size.height() / 2)
    numbers = [label.textItem for label in drawing.path._labels if label.isVisible()]
    assert numbers
    until(qtbot, lambda: all(view().contains(one.mapRectToScene(one.boundingRect())) for one in numbers))
