"""The session: the state of the window, without widgets.

It owns the shown content, live scan, replay, files and fit, and reports changes by signals. With every tick of its
timer it fetches the results of all threads from their queues.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot
from sonarhw_compare.scanner_url import demo_url, is_fake
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.compilation import Watcher, watch_compilation
from sonarhw_sim.rays.small_waves import forget_solutions
from sonarhw_sim.room.room_arrays import rectangular_room
from sonarhw_sim.room.room_writing import save_room

from sonarhw.errors import InputError, SonarError
from sonarhw.log import Log
from sonarhw.readings import Origin
from sonarhw_gui.jobs import files
from sonarhw_gui.jobs.jobs import CLOSED_WITHIN, Jobs
from sonarhw_gui.jobs.searches import RoomSearch, Search, Tracking, find_pose, search_causes
from sonarhw_gui.model.edits import with_board
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.scene import Scene, first_place, place_warning, room_name, scene_with
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session.kept import Kept, read_unsaved
from sonarhw_gui.session.notices import Notice, NoticeButton, Notices, Preparation
from sonarhw_gui.session.scanner import (
    FAKE_NOTE,
    Live,
    ScannerChoice,
    ScannerFinder,
    ScannerTarget,
    ScanSettings,
    place_of,
    suited_board,
)
from sonarhw_gui.session.showing import ScanList, ShownModel
from sonarhw_gui.session.sound import SoundControl
from sonarhw_gui.session.source import Replay, Source, doubt_in
from sonarhw_gui.session.status import PredictionState, ReplayState, Status

if TYPE_CHECKING:
    from sonarhw_compare.corrections import Correction
    from sonarhw_compare.imports import ImportedScan

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
    import_asked = Signal(str)  # path of a scan of another program
    pose_asked = Signal()  # of a scan that was imported
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
        self._scanner_place = place_of(scanner, scene)
        self.takes_board = False  # whether to use the profile that the scanner names, once it is connected
        self.showing = ShownModel(
            scene, look or Look(), lambda: self.source, self.jobs, self.kept.notes, self._report_trace, self
        )
        self.kept.rooms.open(scene)
        self.documents = files.Documents(scan_settings.folder)
        self.files, self._followed = files.FileWatch(), files.FollowedLog()
        self.fitting = Search("fit", find_pose, lambda: self.shown, self.jobs, self)
        self.causes = Search("causes", search_causes, lambda: self.shown, self.jobs, self)
        self.tracking = Tracking(lambda: self.shown, self.jobs, self)
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
        for part in (self.fitting, self.causes, self.tracking, self.scans):
            part.failed.connect(self.notices.fail)
        self.finding.failed.connect(partial(self.notices.fail, until="search changed"))
        self.finding.settled.connect(partial(self.notices.end, "search changed"))
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
            self.live.start(self.shown.scene, self.takes_board)
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
        self.showing.forecast.follow(log.readings)
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
        self.jobs.run("check the readings", files.check_readings, log, then=partial(self._warn_of, name))
        self._warn_of(name, [scan.angle_warning for scan in log.scans if scan.angle_warning])
        if doubt := place_warning(log.metadata, self.shown.scene):
            self.notices.add(Notice(f"{name}: {doubt}", until="placed"))

    def _warn_of(self, name: str, doubts: Sequence[str]) -> None:
        for doubt in doubts:
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
            self.showing.forecast.follow(self.live.readings)
            self.showing.open_notes()

    @Slot()
    def close_readings(self) -> None:
        """Show no readings: close the log, or drop those of the last scan, whose recording is kept."""
        if not self.live.running:
            self.leave_replay()
            self.notices.clear()
            self._drop_readings()
            self.live.drop_readings()
            self.showing.forecast.follow(())
            self.showing.open_notes()

    @Slot()
    def close_room(self) -> None:
        """Show the readings without a room; unsaved changes of the room can be restored."""
        if not self.live.running:
            self.files.watch("room", None)
            self.set_scene(scene_with(self.shown.scene.board))

    @Slot(str, float, float)
    def new_room(self, name: str, width: float, depth: float) -> None:
        """Show the readings in a new room of four walls, which is in no file yet, with the scanner in its middle."""
        if self.live.running:
            return
        room = rectangular_room(width, depth, name=name)
        self.files.watch("room", None)
        self.set_scene(replace(self.shown.scene, room=room, place=first_place(room), room_file=""))
        self.room_opened.emit()

    @Slot()
    def watch_demo(self) -> None:
        """Scan with the fake scanner of the demo, in the demo room."""
        target = self.scanners.find(demo_url(), follows=True)
        if target is not None and not self.live.running:
            self.scanners.chosen.emit(target)
            self.scan_when_predicted()

    @Slot()
    def connect_fake(self) -> None:
        """Use a fake scanner: each of its scans is made in the room that the plan shows, at the place of the sensor."""
        target = self.scanners.find(demo_url(), follows=True)
        if target is not None and target.follow is not None:
            self.scanners.chosen.emit(replace(target, opener=target.follow(self.shown.scene), scene=None))

    def set_scene(self, scene: Scene, source: Path | None = None) -> None:
        """Show the readings in another scene; earlier edits can no longer be undone.

        `source`: the file of unsaved changes that the scene was restored from, if any.
        """
        self.fitting.cancel()
        self.causes.cancel()
        self.tracking.cancel()
        forget_solutions()  # of rooms shown before, and of all their edits
        self.showing.replace_scene(scene)
        self.kept.rooms.open(scene, source)
        self._update_status()

    @Slot(str)
    def open_file(self, path: str) -> None:
        """Open a log, or a room for the current readings; a log is shown in its own room if it has one.

        Of any other file, the user sees how it is read before it is imported.
        """
        file = Path(path)
        match files.file_kind(file):
            case "log":
                self.open_log(file)
            case "room":
                self.open_room(file)
            case "scan":
                self.import_asked.emit(path)

    def open_log(self, path: Path, last_scene: Scene | None = None) -> None:
        """Open a log; `last_scene`: the scene of the last session instead of that in the log."""
        self._open("open a log", files.open_log, path, last_scene, take=self._take_log)

    def open_room(self, room: Path | str, unit: str = "") -> None:
        """Open a room file, a shipped room by its name, or import a room; `unit`: of a drawing that states none."""
        self._open("open a room", files.open_room, room, self.shown.scene.board, unit, take=self._take_room)

    @Slot(object, object, bool)
    def import_scan(self, file: Path, scan: "ImportedScan", find_pose: bool) -> None:
        """Write a scan of another program as a log in the folder of recordings, open it, and find its pose if asked."""
        take = self._take_unplaced if find_pose else self._take_log
        self._open("import a scan", files.import_scan, file, scan, self.live.settings.folder, take=take)

    def correct_log(self, correction: "Correction") -> None:
        """Import the log shown again with a correction, and find its pose."""
        path, folder = self.source.path, self.live.settings.folder
        if path is not None:
            self._open("import a scan", files.correct_log, path, correction, folder, take=self._take_unplaced)

    def _take_unplaced(self, opened: files.Opened) -> None:
        self._take_log(opened)
        self.pose_asked.emit()

    def _open(self, key: str, function: Callable[..., Any], *args: object, take: Callable[[Any], None]) -> None:
        self.jobs.run(key, function, *args, then=partial(self._take_opened, take), lane="open files")

    @Slot(str)
    def open_board(self, path: str) -> None:
        """Predict with the board profile in a file. An invalid profile is reported and changes nothing."""
        try:
            self.showing.edit(*with_board(self.shown.scene, load_board(path)))
            self.files.watch("board", Path(path))
        except InputError as error:
            self.notices.fail(str(error))

    @Slot(object)
    def restore_room(self, path: Path) -> None:
        """Show the unsaved room in a file of the folder of unsaved rooms. Raises InputError."""
        self.set_scene(read_unsaved(path).applied_to(self.shown.scene), path)

    @Slot()
    def save_room_again(self) -> bool:
        """Save the room in its file; return whether it has one.

        If another program has changed the file, it is kept, and the user is asked what to do.
        """
        file = self.files.path("room")
        if file is not None:
            change = files.changed_outside(file, self.kept.rooms.file_text)
            if change:
                overwrite = NoticeButton("Overwrite, keep a copy", self._save_over, file)
                reload = NoticeButton("Reload the room", self.open_room, file)
                text = f"not saved: {change}; Save room as… keeps both"
                self.notices.add(Notice(text, overwrite, reload, error=True, until="scene replaced"))
            else:
                self.save_room(str(file))
        return file is not None

    def _save_over(self, file: Path) -> None:
        """Save the room in a file that another program has changed, and keep a copy of the file. Raises OutputError."""
        copy = files.keep_copy(file)
        self.save_room(str(file))
        self.notices.warn(f"{file.name} was saved; its earlier content is in {copy.name}")

    @Slot(str)
    def save_room(self, path: str) -> None:
        """Save the room with the sensor's place. An existing file is overwritten: the user has agreed."""
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
        self.files.watch("room", file)

    def save(
        self, write: Callable[[BinaryIO], None], endings: Sequence[str], path: Path, overwrite: bool = False
    ) -> None:
        """Save a file, also if the window is closed meanwhile; `overwrite`: the user has agreed to overwrite it.

        `write` writes it, `endings` are its possible extensions: see `save_file`.
        """
        self.jobs.run(
            f"save {path}",
            files.save_file,
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
            self.files.watch("room", None)  # this room is not that of the file
            self.set_scene(target.scene)
        self.takes_board = target.scene is None and target.follow is None
        self._scanner_place = place_of(target, self.shown.scene)
        self.live.connect()

    @property
    def source(self) -> Source:
        """What the readings shown come from."""
        return self.live if self.replay is None else self.replay

    @property
    def empty(self) -> bool:
        """Whether nothing is open: no room, no readings, and no scanner but a fake one."""
        target = self.live.target
        nothing = self.shown.scene.room is None and self.replay is None and not self.live.readings
        return nothing and not self.live.running and (target is None or is_fake(target.url))

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
        until = time.monotonic() + CLOSED_WITHIN  # a driver, a plug-in or a search may not end
        self.live.close(CLOSED_WITHIN)
        self.jobs.close(until)
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

    def _take_opened(self, take: Callable[[Any], None], opened: files.Opened) -> None:
        if opened.path is not None:
            self.documents.add(opened.path)
        self.recent_changed.emit(self.documents.recent)
        if not self.live.running:  # else requested before the scan began; it would change the room of the scan
            take(opened)
        if opened.notice and opened.log is not None:
            self.saved.emit(opened.notice)  # nothing is wrong
        elif opened.notice:
            self.notices.warn(opened.notice)

    def _take_log(self, opened: files.Opened) -> None:
        log, path = opened.log, opened.path
        assert log is not None, "a file with readings was opened"
        assert path is not None, "a log is in a file"
        self.notices.clear()
        self.files.watch("room", None)
        here, metadata = self.shown.scene, log.metadata
        if self.replay is None:
            self._before_replay = here
        board = opened.scene.board if metadata.board or metadata.board_text else here.board
        self.set_scene(opened.scene if opened.scene.room else replace(here, board=board))
        self.show_log(log, path.name, path)
        if opened.scene.room_file != metadata.room_file:  # restored; edits of the own room need no warning
            self._warn_if_recorded_elsewhere(opened.scene)

    def _take_room(self, opened: files.Opened) -> None:
        *_, recorded_place = self.source.recorded_in
        scene = files.at_kept_place(opened.scene, self.shown.scene, recorded_place)
        self._scanner_place = place = self._scanner_place.moved(scene)
        if place.follow is None and (doubt := place.doubt(scene)):
            self.notices.warn(doubt)
        self._warn_if_recorded_elsewhere(scene)
        self.set_scene(scene)
        self.files.watch("room", opened.path)
        self.room_opened.emit()

    def _take_grown(self, grown: tuple[Path, Log, float]) -> None:
        if self.live.running:
            return
        path, log, took = grown
        self._followed.rest(took, time.monotonic())
        replay = self.replay
        if replay is None or replay.path != path:
            return
        self.notices.end("grown")
        replay.extend(log)
        self.showing.forecast.follow(replay.readings)
        self.tracking.follow(log.readings, whole=not log.torn)
        if not log.torn:
            self._followed.stop()

    def _warn_of_torn(self, now: float) -> None:
        for warning in self._followed.due_warnings(now):
            self.notices.add(Notice(warning, until="grown"))

    def _look_at_files(self, now: float) -> None:
        """Follow a log that grows, and offer to reload a changed room or board."""
        self._warn_of_torn(now)
        if grown := self._followed.grown_file(now):
            self.jobs.run("follow a log", files.read_grown_log, grown, then=self._take_grown, lane="open files")
        for what, path in self.files.changed(now):
            again = NoticeButton("Reload the board", self.open_board, str(path))
            if what == "room":
                again = NoticeButton("Reload the room", self.open_room, path)
            self.notices.add(Notice(f"{path.name} has changed on disk", again))

    def _warn_if_recorded_elsewhere(self, scene: Scene) -> None:
        if doubt := doubt_in(self.source, scene):
            self.notices.warn(doubt)

    def _take_readings(self) -> bool:
        if self.live.newly_connected():  # before its errors are taken
            self.notices.end("connected")
            self._take_board()
        fresh = self.live.take(self._last_tick)
        if fresh:
            self.showing.forecast.follow(self.live.readings)
        return fresh

    def _take_board(self) -> None:
        """Use the profile that the scanner names; decided once for each scanner that the user chooses."""
        link, shown = self.live.link, self.shown.scene.board
        if link is None or not self.takes_board:
            return
        self.takes_board, board = False, suited_board(link.device.board, shown)
        if board is not shown:
            self.showing.edit(*with_board(self.shown.scene, board))
            self.notices.warn(f"the scanner has board {board.name}, which is used from now on; Ctrl+Z undoes this")

    def _drop_readings(self) -> None:
        """Prepare for other readings."""
        self._followed.stop()
        self.jobs.cancel("check the readings")
        self.fitting.cancel()
        self.causes.cancel()
        self.tracking.cancel()
        self.showing.drop_readings()

    @Slot()
    def _follow_replay(self) -> None:
        if self._ticking:
            self.showing.update_soon()  # together with the other changes of this tick
        else:
            self.showing.refresh()

    @Slot()
    def _follow_sound(self) -> None:
        self.showing.set_sound(self.sound.drawn)

    @Slot()
    def _follow_edit(self) -> None:
        self.kept.rooms.change(self.shown.scene, time.monotonic())
        if self.replay is not None and not place_warning(self.replay.log.metadata, self.shown.scene):
            self.notices.end("placed")
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
            note = self._scanner_place.note(scene) if replay is None else FAKE_NOTE
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
        """`interval`: pause between two parts, ms. A part that is given twice is updated twice as often as others."""
        super().__init__(parent)
        self._parts = parts
        self._next = self._due = 0  # the next part, and how many are due
        self._timer = QTimer(self, singleShot=True, interval=interval)
        self._timer.timeout.connect(self._take_turn)

    def all_now(self) -> None:
        """Update all parts."""
        self._timer.stop()
        self._due = 0
        for part in dict.fromkeys(self._parts):
            part()

    def soon(self) -> None:
        """Update each part at least once more, in turns."""
        self._due = len(self._parts)
        if not self._timer.isActive():
            self._timer.start()

    def advance(self) -> None:
        """Update each part at least once more, in turns: the first at once, the next with later frames or the timer."""
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
