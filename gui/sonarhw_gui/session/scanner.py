"""The live scanner: its thread, its jobs, its state, and the choice of one."""

import math
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.scanner_url import is_fake
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.room.room import Place

from sonarhw.errors import Incompatible, LinkError, LogError, NoAnswer, SonarError, WrongDevice
from sonarhw.files import recordings_folder
from sonarhw.host.scanner import DeviceInfo, Scanner, ScanPlan, probe_port, record_scan, until_stopped
from sonarhw.host.session import Connection
from sonarhw.link import LinkStatistics, Port, serial_ports
from sonarhw.log import LogMetadata, LogWriter
from sonarhw.readings import FloatArray, Origin, Reading, ScanOrder, Trace, origin_of
from sonarhw.sound_speed import ScanAir
from sonarhw.text_device import guess_lines
from sonarhw.wire.messages import Outcome
from sonarhw_gui.jobs.files import free_name, with_newest
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.scene import Scene, room_name
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.session.source import UNRECORDED, RateMeter, RecordedIn

# The state of a live scanner as frozen values: its job, its identity and its link.


class Phase(StrEnum):
    """The phase of a job."""

    CONNECTING = "connecting"
    READY = "connected"
    HOMING = "homing"
    TURNING = "turning"
    SCANNING = "scanning"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass(frozen=True)
class JobState:
    """The state of the scanner's last job, without its readings."""

    phase: Phase | None = None  # None: there was no job, or its connection was closed without readings
    lost: int = 0  # readings
    temperature_c: float | None = None
    angle: float | None = None  # last reported angle of the turntable, rad
    recording: Path | None = None
    error: Exception | None = None

    @property
    def ended(self) -> bool:
        """Whether no job is running."""
        return self.phase not in (Phase.CONNECTING, Phase.HOMING, Phase.TURNING, Phase.SCANNING)


IDLE = JobState()


@dataclass(frozen=True)
class LinkState:
    """The state of the connection to a scanner at one moment."""

    url: str
    device: DeviceInfo
    connection: Connection
    statistics: LinkStatistics
    baud: int | None  # None: the link has no baud rate
    drift: float  # how much faster the host clock runs than the device clock, as a ratio
    takes_orders: bool = True  # False: the device turns by itself
    loss: str = ""  # why the connection is lost; empty: it works


def trouble(link: LinkState | None, phase: Phase | None) -> str:
    """Return a message about a lost connection and the attempts to restore it; empty if it works."""
    if link is None or not link.loss:
        return ""
    greeted = link.connection in (Connection.GREETING, Connection.PREPARING)
    attempt = "Reconnecting to the scanner" if greeted else "The scanner is lost; searching for it"
    then = ". The scan then continues by itself" if phase is Phase.SCANNING else ""
    return f"{attempt}{then}. {link.loss}"


# Traces stored in the sample format of the wire, so that an hour of a live scan with traces fits into memory.
#
# The samples are computed on access.


_FORMS = np.uint8, np.uint16  # sample formats of the wire
_SAME = 1e-12
_NO_SAMPLES: FloatArray = np.empty(0)  # stored by the base class; the property computes the samples


class PackedTrace(Trace):
    """A trace that stores the integer steps of the converter."""

    def __init__(self, steps: NDArray[np.unsignedinteger], like: Trace) -> None:
        super().__init__(_NO_SAMPLES, like.rate, like.start, like.carrier)
        self._steps = steps

    @property
    def samples(self) -> FloatArray:
        """The samples as floats, equal to those before packing."""
        levels = self._steps / np.float64(np.iinfo(self._steps.dtype).max)
        return 2 * levels - 1 if self.carrier else levels


def with_packed_trace(reading: Reading) -> Reading:
    """Return the reading with a packed trace."""
    return reading if reading.trace is None else replace(reading, trace=packed(reading.trace))


def packed(trace: Trace) -> Trace:
    """Return the trace in 1/8 or 1/4 of its memory; unchanged if samples are lost or finer than on the wire."""
    levels = (trace.samples + 1) / 2 if trace.carrier else trace.samples
    for form in _FORMS:
        full = np.iinfo(form).max
        steps = np.round(levels * full)
        if (np.abs(steps / full - levels) < _SAME).all() and ((steps >= 0) & (steps <= full)).all():
            return PackedTrace(steps.astype(form), trace)
    return trace


# Creates the log of a live scan, in the user's folder of recordings, named by date and room.


def start_recording(
    folder: Path, scene: Scene, warn: Callable[[str], None], source: str = "", read_as: str = ""
) -> tuple[LogWriter, Path]:
    """Create a log in `folder`, named by time and room; `warn` is called when the disk is nearly full, and if
    the log is continued elsewhere. `source` is the URL of the scanner, `read_as` how its text is read.

    Raises LogError if the log cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{folder}: cannot be created: {error.strerror}; recordings are stored there") from error
    now = time.time()
    path = free_name(folder, f"{time.strftime('%Y-%m-%d_%H%M%S', time.localtime(now))}_{name_part(scene)}", ".mcap")
    room = scene.written_room
    metadata = LogMetadata(
        made_by="scan",
        started=now,
        room_file=scene.room_file,
        room_text=room.text if room else "",
        place=scene.pose.name,
        board=scene.board.name,
        board_text=scene.board.text,
        source=source,
        read_as=read_as,
    )
    return LogWriter(path, metadata, warn=warn, fallback=recordings_folder()), path


def name_part(scene: Scene) -> str:
    """Return the room's name without characters that a file system may reject."""
    return re.sub(r"\W+", "-", scene.room.name.lower()).strip("-") or "room" if scene.room else "no-room"


# The board profile that a scanner names: used from its connection on, except over a profile of the user.


def suited_board(named: str, shown: Board) -> Board:
    """Return the included profile that a scanner names, if the profile shown is another included one; else that shown.

    A profile with a name of its own is kept: it may be that of this very scanner.
    """
    both_included = {named, shown.name} <= set(board_names())
    return load_board(named) if both_included and named != shown.name else shown


# The jobs of a scanner, as frozen values: connect, home, turn, or scan and record.


ScannerOpener = Callable[[], AbstractContextManager[Scanner]]
Job: TypeAlias = "Callable[[Scanner, ScannerThread], Phase]"  # returns its last phase; raises SonarError
WHOLE_TURN = ScanOrder(0.0, math.radians(5), 72)


@dataclass(frozen=True)
class ScanSettings:
    """What to scan and where to record it."""

    folder: Path
    order: ScanOrder = WHOLE_TURN
    traces: bool = True
    max_range: float | None = None  # m; None: the maximum range of the board
    until_stopped: bool = False  # whether sweeps follow one another until Stop, as of a radar


def connect(scanner: Scanner, report: "ScannerThread") -> Phase:
    """Return at once: the scanner is already connected."""
    return Phase.READY


def home(scanner: Scanner, report: "ScannerThread") -> Phase:
    """Find the zero of the turntable."""
    return _turned(scanner.home(), 0.0, report)


def turn(angle: float) -> Job:
    """Return the job that turns the turntable to an angle, rad; the scanner homes first if necessary."""
    return lambda scanner, report: _turned(scanner.turn(angle), angle, report)


def _turned(outcome: Outcome, angle: float, report: "ScannerThread") -> Phase:
    if outcome is Outcome.STOPPED:
        return Phase.STOPPED
    report.advance(angle=angle)
    return Phase.READY


def scan_and_record(scene: Scene, settings: ScanSettings, takes_board: bool = False) -> Job:
    """Return the job that homes, scans and records in a new log. Also raises LogError if that cannot be created.

    `takes_board`: whether a board profile that the scanner names replaces that of the scene.
    """

    def run(scanner: Scanner, report: "ScannerThread") -> Phase:
        named = suited_board(scanner.info.board, scene.board) if takes_board else scene.board
        scanned = replace(scene, board=named)
        read_as = "; ".join(scanner.notes)
        log, path = start_recording(settings.folder, scanned, report.warn, scanner.url, read_as)
        report.advance(recording=path)
        report.count_lost(scanner)
        try:
            outcome = record_scan(scanner, _plan(scanned, settings), log, report)
        finally:
            if log.path != path or not log.path.exists():
                report.advance(recording=log.path if log.path.exists() else None)
        return Phase.STOPPED if outcome is Outcome.STOPPED else Phase.DONE

    return run


def _plan(scene: Scene, settings: ScanSettings) -> ScanPlan:
    board, air = scene.board, scene.room.air if scene.room else Air()
    return ScanPlan(
        until_stopped(settings.order) if settings.until_stopped else settings.order,
        reach=board.max_range if settings.max_range is None else settings.max_range,
        blanking=board.blanking_end,
        air=ScanAir(air.speed_at, air.temperature_c),
        traces=settings.traces,
    )


# One scanner in a thread: opens the connection, runs jobs one after another, watches the link, closes it.
#
# Readings wait in a bounded queue that drops the oldest, so the scan and its log never wait for the window.


MOST_WAITING = 1024  # readings; over half a minute of the fastest board
_POLL_EVERY = 0.25  # s; a person cannot read values that change more often


class ScannerThread:
    """A connection from `start` until `disconnect` or until it breaks; it cannot be started again.

    It receives the progress of its jobs, as a `ScanWatcher`.
    """

    def __init__(
        self,
        opener: ScannerOpener,
        phase: Phase,
        job: Job,
        arrived: Callable[[], None],
        after: "ScannerThread | None" = None,
    ) -> None:
        """`phase`: of the first job at its begin. `arrived` is called after each reading, in the thread.

        `after`: an earlier connection, which must end first because it may still use the port.
        """
        self.state = JobState(Phase.CONNECTING)
        self.link: LinkState | None = None
        self.warnings: deque[str] = deque()  # the reader removes them
        self.leaving = False  # True: no more jobs are accepted
        self._opener = opener
        self._after = after
        self._arrived = arrived
        self._jobs: SimpleQueue[tuple[Phase, Job] | None] = SimpleQueue()
        self._jobs.put((phase, job))
        self._readings: deque[Reading] = deque(maxlen=MOST_WAITING)
        self._count_lost: Callable[[], int] = lambda: 0  # readings lost during the scan
        self._stop_wanted = threading.Event()
        self._stopping = (
            threading.Lock()
        )  # held while a stop is sent: a job ends only after it, so it stops no later job
        self._wake = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live scanner", daemon=True)

    def start(self) -> None:
        """Start to connect and to run the first job."""
        self._thread.start()

    @property
    def over(self) -> bool:
        """Whether the connection is closed."""
        return self._over.is_set()

    def submit(self, phase: Phase, job: Job) -> JobState:
        """Queue a job, and return its state before it runs; the previous job must have ended."""
        self._stop_wanted.clear()
        state = self.state = JobState(phase, temperature_c=self.state.temperature_c, angle=self.state.angle)
        self._jobs.put((phase, job))
        return state

    def take(self) -> list[Reading]:
        """Return the readings since the last call."""
        taken = []
        while self._readings:
            taken.append(self._readings.popleft())
        return taken

    def stop(self) -> None:
        """Ask the job to stop; it has stopped when `state.ended`."""
        self._stop_wanted.set()
        self._wake.set()

    def disconnect(self) -> None:
        """Close the connection after the current job."""
        self.leaving = True
        self._jobs.put(None)

    def join(self, within: float | None = None) -> None:
        """Wait until the board has stopped, the log is closed and the port is free, at most `within` s."""
        self._thread.join(within)

    # the progress of a job, and the interface `ScanWatcher`

    @property
    def stop_wanted(self) -> bool:
        """Whether the user wants the job to stop."""
        return self._stop_wanted.is_set()

    def advance(self, **changes: Any) -> None:
        """Store other values of the state of the job."""
        self.state = replace(self.state, **changes)

    def count_lost(self, scanner: Scanner) -> None:
        """Count the readings that the scanner loses from now on."""
        before = scanner.statistics.lost_readings
        self._count_lost = lambda: scanner.statistics.lost_readings - before

    def homed(self) -> None:
        """Note that the turntable has homed."""
        self.advance(phase=Phase.SCANNING)

    def reading(self, reading: Reading) -> None:
        """Queue a reading of the scan."""
        self._readings.append(reading)
        self._arrived()
        temperature = self.state.temperature_c if reading.temperature_c is None else reading.temperature_c
        self.advance(angle=reading.angle, temperature_c=temperature, lost=self._count_lost())

    def warn(self, message: str) -> None:
        """Queue a warning; the job continues."""
        self.warnings.append(message)

    # the thread

    def _run(self) -> None:
        if self._after is not None:
            self._after.join()
            self._after = None
        try:
            with self._opener() as scanner:
                self._run_jobs(scanner)
        except Exception as error:  # noqa: BLE001 - the window reports it, or raises it if it is a defect
            self.leaving = True  # before the job is reported as failed, so that no other job is queued
            self._failed(error)
        finally:
            self.link = None
            self._over.set()

    def _run_jobs(self, scanner: Scanner) -> None:
        closing = threading.Event()
        self.link = _link_state(scanner)
        self.advance(temperature_c=scanner.info.temperature_c)
        watcher = threading.Thread(target=self._watch, args=(scanner, closing), name="watch the line", daemon=True)
        watcher.start()
        try:
            while (due := self._jobs.get()) is not None:
                self._run_job(*due, scanner)
        finally:
            closing.set()
            self._wake.set()
            watcher.join()

    def _run_job(self, phase: Phase, job: Job, scanner: Scanner) -> None:
        try:
            self.advance(phase=phase)
            self._end(Phase.STOPPED if self.stop_wanted else job(scanner, self))
        except (LinkError, NoAnswer, WrongDevice, Incompatible):
            raise
        except SonarError as error:  # the connection still works
            self._failed(error)

    def _failed(self, error: Exception) -> None:
        # errors while stopping are caused by the stop
        stopping = self.stop_wanted and isinstance(error, SonarError)
        self._end(Phase.STOPPED if stopping else Phase.FAILED, None if stopping else error)

    def _end(self, phase: Phase, error: Exception | None = None) -> None:
        with self._stopping:
            self.advance(phase=phase, error=error)

    def _watch(self, scanner: Scanner, closing: threading.Event) -> None:
        """Poll the state of the link, and send stop commands; neither may delay the window or the job."""
        while not closing.is_set():
            with self._stopping, suppress(SonarError):
                if not self.state.ended and self.stop_wanted:  # in this order, so that both are of one job
                    scanner.stop()  # repeated until the job has ended
            self.link = _link_state(scanner)
            self._wake.wait(_POLL_EVERY)
            self._wake.clear()


def _link_state(scanner: Scanner) -> LinkState:
    return LinkState(
        url=scanner.url,
        device=scanner.info,
        connection=scanner.state,
        statistics=scanner.statistics,
        baud=scanner.baud,
        drift=scanner.clock_drift,
        takes_orders=scanner.takes_orders,
        loss=str(scanner.loss or ""),
    )


# The live scanner of the session: starts and stops jobs, and polls for new readings every tick.


@dataclass(frozen=True)
class ScannerTarget:
    """A scanner to connect to."""

    url: str
    opener: ScannerOpener
    scene: Scene | None = None  # the scene of a fake scanner
    follow: Callable[[Scene], ScannerOpener] | None = None  # opens this fake scanner in another scene, for each scan


class Live:
    """The live scanner, a `Source`: at most one connection with at most one job, and the readings of the last scan."""

    def __init__(
        self, target: ScannerTarget | None, settings: ScanSettings, notices: Notices, arrived: Callable[[], None]
    ) -> None:
        """`arrived` is called after each reading, in the thread of the scanner."""
        self.target, self.settings = target, settings  # of the next scan
        self.scene: Scene | None = None  # at the start of the last scan
        self.readings: tuple[Reading, ...] = ()
        self.meter = RateMeter()
        self._notices, self._arrived = notices, arrived
        self._thread: ScannerThread | None = None
        self._connected: ScannerThread | None = None  # the last one that made a connection
        self._has_own_readings = False  # whether the readings came from the current scanner
        self._state = IDLE  # of the job, when its readings were fetched last, so that no reading follows the end
        self._end_reported = True

    @property
    def job(self) -> JobState:
        """The state of the last job; its phase is None after a connection that was closed without readings."""
        closed = self._thread is not None and self._thread.over and self._state.phase is Phase.READY
        return replace(self._state, phase=Phase.DONE if self.readings else None) if closed else self._state

    @property
    def link(self) -> LinkState | None:
        """The last known state of the connection; None without a connection."""
        return self._thread.link if self._thread else None

    @property
    def made_readings(self) -> bool:
        """Whether the connected scanner made the readings."""
        return self.link is not None and self._has_own_readings

    @property
    def running(self) -> bool:
        """Whether a job is running."""
        return not self._state.ended

    # the interface `Source`

    @property
    def shown(self) -> tuple[Reading, ...]:
        """All readings."""
        return self.readings

    @property
    def origin(self) -> Origin:
        """The origin of the readings; without readings, of those that the scanner will make."""
        if self.readings and (made := self.readings[0].origin):
            return made
        if link := self.link:
            return origin_of("scan", link.device.firmware, link.device.serial)
        return Origin.FAKE if self.target is not None and is_fake(self.target.url) else Origin.MEASURED

    @property
    def recorded(self) -> Path | None:
        """The recording of the last scan; None without readings."""
        return self.path

    @property
    def path(self) -> Path | None:
        """The recording of the last scan; None without readings."""
        return self._state.recording if self.readings else None

    @property
    def recorded_in(self) -> RecordedIn:
        """The setting of the last scan."""
        scene = self.scene
        if not self.readings or scene is None or scene.room is None:
            return UNRECORDED
        return scene.room.text, scene.room_file, scene.pose.name

    # jobs

    def use(self, target: ScannerTarget | None) -> None:
        """Use another scanner from now on, or none."""
        self.disconnect()
        self._has_own_readings = False
        self.target = target

    def connect(self) -> None:
        """Connect to the scanner."""
        self._submit(Phase.CONNECTING, connect)

    def home(self) -> None:
        """Find the zero of the turntable."""
        self._submit(Phase.HOMING, home)

    def turn(self, angle: float) -> None:
        """Turn the turntable to `angle`, rad."""
        self._submit(Phase.TURNING, turn(angle))

    def start(self, scene: Scene, takes_board: bool = False) -> None:
        """Start a scan; the readings of the previous scan are dropped. `takes_board`: see `scan_and_record`."""
        if self.target is not None and not self.running:
            self.readings, self.scene, self.meter = (), scene, RateMeter()
            self._submit(Phase.HOMING, scan_and_record(scene, self.settings, takes_board))

    def drop_readings(self) -> None:
        """Show no readings; the connection and the recording stay."""
        self.readings, self.scene, self.meter, self._has_own_readings = (), None, RateMeter(), False

    def stop(self) -> None:
        """Ask the job to stop."""
        if self._thread is not None:
            self._thread.stop()

    def disconnect(self) -> None:
        """Stop the job and close the port."""
        if self._thread is not None:
            self._thread.stop()
            self._thread.disconnect()

    def close(self, within: float | None = None) -> None:
        """Disconnect, and wait until the board has stopped and the log is closed, at most `within` s."""
        self.disconnect()
        if self._thread is not None:
            self._thread.join(within)

    def newly_connected(self) -> bool:
        """Return whether a connection was made since the last call."""
        before, thread = self._connected, self._thread
        if thread is not None and thread.link is not None:
            self._connected = thread
        return self._connected is not before

    def take(self, now: float) -> bool:
        """Fetch new readings, and report warnings and the error of the job; return whether there are readings."""
        thread = self._thread
        if thread is None:
            return False
        self._state = thread.state  # before the readings
        fresh = tuple(map(with_packed_trace, thread.take()))
        if fresh:
            self._has_own_readings = True
            self.readings += fresh
            self.meter.add(len(fresh), now)
        while thread.warnings:
            self._notices.warn(thread.warnings.popleft())
        if self._state.ended and not self._end_reported:
            self._end_reported = True
            if text := _error_text(self._state):
                self._notices.fail(text, "connected" if thread.leaving else None)
        return bool(fresh)

    def _submit(self, phase: Phase, job: Job) -> None:
        if self.target is None or self.running:
            return
        self._end_reported = False
        thread = self._thread
        if thread is None or thread.over or thread.leaving:
            thread = self._thread = ScannerThread(self.target.opener, phase, job, self._arrived, thread)
            self._state = thread.state  # before the thread, whose error is reported with a tick
            thread.start()
        else:
            self._state = thread.submit(phase, job)


def _error_text(status: JobState) -> str:
    """Return the message of the job's error, if any. Raises an error that is not a SonarError or OSError."""
    if status.error is None:
        return ""
    if not isinstance(status.error, SonarError | OSError):
        raise status.error
    return str(status.error)


# The choice of the scanner, and the list of ports.


@dataclass(frozen=True)
class PortRow:
    """One port."""

    device: str
    description: str
    likely: bool  # whether its USB device may be a scanner
    answer: str = "not checked"
    answers: bool = False  # whether a scanner answers
    proposed_url: str = ""  # of a device that prints readings
    answered_urls: tuple[str, ...] = ()  # this URL with each answer to what is undecided


_PORTS = "probe ports"  # the thread that opens ports


def _port_rows(find: Callable[[], list[Port]]) -> tuple[PortRow, ...]:
    return tuple(PortRow(port.device, port.known or port.description, port.known is not None) for port in find())


def _probed(row: PortRow, probe: Callable[[str], tuple[bool, str]]) -> PortRow:
    answers, answer = probe(row.device)
    return replace(row, answer=answer, answers=answers)


def _listened(row: PortRow, stopped: Callable[[], bool]) -> PortRow:
    try:
        line = guess_lines(row.device, stopped)
    except LinkError as error:
        return replace(row, answer=str(error).removeprefix(f"{row.device}: "))
    return replace(row, answer=line.text, proposed_url=line.url or "", answered_urls=line.answered_urls)


class ScannerFinder(Protocol):
    """Finds scanners by URL."""

    def __call__(self, url: str, follows: bool = False) -> ScannerTarget:
        """Return the scanner; `follows`: a fake one that scans in the scene of the plan. Raises SonarError."""


class ScannerChoice(QObject):
    """The chosen scanner, if any, and the ports, probed one after another.

    Ports with a known USB device are probed at once. The others are probed only on request, because opening a port may
    reset its device. On request, a port is listened at for the text of a device that prints readings.
    """

    chosen = Signal(object)  # ScannerTarget
    ports_changed = Signal(object)  # tuple of PortRow

    def __init__(
        self,
        scanner: ScannerTarget | None,
        find_scanner: ScannerFinder | None,
        jobs: Jobs,
        notices: Notices,
        parent: QObject,
    ) -> None:
        """`scanner`: chosen at the start."""
        super().__init__(parent)
        self.url = scanner.url if scanner else ""
        self.urls: tuple[str, ...] = ()  # used before, newest first
        self.rows: tuple[PortRow, ...] = ()  # the ports that were found last
        self.find_ports: Callable[[], list[Port]] = serial_ports
        self.probe: Callable[[str], tuple[bool, str]] = probe_port
        self._find_scanner, self._jobs, self._notices = find_scanner, jobs, notices
        self._to_probe: list[str] = []

    @property
    def possible(self) -> bool:
        """Whether a scanner can be chosen by its URL."""
        return self._find_scanner is not None

    @property
    def busy(self) -> bool:
        """Whether ports are being listed or probed."""
        return bool(self._to_probe) or self._jobs.busy(_PORTS)

    @Slot(str)
    def choose(self, url: str) -> None:
        """Choose the scanner at `url`: emits `chosen`, or reports an invalid URL."""
        if (target := self.find(url)) is not None:
            self.chosen.emit(target)

    def find(self, url: str, follows: bool = False) -> ScannerTarget | None:
        """Return the scanner at `url`; None for an invalid URL, which is reported. `follows`: see `ScannerFinder`."""
        if self._find_scanner is None:
            return None
        try:
            return self._find_scanner(url, follows=True) if follows else self._find_scanner(url)
        except SonarError as error:
            self._notices.fail(str(error), "connected")
            return None

    def remember(self, target: ScannerTarget) -> None:
        """Store that this scanner is used now."""
        self.url = target.url
        self.urls = with_newest(self.urls, target.url)

    @Slot()
    def list_ports(self) -> None:
        """List the ports of this computer, and probe those with a known device, except the port in use."""
        self._to_probe = []
        self._run("list ports", _port_rows, self.find_ports, then=self._take_rows)

    @Slot()
    def probe_all(self) -> None:
        """Probe every port that was not checked yet: open it and check whether a scanner answers."""
        self._queue([row.device for row in self.rows])

    @Slot(str)
    def listen(self, device: str) -> None:
        """Listen at a port for the text of a device that prints readings, also at one that is not listed."""
        if device not in [row.device for row in self.rows]:
            self.rows += (PortRow(device, "", likely=False),)
        self.rows = tuple(replace(row, answer="listening …") if row.device == device else row for row in self.rows)
        row = next(row for row in self.rows if row.device == device)
        self._run("listen at a port", _listened, row, lambda: self._jobs.closed, then=self._take_row)
        self.ports_changed.emit(self.rows)

    def _run(self, key: str, function: Callable[..., Any], *args: object, then: Callable[[Any], None]) -> None:
        self._jobs.run(key, function, *args, then=then, failed=self._fail, lane=_PORTS)

    def _take_rows(self, rows: tuple[PortRow, ...]) -> None:
        self.rows = tuple(
            replace(row, answer="in use by this window") if row.device == self.url else row for row in rows
        )
        self._queue([row.device for row in rows if row.likely])
        self.ports_changed.emit(self.rows)

    def _take_row(self, probed: PortRow) -> None:
        self.rows = tuple(probed if row.device == probed.device else row for row in self.rows)
        self._probe_next()
        self.ports_changed.emit(self.rows)

    def _fail(self, message: str) -> None:
        if message:
            self._notices.fail(message, "connected")
        self._probe_next()
        self.ports_changed.emit(self.rows)

    def _queue(self, devices: list[str]) -> None:
        waiting = {row.device for row in self.rows if row.answer == "not checked"}
        self._to_probe = [device for device in devices if device in waiting]
        self.rows = tuple(
            replace(row, answer="checking …") if row.device in self._to_probe else row for row in self.rows
        )
        self._probe_next()

    def _probe_next(self) -> None:
        if self._to_probe and not self._jobs.busy(_PORTS):
            device = self._to_probe.pop(0)
            row = next(row for row in self.rows if row.device == device)
            self._run("probe a port", _probed, row, self.probe, then=self._take_row)


# Where the scanner is: a fake scanner that the window opened follows the plan, any other stays where it is.


FAKE = "fake scanner, hides a post"
_MEANS = (
    "A fake scanner simulates its room, which deliberately differs from the room file: one additional post, a sensor "
    "some millimetres away, and air of another temperature. Analyse > Causes searches for the post"
)
_FOLLOWS = "Each scan takes the room, the place and the board that are shown when it begins"
_STAYS = "It stays in its room, at its place and with its board"
_CLOSE = 1e-4  # m or rad; a `fake:` URL states no more


FAKE_NOTE = FAKE, _MEANS  # what the status bar says of a fake scanner: text and tooltip


@dataclass(frozen=True)
class ScannerPlace:
    """The scene in which the scanner is, as far as the window knows."""

    scene: Scene
    fake: bool = False  # whether it is a fake scanner in this process, whose scene is known
    follow: Callable[[Scene], ScannerOpener] | None = None  # opens a fake scanner that follows the plan in its scene

    def moved(self, shown: Scene) -> "ScannerPlace":
        """Return the place when another scene is opened: only that of a fake scanner is known better."""
        return self if self.fake else replace(self, scene=shown)

    def is_in(self, shown: Scene) -> bool:
        """Return whether a scan is made in exactly the scene that is shown."""
        room, other = self.scene.room, shown.room
        same_room = room is other or (room is not None and other is not None and room.text == other.text)
        return same_room and (self.scene.place, self.scene.board) == (shown.place, shown.board)

    def difference(self, shown: Scene) -> str:
        """Return where a fake scanner is, or which board it has, if that is not what is shown; else empty."""
        own, place = self.scene, shown.place
        if not self.fake or own.place is None or place is None:
            return ""
        if room_name(own) != room_name(shown):
            return f"in {room_name(own)!r}"
        if not _is_same(own.place, place):
            return f"at {own.place.name}"
        return "" if own.board == shown.board else f"with board {own.board.name}"

    def note(self, shown: Scene) -> tuple[str, str]:
        """Return text and tooltip on a fake scanner: where it is if that is not what is shown, or what it hides."""
        text = FAKE
        if where := self.difference(shown):
            text = f"fake scanner, {f'still {where}' if self.follow is None else f'{where} until the next scan'}"
        return text, f"{_MEANS}. {_STAYS if self.follow is None else _FOLLOWS}"

    def doubt(self, shown: Scene) -> str:
        """Return why a scan does not fit the scene that is shown; else empty."""
        if self.fake:
            where = self.difference(shown)
            return f"the fake scanner is still {where}; readings are predicted for what is shown" if where else ""
        was, now = self.scene.pose, shown.pose
        if (was.position, was.heading) == (now.position, now.heading):
            return ""
        return "the sensor was moved only in the window; readings are predicted from the place shown"


def place_of(scanner: ScannerTarget | None, shown: Scene) -> ScannerPlace:
    """Return the place of a scanner that is used from now on."""
    if scanner is None or (scanner.scene is None and scanner.follow is None):
        return ScannerPlace(shown)
    return ScannerPlace(scanner.scene or shown, fake=True, follow=scanner.follow)


def _is_same(place: Place, other: Place) -> bool:
    turned = math.remainder(place.heading - other.heading, math.tau)
    return math.dist(place.position, other.position) < _CLOSE and abs(turned) < _CLOSE and place.height == other.height
