"""Dark and light, units, text size and the three large views, by key; all views follow."""

import re
from collections import Counter
from pathlib import Path

import pytest
from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import DARK, LIGHT, MARKS, UNITS, LengthUnit, Look
from sonarhw_gui.model.rows import Column
from sonarhw_gui.views.legend import Legend
from sonarhw_gui.views.marks import reading_tip
from sonarhw_gui.window.start import open_application
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

CONTROL = Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    return window


def share_of(window: MainWindow, colour: str) -> float:
    """Return the share of the window that has this colour."""
    image = window.grab().toImage()
    wanted, step = QColor(colour).rgb(), 7
    seen = [image.pixel(x, y) for x in range(0, image.width(), step) for y in range(0, image.height(), step)]
    return seen.count(wanted) / len(seen)


def test_ctrl_d_makes_all_views_dark_and_light_again(qtbot: QtBot, window: MainWindow) -> None:
    assert share_of(window, LIGHT.paper) > 0.3
    qtbot.keyClick(window, Qt.Key.Key_D, CONTROL)
    assert window.session.shown.look.palette is DARK
    assert share_of(window, DARK.paper) > 0.3
    assert share_of(window, LIGHT.paper) < 0.05  # the selection is white
    qtbot.keyClick(window, Qt.Key.Key_D, CONTROL)
    assert share_of(window, LIGHT.paper) > 0.3


def test_every_symbol_of_the_legend_is_visible_on_dark() -> None:
    open_application()
    legend = Legend()
    legend.set_look(Look(DARK))
    for entry in legend.entries.values():
        image = entry.icon().pixmap(entry.iconSize()).toImage()
        pixels = [image.pixelColor(x, y) for x in range(image.width()) for y in range(image.height())]
        assert max(contrast(one.name(), DARK.window) for one in pixels if one.alpha() == 255) > 3


def test_ctrl_2_writes_the_axes_in_centimetres_and_ctrl_3_in_feet(qtbot: QtBot, window: MainWindow) -> None:
    axis = window.views.plan.drawing.plot.getAxis("bottom")
    for key, unit in ((Qt.Key.Key_2, LengthUnit.CM), (Qt.Key.Key_3, LengthUnit.FT), (Qt.Key.Key_1, LengthUnit.M)):
        qtbot.keyClick(window, key, CONTROL)
        assert axis.labelText == f"x ({unit.label})"
        assert axis.scale == unit.per_metre


def test_sentence_and_tooltip_follow_the_unit(qtbot: QtBot, window: MainWindow) -> None:
    window.session.showing.choose(27)
    heard = window.session.shown.chosen_reading.range
    for key, unit in ((Qt.Key.Key_2, LengthUnit.CM), (Qt.Key.Key_3, LengthUnit.FT), (Qt.Key.Key_1, LengthUnit.M)):
        qtbot.keyClick(window, key, CONTROL)
        shown = window.session.shown
        assert window.sentence.text().startswith(f"{unit.text(heard)} at 270.0°: ")
        assert f"fake {unit.text(heard)}\n" in reading_tip(shown, 27)
        assert window.views.table.model.index(27, Column.SENTENCE).data().startswith(unit.text(heard))
        others = [other for other in UNITS if other is not unit]
        said = [shown.sentence_of(k) for k in range(len(shown.readings))]
        assert not [one for one in said for other in others if re.search(rf"\d {other.label}\b", one)]


def test_ctrl_plus_enlarges_text_and_ctrl_0_resets_it(qtbot: QtBot, window: MainWindow) -> None:
    usual = QApplication.font().pointSizeF()
    for _ in range(3):
        qtbot.keyClick(window, Qt.Key.Key_Plus, CONTROL)
    assert QApplication.font().pointSizeF() == pytest.approx(usual * 1.1**3)
    qtbot.keyClick(window, Qt.Key.Key_Minus, CONTROL)
    assert QApplication.font().pointSizeF() == pytest.approx(usual * 1.1**2)
    qtbot.keyClick(window, Qt.Key.Key_0, CONTROL)
    assert QApplication.font().pointSizeF() == pytest.approx(usual)


def test_1_2_and_3_show_the_large_views(qtbot: QtBot, window: MainWindow) -> None:
    for key, view in (
        (Qt.Key.Key_2, window.views.side_by_side),
        (Qt.Key.Key_3, window.views.bscan),
        (Qt.Key.Key_1, window.views.plan.drawing),
    ):
        qtbot.keyClick(window, key)
        assert view.isVisible()


@pytest.mark.parametrize("palette", [LIGHT, DARK])
def test_every_colour_of_a_reading_contrasts_with_the_background(palette: object) -> None:
    for kind in MARKS:
        assert contrast(palette.of(kind), palette.paper) > 2.0
    for colour in (palette.predicted, palette.wall, palette.warning_ink):
        assert contrast(colour, palette.paper) > 3.0
    assert contrast(palette.ink, palette.paper) > 7.0
    assert contrast(palette.warning_ink, palette.warning_paper) > 4.5


def test_every_text_of_a_visible_window_can_be_read_in_the_look_chosen_last(qtbot: QtBot, window: MainWindow) -> None:
    """The look changes while each view and each panel is visible."""
    views, (room, device, find) = (
        window.commands.views,
        [
            next(one for one in window.dock_openers if one.text() == name)
            for name in ("Room", "Device", "Find the room")
        ],
    )
    unreadable: set[str] = set()
    for view, panel in zip(views, (room, device, find), strict=True):
        view.trigger()
        panel.trigger()
        for _ in range(2):
            qtbot.keyClick(window, Qt.Key.Key_D, CONTROL)
            unreadable |= faint_labels(window)
        panel.trigger()
    assert unreadable == set()


def faint_labels(window: MainWindow) -> set[str]:
    """Return the texts of visible labels in which no pixel contrasts with the most frequent colour."""
    labels = [one for one in window.findChildren(QLabel) if one.text() and not one.visibleRegion().isEmpty()]
    assert len(labels) > 5
    QApplication.processEvents()  # style sheets are applied between events
    picture, found = window.grab().toImage(), set()
    for label in labels:
        seen = label.visibleRegion().boundingRect()
        part = picture.copy(QRect(label.mapTo(window, seen.topLeft()), seen.size()))
        pixels = Counter(part.pixel(x, y) for x in range(part.width()) for y in range(part.height()))
        ground, *others = (QColor(pixel).name() for pixel, _ in pixels.most_common())
        if max((contrast(colour, ground) for colour in others), default=1.0) < 2.0:
            found.add(label.text())
    return found


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of WCAG 2."""
    lighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour: str) -> float:
    def linear(share: float) -> float:
        return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4

    red, green, blue, _ = QColor(colour).getRgbF()
    return 0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)


def test_a_length_is_written_in_its_unit() -> None:
    assert [unit.text(0.827) for unit in UNITS] == ["0.827 m", "82.7 cm", "2.71 ft"]


def test_the_text_size_is_limited() -> None:
    assert 0.5 < Look().scaled(0.0).scale < 1.0
    assert 2.0 < Look().scaled(1000.0).scale < 4.0
