"""The session: everything the window is about, free of widgets.

Owns what is shown, live scan or replay, files, fit and what is kept; tells views by signals. Every tick of its timer it
fetches what the threads have done since the last one: they put values into queues and know nothing of it.
"""

import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot
from sonarhw_sim.board.profile import load_board

from sonarhw.errors import InputError, SonarError
from sonarhw.log import Log
from sonarhw_gui.live.scanner_jobs import ScannerOpener, ScanSettings
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.scene.scene import Scene, room_name
from sonarhw_gui.scene.scene_edit import with_board
from sonarhw_gui.session.file_saver import FileSaver
from sonarhw_gui.session.fit_control import FitControl
from sonarhw_gui.session.reading_source import ReadingSource
from sonarhw_gui.session.scanner_choice import ScannerChoice, ScannerFinder, ScannerTarget
from sonarhw_gui.session.shown_model import ShownModel
from sonarhw_gui.session.unsaved_rooms import DiscardRoom, RestoreRoom, UnsavedRooms
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.store.documents import Documents
from sonarhw_gui.store.open_requests import Opened, OpenRequest, RoomOpened
from sonarhw_gui.work.fit_request import FitSettings

TICK = 30  # ms
_LONGEST_TICK = 0.25  # s: a busy machine slows a replay down, readings are not skipped


class WindowSession(QObject):
    """One person at work: what is shown, and what they do about it."""

    status_changed = Signal(object)  # Status
    warned = Signal(str)  # for the banner; empty takes it away
    offered = Signal(object)  # Notice, for the banner too
    recent_changed = Signal(object)  # tuple of paths, the newest first

    def __init__(
        self,
        scene: Scene,
        opener: ScannerOpener | None,
        scan_settings: ScanSettings,
        look: Look | None = None,
        find_scanner: ScannerFinder | None = None,
        unsaved: Path | None = None,
    ) -> None:
        """`unsaved`: the folder of rooms that were changed and not saved; None: they are kept nowhere."""
        super().__init__()
        self._ticking = False
        self.status = Status(can_scan=opener is not None, scan_settings=scan_settings)
        self._source = ReadingSource(opener, scan_settings, self)
        self.replay, self.live = self._source.replay, self._source.live
        self._before_replay: Scene | None = None
        self._scanner_in = scene  # where the scanner is known to be
        self.showing = ShownModel(scene, look or Look(), self._source, self)
        self.unsaved = UnsavedRooms(unsaved)
        self.unsaved.open(scene)
        self.documents = Documents(scan_settings.folder)
        self.scanners = ScannerChoice(find_scanner, self)
        self.fitting = FitControl(self)
        self.saver = FileSaver(self)
        self._last_tick = time.monotonic()
        self._timer = QTimer(self, interval=TICK, timerType=Qt.TimerType.PreciseTimer)
        self._connect()
        self._timer.start()

    def _connect(self) -> None:
        self.replay.changed.connect(self._follow_replay)
        self.replay.broken.connect(self.warned)
        self.showing.edited.connect(self._follow_edit)
        self.scanners.chosen.connect(self._use)
        for part in (self.scanners, self.fitting, self.saver):
            part.failed.connect(self.warned)
        self._timer.timeout.connect(self.tick)

    @property
    def shown(self) -> Shown:
        """What is shown now."""
        return self.showing.shown

    # what a person does

    @Slot()
    def scan(self) -> None:
        """Scan with the scanner this session was given, and record."""
        if self.live.possible and not self.live.running:
            self._begin()
            self._warn_if_moved()
            self._source.scan(self.shown.scene)

    @Slot()
    def stop(self) -> None:
        """Stop the scanner, whatever it is at, or the playback."""
        self._source.stop()

    def show_log(self, log: Log, name: str = "the log", path: Path | None = None) -> None:
        """Show all readings of a log, ready to be played; `path` is where to find it again."""
        self._begin()
        self.showing.follow(log.readings)
        self._source.load(log, name, path)
        if log.torn:
            self.warned.emit(f"{name}: {log.torn}; {len(log.readings)} whole readings are shown")
        for doubt in filter(None, (scan.angle_warning for scan in log.scans)):
            self.warned.emit(f"{name}: {doubt}")

    @Slot()
    def leave_replay(self) -> None:
        """Put the log away: back to the readings of the last live scan, in the room that was there before the log."""
        if self.replay.loaded:
            self._begin()
            self.replay.unload()
            if self._before_replay is not None:
                self.set_scene(self._before_replay)
            self.showing.follow(self.live.readings)

    def set_scene(self, scene: Scene, left_in: Path | None = None) -> None:
        """Put the readings into another room; what was done to the one before cannot be undone any more.

        `left_in`: the file of a room that was not saved, where it was brought back from there.
        """
        self.fitting.forget()
        self.showing.replace_scene(scene)
        self.unsaved.open(scene, left_in)
        self._update_status()

    @Slot(object)
    def find_place(self, settings: FitSettings) -> None:
        """Find where the scanner stood, by the readings there are."""
        self.fitting.start(settings, self.shown.scene, self.shown.readings)

    @Slot(str)
    def open_file(self, path: str) -> None:
        """Show a log, in its own room if it has one, or the readings there are in another room, or a scan as CSV."""
        self.documents.open(Path(path), self.shown.scene.board)

    @Slot(str)
    def take_board(self, path: str) -> None:
        """Predict with the board of that profile; a wrong one is told, and all stays as it is."""
        try:
            self.showing.edit(*with_board(self.shown.scene, load_board(path)))
        except InputError as error:
            self.warned.emit(str(error))

    @Slot(object)
    def reopen(self, request: OpenRequest) -> None:
        """Open a file in the other way that was offered."""
        self.documents.submit(request)

    @Slot(object)
    def answer_offer(self, answer: RestoreRoom | DiscardRoom | OpenRequest) -> None:
        """Do what was offered."""
        try:
            match answer:
                case RestoreRoom():
                    self.set_scene(self.unsaved.restored(answer, self.shown.scene), answer.path)
                case DiscardRoom():
                    self.unsaved.discard(answer)
                case _:
                    self.reopen(answer)
        except SonarError as error:
            self.warned.emit(str(error))

    @Slot(str)
    def save_room(self, path: str) -> None:
        """Write the room as it is now, with the sensor's place; the dialog has asked about overwriting."""
        if self.documents.save_room(self.shown.scene.written_room, Path(path)):
            self.showing.name_room(Path(path).name)
            self.unsaved.saved(self.shown.scene)

    @Slot(object)
    def _use(self, way: ScannerTarget) -> None:
        if self.live.running:
            self.warned.emit("a scan runs: stop it before another scanner is connected")
            return
        self.leave_replay()
        self.scanners.remember(way)
        self.live.use(way.opener)
        if way.scene is not None:
            self.set_scene(way.scene)
        self._scanner_in = self.shown.scene
        self.live.connect()

    @property
    def recorded(self) -> Log | Path | None:
        """The log whose readings are shown, or the file that holds it; None where there is none."""
        return self._source.recorded

    @property
    def log_to_keep(self) -> str:
        """The log to open next time: the one that is shown, or the recording of the last scan."""
        return self._source.log_file

    def remember_used(self, recent: tuple[str, ...], urls: tuple[str, ...]) -> None:
        """These files and scanners were used before."""
        self.documents.recent, self.scanners.urls = recent, urls
        self.recent_changed.emit(recent)

    def close(self) -> None:
        """Stop the board, close the log, end every thread; twice does no harm."""
        self._timer.stop()
        self.unsaved.write()
        self.live.close()
        self.documents.close()
        self.scanners.close()
        self.fitting.close()
        self.saver.close()
        self.showing.close()

    # what happens meanwhile

    @Slot()
    def tick(self) -> None:
        """Fetch what has happened since the last tick, and report it."""
        now = time.monotonic()
        elapsed, self._last_tick = min(now - self._last_tick, _LONGEST_TICK), now
        for part in (self.scanners, self.fitting, self.saver):
            part.tick()
        for opened in self.documents.take():
            self._take_opened(opened)
        self._ticking = True
        self.replay.advance(elapsed)
        self._ticking = False
        self.showing.tick(self._take_readings())
        self.unsaved.tick(now)
        self._report_messages()
        self._update_status()

    def _report_messages(self) -> None:
        for messages in (self.showing.forecast.failures, self.documents.messages, self.unsaved.messages):
            for message in messages:
                self.warned.emit(message)
            messages.clear()
        for notice in self.unsaved.notices:
            self.offered.emit(notice)
        self.unsaved.notices.clear()
        failures = self.showing.traces.failures
        for message in failures:
            (self.replay.drop_traces if self.replay.loaded else self.warned.emit)(message)
        failures.clear()

    def _take_opened(self, opened: Opened) -> None:
        self.recent_changed.emit(self.documents.recent)
        if self.live.running:
            return  # asked for before the scan began; it would tear it from its room
        if isinstance(opened, RoomOpened):
            self._warn_if_other_room(opened.scene)
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

    def _warn_if_other_room(self, opened: Scene) -> None:
        replayed, scanned_in = self._source.replayed, self._source.scanned_in
        if replayed is not None:
            text, name = replayed.log.metadata.room_text, replayed.log.metadata.room_file
        elif scanned_in is not None and scanned_in.room is not None:
            text, name = scanned_in.room.text, scanned_in.room_file
        else:
            return
        if self._source.all_readings and text and opened.room and text != opened.room.text:
            taken = f"{name or 'another room'}{' as it was then' if name == opened.room_file else ''}"
            self.warned.emit(f"these readings were taken in {taken}; they are now held against {opened.room_file}")

    def _warn_if_moved(self) -> None:
        was, now = self._scanner_in.pose, self.shown.scene.pose
        if (was.position, was.heading) != (now.position, now.heading):
            self.warned.emit("the scanner itself has not moved: readings are predicted from the place shown")
            self._scanner_in = self.shown.scene  # said once

    def _take_readings(self) -> bool:
        fresh, told = self._source.take(self._last_tick)
        if fresh:
            self.showing.follow(self.live.readings)
        if told:
            self.warned.emit(told)
        return fresh

    def _begin(self) -> None:
        self.warned.emit("")
        self._source.begin()
        self.fitting.forget()
        self.showing.begin()

    @Slot()
    def _follow_replay(self) -> None:
        if self._ticking:
            self.showing.update_soon()  # with whatever else this tick brings
        else:
            self.showing.refresh()

    @Slot()
    def _follow_edit(self) -> None:
        self.unsaved.change(self.shown.scene, time.monotonic())
        self._update_status()

    @Slot()
    def _update_status(self) -> None:
        searching = self.showing.forecast.searching
        status = self._source.status(time.monotonic(), searching, room_name(self.shown.scene))
        status = replace(status, outdated=self.shown.outdated)
        if status != self.status:
            self.status = status
            self.status_changed.emit(status)
