"""The session: the state of the window, without widgets.

It owns the shown content, live scan, replay, files and fit, and reports changes by signals. With every tick of its
timer it fetches the results of all threads from their queues.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO
from weakref import ref

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot
from sonarhw_compare.scans import ReadingNote, note_on
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.compilation import Watcher, watch_compilation
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import paths_serve_all_headings
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_writing import save_room

from sonarhw.errors import InputError, SonarError
from sonarhw.log import Log
from sonarhw.readings import Origin, Reading
from sonarhw_gui.jobs.files import (
    CSV,
    LOG,
    ROOM,
    CsvRead,
    Documents,
    FileWatch,
    FollowedLog,
    LogGrown,
    LogOpened,
    RoomOpened,
    WatchedFile,
    import_scan,
    open_log,
    open_room,
    read_grown_log,
    save_file,
)
from sonarhw_gui.jobs.forecast import Forecast
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.jobs.searches import RoomSearch, Search, find_pose, search_causes
from sonarhw_gui.jobs.traces import BScans, BScanSettings, ChosenTrace, bscan_slice, chosen_trace, trace_at
from sonarhw_gui.model.edits import with_board
from sonarhw_gui.model.look import Class, Look, ViewLayer
from sonarhw_gui.model.scene import Edited, History, NoteTexts, Scene, place_warning, room_name
from sonarhw_gui.model.shown import (
    Choice,
    Cursor,
    FoundDrawing,
    OverlaidScan,
    Proposal,
    ScanPair,
    Shown,
    SoundMoment,
    is_same_question,
)
from sonarhw_gui.session.fake_place import FakeNote, place_of
from sonarhw_gui.session.kept import Kept, NoteStore
from sonarhw_gui.session.notices import Notice, NoticeButton, Notices, Preparation, Until
from sonarhw_gui.session.scanner import Live, ScannerBoard, ScannerChoice, ScannerFinder, ScannerTarget, ScanSettings
from sonarhw_gui.session.scans import ScanList
from sonarhw_gui.session.sound import SoundControl
from sonarhw_gui.session.source import Replay, Source, doubt_in
from sonarhw_gui.session.status import PredictionState, ReplayState, Status

# each has a thread of its own, so that a trace never waits for a B-scan
_TRACE, _BSCAN = "traces", "B-scans"
_PAUSE = 0.05  # s between two traces; a person cannot see fifty readings per second


class TraceForecast:
    """Keeps trace and B-scan up to date with the shown content. Results for another scan are dropped."""

    def __init__(self, jobs: Jobs, report: Callable[[str], None]) -> None:
        """`report` gets the errors of traces."""
        self.trace: ChosenTrace | None = None
        self.answer: PredictedScan | None = None  # at the asked heading
        self.bscan: BScans | None = None
        self._newest_bscan: BScans | None = (
            None  # replaces the one above with the next `take`: views refer weakly to it
        )
        self._jobs, self._report = jobs, report
        self._changed = False  # since the last call of `take`
        self._generation = 0
        self._shown: Shown | None = None
        self._settings: BScanSettings | None = None
        self._requested_trace: tuple[object, ...] = ()
        self._requested_at = -_PAUSE
        self._requested_bscan: tuple[object, ...] = ()

    def begin_scan(self) -> None:
        """Drop traces and B-scan; another scan follows."""
        self._generation += 1
        self.trace, self.answer, self.bscan, self._newest_bscan, self._shown = None, None, None, None, None
        self._requested_trace, self._requested_bscan = (), ()

    def request_bscan(self, settings: BScanSettings | None) -> None:
        """Compute the B-scan with these settings from now on; None: it is not visible."""
        self._settings = settings
        self._request_bscan()

    def follow(self, shown: Shown) -> None:
        """Compute trace and B-scan for this content."""
        self._shown = shown
        self._request_trace()
        self._request_bscan()

    def take(self) -> bool:
        """Request a trace that was due too soon, and return whether anything has changed since the last call."""
        self._request_trace()
        self.bscan = self._newest_bscan
        changed, self._changed = self._changed, False
        return changed

    @property
    def _asking(self) -> bool:
        return self._shown is not None and self._shown.asked is not None

    def _request_trace(self) -> None:
        shown = self._shown
        if shown is None:
            return
        if shown.asked is not None:
            self._request_answer(shown, shown.asked)
            return
        self.answer = None
        reading, row = shown.chosen_reading, shown.chosen_row
        if reading is None:
            self.trace, self._requested_trace = None, ()
            return
        prediction, index = (shown.prediction, row.index) if row is not None else (None, 0)
        self._run_trace(chosen_trace, (shown.scene, reading, prediction, index), self._take_trace)

    def _request_answer(self, shown: Shown, heading: float) -> None:
        outline = shown.outline
        if outline is not None and not _is_of_another_scene(outline, shown.scene):
            self._run_trace(trace_at, (shown.scene, outline, heading), self._take_answer)

    def _run_trace(
        self, function: Callable[..., Any], subject: tuple[object, ...], then: Callable[[int, Any], None]
    ) -> None:
        """Call the function with the subject, unless that was requested already. One at a time, with pauses."""
        now = time.monotonic()
        waits = self._jobs.busy(_TRACE) or now - self._requested_at < _PAUSE
        if not waits and not _same(subject, self._requested_trace):
            self._requested_trace, self._requested_at = subject, now
            taken = partial(then, self._generation)
            self._jobs.run(_TRACE, function, *subject, then=taken, failed=self._fail_trace)

    def _take_trace(self, generation: int, trace: ChosenTrace) -> None:
        if generation == self._generation and not self._asking:
            self.trace, self._changed = trace, True
        self._request_trace()  # a newer one

    def _take_answer(self, generation: int, answer: tuple[PredictedScan, ChosenTrace]) -> None:
        if generation == self._generation and self._asking:
            (self.answer, self.trace), self._changed = answer, True
        self._request_trace()  # a newer one

    def _fail_trace(self, message: str) -> None:
        self.trace, self._changed = None, True
        self._report(message)

    def _request_bscan(self) -> None:
        shown, settings = self._shown, self._settings
        if shown is None or settings is None or self._jobs.busy(_BSCAN):
            return  # one at a time: the next continues it
        subject = (shown.scene, shown.readings, shown.outline, settings, shown.look.palette)
        if not _same(subject, self._requested_bscan):
            self._requested_bscan, before = subject, self._newest_bscan.rows if self._newest_bscan else None
            then = partial(self._take_bscan, self._generation)
            self._jobs.run(_BSCAN, bscan_slice, *subject, before, then=then, failed=self._report)

    def _take_bscan(self, generation: int, bscan: BScans) -> None:
        if generation == self._generation:
            before, self._newest_bscan, self._changed = self._newest_bscan, bscan, True
            if bscan.rows.unreadable and (before is None or bscan.rows.unreadable != before.rows.unreadable):
                self._report(bscan.rows.unreadable)
            if bscan.rows.done < 1:
                self._requested_bscan = ()
        self._request_bscan()  # the remaining rows, or a newer request


def _is_of_another_scene(outline: PredictedScan, scene: Scene) -> bool:
    """Return whether an outline is of a previous scene, and its paths must not be used for this one."""
    if not paths_serve_all_headings(scene.board, scene.options.unit):
        return False  # its paths are not used
    return outline.room is not scene.room or outline.place != scene.pose or outline.board is not scene.board


def _same(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))


# The model of the views: the scene and its edits, its prediction, and the selected reading.
#
# Every change emits `Shown`, at once or with the next tick.


_NEXT_READING = 0.04  # s after the last readings, within which a fast scan delivers the next


class ShownModel(QObject):
    """The content of the views, and the actions that change it."""

    changed = Signal(object)  # Shown
    edited = Signal()  # the scene was edited; `changed` may follow later

    def __init__(
        self,
        scene: Scene,
        look: Look,
        source: Callable[[], Source],
        jobs: Jobs,
        notes: NoteStore,
        report: Callable[[str], None],
        parent: QObject,
    ) -> None:
        """`source` returns where the readings come from; `report` gets errors of traces."""
        super().__init__(parent)
        self.shown = Shown(scene, look=look, origin=source().origin)
        self.history = History()
        self.forecast, self.traces = Forecast(jobs), TraceForecast(jobs, report)
        self._source, self._notes = source, notes
        self._choice = Choice()
        self._update_due = False  # whether something has changed since the last update of the views
        self._results_due = False  # likewise, for results of the threads
        self._read_at = -math.inf  # time of the last new readings

    @Slot(object, str, object)
    def edit(self, scene: Scene, label: str, gesture: object = None) -> None:
        """Change the scene; `label` names the edit and follows the word Undo in the menu.

        All edits with the same `gesture` object, if it is not None, are undone together.
        """
        if scene is not self.shown.scene:
            self.history.remember(self.shown.scene, label, gesture)
            self._change(scene, moving=gesture is not None)

    @Slot()
    def undo(self) -> None:
        """Undo the last edit."""
        self._restore(self.history.undo(self.shown.scene, self.shown.notes))

    def undo_steps(self, count: int) -> None:
        """Undo the last `count` edits."""
        for _ in range(count):
            self.undo()

    @Slot()
    def redo(self) -> None:
        """Repeat the edit that was undone last."""
        self._restore(self.history.redo(self.shown.scene, self.shown.notes))

    @Slot(object)
    def cancel(self, gesture: object) -> None:
        """Undo the edits of an unfinished gesture, without a step in the history."""
        self._restore(self.history.cancel(gesture))

    @Slot(int, str)
    def pin(self, reading: int, text: str) -> None:
        """Pin a note to a reading; an empty text deletes the note."""
        before, notes = self.shown.notes, self.shown.notes.with_note(reading, text)
        if notes != before:
            verb = "adding" if not before.of(reading) else "editing" if text else "deleting"
            self.history.remember(before, f"{verb} a note")
            self._change_notes(notes)

    def open_notes(self) -> None:
        """Show the notes that are stored for the log of the readings."""
        self._emit(replace(self.shown, notes=self._notes.open(self._log, self._source().readings)))

    @property
    def pinned_notes(self) -> tuple[ReadingNote, ...]:
        """The notes, with what identifies their readings in the log."""
        readings = self._source().readings
        return tuple(note_on(readings[place], text) for place, text in self.shown.notes.by_reading.items())

    def has_reading(self, place: int, reading: Reading) -> bool:
        """Return whether this reading is at this place of the scan; the source may have changed."""
        readings = self._source().readings
        return place < len(readings) and readings[place] is reading

    @property
    def _log(self) -> Path | None:
        path = self._source().path
        return None if path is None else path.absolute()

    def _restore(self, state: Edited | None) -> None:
        match state:
            case NoteTexts():
                self._change_notes(state)
            case Scene():
                self._change(state)

    def _change_notes(self, notes: NoteTexts) -> None:
        self._emit(replace(self.shown, notes=notes))
        self._notes.save(notes, self._source().readings, self._log)

    def _change(self, scene: Scene, moving: bool = False) -> None:
        self.shown = replace(self.shown, scene=scene)
        self.forecast.change_scene(scene, moving)
        if moving:
            self._update_due = True  # the mouse moves more often than the views are updated
        else:
            self.refresh()
        self.edited.emit()

    @Slot(str)
    def set_place(self, name: str) -> None:
        """Put the sensor at another place of the room."""
        scene = self.shown.scene
        if scene.room is not None and name != scene.pose.name:
            self.edit(replace(scene, place=scene.room.place(name)), f"moving to {name}")

    @Slot(int)
    def choose(self, index: int) -> None:
        """Select a reading."""
        self._forget_question()
        self._choice.pick(index)
        self.refresh()

    @Slot()
    def follow_newest(self) -> None:
        """Select the newest reading, and follow it; without readings, end the question about a heading."""
        self._forget_question()
        self._choice.follow_newest()
        self.refresh()

    @Slot()
    def choose_next(self) -> None:
        """Select the next reading; after the last one, the first."""
        self._choose_step(1)

    @Slot()
    def choose_previous(self) -> None:
        """Select the previous reading; before the first one, the last."""
        self._choose_step(-1)

    def _choose_step(self, by: int) -> None:
        self._forget_question()
        self._choice.step(by, self.shown.chosen, len(self.shown.readings))
        self.refresh()

    @Slot(float)
    def ask(self, heading: float) -> None:
        """Explain a heading (rad in the room) without a reading, until a reading is selected."""
        if self.shown.scene.room is not None:
            self.shown = replace(self.shown, asked=heading % math.tau, pointed_path=None)
            self._update_due = True  # the mouse moves more often than the views are updated

    @Slot(float)
    def turn_question(self, by: float) -> None:
        """Ask the heading that is `by` (rad) counter-clockwise of the present beam, on a grid of `by`."""
        before = self.shown.due_heading
        before = self.shown.scene.pose.heading if before is None else before
        self.ask((round(before / abs(by)) + math.copysign(1, by)) * abs(by))

    @Slot(object)
    def point_at_path(self, path: int | None) -> None:
        """Draw one path of the list of echoes; None: none."""
        if path != self.shown.pointed_path:
            self.shown = replace(self.shown, pointed_path=path)
            self._update_due = True

    @Slot(object)
    def propose(self, proposal: Proposal | None) -> None:
        """Draw a proposed change of the room; None: none."""
        if proposal is not self.shown.proposal:
            self.shown = replace(self.shown, proposal=proposal)
            self._update_due = True

    @Slot(object)
    def draw_found(self, found: FoundDrawing | None) -> None:
        """Draw the state of a search for the room; None: nothing."""
        if found is not self.shown.found:
            self.shown = replace(self.shown, found=found)
            self._update_due = True

    @Slot(object, object)
    def overlay(self, scans: tuple[OverlaidScan, ...], pair: ScanPair | None) -> None:
        """Draw other scans over the readings, and compare two."""
        self.shown = replace(self.shown, overlays=scans, pair=pair)
        self._update_due = True

    def set_sound(self, sound: SoundMoment | None) -> None:
        """Draw the sound at a moment; None: none."""
        self.shown = replace(self.shown, sound=sound)
        self._update_due = True

    def _forget_question(self) -> None:
        self.shown = replace(self.shown, asked=None, answer=None, pointed_path=None)

    @Slot(object)
    def point_at(self, cursor: Cursor | None) -> None:
        """Show the position of the pointer in every view."""
        if cursor != self.shown.cursor:
            self.shown = replace(self.shown, cursor=cursor)
            self._update_due = True

    @Slot(object)
    def request_bscan(self, settings: BScanSettings | None) -> None:
        """Compute the B-scan with these settings; None: it is not visible."""
        self.traces.request_bscan(settings)

    @Slot(object, bool)
    def switch(self, layer: Class | ViewLayer, visible: bool) -> None:
        """Show or hide a class of readings, or another layer, in every view."""
        hidden = self.shown.hidden - {layer} if visible else self.shown.hidden | {layer}
        if hidden != self.shown.hidden:
            self._emit(replace(self.shown, hidden=hidden))

    @Slot()
    def show_all(self) -> None:
        """Show every class and layer again."""
        self._emit(replace(self.shown, hidden=frozenset()))

    def set_look(self, look: Look) -> None:
        """Draw everything in another palette, unit or size."""
        if look != self.shown.look:
            self._emit(replace(self.shown, look=look))

    # called by the session

    def drop_readings(self) -> None:
        """Drop what belongs to the readings: others follow."""
        self._forget_question()
        self.history.forget_notes()
        self.shown = replace(self.shown, notes=self._notes.open(None, ()))
        self._choice.follow_newest()
        self.forecast.begin_scan()
        self.traces.begin_scan()

    def replace_scene(self, scene: Scene) -> None:
        """Show the readings in another scene; earlier edits can no longer be undone."""
        self.history.clear()
        self.shown = replace(self.shown, scene=scene)
        self.forecast.set_scene(scene)
        self.follow(self._source().readings)
        self.refresh()

    def take_saved(self, room: Room, file: str) -> None:
        """Take the room as it was saved, with its places, and its file name; `refresh` shows the name."""
        scene = self.shown.scene
        if room is not scene.room and scene.place is not None:
            self._change(replace(scene, room=room, place=room.places[scene.place.name]))
        # later, because another room in another file would be fitted to the view
        self.shown = replace(self.shown, scene=replace(self.shown.scene, room_file=file))

    def follow(self, readings: Sequence[Reading]) -> None:
        """Compare these readings."""
        self.forecast.follow(readings)

    def update_soon(self) -> None:
        """Update the views with the next tick."""
        self._update_due = True

    def tick(self, new_readings: bool) -> None:
        """Update the views if anything has changed, also predictions and traces."""
        traced, now = self.traces.take(), time.monotonic()
        self._results_due = self.forecast.take() or traced or self._results_due
        if new_readings:
            self._read_at = now
        # each update repaints the window, so results of a fast scan are shown together with its next readings
        waits = now - self._read_at < _NEXT_READING and not self.forecast.dragging
        if new_readings or self._update_due or (self._results_due and not waits):
            self.refresh()

    def refresh(self) -> None:
        """Update the views now."""
        readings, compared = self._source().shown, self.forecast.compared
        chosen = self._choice.among(len(readings), compared.end if compared else 0)
        self.forecast.prefer(chosen)
        shown = replace(
            self.shown,
            outline=self.forecast.outline,
            chances=self.forecast.chances,
            compared=compared,
            outdated=self.forecast.outdated,
            readings=readings,
            origin=self._source().origin,
            earlier=self.shown.known_rows,
            chosen=chosen,
        )
        self._emit(shown)

    def _emit(self, shown: Shown) -> None:
        self.traces.follow(shown)
        before = self.shown
        bscan = None if self.traces.bscan is None else ref(self.traces.bscan)
        after = replace(shown, trace=self.traces.trace, answer=self.traces.answer, bscan_ref=bscan)
        # rows of paths differ between predictions
        same = is_same_question(before.question, after.question)
        self.shown = after if same else replace(after, pointed_path=None)
        self._update_due = self._results_due = False
        self.changed.emit(self.shown)


# The timer of the window: it ticks regularly, and sooner when a reading has arrived.


TICK = 30  # ms
# ms between two ticks for readings; each paints the window. The fastest board makes 50 readings per second.
_READING_TICK = 18
_DRAG_TICK = 5  # ms: a draft that waits for its tick is late for the hand; a tick without news takes 0.3 ms


class TickTimer(QObject):
    """Emits `due` every TICK ms, more often during a drag, and soon after `wake`."""

    due = Signal()
    _woken = Signal()

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._last = -TICK / 1000  # time of the last tick, s
        self._waking = False  # whether `_woken` was emitted since the last tick
        self._timer = QTimer(self, interval=TICK, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._woken.connect(self._hurry, Qt.ConnectionType.QueuedConnection)
        self.start, self.stop = self._timer.start, self._timer.stop

    def wake(self) -> None:
        """Tick as soon as _READING_TICK has passed since the last tick. Any thread may call this."""
        if not self._waking:
            self._waking = True
            self._woken.emit()

    @Slot()
    def _hurry(self) -> None:
        if self._timer.isActive():
            since = 1000 * (time.monotonic() - self._last)
            self._timer.start(max(0, round(_READING_TICK - since)))

    @Slot()
    def _tick(self) -> None:
        self._last, self._waking = time.monotonic(), False
        self._timer.start(TICK)
        self.due.emit()

    def follow_drag(self, dragging: bool) -> None:
        """Tick more often during a drag."""
        interval = _DRAG_TICK if dragging else TICK
        if self._timer.isActive() and not self._waking and self._timer.interval() != interval:
            self._timer.start(interval)


_BUSY = "a scan is running; stop it before you connect another scanner"
_LONGEST_TICK = 0.25  # s; on a busy machine a replay slows down instead of skipping readings


class WindowSession(QObject):
    """The state of one window, and the actions of its user."""

    status_changed = Signal(object)  # Status
    replay_changed = Signal(object)  # Replay; None without one
    import_asked = Signal(str)  # path of a CSV scan
    room_opened = Signal()  # a room file was opened or reloaded
    saved = Signal(str)  # message, after a file was saved
    recent_changed = Signal(object)  # tuple of paths, newest first

    def __init__(
        self,
        scene: Scene,
        scanner: ScannerTarget | None,
        scan_settings: ScanSettings,
        look: Look | None,
        find_scanner: ScannerFinder | None,
        memory: Path | None,
    ) -> None:
        """`memory`: the file of what the next start restores; None: nothing is stored."""
        super().__init__()
        self._ticking = False
        self.jobs, self.notices = Jobs(self), Notices(self)
        self.kept = Kept(memory, self.notices, self.restore_room)
        self.status = Status(chosen=scanner is not None, settings=scan_settings)
        self.scanners = ScannerChoice(scanner, find_scanner, self.jobs, self.notices, self)
        self._timer = TickTimer(self)
        self.live = Live(scanner, scan_settings, self.notices, self._timer.wake)
        self.replay: Replay | None = None
        self._before_replay: Scene | None = None
        self._scanner_place, self.scanner_board = place_of(scanner, scene), ScannerBoard()
        self.showing = ShownModel(
            scene, look or Look(), lambda: self.source, self.jobs, self.kept.notes, self._report_trace, self
        )
        self.kept.rooms.open(scene)
        self.documents = Documents(scan_settings.folder)
        self.files, self._followed = FileWatch(), FollowedLog()
        self.fitting = Search("fit", find_pose, lambda: self.shown, self.jobs, self)
        self.causes = Search("causes", search_causes, lambda: self.shown, self.jobs, self)
        self.scans = ScanList(lambda: self.shown, lambda: self.log_file, self.jobs, self)
        self.finding = RoomSearch(lambda: self.shown, lambda: Path(self.log_file).stem or "this scan", self.jobs, self)
        self.sound = SoundControl(self)
        self.preparation = Preparation()
        watch_compilation(self.preparation)
        self._begun = False
        self._scan_due = False  # whether to scan as soon as there is a prediction
        self._last_tick = time.monotonic()
        self._connect()

    def _connect(self) -> None:
        self.jobs.failed.connect(self.notices.fail)
        for part in (self.fitting, self.causes, self.scans):
            part.failed.connect(self.notices.fail)
        self.finding.failed.connect(self._fail_search)
        self.finding.settled.connect(self._settle_search)
        self.replay_changed.connect(self._follow_replay)
        self.showing.edited.connect(self._follow_edit)
        self.showing.changed.connect(self.sound.follow)
        self.scans.changed.connect(self.showing.overlay)
        self.sound.changed.connect(self._follow_sound)
        self.scanners.chosen.connect(self._use)
        self._timer.due.connect(self.tick)

    @Slot()
    def begin(self) -> None:
        """Begin to predict and to fetch results, after the first paint, which kernels would delay by 0.3 s."""
        if not self._begun:
            self._begun = True
            self.showing.replace_scene(self.shown.scene)
            self._timer.start()

    @property
    def shown(self) -> Shown:
        """The content shown now."""
        return self.showing.shown

    # actions of the user

    @Slot()
    def scan(self) -> None:
        """Scan with the chosen scanner, and record."""
        self._scan_due = False
        if self.live.target is not None and not self.live.running:
            self.notices.clear()
            self._drop_readings()
            self._place_scanner(self.shown.scene)
            self._set_replay(None)
            self.live.start(self.shown.scene, self.scanner_board.wanted)
            self.showing.update_soon()

    def _place_scanner(self, scene: Scene) -> None:
        """Put a fake scanner that follows the plan into the scene; of any other scanner, say that it is elsewhere."""
        place, target = self._scanner_place, self.live.target
        if place.follow is not None and target is not None and scene.room is not None:
            if not place.is_in(scene):
                self.live.use(replace(target, opener=place.follow(scene)))
                self._scanner_place = replace(place, scene=scene)
        elif doubt := place.doubt(scene):
            self.notices.warn(doubt)
            self._scanner_place = place.moved(scene)  # a real scanner is named once

    def scan_when_predicted(self) -> None:
        """Scan as soon as there is a prediction, so that the readings appear over it; without a room, at once."""
        self._scan_due = True
        self._scan_if_due()

    def _scan_if_due(self) -> None:
        due = self._scan_due and not self.live.running
        if due and (self.shown.scene.room is None or self.shown.outline is not None):
            self.scan()

    @Slot()
    def stop(self) -> None:
        """Stop the job of the scanner, and pause the replay."""
        self._scan_due = False
        self.live.stop()
        self.in_replay(Replay.pause)

    def in_replay(self, act: Callable[[Replay], object]) -> None:
        """Do something with the log that is replayed; without one, nothing."""
        if self.replay is not None:
            act(self.replay)

    def _set_replay(self, replay: Replay | None) -> None:
        """Show the readings of a log from now on; None: those of the scanner."""
        if replay is not self.replay:
            self.replay = replay
            self.replay_changed.emit(replay)

    def show_log(self, log: Log, name: str = "the log", path: Path | None = None) -> None:
        """Show all readings of a log for replay; `path`: its file."""
        self._drop_readings()
        self.showing.follow(log.readings)
        self._set_replay(Replay(log, name, path, self.replay_changed.emit))
        self.showing.open_notes()
        if log.torn:
            now = time.monotonic()
            remedy = "; to repair it: `sonarhw log recover`" if log.readings else ""
            self._followed.follow(
                path, f"{name}: {log.torn}; {len(log.readings)} whole readings are shown{remedy}", now
            )
            self._warn_of_torn(now)
        elif not log.readings:
            self.notices.warn(f"{name}: contains no readings")
        doubts = (place_warning(log.metadata, self.shown.scene), *(scan.angle_warning for scan in log.scans))
        for doubt in filter(None, doubts):
            self.notices.warn(f"{name}: {doubt}")

    @Slot()
    def leave_replay(self) -> None:
        """Close the log, and return to the last live scan in the scene from before the replay."""
        if self.replay is not None:
            self.notices.clear()
            self._drop_readings()
            self._set_replay(None)
            if self._before_replay is not None:
                self.set_scene(self._before_replay)
            self.showing.follow(self.live.readings)
            self.showing.open_notes()

    def set_scene(self, scene: Scene, source: Path | None = None) -> None:
        """Show the readings in another scene; earlier edits can no longer be undone.

        `source`: the file of unsaved changes that the scene was restored from, if any.
        """
        self.fitting.cancel()
        self.causes.cancel()
        self.showing.replace_scene(scene)
        self.kept.rooms.open(scene, source)
        self._update_status()

    @Slot(str)
    def open_file(self, path: str) -> None:
        """Open a log, or a room for the current readings; a log is shown in its own room if it has one.

        For a CSV scan, the user is asked how to read it.
        """
        file, ending = Path(path), Path(path).suffix.lower()
        if ending == CSV:
            self.import_asked.emit(path)
        elif ending == LOG:
            self.open_log(file)
        elif ending == ROOM:
            self.open_room(file)
        else:
            self.notices.fail(f"{file.name}: expected a log ({LOG}), a room ({ROOM}) or a scan as {CSV}")

    def open_log(self, path: Path, last_scene: Scene | None = None) -> None:
        """Open a log; `last_scene`: the scene of the last session instead of that in the log."""
        self._open("open a log", open_log, path, last_scene, take=self._take_log)

    def open_room(self, room: Path | str) -> None:
        """Open a room file, or a shipped room by its name."""
        self._open("open a room", open_room, room, self.shown.scene.board, take=self._take_room)

    @Slot(object)
    def import_csv(self, csv: CsvRead) -> None:
        """Import a CSV scan as a log in the folder of recordings, and open the log."""
        self._open("import a scan", import_scan, csv, self.live.settings.folder, take=self._take_log)

    def _open(self, key: str, function: Callable[..., Any], *args: object, take: Callable[[Any], None]) -> None:
        self.jobs.run(key, function, *args, then=partial(self._take_opened, take), lane="open files")

    @Slot(str)
    def open_board(self, path: str) -> None:
        """Predict with the board profile in a file. An invalid profile is reported and changes nothing."""
        try:
            self.showing.edit(*with_board(self.shown.scene, load_board(path)))
            self.files.watch(WatchedFile.BOARD, Path(path))
        except InputError as error:
            self.notices.fail(str(error))

    @Slot(object)
    def restore_room(self, path: Path) -> None:
        """Show the unsaved room in a file of the folder of unsaved rooms. Raises InputError."""
        self.set_scene(self.kept.rooms.restored(path, self.shown.scene), path)

    @Slot(str)
    def save_room(self, path: str) -> None:
        """Save the room with the sensor's place. An existing file is overwritten: the dialog has asked the user."""
        room, file = self.shown.scene.written_room, Path(path)
        try:
            if room is None:
                raise InputError("there is no room to save; open a room file")
            save_room(room, file, overwrite=True)
        except SonarError as error:
            self.notices.fail(str(error))
            return
        self.documents.add(file)
        self.documents.saved_in = file.absolute().parent
        self.showing.take_saved(room, file.name)
        self.kept.rooms.saved(self.shown.scene)
        self.showing.refresh()
        self.files.watch(WatchedFile.ROOM, file)

    def save(
        self, write: Callable[[BinaryIO], None], endings: Sequence[str], path: Path, overwrite: bool = False
    ) -> None:
        """Save a file, also if the window is closed meanwhile; `overwrite`: the user has agreed to overwrite it.

        `write` writes it, `endings` are its possible extensions: see `save_file`.
        """
        self.jobs.run(
            f"save {path}",
            save_file,
            write,
            endings,
            path,
            overwrite,
            then=lambda saved: self.saved.emit(f"saved: {saved}"),
            lane="save files",
            at_close=True,
        )

    @Slot()
    def play_sound(self) -> None:
        """Play the sound of the asked heading or the selected reading, or end that."""
        if self.sound.state is None:
            self.sound.open(self.shown)
        else:
            self.sound.close()

    @Slot(object)
    def _use(self, target: ScannerTarget) -> None:
        if self.live.running:
            self.notices.warn(_BUSY)
            return
        self.leave_replay()
        self.scanners.remember(target)
        self.live.use(target)
        if target.scene is not None:
            self.set_scene(target.scene)
        self.scanner_board.wanted = target.scene is None
        self._scanner_place = place_of(target, self.shown.scene)
        self.live.connect()

    @property
    def source(self) -> Source:
        """What the readings shown come from."""
        return self.live if self.replay is None else self.replay

    @property
    def log_file(self) -> str:
        """The file of the readings shown: a replayed log, or the recording of the last scan. Empty if there is none."""
        path = self.source.path
        return "" if path is None else str(path.absolute())

    def remember_used(self, recent: tuple[str, ...], urls: tuple[str, ...]) -> None:
        """Set the lists of recent files and scanners."""
        self.documents.recent, self.scanners.urls = recent, urls
        self.recent_changed.emit(recent)

    def close(self) -> None:
        """Stop the board, close the log, end all threads. A second call has no effect."""
        self._begun = True  # a window that is closed before its first paint begins nothing
        self._timer.stop()
        self.kept.rooms.write()
        self.live.close()
        self.jobs.close()
        watch_compilation(Watcher())

    # updates

    @Slot()
    def tick(self) -> None:
        """Fetch the results of all threads since the last tick, and emit the changes."""
        now = time.monotonic()
        elapsed, self._last_tick = min(now - self._last_tick, _LONGEST_TICK), now
        self.jobs.tick()
        self.finding.tick()
        self._look_at_files(now)
        self._ticking = True
        self.in_replay(lambda replay: replay.advance(elapsed))
        self._ticking = False
        self.sound.advance(elapsed)
        self.showing.tick(self._take_readings())
        self._scan_if_due()
        self.kept.tick(now)
        if doubt := self.preparation.take_doubt():
            self.notices.warn(doubt)
        self._update_status()
        self._timer.follow_drag(self.showing.forecast.dragging)

    def _report_trace(self, why: str) -> None:
        """Report that a trace cannot be read or computed. A log that can no longer be read loses its traces."""
        if not why:
            return
        if self.replay is None:
            self.notices.warn(why)
        else:
            self.notices.fail(f"{why}. The replay is paused; readings are shown without traces")
            self.replay.drop_traces()

    @Slot(str)
    def _fail_search(self, message: str) -> None:
        self.notices.fail(message, Until.SEARCH_CHANGED)

    @Slot()
    def _settle_search(self) -> None:
        self.notices.end(Until.SEARCH_CHANGED)

    def _take_opened(self, take: Callable[[Any], None], opened: LogOpened | RoomOpened) -> None:
        if opened.path is not None:
            self.documents.add(opened.path)
        self.recent_changed.emit(self.documents.recent)
        if not self.live.running:  # else requested before the scan began; it would change the room of the scan
            take(opened)
        if isinstance(opened, LogOpened) and opened.notice:
            self.notices.fail(opened.notice)

    def _take_log(self, opened: LogOpened) -> None:
        self.notices.clear()
        self.files.watch(WatchedFile.ROOM, None)
        here, metadata = self.shown.scene, opened.log.metadata
        if self.replay is None:
            self._before_replay = here
        board = opened.scene.board if metadata.board or metadata.board_text else here.board
        self.set_scene(opened.scene if opened.scene.room else replace(here, board=board))
        self.show_log(opened.log, opened.path.name, opened.path)
        if opened.scene.room_file != metadata.room_file:  # restored; edits of the own room need no warning
            self._warn_if_recorded_elsewhere(opened.scene)

    def _take_room(self, opened: RoomOpened) -> None:
        scene = opened.at_known_place(self.shown.scene, self.source.recorded_in.place)
        self._scanner_place = place = self._scanner_place.moved(scene)
        if place.follow is None and (doubt := place.doubt(scene)):
            self.notices.warn(doubt)
        self._warn_if_recorded_elsewhere(scene)
        self.set_scene(scene)
        self.files.watch(WatchedFile.ROOM, opened.path)
        self.room_opened.emit()

    def _take_grown(self, grown: LogGrown) -> None:
        if self.live.running:
            return
        self._followed.rest(grown.took, time.monotonic())
        replay = self.replay
        if replay is None or replay.path != grown.path:
            return
        replay.extend(grown.log)
        self.showing.follow(replay.readings)
        if not grown.log.torn:
            self._followed.stop()

    def _warn_of_torn(self, now: float) -> None:
        for warning in self._followed.due_warnings(now):
            self.notices.warn(warning)

    def _look_at_files(self, now: float) -> None:
        """Follow a log that grows, and offer to reload a changed room or board."""
        self._warn_of_torn(now)
        if grown := self._followed.grown_file(now):
            self.jobs.run("follow a log", read_grown_log, grown, then=self._take_grown, lane="open files")
        for what, path in self.files.changed(now):
            again = NoticeButton("Reload the board", self.open_board, str(path))
            if what is WatchedFile.ROOM:
                again = NoticeButton("Reload the room", self.open_room, path)
            self.notices.add(Notice(f"{path.name} has changed on disk", again))

    def _warn_if_recorded_elsewhere(self, scene: Scene) -> None:
        if doubt := doubt_in(self.source, scene):
            self.notices.warn(doubt)

    def _take_readings(self) -> bool:
        if self.live.newly_connected():  # before its errors are taken
            self.notices.end(Until.CONNECTED)
            if board := self.scanner_board.instead_of(self.shown.scene.board, self.live.link):
                self.showing.edit(*with_board(self.shown.scene, board))
                self.notices.warn(f"the scanner has board {board.name}, which is used from now on; Ctrl+Z undoes this")
        fresh = self.live.take(self._last_tick)
        if fresh:
            self.showing.follow(self.live.readings)
        return fresh

    def _drop_readings(self) -> None:
        """Prepare for other readings."""
        self._followed.stop()
        self.fitting.cancel()
        self.causes.cancel()
        self.showing.drop_readings()

    @Slot()
    def _follow_replay(self) -> None:
        if self._ticking:
            self.showing.update_soon()  # together with the other changes of this tick
        else:
            self.showing.refresh()

    @Slot()
    def _follow_sound(self) -> None:
        self.showing.set_sound(self.sound.moment)

    @Slot()
    def _follow_edit(self) -> None:
        self.kept.rooms.change(self.shown.scene, time.monotonic())
        self._update_status()

    @Slot()
    def _update_status(self) -> None:
        status = self._made_status(time.monotonic())
        self.notices.set_state(status.trouble)
        if status != self.status:
            self.status = status
            self.status_changed.emit(status)

    def _made_status(self, now: float) -> Status:
        live, source, scene, forecast = self.live, self.source, self.shown.scene, self.showing.forecast
        readings, replay, note = source.shown, None, None
        if self.replay is not None:
            temperature = readings[-1].temperature_c if readings else None
            replay = ReplayState(self.replay.name, self.replay.lost, temperature, self._followed.grows(now))
        if source.origin is Origin.FAKE:
            note = self._scanner_place.note(scene) if replay is None else FakeNote()
        same_room = live.scene is not None and room_name(scene) == room_name(live.scene)
        return Status(
            job=live.job,
            link=live.link,
            replay=replay,
            prediction=PredictionState(
                forecast.searching, self.shown.outdated, forecast.uncompared, self.preparation.progress
            ),
            chosen=live.target is not None,
            settings=live.settings,
            scan_due=self._scan_due,
            readings=len(readings),
            rate=source.meter.rate(now),
            own_readings=bool(readings) and live.made_readings and same_room,
            fake=note,
        )


# Updates that are done in turns, so that no frame has to wait for all of them.


class Turns(QObject):
    """Parts of one update: all at once, or one after another with a pause."""

    def __init__(self, parts: Sequence[Callable[[], None]], interval: int, parent: QObject) -> None:
        """`interval`: pause between two parts, ms."""
        super().__init__(parent)
        self._parts = parts
        self._next = self._due = 0  # the next part, and how many are due
        self._timer = QTimer(self, singleShot=True, interval=interval)
        self._timer.timeout.connect(self._take_turn)

    def all_now(self) -> None:
        """Update all parts."""
        self._timer.stop()
        self._due = 0
        for part in self._parts:
            part()

    def soon(self) -> None:
        """Update each part once more, in turns."""
        self._due = len(self._parts)
        if not self._timer.isActive():
            self._timer.start()

    def advance(self) -> None:
        """Update each part once more, in turns, the first at once: one part with each frame, the last by the timer."""
        self._due = len(self._parts)
        self._take_turn()

    @Slot()
    def _take_turn(self) -> None:
        part = self._parts[self._next]
        self._next = (self._next + 1) % len(self._parts)
        self._due -= 1
        if self._due > 0:
            self._timer.start()
        else:
            self._timer.stop()
        part()
