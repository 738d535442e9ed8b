"""Names from files and devices are shown as they are, even if they look like HTML."""

import pytest
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot
from sonarhw_gui.widgets import ElidedLabel, PlainLabel, plain_tip

HTML = "<h1>big</h1><img src='file:///etc/hostname'>&amp;"


@pytest.mark.parametrize("kind", [PlainLabel, ElidedLabel])
def test_a_label_does_not_interpret_html(qtbot: QtBot, kind: type[PlainLabel]) -> None:
    label = kind()
    qtbot.addWidget(label)
    label.setText(HTML)
    expected = QLabel(HTML.replace("<", "(").replace(">", ")"))
    assert QLabel.sizeHint(label).height() == expected.sizeHint().height()  # a heading would be higher


@pytest.mark.parametrize("text", [HTML, "a < b > c", "plain", "<b>", "two\nlines"])
def test_a_tooltip_shows_exactly_its_text(qtbot: QtBot, text: str) -> None:
    label = PlainLabel()
    qtbot.addWidget(label)
    label.setToolTip(text)
    shown = QTextDocument()
    (shown.setHtml if label.toolTip().startswith("<p>") else shown.setPlainText)(label.toolTip())
    assert shown.toPlainText() == text
    assert label.toolTip() == plain_tip(text)
