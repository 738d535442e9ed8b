"""The window on every screen and in every look: nothing is cut, every text can be read, panels and views keep sizes."""

from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, QRect, QSize, Qt
from PySide6.QtGui import QColor, QMouseEvent, QTextDocument
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QLabel,
    QScrollArea,
    QScrollBar,
    QTabBar,
    QToolButton,
    QVBoxLayout,
    QWidget,
)
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import DARK, LIGHT, MARKS, UNITS, LengthUnit, Look
from sonarhw_gui.views.legend import Legend
from sonarhw_gui.widgets import ElidedLabel, LayoutBarrier, PlainLabel, arranged, plain_tip
from sonarhw_gui.window.start import open_application
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import key, pause, predicted, push, until

FRAME = QSize(16, 48)
SCREENS = {  # and the number of stacks of small views
    "1024x600": (QSize(1024, 600), 1, Look()),
    "1024x600, dark, text a third larger": (QSize(1024, 600), 1, Look(palette=DARK, scale=4 / 3)),
    "2560x1440 at 200 %": (QSize(1280, 720), 2, Look()),
    "1280x800": (QSize(1280, 800), 2, Look()),
    "1920x1080": (QSize(1920, 1080), 3, Look()),
}


@pytest.fixture(scope="module")
def shared(open_shared: OpenWith, recorded: Path) -> MainWindow:
    window = open_shared(source=read_log(recorded))
    until(lambda: predicted(window))
    return window


@pytest.fixture
def window(shared: MainWindow) -> MainWindow:
    """A window with a predicted log and the plan, without panels, as it was opened."""
    shared.session.notices.clear()
    shared.session.sound.close()
    shared.session.showing.set_look(Look())
    for dock in shared.docks:
        dock.close()
    shared.hint.end()
    shared.resize(1280, 800)
    key(shared, "1", "F")
    shared.session.showing.choose(27)
    shared.commands.reset_layout.trigger()
    pause(50)
    return shared


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
    scrolled = any(type(parent).__name__ == "VerticalScrollArea" for parent in _ancestors(part))
    across = QRect(part.mapTo(window, QPoint()), part.size())
    outside = across.left() < 0 or across.right() >= window.width() or across.bottom() >= window.height()
    return part.width() < needed or (outside and not scrolled)


def _ancestors(part: QWidget) -> list[QWidget]:
    parent = part.parentWidget()
    return [] if parent is None else [parent, *_ancestors(parent)]


@pytest.mark.parametrize("screen", SCREENS)
def test_nothing_is_cut_or_off_screen(window: MainWindow, screen: str, monkeypatch: pytest.MonkeyPatch) -> None:
    available, stacks, look = SCREENS[screen]
    window.session.showing.set_look(look)
    size, problems = on_screen(window, available, monkeypatch), []

    def check(what: str) -> None:
        pause(20)
        texts = cut(window)
        if window.size() != size or texts:
            pause(200)  # wrapped text may need a second layout
            texts = cut(window)
        problems.extend(f"{what}: {text}" for text in texts)
        if window.size() != size:
            problems.append(f"{what}: {window.size().toTuple()}")
            window.resize(size)

    pause(50)
    assert len({dock.geometry().top() for dock in window.views.docks if dock.in_front}) == stacks
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
    window.commands.views[0].trigger()
    for dock in window.docks:
        dock.close()
    drawing = window.views.plan.drawing  # numbers of bounces are within the plan
    numbers = [label.textItem for label in drawing.path.labels if label.isVisible()]
    assert numbers
    seen = drawing.plot.vb.sceneBoundingRect
    until(lambda: all(seen().contains(one.mapRectToScene(one.boundingRect())) for one in numbers))
    assert problems == []


def drag_line(views: QWidget, line: QPoint, by: QPoint) -> None:
    """Drag the line between two views with the left button held down."""
    left, none = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
    kinds = QEvent.Type.MouseButtonPress, QEvent.Type.MouseMove, QEvent.Type.MouseButtonRelease
    for kind, at, held in zip(kinds, (line, line + by, line + by), (left, left, none), strict=True):
        QApplication.processEvents()  # Qt moves the line between events
        button = none if kind is QEvent.Type.MouseMove else left
        places = QPointF(at), QPointF(views.mapToGlobal(at))
        QApplication.sendEvent(views, QMouseEvent(kind, *places, button, held, Qt.KeyboardModifier.NoModifier))


def test_each_large_view_keeps_its_share_of_the_width(window: MainWindow) -> None:
    views, (plan, beside, _) = window.views, window.commands.views

    def share() -> float:
        pause(20)
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
    for dock in window.docks[:2]:
        dock.close()
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


def test_the_legend_is_one_line_until_more_is_pressed(window: MainWindow) -> None:
    legend = window.legend

    def visible() -> list[QToolButton]:
        pause(50)
        return [button for button in legend.findChildren(QToolButton) if button.isVisible()]

    def lines() -> int:
        return len({button.y() for button in visible()})

    assert lines() == 1
    few = visible()
    push(legend.more)
    assert lines() > 1
    assert legend.more.text() == "less"
    every = visible()
    push(legend.more)
    assert (lines(), visible()) == (1, few)
    assert legend.more.text() == f"{len(every) - len(few)} more"


# panels


def test_a_key_brings_its_panel_to_the_front_or_closes_it_there(window: MainWindow) -> None:
    panels = {"Device": window.device, "Room": window.room, "Fit": window.fit_panel}

    def in_front() -> list[str]:
        return [name for name, panel in panels.items() if not panel.visibleRegion().isEmpty()]

    assert in_front() == []
    for pressed, seen in (
        ("F7", ["Device"]),
        ("F8", ["Room"]),
        ("F7", ["Device"]),  # it was open, behind the Room dock
    ):
        key(window, pressed)
        until(lambda seen=seen: in_front() == seen)
        assert [action.text() for action in window.dock_openers if action.isChecked()] == seen
    key(window, "F7")
    until(lambda: "Device" not in in_front())
    assert not window.docks[0].isVisible()
    window.commands.reset_layout.trigger()
    (bar,) = (bar for bar in window.findChildren(QTabBar) if bar.isVisible())
    below = [dock.windowTitle() for dock in window.views.docks[2:]]  # trace and ranges have stacks of their own
    until(lambda: [bar.tabText(k) for k in range(len(below))] == below)
    assert bar.count() == len(below) + len(window.docks)
    until(lambda: bar.tabRect(bar.count() - 1).right() <= bar.width())  # the tabs of all panels fit


def turn_wheel(over: QWidget) -> None:
    """Turn the wheel by one step towards the user, as an event of the window system."""
    window = over.window()
    QTest.wheelEvent(window.windowHandle(), over.mapTo(window, over.rect().center()).toPointF(), QPoint(0, -120))


def wheeled(panel: QWidget) -> list[QWidget]:
    """Return the widgets whose value the wheel could change."""
    kinds = (QAbstractSlider, QAbstractSpinBox, QComboBox)
    found = [one for one in panel.findChildren(QWidget) if isinstance(one, kinds)]
    return [one for one in found if not isinstance(one, QScrollBar) and one.window() is panel.window()]


def test_the_wheel_scrolls_a_panel_and_changes_only_the_focused_widget(window: MainWindow) -> None:
    window.resize(1000, 600)
    key(window, "F8")
    room = window.room
    area = next(area for area in window.findChildren(QScrollArea) if area.widget() is room)
    bar = area.verticalScrollBar()
    until(lambda: bar.maximum() > 0)
    before, parts = window.session.shown.scene, wheeled(room)
    assert len(parts) >= 15
    for part in parts:
        bar.setValue(0)
        area.ensureWidgetVisible(part)
        at = bar.value()
        turn_wheel(part)
        assert window.session.shown.scene is before, part
        assert bar.value() > at or at == bar.maximum(), part
    for part in (*wheeled(window.device), *wheeled(window.fit_panel)):
        assert part.focusPolicy() is Qt.FocusPolicy.StrongFocus, part
    humidity = room.air.humidity.slider
    area.ensureWidgetVisible(humidity)
    humidity.setFocus()
    turn_wheel(humidity)
    assert window.session.shown.scene is not before
    window.session.showing.undo()


# looks


def share_of(window: MainWindow, colour: str) -> float:
    """Return the share of the window that has this colour."""
    image, wanted, step = window.grab().toImage(), QColor(colour).rgb(), 7
    seen = [image.pixel(x, y) for x in range(0, image.width(), step) for y in range(0, image.height(), step)]
    return seen.count(wanted) / len(seen)


def test_keys_change_palette_unit_text_size_and_large_view(window: MainWindow) -> None:
    session, axis = window.session, window.views.plan.drawing.plot.getAxis("bottom")
    assert share_of(window, LIGHT.paper) > 0.3
    key(window, "Ctrl+D")
    assert session.shown.look.palette is DARK
    assert share_of(window, DARK.paper) > 0.3
    until(lambda: share_of(window, LIGHT.paper) < 0.05)  # the selection is white
    key(window, "Ctrl+D")
    assert share_of(window, LIGHT.paper) > 0.3
    for pressed, unit in (("Ctrl+2", LengthUnit.CM), ("Ctrl+3", LengthUnit.FT), ("Ctrl+1", LengthUnit.M)):
        key(window, pressed)
        assert (session.shown.look.unit, axis.labelText, axis.scale) == (unit, f"x ({unit.label})", unit.per_metre)
    usual = QApplication.font().pointSizeF()
    for pressed, times in ((["Ctrl++"] * 3, 1.1**3), (["Ctrl+-"], 1.1**2), (["Ctrl+0"], 1.0)):
        key(window, *pressed)
        assert QApplication.font().pointSizeF() == pytest.approx(usual * times)
    views = {"2": window.views.side_by_side, "3": window.views.bscan, "1": window.views.plan.drawing}
    for pressed, view in views.items():
        key(window, pressed)
        assert view.isVisible()


def faint_labels(window: MainWindow) -> set[str]:
    """Return the texts of visible labels in which no pixel contrasts with the most frequent colour."""
    QApplication.processEvents()  # style sheets are applied between events
    labels = [one for one in window.findChildren(QLabel) if one.text() and not one.visibleRegion().isEmpty()]
    assert len(labels) > 5
    picture, found = window.grab().toImage(), set()
    for label in labels:
        seen = label.visibleRegion().boundingRect()
        part = picture.copy(QRect(label.mapTo(window, seen.topLeft()), seen.size()))
        pixels = Counter(part.pixel(x, y) for x in range(part.width()) for y in range(part.height()))
        ground, *others = (QColor(pixel).name() for pixel, _ in pixels.most_common())
        if max((contrast(colour, ground) for colour in others), default=1.0) < 2.0:
            found.add(label.text())
    return found


def test_every_text_of_a_visible_window_can_be_read_in_the_look_chosen_last(window: MainWindow) -> None:
    """The look changes while each view and each panel is visible."""
    panels = {panel.text(): panel for panel in window.dock_openers}
    unreadable: set[str] = set()
    for view, name in zip(window.commands.views, ("Room", "Device", "Find the room"), strict=True):
        view.trigger()
        panels[name].trigger()
        for _ in range(2):
            key(window, "Ctrl+D")
            unreadable |= faint_labels(window)
        panels[name].trigger()
    assert unreadable == set()


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of WCAG 2."""
    lighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour: str) -> float:
    def linear(share: float) -> float:
        return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4

    red, green, blue, _ = QColor(colour).getRgbF()
    return 0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)


@pytest.mark.parametrize("palette", [LIGHT, DARK])
def test_every_colour_of_a_reading_and_symbol_of_the_legend_contrasts_with_the_background(palette: object) -> None:
    for kind in MARKS:
        assert contrast(palette.of(kind), palette.paper) > 2.0
    for colour in (palette.predicted, palette.wall, palette.warning_ink):
        assert contrast(colour, palette.paper) > 3.0
    assert contrast(palette.ink, palette.paper) > 7.0
    assert contrast(palette.warning_ink, palette.warning_paper) > 4.5
    open_application()
    legend = Legend()
    legend.set_look(Look(palette))
    for entry in legend.entries.values():
        image = entry.icon().pixmap(entry.iconSize()).toImage()
        pixels = (image.pixelColor(x, y) for x in range(image.width()) for y in range(image.height()))
        assert max(contrast(one.name(), palette.window) for one in pixels if one.alpha() == 255) > 2.0


def test_lengths_are_written_in_their_unit_and_the_text_size_is_limited() -> None:
    assert [unit.text(0.827) for unit in UNITS] == ["0.827 m", "82.7 cm", "2.71 ft"]
    assert 0.5 < Look().scaled(0.0).scale < 1.0
    assert 2.0 < Look().scaled(1000.0).scale < 4.0


HTML = "<h1>big</h1><img src='file:///etc/hostname'>&amp;"


def test_names_from_files_and_devices_are_shown_as_they_are_even_if_they_look_like_html(qapp: object) -> None:
    expected = QLabel(HTML.replace("<", "(").replace(">", ")")).sizeHint().height()
    for kind in (PlainLabel, ElidedLabel):
        label = kind()
        label.setText(HTML)
        assert QLabel.sizeHint(label).height() == expected  # a heading would be higher
    for text in (HTML, "a < b > c", "plain", "<b>", "two\nlines"):
        label.setToolTip(text)
        shown = QTextDocument()
        (shown.setHtml if label.toolTip().startswith("<p>") else shown.setPlainText)(label.toolTip())
        assert shown.toPlainText() == text
        assert label.toolTip() == plain_tip(text)


def test_a_label_that_grows_while_it_is_hidden_has_its_height_when_it_is_shown(qtbot: QtBot) -> None:
    page, label = QWidget(), PlainLabel("text")
    qtbot.addWidget(page)
    layout = arranged(QVBoxLayout(page), LayoutBarrier(label), LayoutBarrier(PlainLabel("below")))
    page.resize(200, 200)
    page.show()
    page.hide()
    label.setFixedHeight(90)  # such as a larger font
    page.show()
    until(lambda: layout.sizeHint().height() > 90 and label.visibleRegion().boundingRect().height() == 90)
