"""The panels of the searches: fit, causes, find the room, and the scans drawn together."""

import math
from collections.abc import Callable
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QColor, QHideEvent, QIcon, QPainter, QPen, QPixmap, QShowEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QGridLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)
from sonarhw_compare.edits import remove_surface
from sonarhw_compare.fit.quantities import QUANTITIES, Offer
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.match import Kind
from sonarhw_compare.pictures import points_at
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError, counted
from sonarhw.readings import BoolArray, FloatArray
from sonarhw_gui.jobs.searches import (
    ACCURACIES,
    NEAR,
    Accuracy,
    FindState,
    FitSettings,
    Hypotheses,
    LoadedScan,
    SearchState,
    fitted,
    loaded_scans,
    rows,
    share_line,
    share_readings,
    solution_line,
    warnings,
)
from sonarhw_gui.model.edits import with_room
from sonarhw_gui.model.look import OVERLAYS, LengthUnit, residual_unit
from sonarhw_gui.model.rows import ReadingRows
from sonarhw_gui.model.scene import first_place
from sonarhw_gui.model.shown import NO_POINTS, SHOWN, FoundDrawing, NextScan, OverlaidScan, ScanPair, Shown, proposal_of
from sonarhw_gui.widgets import PlainLabel, ignore_wheel_without_focus, plain_tip, short_list

if TYPE_CHECKING:
    from sonarhw_compare.locate import Pose
    from sonarhw_compare.rooms.causes import Cause  # importing it takes a third of the start of the window

# The fit panel: find the pose of the scanner from its readings. An accepted result is one undo step.


class FitPanel(QWidget):
    """Starts a fit and shows its result."""

    edited = Signal(object, str, object)  # Scene, label for Undo, gesture
    requested = Signal(object)  # FitSettings
    cancelled = Signal()  # a running fit is cancelled, or a result is discarded

    def __init__(self) -> None:
        super().__init__()
        self._shown: Shown | None = None
        self._state = SearchState()
        self.free = {one.word: _box(one.offer) for one in QUANTITIES if one.offer is not None}
        self.where = short_list()
        self.begin = QPushButton("Find pose")
        self.progress, self.cancel = QProgressBar(), QPushButton("Cancel")
        self.solutions = QComboBox()
        ignore_wheel_without_focus(self.solutions)
        self.solutions.setToolTip("Solutions that fit almost equally well, the best first")
        self.table, self.notes = QLabel(textFormat=Qt.TextFormat.RichText), PlainLabel(wordWrap=True)
        self.accept, self.discard = QPushButton("Accept"), QPushButton("Discard")
        self._refused = PlainLabel(wordWrap=True)
        self._request, self._work, self._result = self._request_group(), self._work_row(), self._result_group()
        column = QVBoxLayout(self)
        for part in (self._request, self._work, self._refused, self._result):
            column.addWidget(part)
        column.addStretch(1)
        self._connect()
        self._draw()

    @property
    def settings(self) -> FitSettings:
        """The selected parameters and search area."""
        free = tuple(word for word, box in self.free.items() if box.isChecked())
        return FitSettings(free, everywhere=self.where.currentIndex() == 1)

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, "look"):
            unit = shown.look.unit
            self.where.setItemText(0, f"within {unit.of(NEAR):.2g} {unit.label} of here")
            self._draw()
        self._enable()

    @Slot(object)
    def show_fit(self, state: SearchState) -> None:
        """Show the progress or the result of the fit."""
        fresh = state.answer is not self._state.answer or state.running != self._state.running
        self._state = state
        self.progress.setValue(round(100 * state.share))
        self.progress.setFormat(f"{state.step}  %p %")
        if fresh:
            self._draw()

    @Slot()
    def request_fit(self) -> None:
        """Start a fit with the selected settings."""
        if self.begin.isEnabled():
            self.requested.emit(self.settings)

    def _request_group(self) -> QWidget:
        group = QGroupBox("Free parameters")
        column = QVBoxLayout(group)
        for box in self.free.values():
            column.addWidget(box)
        self.where.addItems(["", "in the whole room"])
        self.where.setToolTip("Search area for the position; the whole room takes longer")
        column.addWidget(self.where)
        column.addWidget(self.begin)
        return group

    def _work_row(self) -> QWidget:
        part = QWidget()
        row = QHBoxLayout(part)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.progress, stretch=1)
        row.addWidget(self.cancel)
        return part

    def _result_group(self) -> QWidget:
        group = QGroupBox("Result")
        layout = QGridLayout(group)
        self.table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        for row, part in enumerate((self.solutions, self.table, self.notes)):
            layout.addWidget(part, row, 0, 1, 2)
        layout.addWidget(self.accept, 3, 0)
        layout.addWidget(self.discard, 3, 1)
        self.accept.setToolTip("Move the sensor there; Undo moves it back")
        return group

    def _connect(self) -> None:
        for box in self.free.values():
            box.toggled.connect(self._enable)
        self.begin.clicked.connect(self.request_fit)
        self.cancel.clicked.connect(self.cancelled)
        self.discard.clicked.connect(self.cancelled)
        self.accept.clicked.connect(self._accept)
        self.solutions.activated.connect(self._draw_solution)

    @Slot()
    def _enable(self) -> None:
        shown = self._shown
        ready = shown is not None and shown.scene.room is not None and bool(shown.readings)
        self.begin.setEnabled(ready and bool(self.settings.free) and not self._state.running)
        self.begin.setToolTip("" if ready else "Needs readings and a room")
        self.where.setEnabled(self.free["position"].isChecked())

    def _draw(self) -> None:
        found = self._state.answer
        self._work.setVisible(self._state.running)
        self._result.setVisible(found is not None)
        self._refused.hide()
        self._enable()
        if found is not None and self._shown is not None:
            unit = self._shown.look.unit
            chosen = max(self.solutions.currentIndex(), 0)
            self.solutions.clear()
            self.solutions.addItems([solution_line(found, k, unit) for k in range(len(found.solutions))])
            self.solutions.setCurrentIndex(min(chosen, len(found.solutions) - 1))
            self.solutions.setVisible(len(found.solutions) > 1)
            self._draw_solution()

    @Slot()
    def _draw_solution(self) -> None:
        found, shown = self._state.answer, self._shown
        if found is None or shown is None:
            return
        solution = self.solutions.currentIndex()
        lines = "".join(
            f"<tr><td>{escape(name)}&nbsp;&nbsp;</td><td align=right>{value}</td><td>&nbsp;&nbsp;{deviation}</td></tr>"
            for name, value, deviation in rows(found, solution, shown.look.unit)
        )
        self.table.setText(f"<table>{lines}</table>")
        warned = [f"⚠ {warning}" for warning in warnings(found)]
        count = f"{found.readings} readings; ± is one standard deviation"
        self.notes.setText("\n\n".join((share_line(found, solution), count, *warned)))

    @Slot()
    def _accept(self) -> None:
        found, shown = self._state.answer, self._shown
        if found is None or shown is None:
            return
        values = found.solutions[self.solutions.currentIndex()].values
        try:
            scene, label = fitted(shown.scene, values, found.scene.board)
        except InputError as error:
            self._refused.setText(f"⚠ {error}")
            self._refused.show()
            return
        self.edited.emit(scene, label, None)
        self.cancelled.emit()


def _box(offer: Offer) -> QCheckBox:
    box = QCheckBox(offer.label)
    box.setToolTip(offer.tip)
    box.setChecked(offer.checked)
    return box


# The panel "Causes": changes of the room that explain misfits, worst first. Each can be tried, and undone.
#
# A click on a cause selects its first misfit and draws the proposed change in the plan.


TRYING = "trying a cause"  # label of Undo
_CAUSES_HINT = (
    "Find causes searches for changes of the room that explain misfits: missing objects, moved walls, weaker edges."
)


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
        self._state = SearchState()
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
    def show_causes(self, state: SearchState) -> None:
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
        self.note.setText("" if running else _CAUSES_HINT)
        if answer is not None and answer.scene.room is not None:
            from sonarhw_compare.rooms.causes import cause_text, left_text  # loaded by the search

            self._tried = [(answer.scene.room, frozenset())]
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

        numbers = tuple(answer.first + row for row in cause.readings)
        surface = cause.change.surface if isinstance(cause.change, OtherReflectance) else None
        try:
            changed = cause.change.applied(shown.scene.room)
        except (InputError, ValueError):
            changed = shown.scene.room  # the room was edited since the search
        kinds = {row.index: row.kind for row in answer.found.before.rows}
        misfits = (row for row in cause.readings if kinds[row] not in (Kind.MATCH, Kind.BOTH_SILENT))
        self.picked.emit(answer.first + next(misfits, cause.readings[0]))
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


# The texts and the drawing of a search for the room.


def row_texts(state: FindState, unit: LengthUnit) -> list[str]:
    """Return one line for each wall and post: name, size, standard deviations, readings for and against."""
    found = state.hypotheses
    if found is None:
        return []
    texts = []
    for row, support in enumerate(found.supports):
        speaking, against = (sum(int(one.sum()) for one in support.speaking(sign)) for sign in (1, -1))
        parts = (support.name, _size(found, row, unit), _deviations(state, row, unit))
        texts.append(f"{' · '.join(filter(None, parts))}\n{speaking} readings for, {against} against")
    return texts


def drawing_of(state: FindState, row: int) -> FoundDrawing | None:
    """Return what is drawn of a search if the wall or post `row` is selected; -1: none. None: nothing."""
    found = state.hypotheses
    if found is None:
        return None
    walls, posts = found.draft.segments, np.array([(*post.center, post.radius) for post in found.draft.posts])
    posts, number = posts.reshape(-1, 3), row - len(walls)
    chosen = 0 <= row < len(found.supports)
    return FoundDrawing(
        walls,
        posts,
        walls[row : row + 1] if chosen and number < 0 else walls[:0],
        posts[number : number + 1] if chosen and number >= 0 else posts[:0],
        _points(found, found.supports[row].speaking(1)) if chosen else NO_POINTS,
        _points(found, found.supports[row].speaking(-1)) if chosen else NO_POINTS,
        NextScan(state.places[0].position, state.places[0].sectors) if state.places else None,
    )


def next_text(state: FindState, unit: Callable[[float], str]) -> str:
    """Return where to scan next and at which headings; empty if it is not known."""
    if not state.places:
        return ""
    best = state.places[0]
    if best.gain <= 0 or not best.sectors:
        return "" if state.running else "Another scan would make no wall or post more certain."
    x, y = (unit(at) for at in best.position)
    sectors = ", ".join(f"{in_degrees(begin, 0):.0f}° to {in_degrees(end, 0):.0f}°" for begin, end in best.sectors)
    so_far = "Best so far, while other places are tried: s" if state.running else "S"
    return f"{so_far}can next at x {x}, y {y}: gain {best.gain:.1f} nats, most from headings {sectors}."


def poses_text(state: FindState, unit: LengthUnit) -> str:
    """Return the possible poses of each scan that was located, and the scans that were not; empty if there are none."""
    if (answer := state.answer) is None:
        return ""
    lines = [f"{name}: {'; '.join(_pose(one, unit) for one in poses)}" for name, poses in answer.poses.items()]
    lines += [f"⚠ {name} is left out: its pose was not found." for name in answer.left_out]
    return "\n".join(lines)


def _pose(pose: "Pose", unit: LengthUnit) -> str:
    x, y = (unit.text(at) for at in pose.position)
    return f"{pose.probability:.0%} at x {x}, y {y}, {in_degrees(pose.heading, 1):.1f}°"


def _size(found: Hypotheses, row: int, unit: LengthUnit) -> str:
    segments = found.draft.segments
    if row < len(segments):
        x, y, x2, y2 = segments[row]
        return str(unit.text(math.hypot(x2 - x, y2 - y)))
    return f"radius {unit.text(found.draft.posts[row - len(segments)].radius)}"


def _deviations(state: FindState, row: int, unit: LengthUnit) -> str:
    """Return the standard deviations of a wall or post; empty while the search runs."""
    found, answer = state.hypotheses, state.answer
    if found is None or answer is None:
        return ""
    from sonarhw_compare.rooms.search import Move  # loaded by the search

    small, deviations = residual_unit(unit), answer.found.deviations

    def length(what: str, which: int, part: int) -> str:
        return f"{deviations[Move(what, which, part)] * small.per_metre:.{max(small.decimals, 1)}f} {small.label}"

    keys = list(found.draft.walls)
    if row < len(keys):
        turned = math.degrees(deviations[Move("wall", keys[row], 1)])
        return f"± {length('wall', keys[row], 0)}, ± {turned:.2f}°"
    name = found.supports[row].name
    number = [support.name for support in answer.hypotheses.supports].index(name) - len(answer.found.draft.walls)
    return f"± {length('post', number, 0)}, ± {length('post', number, 1)}"


def _points(found: Hypotheses, chosen: tuple[BoolArray, ...]) -> FloatArray:
    """Return the points of the chosen readings with an echo, (n, 2) m, at the places of the draft."""
    parts = []
    for scan, place, which in zip(found.scans, found.draft.places, chosen, strict=True):
        readings = [scan.readings[k] for k in np.flatnonzero(which) if scan.readings[k].range is not None]
        if not readings:
            continue
        faced = scan.board.faced(place)
        headings = np.array([faced.heading + scan.board.turned(reading.angle) for reading in readings])
        ranges = np.array([reading.range for reading in readings], dtype=np.float64)
        parts.append(points_at(standpoints(scan.board, faced, headings), headings, ranges))
    return np.vstack(parts) if parts else NO_POINTS


# The panel "Find the room": searches the room that the loaded scans show, lists its walls, and plans the next scan.
#
# A click on a wall highlights it in the plan, with the readings that speak for and against it.


ACCEPTING, REJECTING = "accepting the found room", "rejecting"  # labels of Undo
_FIND_HINT = (
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
        self.note.setText(
            _ELSEWHERE if elsewhere else _KEY if self.list.currentRow() >= 0 else "" if some else _FIND_HINT
        )
        self.note.setVisible(bool(self.note.text()))


def _scans_text(scans: tuple[LoadedScan, ...]) -> str:
    """Return the number of the scans, and a warning if all have one place."""
    if not scans:
        return "No scan"
    text = f"Scans: {len(scans)} (the scan shown and the visible ones of the panel Scans)"
    from sonarhw_compare.arcs import place_numbers  # not needed at the start of the window

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


# The panel "Scans": scans drawn over the one shown, each with colour and eye, and the two that are compared.


_ICON = 16  # pixels
_SCANS_HINT = "Add a log, or keep this scan and make another: both are drawn in the plan and in the ranges."


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
        self.note = PlainLabel(_SCANS_HINT, wordWrap=True)
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
        self.note.setText(
            "The view Differences shows the second scan minus the first." if self.list.count() else _SCANS_HINT
        )

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
