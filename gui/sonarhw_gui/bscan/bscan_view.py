"""The view "B-scan": heading by range as an image, measured, predicted and their difference, flat or polar.

`work/bscan_picture.py` computes the images in a worker thread; this view displays them.
"""

import math
from functools import partial
from weakref import ref

import numpy as np
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QMargins, QPointF, QRectF, Qt, Slot
from PySide6.QtGui import QActionGroup, QHideEvent, QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from sonarhw_compare.pictures import RangeCells
from sonarhw_compare.scans import heading_text

from sonarhw_gui.bscan.bscan_pane import BScanPane
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.flow_layout import FlowLayout
from sonarhw_gui.plots.canvas import Canvas
from sonarhw_gui.plots.view_actions import add_buttons, view_action
from sonarhw_gui.shown.initial_range import initial_range
from sonarhw_gui.shown.shown import Cursor, Shown
from sonarhw_gui.view import Gestures, ViewEntry
from sonarhw_gui.work.bscan_picture import BScans, BScanSettings, Pane

_CHOICES = (
    ("Recorded", "F2", (Pane.MEASURED,), "Traces of the scan"),
    ("Predicted", "F3", (Pane.PREDICTED,), "Traces that the model predicts"),
    ("Difference", "F4", (Pane.DIFFERENCE,), "Recorded minus predicted"),
    ("All three", "Shift+F4", tuple(Pane), "Recorded, predicted and difference, with common pan and zoom"),
)


class BScanView(QWidget):
    """Draws the traces of all headings as images."""

    entry = ViewEntry("B-scan", "Heading by range as an image", key="3", menu="Trace")

    def __init__(self) -> None:
        super().__init__()
        self.gestures = Gestures(self)
        self._shown: Shown | None = None
        self._drawn: ref[BScans] | None = None
        self._laid_out: BScanSettings | None = None
        self._zoomed = False  # whether the zoom was set for these images
        self._cells: RangeCells | None = None
        self._frame: QRectF | None = None  # what is visible at least; more where a pane has other proportions
        self.choices = QActionGroup(self)
        for name, key, panes, tip in _CHOICES:
            choice = view_action(self, name, key, tip)
            choice.setData(panes)
            self.choices.addAction(choice)
        self.choices.actions()[0].setChecked(True)
        self._settled = False  # whether there were readings, or the user has chosen
        self.polar = view_action(self, "Polar", "O", "Polar, over the room; off: heading by range")
        self.decibels = view_action(self, "dB", "B", "Levels in dB of full scale; off: linear")
        self.decibels.setChecked(True)
        self.note = ElidedLabel()
        self.canvas = Canvas()
        self.panes: dict[Pane, BScanPane] = {}  # each is created when first visible
        self._arrange()
        self._connect()

    @property
    def settings(self) -> BScanSettings:
        """The selected panes, coordinates and scale."""
        return BScanSettings(self.choices.checkedAction().data(), self.polar.isChecked(), self.decibels.isChecked())

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, "look"):
            self.canvas.set_look(shown.look)
            for pane in self.panes.values():
                pane.set_look(shown.look)
            self._make_panes(shown.look)
            self._lay_out()
            self._drawn = None
        if self.isVisible():
            self._choose_pane(shown)
            self._draw(shown)

    @Slot()
    def fit(self) -> None:
        """Show all of the images."""
        self._fit(None)

    def _fit(self, limit: float | None) -> None:
        for kind in self.settings.panes:
            if kind in self.panes:
                self._frame = self.panes[kind].fit(limit)

    def _keep_frame(self, pane: BScanPane, *_: object) -> None:
        """Remember what the user has zoomed to."""
        self._frame = pane.plot.vb.viewRect()

    def showEvent(self, event: QShowEvent) -> None:
        """Request the images, now that the view is visible."""
        if self._shown is None or not self._choose_pane(self._shown):
            self.gestures.bscan_requested.emit(self.settings)
        if self._shown is not None:
            self._draw(self._shown)

    def hideEvent(self, event: QHideEvent) -> None:
        """Cancel the request; hidden images are not computed."""
        self.gestures.bscan_requested.emit(None)

    def picture(self) -> QWidget:
        """Return the images with their buttons."""
        return self

    def _arrange(self) -> None:
        bar = QWidget()
        add_buttons(FlowLayout(bar, QMargins(8, 4, 8, 2), gap=3), (*self.choices.actions(), self.polar, self.decibels))
        self.note.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.note.setContentsMargins(8, 0, 8, 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(bar)
        column.addWidget(self.canvas, stretch=1)
        column.addWidget(self.note)

    def _connect(self) -> None:
        self.choices.triggered.connect(self._settle)
        for chosen in (self.choices, self.polar, self.decibels):
            chosen.triggered.connect(self._request_bscan)
        self.canvas.clicked.connect(self._click)
        self.canvas.hovered.connect(self._point_at)

    @Slot()
    def _settle(self) -> None:
        self._settled = True

    def _choose_pane(self, shown: Shown) -> bool:
        """Show the prediction of a room until there are readings or the user chooses; return whether that is new."""
        if self._settled:
            return False
        self._settled = bool(shown.readings)
        recorded, predicted, *_ = self.choices.actions()
        choice = predicted if shown.scene.room is not None and not shown.readings else recorded
        if choice.isChecked():
            return False
        choice.setChecked(True)
        self._request_bscan()
        return True

    @Slot()
    def _request_bscan(self) -> None:
        if self._shown is not None:
            self._make_panes(self._shown.look)
            self._lay_out()
        self._drawn = None
        self.gestures.bscan_requested.emit(self.settings)

    def _make_panes(self, look: Look) -> None:
        for kind in self.settings.panes:
            if kind not in self.panes:
                self.panes[kind] = pane = BScanPane(kind)
                pane.set_look(look)
                pane.plot.vb.sigRangeChangedManually.connect(partial(self._keep_frame, pane))

    def _lay_out(self) -> None:
        """Arrange flat images in one column and polar images in two, with common pan and zoom."""
        settings, before = self.settings, self._laid_out
        first = self.panes[settings.panes[0]]
        if before is None or before.polar != settings.polar:
            self._zoomed, self._frame = False, None
        self._laid_out = settings
        self.canvas.clear()
        for number, kind in enumerate(settings.panes):
            pane = self.panes[kind]
            row, column = divmod(number, 2 if settings.polar else 1)
            self.canvas.addItem(pane.plot, row=row, col=column)
            pane.set_axes(settings.polar, len(settings.panes), kind is settings.panes[-1])
            pane.plot.setXLink(None if pane is first else first.plot)
            pane.plot.setYLink(None if pane is first else first.plot)
        if self._frame is not None:
            self.canvas.ci.layout.activate()  # the new size decides how much is visible around the frame
            first.plot.vb.setRange(self._frame, padding=0)

    def _draw(self, shown: Shown) -> None:
        bscan = shown.bscan
        if bscan is not None and bscan.settings == self.settings and shown.bscan_ref is not self._drawn:
            for kind in bscan.settings.panes:
                self.panes[kind].draw(bscan, shown)
            if not self._zoomed or self._cells != bscan.rows.cells:
                self._zoomed, self._cells = True, bscan.rows.cells
                self._fit(initial_range(shown))
            self._drawn = shown.bscan_ref
        self.note.setText(_cursor_text(bscan, shown) or _note(bscan, self.settings, bool(shown.readings)))
        for kind in self.settings.panes:
            self.panes[kind].point(shown)

    def _click(self, event: MouseClickEvent) -> None:
        place = self._cursor_under(event.scenePos())
        if self._shown is None or place is None:
            return
        index = reading_along(self._shown, place.heading)
        if index is not None:
            event.accept()
            self.gestures.picked.emit(index)

    @Slot(object)
    def _point_at(self, position: QPointF | None) -> None:
        self.gestures.pointed.emit(None if position is None else self._cursor_under(position))

    def _cursor_under(self, position: QPointF) -> Cursor | None:
        for kind in self.settings.panes:
            place = self.panes[kind].cursor_at(position)
            if place is not None:
                return place
        return None


def reading_along(shown: Shown, heading: float) -> int | None:
    """Return the newest of the readings nearest to `heading`, rad; None without readings."""
    if not shown.readings:
        return None
    zero = shown.scene.pose.heading
    angles = shown.scene.board.turned(np.array([reading.angle for reading in shown.readings]))
    apart = np.abs(np.angle(np.exp(1j * (zero + angles - heading))))
    nearest = np.flatnonzero(apart <= apart.min() + 1e-6)
    return int(nearest[-1])


def _cursor_text(bscan: BScans | None, shown: Shown) -> str:
    """Return measured and predicted level at the cursor; empty without a cursor."""
    cursor = shown.cursor
    if bscan is None or cursor is None:
        return ""
    texts = [f"{heading_text(cursor.heading)}, {shown.look.unit.text(cursor.range)}:"]
    for name, image in ((shown.origin.value, bscan.measured), ("predicted", bscan.predicted)):
        level = image.level_at(cursor.heading, cursor.range)
        if level is not None:
            texts.append(f"{name} {_decibels(level)}")
    return "  ".join(texts) if len(texts) > 1 else ""


def _decibels(level: float) -> str:
    return f"{20 * math.log10(level):.0f} dB".replace("-", "−") if level > 0 else "silent"


def _note(bscan: BScans | None, settings: BScanSettings, scanned: bool) -> str:
    if bscan is None:
        return "computing …"
    notes = []
    if Pane.MEASURED in settings.panes and not scanned:
        notes.append("no readings")
    elif Pane.MEASURED in settings.panes and not bscan.rows.traced and len(bscan.measured.headings):
        notes.append("no traces recorded: marks show the reported ranges, without a level")
    if Pane.DIFFERENCE in settings.panes and not bscan.rows.traced:
        notes.append("no difference: it needs recorded traces")
    if bscan.rows.outline is None:
        notes.append("no prediction")
    if bscan.rows.done < 1:
        notes.append(f"{bscan.rows.done:.0%} computed")
    return " · ".join(notes)
