"""The room panel: pose of the sensor, walls and posts, materials, air, board and model options.

Each edit is one undo step, and so is one drag of a slider.
"""

import math
from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial
from typing import NamedTuple

from PySide6 import QtWidgets
from PySide6.QtCore import QSignalBlocker, Qt, Signal, Slot
from sonarhw_sim.air import EdgeStrength, Receiver, Unit
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.room.room_file import Material
from sonarhw_sim.room.room_writing import materials

from sonarhw.errors import InputError
from sonarhw_gui import widgets
from sonarhw_gui.model import edits
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.views.plan_tools import surface_text

# applies an edit of the scene; edits of one gesture, a second argument, are one undo step
Change = Callable[..., None]
_FARTHEST = 1000.0  # m
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


class _Value(NamedTuple):
    """A value of the air or of a material, with its slider."""

    name: str
    key: str  # of the value in the scene
    per_unit: float  # the number that is shown, for each unit of the value
    limits: tuple[float, float, int, str]  # lowest and highest number, decimals, unit
    tip: str


_AIR = (
    _Value("Temperature", "temperature_c", 1.0, (-40, 60, 1, " °C"), "Sound is faster in warmer air: 0.18 % per °C"),
    _Value(
        "Humidity",
        "relative_humidity",
        100.0,
        (0, 100, 0, " %"),
        "Relative humidity; changes the absorption of ultrasound",
    ),
    _Value("Pressure", "pressure_kpa", 1.0, (30, 120, 1, " kPa"), "101.3 kPa at sea level, about 90 kPa at 1000 m"),
)
_OF_TABLE = "Largest value of the table in the room file. Another value replaces the table"
_SHARES = (
    _Value("Reflectance", "reflectance", 1.0, (0, 1, 2, ""), "Ratio of reflected to incident amplitude, 0 to 1"),
    _Value("Scatter", "scatter", 1.0, (0, 1, 2, ""), "Diffuse share of the reflected sound: 0 mirror, 1 fully diffuse"),
)


class Group(QtWidgets.QGroupBox):
    """A part of the panel with a title and rows."""

    def __init__(self, title: str, change: Change) -> None:
        super().__init__(title)
        self._change = change
        self.rows = QtWidgets.QFormLayout(self)
        self.rows.setFieldGrowthPolicy(QtWidgets.QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene; `room` and `place` are its room and place."""
        raise NotImplementedError

    def _add_name(
        self, what: str, text: str, tip: str, slot: Callable[[], None]
    ) -> tuple[QtWidgets.QLineEdit, QtWidgets.QPushButton]:
        """Add a row with a field for a name, and a button that uses it, as Enter does."""
        field, use = QtWidgets.QLineEdit(placeholderText=what), widgets.button(text, tip, slot)
        field.returnPressed.connect(slot)
        row = QtWidgets.QHBoxLayout()
        row.addWidget(field, stretch=1)
        row.addWidget(use)
        self.rows.addRow(row)
        return field, use

    def _slider(self, value: _Value, set_value: Callable[[float, object], None], tip: str = "") -> widgets.SliderField:
        """Return a slider for a value; `set_value` takes another value and the gesture."""
        slider = widgets.SliderField(*value.limits, tip or value.tip)
        slider.changed.connect(lambda number, gesture: set_value(number / value.per_unit, gesture))
        return slider


class SensorGroup(Group):
    """Position of the sensor and heading of its step 0."""

    def __init__(self, change: Change) -> None:
        super().__init__("Sensor", change)
        self._unit = LengthUnit.M
        self._gesture = object()
        self.along_x, self.along_y = (
            widgets.NumberField(-_FARTHEST, _FARTHEST),
            widgets.NumberField(-_FARTHEST, _FARTHEST),
        )
        self.heading = widgets.NumberField(0.0, 360.0, 1, " °")
        self.heading.setWrapping(True)
        for name, field, changed in (
            ("x", self.along_x, self._move),
            ("y", self.along_y, self._move),
            ("Step 0 at", self.heading, self._turn),
        ):
            field.valueChanged.connect(changed)
            field.editingFinished.connect(self._finish)
            self.rows.addRow(name, field)
        tip = "Save this place in the room under this name"
        self.name, self.save = self._add_name("name of this place", "Save", tip, self._save_place)

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

    @Slot()
    def _finish(self) -> None:
        self._gesture = object()

    @Slot()
    def _move(self) -> None:
        to = self._unit.metres(self.along_x.value()), self._unit.metres(self.along_y.value())
        self._change(partial(edits.sensor_at, position=to), self._gesture)

    @Slot()
    def _turn(self) -> None:
        self._change(partial(edits.sensor_facing, heading=math.radians(self.heading.value())), self._gesture)

    @Slot()
    def _save_place(self) -> None:
        name = self.name.text().strip()
        if name:
            self._change(partial(edits.with_named_place, name=name))
            self.name.clear()


class SurfaceGroup(Group):
    """Name and material of the selected wall or post."""

    chosen = Signal(object)  # name of a wall or post, or None

    def __init__(self, change: Change) -> None:
        super().__init__("Wall or post", change)
        self.surface, self.material = widgets.short_list(), widgets.short_list()
        self.description = widgets.PlainLabel(wordWrap=True)
        self.remove = widgets.button("Remove", "Remove it from the room (Del)", self._remove)
        self._room: Room | None = None
        self._chosen_name = ""  # name of the selected wall or post
        self.rows.addRow("Name", self.surface)
        self.rows.addRow("Material", self.material)
        self.rows.addRow("", self.description)
        self.rows.addRow("", self.remove)
        self.surface.activated.connect(self._choose)
        self.material.textActivated.connect(self._set_material)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        if room is self._room:
            return
        self._room = room
        widgets.show_names(self.surface, room.names, self._chosen_name)
        widgets.show_names(self.material, materials(room), "")
        self._draw_surface(room)

    @Slot(object)
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
            self._change(partial(edits.with_surface_material, surface=number, material=material))

    @Slot()
    def _remove(self) -> None:
        self._change(partial(edits.without_surface, surface=self.surface.currentIndex()))


class MaterialGroup(Group):
    """Two sliders for each material, and a field to add a new one."""

    def __init__(self, change: Change) -> None:
        super().__init__("Materials", change)
        self.sliders: dict[str, tuple[widgets.SliderField, widgets.SliderField]] = {}  # reflectance and scatter
        self._room: Room | None = None
        self._materials: dict[str, Material] = {}
        tip = "Define a material. Assign it under Wall or post"
        self.name, self.add = self._add_name("name of a new material", "Add", tip, self._define)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Draw the materials of the room."""
        if room is not self._room:  # parsing its text takes milliseconds
            self._room, self._materials = room, materials(room)
        if [*self._materials] != [*self.sliders]:
            self._lay_out()
        for name, (reflectance, scatter) in self.sliders.items():
            reflectance.show_value(self._materials[name].largest)
            scatter.show_value(self._materials[name].scatter)

    def _lay_out(self) -> None:
        while self.rows.rowCount() > 1:
            self.rows.removeRow(0)
        self.sliders = {}
        for row, (name, material) in enumerate(self._materials.items()):
            self.rows.insertRow(3 * row, widgets.title_label(name))
            reflectance, scatter = (
                self._slider(value, partial(self._set_share, name, value.key), tip)
                for value, tip in zip(_SHARES, (_OF_TABLE if material.table else "", ""), strict=True)
            )
            self.rows.insertRow(3 * row + 1, _SHARES[0].name, reflectance)
            self.rows.insertRow(3 * row + 2, _SHARES[1].name, scatter)
            self.sliders[name] = reflectance, scatter

    @Slot()
    def _define(self) -> None:
        name = self.name.text().strip()
        if name and name not in self.sliders:
            self._change(partial(edits.with_material_values, material=name))
            self.name.clear()

    def _set_share(self, material: str, share: str, value: float, gesture: object) -> None:
        self._change(partial(edits.with_material_values, material=material, shares={share: value}), gesture)


class AirGroup(Group):
    """Temperature, humidity and pressure of the air."""

    def __init__(self, change: Change) -> None:
        super().__init__("Air", change)
        self.sliders = [self._slider(value, partial(self._set_state, value.key)) for value in _AIR]
        self.temperature, self.humidity, self.pressure = self.sliders
        self.speed = widgets.PlainLabel()
        for value, slider in zip(_AIR, self.sliders, strict=True):
            self.rows.addRow(value.name, slider)
        self.rows.addRow("Speed of sound", self.speed)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        for value, slider in zip(_AIR, self.sliders, strict=True):
            slider.show_value(value.per_unit * getattr(room.air, value.key))
        self.speed.setText(f"{room.air.speed_of_sound:.1f} m/s")

    def _set_state(self, key: str, value: float, gesture: object) -> None:
        self._change(lambda scene: edits.with_air_state(scene, **{key: value}), gesture)


class ModelGroup(Group):
    """The board profile, and the options of receiver, sensor unit and edge diffraction."""

    board_file_requested = Signal()

    def __init__(self, change: Change) -> None:
        super().__init__("Board and model", change)
        self._boards = {name: load_board(name) for name in board_names()}
        self._own: dict[str, Board] = {}  # the board of the log or the command line, if it is not an included one
        self._named = ""  # the shown board's entry in the list
        self.board = widgets.short_list()
        self.board.setToolTip("Profile of the ranging board for the prediction; a log contains its own")
        self.rows.addRow("Board", self.board)
        self.board.textActivated.connect(self._choose_board)
        self.receiver = self._list("Receiver", [*Receiver])
        self.unit = self._list("Sensor unit", [*Unit])
        self.edges = self._list("Edges", [*EdgeStrength])

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Show the values of the scene."""
        self._name_board(shown.scene.board)
        options, board = shown.scene.options, shown.scene.board
        for field, value in (
            (self.receiver, options.receiver_of(board)),
            (self.unit, options.unit),
            (self.edges, options.edge_strength or board.edge_strength),
        ):
            text, tip = _MEANINGS[value]
            field.setCurrentText(text)
            field.setToolTip(tip)

    def _list(self, name: str, values: Sequence[Enum]) -> QtWidgets.QComboBox:
        field = widgets.short_list()
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
        widgets.show_names(self.board, (*self._own, *self._boards, _FROM_FILE), name)

    @Slot(str)
    def _choose_board(self, name: str) -> None:
        if name == _FROM_FILE:
            self.board.setCurrentText(self._named)  # until the file is read
            self.board_file_requested.emit()
            return
        self._change(partial(edits.with_board, board={**self._boards, **self._own}[name]))

    @Slot()
    def _set_options(self) -> None:
        receiver = [*Receiver][self.receiver.currentIndex()]
        unit = [*Unit][self.unit.currentIndex()]
        strength = [*EdgeStrength][self.edges.currentIndex()]
        self._change(partial(edits.with_options, receiver=receiver, unit=unit, edge_strength=strength))


def _show_number(field: widgets.NumberField, value: float) -> None:
    if abs(field.value() - value) >= 10.0 ** -field.decimals() / 2:
        with QSignalBlocker(field):
            field.setValue(value)


class RoomPanel(QtWidgets.QWidget):
    """Shows and edits the values of the room that cannot be edited in the plan."""

    edited = Signal(object, str, object)  # Scene, label for Undo, gesture

    def __init__(self) -> None:
        super().__init__()
        self._shown: Shown | None = None
        self.refused = widgets.PlainLabel(wordWrap=True)
        self.refused.hide()
        self.sensor, self.surface = SensorGroup(self.change), SurfaceGroup(self.change)
        self.materials, self.air = MaterialGroup(self.change), AirGroup(self.change)
        self.model = ModelGroup(self.change)
        self.groups: tuple[Group, ...] = (self.sensor, self.surface, self.materials, self.air, self.model)
        widgets.stacked(self, self.refused, *self.groups, None)

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if before is None or before.scene is not shown.scene or before.look != shown.look:
            self._draw(shown)

    def change(self, edit: Callable[[Scene], edits.Edit], gesture: object = None) -> None:
        """Apply an edit to the shown scene, or show why it is rejected."""
        if self._shown is None:
            return
        try:
            scene, label = edit(self._shown.scene)
        except InputError as error:
            self.refused.setText(f"⚠ {error}")
            self.refused.show()
            self._draw(self._shown)  # restore the fields
            return
        self.refused.hide()
        self.edited.emit(scene, label, gesture)

    def _draw(self, shown: Shown) -> None:
        room, place = shown.scene.room, shown.scene.place
        for group in self.groups:
            group.setEnabled(room is not None)
            if room is not None and place is not None:
                group.draw(shown, room, place)
