"""The sentence: wrapped to two lines; a longer one ends in … and is complete in the tooltip."""

from dataclasses import replace

import pytest
from PySide6.QtGui import QFontMetricsF, QTextLayout
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.views.table import Sentence, shortened_to_lines

from tests.system.gui.driving import PATIENCE

LONG = "a later echo, " + ", ".join(["bottom", "top", "left", "right"] * 20) + "; the near wall lies within blanking"


@pytest.fixture
def sentence(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, scene: Scene) -> Sentence:
    monkeypatch.setattr(Shown, "sentence", LONG)
    sentence = Sentence()
    qtbot.addWidget(sentence)
    sentence.resize(500, 60)
    sentence.show_state(Shown(scene))
    return sentence


def lines_of(sentence: Sentence) -> int:
    layout = QTextLayout(sentence.text(), sentence.font())
    layout.beginLayout()
    count = 0
    while (line := layout.createLine()).isValid():
        line.setLineWidth(sentence.width() - 24)
        count += 1
    layout.endLayout()
    return count


def test_a_sentence_that_does_not_fit_ends_in_an_ellipsis_and_is_complete_in_the_tooltip(sentence: Sentence) -> None:
    assert sentence.text().endswith("…")
    assert LONG.startswith(sentence.text()[:-1])
    assert sentence.toolTip() == LONG
    assert lines_of(sentence) == 2
    assert 2 * QFontMetricsF(sentence.font()).lineSpacing() <= sentence.height()


def test_a_wider_window_shows_more_of_the_sentence(qtbot: QtBot, sentence: Sentence) -> None:
    before = len(sentence.text())
    with qtbot.waitExposed(sentence, timeout=PATIENCE):
        sentence.show()
    sentence.resize(900, sentence.height())
    assert before < len(sentence.text()) < len(LONG)
    sentence.resize(4000, sentence.height())
    assert (sentence.text(), sentence.toolTip()) == (LONG, "")


def test_larger_text_increases_the_height_and_is_not_cut_off(sentence: Sentence, scene: Scene) -> None:
    before = sentence.height(), len(sentence.text())
    sentence.show_state(Shown(scene, look=replace(Look(), scale=2.0)))
    assert sentence.height() > before[0]
    assert len(sentence.text()) < before[1]
    assert lines_of(sentence) == 2


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.3, 1.6, 2.0])
def test_two_lines_fit_with_their_descenders(sentence: Sentence, scene: Scene, scale: float) -> None:
    sentence.show_state(Shown(scene, look=replace(Look(), scale=scale)))
    assert sentence.heightForWidth(sentence.width()) <= sentence.height()


def test_a_short_sentence_is_not_changed(sentence: Sentence) -> None:
    assert shortened_to_lines("0.827 m at 270.0°", sentence.font(), 500, 2) == "0.827 m at 270.0°"
