"""The view of ranges and residuals over heading: common heading axis, units, clicks and the linked cursor."""

import math
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind, compare_readings
from sonarhw_compare.pictures import RangeShading
from sonarhw_gui.jobs.forecast import ComparedScan, Stretch
from sonarhw_gui.model.look import LengthUnit, Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Cursor, Shown
from sonarhw_gui.views.ranges import RangeView

from sonarhw.readings import Reading
from tests.system.gui.driving import PATIENCE, click, position_of, until

SPEED = 343.2
RANGES = (0.8, 0.5, 0.9, None)


@pytest.fixture
def shown(scene: Scene) -> Shown:
    readings = tuple(
        Reading(k, 0, 0, math.radians(90 * k), 0.1 * k, () if far is None else (2 * far / SPEED,), SPEED)
        for k, far in enumerate(RANGES)
    )
    comparison = compare_readings(readings, scene.room, scene.pose, scene.board)
    return Shown(scene, None, ComparedScan((Stretch(0, comparison),)), readings, chosen=0)


@pytest.fixture
def view(qtbot: QtBot, shown: Shown) -> RangeView:
    view = RangeView()
    qtbot.addWidget(view)
    view.resize(600, 350)
    view.show_state(shown)
    with qtbot.waitExposed(view, timeout=PATIENCE):
        view.show()
    return view


def test_residuals_are_measured_minus_predicted_and_clipped_to_the_scale(view: RangeView, shown: Shown) -> None:
    for row in shown.compared.stretches[0].comparison.rows:
        if row.kind in (Kind.MATCH, Kind.SHORT, Kind.LONG):
            heading, residual = position_of(view._marks[1], row.index)
            assert heading == pytest.approx(90 * row.index)
            assert residual == pytest.approx(float(np.clip(row.residual, -0.25, 0.25)))


def test_a_residual_beyond_the_scale_is_an_arrow_with_its_value_in_the_tooltip(
    qtbot: QtBot, view: RangeView, shown: Shown
) -> None:
    ranges = (shown.row(0).predicted, None, shown.row(2).predicted + 0.4, shown.row(3).predicted - 0.2)
    readings = tuple(
        replace(reading, echo_times=() if far is None else (2 * far / SPEED,))
        for reading, far in zip(shown.readings, ranges, strict=True)
    )
    room = shown.scene
    comparison = compare_readings(readings, room.room, room.pose, room.board)
    view.show_state(replace(shown, readings=readings, compared=ComparedScan((Stretch(0, comparison),))))
    points = {kind: list(zip(*view.beyond[kind].getData(), strict=True)) for kind in view.beyond}
    assert points == {Kind.SHORT: [], Kind.LONG: [(pytest.approx(180), pytest.approx(0.25))]}
    assert view.beyond[Kind.LONG].isVisible()
    assert colour_at(view, (180, 0.25)) == QColor(shown.look.palette.long).name()

    at = view.mapFromScene(view.residuals.vb.mapViewToScene(QPointF(180, 0.25)))
    for pixel in (at - QPoint(40, 40), at):
        qtbot.mouseMove(view.viewport(), pixel)
    until(qtbot, lambda: "residual +400 mm" in view.residuals.vb.toolTip())
    view.show_state(replace(shown, compared=None))
    assert not view.beyond[Kind.LONG].isVisible()


def colour_at(view: RangeView, at: tuple[float, float]) -> str:
    """Return the colour at a point of the residuals."""
    pixel = view.mapFromScene(view.residuals.vb.mapViewToScene(QPointF(*at)))
    return view.grab().toImage().pixelColor(pixel).name()


def test_both_plots_share_their_headings(view: RangeView) -> None:
    view.ranges.setXRange(100, 200, padding=0)
    assert view.residuals.vb.viewRange()[0] == pytest.approx([100, 200])


@pytest.mark.parametrize(("unit", "small"), [(LengthUnit.M, "mm"), (LengthUnit.CM, "cm"), (LengthUnit.FT, "in")])
def test_residuals_have_the_smaller_unit(view: RangeView, shown: Shown, unit: LengthUnit, small: str) -> None:
    view.show_state(replace(shown, look=Look(unit=unit)))
    assert view.ranges.getAxis("left").labelText == f"range ({unit.label})"
    assert view.residuals.getAxis("left").labelText == f"residual ({small})"
    assert view.residuals.getAxis("left").scale == pytest.approx({"mm": 1000, "cm": 100, "in": 1 / 0.0254}[small])


def test_a_click_in_the_residuals_picks_the_nearest_reading(qtbot: QtBot, view: RangeView) -> None:
    with qtbot.waitSignal(view.gestures.picked, timeout=PATIENCE) as picked:
        click(qtbot, view, view.residuals.vb, (80.0, 0.1))
    assert picked.args == [1]


def test_the_mouse_points_at_heading_and_range_inside_the_plots_only(qtbot: QtBot, view: RangeView) -> None:
    cursors: list[Cursor | None] = []
    view.gestures.pointed.connect(cursors.append)
    view.scene().sigMouseMoved.emit(view.ranges.vb.mapViewToScene(QPointF(180.0, 0.7)))
    assert cursors[-1].heading == pytest.approx(math.pi)
    assert cursors[-1].range == pytest.approx(0.7)
    view.scene().sigMouseMoved.emit(view.residuals.vb.mapViewToScene(QPointF(170.0, 0.0)))
    assert cursors[-1].range == pytest.approx(0.9)  # of the reading at 180°
    view.scene().sigMouseMoved.emit(QPointF(2.0, 2.0))
    assert cursors[-1] is None


def test_the_cursor_of_another_view_is_a_cross(view: RangeView, shown: Shown) -> None:
    view.show_state(replace(shown, cursor=Cursor(-math.pi / 2, 0.6)))
    assert [line.value() for line in view._pointer] == pytest.approx([270, 270, 0.6])
    assert all(line.isVisible() for line in view._pointer)
    view.show_state(shown)
    assert not any(line.isVisible() for line in view._pointer)


def test_shading_has_the_opacity_of_the_probability(view: RangeView, shown: Shown) -> None:
    opacities = np.zeros((360, 10))
    opacities[:, 4], opacities[75:105, 4] = 1.0, 0.5
    chances = RangeShading(np.radians(np.arange(360.0)), opacities, 1.0)
    view.show_state(replace(shown, chances=chances))
    shade, paper = QColor(shown.look.palette.predicted), QColor(shown.look.palette.paper)

    def colour(heading: float, distance: float) -> QColor:
        at = view.mapFromScene(view.ranges.vb.mapViewToScene(QPointF(heading, distance)))
        return view.grab().toImage().pixelColor(at)

    for heading, share in ((130.0, 1.0), (80.0, 0.5)):
        found = colour(heading, 0.45)
        for channel in ("red", "green", "blue"):
            mixed = share * getattr(shade, channel)() + (1 - share) * getattr(paper, channel)()
            # a grid line may cross
            assert getattr(found, channel)() == pytest.approx(mixed, abs=30)
    view.show_state(shown)
    assert not view.shading.isVisible()


def test_a_low_view_shows_both_plots_with_short_labels(view: RangeView) -> None:
    axis = view.residuals.getAxis("left")
    for height, label in ((400, "residual (mm)"), (150, "mm"), (400, "residual (mm)")):
        view.resize(view.width(), height)
        assert axis.labelText == label
        bottom = view.residuals.mapRectToScene(view.residuals.boundingRect()).bottom()
        assert height - 20 < bottom <= height
