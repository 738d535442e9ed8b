"""`sonarhw scan`, `ping` and `serve`: record scans, show single pings, and publish readings."""

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import DeviceError, InputError, counted, counted_are, harmless
from sonarhw.export import HEADER, row
from sonarhw.wire.limits import MOST_SWEEPS
from sonarhw_cli import inputs, options
from sonarhw_cli.interruption import LAST_WORDS, Interruption, interruption
from sonarhw_cli.outputs import checked_out, progress, standard_output

if TYPE_CHECKING:
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.rays.paths import Paths
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.foxglove import FoxgloveServer
    from sonarhw.host.scanner import Scanner, ScanPlan
    from sonarhw.log import LogMetadata, LogWriter
    from sonarhw.readings import Reading, ScanOrder, Trace

# What `sonarhw scan` and `sonarhw serve` have in common: the request, its checks, the plan and the log's metadata.


# options that a device which turns by itself cannot obey, by parameter
_ORDERS = {
    "start": "--from",
    "stop": "--to",
    "step": "--step",
    "pings": "--pings",
    "traces": "--traces",
    "zero_here": "--zero-here",
}


@dataclass(frozen=True)
class ScanRequest:
    """The options of a scan."""

    order: "ScanOrder"
    board: str | None
    max_range: float | None  # m
    temperature: float | None  # °C
    traces: bool
    show: bool
    zero_here: bool
    turns_by_itself: bool  # the device takes no order, and the number of its readings is unknown


def refuse_orders(context: typer.Context) -> None:
    """Raise InputError for an option that a device cannot obey which turns and measures by itself."""
    reason = "this device turns and measures by itself; remove the option, and end the scan with --sweeps N"
    options.refuse_given(context, _ORDERS, reason)


def check_request(request: ScanRequest) -> None:
    """Raise InputError for an impossible option. The scanner checks the limits of the turntable."""
    from sonarhw.readings import check_order

    check_order(request.order)
    if request.show:
        standard_output()
    options.check_scan_values(request.board, request.max_range, request.temperature)


def room_and_place(room_name: str | None, place: str | None, out: Path | None) -> "tuple[Room, Place] | None":
    """Return the room and the place of --room and --place; None without a room. Raises InputError."""
    if room_name is None:
        return None
    room = inputs.open_room(room_name)
    if place is None and len(room.places) != 1:
        raise InputError(
            f"--room {room_name}: give --place NAME or --place X,Y in metres; its places: "
            f"{', '.join(room.places) or 'none'}; from an unknown place, scan without --room, "
            f"then run `sonarhw locate {quote(str(out or 'LOG.mcap'))} --room {quote(room_name)}`"
        )
    return room, inputs.chosen_place(room, place)


def log_metadata(room_name: str | None, where: "tuple[Room, Place] | None", place: str | None = None) -> "LogMetadata":
    """Return the metadata of a log that begins now, with the room of `room_and_place`, or a `place` X,Y,DEG alone."""
    from sonarhw_sim.files import file_name

    from sonarhw.log import LogMetadata

    metadata = LogMetadata(made_by="scan", started=time.time())
    if room_name is None or where is None:
        return metadata if place is None else replace(metadata, place=place)
    room, here = where
    return replace(metadata, room_file=file_name(room_name), room_text=room.text, place=here.name)


def scan_plan(scanner: "Scanner", request: ScanRequest, board: "Board", room_air: "Air | None") -> "ScanPlan":
    """Return the plan of the scan, with warnings about what this scanner and board cannot do."""
    from sonarhw_sim.air import Air

    from sonarhw.host.scanner import ScanPlan
    from sonarhw.sound_speed import ScanAir

    air = room_air or Air()
    if request.max_range is not None and request.max_range > board.max_range:
        options.warn(
            f"--max-range {request.max_range:g}: board {board.name!r} detects echoes to {board.max_range:g} m; "
            f"each ping now takes at least {2 * request.max_range / air.speed_of_sound:.2g} s"
        )
    if request.traces and not scanner.info.trace_rate:
        options.warn(f"{scanner.url}: the scanner sends no traces; only echo times are recorded")
    plan = ScanPlan(
        request.order,
        reach=board.max_range if request.max_range is None else request.max_range,
        blanking=board.blanking_end,
        air=ScanAir(air.speed_at, air.temperature_c, request.temperature),
        traces=request.traces,
        zero_here=request.zero_here,
    )
    options.print_detail(
        f"board {board.name!r}; speed of sound {plan.air.speed_of_sound(scanner.info.temperature_c):.2f} m/s"
    )
    return plan


# `sonarhw scan`: scan, and record a log.


Sweeps = Annotated[int, typer.Option(help="Number of sweeps, forwards and backwards.", min=1, max=MOST_SWEEPS)]
PrintReadings = Annotated[
    bool,
    typer.Option("--print", help="Write each reading to standard output as CSV; heading_deg is the turntable angle."),
]


def scan(
    context: typer.Context,
    url: inputs.ScannerUrl,
    out: Annotated[Path, typer.Option(help="Log to write.", metavar="LOG.mcap")],
    room: options.RoomToStore = None,
    place: options.PlaceName = None,
    board: options.BoardOfScanner = None,
    start: options.FromAngle = 0.0,
    stop: options.ToAngle = 360.0,
    step: options.StepAngle = 5.0,
    sweeps: Sweeps = 1,
    pings: options.PingsPerHeading = 1,
    max_range: options.MaxRange = None,
    temperature: options.TemperatureInRoom = None,
    traces: Annotated[bool, typer.Option("--traces", help="Record the receive signal of every ping.")] = False,
    show: PrintReadings = False,
    zero_here: options.ZeroHere = False,
    reconnect: inputs.Reconnect = inputs.RECONNECT,
    force: options.Force = False,
) -> None:
    """Scan and record a log. With --print, each reading is also written to standard output as it arrives."""
    from sonarhw.plugins.device_plugin import takes_orders

    by_itself = not takes_orders(url)
    if by_itself:
        refuse_orders(context)
    order = options.order_in_degrees(start, stop, step, sweeps, pings)
    options.warn_of_radians(start, stop)
    request = ScanRequest(order, board, max_range, temperature, traces, show, zero_here, by_itself)
    checked_out(out, (options.LOG,), force, url, room, board)
    check_request(request)
    where = room_and_place(room, place, out)
    alone = None if room or place is None else inputs.place_without_room(place)
    with inputs.connect(url, reconnect) as scanner:
        metadata, air = log_metadata(room, where, alone), where[0].air if where else None
        _record(scanner, request, out, force, metadata, air)


def _record(
    scanner: "Scanner",
    request: ScanRequest,
    out: Path,
    force: bool,
    metadata: "LogMetadata",
    room_air: "Air | None",
) -> None:
    from sonarhw.host.scanner import record_scan

    board = inputs.board_of(scanner, request.board)
    metadata = replace(metadata, board=board.name, board_text=board.text, source=scanner.url)
    plan = scan_plan(scanner, request, board, room_air)
    with ExitStack() as exit_stack:
        terminal = _Terminal(scanner, request, exit_stack)
        exit_stack.enter_context(_interruption_reported(out, terminal))
        terminal.interrupted = exit_stack.enter_context(interruption(scanner.stop))
        terminal.log = log = _log(out, metadata, force)
        if request.turns_by_itself:  # the start of a sweep may be far away
            terminal.show_bar()
        try:
            record_scan(scanner, plan, log, terminal)
        except DeviceError:
            if request.turns_by_itself and terminal.count:  # the cause may be a restart
                _report_ignored(scanner)
                _warn_of_the_link(scanner)
            raise
    options.print_note(f"{counted(terminal.count, 'reading')}, {terminal.echoes} with an echo, in {log.path}")
    _report_ignored(scanner)
    if not request.turns_by_itself:
        _warn_of_another_count(terminal.count, request)
    _warn_of_the_link(scanner)
    if request.turns_by_itself:
        _print_next(log.path, metadata, board_stated=bool(request.board or scanner.info.board))


_USUAL_BOARD = "hc-sr04"  # of devices that turn by themselves


def _print_next(log: Path, metadata: "LogMetadata", board_stated: bool) -> None:
    """Print the commands that show a scan of a device that turns by itself in its room."""
    of_next = quote(str(log))
    if not metadata.room_text:
        of_next += " --room room.toml"
    if not board_stated:
        options.print_note(f"board not stated: {metadata.board} recorded; below write yours in place of {_USUAL_BOARD}")
        of_next += f" --board {_USUAL_BOARD}"
    if metadata.room_text:
        options.print_note(f"next: sonarhw locate {of_next}, which finds the pose, or sonarhw gui {of_next}")
        return
    options.print_note("next: sonarhw room new room.toml --size WxD --place X,Y,DEG, with your numbers in metres")
    options.print_note(f"then: sonarhw compare {of_next}, or sonarhw gui {of_next}")


def _log(out: Path, metadata: "LogMetadata", force: bool) -> "LogWriter":
    """Return the log of a scan that begins now; if it can no longer be written, the folder of recordings continues it.

    Raises LogError.
    """
    from sonarhw.files import recordings_folder
    from sonarhw.log import LogWriter

    return LogWriter(out, metadata, overwrite=force, warn=options.warn, fallback=recordings_folder())


class _Terminal:
    """Shows the progress of a scan: the bar, the lines of --print and warnings. Counts the readings."""

    def __init__(self, scanner: "Scanner", request: ScanRequest, exit_stack: ExitStack) -> None:
        """Show the progress of a scan with `scanner`. `exit_stack` closes the bar."""
        self.count = 0
        self.echoes = 0  # readings with an echo
        self.interrupted: Interruption
        self.log: LogWriter | None = None  # none yet
        self._scanner = scanner
        self._request = request
        self._exit_stack = exit_stack
        self._advance: Callable[[], None]
        self._sweep = 0
        self._began: float | None = None

    @property
    def stop_wanted(self) -> bool:
        return self.interrupted.wanted

    def show_bar(self) -> None:
        """Show the progress bar."""
        order = self._request.order
        parts = order.sweeps if self._request.turns_by_itself else order.readings
        self._advance = self._exit_stack.enter_context(progress(parts, self._state))

    def _state(self) -> str:
        """Return the state of the scanner: "lost" while the driver reconnects."""
        state = self._scanner.state.value
        return "waiting for the start of a sweep" if self._request.turns_by_itself and state == "moving" else state

    def homed(self) -> None:
        if not self._request.turns_by_itself:
            self.show_bar()
        if self._request.show:
            self._print(HEADER)

    def reading(self, reading: "Reading") -> None:
        self.count += 1
        self.echoes += bool(reading.echo_times)
        if self._began is None:
            self._began = min(self._scanner.scan_began, reading.time)
        if self._request.show:
            self._print(row(reading, self._began))
        if not self._request.turns_by_itself or reading.sweep != self._sweep:
            self._sweep = reading.sweep
            self._advance()

    warn = staticmethod(options.warn)

    def _print(self, line: str) -> None:
        # writing to a pipe may block; an interruption is safe, because the log has no incomplete reading now
        with self.interrupted.at_once():
            sys.stdout.write(line + "\n")
            sys.stdout.flush()


@contextmanager
def _interruption_reported(out: Path, terminal: _Terminal) -> Iterator[None]:
    """After an interruption, print the number of recorded readings when the log is closed."""

    def message() -> str:
        count = terminal.log.count if terminal.log and terminal.count else 0
        where = terminal.log.path if terminal.log else out
        kept = f"{counted_are(count, 'reading')} kept in {where}" if count else "nothing was recorded"
        return f"interrupted; {kept}"

    def last_words() -> str:
        return harmless(f"sonarhw: {message()}")

    LAST_WORDS.append(last_words)
    try:
        yield
    except KeyboardInterrupt:
        LAST_WORDS.clear()
        with suppress(OSError):  # the terminal may be closed
            options.print_error(message())
        raise
    finally:
        LAST_WORDS.clear()


def _warn_of_another_count(count: int, request: ScanRequest) -> None:
    """Warn if the number of readings is not the requested one: a replayed log has its own number of readings."""
    if count != request.order.readings:
        requested = counted(request.order.readings, "reading")
        options.warn(f"{requested} requested, {count} received: a replay plays the readings of its log")


def _report_ignored(scanner: "Scanner") -> None:
    """Print what of the received text was no reading."""
    for note in scanner.notes:
        options.print_note(note)
    kinds = ", ".join(f"{kind} ({count})" for kind, count in scanner.ignored.items())
    if kinds:
        options.print_note(f"ignored: {kinds}")


def _warn_of_the_link(scanner: "Scanner") -> None:
    link = scanner.statistics
    if link.resets and not link.reopened and scanner.info.protocol == (0, 0):
        options.warn(
            f"the device restarted {counted(link.resets, 'time')}; a sweep that a restart ends is not "
            "counted as whole; check the supply"
        )
    elif link.reopened or link.resets:  # a short silence alone does not matter
        options.warn(f"the connection was lost {counted(link.losses, 'time')} and restored; check the cable")
    elif link.lost_readings:
        options.warn(f"the link lost {counted(link.lost_readings, 'reading')}, measured again; check the cable")


# `sonarhw ping`: the echoes of a ranging board without a turntable, live in the terminal.


LEVELS = " .:-=+*#%@"  # of a trace, each LEVEL_DB stronger; the last one reaches full scale
LEVEL_DB = 5.0
COLUMNS = 60  # characters of a trace


PingCount = Annotated[int | None, typer.Option(help="Number of pings; default: until Ctrl-C.", min=1, max=MOST_SWEEPS)]
ShowTraces = Annotated[
    bool, typer.Option("--traces", help="Also show the receive signal of every ping, as one row of characters.")
]


def ping(
    url: inputs.ScannerUrl,
    count: PingCount = None,
    out: Annotated[Path | None, typer.Option(help="Also write a log.", metavar="LOG.mcap")] = None,
    board: options.BoardOfScanner = None,
    max_range: options.MaxRange = None,
    temperature: options.Temperature = None,
    traces: ShowTraces = False,
    force: options.Force = False,
) -> None:
    """Ping at the present angle (at all angles: `scan`).

    Each is printed as it arrives. The turntable is not homed or turned and its motor stays off, so a ranging board
    alone is enough.
    """
    if out is not None:
        checked_out(out, (options.LOG,), force, url, board)
    options.check_scan_values(board, max_range, temperature)
    with inputs.connect_turntable(url) as scanner:
        profile = inputs.board_of(scanner, board)
        plan = _plan(count or MOST_SWEEPS, profile, max_range, temperature, traces)
        if traces and not scanner.info.trace_rate:
            options.warn(f"{url}: the scanner sends no traces; only echo times are shown")
        terminal = _PingTerminal(plan.reach)
        try:
            _run(scanner, plan, profile, out, force, terminal)
        finally:
            if terminal.count:
                kept = "" if terminal.log is None else f", in {terminal.log.path}"
                options.print_note(f"{counted(terminal.count, 'reading')}, {terminal.echoes} with an echo{kept}")


def _plan(count: int, board: "Board", max_range: float | None, temperature: float | None, traces: bool) -> "ScanPlan":
    from sonarhw.host.scanner import ScanPlan
    from sonarhw.readings import pings_in_place
    from sonarhw.sound_speed import ScanAir

    reach = board.max_range if max_range is None else max_range
    return ScanPlan(
        pings_in_place(count), reach, board.blanking_end, ScanAir(chosen_temperature=temperature), traces=traces
    )


def _run(
    scanner: "Scanner", plan: "ScanPlan", board: "Board", out: Path | None, force: bool, terminal: "_PingTerminal"
) -> None:
    from sonarhw.host.scanner import record_scan
    from sonarhw.log import LogMetadata

    with interruption(scanner.stop) as terminal.interrupted:
        metadata = LogMetadata(made_by="ping", started=time.time(), board=board.name, board_text=board.text)
        terminal.log = None if out is None else _log(out, metadata, force)
        record_scan(scanner, plan, terminal.log, terminal)


class _PingTerminal:
    """Prints the readings as they arrive, and counts them."""

    def __init__(self, reach: float) -> None:
        """`reach` is the range at the end of a printed trace, m."""
        self.interrupted: Interruption
        self.log: LogWriter | None = None
        self._reach = reach
        self._began: float | None = None
        self.count = self.echoes = 0  # readings, and those with an echo

    @property
    def stop_wanted(self) -> bool:
        return self.interrupted.wanted

    def homed(self) -> None:
        """Do nothing: no turntable homes."""

    def reading(self, reading: "Reading") -> None:
        self.count += 1
        self.echoes += bool(reading.echo_times)
        if self._began is None:
            self._began = reading.time
        row = "" if reading.trace is None else f"|{trace_row(reading.trace, reading.speed_of_sound, self._reach)}|  "
        ranges = " ".join(f"{distance:.3f}" for distance in reading.echo_ranges)
        with self.interrupted.at_once():  # writing to a pipe may block
            options.print_line(f"{reading.time - self._began:9.3f} s  {row}{ranges + ' m' if ranges else 'no echo'}")

    warn = staticmethod(options.warn)


def trace_row(trace: "Trace", speed_of_sound: float, reach: float) -> str:
    """Return a trace from 0 to `reach` m as COLUMNS characters of LEVELS for the strongest sample; `?`: all are lost.

    `speed_of_sound` is in m/s.
    """
    import numpy as np

    columns = (trace.times * speed_of_sound / 2 / reach * COLUMNS).astype(int)
    shown = (columns >= 0) & (columns < COLUMNS) & ~np.isnan(trace.samples)
    highest = np.full(COLUMNS, -1.0)
    np.maximum.at(highest, columns[shown], np.abs(trace.samples[shown]))
    steps = len(LEVELS) + 20 * np.log10(np.maximum(highest, 1e-9)) / LEVEL_DB
    steps = np.clip(np.floor(steps), 0, len(LEVELS) - 1).astype(int)
    return "".join("?" if level < 0 else LEVELS[step] for level, step in zip(highest, steps, strict=True))


# `sonarhw serve`: scan, and publish the readings to viewers while they are measured.


_ADDRESS = "127.0.0.1:8765"  # the port that Foxglove suggests


OnFoxglove = Annotated[
    bool, typer.Option("--foxglove", help="Publish on the WebSocket of Foxglove; needs the extra foxglove.")
]
FoxgloveAddress = Annotated[
    str, typer.Option("--tcp", help="Address to listen on; port 0 selects a free port.", metavar="HOST:PORT")
]
SweepsServed = Annotated[
    int | None, typer.Option(help="Number of sweeps; default: until Ctrl-C.", min=1, max=MOST_SWEEPS)
]


def serve(
    context: typer.Context,
    url: inputs.ScannerUrl,
    foxglove: OnFoxglove = False,
    tcp: FoxgloveAddress = _ADDRESS,
    out: Annotated[Path | None, typer.Option(help="Also write a log; needs --sweeps.", metavar="LOG.mcap")] = None,
    room: options.RoomToStore = None,
    place: options.PlaceName = None,
    board: options.BoardOfScanner = None,
    start: options.FromAngle = 0.0,
    stop: options.ToAngle = 360.0,
    step: options.StepAngle = 5.0,
    sweeps: SweepsServed = None,
    pings: options.PingsPerHeading = 1,
    max_range: options.MaxRange = None,
    temperature: options.TemperatureInRoom = None,
    traces: Annotated[bool, typer.Option("--traces", help="Publish the receive signal of every ping.")] = False,
    zero_here: options.ZeroHere = False,
    reconnect: inputs.Reconnect = inputs.RECONNECT,
    force: options.Force = False,
) -> None:
    """Scan until Ctrl-C, for other programs (to record a log: `scan`).

    The first line of standard output is the address.

    The topics are those of a log: /readings, /traces, and /scan with each whole sweep. With --room, /prediction has the
    predicted ranges beside each /scan.
    """
    from sonarhw.foxglove import FoxgloveServer
    from sonarhw.host.scanner import until_stopped
    from sonarhw.plugins.device_plugin import takes_orders

    if out is not None:
        checked_out(out, (options.LOG,), force, url, room, board)
    by_itself = not takes_orders(url)
    if by_itself:
        refuse_orders(context)
    order = options.order_in_degrees(start, stop, step, sweeps or 1, pings)
    order = order if sweeps else until_stopped(order)
    options.warn_of_radians(start, stop)
    request = ScanRequest(order, board, max_range, temperature, traces, False, zero_here, by_itself)
    check_request(request)
    where = room_and_place(room, place, out)
    alone = None if room or place is None else inputs.place_without_room(place)
    with FoxgloveServer(tcp) as server:
        options.print_line(server.url)
        with inputs.connect(url, reconnect) as scanner:
            profile = inputs.board_of(scanner, board)
            plan = scan_plan(scanner, request, profile, where[0].air if where else None)
            # a replay and a device that turns by itself have another number of readings than the order
            fixed_order = order if scanner.info.capabilities else None
            publisher = _Publisher(server, fixed_order, where, profile)
            metadata = replace(log_metadata(room, where, alone), board=profile.name, board_text=profile.text)
            try:
                _scan(scanner, plan, publisher, metadata, out, force)
            finally:
                publisher.end()
                kept = f", in {publisher.log.path}" if publisher.log and publisher.count else ""
                options.print_note(f"{counted(publisher.count, 'reading')} published{kept}")


def _scan(
    scanner: "Scanner",
    plan: "ScanPlan",
    publisher: "_Publisher",
    metadata: "LogMetadata",
    out: Path | None,
    force: bool,
) -> None:
    from sonarhw.host.scanner import record_scan

    with interruption(scanner.stop) as publisher.interrupted:
        publisher.log = None if out is None else _log(out, metadata, force)
        record_scan(scanner, plan, publisher.log, publisher)


class _Publisher:
    """Receives the progress of a scan and publishes it, with predicted ranges in a room. Counts the readings."""

    def __init__(
        self, server: "FoxgloveServer", order: "ScanOrder | None", where: "tuple[Room, Place] | None", board: "Board"
    ) -> None:
        """`order` is None if the scan may have another number of readings."""
        from sonarhw.log.writer import OpenSweeps

        self.count = 0
        self.log: LogWriter | None = None
        self.interrupted: Interruption
        self._server = server
        self._of_each = None if order is None else order.headings * order.pings
        self._where, self._board = where, board
        self._paths: Paths | None = None  # to the place, followed once
        self._sweeps = OpenSweeps()

    @property
    def stop_wanted(self) -> bool:
        return self.interrupted.wanted

    def homed(self) -> None:
        """Do nothing: the first reading follows."""

    def reading(self, reading: "Reading") -> None:
        self.count += 1
        self._server.reading(reading)
        for sweep in self._sweeps.add(reading, self._of_each):
            self._publish(sweep)

    warn = staticmethod(options.warn)

    def end(self) -> None:
        """Publish the last sweep, which may be incomplete."""
        for sweep in self._sweeps.end():
            self._publish(sweep)

    def _publish(self, sweep: "list[Reading]") -> None:
        self._server.sweep(sweep, self._predicted(sweep))

    def _predicted(self, sweep: "list[Reading]") -> list[float | None] | None:
        """Return the predicted range at the heading of each reading, m; None for no echo. None without a room."""
        if self._where is None:
            return None
        from sonarhw_compare.match import headings_of
        from sonarhw_sim.predict.prediction import predict_scan

        room, place = self._where
        headings = headings_of(sweep, place, self._board)
        prediction = predict_scan(room, place, self._board, headings, paths=self._paths)
        self._paths = prediction.paths
        return [None if math.isnan(distance) else distance for distance in prediction.ranges.tolist()]
