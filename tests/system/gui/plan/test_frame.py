"""The frame of the plan: room and sensor stay in view, and arrows at the edge point to readings outside."""

import gc
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QPoint, QPointF, QRectF, Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot
from sonarhw_compare.headings import heading_text
from sonarhw_gui.model.look import ViewLayer
from sonarhw_gui.model.scene import Scene, decibels_text, wall_lines
from sonarhw_gui.model.shown import bounces_text, chosen_path
from sonarhw_gui.views.base import png_pixels, svg_text
from sonarhw_gui.views.legend import Legend
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.views.plan_layers import edge_arrows
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import ORDER, OpenFake, OpenWith
from tests.system.gui.driving import ended, position_of, predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    return window


def plan_of(window: MainWindow) -> PlanDrawing:
    return window.views.plan.drawing


def outside(window: MainWindow) -> set[int]:
    """Return the readings that the plan draws outside its visible part."""
    plan = plan_of(window)
    seen = plan.plot.vb.viewRect()
    drawn = [(k, position_of(plan._marks, k)) for points, _ in plan._marks.placed.values() for k in points.readings]
    return {k for k, at in drawn if not seen.contains(QPointF(*at))}


def test_the_frame_holds_the_room_whatever_is_selected(window: MainWindow) -> None:
    frame = plan_of(window).plot.vb.viewRect()
    walls = wall_lines(window.session.shown.scene.room)
    assert all(frame.contains(QPointF(x, y)) for x, y in walls)
    assert max(np.ptp(walls, axis=0) / (frame.width(), frame.height())) > 0.7
    assert outside(window)
    for chosen in sorted(outside(window)):
        window.session.showing.choose(chosen)
        assert plan_of(window).plot.vb.viewRect() == frame


def test_every_reading_outside_has_an_arrow_with_its_distance(window: MainWindow) -> None:
    plan = plan_of(window)
    arrows = plan.arrows.arrows
    assert sum(arrow.count for arrow in arrows) == len(outside(window))
    x, y = window.session.shown.scene.pose.position
    for arrow in arrows:
        assert plan.arrows.boundingRect().contains(QPointF(*arrow.middle))
        assert arrow.distance == pytest.approx(math.dist((x, y), position_of(plan._marks, arrow.reading)))
        assert f"{arrow.distance:.1f} m" in plan.arrows.text(arrow)


def test_the_arrow_of_the_selected_reading_lies_on_the_beam(window: MainWindow) -> None:
    plan = plan_of(window)
    for chosen in sorted(outside(window)):
        window.session.showing.choose(chosen)
        arrow = next(arrow for arrow in plan.arrows.arrows if arrow.reading == chosen)
        at = plan.plot.vb.mapToView(QPointF(*arrow.middle))
        x, y = window.session.shown.scene.pose.position
        off = math.atan2(at.y() - y, at.x() - x) - window.session.shown.heading(chosen)
        assert math.remainder(off, math.tau) == pytest.approx(0, abs=math.radians(1))
        assert plan.arrows.text(arrow).startswith(heading_text(window.session.shown.heading(chosen)))


def test_without_a_room_the_plan_shows_all_readings_as_they_come(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, scene: Scene
) -> None:
    window = open_with(scene=Scene(None, None, scene.board), source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window) and len(window.session.shown.readings) == ORDER.readings)
    until(qtbot, lambda: not outside(window))
    entries = window.legend.entries
    assert not any(entries[layer].isVisible() for layer in (ViewLayer.PREDICTED, ViewLayer.RAYS))
    assert not window.legend.explained["wall"].isVisible()


def test_a_click_on_an_arrow_selects_its_reading(qtbot: QtBot, window: MainWindow) -> None:
    plan = plan_of(window)
    window.session.showing.choose(0)
    arrow = next(arrow for arrow in plan.arrows.arrows if arrow.reading != 0)
    at = plan.mapFromScene(plan.arrows.mapToScene(QPointF(*arrow.middle)))
    qtbot.mouseMove(plan.viewport(), at)
    qtbot.mouseClick(plan.viewport(), Qt.MouseButton.LeftButton, pos=at)
    until(qtbot, lambda: window.session.shown.chosen == arrow.reading)


def test_shift_f_shows_every_reading_and_home_the_room(qtbot: QtBot, window: MainWindow) -> None:
    frame = plan_of(window).plot.vb.viewRect()
    qtbot.keyClick(window, Qt.Key.Key_F, Qt.KeyboardModifier.ShiftModifier)
    until(qtbot, lambda: not outside(window))
    assert not plan_of(window).arrows.arrows
    qtbot.keyClick(window, Qt.Key.Key_Home)
    until(qtbot, lambda: bool(outside(window)))
    assert plan_of(window).plot.vb.viewRect() == frame


def test_readings_close_together_share_an_arrow_and_the_selected_one_comes_first(window: MainWindow) -> None:
    plan = plan_of(window)
    placed = plan._marks.placed
    seen = QRectF(-0.01, -0.01, 0.02, 0.02)  # nearly all readings are outside
    chosen = max(outside(window))
    arrows = edge_arrows(placed, seen, (200.0, 200.0), (0.0, 0.0), chosen)
    assert sum(arrow.count for arrow in arrows) > len(arrows)
    assert arrows[0].reading == chosen
    for arrow in arrows:
        assert all(math.dist(arrow.middle, other.middle) >= 50 for other in arrows if other is not arrow)


def test_bounces_have_a_number_in_the_plan_and_wall_and_loss_beside_the_sentence(window: MainWindow) -> None:
    shown, losses = window.session.shown, []
    for chosen in range(len(shown.readings)):
        window.session.showing.choose(chosen)
        path = chosen_path(window.session.shown)
        labels = [label for label in plan_of(window).path._labels if label.isVisible()]
        written = sorted(int(n) for label in labels for n in label.toPlainText().split(", "))
        assert written == list(range(1, 1 + (len(path.names) if path else 0)))
        window._show_sentence()
        assert window.bounces.text() == bounces_text(window.session.shown)
        if path is not None:
            losses += [loss for loss in path.losses if loss is not None]
            assert window.bounces.text().startswith(f"1 {path.names[0]}")
    assert losses
    assert any(decibels_text(loss) in "−0.4 dB" for loss in losses)


def test_an_exported_picture_lists_the_bounces(window: MainWindow) -> None:
    window.session.showing.choose(27)
    text = svg_text(plan_of(window), "title", window.session.shown)
    assert bounces_text(window.session.shown)
    for word in bounces_text(window.session.shown).split(" · ")[0].split():
        assert word in text


def legends() -> list[Legend]:
    return [widget for widget in QApplication.allWidgets() if isinstance(widget, Legend)]


def test_pictures_leave_no_legend_behind(window: MainWindow) -> None:
    before = legends()  # windows of other tests may not be deleted yet
    assert window.legend in before
    for picture in (svg_text, png_pixels):
        picture(plan_of(window), "title", window.session.shown)
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    assert set(legends()) <= set(before)


def test_arrows_stay_inside_a_resized_plan(qtbot: QtBot, window: MainWindow) -> None:
    window.resize(1024, 600)
    qtbot.wait(50)
    area = plan_of(window).arrows.boundingRect()
    assert plan_of(window).arrows.arrows
    assert all(area.contains(QPoint(*map(round, arrow.middle)).toPointF()) for arrow in plan_of(window).arrows.arrows)


def test_texts_of_arrows_cover_neither_the_room_nor_each_other(qtbot: QtBot, window: MainWindow) -> None:
    plan = plan_of(window)
    window.session.showing.choose(None)
    walls = wall_lines(window.session.shown.scene.room)
    for size in ((1024, 552), (1280, 752)):
        window.resize(*size)
        qtbot.wait(50)
        box, texts = plan.plot.vb, plan.arrows.text_areas()
        corners = [
            plan.arrows.mapFromItem(box.childGroup, QPointF(*at)) for at in (walls.min(axis=0), walls.max(axis=0))
        ]
        room = QRectF(*corners).normalized()
        assert len(texts) > len(plan.arrows.arrows) / 2
        assert [plan.arrows.text(arrow) for arrow, area in texts if area.intersects(room)] == []
        areas = [area for _, area in texts]
        assert not any(one.intersects(other) for one, other in itertools.combinations(areas, 2))
