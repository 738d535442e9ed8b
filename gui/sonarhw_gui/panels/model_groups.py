"""Groups of the room panel about the sound model: the air, the board, and the options of the prediction."""

from collections.abc import Sequence
from enum import Enum
from functools import partial

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QComboBox
from sonarhw_sim.air import EdgeStrength, Receiver, Unit
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.room.room import Place, Room

from sonarhw_gui.panels.room_groups import Change, Group
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.parts.short_list import short_list, show_names
from sonarhw_gui.parts.slider_field import SliderField
from sonarhw_gui.scene.scene_edit import with_air_state, with_board, with_options
from sonarhw_gui.shown.shown import Shown


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
