"""The session: the state of the window, without widgets.

It owns the shown content, live scan, replay, files and fit, and reports changes by signals. With every tick of its
timer it fetches the results of all threads from their queues.
"""

import time
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.compiled import Quiet, watch_compilation

from sonarhw.errors import InputError, SonarError
from sonarhw.log import Log
from sonarhw_gui.causes.cause_control import CauseControl
from sonarhw_gui.finding.find_control import FindControl
from sonarhw_gui.fitting.fit_control import FitControl
from sonarhw_gui.live.scanner_board import ScannerBoard
from sonarhw_gui.live.scanner_jobs import ScanSettings
from sonarhw_gui.live.scanner_place import MoveFake, ScannerPlace, ScanRoom
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.scans.scan_list import ScanList
from sonarhw_gui.scene.scene import Scene, place_warning, room_name
from sonarhw_gui.scene.scene_edit import with_board
from sonarhw_gui.session.file_saver import FileSaver
from sonarhw_gui.session.reading_source import ReadingSource
from sonarhw_gui.session.scanner_choice import ScannerChoice, ScannerFinder, ScannerTarget
from sonarhw_gui.session.shown_model import ShownModel
from sonarhw_gui.session.tick_timer import TickTimer
from sonarhw_gui.session.unsaved_rooms import DiscardRoom, RestoreRoom, UnsavedRooms
from sonarhw_gui.shown.notices import Notice
from sonarhw_gui.shown.preparation import Preparation
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.sound.sound_control import SoundControl
from sonarhw_gui.store.csv_preview import ReadCsvRequest
from sonarhw_gui.store.documents import Documents
from sonarhw_gui.store.file_watch import FileWatch, ReloadBoard, WatchedFile
from sonarhw_gui.store.followed_log import FollowedLog
from sonarhw_gui.store.open_requests import (
    FollowLogRequest,
    LogGrown,
    LogOpened,
    Opened,
    OpenRequest,
    OpenRoomRequest,
    RoomOpened,
    is_csv,
)

_BUSY = "a scan is running; stop it before you connect another scanner"
_LONGEST_TICK = 0.25  # s; on a busy machine a replay slows down instead of skipping readings


class WindowSession(QObject):
    """The state of one window, and the actions of its user."""

    status_changed = Signal(object)  # Status
    warned = Signal(str)  # for the banner; empty removes all messages
    failed = Signal(str)  # an error, for the banner
    noticed = Signal(object)  # Notice, for the banner
    connected = Signal()  # a connection to a scanner was made
    import_asked = Signal(str)  # path of a CSV scan
    room_opened = Signal()  # a room file was opened or reloaded
    recent_changed = Signal(object)  # tuple of paths, newest first

    def __init__(
        self,
        scene: Scene,
        scanner: ScannerTarget | None,
        scan_settings: ScanSettings,
        look: Look | None,
        find_scanner: ScannerFinder | None,
        unsaved: Path | None,
    ) -> None:
        """`unsaved`: folder for rooms with unsaved changes, and for notes not beside their log; None: not stored."""
        super().__init__()
        self._ticking = False
        self.status = Status(can_scan=scanner is not None, scan_settings=scan_settings)
        self.scanners = ScannerChoice(scanner, find_scanner, self)
        self._timer = TickTimer(self)
        self._source = ReadingSource(self.scanners, scan_settings, self, self._timer.wake)
        self.replay, self.live = self._source.replay, self._source.live
        self._before_replay: Scene | None = None
        self._scanner_place, self.scanner_board = ScannerPlace(scene), ScannerBoard()
        self.showing = ShownModel(scene, look or Look(), self._source, self, unsaved)
        self.unsaved = UnsavedRooms(unsaved)
        self.unsaved.open(scene)
        self.documents = Documents(scan_settings.folder)
        self.files, self._followed = FileWatch(), FollowedLog()
        self.fitting = FitControl(lambda: self.shown, self)
        self.causes = CauseControl(lambda: self.shown, self)
        self.scans = ScanList(lambda: self.shown, lambda: self.log_file, self)
        self.finding = FindControl(lambda: self.shown, lambda: Path(self.log_file).stem or "this scan", self)
        self.saver = FileSaver(self)
        self.sound = SoundControl(self)
        self.preparation = Preparation()
        watch_compilation(self.preparation)
        self._begun = False
        self._scan_due = False  # whether to scan as soon as there is a prediction
        self._last_tick = time.monotonic()
        self._connect()

    def _connect(self) -> None:
        self.replay.changed.connect(self._follow_replay)
        self.replay.broken.connect(self.failed)
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
        if self.live.possible and not self.live.running:
            self._drop_readings()
            self._move_fake(self._scanner_place.follow(self.scanners.url, self.shown.scene))
            for doubt in self._scanner_place.doubts(self.scanners.url, self.shown.scene):
                self.noticed.emit(doubt)
            self._source.scan(self.shown.scene, self.scanner_board.wanted)

    @Slot()
    def move_fake(self) -> None:
        """Move the fake scanner to the place shown, and scan there when a running scan has stopped."""
        try:
            url = self._scanner_place.moved_here(self.scanners.url, self.shown.scene)
        except InputError as error:
            self.failed.emit(str(error))
            return
        self.stop()
        self._move_fake(url)
        self.scan_when_predicted()

    def _scan_room(self, offer: ScanRoom) -> None:
        if self.live.running:
            self.warned.emit(_BUSY)
        else:
            self._move_fake(self._scanner_place.moved_fake(offer, self.shown.scene))
            self.scan()

    def _move_fake(self, url: str) -> None:
        """Use the fake scanner at another URL from now on; the scene shown stays."""
        if url != self.scanners.url and (target := self.scanners.find(url)) is not None:
            self.scanners.remember(target)
            self.live.use(target.opener)

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
        self._source.stop()

    def show_log(self, log: Log, name: str = "the log", path: Path | None = None) -> None:
        """Show all readings of a log for replay; `path`: its file."""
        self._drop_readings()
        self.showing.follow(log.readings)
        self._source.load(log, name, path)
        self.showing.open_notes()
        if log.torn:
            now = time.monotonic()
            remedy = "; to repair it: `sonarhw log recover`" if log.readings else ""
            self._followed.follow(
                path, f"{name}: {log.torn}; {len(log.readings)} whole readings are shown{remedy}", now
            )
            self._warn_of_torn(now)
        elif not log.readings:
            self.warned.emit(f"{name}: contains no readings")
        doubts = (place_warning(log.metadata, self.shown.scene), *(scan.angle_warning for scan in log.scans))
        for doubt in filter(None, doubts):
            self.warned.emit(f"{name}: {doubt}")

    @Slot()
    def leave_replay(self) -> None:
        """Close the log, and return to the last live scan in the scene from before the replay."""
        if self.replay.loaded:
            self._drop_readings()
            self._source.close_log()
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
        self.unsaved.open(scene, source)
        self._update_status()

    @Slot(str)
    def open_file(self, path: str) -> None:
        """Open a log, or a room for the current readings; a log is shown in its own room if it has one.

        For a CSV scan, the user is asked how to read it.
        """
        if is_csv(Path(path)):
            self.import_asked.emit(path)
        else:
            self.documents.open(Path(path), self.shown.scene.board)

    @Slot(object)
    def import_csv(self, source: ReadCsvRequest) -> None:
        """Import a CSV scan as a log, and open the log."""
        self.documents.import_csv(source)

    @Slot(str)
    def open_board(self, path: str) -> None:
        """Predict with the board profile in a file. An invalid profile is reported and changes nothing."""
        try:
            self.showing.edit(*with_board(self.shown.scene, load_board(path)))
            self.files.watch(WatchedFile.BOARD, Path(path))
        except InputError as error:
            self.failed.emit(str(error))

    @Slot(object)
    def reopen(self, request: OpenRequest) -> None:
        """Open a file by a request."""
        self.documents.submit(request)

    @Slot(object)
    def answer_offer(self, answer: RestoreRoom | DiscardRoom | ReloadBoard | ScanRoom | MoveFake | OpenRequest) -> None:
        """Carry out the answer to a notice."""
        try:
            match answer:
                case RestoreRoom():
                    self.set_scene(self.unsaved.restored(answer, self.shown.scene), answer.path)
                case DiscardRoom():
                    self.unsaved.discard(answer)
                case ReloadBoard():
                    self.open_board(str(answer.path))
                case ScanRoom():
                    self._scan_room(answer)
                case MoveFake():
                    self.move_fake()
                case _:
                    self.reopen(answer)
        except SonarError as error:
            self.failed.emit(str(error))

    @Slot(str)
    def save_room(self, path: str) -> None:
        """Save the room with the sensor's place. An existing file is overwritten: the dialog has asked the user."""
        room = self.shown.scene.written_room
        if self.documents.save_room(room, Path(path)) and room is not None:
            self.showing.take_saved(room, Path(path).name)
            self.unsaved.saved(self.shown.scene)
            self.showing.refresh()
            self.files.watch(WatchedFile.ROOM, Path(path))

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
            self.warned.emit(_BUSY)
            return
        self.leave_replay()
        self.scanners.remember(target)
        self.live.use(target.opener)
        if target.scene is not None:
            self.set_scene(target.scene)
        self.scanner_board.wanted = target.scene is None
        self._scanner_place.confirm(self.shown.scene)
        self.live.connect()

    @property
    def recorded(self) -> Log | Path | None:
        """The log of the readings shown, or its file; None if there is none."""
        return self._source.recorded

    @property
    def log_file(self) -> str:
        """The file of the readings shown: a replayed log, or the recording of the last scan. Empty if there is none."""
        return self._source.log_file

    def remember_used(self, recent: tuple[str, ...], urls: tuple[str, ...]) -> None:
        """Set the lists of recent files and scanners."""
        self.documents.recent, self.scanners.urls = recent, urls
        self.recent_changed.emit(recent)

    def close(self) -> None:
        """Stop the board, close the log, end all threads. A second call has no effect."""
        self._begun = True  # a window that is closed before its first paint begins nothing
        self._timer.stop()
        self.unsaved.write()
        for part in (self.live, self.documents, self.scanners, self.fitting, self.causes, self.scans, self.finding):
            part.close()
        self.saver.close()
        self.showing.close()
        watch_compilation(Quiet())

    # updates

    @Slot()
    def tick(self) -> None:
        """Fetch the results of all threads since the last tick, and emit the changes."""
        now = time.monotonic()
        elapsed, self._last_tick = min(now - self._last_tick, _LONGEST_TICK), now
        for part in (self.scanners, self.fitting, self.causes, self.scans, self.finding, self.saver):
            part.tick()
        self._look_at_files(now)
        for opened in self.documents.take():
            self._take_opened(opened)
        self._ticking = True
        self.replay.advance(elapsed)
        self._ticking = False
        self.sound.advance(elapsed)
        self.showing.tick(self._take_readings())
        self._scan_if_due()
        self.unsaved.tick(now)
        self._report_messages()
        self._update_status()
        self._timer.follow_drag(self.showing.forecast.dragging)

    def _report_messages(self) -> None:
        report_trace = self.replay.drop_traces if self.replay.loaded else self.warned.emit
        for messages, report in (
            (self.preparation.messages, self.warned.emit),
            (self.unsaved.messages, self.warned.emit),
            (self.showing.note_store.messages, self.warned.emit),
            (self.showing.forecast.failures, self.failed.emit),
            (self.documents.messages, self.failed.emit),
            (self.showing.traces.failures, report_trace),
        ):
            for message in messages:
                report(message)
            messages.clear()
        for notice in self.unsaved.notices:
            self.noticed.emit(notice)
        self.unsaved.notices.clear()

    def _take_opened(self, opened: Opened) -> None:
        self.recent_changed.emit(self.documents.recent)
        if self.live.running:
            return  # requested before the scan began; it would change the room of the scan
        match opened:
            case LogOpened():
                self._take_log(opened)
            case RoomOpened():
                self._take_room(opened)
            case LogGrown():
                self._take_grown(opened)

    def _take_log(self, opened: LogOpened) -> None:
        self.files.watch(WatchedFile.ROOM, None)
        here, metadata = self.shown.scene, opened.log.metadata
        if not self.replay.loaded:
            self._before_replay = here
        board = opened.scene.board if metadata.board or metadata.board_text else here.board
        self.set_scene(opened.scene if opened.scene.room else replace(here, board=board))
        self.show_log(opened.log, opened.path.name, opened.path)
        if opened.scene.room_file != metadata.room_file:  # restored; edits of the own room need no warning
            self._warn_if_recorded_elsewhere(opened.scene)

    def _take_room(self, opened: RoomOpened) -> None:
        scene = opened.at_known_place(self.shown.scene, self._source.recorded_in.place)
        self._notify(self._scanner_place.enter_room(self.scanners.url, opened.path, scene))
        self._warn_if_recorded_elsewhere(scene)
        self.set_scene(scene)
        self.files.watch(WatchedFile.ROOM, opened.path)
        self.room_opened.emit()

    def _take_grown(self, grown: LogGrown) -> None:
        self._followed.rest(grown.took, time.monotonic())
        replayed = self._source.replayed
        if replayed is None or replayed.path != grown.path:
            return
        self._source.extend(grown.log)
        self.showing.follow(self._source.all_readings)
        if not grown.log.torn:
            self._followed.stop()

    def _warn_of_torn(self, now: float) -> None:
        for warning in self._followed.due_warnings(now):
            self.warned.emit(warning)

    def _look_at_files(self, now: float) -> None:
        """Follow a log that grows, and offer to reload a changed room or board."""
        self._warn_of_torn(now)
        if grown := self._followed.grown_file(now):
            self.documents.submit(FollowLogRequest(grown))
        for what, path in self.files.changed(now):
            board = self.shown.scene.board
            again = OpenRoomRequest(path, board) if what is WatchedFile.ROOM else ReloadBoard(path)
            self.noticed.emit(Notice(f"{path.name} has changed on disk", f"Reload the {what}", again))

    def _warn_if_recorded_elsewhere(self, scene: Scene) -> None:
        if doubt := self._source.doubt_in(scene):
            self.warned.emit(doubt)

    def _notify(self, notice: Notice | None) -> None:
        if notice is not None:
            self.noticed.emit(notice)

    def _take_readings(self) -> bool:
        if self.live.newly_connected():  # before its errors are taken
            self.connected.emit()
            if board := self.scanner_board.instead_of(self.shown.scene.board, self.live.link):
                self.showing.edit(*with_board(self.shown.scene, board))
                self.warned.emit(f"the scanner has board {board.name}, which is used from now on; Ctrl+Z undoes this")
        fresh, notice = self._source.take(self._last_tick)
        if fresh:
            self.showing.follow(self.live.readings)
        self._notify(notice)
        return fresh

    def _drop_readings(self) -> None:
        """Prepare for other readings."""
        self.warned.emit("")
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
        self.unsaved.change(self.shown.scene, time.monotonic())
        self._update_status()

    @Slot()
    def _update_status(self) -> None:
        searching, place = self.showing.forecast.searching, self._scanner_place
        status = self._source.status(time.monotonic(), searching, room_name(self.shown.scene))
        status = replace(
            status,
            outdated=self.shown.outdated,
            preparing=self.preparation.progress,
            scan_due=self._scan_due,
            fake_still="" if self.replay.loaded else place.fake_still(self.scanners.url, self.shown.scene),
            uncompared=self.showing.forecast.uncompared,
            following=self._followed.grows(time.monotonic()),
        )
        if status != self.status:
            self.status = status
            self.status_changed.emit(status)
