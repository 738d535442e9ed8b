"""The panel "Scans": scans drawn over the one shown, each with colour and eye, and the two that are compared."""

import pyqtgraph as pg
from PySide6.QtCore import QPointF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QColor, QIcon, QPainter, QPen, QPixmap
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QGridLayout,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from sonarhw_gui.look.palette import OVERLAYS
from sonarhw_gui.parts.plain_label import PlainLabel, plain_tip
from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus
from sonarhw_gui.shown.overlaid_scan import SHOWN, OverlaidScan, ScanPair
from sonarhw_gui.shown.shown import Shown

_ICON = 16  # pixels
_HINT = "Add a log, or keep this scan and make another: both are drawn in the plan and in the ranges."


class ScansPanel(QWidget):
    """Lists the scans."""

    add_requested = Signal()
    kept = Signal()
    sweeps_kept = Signal()
    removed = Signal(int)
    switched = Signal(int, bool)
    pair_chosen = Signal(int, int)

    def __init__(self) -> None:
        super().__init__()
        self._filling = False
        self.add, self.keep = QPushButton("Add log…"), QPushButton("Keep this scan")
        self.sweeps, self.remove = QPushButton("Keep sweeps"), QPushButton("Remove")
        self.keep.setToolTip("Add the readings shown now; they stay when another scan is shown")
        self.sweeps.setToolTip("Add each sweep of the readings shown as a scan of its own")
        self.list = QListWidget()
        self.list.setAccessibleName("Scans drawn over the one shown")
        self.list.setIconSize(QSize(_ICON, _ICON))
        self.first, self.second = QComboBox(), QComboBox()
        for box in (self.first, self.second):
            ignore_wheel_without_focus(box)
            box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.activated.connect(self._choose_pair)
        self.note = PlainLabel(_HINT, wordWrap=True)
        self._arrange()
        self.add.clicked.connect(self.add_requested)
        self.keep.clicked.connect(self.kept)
        self.sweeps.clicked.connect(self.sweeps_kept)
        self.remove.clicked.connect(self._remove)
        self.list.itemChanged.connect(self._switch)
        self.list.currentRowChanged.connect(self._enable)
        self.show_scans((), None)

    def show_state(self, shown: Shown) -> None:
        """Enable what is possible with the readings shown."""
        self.keep.setEnabled(bool(shown.readings))
        self.sweeps.setEnabled(bool(shown.readings) and shown.readings[-1].sweep != shown.readings[0].sweep)

    @Slot(object, object)
    def show_scans(self, scans: tuple[OverlaidScan, ...], pair: ScanPair | None) -> None:
        """List the scans."""
        self._filling = True
        row = self.list.currentRow()
        self.list.clear()
        for scan in scans:
            item = QListWidgetItem(_icon(scan.style), scan.name)
            item.setToolTip(plain_tip(f"{scan.name}: {len(scan.series.ranges)} readings"))
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Checked if scan.visible else Qt.CheckState.Unchecked)
            self.list.addItem(item)
        self.list.setCurrentRow(min(max(row, 0), len(scans) - 1))
        chosen_pair = (SHOWN, SHOWN) if pair is None else (pair.first, pair.second)
        for box, chosen in zip((self.first, self.second), chosen_pair, strict=True):
            box.clear()
            box.addItem("scan shown", SHOWN)
            for number, scan in enumerate(scans):
                box.addItem(_icon(scan.style), scan.name, number)
            box.setCurrentIndex(box.findData(chosen))
            box.setEnabled(bool(scans))
        self._filling = False
        self._enable()

    def _arrange(self) -> None:
        buttons = QGridLayout()
        for number, button in enumerate((self.add, self.keep, self.sweeps, self.remove)):
            buttons.addWidget(button, number // 2, number % 2)
        pair = QFormLayout()
        pair.addRow("First", self.first)
        pair.addRow("Second", self.second)
        column = QVBoxLayout(self)
        column.addLayout(buttons)
        column.addWidget(self.list, stretch=1)
        column.addLayout(pair)
        column.addWidget(self.note)

    @Slot()
    def _enable(self) -> None:
        self.remove.setEnabled(self.list.currentRow() >= 0)
        self.note.setText("The view Differences shows the second scan minus the first." if self.list.count() else _HINT)

    @Slot()
    def _remove(self) -> None:
        self.removed.emit(self.list.currentRow())

    @Slot(QListWidgetItem)
    def _switch(self, item: QListWidgetItem) -> None:
        if not self._filling:
            self.switched.emit(self.list.row(item), item.checkState() is Qt.CheckState.Checked)

    @Slot()
    def _choose_pair(self) -> None:
        self.pair_chosen.emit(self.first.currentData(), self.second.currentData())


def _icon(style: int) -> QIcon:
    """Return the mark of a scan as an icon."""
    overlay = OVERLAYS[style]
    picture = QPixmap(_ICON, _ICON)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    pen = QPen(QColor(overlay.colour), 0.14)
    painter.translate(QPointF(_ICON / 2, _ICON / 2))
    painter.scale(_ICON - 5, _ICON - 5)
    painter.setPen(pen)
    painter.drawPath(pg.graphicsItems.ScatterPlotItem.Symbols[overlay.symbol])
    painter.end()
    return QIcon(picture)
