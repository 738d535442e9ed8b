"""The room panel with mouse and keys: materials, air, board, model options and the pose of the sensor."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, Qt
from PySide6.QtWidgets import QFileDialog, QSlider, QStyle, QStyleOptionSlider
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import LengthUnit, Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.panels.room import RoomPanel
from sonarhw_gui.window.start import open_application
from sonarhw_sim.air import Air, EdgeStrength, Receiver, Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room
from sonarhw_sim.room.room_writing import materials, with_air

from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until


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
def panel(qtbot: QtBot) -> Iterator[RoomPanel]:
    open_application()
    panel = RoomPanel()
    qtbot.addWidget(panel)
    panel.show()
    return panel


@pytest.fixture
def edits(panel: RoomPanel, scene: Scene) -> EditRecorder:
    return EditRecorder(panel, scene)


def drag_slider(qtbot: QtBot, slider: QSlider, *values: int) -> None:
    """Drag the handle with the mouse through the values."""
    option = QStyleOptionSlider()
    slider.initStyleOption(option)
    part = QStyle.SubControl.SC_SliderHandle
    knob = slider.style().subControlRect(QStyle.ComplexControl.CC_Slider, option, part, slider)
    pixels = (slider.width() - knob.width()) / (slider.maximum() - slider.minimum())
    start, first = knob.center(), slider.value()
    stops = [start + QPoint(round((value - first) * pixels), 0) for value in values]
    qtbot.mousePress(slider, Qt.MouseButton.LeftButton, pos=start)
    for at in stops:
        qtbot.mouseMove(slider, at)
    qtbot.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=stops[-1])


def test_one_drag_of_a_slider_is_one_undo_step_and_changes_the_walls(
    qtbot: QtBot, panel: RoomPanel, edits: EditRecorder
) -> None:
    reflectance, scatter = panel.materials.sliders["shelving"]
    drag_slider(qtbot, reflectance.slider, 80, 60, 40)
    assert len(edits.labels) >= 3
    assert len(set(map(id, edits.gestures))) == 1
    assert edits.scene.room.reflectances[0] == pytest.approx(0.4, abs=0.03)
    assert reflectance.field.value() == edits.scene.room.reflectances[0]
    drag_slider(qtbot, scatter.slider, 30)
    assert len(set(map(id, edits.gestures))) == 2
    shelving = materials(edits.scene.room)["shelving"]
    assert shelving.scatter == pytest.approx(0.3, abs=0.03)
    assert shelving.reflectance == reflectance.field.value()
    assert set(edits.labels) == {"changing shelving"}


def test_a_typed_air_value_leaves_the_others_unchanged(qtbot: QtBot, panel: RoomPanel, edits: EditRecorder) -> None:
    edits.scene = replace(edits.scene, room=with_air(edits.scene.room, Air(10.0, 0.333, 99.987)))
    edits.show()
    panel.air.temperature.field.setFocus()
    panel.air.temperature.field.selectAll()
    qtbot.keyClicks(panel.air.temperature.field, "-5.5")
    qtbot.keyClick(panel.air.temperature.field, Qt.Key.Key_Return)
    air = edits.scene.room.air
    assert (air.temperature_c, air.relative_humidity, air.pressure_kpa) == (-5.5, 0.333, 99.987)
    assert panel.air.speed.text() == f"{air.speed_of_sound:.1f} m/s"
    assert "temperature_c = -5.5" in edits.scene.room.text


def test_keys_choose_receiver_unit_and_edges(qtbot: QtBot, panel: RoomPanel, edits: EditRecorder) -> None:
    group = panel.model
    for field in (group.receiver, group.unit, group.edges):
        qtbot.keyClick(field, Qt.Key.Key_Down)
    options = edits.scene.options
    assert options.receiver is Receiver.BOARD
    assert options.unit is Unit.BLOCK
    assert options.edge_strength is EdgeStrength.KELLER
    assert edits.scene.room.text == load_room(ROOM).text


def test_keys_choose_a_board_with_its_receiver_and_the_original_board_again(
    qtbot: QtBot, panel: RoomPanel, edits: EditRecorder
) -> None:
    own = replace(edits.scene.board, range_offset=0.01)
    edits.scene = replace(edits.scene, board=own)
    edits.show()
    board = panel.model.board
    assert board.currentText() == f"{own.name}, changed"
    board.setFocus()
    qtbot.keyClicks(board, "lego")
    assert edits.scene.board == load_board("lego-nxt")
    assert edits.scene.options.receiver_of(edits.scene.board) is edits.scene.board.receiver
    assert edits.labels == ["choosing board lego-nxt"]
    qtbot.keyClick(board, Qt.Key.Key_Home)
    assert edits.scene.board == own


def test_a_board_is_read_from_a_file_and_an_invalid_file_is_reported(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, tmp_path: Path
) -> None:
    window = open_with()
    window.open_dock("Room")
    board = window.room.model.board

    def take(text: str) -> None:
        (tmp_path / "own.toml").write_text(text)
        board.setFocus()
        qtbot.keyClick(board, Qt.Key.Key_End)
        dialog = next(dialog for dialog in window.findChildren(QFileDialog) if dialog.isVisible())
        dialog.fileSelected.emit(str(tmp_path / "own.toml"))
        dialog.reject()

    take(f"nonsense = 1\n{scene.board.text}")
    assert window.banner.message.startswith(f"⚠ {tmp_path / 'own.toml'}: nonsense")
    assert window.session.shown.scene is scene
    assert board.currentText() == f"{scene.board.name}, changed"
    own = scene.board.text.replace(f'name = "{scene.board.name}"', 'name = "mine"')
    take(own)
    assert (board.currentText(), window.session.shown.scene.board.text) == ("mine", own)
    window.session.showing.undo()
    assert window.session.shown.scene is scene


def test_another_board_changes_the_prediction_and_can_be_undone(
    qtbot: QtBot, open_with: OpenWith, scene: Scene
) -> None:
    window = open_with()
    window.open_dock("Room")
    until(qtbot, lambda: predicted(window))
    board = window.room.model.board
    board.setFocus()
    qtbot.keyClick(board, Qt.Key.Key_Down)
    assert board.currentText() == "hc-sr04"
    until(qtbot, lambda: window.session.shown.outline.board == load_board("hc-sr04"))
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.session.shown.scene is scene
    assert board.currentText() == f"{scene.board.name}, changed"
    until(qtbot, lambda: window.session.shown.outline.board == scene.board)


def test_typed_coordinates_move_the_sensor_in_the_unit_of_the_look(
    qtbot: QtBot, panel: RoomPanel, edits: EditRecorder
) -> None:
    edits.show(Look(unit=LengthUnit.CM))
    x = panel.sensor.along_x
    assert x.text() == "77.4 cm"
    x.setFocus()
    x.selectAll()
    qtbot.keyClicks(x, "50")
    qtbot.keyClick(x, Qt.Key.Key_Return)
    assert edits.scene.pose.position == (0.5, 0.085)
    edits.show()
    assert x.text() == "0.500 m"
    panel.sensor.heading.selectAll()
    qtbot.keyClicks(panel.sensor.heading, "90")
    qtbot.keyClick(panel.sensor.heading, Qt.Key.Key_Return)
    assert edits.scene.pose.heading == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(("typed", "metres"), [("1,5", 1.5), ("1.5", 1.5), ("1,234.5", 1.234), ("1.234,5", 1.234)])
def test_a_comma_is_a_decimal_point_and_nothing_groups_digits(
    qtbot: QtBot, panel: RoomPanel, edits: EditRecorder, typed: str, metres: float
) -> None:
    x = panel.sensor.along_x
    x.setFocus()
    x.selectAll()
    qtbot.keyClicks(x, typed)
    qtbot.keyClick(x, Qt.Key.Key_Return)
    assert edits.scene.pose.position[0] == metres


def test_a_place_is_saved_under_its_name(qtbot: QtBot, panel: RoomPanel, edits: EditRecorder) -> None:
    panel.sensor.along_y.setValue(0.6)
    qtbot.keyClicks(panel.sensor.name, "shelf")
    qtbot.keyClick(panel.sensor.name, Qt.Key.Key_Return)
    assert edits.scene.pose.name == "shelf"
    assert edits.scene.room.place("shelf").position == (0.774, 0.6)
    assert edits.scene.room.places.keys() == {"figure7", "figure9", "shelf"}
    assert edits.labels[-1] == "adding place shelf"


def test_a_new_material_is_assigned_to_a_wall(qtbot: QtBot, panel: RoomPanel, edits: EditRecorder) -> None:
    qtbot.keyClicks(panel.materials.name, "felt")
    qtbot.mouseClick(panel.materials.add, Qt.MouseButton.LeftButton)
    assert [*panel.materials.sliders] == ["shelving", "felt"]
    panel.surface.choose("top")
    qtbot.keyClick(panel.surface.material, Qt.Key.Key_Down)
    room = edits.scene.room
    assert [room.names[k] for k, material in enumerate(room.materials) if material == "felt"] == ["top"]
    assert panel.surface.description.text().startswith("top · felt, reflectance 0.90")


def test_a_rejected_edit_is_reported_and_the_fields_are_restored(
    qtbot: QtBot, panel: RoomPanel, edits: EditRecorder
) -> None:
    while len(edits.scene.room.walls) > 1:
        qtbot.mouseClick(panel.surface.remove, Qt.MouseButton.LeftButton)
    before = edits.scene
    qtbot.mouseClick(panel.surface.remove, Qt.MouseButton.LeftButton)
    assert edits.scene is before
    assert "last wall" in panel._refused.text()
    assert panel._refused.isVisible()


def test_without_a_room_all_groups_are_disabled(panel: RoomPanel, edits: EditRecorder) -> None:
    edits.scene = replace(edits.scene, room=None, place=None)
    edits.show()
    assert not any(group.isEnabled() for group in panel._groups)


def test_a_changed_reflectance_is_predicted_and_saved_with_the_room(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_F8)
    before = window.session.shown
    window.session.showing.choose(27)
    reflectance = window.room.materials.sliders["shelving"][0]
    drag_slider(qtbot, reflectance.slider, 50)
    until(qtbot, lambda: predicted(window) and window.session.shown.outline is not before.outline)
    shown = window.session.shown
    assert shown.outline.room.reflectances[0] == reflectance.value
    qtbot.keyClick(window, Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    window.views.plan.drawing.zoom(0.5)
    seen = window.views.plan.drawing.plot.vb.viewRange()
    file = tmp_path / "mine.toml"
    window.session.save_room(str(file))
    saved = load_room(file)
    assert saved.reflectances[0] == reflectance.value
    assert saved.place("0.764,0.085").position == (0.764, 0.085)
    assert window.session.shown.scene.room_file == "mine.toml"
    assert window.views.plan.drawing.plot.vb.viewRange() == seen
    for _ in range(2):
        until(qtbot, window.commands.undo.isEnabled)
        doing = window.commands.undo.text()
        qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
        until(qtbot, lambda doing=doing: window.commands.undo.text() != doing)
    assert window.session.shown.scene.room is before.scene.room


def test_a_saved_room_has_no_places_that_the_sensor_was_dragged_to_before(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path
) -> None:
    window, file = open_with(), tmp_path / "mine.toml"
    shift = Qt.KeyboardModifier.ShiftModifier
    own = set(window.session.shown.scene.room.places)
    for _ in range(2):
        qtbot.keyClick(window, Qt.Key.Key_Left, shift)
        window.session.save_room(str(file))
        saved = load_room(file)
        assert set(saved.places) == {*own, window.session.shown.scene.pose.name}
        assert set(window.session.shown.scene.room.places) == set(saved.places)
        assert "[*]" in window.windowTitle()
        assert not window.isWindowModified()
    qtbot.keyClick(window, Qt.Key.Key_F8)
    window.room.sensor.name.setText("bench")
    window.room.sensor.save.click()
    window.session.save_room(str(file))
    assert set(load_room(file).places) == {*own, "bench"}


def test_plan_and_panel_share_the_chosen_wall(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    qtbot.keyClick(window, Qt.Key.Key_F8)
    window.views.plan.drawing.controller.choose_surface("top")
    assert window.room.surface.surface.currentText() == "top"
    qtbot.keyClick(window.room.surface.surface, Qt.Key.Key_Down)
    assert window.views.plan.drawing.controller.chosen_surface == 3


class Heights(QObject):
    """Records the height of every group of the panel at each of its paints."""

    def __init__(self, panel: RoomPanel) -> None:
        super().__init__(panel)
        self._panel = panel
        self.painted: list[list[int]] = []
        panel.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() is QEvent.Type.Paint:
            self.painted.append([group.height() for group in self._panel._groups])
        return False


def test_the_panel_has_its_height_from_its_first_paint(qtbot: QtBot, open_with: OpenWith) -> None:
    room = load_room("laboratory")  # many materials, whose rows are added when the panel opens
    window = open_with(scene=Scene(room, room.place("bench"), load_board("polaroid-6500"), "laboratory.toml"))
    until(qtbot, lambda: predicted(window))
    heights = Heights(window.room)
    qtbot.keyClick(window, Qt.Key.Key_F8)
    needed = [group.minimumSizeHint().height() for group in window.room._groups]
    until(qtbot, lambda: bool(heights.painted))
    assert all(height >= least for painted in heights.painted for height, least in zip(painted, needed, strict=True))
