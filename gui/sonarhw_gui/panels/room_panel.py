"""The room panel: pose of the sensor, walls and posts, materials, air, board and model options.

Each edit is one undo step, and so is one drag of a slider.
"""

from collections.abc import Callable

from PySide6.QtCore import Signal, Slot
from PySide6.QtWidgets import QVBoxLayout, QWidget

from sonarhw.errors import InputError
from sonarhw_gui.panels.material_group import MaterialGroup
from sonarhw_gui.panels.model_groups import AirGroup, ModelGroup
from sonarhw_gui.panels.room_groups import Group, SensorGroup, SurfaceGroup
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit
from sonarhw_gui.shown.shown import Shown


class RoomPanel(QWidget):
    """Shows and edits the values of the room that cannot be edited in the plan."""

    edited = Signal(object, str, object)  # Scene, label for Undo, gesture
    surface_chosen = Signal(object)  # name of a wall or post, or None

    def __init__(self) -> None:
        super().__init__()
        self._shown: Shown | None = None
        self._refused = PlainLabel(wordWrap=True)
        self._refused.hide()
        self.sensor, self.surface = SensorGroup(self.change), SurfaceGroup(self.change)
        self.materials = MaterialGroup(self.change)
        self.air, self.model = AirGroup(self.change), ModelGroup(self.change)
        self._groups: tuple[Group, ...] = (self.sensor, self.surface, self.materials, self.air, self.model)
        column = QVBoxLayout(self)
        column.addWidget(self._refused)
        for group in self._groups:
            column.addWidget(group)
        column.addStretch(1)
        self.surface.chosen.connect(self.surface_chosen)

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if before is not None and before.scene is shown.scene and before.look == shown.look:
            return
        self._draw(shown)

    @Slot(object)
    def choose_surface(self, name: str | None) -> None:
        """Select a wall or post."""
        self.surface.choose(name)

    def change(self, edit: Callable[[Scene], Edit], gesture: object = None) -> None:
        """Apply an edit to the shown scene, or show why it is rejected."""
        if self._shown is None:
            return
        try:
            scene, label = edit(self._shown.scene)
        except InputError as error:
            self._refused.setText(f"⚠ {error}")
            self._refused.show()
            self._draw(self._shown)  # restore the fields
            return
        self._refused.hide()
        self.edited.emit(scene, label, gesture)

    def _draw(self, shown: Shown) -> None:
        room, place = shown.scene.room, shown.scene.place
        for group in self._groups:
            group.setEnabled(room is not None)
            if room is not None and place is not None:
                group.draw(shown, room, place)
