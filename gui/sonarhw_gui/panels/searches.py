"""The panels that search with scans: the fit, the causes of misfits, the room; and the list of several scans.

A search runs in a thread. Its panel starts it, follows its progress and lists what it has found; what the user accepts
is one undo step.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pyqtgraph as pg
from PySide6 import QtWidgets
from PySide6.QtCore import QPointF, QSignalBlocker, QSize, Qt, QTimer, Slot
from PySide6.QtGui import QColor, QHideEvent, QIcon, QPainter, QPen, QPixmap, QShowEvent
from sonarhw_compare.edits import remove_surface
from sonarhw_compare.fit.quantities import NEAR, QUANTITIES, Offer
from sonarhw_compare.match import Kind
from sonarhw_compare.rooms.effort import Effort
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError, counted, in_degrees
from sonarhw.readings import BoolArray, FloatArray, points_at
from sonarhw_gui.jobs import searches
from sonarhw_gui.jobs.searches import rows
from sonarhw_gui.model.edits import Edit, with_room
from sonarhw_gui.model.look import OVERLAYS, LengthUnit
from sonarhw_gui.model.rows import ReadingRows
from sonarhw_gui.model.scene import first_place
from sonarhw_gui.model.shown import (
    NO_POINTS,
    SHOWN,
    FoundDrawing,
    OverlaidScan,
    Proposal,
    ScanPair,
    Shown,
    TrackDrawing,
    proposal_of,
    proposed_pose,
)
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.widgets import PlainLabel, button, ignore_wheel_without_focus, plain_tip, short_list, stacked

if TYPE_CHECKING:
    from sonarhw_compare.locate import Pose
    from sonarhw_compare.rooms.causes import Cause  # importing it takes a third of the start of the window
    from sonarhw_compare.track import Track

TRYING = "trying a cause"  # label of Undo
_CAUSES_HINT = (
    "Find causes searches for changes of the room that explain misfits: missing objects, moved walls, weaker edges."
)
ACCEPTING, REJECTING = "accepting the found room", "rejecting"  # labels of Undo
_FIND_HINT = (
    "Finds walls and posts that explain all echoes of the scan shown and of the visible scans of the panel Scans "
    "(F12). This takes seconds to minutes."
)
_ELSEWHERE = "These walls were found while another room was shown, so they are not drawn in this one."
_KEY = "Rings in the plan: echoes that speak for the selected wall. Crosses: against it. Silence counts too."
_ICON = 16  # pixels
_TRACK_HINT = (
    "Follows a robot through its log, by the steps of its odometry and by its sonar. The plan shows its way, and as "
    "dots where else it may be."
)
_SCANS_HINT = "Add a log, or keep this scan and make another: both are drawn in the plan and in the ranges."


class SearchPanel(QtWidgets.QWidget):
    """The parts of every search: a button that starts it, its progress, a button that cancels it, and a note."""

    def __init__(self, session: WindowSession, control: Any, begin: str) -> None:
        """`control`: starts, cancels and observes the search; `begin`: the text of the button that starts it."""
        super().__init__()
        self._session, self._control = session, control
        self._state, self._drawn = control.state, session.shown
        self.begin, self.cancel = button(begin, "", self._begin), button("Cancel", "", control.cancel)
        self.progress, self.note = QtWidgets.QProgressBar(), PlainLabel(wordWrap=True)
        self.decision: QtWidgets.QWidget = self.note  # what the user needs once the search has an answer
        control.changed.connect(self._follow)

    @property
    def _shown(self) -> Shown:
        return self._session.shown

    @property
    def _is_ready(self) -> bool:
        """Whether there are readings and a room."""
        return self._shown.scene.room is not None and bool(self._shown.readings)

    @Slot()
    def _begin(self) -> None:
        self._control.start()

    @Slot(object)
    def _follow(self, state: Any) -> None:
        before, self._state = self._state, state
        self.progress.setValue(round(100 * state.share))
        self._show_changes(before)
        if state.running and not before.running:
            self._reveal(self.cancel)
        elif state.answer is not None and before.answer is None:
            self._reveal(self.decision)

    def _reveal(self, part: QtWidgets.QWidget) -> None:
        """Scroll the panel to a part of it, once the part has its place."""
        area = self.parentWidget()
        while area is not None and not isinstance(area, QtWidgets.QScrollArea):
            area = area.parentWidget()
        if area is not None:
            QTimer.singleShot(0, part, partial(area.ensureWidgetVisible, part))

    def _show_changes(self, before: Any) -> None:
        """Show the state of the search, which was `before`."""
        if (self._state.answer, self._state.running) != (before.answer, before.running):
            self._draw()

    def _draw(self) -> None:
        """Show the answer of the search."""
        raise NotImplementedError

    def _allow(self, ready: bool, needs: str, possible: bool = True) -> None:
        """Enable the button that starts the search; its tooltip says what it `needs` to be ready."""
        running = bool(self._state.running)
        self.begin.setEnabled(ready and possible and not running)
        self.begin.setToolTip("" if ready else needs)
        _show(running, self.progress, self.cancel)

    def _apply(self, edit: Callable[[], Edit]) -> bool:
        """Apply an edit, and return whether the room allows it; if it does not, show why."""
        try:
            scene, label = edit()
        except (InputError, ValueError) as error:
            self.note.setText(f"⚠ {error}")
            self.note.show()
            return False
        self._session.showing.edit(scene, label)
        return True


class FitPanel(SearchPanel):
    """Finds the pose of the scanner, and other values, from its readings."""

    def __init__(self, session: WindowSession) -> None:
        super().__init__(session, session.fitting, "Find pose")
        self.free = {quantity.word: _box(quantity.offer) for quantity in QUANTITIES if quantity.offer is not None}
        self.where, self.solutions = short_list(), QtWidgets.QComboBox()
        self.where.addItems(["", "in the whole room"])
        self.where.setToolTip("Search area for the position; the whole room takes longer")
        self.solutions.setToolTip("Solutions that fit almost equally well, the best first")
        ignore_wheel_without_focus(self.solutions)
        self.table, self.notes = QtWidgets.QLabel(textFormat=Qt.TextFormat.RichText), PlainLabel(wordWrap=True)
        self.table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.accept = button("Accept", "Move the sensor there; Undo moves it back", self._accept)
        self.discard = button("Discard", "", session.fitting.cancel)
        self.reread = button("", "Import the log again in this way, and find its pose", self._reread)
        self.decision = self.accept
        request, self._result = QtWidgets.QGroupBox("Free parameters"), QtWidgets.QGroupBox("Result")
        stacked(request, *self.free.values(), self.where, self.begin)
        stacked(self._result, self.solutions, self.table, self.notes, self.reread, (self.accept, self.discard))
        stacked(self, request, (self.progress, self.cancel), self.note, self._result, None)
        for box in self.free.values():
            box.toggled.connect(self._enable)
        self.solutions.activated.connect(self._draw_solution)
        self._name_area()
        self._draw()

    @property
    def free_words(self) -> tuple[str, ...]:
        """The words of the selected quantities."""
        return tuple(word for word, box in self.free.items() if box.isChecked())

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._drawn = self._drawn, shown
        if shown.changed_since(before, lambda new: (new.look,)):
            self._name_area()
            self._draw()
        self._enable()

    def _name_area(self) -> None:
        unit = self._shown.look.unit
        self.where.setItemText(0, f"within {unit.of(NEAR):.2g} {unit.label} of here")

    def _show_changes(self, before: searches.SearchState) -> None:
        self.progress.setFormat(f"{self._state.step}  %p %")
        super()._show_changes(before)

    @Slot()
    def _begin(self) -> None:
        self._control.start(self.free_words, self.where.currentIndex() == 1)

    @Slot()
    def _enable(self) -> None:
        self._allow(self._is_ready, "Needs readings and a room", possible=bool(self.free_words))
        self.where.setEnabled(self.free["position"].isChecked())

    def _draw(self) -> None:
        fit: searches.FitFound | None = self._state.answer
        self._result.setVisible(fit is not None)
        self.note.hide()
        self._enable()
        if fit is not None:
            chosen, count = max(self.solutions.currentIndex(), 0), len(fit.solutions)
            self.solutions.clear()
            self.solutions.addItems([searches.solution_line(fit, k, self._shown.look.unit) for k in range(count)])
            self.solutions.setCurrentIndex(min(chosen, count - 1))
            self.solutions.setVisible(count > 1)
            self.reread.setVisible(fit.otherwise is not None)
            self.reread.setText("" if fit.otherwise is None else f"Read {fit.otherwise.correction.name}")
            self._draw_solution()
        else:
            self._session.showing.propose(None)

    @Slot()
    def _draw_solution(self) -> None:
        fit, solution = self._state.answer, self.solutions.currentIndex()
        lines = "".join(
            f"<tr><td>{escape(name)}&nbsp;&nbsp;</td><td align=right>{value}</td><td>&nbsp;&nbsp;{deviation}</td></tr>"
            for name, value, deviation in rows(fit, solution, self._shown.look.unit)
        )
        self.table.setText(f"<table>{lines}</table>")
        warned = [f"⚠ {warning}" for warning in searches.warnings(fit)]
        count = f"{fit.readings} readings; ± is one standard deviation"
        self.notes.setText("\n\n".join((searches.share_line(fit, solution), count, *warned)))
        self._session.showing.propose(self._proposal(fit, solution))

    def _proposal(self, fit: searches.FitFound, solution: int) -> Proposal | None:
        """Return the pose and the walls of a solution, to be drawn before they are accepted."""
        scene = self._shown.scene
        if scene.room is None:
            return None
        try:
            return proposed_pose(scene.room, searches.fitted(scene, fit.solutions[solution], fit.scene.board)[0])
        except (InputError, ValueError):
            return None

    @Slot()
    def _reread(self) -> None:
        self._session.correct_log(self._state.answer.otherwise.correction)

    @Slot()
    def _accept(self) -> None:
        fit = self._state.answer
        values = fit.solutions[self.solutions.currentIndex()]
        if self._apply(lambda: searches.fitted(self._shown.scene, values, fit.scene.board)):
            self._control.cancel()


class CausesPanel(SearchPanel):
    """Lists changes of the room that explain misfits, worst first. Each can be tried, and undone.

    A click on a cause selects its first misfit and draws the proposed change in the plan.
    """

    def __init__(self, session: WindowSession) -> None:
        super().__init__(session, session.causes, "Find causes")
        self._tried: list[
            tuple[Room | None, frozenset[int]]
        ] = []  # rooms of this search, with the causes tried in each
        self.list = _list("Causes of misfits, worst first")
        self.list.setSizeAdjustPolicy(QtWidgets.QListWidget.SizeAdjustPolicy.AdjustToContents)  # few: Try stays visible
        self.try_it = button("Try", "Change the room, and predict again", self._try)
        self.undo = button("Undo", "Undo the change that was tried last", session.showing.undo)
        self.shares = PlainLabel(wordWrap=True)
        self.note.setAlignment(Qt.AlignmentFlag.AlignTop)  # it has the whole panel before the first search
        decide = self.try_it, self.undo
        stacked(self, self.begin, (self.progress, self.cancel), self.list, decide, self.shares, self.note)
        self.list.currentRowChanged.connect(self._select)
        self.list.itemClicked.connect(self._select)
        self.list.itemActivated.connect(self._try)
        self._draw()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        self._enable()

    def _draw(self) -> None:
        answer: searches.CausesAnswer | None = self._state.answer
        _show(answer is not None, self.list, self.try_it, self.undo, self.shares)
        self.list.clear()
        self._session.showing.propose(None)
        self.note.setText("" if self._state.running else _CAUSES_HINT)
        if answer is not None and answer.scene.room is not None:
            self._tried = [(answer.scene.room, frozenset())]
            for number, cause in enumerate(answer.result.causes, 1):
                text = f"{number}. {cause.text(self._shown.look.unit.text)}"
                self.list.addItem(_item(text, f"{text}; log-likelihood +{cause.gain:.0f}"))
            chosen = -1 if self._shown.chosen is None else self._shown.chosen - answer.first
            of_chosen = (row for row, cause in enumerate(answer.result.causes) if chosen in cause.misfits)
            with QSignalBlocker(self.list):
                self.list.setCurrentRow(next(of_chosen, 0))  # the cause of the reading that was asked about
            self._propose()
            found = "with all changes tried, " if answer.result.causes else "no change of the room explains misfits; "
            self.note.setText(f"{found}{answer.result.left_text}")
        self._enable()

    @Slot()
    def _select(self) -> None:
        """Draw the current cause, and select a misfit that it explains."""
        cause, answer = self._cause, self._state.answer
        if cause is not None and self._shown.chosen not in (numbers := [answer.first + row for row in cause.misfits]):
            self._session.showing.choose(numbers[0])
        self._propose()

    def _propose(self) -> None:
        """Draw the change of the current cause, with rings around its misfits."""
        cause, room, answer = self._cause, self._shown.scene.room, self._state.answer
        if cause is None or room is None:
            return
        from sonarhw_compare.rooms.causes import OtherReflectance

        numbers = tuple(answer.first + row for row in cause.misfits)
        surface = cause.change.surface if isinstance(cause.change, OtherReflectance) else None
        try:
            changed = cause.change.applied(room)
        except (InputError, ValueError):
            changed = room  # the room was edited since the search
        self._session.showing.propose(proposal_of(room, changed, numbers, surface))
        self._enable()

    @Slot()
    def _try(self) -> None:
        cause, scene, room, tried = self._cause, self._shown.scene, self._shown.scene.room, self._tried_now
        if cause is None or room is None or not self.try_it.isEnabled():
            return
        if self._apply(lambda: (with_room(scene, cause.change.applied(room)), TRYING)):
            self._tried.append((self._shown.scene.room, tried | {self.list.currentRow()}))
            self._session.showing.propose(None)
            self._enable()

    @property
    def _cause(self) -> "Cause | None":
        answer, row = self._state.answer, self.list.currentRow()
        return answer.result.causes[row] if answer is not None and 0 <= row < len(answer.result.causes) else None

    @property
    def _tried_now(self) -> frozenset[int]:
        """The causes that were tried in the room shown."""
        return next((tried for room, tried in self._tried if room is self._shown.scene.room), frozenset())

    def _enable(self) -> None:
        answer, tried = self._state.answer, self._tried_now
        self._allow(self._is_ready, "Needs readings and a room")
        self.try_it.setEnabled(self._cause is not None and self.list.currentRow() not in tried)
        self.undo.setEnabled(bool(tried))
        for row in range(self.list.count()):
            text = self.list.item(row).text().removesuffix(" — tried")
            self.list.item(row).setText(f"{text} — tried" if row in tried else text)
        if answer is not None:
            before, now = answer.result.before.summary().within_5cm, _share(self._shown.rows)
            self.shares.setText(f"within 5 cm of the prediction: {_percent(before)} before, {_percent(now)} now")


def _share(rows: ReadingRows) -> float | None:
    counts = rows.counts()
    echoes = sum(counts[kind] for kind in (Kind.MATCH, Kind.SHORT, Kind.LONG, Kind.EXTRA))
    return counts[Kind.MATCH] / echoes if echoes else None


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{share:.1%}"


class FindPanel(SearchPanel):
    """Searches the room that the loaded scans show, lists its walls, and plans the next scan.

    A click on a wall highlights it in the plan, with the readings that speak for and against it.
    """

    def __init__(self, session: WindowSession) -> None:
        super().__init__(session, session.finding, "Find")
        self._room: Room | None = None  # the accepted one, while it is the room of the window
        self.scans, self.places = PlainLabel(wordWrap=True), QtWidgets.QComboBox()
        self.places.addItems([*searches.ACCURACIES])
        self.places.setToolTip("How well the places of the scans are known; those of logs without a room are unknown")
        self.effort = QtWidgets.QComboBox()
        self.effort.addItems([*Effort])
        self.effort.setCurrentText(Effort.NORMAL)
        self.effort.setToolTip("quick: rough walls in some seconds; thorough: several searches, some minutes")
        ignore_wheel_without_focus(self.places)
        ignore_wheel_without_focus(self.effort)
        self.go_on = button(
            "Go on", "Search further: without what you rejected, from the room as you edited it", self._go_on
        )
        self.list = _list("Walls and posts found")
        self.list.setSpacing(2)
        self.list.setResizeMode(QtWidgets.QListWidget.ResizeMode.Adjust)
        self.list.currentRowChanged.connect(self._select)
        self.decision = self.accept = button(
            "Accept", "Make this the room of the window; Undo takes it back", self._accept
        )
        self.reject = button("Reject", "Remove the selected wall or post; Go on does not find it again", self._reject)
        self.plan = button(
            "Next place to scan", "Find where another scan makes the walls most certain", session.finding.plan_next
        )
        self.step, self.poses, self.next = (PlainLabel(wordWrap=True) for _ in range(3))
        self._space = QtWidgets.QWidget()  # below all, while there is no list
        form, begin = QtWidgets.QFormLayout(), QtWidgets.QGridLayout()
        form.addRow("Places", self.places)
        form.addRow("Effort", self.effort)
        begin.addWidget(self.begin, 0, 0)
        begin.addWidget(self.go_on, 0, 1)
        above = self.scans, form, begin, (self.progress, self.cancel), self.step
        below = self.poses, (self.accept, self.reject), self.plan, self.next, self.note
        column = stacked(self, *above, self.list, *below)
        column.addWidget(self._space, stretch=1)
        self._fill()

    @property
    def accuracy(self) -> searches.Accuracy:
        """How well the places of the scans are known, as chosen."""
        return searches.ACCURACIES[self.places.currentText()]

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._drawn = self._drawn, shown
        if before.look is not shown.look:
            self._fill()
        elif shown.changed_since(before, lambda new: (new.readings, new.overlays, new.scene)):
            self._enable()
            if self._is_elsewhere(before) is not self._is_elsewhere(shown):
                self._draw()

    def _show_changes(self, before: searches.FindState) -> None:
        state = self._state
        if (state.hypotheses, state.answer) != (before.hypotheses, before.answer):
            self._fill()
        elif state.running != before.running or state.places != before.places:
            self._select()
        self.step.setText(_step_text(state))

    def showEvent(self, event: QShowEvent) -> None:
        """Draw what was found."""
        super().showEvent(event)
        self._draw()

    def hideEvent(self, event: QHideEvent) -> None:
        """Remove the drawing from the plan."""
        super().hideEvent(event)
        self._session.showing.draw_found(None)

    @Slot()
    def _begin(self) -> None:
        self._control.start(self.accuracy, Effort(self.effort.currentText()))

    @Slot()
    def _go_on(self) -> None:
        self._control.go_on(self.accuracy, Effort(self.effort.currentText()))

    def _fill(self) -> None:
        """List the hypotheses; the same row stays selected."""
        row = self.list.currentRow()
        with QSignalBlocker(self.list):
            self.list.clear()
            for text in row_texts(self._state, self._shown.look.unit):
                self.list.addItem(_item(text, text))
            self.list.setCurrentRow(min(row, self.list.count() - 1))
        self._select()

    @Slot()
    def _select(self) -> None:
        self._enable()
        self._draw()

    def _draw(self) -> None:
        if self.isVisible():
            elsewhere = self._is_elsewhere(self._shown)
            drawing = None if elsewhere else drawing_of(self._state, self.list.currentRow())
            self._session.showing.draw_found(drawing)

    def _is_elsewhere(self, shown: Shown) -> bool:
        """Return whether the walls found belong to another room than the one shown."""
        return self._state.hypotheses is not None and not self._state.is_in(shown.scene)

    @Slot()
    def _accept(self) -> None:
        shown, room, answer = self._shown, self._state.room, self._state.answer
        own = (scan.name for scan in answer.hypotheses.scans if searches.share_readings(scan.readings, shown.readings))
        here = next(own, None)
        place = first_place(room) if here is None else room.places[here]
        changed = replace(shown.scene, room=room, place=place, room_file="")
        if self._apply(lambda: (with_room(changed, room), ACCEPTING)):
            self._room = room
            self._control.note_accepted()
            self._select()

    @Slot()
    def _reject(self) -> None:
        """Remove the selected wall from the list, and from the room of the window if it was accepted."""
        row, scene = self.list.currentRow(), self._shown.scene
        name, room = self._state.hypotheses.supports[row].name, scene.room
        if room is not None and room is self._room and name in room.names:
            number = room.names.index(name)
            if not self._apply(lambda: (with_room(scene, remove_surface(room, number)), f"{REJECTING} {name}")):
                return  # the last wall
            self._room = self._shown.scene.room
        self._control.reject(row)

    def _enable(self) -> None:
        shown, state, row = self._shown, self._state, self.list.currentRow()
        scans, some, unit = searches.loaded_scans(shown, ""), state.hypotheses is not None, shown.look.unit
        self._allow(bool(scans), "Needs a scan with readings")
        free, accepted = not state.running, self._room is not None and shown.scene.room is self._room
        self.go_on.setEnabled(free and some and bool(scans))
        self.accept.setEnabled(free and state.room is not None and not (accepted and state.accepted))
        self.reject.setEnabled(row >= 0 and state.running != "planning")
        self.plan.setEnabled(free and state.whole)
        _show(not free, self.step)
        _show(some, self.list, self.accept, self.reject, self.plan)
        _show(not some, self._space)
        elsewhere = self._is_elsewhere(shown)
        for label, text in (
            (self.scans, _scans_text(scans)),
            (self.poses, poses_text(state, unit)),
            (self.next, next_text(state, unit.text)),
            (self.note, _ELSEWHERE if elsewhere else _KEY if row >= 0 else "" if some else _FIND_HINT),
        ):
            label.setText(text)
            label.setVisible(bool(text))


def _scans_text(scans: tuple[searches.LoadedScan, ...]) -> str:
    """Return the number of the scans, and a warning if all have one place."""
    if not scans:
        return "No scan"
    text = f"Scans: {len(scans)} (the scan shown and the visible ones of the panel Scans)"
    from sonarhw_compare.arcs import place_numbers  # not needed at the start of the window

    places = place_numbers([scan.place.position for scan in scans])
    if len(set(places.tolist())) > 1 or (len(scans) > 1 and not all(scan.has_place for scan in scans)):
        return text
    return f"{text}\n⚠ One place alone does not determine a room: walls and posts may be false. Add a scan of another."


def _step_text(state: searches.FindState) -> str:
    if state.running == "planning":
        return "trying places for the next scan"
    hypotheses = state.hypotheses
    walls, posts = (len(hypotheses.draft.walls), len(hypotheses.draft.posts)) if hypotheses is not None else (0, 0)
    return f"{counted(walls, 'wall')} and {counted(posts, 'post')} so far"


def row_texts(state: searches.FindState, unit: LengthUnit) -> list[str]:
    """Return one line for each wall and post: name, size, standard deviations, readings for and against."""
    hypotheses = state.hypotheses
    if hypotheses is None:
        return []
    texts = []
    for row, support in enumerate(hypotheses.supports):
        speaking, against = (sum(int(scan.sum()) for scan in support.speaking(sign)) for sign in (1, -1))
        parts = (support.name, _size(hypotheses, row, unit), _deviations(state, row, unit))
        texts.append(f"{' · '.join(filter(None, parts))}\n{speaking} readings for, {against} against")
    return texts


def drawing_of(state: searches.FindState, row: int) -> FoundDrawing | None:
    """Return what is drawn of a search if the wall or post `row` is selected; -1: none. None: nothing."""
    hypotheses = state.hypotheses
    if hypotheses is None:
        return None
    walls, posts = hypotheses.draft.segments, np.array([(*post.center, post.radius) for post in hypotheses.draft.posts])
    posts, number = posts.reshape(-1, 3), row - len(walls)
    chosen = 0 <= row < len(hypotheses.supports)
    return FoundDrawing(
        walls,
        posts,
        walls[row : row + 1] if chosen and number < 0 else walls[:0],
        posts[number : number + 1] if chosen and number >= 0 else posts[:0],
        _points(hypotheses, hypotheses.supports[row].speaking(1)) if chosen else NO_POINTS,
        _points(hypotheses, hypotheses.supports[row].speaking(-1)) if chosen else NO_POINTS,
        state.places[0] if state.places else None,
    )


def next_text(state: searches.FindState, unit: Callable[[float], str]) -> str:
    """Return where to scan next and at which headings; empty if it is not known."""
    if not state.places:
        return ""
    best = state.places[0]
    if best.gain <= 0 or not best.sectors:
        return "" if state.running else "Another scan would make no wall or post more certain."
    x, y = (unit(metres) for metres in best.position)
    sectors = ", ".join(f"{in_degrees(begin, 0):.0f}° to {in_degrees(end, 0):.0f}°" for begin, end in best.sectors)
    so_far = "Best so far, while other places are tried: s" if state.running else "S"
    return f"{so_far}can next at x {x}, y {y}: gain {best.gain:.1f} nats, most from headings {sectors}."


def poses_text(state: searches.FindState, unit: LengthUnit) -> str:
    """Return why this may be no room, the possible poses of located scans, and the scans that were not located."""
    if (answer := state.answer) is None:
        return ""
    from sonarhw_compare.rooms.outcome import unconfirmed_text, verdict_of

    reasons = [f"⚠ This is probably not a room: {reason}." for reason in verdict_of(answer.result).reasons]
    lines = [f"{name}: {'; '.join(_pose(pose, unit) for pose in poses)}" for name, poses in answer.result.poses.items()]
    lines += [f"⚠ {name} is left out: its pose was not found." for name in answer.result.left_out]
    return "\n".join([*reasons, *lines, *unconfirmed_text(answer.result)])


def _pose(pose: "Pose", unit: LengthUnit) -> str:
    x, y = (unit.text(metres) for metres in pose.position)
    return f"{pose.probability:.0%} at x {x}, y {y}, {in_degrees(pose.heading, 1):.1f}°"


def _size(hypotheses: searches.Hypotheses, row: int, unit: LengthUnit) -> str:
    segments = hypotheses.draft.segments
    if row < len(segments):
        x, y, x2, y2 = segments[row]
        return str(unit.text(math.hypot(x2 - x, y2 - y)))
    return f"radius {unit.text(hypotheses.draft.posts[row - len(segments)].radius)}"


def _deviations(state: searches.FindState, row: int, unit: LengthUnit) -> str:
    """Return the standard deviations of a wall or post; empty while the search runs."""
    hypotheses, answer = state.hypotheses, state.answer
    if hypotheses is None or answer is None:
        return ""
    from sonarhw_compare.rooms.refinement import Move  # loaded by the search

    small, deviations = unit.small, answer.result.deviations

    def length(what: str, which: int, part: int) -> str:
        return f"{deviations[Move(what, which, part)] * small.per_metre:.{max(small.decimals, 1)}f} {small.label}"

    keys = list(hypotheses.draft.walls)
    if row < len(keys):
        turned = math.degrees(deviations[Move("wall", keys[row], 1)])
        return f"± {length('wall', keys[row], 0)}, ± {turned:.2f}°"
    name = hypotheses.supports[row].name
    number = [support.name for support in answer.hypotheses.supports].index(name) - len(answer.result.draft.walls)
    return f"± {length('post', number, 0)}, ± {length('post', number, 1)}"


def _points(hypotheses: searches.Hypotheses, chosen: tuple[BoolArray, ...]) -> FloatArray:
    """Return the points of the chosen readings with an echo, (n, 2) m, at the places of the draft."""
    parts = []
    for scan, place, which in zip(hypotheses.scans, hypotheses.draft.places, chosen, strict=True):
        readings = [scan.readings[k] for k in np.flatnonzero(which) if scan.readings[k].range is not None]
        if not readings:
            continue
        faced = scan.board.faced(place)
        headings = np.array([faced.heading + scan.board.turned(reading.angle) for reading in readings])
        ranges = np.array([reading.range for reading in readings], dtype=np.float64)
        parts.append(points_at(standpoints(scan.board, faced, headings), headings, ranges))
    return np.vstack(parts) if parts else NO_POINTS


class TrackPanel(SearchPanel):
    """Finds where a robot was, by its odometry and its sonar; the plan shows its way and the particles."""

    def __init__(self, session: WindowSession) -> None:
        super().__init__(session, session.tracking, "Track the robot")
        self.everywhere = QtWidgets.QCheckBox("Start anywhere")
        self.everywhere.setToolTip("The first pose is not known")
        self.decision = self.lines = PlainLabel(wordWrap=True)
        self.note.setText(_TRACK_HINT)
        self._update: int | None = None  # the one drawn
        stacked(self, self.everywhere, self.begin, (self.progress, self.cancel), self.note, self.lines, None)
        self._draw()

    def show_state(self, shown: Shown) -> None:
        """Draw the way up to the newest reading shown, which follows a replay."""
        self._allow(self._is_ready and shown.poses is not None, "Needs a room and readings of a robot that moves")
        track: Track | None = self._state.answer
        if track is None or not shown.readings:
            self._update = None
            self._session.showing.draw_track(None)
            return
        ends = np.cumsum([len(headings) for headings, _ in track.readings]).astype(np.intp)
        update = min(int(np.searchsorted(ends, len(shown.readings))), len(ends) - 1)
        if update != self._update:
            self._update = update
            self._session.showing.draw_track(TrackDrawing(track.poses[: update + 1, :2], track.clouds[update]))

    @Slot()
    def _begin(self) -> None:
        self._control.start(self.everywhere.isChecked())

    def _draw(self) -> None:
        track, self._update = self._state.answer, None
        _show(track is None, self.note)
        _show(track is not None, self.lines)
        if track is not None:
            self.lines.setText("\n".join([*track.lines(), *(f"⚠ {doubt}" for doubt in track.doubts)]))
        self.show_state(self._shown)


class ScansPanel(QtWidgets.QWidget):
    """Lists the scans drawn over the one shown, each with colour and eye, and the two that are compared."""

    def __init__(self, session: WindowSession, add: Callable[[], None]) -> None:
        """`add`: asks for a log to add."""
        super().__init__()
        self._scans = session.scans
        self._filling = False
        self.add, self.remove = button("Add log…", "", add), button("Remove", "", self._remove)
        self.keep = button(
            "Keep this scan", "Add the readings shown now; they stay when another scan is shown", session.scans.keep
        )
        self.sweeps = button(
            "Keep sweeps", "Add each sweep of the readings shown as a scan of its own", session.scans.keep_sweeps
        )
        self.list = QtWidgets.QListWidget()
        self.list.setAccessibleName("Scans drawn over the one shown")
        self.list.setIconSize(QSize(_ICON, _ICON))
        self.first, self.second = QtWidgets.QComboBox(), QtWidgets.QComboBox()
        for box in (self.first, self.second):
            ignore_wheel_without_focus(box)
            box.setSizeAdjustPolicy(QtWidgets.QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.activated.connect(self._choose_pair)
        self.note = PlainLabel(_SCANS_HINT, wordWrap=True)
        buttons, pair = QtWidgets.QGridLayout(), QtWidgets.QFormLayout()
        for number, part in enumerate((self.add, self.keep, self.sweeps, self.remove)):
            buttons.addWidget(part, number // 2, number % 2)
        pair.addRow("First", self.first)
        pair.addRow("Second", self.second)
        stacked(self, buttons, self.list, pair, self.note)
        self.list.itemChanged.connect(self._switch)
        self.list.currentRowChanged.connect(self._enable)
        session.scans.changed.connect(self.show_scans)
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
            item = _item(scan.name, f"{scan.name}: {len(scan.series.ranges)} readings")
            item.setIcon(_icon(scan.style))
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Checked if scan.visible else Qt.CheckState.Unchecked)
            self.list.addItem(item)
        self.list.setCurrentRow(min(max(row, 0), len(scans) - 1))
        chosen_pair = (SHOWN, SHOWN) if pair is None else pair
        for box, chosen in zip((self.first, self.second), chosen_pair, strict=True):
            box.clear()
            box.addItem("scan shown", SHOWN)
            for number, scan in enumerate(scans):
                box.addItem(_icon(scan.style), scan.name, number)
            box.setCurrentIndex(box.findData(chosen))
            box.setEnabled(bool(scans))
        self._filling = False
        self._enable()

    @Slot()
    def _enable(self) -> None:
        self.remove.setEnabled(self.list.currentRow() >= 0)
        self.note.setText(
            "The view Differences shows the second scan minus the first." if self.list.count() else _SCANS_HINT
        )

    @Slot()
    def _remove(self) -> None:
        self._scans.remove(self.list.currentRow())

    @Slot(QtWidgets.QListWidgetItem)
    def _switch(self, item: QtWidgets.QListWidgetItem) -> None:
        if not self._filling:
            self._scans.switch(self.list.row(item), item.checkState() is Qt.CheckState.Checked)

    @Slot()
    def _choose_pair(self) -> None:
        self._scans.compare(self.first.currentData(), self.second.currentData())


def _box(offer: Offer) -> QtWidgets.QCheckBox:
    box = QtWidgets.QCheckBox(offer.label)
    box.setToolTip(offer.tip)
    box.setChecked(offer.checked)
    return box


def _list(name: str) -> QtWidgets.QListWidget:
    widget = QtWidgets.QListWidget()
    widget.setAccessibleName(name)
    widget.setWordWrap(True)  # a long line is wider than a narrow panel
    widget.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    return widget


def _item(text: str, tip: str) -> QtWidgets.QListWidgetItem:
    item = QtWidgets.QListWidgetItem(text)
    item.setToolTip(plain_tip(tip))
    return item


def _show(visible: bool, *parts: QtWidgets.QWidget) -> None:
    for part in parts:
        part.setVisible(visible)


def _icon(style: int) -> QIcon:
    """Return the mark of a scan as an icon."""
    colour, symbol = OVERLAYS[style]
    picture = QPixmap(_ICON, _ICON)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    pen = QPen(QColor(colour), 0.14)
    painter.translate(QPointF(_ICON / 2, _ICON / 2))
    painter.scale(_ICON - 5, _ICON - 5)
    painter.setPen(pen)
    painter.drawPath(pg.graphicsItems.ScatterPlotItem.Symbols[symbol])
    painter.end()
    return QIcon(picture)
