"""The panel "Find the room": searches the room that the loaded scans show, lists its walls, and plans the next scan.

A click on a wall highlights it in the plan, with the readings that speak for and against it.
"""

from dataclasses import replace

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QGridLayout,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)
from sonarhw_compare.edits import remove_surface
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError, counted
from sonarhw_gui.finding.find_control import FindState
from sonarhw_gui.finding.find_request import ACCURACIES, Accuracy, LoadedScan
from sonarhw_gui.finding.found_marks import drawing_of, next_text, poses_text, row_texts
from sonarhw_gui.finding.loaded_scans import loaded_scans, share_readings
from sonarhw_gui.parts.plain_label import PlainLabel, plain_tip
from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus
from sonarhw_gui.scene.scene import first_place
from sonarhw_gui.scene.scene_edit import with_room
from sonarhw_gui.shown.shown import Shown

ACCEPTING, REJECTING = "accepting the found room", "rejecting"  # labels of Undo
_HINT = (
    "Finds walls and posts that explain all echoes of the scan shown and of the visible scans of the panel Scans "
    "(F12). This takes seconds to minutes."
)
_ELSEWHERE = "These walls were found while another room was shown, so they are not drawn in this one."
_KEY = "Rings in the plan: echoes that speak for the selected wall. Crosses: against it. Silence counts too."


class FindPanel(QWidget):
    """Starts the search, lists what it has found, and passes on what the user decides."""

    requested = Signal(object)  # Accuracy
    continued = Signal(object)  # Accuracy
    cancelled = Signal()
    rejected = Signal(int)  # row of the list
    edited = Signal(object, str, object)  # Scene, label for Undo, gesture
    accepted = Signal()
    next_requested = Signal()
    drawn = Signal(object)  # FoundDrawing, or None

    def __init__(self) -> None:
        super().__init__()
        self._shown: Shown | None = None
        self._state = FindState()
        self._room: Room | None = None  # the accepted one, while it is the room of the window
        self.scans, self.places = PlainLabel(wordWrap=True), QComboBox()
        for accuracy in ACCURACIES:
            self.places.addItem(accuracy.text)
        self.places.setToolTip("How well the places of the scans are known; those of logs without a room are unknown")
        ignore_wheel_without_focus(self.places)
        self.begin, self.go_on, self.cancel = QPushButton("Find"), QPushButton("Go on"), QPushButton("Cancel")
        self.go_on.setToolTip("Search further: without what you rejected, from the room as you edited it")
        self.progress, self.step = QProgressBar(), PlainLabel(wordWrap=True)
        self.list = QListWidget()
        self.list.setAccessibleName("Walls and posts found")
        self.list.setSpacing(2)
        self.list.setWordWrap(True)  # the line of a post is wider than the narrow panel
        self.list.setResizeMode(QListWidget.ResizeMode.Adjust)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.accept, self.reject = QPushButton("Accept"), QPushButton("Reject")
        self.accept.setToolTip("Make this the room of the window; Undo takes it back")
        self.reject.setToolTip("Remove the selected wall or post; Go on does not find it again")
        self.plan = QPushButton("Next place to scan")
        self.plan.setToolTip("Find where another scan makes the walls most certain")
        self.poses, self.next, self.note = (PlainLabel(wordWrap=True) for _ in range(3))
        self._space = QWidget()  # below all, while there is no list
        self._arrange()
        self._connect()
        self._fill()

    @property
    def accuracy(self) -> Accuracy:
        """How well the places of the scans are known, as chosen."""
        return ACCURACIES[self.places.currentIndex()]

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if before is None or before.look is not shown.look:
            self._fill()
        elif shown.changed_since(before, "readings", "overlays", "scene"):
            self._enable()
            if self._is_elsewhere(before) is not self._is_elsewhere(shown):
                self._draw()

    @Slot(object)
    def show_search(self, state: FindState) -> None:
        """Show the progress and the hypotheses of the search."""
        before, self._state = self._state, state
        self.progress.setValue(round(100 * state.share))
        if (state.hypotheses, state.answer) != (before.hypotheses, before.answer):
            self._fill()
        elif state.running != before.running or state.places != before.places:
            self._enable()
            self._draw()
        self.step.setText(_step_text(state))

    def showEvent(self, event: QShowEvent) -> None:
        """Draw what was found."""
        super().showEvent(event)
        self._draw()

    def hideEvent(self, event: QHideEvent) -> None:
        """Remove the drawing from the plan."""
        super().hideEvent(event)
        self.drawn.emit(None)

    def _arrange(self) -> None:
        form, begin, decide, work = QFormLayout(), QGridLayout(), QHBoxLayout(), QHBoxLayout()
        form.addRow("Places", self.places)
        begin.addWidget(self.begin, 0, 0)
        begin.addWidget(self.go_on, 0, 1)
        for row, parts in ((work, (self.progress, self.cancel)), (decide, (self.accept, self.reject))):
            for part in parts:
                row.addWidget(part)
        column = QVBoxLayout(self)
        column.addWidget(self.scans)
        column.addLayout(form)
        column.addLayout(begin)
        column.addLayout(work)
        column.addWidget(self.step)
        column.addWidget(self.list, stretch=1)
        column.addWidget(self.poses)
        column.addLayout(decide)
        column.addWidget(self.plan)
        column.addWidget(self.next)
        column.addWidget(self.note)
        column.addWidget(self._space, stretch=1)

    def _connect(self) -> None:
        self.begin.clicked.connect(self._begin)
        self.go_on.clicked.connect(self._go_on)
        self.cancel.clicked.connect(self.cancelled)
        self.list.currentRowChanged.connect(self._select)
        self.accept.clicked.connect(self._accept)
        self.reject.clicked.connect(self._reject)
        self.plan.clicked.connect(self.next_requested)

    @Slot()
    def _begin(self) -> None:
        self.requested.emit(self.accuracy)

    @Slot()
    def _go_on(self) -> None:
        self.continued.emit(self.accuracy)

    def _fill(self) -> None:
        """List the hypotheses; the same row stays selected."""
        row = self.list.currentRow()
        self.list.blockSignals(True)
        self.list.clear()
        if self._shown is not None:
            for text in row_texts(self._state, self._shown.look.unit):
                item = QListWidgetItem(text)
                item.setToolTip(plain_tip(text))
                self.list.addItem(item)
        self.list.setCurrentRow(min(row, self.list.count() - 1))
        self.list.blockSignals(False)
        self._enable()
        self._draw()

    @Slot()
    def _select(self) -> None:
        self._enable()
        self._draw()

    def _draw(self) -> None:
        if self.isVisible():
            elsewhere = self._shown is not None and self._is_elsewhere(self._shown)
            self.drawn.emit(None if elsewhere else drawing_of(self._state, self.list.currentRow()))

    def _is_elsewhere(self, shown: Shown) -> bool:
        """Return whether the walls found belong to another room than the one shown."""
        return self._state.hypotheses is not None and not self._state.is_in(shown.scene)

    @Slot()
    def _accept(self) -> None:
        shown, room, answer = self._shown, self._state.room, self._state.answer
        if shown is None or room is None or answer is None:
            return
        own = (scan.name for scan in answer.hypotheses.scans if share_readings(scan.readings, shown.readings))
        here = next(own, None)
        place = first_place(room) if here is None else room.places[here]
        try:
            changed = with_room(replace(shown.scene, room=room, place=place, room_file=""), room)
        except InputError as error:
            self.note.setText(f"⚠ {error}")
            return
        self._room = room
        self.accepted.emit()
        self.edited.emit(changed, ACCEPTING, None)

    @Slot()
    def _reject(self) -> None:
        """Remove the selected wall from the list, and from the room of the window if it was accepted."""
        row, found, shown = self.list.currentRow(), self._state.hypotheses, self._shown
        if row < 0 or found is None or shown is None:
            return
        name, room = found.supports[row].name, shown.scene.room
        if room is not None and room is self._room and name in room.names:
            try:
                self._room = remove_surface(room, room.names.index(name))
            except InputError as error:  # the last wall
                self.note.setText(f"⚠ {error}")
                return
            self.edited.emit(with_room(shown.scene, self._room), f"{REJECTING} {name}", None)
        self.rejected.emit(row)

    def _enable(self) -> None:
        shown, state = self._shown, self._state
        scans = loaded_scans(shown, "") if shown is not None else ()
        count = len(scans)
        free, some = not state.running, state.hypotheses is not None
        self.scans.setText(_scans_text(scans))
        self.begin.setEnabled(free and count > 0)
        self.begin.setToolTip("" if count else "Needs a scan with readings")
        self.go_on.setEnabled(free and some and count > 0)
        accepted = self._room is not None and shown is not None and shown.scene.room is self._room
        self.accept.setEnabled(free and state.room is not None and not (accepted and state.accepted))
        self.reject.setEnabled(self.list.currentRow() >= 0 and state.running != "planning")
        self.plan.setEnabled(free and state.whole)
        for part in (self.progress, self.cancel):
            part.setVisible(bool(state.running))
        self.step.setVisible(bool(state.running))
        self._space.setVisible(not some)
        for result in (self.list, self.accept, self.reject, self.plan):
            result.setVisible(some)
        self.poses.setText(poses_text(state, shown.look.unit) if shown is not None else "")
        self.poses.setVisible(bool(self.poses.text()))
        self.next.setText(next_text(state, shown.look.unit.text) if shown is not None else "")
        self.next.setVisible(bool(self.next.text()))
        elsewhere = shown is not None and self._is_elsewhere(shown)
        self.note.setText(_ELSEWHERE if elsewhere else _KEY if self.list.currentRow() >= 0 else "" if some else _HINT)
        self.note.setVisible(bool(self.note.text()))


def _scans_text(scans: tuple[LoadedScan, ...]) -> str:
    """Return the number of the scans, and a warning if all have one place."""
    if not scans:
        return "No scan"
    text = f"Scans: {len(scans)} (the scan shown and the visible ones of the panel Scans)"
    from sonarhw_compare.calibration.room import place_numbers  # not needed at the start of the window

    places = place_numbers([scan.place.position for scan in scans])
    if len(set(places.tolist())) > 1 or (len(scans) > 1 and not all(scan.known for scan in scans)):
        return text
    return f"{text}\n⚠ One place alone does not determine a room: walls and posts may be false. Add a scan of another."


def _step_text(state: FindState) -> str:
    if state.running == "planning":
        return "trying places for the next scan"
    found = state.hypotheses
    walls, posts = (len(found.draft.walls), len(found.draft.posts)) if found is not None else (0, 0)
    return f"{counted(walls, 'wall')} and {counted(posts, 'post')} so far"
