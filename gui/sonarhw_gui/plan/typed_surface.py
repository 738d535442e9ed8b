"""A dialog that adds a wall or a post by typed coordinates, without the mouse."""

from collections.abc import Callable

from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QWidget
from sonarhw_compare.edits import add_post, add_wall
from sonarhw_sim.room.room_file import MAX_COORDINATE

from sonarhw.errors import InputError
from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.parts.number_field import NumberField
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit, room_and_place, with_room
from sonarhw_gui.view import Gestures

_WALL, _POST = ("x of one end", "y of one end", "x of the other end", "y of the other end"), ("x", "y", "radius")

_RADIUS = 0.05  # m, of a post until another one is typed


class TypedSurface(QDialog):
    """Asks for the coordinates of a wall (four) or of a post (three). Not modal."""

    def __init__(
        self, scene: Callable[[], Scene], unit: LengthUnit, gestures: Gestures, post: bool, parent: QWidget
    ) -> None:
        """`scene`: returns the present scene, which may change while the dialog is open."""
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("Add a post" if post else "Add a wall")
        self._scene, self._gestures, self._post, self._unit = scene, gestures, post, unit
        self.problem = PlainLabel(wordWrap=True)
        form = QFormLayout(self)
        self.fields = [self._field(form, name, self._unit) for name in (_POST if post else _WALL)]
        for field, value in zip(self.fields, scene().pose.position, strict=False):
            field.setValue(self._unit.of(value))
        if post:
            self.fields[2].setValue(self._unit.of(_RADIUS))
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel)
        buttons.button(QDialogButtonBox.StandardButton.Ok).setDefault(True)  # Enter in a field adds
        buttons.accepted.connect(self._add)
        buttons.rejected.connect(self.close)
        form.addRow(self.problem)
        form.addRow(buttons)

    @staticmethod
    def _field(form: QFormLayout, name: str, unit: LengthUnit) -> NumberField:
        most = unit.of(MAX_COORDINATE)
        field = NumberField(0.0 if name == "radius" else -most, most, unit.decimals, f" {unit.label}")
        field.setAccessibleName(name)
        form.addRow(name, field)
        return field

    @Slot()
    def _add(self) -> None:
        for field in self.fields:
            field.interpretText()  # Enter may come before a field has lost the focus
        try:
            scene, label = self._edited(self._scene())
        except InputError as error:
            self.problem.setText(str(error))
            return
        self._gestures.edited.emit(scene, label, None)
        self.close()

    def _edited(self, scene: Scene) -> Edit:
        room, _ = room_and_place(scene)
        values = [round(self._unit.metres(field.value()), 6) for field in self.fields]
        if self._post:
            return with_room(
                scene, add_post(room, (values[0], values[1]), values[2], room.materials[0])
            ), "adding a post"
        if values[:2] == values[2:]:
            raise InputError("the ends of the wall are the same point; give two different points")
        ends = (values[0], values[1]), (values[2], values[3])
        return with_room(scene, add_wall(room, *ends, room.materials[0])), "adding a wall"
