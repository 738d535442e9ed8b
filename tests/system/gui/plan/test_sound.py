"""Sound in the plan and the trace: played, moved by the slider, and saved as a film."""

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.views.legend import SOUND
from sonarhw_gui.window.window import MainWindow

from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import dialog_of, predicted, until

SENSOR = 0.774, 0.085


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith) -> MainWindow:
    """Open a window that plays the sound at 270°, where the near wall is blanked."""
    window = open_with()
    until(qtbot, lambda: predicted(window))
    window.session.showing.ask(math.radians(270))
    until(qtbot, lambda: window.session.shown.answer is not None)
    qtbot.keyClick(window, Qt.Key.Key_S)
    until(qtbot, lambda: window.session.shown.sound is not None)
    return window


def seek(qtbot: QtBot, window: MainWindow, time: float) -> None:
    window.sound_bar.slider.setValue(round(time * 1e6))
    until(qtbot, lambda: window.views.trace.marks.sound.value() == pytest.approx(time, abs=1e-6))


def test_it_plays_by_itself_loops_and_pauses(qtbot: QtBot, window: MainWindow) -> None:
    bar, sound = window.sound_bar, window.session.sound
    assert bar.isVisible()
    legend = window.legend.explained
    until(qtbot, lambda: all(legend[name].isVisible() and legend[name].toolTip() for name in SOUND))
    first = window.session.shown.sound.time
    until(qtbot, lambda: window.session.shown.sound.time > first)
    bar.play.click()
    assert not sound.state.playing
    assert bar.play.text() == "Play"
    seek(qtbot, window, sound.state.ping.duration)
    sound.toggle()  # at the end: again
    assert sound.state.time == 0
    for _ in range(2):
        sound.advance(10.0)
    assert sound.state.time < sound.state.ping.duration  # looped
    bar.loop.click()
    for _ in range(3):
        sound.advance(10.0)
    assert sound.state.time == pytest.approx(sound.state.ping.duration)
    assert not sound.state.playing


def test_plan_and_trace_show_the_same_moment(qtbot: QtBot, window: MainWindow) -> None:
    layer, ping = window.views.plan.drawing.sound, window.session.sound.state.ping
    seek(qtbot, window, 1.35e-3)
    # 0.463 m along the path: down to the wall, and 0.293 m beyond the sensor
    travelled = 1.35e-3 * ping.speed
    head = np.nanmax(layer._winner.getData()[1])
    assert head == pytest.approx(travelled - 0.085, abs=1e-3)
    assert window.sound_bar.caption.text() == "1.35 ms: the board listens"
    assert not window.views.trace.marks.crossing.isVisible()
    seek(qtbot, window, ping.duration)
    assert window.views.trace.marks.crossing.isVisible()
    assert layer.counted.getData()[1][0] == pytest.approx(SENSOR[1] - float(ping.prediction.distances[0]), abs=1e-3)
    assert "the board would report 0.8" in window.sound_bar.caption.text()
    left, right = window.views.plan.drawing.plot.viewRange()[1]
    assert left < SENSOR[1] - 0.82 < right  # the false wall is visible


def test_keys_move_the_slider_and_close_the_bar(qtbot: QtBot, window: MainWindow) -> None:
    bar = window.sound_bar
    bar.play.click()
    seek(qtbot, window, 1e-3)
    bar.slider.setFocus()
    qtbot.keyClick(bar.slider, Qt.Key.Key_PageUp)
    assert window.session.sound.state.time == pytest.approx(1.2e-3)
    qtbot.keyClick(window, Qt.Key.Key_S)
    assert not bar.isVisible()
    until(qtbot, lambda: not window.views.trace.marks.sound.isVisible())
    assert window.session.shown.sound is None
    assert not any(window.legend.explained[name].isVisible() for name in SOUND)


def test_all_echoes_and_another_heading(qtbot: QtBot, window: MainWindow) -> None:
    before = window.session.sound.state.ping
    window.sound_bar.every.click()
    assert len(window.session.sound.state.ping.ways) > len(before.ways)
    qtbot.keyClick(window, Qt.Key.Key_BracketLeft)
    until(qtbot, lambda: math.degrees(window.session.sound.state.ping.heading) == pytest.approx(271))
    assert window.session.sound.state.ping.every


def test_the_sound_is_saved_as_a_film(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    window.sound_bar.film.click()
    dialog_of(window).fileSelected.emit(str(tmp_path / "sound.gif"))
    dialog_of(window).close()
    until(qtbot, lambda: (tmp_path / "sound.gif").exists() and not window.session.jobs.busy("save files"))
    with Image.open(tmp_path / "sound.gif") as film:
        assert film.n_frames > 50
        assert film.size[0] > 700
