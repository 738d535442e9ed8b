"""Groups of the room panel about sound: the air it goes through, how it is followed and received.

Each takes what is shown and hands on edits through the function that it is given.
"""

from collections.abc import Sequence
from enum import Enum
from functools import partial

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QComboBox, QLabel
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.choices import EdgeStrength, Receiver, Unit
from sonarhw_sim.room.model import Place, Room

from sonarhw_gui.panels.room_groups import Change, Group, short_list, show_names
from sonarhw_gui.parts.slider_field import SliderField
from sonarhw_gui.scene.scene_edit import with_air_state, with_board, with_options
from sonarhw_gui.shown.shown import Shown


class AirGroup(Group):
    """What the sound goes through."""

    def __init__(self, change: Change) -> None:
        super().__init__("Air", change)
        self.temperature = SliderField(-40, 60, 1, " °C", "The warmer the air, the faster sound: 0.18 % a degree")
        self.humidity = SliderField(0, 100, 0, " %", "Relative humidity: how much the air takes of ultrasound")
        self.pressure = SliderField(30, 120, 1, " kPa", "101.3 kPa at the sea, about 90 kPa at 1000 m")
        self.speed = QLabel()
        rows = (("Temperature", self.temperature), ("Humidity", self.humidity), ("Pressure", self.pressure))
        for name, slider in rows:
            self.rows.addRow(name, slider)
        self.temperature.changed.connect(self._warm)
        self.humidity.changed.connect(self._moisten)
        self.pressure.changed.connect(self._press)
        self.rows.addRow("Speed of sound", self.speed)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Draw it."""
        air = room.air
        self.temperature.show_value(air.temperature_c)
        self.humidity.show_value(100 * air.relative_humidity)
        self.pressure.show_value(air.pressure_kpa)
        self.speed.setText(f"{air.speed_of_sound:.1f} m/s")

    @Slot(float, object)
    def _warm(self, celsius: float, gesture: object) -> None:
        self._change(partial(with_air_state, temperature_c=celsius), gesture)

    @Slot(float, object)
    def _moisten(self, percent: float, gesture: object) -> None:
        self._change(partial(with_air_state, relative_humidity=percent / 100), gesture)

    @Slot(float, object)
    def _press(self, kilopascals: float, gesture: object) -> None:
        self._change(partial(with_air_state, pressure_kpa=kilopascals), gesture)


_MEANINGS: dict[Enum, tuple[str, str]] = {
    Receiver.FIRST_ECHO: ("first echo", "The first echo over the threshold, at its true range, as the paper has it"),
    Receiver.BOARD: ("board", "What the ranging board makes of the signal: gain steps, integration, re-arming"),
    Unit.PASS: ("lets sound pass", "Sound that comes back to the unit goes on as if it were not there"),
    Unit.BLOCK: ("stops sound", "Sound that meets the face of the transducer ends there"),
    Unit.REFLECT: (
        "reflects sound",
        "Sound that meets the face of the transducer is thrown back; takes long to predict",
    ),
    EdgeStrength.PAPER: ("as in the paper", "An edge bends sound alike in all directions"),
    EdgeStrength.KELLER: ("after Keller", "An edge bends sound by the angles to its faces"),
}


_FROM_FILE = "From file…"


class ModelGroup(Group):
    """Which board sends and hears, and how echoes are followed and received."""

    board_file_wanted = Signal()

    def __init__(self, change: Change) -> None:
        super().__init__("Hearing", change)
        self._boards = {name: load_board(name) for name in board_names()}
        self._own: dict[str, Board] = {}  # what the scan or the command line brought, beside those that ship
        self._named = ""  # the board shown, as the list has it
        self.board = short_list()
        self.board.setToolTip("The profile of the ranging board that is predicted; a log brings its own")
        self.rows.addRow("Board", self.board)
        self.board.textActivated.connect(self._take_board)
        self.receiver = self._list("Receiver", [*Receiver])
        self.unit = self._list("The unit", [*Unit])
        self.edges = self._list("Edges", [*EdgeStrength])

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Draw it."""
        self._name_board(shown.scene.board)
        options = shown.scene.options
        for field, value in (
            (self.receiver, options.receiver),
            (self.unit, options.unit),
            (self.edges, options.edge_strength),
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
        field.activated.connect(self._hear)
        return field

    def _name_board(self, board: Board) -> None:
        name = board.name
        if self._boards.get(name) != board:
            name = f"{name}, changed" if name in self._boards else name
            self._own = {name: board}
        self._named = name
        show_names(self.board, (*self._own, *self._boards, _FROM_FILE), name)

    @Slot(str)
    def _take_board(self, name: str) -> None:
        if name == _FROM_FILE:
            self.board.setCurrentText(self._named)  # until there is another one
            self.board_file_wanted.emit()
            return
        self._change(partial(with_board, board={**self._boards, **self._own}[name]))

    @Slot()
    def _hear(self) -> None:
        receiver = [*Receiver][self.receiver.currentIndex()]
        unit = [*Unit][self.unit.currentIndex()]
        strength = [*EdgeStrength][self.edges.currentIndex()]
        self._change(partial(with_options, receiver=receiver, unit=unit, edge_strength=strength))
