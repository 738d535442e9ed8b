"""What the views show: the scene and its edits, its prediction and traces, the selected reading, scans over it."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from weakref import ref

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.scans import ReadingNote, note_on
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import paths_serve_all_headings
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError
from sonarhw.log import read_log
from sonarhw.readings import Reading
from sonarhw_gui.jobs.forecast import Forecast
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.jobs.traces import BScans, BScanSettings, ChosenTrace, bscan_slice, chosen_trace, trace_at
from sonarhw_gui.model.look import OVERLAYS, Class, Look, ViewLayer
from sonarhw_gui.model.scene import Edited, History, NoteTexts, Scene, scene_of_log
from sonarhw_gui.model.shown import (
    SHOWN,
    Cursor,
    FoundDrawing,
    OverlaidScan,
    Proposal,
    ScanPair,
    Shown,
    SoundState,
    TrackDrawing,
    is_same_question,
    overlaid,
)
from sonarhw_gui.session.kept import NoteStore
from sonarhw_gui.session.source import Source

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
        self._release_bscan(shown)

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

    def _release_bscan(self, shown: Shown) -> None:
        """Drop the predicted rows of another prediction, and with them its paths, while no B-scan is visible."""
        bscan = self._newest_bscan
        if self._settings is not None or bscan is None or bscan.rows.outline is None:
            return
        if bscan.rows.outline is not shown.outline:
            self._newest_bscan = replace(bscan, rows=replace(bscan.rows, outline=None, predicted={}, done=0.0))
            self._requested_bscan = ()

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


def _same(parts: tuple[object, ...], others: tuple[object, ...]) -> bool:
    return len(parts) == len(others) and all(a is b for a, b in zip(parts, others, strict=True))


# The model of the views: the scene and its edits, its prediction, and the selected reading.
#
# Every change emits `Shown`, at once or with the next tick.


_NEXT_READING = 0.04  # s after the last readings, within which a fast scan delivers the next
_NEXT_DRAFT = 0.05  # s after an update, within which a drag waits for the next draft


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
        self._picked: int | None = None  # the reading that the user has selected; None: the newest is
        self._update_due = False  # whether something has changed since the last update of the views
        self._results_due = False  # likewise, for results of the threads
        self._read_at = self._refreshed_at = -math.inf  # times of the last new readings, and of the last update

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
        self._picked = index
        self.refresh()

    @Slot()
    def follow_newest(self) -> None:
        """Select the newest reading, and follow it; without readings, end the question about a heading."""
        self._forget_question()
        self._picked = None
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
        if self.shown.chosen is not None:
            self._picked = (self.shown.chosen + by) % len(self.shown.readings)
        self.refresh()

    @Slot(float)
    def ask(self, heading: float) -> None:
        """Explain a heading (rad in the room) without a reading, until a reading is selected."""
        if self.shown.scene.room is not None and self.shown.poses is None:
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
    def draw_found(self, drawing: FoundDrawing | None) -> None:
        """Draw the state of a search for the room; None: nothing."""
        if drawing is not self.shown.found_room:
            self.shown = replace(self.shown, found_room=drawing)
            self._update_due = True

    @Slot(object)
    def draw_track(self, drawing: TrackDrawing | None) -> None:
        """Draw where a robot was found; None: nothing."""
        if drawing is not self.shown.track:
            self.shown = replace(self.shown, track=drawing)
            self._update_due = True

    @Slot(object, object)
    def overlay(self, scans: tuple[OverlaidScan, ...], pair: ScanPair | None) -> None:
        """Draw other scans over the readings, and compare two."""
        self.shown = replace(self.shown, overlays=scans, pair=pair)
        self._update_due = True

    def set_sound(self, sound: SoundState | None) -> None:
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
        self._picked = None
        self.forecast.begin_scan()
        self.traces.begin_scan()

    def replace_scene(self, scene: Scene) -> None:
        """Show the readings in another scene; earlier edits can no longer be undone."""
        self.history.clear()
        self.shown = replace(self.shown, scene=scene)
        self.forecast.set_scene(scene)
        self.forecast.follow(self._source().readings)
        self.refresh()

    def take_saved(self, room: Room, file: str) -> None:
        """Take the room as it was saved, with its places, and its file name; `refresh` shows the name."""
        scene = self.shown.scene
        if room is not scene.room and scene.place is not None:
            self._change(replace(scene, room=room, place=room.places[scene.place.name]))
        # later, because another room in another file would be fitted to the view
        self.shown = replace(self.shown, scene=replace(self.shown.scene, room_file=file))

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
        if new_readings or ((self._update_due or (self._results_due and not waits)) and not self._waits_for_draft(now)):
            self.refresh()

    def _waits_for_draft(self, now: float) -> bool:
        """Return whether a movement of a drag is better shown together with its outline, compared with the readings."""
        forecast, shown = self.forecast, self.shown
        if not forecast.dragging or now - self._refreshed_at >= _NEXT_DRAFT:
            return False
        return forecast.compared is shown.compared if shown.readings else forecast.outline is shown.outline

    def refresh(self) -> None:
        """Update the views now."""
        self._refreshed_at = time.monotonic()
        readings, compared = self._source().shown, self.forecast.compared
        chosen = self._chosen(len(readings), compared.end if compared else 0)
        self.forecast.prefer(chosen)
        poses = self.shown.scene.poses_of(readings)
        shown = replace(
            self.shown,
            # an outline is that of one place
            outline=self.forecast.outline if poses is None else None,
            chances=self.forecast.chances if poses is None else None,
            compared=compared,
            outdated=self.forecast.outdated,
            readings=readings,
            poses=poses,
            origin=self._source().origin,
            earlier=self.shown.known_rows,
            chosen=chosen,
        )
        self._emit(shown)

    def _chosen(self, count: int, compared: int) -> int | None:
        """Return the selected one of `count` readings; None if there are none.

        The newest reading is the newest of the first `compared`, if any, because it can be explained.
        """
        if count == 0:
            return None
        newest = min(compared, count) - 1 if compared else count - 1
        return newest if self._picked is None else min(self._picked, count - 1)

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


# The scans that are drawn over the one shown, and the two whose differences are shown.


_MOST_SCANS = 8  # scans


def _read_scan(path: Path, scene: Scene) -> OverlaidScan:
    """Read a log; one that names no place is drawn at that of `scene`. Raises InputError."""
    log = read_log(path)
    if not log.readings:
        raise InputError(f"{path.name}: contains no readings")
    return overlaid(path.stem, log.readings, scene_of_log(log.metadata, log.readings), scene)


class ScanList(QObject):
    """Up to eight scans."""

    changed = Signal(object, object)  # tuple of OverlaidScan, ScanPair or None
    failed = Signal(str)

    def __init__(self, shown: Callable[[], Shown], log_file: Callable[[], str], jobs: Jobs, parent: QObject) -> None:
        """`shown`, `log_file`: return what the window shows, and the file of its readings or ""."""
        super().__init__(parent)
        self._shown, self._log_file, self._jobs = shown, log_file, jobs
        self.scans: tuple[OverlaidScan, ...] = ()
        self.pair: ScanPair | None = None

    @Slot(str)
    def open(self, path: str) -> None:
        """Add the scan in a log."""
        self._jobs.run("add scans", _read_scan, Path(path), self._shown().scene, then=lambda scan: self._add([scan]))

    @Slot()
    def keep(self) -> None:
        """Add the readings shown, as they are now."""
        shown = self._shown()
        if shown.readings:
            self._add([overlaid(self._name, shown.readings, shown.scene)])

    @Slot()
    def keep_sweeps(self) -> None:
        """Add each sweep of the readings shown; the first and the last are compared."""
        name, readings, scene = self._name, self._shown().readings, self._shown().scene
        sweeps = sorted({reading.sweep for reading in readings})
        if len(sweeps) < 2:
            self.failed.emit(
                "these readings have one sweep only; scan with several, or keep this scan and make another"
            )
            return
        before = len(self.scans)
        chosen = sweeps[: max(1, _MOST_SCANS - before)]
        parts = [tuple(reading for reading in readings if reading.sweep == sweep) for sweep in chosen]
        named = zip(chosen, parts, strict=True)
        self._add([overlaid(f"{name}, sweep {sweep + 1}", part, scene) for sweep, part in named])
        if len(self.scans) > before + 1:
            self.compare(before, len(self.scans) - 1)

    @Slot(int)
    def remove(self, row: int) -> None:
        """Remove a scan."""
        if 0 <= row < len(self.scans):
            self.scans = self.scans[:row] + self.scans[row + 1 :]
            self._set((len(self.scans) - 1, SHOWN) if self.scans else None)

    @Slot(int, bool)
    def switch(self, row: int, visible: bool) -> None:
        """Show or hide a scan."""
        if self.scans[row].visible is not visible:
            scans = list(self.scans)
            scans[row] = replace(scans[row], visible=visible)
            self.scans = tuple(scans)
            self._set(self.pair)

    @Slot(int, int)
    def compare(self, first: int, second: int) -> None:
        """Choose the two scans whose differences are shown."""
        self._set((first, second))

    @property
    def _name(self) -> str:
        return Path(self._log_file()).stem or f"scan {len(self.scans) + 1}"

    def _add(self, scans: Sequence[OverlaidScan]) -> None:
        for scan in scans:
            if len(self.scans) == _MOST_SCANS:
                self.failed.emit(f"{scan.name}: {_MOST_SCANS} scans are in the list; remove one")
                break
            used = {other.style for other in self.scans}
            style = next((k for k in range(len(OVERLAYS)) if k not in used), len(self.scans) % len(OVERLAYS))
            self.scans = (*self.scans, replace(scan, style=style))
        self._set((len(self.scans) - 1, SHOWN))

    def _set(self, pair: ScanPair | None) -> None:
        self.pair = pair
        self.changed.emit(self.scans, pair)
