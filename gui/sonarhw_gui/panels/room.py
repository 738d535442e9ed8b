"""The room panel: pose of the sensor, walls and posts, materials, air, board and model options.

Each edit is one undo step, and so is one drag of a slider.
"""

import math
from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial
from typing import Protocol

from PySide6.QtCore import QSignalBlocker, Qt, Signal, Slot
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)
from sonarhw_sim.air import EdgeStrength, Receiver, Unit
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.room.room_file import Material
from sonarhw_sim.room.room_writing import materials

from sonarhw.errors import InputError
from sonarhw_gui.model.edits import (
    Edit,
    sensor_at,
    sensor_facing,
    with_air_state,
    with_board,
    with_material_values,
    with_named_place,
    with_options,
    with_surface_material,
    without_surface,
)
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.views.plan_tools import surface_text
from sonarhw_gui.widgets import NumberField, PlainLabel, SliderField, TitleLabel, short_list, show_names

# Groups of the room panel: their base class, the pose of the sensor, and the selected wall or post.


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


# Groups of the room panel about the sound model: the air, the board, and the options of the prediction.


class AirGroup(Group):
    """Temperature, humidity and pressure of the air."""

    def __init__(self, change: Change) -> None:
        super().__init__("Air", change)
        self.temperature = SliderField(-40, 60, 1, " °C", "Sound is faster in warmer air: 0.18 % per °C")
        self.humidity = SliderField(0, 100, 0, " %", "Relative humidity; changes the absorption of ultrasound")
        self.pressure = SliderField(30, 120, 1, " kPa", "101.3 kPa at sea level, about 90 kPa at 1000 m")
        self.speed = PlainLabel()
        rows = (("Temperature", self.temperature), ("Humidity", self.humidity), ("Pressure", self.pressure))
        for name, slider in rows:
            self.rows.addRow(name, slider)
        self.temperature.changed.connect(self._set_temperature)
        self.humidity.changed.connect(self._set_humidity)
        self.pressure.changed.connect(self._set_pressure)
        self.rows.addRow("Speed of sound", self.speed)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        air = room.air
        self.temperature.show_value(air.temperature_c)
        self.humidity.show_value(100 * air.relative_humidity)
        self.pressure.show_value(air.pressure_kpa)
        self.speed.setText(f"{air.speed_of_sound:.1f} m/s")

    @Slot(float, object)
    def _set_temperature(self, celsius: float, gesture: object) -> None:
        self._change(partial(with_air_state, temperature_c=celsius), gesture)

    @Slot(float, object)
    def _set_humidity(self, percent: float, gesture: object) -> None:
        self._change(partial(with_air_state, relative_humidity=percent / 100), gesture)

    @Slot(float, object)
    def _set_pressure(self, kilopascals: float, gesture: object) -> None:
        self._change(partial(with_air_state, pressure_kpa=kilopascals), gesture)


_MEANINGS: dict[Enum, tuple[str, str]] = {
    Receiver.FIRST_ECHO: ("first echo", "First echo above the threshold, at its true range, as in the paper"),
    Receiver.BOARD: ("board", "Echoes as the ranging board detects them: gain steps, integration, re-arming"),
    Unit.PASS: ("lets sound pass", "Sound that returns to the sensor unit continues unchanged"),
    Unit.BLOCK: ("stops sound", "Sound that hits the face of the transducer is absorbed"),
    Unit.REFLECT: (
        "reflects sound",
        "Sound that hits the face of the transducer is reflected; slow to predict",
    ),
    EdgeStrength.UNIFORM: (
        "uniform theory",
        "Diffraction by angles, distances and reflectances, continuous with reflection",
    ),
    EdgeStrength.PAPER: ("as in the paper", "An edge diffracts sound equally in all directions"),
    EdgeStrength.KELLER: ("after Keller", "Diffraction depends on the angles to the faces of the edge"),
}


_FROM_FILE = "From file…"


class ModelGroup(Group):
    """The board profile, and the options of receiver, sensor unit and edge diffraction."""

    board_file_requested = Signal()

    def __init__(self, change: Change) -> None:
        super().__init__("Board and model", change)
        self._boards = {name: load_board(name) for name in board_names()}
        self._own: dict[str, Board] = {}  # the board of the log or the command line, if it is not an included one
        self._named = ""  # the shown board's entry in the list
        self.board = short_list()
        self.board.setToolTip("Profile of the ranging board for the prediction; a log contains its own")
        self.rows.addRow("Board", self.board)
        self.board.textActivated.connect(self._choose_board)
        self.receiver = self._list("Receiver", [*Receiver])
        self.unit = self._list("Sensor unit", [*Unit])
        self.edges = self._list("Edges", [*EdgeStrength])

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        self._name_board(shown.scene.board)
        options = shown.scene.options
        for field, value in (
            (self.receiver, options.receiver_of(shown.scene.board)),
            (self.unit, options.unit),
            (self.edges, options.edge_strength or shown.scene.board.edge_strength),
        ):
            text, tip = _MEANINGS[value]
            field.setCurrentText(text)
            field.setToolTip(tip)

    def _list(self, name: str, values: Sequence[Enum]) -> QComboBox:
        field = short_list()
        for k, value in enumerate(values):
            text, tip = _MEANINGS[value]
            field.addItem(text)
            field.setItemData(k, tip, Qt.ItemDataRole.ToolTipRole)
        self.rows.addRow(name, field)
        field.activated.connect(self._set_options)
        return field

    def _name_board(self, board: Board) -> None:
        name = board.name
        if self._boards.get(name) != board:
            name = f"{name}, changed" if name in self._boards else name
            self._own = {name: board}
        self._named = name
        show_names(self.board, (*self._own, *self._boards, _FROM_FILE), name)

    @Slot(str)
    def _choose_board(self, name: str) -> None:
        if name == _FROM_FILE:
            self.board.setCurrentText(self._named)  # until the file is read
            self.board_file_requested.emit()
            return
        self._change(partial(with_board, board={**self._boards, **self._own}[name]))

    @Slot()
    def _set_options(self) -> None:
        receiver = [*Receiver][self.receiver.currentIndex()]
        unit = [*Unit][self.unit.currentIndex()]
        strength = [*EdgeStrength][self.edges.currentIndex()]
        self._change(partial(with_options, receiver=receiver, unit=unit, edge_strength=strength))


# The group "Materials" of the room panel: reflectance and scatter of each material.


class MaterialGroup(Group):
    """Two sliders for each material, and a field to add a new one."""

    def __init__(self, change: Change) -> None:
        super().__init__("Materials", change)
        self.sliders: dict[str, tuple[SliderField, SliderField]] = {}  # reflectance and scatter
        self._room: Room | None = None
        self._known: dict[str, Material] = {}
        self.name = QLineEdit(placeholderText="name of a new material")
        self.add = QPushButton("Add")
        self.add.setToolTip("Define a material. Assign it under Wall or post")
        last = QHBoxLayout()
        last.addWidget(self.name, stretch=1)
        last.addWidget(self.add)
        self.rows.addRow(last)
        self.add.clicked.connect(self._define)
        self.name.returnPressed.connect(self._define)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Draw the materials of the room."""
        if room is not self._room:  # parsing its text takes milliseconds
            self._room, self._known = room, materials(room)
        known = self._known
        if [*known] != [*self.sliders]:
            self._lay_out(known)
        for name, (reflectance, scatter) in self.sliders.items():
            reflectance.show_value(known[name].largest)
            scatter.show_value(known[name].scatter)

    def _lay_out(self, known: dict[str, Material]) -> None:
        while self.rows.rowCount() > 1:
            self.rows.removeRow(0)
        self.sliders = {}
        for row, name in enumerate(known):
            tip = "Ratio of reflected to incident amplitude, 0 to 1"
            if known[name].table:
                tip = "Largest value of the table in the room file. Another value replaces the table"
            reflectance = SliderField(0, 1, 2, "", tip)
            scatter = SliderField(0, 1, 2, "", "Diffuse share of the reflected sound: 0 mirror, 1 fully diffuse")
            self.sliders[name] = reflectance, scatter
            reflectance.changed.connect(self._set_share)
            scatter.changed.connect(self._set_share)
            self.rows.insertRow(3 * row, TitleLabel(name))
            self.rows.insertRow(3 * row + 1, "Reflectance", reflectance)
            self.rows.insertRow(3 * row + 2, "Scatter", scatter)

    @Slot()
    def _define(self) -> None:
        name = self.name.text().strip()
        if name and name not in self.sliders:
            self._change(partial(with_material_values, material=name))
            self.name.clear()

    @Slot(float, object)
    def _set_share(self, value: float, gesture: object) -> None:
        for name, sliders in self.sliders.items():
            for share, slider in zip(("reflectance", "scatter"), sliders, strict=True):
                if slider is self.sender():
                    self._change(partial(with_material_values, material=name, shares={share: value}), gesture)
                    return


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
