"""The room panel with mouse and keys: materials, air, board, model options and the pose of the sensor."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QEvent, QObject, QPoint
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QSlider, QStyle, QStyleOptionSlider
from sonarhw_gui.model.look import LengthUnit, Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.panels.room import RoomPanel
from sonarhw_gui.window.start import open_application
from sonarhw_sim.air import Air, EdgeStrength, Receiver, Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room
from sonarhw_sim.room.room_writing import materials, with_air

from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import LEFT, dialog_of, enter, key, predicted, push, until


class EditRecorder:
    """Shows each edit in the panel, as the session does, and records its label and gesture."""

    def __init__(self, panel: RoomPanel, scene: Scene) -> None:
        self._panel, self.scene = panel, scene
        self.labels: list[str] = []
        self.gestures: list[object] = []
        panel.edited.connect(self.take)
        self.show()

    def take(self, scene: Scene, label: str, gesture: object) -> None:
        self.scene = scene
        self.labels.append(label)
        self.gestures.append(gesture)
        self.show()

    def show(self, look: Look | None = None) -> None:
        self._panel.show_state(Shown(self.scene, look=look or Look()))


@pytest.fixture
def panel(qapp: object) -> Iterator[RoomPanel]:
    open_application()
    panel = RoomPanel()
    panel.show()
    yield panel
    panel.close()


@pytest.fixture
def edits(panel: RoomPanel, scene: Scene) -> EditRecorder:
    return EditRecorder(panel, scene)


def drag_slider(slider: QSlider, *values: int) -> None:
    """Drag the handle with the mouse through the values."""
    option = QStyleOptionSlider()
    slider.initStyleOption(option)
    part = QStyle.SubControl.SC_SliderHandle
    knob = slider.style().subControlRect(QStyle.ComplexControl.CC_Slider, option, part, slider)
    pixels = (slider.width() - knob.width()) / (slider.maximum() - slider.minimum())
    start, first = knob.center(), slider.value()
    stops = [start + QPoint(round((value - first) * pixels), 0) for value in values]
    QTest.mousePress(slider, LEFT, pos=start)
    for at in stops:
        QTest.mouseMove(slider, at)
    QTest.mouseRelease(slider, LEFT, pos=stops[-1])


def test_one_drag_of_a_slider_is_one_undo_step_and_changes_the_walls(panel: RoomPanel, edits: EditRecorder) -> None:
    reflectance, scatter = panel.materials.sliders["shelving"]
    drag_slider(reflectance.slider, 80, 60, 40)
    assert len(edits.labels) >= 3
    assert len(set(map(id, edits.gestures))) == 1
    assert edits.scene.room.reflectances[0] == pytest.approx(0.4, abs=0.03)
    assert reflectance.field.value() == edits.scene.room.reflectances[0]
    drag_slider(scatter.slider, 30)
    assert len(set(map(id, edits.gestures))) == 2
    shelving = materials(edits.scene.room)["shelving"]
    assert shelving.scatter == pytest.approx(0.3, abs=0.03)
    assert shelving.reflectance == reflectance.field.value()
    assert set(edits.labels) == {"changing shelving"}


def test_typed_values_change_one_thing_in_the_unit_of_the_look(panel: RoomPanel, edits: EditRecorder) -> None:
    edits.scene = replace(edits.scene, room=with_air(edits.scene.room, Air(10.0, 0.333, 99.987)))
    edits.show()
    enter(panel.air.temperature.field, "-5.5")
    air = edits.scene.room.air
    assert (air.temperature_c, air.relative_humidity, air.pressure_kpa) == (-5.5, 0.333, 99.987)
    assert panel.air.speed.text() == f"{air.speed_of_sound:.1f} m/s"
    assert "temperature_c = -5.5" in edits.scene.room.text
    x, heading = panel.sensor.along_x, panel.sensor.heading
    edits.show(Look(unit=LengthUnit.CM))
    assert x.text() == "77.4 cm"
    enter(x, "50")
    assert edits.scene.pose.position == (0.5, 0.085)
    edits.show()
    assert x.text() == "0.500 m"
    enter(heading, "90")
    assert edits.scene.pose.heading == pytest.approx(math.pi / 2)
    # a comma is a decimal point, and nothing groups digits
    for typed, metres in (("1,5", 1.5), ("1.25", 1.25), ("1,234.5", 1.234), ("1.235,5", 1.235)):
        enter(x, typed)
        assert edits.scene.pose.position[0] == metres
    panel.sensor.along_y.setValue(0.6)
    enter(panel.sensor.name, "shelf")
    assert edits.scene.pose.name == "shelf"
    assert edits.scene.room.place("shelf").position == (1.235, 0.6)
    assert edits.scene.room.places.keys() == {"figure7", "figure9", "shelf"}
    assert edits.labels[-1] == "adding place shelf"


def test_keys_choose_receiver_unit_edges_and_board(panel: RoomPanel, edits: EditRecorder) -> None:
    group = panel.model
    for field in (group.receiver, group.unit, group.edges):
        key(field, "Down")
    options = edits.scene.options
    assert (options.receiver, options.unit, options.edge_strength) == (Receiver.BOARD, Unit.BLOCK, EdgeStrength.KELLER)
    assert edits.scene.room.text == load_room(ROOM).text
    own = replace(edits.scene.board, range_offset=0.01)
    edits.scene = replace(edits.scene, board=own)
    edits.show()
    assert group.board.currentText() == f"{own.name}, changed"
    group.board.setFocus()
    QTest.keyClicks(group.board, "lego")
    assert edits.scene.board == load_board("lego-nxt")
    assert edits.labels[-1] == "choosing board lego-nxt"
    key(group.board, "Home")
    assert edits.scene.board == own


def test_a_new_material_is_assigned_to_a_wall(panel: RoomPanel, edits: EditRecorder) -> None:
    QTest.keyClicks(panel.materials.name, "felt")
    push(panel.materials.add)
    assert [*panel.materials.sliders] == ["shelving", "felt"]
    panel.surface.choose("top")
    key(panel.surface.material, "Down")
    room = edits.scene.room
    assert [room.names[k] for k, material in enumerate(room.materials) if material == "felt"] == ["top"]
    assert panel.surface.description.text().startswith("top · felt, reflectance 0.90")
    while len(edits.scene.room.walls) > 1:
        push(panel.surface.remove)
    before = edits.scene
    push(panel.surface.remove)
    assert edits.scene is before
    assert "last wall" in panel.refused.text()
    assert panel.refused.isVisible()
    edits.scene = replace(edits.scene, room=None, place=None)
    edits.show()
    assert not any(group.isEnabled() for group in panel.groups)


class Heights(QObject):
    """Records the height of every group of the panel at each of its paints."""

    def __init__(self, panel: RoomPanel) -> None:
        super().__init__(panel)
        self._panel = panel
        self.painted: list[list[int]] = []
        panel.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() is QEvent.Type.Paint:
            self.painted.append([group.height() for group in self._panel.groups])
        return False


def test_edits_in_the_panel_are_predicted(open_with: OpenWith, scene: Scene, tmp_path: Path) -> None:
    window = open_with()
    session, panel, controller = window.session, window.room, window.views.plan.drawing.controller
    until(lambda: predicted(window))
    heights = Heights(panel)
    key(window, "F8")
    needed = [group.minimumSizeHint().height() for group in panel.groups]
    until(lambda: bool(heights.painted))  # the panel has its height from its first paint
    assert all(height >= least for painted in heights.painted for height, least in zip(painted, needed, strict=True))
    controller.choose_surface("top")
    assert panel.surface.surface.currentText() == "top"
    key(panel.surface.surface, "Down")
    assert controller.chosen_surface == 3

    board, file = panel.model.board, tmp_path / "own.toml"
    board.setFocus()
    key(board, "Down")
    assert board.currentText() == "hc-sr04"
    until(lambda: session.shown.outline.board == load_board("hc-sr04"))
    key(window, "Ctrl+Z")
    assert (session.shown.scene, board.currentText()) == (scene, f"{scene.board.name}, changed")
    until(lambda: session.shown.outline.board == scene.board)
    own = scene.board.text.replace(f'name = "{scene.board.name}"', 'name = "mine"')
    for text, name in ((f"nonsense = 1\n{own}", f"{scene.board.name}, changed"), (own, "mine")):
        file.write_text(text)
        board.setFocus()
        key(board, "End")  # from a file
        dialog_of(window).fileSelected.emit(str(file))
        dialog_of(window).reject()
        assert board.currentText() == name
    assert window.banner.message.startswith(f"⚠ {file}: nonsense")
    assert session.shown.scene.board.text == own
    session.showing.undo()

    reflectance, outline = panel.materials.sliders["shelving"][0], session.shown.outline
    drag_slider(reflectance.slider, 50)
    until(lambda: predicted(window) and session.shown.outline is not outline)
    assert session.shown.outline.room.reflectances[0] == reflectance.value
    key(window, "Shift+Left")
    until(lambda: panel.sensor.along_x.text() == "0.764 m")
    panel.sensor.name.setText("bench")
    panel.sensor.save.click()
    window.views.plan.drawing.zoom(0.5)
    seen, file = window.views.plan.drawing.plot.vb.viewRange(), tmp_path / "room.toml"
    session.save_room(str(file))
    saved = load_room(file)
    assert (saved.reflectances[0], saved.place("bench").position) == (reflectance.value, (0.764, 0.085))
    assert set(saved.places) == {*scene.room.places, "bench"}
    assert session.shown.scene.room_file == "room.toml"
    assert window.views.plan.drawing.plot.vb.viewRange() == seen
    while window.session.showing.history.undo_label:
        key(window, "Ctrl+Z")
    assert session.shown.scene.room is scene.room
