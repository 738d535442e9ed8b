"""A dense scan: every reading is compared, and classes are shown and hidden in all views."""

import threading
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QImage
from PySide6.QtWidgets import QGraphicsView
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind, compare_readings
from sonarhw_gui.jobs import forecast
from sonarhw_gui.jobs.forecast import STRETCH, Comparer, PathsFound, Stretch, find_paths
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.look import LIGHT, Unclassed, ViewLayer
from sonarhw_gui.model.rows import Column
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from sonarhw.readings import Reading
from tests.system.gui.conftest import OpenWith
from tests.system.gui.dense_scan import SHORT, dense_log, dense_readings
from tests.system.gui.driving import pixel_at, position_of, predicted, until

COUNT = 3600
Stretches = tuple[tuple[int, tuple[Reading, ...]], ...]
_BLENDED = 30  # of 255, of a colour channel: lines of the grid are drawn over the marks


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Let only comparisons with the last stretch through until the event is set."""
    gate = threading.Event()
    compare = forecast.compare_stretches

    def compare_later(found: PathsFound, stretches: Stretches) -> tuple[Stretch, ...]:
        if all(first + len(readings) < COUNT for first, readings in stretches):
            gate.wait()
        return compare(found, stretches)

    monkeypatch.setattr(forecast, "compare_stretches", compare_later)
    yield gate
    gate.set()


def test_the_stretch_of_the_selected_reading_is_compared_first_and_the_rest_is_hollow_and_grey(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, tmp_path: Path, held: threading.Event
) -> None:
    window = open_with(source=dense_log(tmp_path / "dense.mcap", scene, COUNT))
    until(qtbot, lambda: window.session.shown.row(COUNT - 1) is not None)
    shown = window.session.shown
    assert shown.row(0) is None
    assert set(shown.classes) >= {Unclassed.WAITING, Kind.MATCH}
    waiting = len(shown.classes[Unclassed.WAITING].readings)
    assert 0 < waiting <= COUNT - STRETCH
    until(qtbot, lambda: "readings to compare" in window.status_bar.activity.text())
    assert window.views.table.classes[Unclassed.WAITING].text().endswith(" not compared")
    assert LIGHT.of(Unclassed.WAITING) not in {LIGHT.of(kind) for kind in Kind}
    held.set()
    until(qtbot, lambda: predicted(window))
    assert Unclassed.WAITING not in window.session.shown.classes
    assert "to compare" not in window.status_bar.activity.text()


def test_every_reading_gets_the_class_that_the_command_gives_it(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, tmp_path: Path
) -> None:
    log = dense_log(tmp_path / "dense.mcap", scene, COUNT)
    window = open_with(source=log)
    until(qtbot, lambda: predicted(window))
    shown = window.session.shown
    expected = compare_readings(log.readings, scene.room, scene.pose, scene.board)
    assert [shown.row(k).kind for k in range(COUNT)] == [row.kind for row in expected.rows]
    assert expected.rows[SHORT.start].kind is Kind.SHORT
    for reading in (0, COUNT // 2, COUNT - 1):
        assert "being compared" not in shown.sentence_of(reading)


def test_a_reading_selected_meanwhile_is_compared_next(
    qtbot: QtBot,
    open_with: OpenWith,
    scene: Scene,
    tmp_path: Path,
    held: threading.Event,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    window = open_with(source=dense_log(tmp_path / "dense.mcap", scene, COUNT))
    until(qtbot, lambda: window.session.shown.row(COUNT - 1) is not None)
    window.session.showing.choose(5)
    requests = []
    compare = forecast.compare_stretches
    monkeypatch.setattr(
        forecast,
        "compare_stretches",
        lambda found, stretches: (requests.append(stretches[0][0]), compare(found, stretches))[1],
    )
    held.set()
    until(qtbot, lambda: predicted(window))
    assert requests[0] == 0  # the request that was already waiting has the next stretch at the end of the scan


def test_an_hour_of_comparison_takes_little_memory(scene: Scene) -> None:
    """36 000 readings take 36 times as much as these."""
    found = find_paths(1, scene, scene.options)
    readings = dense_readings(scene, 1440)
    forecast.compare_stretches(found, ((0, tuple(readings[:10])),))  # loads and compiles
    tracemalloc.start()
    try:
        kept = tuple((k, tuple(readings[k : k + STRETCH])) for k in range(0, 1440, STRETCH))
        compared = forecast.compare_stretches(found, kept)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(compared) == 4
    assert grown / 1440 < 1500  # bytes a reading: 54 MB an hour at ten readings a second


@pytest.fixture
def jobs(qtbot: QtBot) -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


def test_only_a_stretch_that_grows_is_compared_again(qtbot: QtBot, jobs: Jobs, scene: Scene) -> None:
    comparer = Comparer(jobs, lambda: None)
    readings = dense_readings(scene, 2 * STRETCH + 20)
    comparer.follow(readings[:-10])
    comparer.use(find_paths(1, scene, scene.options))
    until(qtbot, lambda: comparer.uncompared == 0)
    before = comparer.compared.stretches
    comparer.follow(readings)
    assert comparer.uncompared == 10
    until(qtbot, lambda: comparer.uncompared == 0)
    after = comparer.compared.stretches
    assert [one is other for one, other in zip(before, after, strict=True)] == [True, True, False]
    assert comparer.compared.end == len(readings)
    assert comparer.compared.row(len(readings)) is None


def test_a_reading_of_a_running_scan_is_compared_with_few_others(
    qtbot: QtBot, jobs: Jobs, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = []
    compare = forecast.compare_stretches
    monkeypatch.setattr(
        forecast,
        "compare_stretches",
        lambda found, stretches: (together.append(sum(len(some) for _, some in stretches)), compare(found, stretches))[
            1
        ],
    )
    comparer = Comparer(jobs, lambda: None)
    readings = dense_readings(scene, STRETCH + 1)
    comparer.use(find_paths(1, scene, scene.options))
    for count in (*range(10, STRETCH, 10), STRETCH, STRETCH + 1):
        comparer.follow(readings[:count])
        until(qtbot, lambda: comparer.uncompared == 0)
    assert together[-2:] == [STRETCH, 1]
    assert max(together[:-2]) <= 40
    assert [(stretch.first, stretch.end) for stretch in comparer.compared.stretches] == [
        (0, STRETCH),
        (STRETCH, STRETCH + 1),
    ]


def test_a_click_on_the_legend_hides_a_class_in_plan_ranges_and_table(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, tmp_path: Path
) -> None:
    window = open_with(source=dense_log(tmp_path / "dense.mcap", scene, COUNT))
    until(qtbot, lambda: predicted(window))
    views = window.views
    entry, pill = window.legend.entries[Kind.SHORT], views.table.classes[Kind.SHORT]
    drawn = [views.plan.drawing._marks, *views.ranges._marks]
    assert all(Kind.SHORT in marks.placed for marks in drawn)
    qtbot.mouseClick(entry, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: "short" not in _classes_listed(window))
    assert not any(Kind.SHORT in marks.placed for marks in drawn)
    assert entry.accessibleName().endswith("hidden")
    qtbot.mouseClick(pill, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: "short" in _classes_listed(window))
    assert all(Kind.SHORT in marks.placed for marks in drawn)
    assert entry.accessibleName().endswith("shown")


def test_every_entry_of_the_legend_switches_its_layer_with_a_key(
    qtbot: QtBot, open_with: OpenWith, recorded: Path
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window) and window.session.shown.trace is not None)
    views = window.views
    items_of = {
        ViewLayer.TRACE: [views.trace._measured],
        ViewLayer.PREDICTED: [
            views.trace._predicted,
            views.plan.drawing._outline,
            views.ranges._outline,
        ],
        ViewLayer.THRESHOLD: [views.trace.marks._threshold],
        ViewLayer.BEAM: [views.plan.drawing.sensor._beam],
        ViewLayer.BLANKING: [views.trace.marks._blanking],
        ViewLayer.RAYS: [],
    }
    assert set(items_of) == set(ViewLayer)
    for layer, items in items_of.items():
        assert all(item.isVisible() for item in items), layer
        entry = window.legend.entries[layer]
        entry.setFocus()
        qtbot.keyClick(entry, Qt.Key.Key_Space)
        until(qtbot, lambda layer=layer: layer in window.session.shown.hidden)
        assert not any(item.isVisible() for item in items), layer
    rays = window.views.plan.drawing.path._rays.getData()[0]
    assert rays is None or not len(rays)
    qtbot.keyClick(entry, Qt.Key.Key_Space)
    until(qtbot, lambda: layer not in window.session.shown.hidden)
    assert all(item.isVisible() for item in items)


def test_marks_of_a_dense_scan_keep_the_colour_of_their_class(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, tmp_path: Path
) -> None:
    """Outlines in the colour of the paper would cover the fill of the neighbours."""
    window = open_with(source=dense_log(tmp_path / "dense.mcap", scene, COUNT))
    window.session.showing.set_look(replace(window.session.shown.look, palette=LIGHT))
    window.session.showing.switch(ViewLayer.PREDICTED, False)
    until(qtbot, lambda: predicted(window))
    drawing = window.views.plan.drawing
    middle = (SHORT.start + SHORT.stop) // 2
    drawing.plot.vb.autoRange()
    qtbot.wait(50)
    image = drawing.viewport().grab().toImage()
    for reading, kind in ((middle, Kind.SHORT), (SHORT.stop + 200, Kind.MATCH)):
        at = pixel_at(drawing, drawing.plot.vb, position_of(drawing._marks, reading))
        drawn, own = _colour_at(image, drawing, at), QColor(LIGHT.of(kind))
        assert max(abs(one - other) for one, other in zip(drawn.getRgb(), own.getRgb(), strict=True)) < _BLENDED


def _colour_at(image: QImage, view: QGraphicsView, at: QPoint) -> QColor:
    ratio = view.devicePixelRatioF()
    return image.pixelColor(round(at.x() * ratio), round(at.y() * ratio))


def _classes_listed(window: MainWindow) -> set[str]:
    model = window.views.table.model
    return {model.data(model.index(row, Column.CLASS)) for row in range(0, model.rowCount(), 10)}
