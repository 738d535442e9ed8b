"""The panel "Causes": changes of the room that explain misfits, worst first. Each can be tried, and undone.

A click on a cause selects its first misfit and draws the proposed change in the plan.
"""

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import QHBoxLayout, QListWidget, QListWidgetItem, QProgressBar, QPushButton, QVBoxLayout, QWidget
from sonarhw_compare.match import Kind
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError
from sonarhw_gui.causes.cause_control import CausesState
from sonarhw_gui.parts.plain_label import PlainLabel, plain_tip
from sonarhw_gui.scene.scene_edit import with_room
from sonarhw_gui.shown.proposal import proposal_of
from sonarhw_gui.shown.reading_rows import ReadingRows
from sonarhw_gui.shown.shown import Shown

if TYPE_CHECKING:
    from sonarhw_compare.rooms.causes import Cause  # importing it takes a third of the start of the window

TRYING = "trying a cause"  # label of Undo
_HINT = "Find causes searches for changes of the room that explain misfits: missing objects, moved walls, weaker edges."


class CausesPanel(QWidget):
    """Starts the search and lists its results."""

    requested = Signal()
    cancelled = Signal()
    edited = Signal(object, str, object)  # Scene, label for Undo, gesture
    undone = Signal()
    proposed = Signal(object)  # Proposal, or None
    picked = Signal(int)  # the first misfit of a cause

    def __init__(self) -> None:
        super().__init__()
        self._shown: Shown | None = None
        self._state = CausesState()
        self._tried: list[tuple[Room, frozenset[int]]] = []  # rooms of this search, with the causes tried in each
        self.begin, self.cancel = QPushButton("Find causes"), QPushButton("Cancel")
        self.progress = QProgressBar()
        self.list = QListWidget()
        self.list.setWordWrap(True)
        self.list.setAccessibleName("Causes of misfits, worst first")
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.try_it, self.undo = QPushButton("Try"), QPushButton("Undo")
        self.try_it.setToolTip("Change the room, and predict again")
        self.undo.setToolTip("Undo the change that was tried last")
        self.shares, self.note = PlainLabel(wordWrap=True), PlainLabel(wordWrap=True)
        self.note.setAlignment(Qt.AlignmentFlag.AlignTop)  # it has the whole panel before the first search
        self._arrange()
        self.begin.clicked.connect(self.requested)
        self.cancel.clicked.connect(self.cancelled)
        self.list.currentRowChanged.connect(self._select)
        self.list.itemClicked.connect(self._select)
        self.list.itemActivated.connect(self._try)
        self.try_it.clicked.connect(self._try)
        self.undo.clicked.connect(self.undone)
        self._draw()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        self._shown = shown
        self._enable()

    @Slot(object)
    def show_causes(self, state: CausesState) -> None:
        """Show the progress or the result of the search."""
        fresh = state.answer is not self._state.answer or state.running != self._state.running
        self._state = state
        self.progress.setValue(round(100 * state.share))
        if fresh:
            self._draw()

    def _arrange(self) -> None:
        work, decide = QHBoxLayout(), QHBoxLayout()
        for row, parts in ((work, (self.progress, self.cancel)), (decide, (self.try_it, self.undo))):
            for part in parts:
                row.addWidget(part)
        column = QVBoxLayout(self)
        column.addWidget(self.begin)
        column.addLayout(work)
        column.addWidget(self.list, stretch=1)
        column.addLayout(decide)
        column.addWidget(self.shares)
        column.addWidget(self.note)

    def _draw(self) -> None:
        answer, running = self._state.answer, self._state.running
        for part in (self.progress, self.cancel):
            part.setVisible(running)
        for result in (self.list, self.try_it, self.undo, self.shares):
            result.setVisible(answer is not None)
        self.list.clear()
        self.proposed.emit(None)
        self.note.setText("" if running else _HINT)
        if answer is not None and answer.request.scene.room is not None:
            from sonarhw_compare.rooms.causes import cause_text, left_text  # loaded by the search

            self._tried = [(answer.request.scene.room, frozenset())]
            unit = self._shown.look.unit.text if self._shown else "{:.3f} m".format
            for number, cause in enumerate(answer.found.causes, 1):
                text = f"{number}. {cause_text(cause, unit)}"
                item = QListWidgetItem(text)
                item.setToolTip(plain_tip(f"{text}; log-likelihood +{cause.gain:.0f}"))
                self.list.addItem(item)
            count = "no change of the room explains misfits; " if not answer.found.causes else ""
            self.note.setText(
                f"{count}with all changes, {left_text(answer.found)}".replace("changes, no", "changes no")
            )
        self._enable()

    @Slot()
    def _select(self) -> None:
        """Draw the proposal of the current cause, and select its first misfit."""
        cause, shown, answer = self._cause, self._shown, self._state.answer
        if cause is None or shown is None or answer is None or shown.scene.room is None:
            return
        from sonarhw_compare.rooms.causes import OtherReflectance

        numbers = tuple(answer.request.first + row for row in cause.readings)
        surface = cause.change.surface if isinstance(cause.change, OtherReflectance) else None
        try:
            changed = cause.change.applied(shown.scene.room)
        except (InputError, ValueError):
            changed = shown.scene.room  # the room was edited since the search
        kinds = {row.index: row.kind for row in answer.found.before.rows}
        misfits = (row for row in cause.readings if kinds[row] not in (Kind.MATCH, Kind.BOTH_SILENT))
        self.picked.emit(answer.request.first + next(misfits, cause.readings[0]))
        self.proposed.emit(proposal_of(shown.scene.room, changed, numbers, surface))
        self._enable()

    @Slot()
    def _try(self) -> None:
        cause, shown = self._cause, self._shown
        if cause is None or shown is None or shown.scene.room is None or not self.try_it.isEnabled():
            return
        try:
            changed = with_room(shown.scene, cause.change.applied(shown.scene.room))
        except (InputError, ValueError) as error:
            self.note.setText(f"⚠ {error}")
            return
        if changed.room is not None:
            self._tried.append((changed.room, self._tried_now | {self.list.currentRow()}))
        self.edited.emit(changed, TRYING, None)
        self.proposed.emit(None)

    @property
    def _cause(self) -> "Cause | None":
        answer, row = self._state.answer, self.list.currentRow()
        return answer.found.causes[row] if answer is not None and 0 <= row < len(answer.found.causes) else None

    @property
    def _tried_now(self) -> frozenset[int]:
        """The causes that were tried in the room shown."""
        room = self._shown.scene.room if self._shown else None
        return next((tried for known, tried in self._tried if known is room), frozenset())

    def _enable(self) -> None:
        shown, answer, tried = self._shown, self._state.answer, self._tried_now
        ready = shown is not None and shown.scene.room is not None and bool(shown.readings)
        self.begin.setEnabled(ready and not self._state.running)
        self.begin.setToolTip("" if ready else "Needs readings and a room")
        self.try_it.setEnabled(self._cause is not None and self.list.currentRow() not in tried)
        self.undo.setEnabled(bool(tried))
        for row in range(self.list.count()):
            item = self.list.item(row)
            text = item.text().removesuffix(" — tried")
            item.setText(f"{text} — tried" if row in tried else text)
        if shown is not None and answer is not None:
            before = answer.found.before.summary().within_5cm
            now = _share(shown.rows)
            self.shares.setText(f"within 5 cm of the prediction: {_percent(before)} before, {_percent(now)} now")


def _share(rows: ReadingRows) -> float | None:
    counts = rows.counts()
    echoes = sum(counts[kind] for kind in (Kind.MATCH, Kind.SHORT, Kind.LONG, Kind.EXTRA))
    return counts[Kind.MATCH] / echoes if echoes else None


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{share:.1%}"
