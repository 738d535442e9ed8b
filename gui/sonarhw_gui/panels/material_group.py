"""The materials of the room: how much of an echo each leaves, and how much of that it scatters.

Takes what is shown; hands on edits through the function that it is given.
"""

from functools import partial

from PySide6.QtCore import Slot
from PySide6.QtWidgets import QHBoxLayout, QLabel, QLineEdit, QPushButton
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.room_file import Material
from sonarhw_sim.room.room_writing import materials

from sonarhw_gui.panels.room_groups import Change, Group
from sonarhw_gui.parts.amount import Amount
from sonarhw_gui.scene.scene_edit import with_material_values
from sonarhw_gui.shown.shown import Shown


class MaterialGroup(Group):
    """Two amounts a material, and a line for a new one."""

    def __init__(self, change: Change) -> None:
        super().__init__("Materials", change)
        self.amounts: dict[str, tuple[Amount, Amount]] = {}  # reflectance and scatter
        self._room: Room | None = None
        self._known: dict[str, Material] = {}
        self.name = QLineEdit(placeholderText="name of a new material")
        self.add = QPushButton("Add")
        self.add.setToolTip("Define a material; a wall takes it under Wall or post")
        last = QHBoxLayout()
        last.addWidget(self.name, stretch=1)
        last.addWidget(self.add)
        self.rows.addRow(last)
        self.add.clicked.connect(self._define)
        self.name.returnPressed.connect(self._define)

    def draw(self, shown: Shown, room: Room, place: Place) -> None:
        """Draw them."""
        if room is not self._room:  # its text takes milliseconds to read
            self._room, self._known = room, materials(room)
        known = self._known
        if [*known] != [*self.amounts]:
            self._lay_out(known)
        for name, (reflectance, scatter) in self.amounts.items():
            reflectance.show_value(known[name].reflectance)
            scatter.show_value(known[name].scatter)

    def _lay_out(self, known: dict[str, Material]) -> None:
        while self.rows.rowCount() > 1:
            self.rows.removeRow(0)
        self.amounts = {}
        for row, name in enumerate(known):
            reflectance = Amount(0, 1, 2, "", "What is left of the amplitude of an echo: 0 nothing, 1 all of it")
            scatter = Amount(0, 1, 2, "", "How much of what is left goes in all directions: 0 a mirror, 1 all of it")
            self.amounts[name] = reflectance, scatter
            reflectance.changed.connect(self._coat)
            scatter.changed.connect(self._coat)
            title = QLabel(name)
            title.setStyleSheet("font-weight: bold")
            self.rows.insertRow(3 * row, title)
            self.rows.insertRow(3 * row + 1, "Reflectance", reflectance)
            self.rows.insertRow(3 * row + 2, "Scatter", scatter)

    @Slot()
    def _define(self) -> None:
        name = self.name.text().strip()
        if name and name not in self.amounts:
            self._change(partial(with_material_values, material=name))
            self.name.clear()

    @Slot(float, object)
    def _coat(self, value: float, gesture: object) -> None:
        for name, amounts in self.amounts.items():
            for share, amount in zip(("reflectance", "scatter"), amounts, strict=True):
                if amount is self.sender():
                    self._change(partial(with_material_values, material=name, shares={share: value}), gesture)
                    return
