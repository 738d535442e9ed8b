"""The device panel: connection, identity, turntable, scan settings and link quality of the scanner."""

import math
from dataclasses import replace

from PySide6 import QtWidgets
from PySide6.QtCore import QSignalBlocker, Qt, Slot
from PySide6.QtGui import QAction

from sonarhw.errors import InputError
from sonarhw.readings import ScanOrder
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session.scanner import Live
from sonarhw_gui.session.status import (
    Status,
    angle_text,
    identity_text,
    link_figures,
    order_of_sector,
    scan_summary,
    state_text,
    temperature_text,
)
from sonarhw_gui.widgets import NumberField, PlainLabel, beside, button, ignore_wheel_without_focus, stacked
from sonarhw_gui.window.commands import Commands

_FARTHEST = 720.0  # degrees, limit of the cable
_MOST_SWEEPS, _MOST_PINGS = 10_000, 100
_LONGEST = 30.0  # m


class DevicePanel(QtWidgets.QWidget):
    """Shows the state of the scanner and controls it."""

    def __init__(self, commands: Commands, live: Live) -> None:
        super().__init__()
        self._live = live
        self._status = Status()
        self._look = Look()
        self.state, self.hint, self.identity = PlainLabel(), PlainLabel(wordWrap=True), PlainLabel(wordWrap=True)
        self.temperature, self.angle, self.summary = PlainLabel(), PlainLabel(), PlainLabel(wordWrap=True)
        tip = "Connect and read the scanner's identity; the turntable does not move"
        self.connect_button = button("Connect", tip, live.connect)
        tip = "Stop and release the port for other programs"
        self.disconnect_button = button("Disconnect", tip, live.disconnect)
        self.identity.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.target = _degrees(0.0, "Target angle of the turntable; press Enter to turn")
        self.turn = button("Turn", "Turn to this angle; home first if the zero is unknown", self._turn)
        self.start, self.end = _degrees(0.0, "Start of the sector"), _degrees(360.0, "End of the sector, excluded")
        self.step = _degrees(5.0, "Angle from one heading to the next", lowest=0.01, decimals=2)
        self.sweeps = _count(_MOST_SWEEPS, "Number of passes over the sector, in alternate directions")
        self.pings = _count(_MOST_PINGS, "Readings at each heading")
        self.max_range = NumberField(0.0, _LONGEST)
        self.max_range.setToolTip("Ignore echoes beyond this range; lowest value: the board's maximum range")
        self.max_range.setSpecialValueText("maximum")
        self.traces = QtWidgets.QCheckBox("Record traces")
        self.traces.setToolTip("Record the received signal of each ping, about 3 kB per reading")
        self.endless = QtWidgets.QCheckBox("Sweep until Stop")
        self.endless.setToolTip("Sweep after sweep, in alternate directions, as a radar does")
        self.figures = [PlainLabel() for _ in link_figures(None)]
        self._fields = self.start, self.end, self.step, self.sweeps, self.pings, self.max_range
        self._turntable = self._made_turntable(commands)
        self._scan = self._made_scan(commands)
        self._lay_out(commands)
        self._connect()

    def show_state(self, shown: Shown) -> None:
        """Apply a changed look."""
        if shown.look != self._look:
            self._look = shown.look
            self._show_settings()
            self._show_summary()

    def show_status(self, status: Status) -> None:
        """Show the status and enable the possible actions."""
        before, self._status = self._status, status
        self.state.setText(state_text(status))
        self.state.setToolTip(status.trouble)
        self.hint.setText(_hint(status))
        self.hint.setVisible(bool(self.hint.text()))
        self.identity.setText(identity_text(status.link))
        self.temperature.setText(temperature_text(status))
        self.angle.setText(angle_text(status.job.angle))
        for label, (_, figure, _) in zip(self.figures, link_figures(status.link), strict=True):
            label.setText(figure)
        self.connect_button.setEnabled(status.can_turn and status.link is None)
        self.disconnect_button.setEnabled(status.link is not None)
        obeys = status.link is None or status.link.takes_orders
        self._turntable.setEnabled(status.can_turn and obeys)
        for field in (self.start, self.end, self.step, self.pings, self.traces):
            field.setEnabled(obeys)
        self._scan.setEnabled(status.can_scan)
        if before.settings != status.settings:
            self._show_settings()
        self._show_summary()

    # layout

    def _made_turntable(self, commands: Commands) -> QtWidgets.QGroupBox:
        group = QtWidgets.QGroupBox("Turntable")
        row = QtWidgets.QHBoxLayout()
        row.addWidget(_button(commands.home))
        row.addWidget(self.target, 1)
        row.addWidget(self.turn)
        form = QtWidgets.QFormLayout(group)
        form.addRow("Angle", self.angle)
        form.addRow(row)
        return group

    def _made_scan(self, commands: Commands) -> QtWidgets.QGroupBox:
        group = QtWidgets.QGroupBox("Scan")
        grid = QtWidgets.QGridLayout(group)
        fields = {"From": self.start, "to": self.end, "Step": self.step, "Pings": self.pings, "Sweeps": self.sweeps}
        for place, (name, field) in enumerate([*fields.items(), ("Range", self.max_range)]):
            row, column = divmod(place, 2)
            label = PlainLabel(name)
            label.setBuddy(field)
            grid.addWidget(label, row, 2 * column)
            grid.addWidget(field, row, 2 * column + 1)
        for column in (1, 3):
            grid.setColumnStretch(column, 1)
        grid.addWidget(self.traces, 3, 0, 1, 2)
        grid.addWidget(self.endless, 3, 2, 1, 2)
        grid.addWidget(self.summary, 4, 0, 1, 4)
        grid.addWidget(_button(commands.scan), 5, 0, 1, 4)
        return group

    def _lay_out(self, commands: Commands) -> None:
        head = QtWidgets.QGroupBox("Scanner")
        form = QtWidgets.QFormLayout(head)
        form.addRow(self.state)
        form.addRow(self.hint)
        form.addRow(beside(self.connect_button, self.disconnect_button))
        form.addRow("Identity", self.identity)
        form.addRow("Air", self.temperature)
        link = QtWidgets.QGroupBox("Link")
        figures = QtWidgets.QFormLayout(link)
        for label, (name, _, meaning) in zip(self.figures, link_figures(None), strict=True):
            label.setToolTip(meaning)
            figures.addRow(name, label)
        stacked(self, head, _button(commands.stop), self._turntable, self._scan, link, None)

    def _connect(self) -> None:
        # only on Enter: `editingFinished` is emitted when the focus leaves, too
        self.target.lineEdit().returnPressed.connect(self._turn)
        for field in self._fields:
            field.valueChanged.connect(self._send_settings)
        self.traces.toggled.connect(self._send_settings)
        self.endless.toggled.connect(self._send_settings)

    # input

    @Slot()
    def _turn(self) -> None:
        self._live.turn(math.radians(self.target.value()))

    @Slot()
    def _send_settings(self) -> None:
        scan_settings, order = self._status.settings, self._show_summary()
        if scan_settings is not None and order is not None:
            limit = self.max_range.value()
            max_range = None if limit == self.max_range.minimum() else self._look.unit.metres(limit)
            chosen = replace(scan_settings, order=order, traces=self.traces.isChecked(), max_range=max_range)
            self._live.settings = replace(chosen, until_stopped=self.endless.isChecked())

    # display

    def _show_settings(self) -> None:
        """Fill the fields from the scan settings. Fields that describe this scan already keep the typed text."""
        unit = self._look.unit
        blocked = [QSignalBlocker(field) for field in (*self._fields, self.traces, self.endless)]
        self.max_range.setRange(0.0, unit.of(_LONGEST))
        self.max_range.setSuffix(f" {unit.label}")
        self.max_range.setSingleStep(unit.of(0.5))
        scan_settings = self._status.settings
        if scan_settings is not None:
            self.max_range.setValue(0.0 if scan_settings.max_range is None else unit.of(scan_settings.max_range))
            self.traces.setChecked(scan_settings.traces)
            self.endless.setChecked(scan_settings.until_stopped)
            if not self._has_order(scan_settings.order):
                self._fill(scan_settings.order)
        for block in blocked:
            block.unblock()

    def _fill(self, order: ScanOrder) -> None:
        start, step = math.degrees(order.start), math.degrees(order.step)
        self.start.setValue(start)
        self.end.setValue(start + order.headings * step)
        self.step.setValue(abs(step))
        self.sweeps.setValue(order.sweeps)
        self.pings.setValue(order.pings)

    def _order(self) -> ScanOrder:
        """Return the order in the fields. Raises InputError if it is impossible."""
        angles = self.start.value(), self.end.value(), self.step.value()
        return order_of_sector(*angles, self.sweeps.value(), self.pings.value())

    def _has_order(self, order: ScanOrder) -> bool:
        try:
            return self._order() == order
        except InputError:
            return False

    def _show_summary(self) -> ScanOrder | None:
        """Show a summary of the scan and return its order; None if the settings are invalid."""
        try:
            order = self._order()
        except InputError as error:
            self.summary.setText(f"⚠ {error}")
            return None
        endless = self.endless.isChecked()
        self.sweeps.setEnabled(not endless)
        self.summary.setText(scan_summary(order, self._status.link, endless))
        return order


def _hint(status: Status) -> str:
    """Return why actions are disabled, and what to do."""
    if status.replay is not None:
        return "A log is shown. Leave the replay (Ctrl+W) to turn the scanner. A scan closes the log."
    if not status.chosen:
        return "Choose a scanner with Connect (Ctrl+K), or start with “sonarhw gui PORT”."
    return ""


def _button(action: QAction) -> QtWidgets.QPushButton:
    made = button(f"{action.text()}   {action.shortcut().toString()}", action.toolTip(), action.trigger)
    made.setEnabled(action.isEnabled())
    action.enabledChanged.connect(made.setEnabled)
    return made


def _degrees(value: float, tip: str, lowest: float = -_FARTHEST, decimals: int = 1) -> NumberField:
    field = NumberField(lowest, _FARTHEST, decimals, "°")
    field.setValue(value)
    field.setToolTip(tip)
    return field


def _count(most: int, tip: str) -> QtWidgets.QSpinBox:
    field = QtWidgets.QSpinBox(minimum=1, maximum=most)
    field.setKeyboardTracking(False)
    field.setToolTip(tip)
    ignore_wheel_without_focus(field)
    return field
