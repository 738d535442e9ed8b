"""The session: everything the window is about, free of widgets.

Owns scene, live scan or replay, readings, prediction and choice; tells views by signals. Every tick of its timer it
fetches what the threads have done since the last one: they put values into queues and know nothing of it.
"""

import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot

from gui.bscan_picture import BScanWish
from gui.choice import Choice
from gui.documents import Documents
from gui.files import Opened, OpenRequest, RoomOpened
from gui.fitting import Fitting, FitWish
from gui.forecast import Forecast
from gui.history import History
from gui.intake import Intake
from gui.keeping import Keeping
from gui.live_scan import ScannerOpener, ScanWish
from gui.look import Look
from gui.scanner_choice import ScannerChoice, ScannerWay, WayFinder
from gui.scene import Scene, room_name
from gui.shown import Cursor, Shown
from gui.status import Status
from gui.trace_forecast import TraceForecast
from sonarhw.log import Log

TICK = 30  # ms


class Session(QObject):
    """One person at work: what is shown, and what they do about it."""

    shown_changed = Signal(object)  # Shown
    status_changed = Signal(object)  # Status
    warned = Signal(str)  # for the banner; empty takes it away
    offered = Signal(object)  # Notice, for the banner too
    recent_changed = Signal(object)  # tuple of paths, the newest first

    def __init__(
        self,
        scene: Scene,
        opener: ScannerOpener | None,
        wish: ScanWish,
        look: Look | None = None,
        find_way: WayFinder | None = None,
    ) -> None:
        super().__init__()
        self.shown = Shown(scene, look=look or Look())
        self.history = History()
        self._to_tell = False  # whether what is shown has changed since the views were told
        self._ticking = False
        self.status = Status(can_scan=opener is not None, wish=wish)
        self._intake = Intake(opener, wish, self)
        self.replay, self.live = self._intake.replay, self._intake.live
        self.replay.changed.connect(self._follow_replay)
        self.replay.broken.connect(self.warned)
        self._before_replay: Scene | None = None
        self._scanned_in = self._scanner_in = scene  # when the last scan began; where the scanner is known to be
        self._choice = Choice()
        self._forecast = Forecast()
        self._traces = TraceForecast()
        self.documents = Documents(wish.folder)
        self.scanners = ScannerChoice(find_way, self)
        self.scanners.chosen.connect(self._use)
        self.scanners.failed.connect(self.warned)
        self.fitting = Fitting(self)
        self.keeping = Keeping(self)
        for errand in (self.fitting, self.keeping):
            errand.failed.connect(self.warned)
        self._last_tick = time.monotonic()
        self._timer = QTimer(self, interval=TICK, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self.tick)
        self._forecast.set_scene(scene)
        self._timer.start()

    # what a person does

    @Slot()
    def scan(self) -> None:
        """Scan with the scanner this session was given, and record."""
        if self.live.possible and not self.live.running:
            self._begin()
            self._tell_moved()
            self._scanned_in = self.shown.scene
            self._intake.scan(self.shown.scene)

    @Slot()
    def stop(self) -> None:
        """Stop the scanner, whatever it is at, or the playback."""
        self._intake.stop()

    def show_log(self, log: Log, name: str = "the log", path: Path | None = None) -> None:
        """Show all readings of a log, ready to be played; `path` is where to find it again."""
        self._begin()
        self._forecast.follow(log.readings)
        self._intake.load(log, name, path)
        if log.torn:
            self.warned.emit(f"{name}: {log.torn}; {len(log.readings)} whole readings are shown")
        for doubt in filter(None, (scan.doubt for scan in log.scans)):
            self.warned.emit(f"{name}: {doubt}")

    @Slot()
    def leave_replay(self) -> None:
        """Put the log away: back to the readings of the last live scan, in the room that was there before the log."""
        if self.replay.loaded:
            self._begin()
            self.replay.unload()
            if self._before_replay is not None:
                self.set_scene(self._before_replay)
            self._forecast.follow(self.live.readings)

    def set_scene(self, scene: Scene) -> None:
        """Put the readings into another room; what was done to the one before cannot be undone any more."""
        self.history.forget()
        self.fitting.forget()
        self.shown = replace(self.shown, scene=scene)
        self._forecast.set_scene(scene)
        self._forecast.follow(self._intake.all_readings)
        self._refresh()
        self._tell_status(time.monotonic())

    @Slot(object, str, object)
    def edit(self, scene: Scene, label: str, gesture: object = None) -> None:
        """Change the scene: `label` says what was done, in words that fit behind Undo.

        Edits of one gesture, the same object each time and not None, are undone at once.
        """
        if scene is not self.shown.scene:
            self.history.remember(self.shown.scene, label, gesture)
            self._change(scene, moving=gesture is not None)

    @Slot()
    def undo(self) -> None:
        """Take back the last edit."""
        before = self.history.undo(self.shown.scene)
        if before is not None:
            self._change(before)

    @Slot()
    def redo(self) -> None:
        """Do again the edit that was taken back last."""
        after = self.history.redo(self.shown.scene)
        if after is not None:
            self._change(after)

    @Slot(object)
    def cancel(self, gesture: object) -> None:
        """Take back what a gesture has done so far, and leave no step of it."""
        before = self.history.cancel(gesture)
        if before is not None:
            self._change(before)

    def _change(self, scene: Scene, moving: bool = False) -> None:
        self.shown = replace(self.shown, scene=scene)
        self._forecast.change_scene(scene, moving)
        if moving:
            self._to_tell = True  # a mouse moves more often than anybody looks
        else:
            self._refresh()
        self._tell_status(time.monotonic())

    @Slot(object)
    def find_place(self, wish: FitWish) -> None:
        """Find where the scanner stood, by the readings there are."""
        self.fitting.start(wish, self.shown.scene, self.shown.readings)

    @Slot(str)
    def set_place(self, name: str) -> None:
        """Stand at another place of the room."""
        scene = self.shown.scene
        if scene.room is not None and name != scene.standing.name:
            self.edit(replace(scene, place=scene.room.place(name)), f"standing at {name}")

    @Slot(str)
    def open_file(self, path: str) -> None:
        """Show a log, in its own room if it has one, or the readings there are in another room, or a scan as CSV."""
        self.documents.open(Path(path), self.shown.scene.board)

    @Slot(object)
    def reopen(self, request: OpenRequest) -> None:
        """Open a file in the other way that was offered."""
        self.documents.ask(request)

    @Slot(str)
    def save_room(self, path: str) -> None:
        """Write the room as it is now, with the sensor's place; the dialog has asked about overwriting."""
        if self.documents.save_room(self.shown.scene.written_room, Path(path)):
            self.shown = replace(self.shown, scene=replace(self.shown.scene, room_file=Path(path).name))
            self._refresh()

    @Slot(object)
    def _use(self, way: ScannerWay) -> None:
        if self.live.running:
            self.warned.emit("a scan runs: stop it before another scanner is connected")
            return
        self.leave_replay()
        self.live.use(way.opener)
        if way.scene is not None:
            self.set_scene(way.scene)
        self._scanner_in = self.shown.scene
        self.live.connect()

    @Slot(int)
    def choose(self, index: int) -> None:
        """Ask about one reading."""
        self._choice.pick(index)
        self._refresh()

    @Slot()
    def follow_newest(self) -> None:
        """Let the choice follow the newest reading again."""
        self._choice.follow_newest()
        self._refresh()

    @Slot()
    def choose_next(self) -> None:
        """Ask about the next reading, round and round."""
        self._step(1)

    @Slot()
    def choose_previous(self) -> None:
        """Ask about the reading before this one, round and round."""
        self._step(-1)

    def _step(self, by: int) -> None:
        self._choice.step(by, self.shown.chosen, len(self.shown.readings))
        self._refresh()

    @Slot(object)
    def point_at(self, cursor: Cursor | None) -> None:
        """Point at a heading and range, in every view."""
        if cursor != self.shown.cursor:
            self.shown = replace(self.shown, cursor=cursor)
            self._to_tell = True

    @Slot(object)
    def wish_bscan(self, wish: BScanWish | None) -> None:
        """Have the B-scan worked out as it is wanted; None: nobody looks at it."""
        self._traces.wish(wish)

    def set_look(self, look: Look) -> None:
        """Draw everything in another palette, unit or size."""
        if look != self.shown.look:
            self._tell_shown(replace(self.shown, look=look))

    @property
    def recorded(self) -> Log | Path | None:
        """The log whose readings are shown, or the file that holds it; None where there is none."""
        return self._intake.recorded

    @property
    def log_to_keep(self) -> str:
        """The log to open next time: the one that is shown, or the recording of the last scan."""
        return self._intake.log_file

    def remember_used(self, recent: tuple[str, ...], urls: tuple[str, ...]) -> None:
        """These files and scanners were used before."""
        self.documents.recent, self.scanners.urls = recent, urls
        self.recent_changed.emit(recent)

    def close(self) -> None:
        """Stop the board, close the log, end every thread; twice does no harm."""
        self._timer.stop()
        self.live.close()
        self.documents.close()
        self.scanners.close()
        self.fitting.close()
        self.keeping.close()
        self._forecast.close()
        self._traces.close()

    # what happens meanwhile

    @Slot()
    def tick(self) -> None:
        """Fetch what has happened since the last tick, and tell."""
        now = time.monotonic()
        elapsed, self._last_tick = now - self._last_tick, now
        self.scanners.tick()
        self.fitting.tick()
        self.keeping.tick()
        for opened in self.documents.take():
            self._take_opened(opened)
        self._ticking = True
        self.replay.advance(elapsed)
        self._ticking = False
        heard = self._take_heard()
        traced = self._traces.take()
        if self._forecast.take() or heard or traced or self._to_tell:
            self._refresh()
        for messages in (self._forecast.failures, self.documents.messages):
            for message in messages:
                self.warned.emit(message)
            messages.clear()
        for message in self._traces.failures:
            (self.replay.give_up_traces if self.replay.loaded else self.warned.emit)(message)
        self._traces.failures.clear()
        self._tell_status(now)

    def _take_opened(self, opened: Opened) -> None:
        self.recent_changed.emit(self.documents.recent)
        if self.live.running:
            return  # asked for before the scan began; it would tear it from its room
        if isinstance(opened, RoomOpened):
            self._tell_other_room(opened.scene)
            self.set_scene(opened.scene)
            self._scanner_in = opened.scene
            return
        here, metadata = self.shown.scene, opened.log.metadata
        if not self.replay.loaded:
            self._before_replay = here
        board = opened.scene.board if metadata.board or metadata.board_text else here.board
        self.set_scene(opened.scene if opened.scene.room else replace(here, board=board))
        self.show_log(opened.log, opened.path.name, opened.path)
        if opened.doubt is not None:
            self.offered.emit(opened.doubt)

    def _tell_other_room(self, opened: Scene) -> None:
        log = self.recorded if self.replay.loaded else None
        if isinstance(log, Log):
            text, name = log.metadata.room_text, log.metadata.room_file
        else:
            room = self._scanned_in.room
            text, name = room.text if room else "", self._scanned_in.room_file
        if self._intake.all_readings and text and opened.room and text != opened.room.text:
            taken = f"{name or 'another room'}{' as it was then' if name == opened.room_file else ''}"
            self.warned.emit(f"these readings were taken in {taken}; they are now held against {opened.room_file}")

    def _tell_moved(self) -> None:
        was, now = self._scanner_in.standing, self.shown.scene.standing
        if (was.position, was.heading) != (now.position, now.heading):
            self.warned.emit("the scanner itself has not moved: readings are predicted from the place shown")
            self._scanner_in = self.shown.scene  # said once

    def _take_heard(self) -> bool:
        fresh, told = self._intake.take(self._last_tick)
        if fresh:
            self._forecast.follow(self.live.readings)
        if told:
            self.warned.emit(told)
        return fresh

    def _begin(self) -> None:
        self.warned.emit("")
        self._intake.begin()
        self._choice.follow_newest()
        self.fitting.forget()
        self._forecast.begin_scan()
        self._traces.begin_scan()

    @Slot()
    def _follow_replay(self) -> None:
        if self._ticking:
            self._to_tell = True  # with whatever else this tick brings
        else:
            self._refresh()

    def _refresh(self) -> None:
        readings, compared = self._intake.readings, self._forecast.compared
        if self.replay.loaded and readings and compared is not None and compared.row(len(readings) - 1) is None:
            self._forecast.follow(readings)  # a long log is compared by stretches
        shown = replace(
            self.shown,
            outline=self._forecast.outline,
            compared=compared,
            readings=readings,
            earlier=self.shown.known_rows,
            chosen=self._choice.among(len(readings), compared.end if compared else 0),
        )
        self._tell_shown(shown)

    def _tell_shown(self, shown: Shown) -> None:
        self._traces.follow(shown)
        self.shown = replace(shown, trace=self._traces.trace, bscan=self._traces.bscan)
        self._to_tell = False
        self.shown_changed.emit(self.shown)

    def _tell_status(self, now: float) -> None:
        status = self._intake.status(now, self._forecast.searching, room_name(self.shown.scene))
        if status != self.status:
            self.status = status
            self.status_changed.emit(status)
