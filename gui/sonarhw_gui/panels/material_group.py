"""The group "Materials" of the room panel: reflectance and scatter of each material."""

from functools import partial

from PySide6.QtCore import Slot
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QPushButton
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.room.room_file import Material
from sonarhw_sim.room.room_writing import materials

from sonarhw_gui.panels.room_groups import Change, Group
from sonarhw_gui.parts.plain_label import TitleLabel
from sonarhw_gui.parts.slider_field import SliderField
from sonarhw_gui.scene.scene_edit import with_material_values
from sonarhw_gui.shown.shown import Shown


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
