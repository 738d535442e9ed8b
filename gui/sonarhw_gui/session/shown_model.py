"""The model of the views: the scene and its edits, its prediction, and the selected reading.

Every change emits `Shown`, at once or with the next tick.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from weakref import ref

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.scans import ReadingNote, note_on
from sonarhw_sim.room.room import Room

from sonarhw.readings import Reading
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import Class, ViewLayer
from sonarhw_gui.scene.history import Edited, History
from sonarhw_gui.scene.note_texts import NoteTexts
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.session.reading_source import ReadingSource
from sonarhw_gui.session.trace_forecast import TraceForecast
from sonarhw_gui.shown.choice import Choice
from sonarhw_gui.shown.found_drawing import FoundDrawing
from sonarhw_gui.shown.overlaid_scan import OverlaidScan, ScanPair
from sonarhw_gui.shown.proposal import Proposal
from sonarhw_gui.shown.shown import Cursor, Shown, SoundMoment, is_same_question
from sonarhw_gui.store.note_store import NoteStore
from sonarhw_gui.work.bscan_picture import BScanSettings
from sonarhw_gui.work.forecast import Forecast

_NEXT_READING = 0.04  # s after the last readings, within which a fast scan delivers the next


class ShownModel(QObject):
    """The content of the views, and the actions that change it."""

    changed = Signal(object)  # Shown
    edited = Signal()  # the scene was edited; `changed` may follow later

    def __init__(
        self, scene: Scene, look: Look, source: ReadingSource, parent: QObject, unsaved: Path | None = None
    ) -> None:
        """`unsaved`: the folder for notes that cannot be stored beside their log."""
        super().__init__(parent)
        self.note_store = NoteStore(unsaved)
        self.shown = Shown(scene, look=look, origin=source.origin)
        self.history = History()
        self.forecast, self.traces = Forecast(), TraceForecast()
        self._source = source
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
        self._emit(replace(self.shown, notes=self.note_store.open(self._log, self._source.all_readings)))

    @property
    def pinned_notes(self) -> tuple[ReadingNote, ...]:
        """The notes, with what identifies their readings in the log."""
        readings = self._source.all_readings
        return tuple(note_on(readings[place], text) for place, text in self.shown.notes.by_reading.items())

    def has_reading(self, place: int, reading: Reading) -> bool:
        """Return whether this reading is at this place of the scan; the source may have changed."""
        readings = self._source.all_readings
        return place < len(readings) and readings[place] is reading

    @property
    def _log(self) -> Path | None:
        return Path(self._source.log_file) if self._source.log_file else None

    def _restore(self, state: Edited | None) -> None:
        match state:
            case NoteTexts():
                self._change_notes(state)
            case Scene():
                self._change(state)

    def _change_notes(self, notes: NoteTexts) -> None:
        self._emit(replace(self.shown, notes=notes))
        self.note_store.save(notes, self._source.all_readings, self._log)

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
        self.shown = replace(self.shown, notes=self.note_store.open(None, ()))
        self._choice.follow_newest()
        self.forecast.begin_scan()
        self.traces.begin_scan()

    def replace_scene(self, scene: Scene) -> None:
        """Show the readings in another scene; earlier edits can no longer be undone."""
        self.history.clear()
        self.shown = replace(self.shown, scene=scene)
        self.forecast.set_scene(scene)
        self.follow(self._source.all_readings)
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
        """Fetch finished predictions and traces, and update the views if anything has changed."""
        traced, now = self.traces.take(), time.monotonic()
        self._results_due = self.forecast.take() or traced or self._results_due
        if new_readings:
            self._read_at = now
        # each update repaints the window, so results of a fast scan are shown together with its next readings
        waits = now - self._read_at < _NEXT_READING and not self.forecast.dragging
        if new_readings or self._update_due or (self._results_due and not waits):
            self.refresh()

    def close(self) -> None:
        """End the threads."""
        self.forecast.close()
        self.traces.close()

    def refresh(self) -> None:
        """Update the views now."""
        readings, compared = self._source.readings, self.forecast.compared
        chosen = self._choice.among(len(readings), compared.end if compared else 0)
        self.forecast.prefer(chosen)
        shown = replace(
            self.shown,
            outline=self.forecast.outline,
            chances=self.forecast.chances,
            compared=compared,
            outdated=self.forecast.outdated,
            readings=readings,
            origin=self._source.origin,
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
