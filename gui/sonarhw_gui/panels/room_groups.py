"""Groups of the room panel: their base class, the pose of the sensor, and the selected wall or post."""

import math
from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import QSignalBlocker, Signal, Slot
from PySide6.QtWidgets import (
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
)
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.room.room_writing import materials

from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.parts.number_field import NumberField
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.parts.short_list import short_list, show_names
from sonarhw_gui.plan.plan_texts import surface_text
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import (
    Edit,
    sensor_at,
    sensor_facing,
    with_named_place,
    with_surface_material,
    without_surface,
)
from sonarhw_gui.shown.shown import Shown

_FARTHEST = 1000.0  # m


class Change(Protocol):
    """A function that applies an edit to the scene."""

    def __call__(self, edit: Callable[[Scene], Edit], gesture: object = None) -> None:
        """Apply an edit. Edits of one `gesture` are one undo step."""


class Group(QGroupBox):
    """A part of the panel with a title and rows."""

    def __init__(self, title: str, change: Change) -> None:
        super().__init__(title)
        self._change = change
        self.rows = QFormLayout(self)
        self.rows.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene; `room` and `place` are its room and place."""
        raise NotImplementedError


class SensorGroup(Group):
    """Position of the sensor and heading of its step 0."""

    def __init__(self, change: Change) -> None:
        super().__init__("Sensor", change)
        self._unit = LengthUnit.M
        self.along_x, self.along_y = (self._field(-_FARTHEST, _FARTHEST, self._move) for _ in range(2))
        self.heading = self._field(0.0, 360.0, self._turn)
        self.heading.setDecimals(1)
        self.heading.setSuffix(" °")
        self.heading.setWrapping(True)
        self._gesture = object()
        for name, field in (("x", self.along_x), ("y", self.along_y), ("Step 0 at", self.heading)):
            self.rows.addRow(name, field)
        self.name = QLineEdit(placeholderText="name of this place")
        self.save = QPushButton("Save")
        self.save.setToolTip("Save this place in the room under this name")
        last = QHBoxLayout()
        last.addWidget(self.name, stretch=1)
        last.addWidget(self.save)
        self.rows.addRow(last)
        self.save.clicked.connect(self._save_place)
        self.name.returnPressed.connect(self._save_place)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        self._unit = unit = shown.look.unit
        for field, metres in zip((self.along_x, self.along_y), place.position, strict=True):
            with QSignalBlocker(field):
                field.setDecimals(unit.decimals)
                field.setSuffix(f" {unit.label}")
                field.setSingleStep(10.0 ** (1 - unit.decimals))
            _show_number(field, unit.of(metres))
        _show_number(self.heading, math.degrees(place.heading) % 360)

    def _field(self, low: float, high: float, changed: Callable[[], None]) -> NumberField:
        field = NumberField(low, high)
        field.valueChanged.connect(changed)
        field.editingFinished.connect(self._finish)
        return field

    @Slot()
    def _finish(self) -> None:
        self._gesture = object()

    @Slot()
    def _move(self) -> None:
        to = self._unit.metres(self.along_x.value()), self._unit.metres(self.along_y.value())
        self._change(lambda scene: sensor_at(scene, to), self._gesture)

    @Slot()
    def _save_place(self) -> None:
        name = self.name.text().strip()
        if name:
            self._change(lambda scene: with_named_place(scene, name))
            self.name.clear()

    @Slot()
    def _turn(self) -> None:
        to = math.radians(self.heading.value())
        self._change(lambda scene: sensor_facing(scene, to), self._gesture)


class SurfaceGroup(Group):
    """Name and material of the selected wall or post."""

    chosen = Signal(object)  # name of a wall or post, or None

    def __init__(self, change: Change) -> None:
        super().__init__("Wall or post", change)
        self.surface, self.material = short_list(), short_list()
        self.description = PlainLabel(wordWrap=True)
        self.remove = QPushButton("Remove")
        self.remove.setToolTip("Remove it from the room (Del)")
        self._room: Room | None = None
        self._chosen_name = ""  # name of the selected wall or post
        for name, field in (
            ("Name", self.surface),
            ("Material", self.material),
            ("", self.description),
            ("", self.remove),
        ):
            self.rows.addRow(name, field)
        self.surface.activated.connect(self._choose)
        self.material.textActivated.connect(self._set_material)
        self.remove.clicked.connect(self._remove)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        if room is self._room:
            return
        self._room = room
        show_names(self.surface, room.names, self._chosen_name)
        show_names(self.material, materials(room), "")
        self._draw_surface(room)

    def choose(self, name: str | None) -> None:
        """Select a wall or post. The name may belong to one that is not shown yet."""
        self._chosen_name = name or self._chosen_name
        if self._room is not None and self._chosen_name in self._room.names:
            self.surface.setCurrentText(self._chosen_name)
            self._draw_surface(self._room)

    def _draw_surface(self, room: Room) -> None:
        number = self.surface.currentIndex()
        self.material.setCurrentText(room.materials[number])
        self.description.setText(surface_text(room, number))
        self.remove.setEnabled(number not in room.levels)

    @Slot(int)
    def _choose(self, number: int) -> None:
        if self._room is not None:
            self._chosen_name = self._room.names[number]
            self._draw_surface(self._room)
            self.chosen.emit(None if number in self._room.levels else self._chosen_name)

    @Slot(str)
    def _set_material(self, material: str) -> None:
        number = self.surface.currentIndex()
        if self._room is not None and self._room.materials[number] != material:
            self._change(lambda scene: with_surface_material(scene, number, material))

    @Slot()
    def _remove(self) -> None:
        number = self.surface.currentIndex()
        self._change(lambda scene: without_surface(scene, number))


def _show_number(field: NumberField, value: float) -> None:
    if abs(field.value() - value) >= 10.0 ** -field.decimals() / 2:
        with QSignalBlocker(field):
            field.setValue(value)
