"""`sonarhw scan`: scan, and record a log."""

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError
from sonarhw.export.csv_rows import HEADER, row
from sonarhw.harmless_text import counted, counted_are
from sonarhw_cli.console.connect import RECONNECT, Reconnect, ScannerUrl, board_of, connect
from sonarhw_cli.console.interruption import Interruption, interruption
from sonarhw_cli.console.lines import print_detail, print_error, print_note, warn
from sonarhw_cli.console.options import (
    LOG,
    BoardOfScanner,
    Force,
    FromAngle,
    MaxRange,
    PingsPerHeading,
    PlaceName,
    RoomToStore,
    StepAngle,
    TemperatureInRoom,
    ToAngle,
    ZeroHere,
    check_scan_values,
    order_in_degrees,
    refuse_given,
)
from sonarhw_cli.console.output import checked_out, standard_output
from sonarhw_cli.console.progress import progress
from sonarhw_cli.console.room_input import chosen_place, open_room

if TYPE_CHECKING:
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.model import Place, Room

    from sonarhw.host.connected_scanner import ConnectedScanner
    from sonarhw.log import LogMetadata, LogWriter
    from sonarhw.plugins.plugin_scanner import PluginScanner
    from sonarhw.readings import Reading, ScanOrder
    from sonarhw.scanning.scan_recording import ScanPlan


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


Sweeps = Annotated[int, typer.Option(help="Number of sweeps, forwards and backwards.", min=1, max=65535)]
PrintReadings = Annotated[
    bool,
    typer.Option("--print", help="Write each reading to standard output as CSV; heading_deg is the turntable angle."),
]


def scan(
    context: typer.Context,
    url: ScannerUrl,
    out: Annotated[Path, typer.Option(help="Log to write.", metavar="LOG.mcap")],
    room: RoomToStore = None,
    place: PlaceName = None,
    board: BoardOfScanner = None,
    start: FromAngle = 0.0,
    stop: ToAngle = 360.0,
    step: StepAngle = 5.0,
    sweeps: Sweeps = 1,
    pings: PingsPerHeading = 1,
    max_range: MaxRange = None,
    temperature: TemperatureInRoom = None,
    traces: Annotated[bool, typer.Option("--traces", help="Record the receive signal of every ping.")] = False,
    show: PrintReadings = False,
    zero_here: ZeroHere = False,
    reconnect: Reconnect = RECONNECT,
    force: Force = False,
) -> None:
    """Scan and record a log. With --print, each reading is also written to standard output as it arrives."""
    from sonarhw.plugins.plugin_list import takes_orders

    if not takes_orders(url):
        refuse_orders(context)
    order = order_in_degrees(start, stop, step, sweeps, pings)
    request = ScanRequest(order, board, max_range, temperature, traces, show, zero_here, not takes_orders(url))
    checked_out(out, (LOG,), force, url, room, board)
    check_request(request)
    where = room_and_place(room, place, out)
    with connect(url, reconnect) as scanner:
        metadata, air = log_metadata(room, where), where[0].air if where else None
        _record(scanner, request, out, force, metadata, air)


def refuse_orders(context: typer.Context) -> None:
    """Raise InputError for an option that a device cannot obey which turns and measures by itself."""
    reason = "this device turns and measures by itself; remove the option, and end the scan with --sweeps N"
    refuse_given(context, _ORDERS, reason)


def check_request(request: ScanRequest) -> None:
    """Raise InputError for an impossible option. The scanner checks the limits of the turntable."""
    _check_order(request.order)
    if request.show:
        standard_output()
    check_scan_values(request.board, request.max_range, request.temperature)


def _check_order(order: "ScanOrder") -> None:
    """Raise InputError for an order that does not fit into a frame."""
    from sonarhw.wire.limits import MOST_READINGS
    from sonarhw.wire.units import microdegrees_of

    if microdegrees_of(order.step) == 0:
        raise InputError(f"--step {math.degrees(order.step):g}: too fine; expected 0.000001 degrees or more")
    if order.readings > MOST_READINGS:
        raise InputError(
            f"--sweeps {order.sweeps}, --pings {order.pings}: {order.readings} readings of {order.headings} headings, "
            f"at most {MOST_READINGS} are possible; reduce one of them"
        )


def room_and_place(room_name: str | None, place: str | None, out: Path | None) -> "tuple[Room, Place] | None":
    """Return the room and the place of --room and --place; None without a room. Raises InputError."""
    if room_name is None:
        if place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return None
    room = open_room(room_name)
    if place is None and len(room.places) != 1:
        raise InputError(
            f"--room {room_name}: give --place NAME or --place X,Y in metres; its places: "
            f"{', '.join(room.places) or 'none'}; from an unknown place, scan without --room, "
            f"then run `sonarhw locate {out or 'LOG.mcap'} --room {room_name}`"
        )
    return room, chosen_place(room, place)


def log_metadata(room_name: str | None, where: "tuple[Room, Place] | None") -> "LogMetadata":
    """Return the metadata of a log that begins now, with the room of `room_and_place`."""
    from sonarhw_sim.named_file import file_name

    from sonarhw.log import LogMetadata

    metadata = LogMetadata(made_by="scan", started=time.time())
    if room_name is None or where is None:
        return metadata
    room, here = where
    return replace(metadata, room_file=file_name(room_name), room_text=room.text, place=here.name)


def _record(
    scanner: "ConnectedScanner",
    request: ScanRequest,
    out: Path,
    force: bool,
    metadata: "LogMetadata",
    room_air: "Air | None",
) -> None:
    from sonarhw.log import LogWriter
    from sonarhw.plugins.plugin_scanner import PluginScanner
    from sonarhw.scanning.scan_recording import record_scan

    board = board_of(scanner, request.board)
    metadata = replace(metadata, board=board.name, board_text=board.text)
    plan = scan_plan(scanner, request, board, room_air)
    with ExitStack() as exit_stack:
        terminal = _Terminal(scanner, request, exit_stack)
        exit_stack.enter_context(_interruption_reported(out, terminal))
        terminal.interrupted = exit_stack.enter_context(interruption(scanner.stop))
        terminal.log = log = LogWriter(out, metadata, overwrite=force, warn=warn)
        if request.turns_by_itself:  # the start of a sweep may be far away
            terminal.show_bar()
        record_scan(scanner, plan, log, terminal)
    print_note(f"{counted(terminal.count, 'reading')}, {terminal.echoes} with an echo, in {out}")
    if isinstance(scanner, PluginScanner):
        _report_ignored(scanner)
    else:
        _warn_of_another_count(terminal.count, request)
    _warn_of_the_link(scanner)


def scan_plan(scanner: "ConnectedScanner", request: ScanRequest, board: "Board", room_air: "Air | None") -> "ScanPlan":
    """Return the plan of the scan, with warnings about what this scanner and board cannot do."""
    from sonarhw_sim.air import Air

    from sonarhw.scanning.scan_recording import ScanPlan
    from sonarhw.sound_speed import ScanAir

    air = room_air or Air()
    if request.max_range is not None and request.max_range > board.max_range:
        warn(
            f"--max-range {request.max_range:g}: board {board.name!r} detects echoes to {board.max_range:g} m; "
            f"each ping now takes at least {2 * request.max_range / air.speed_of_sound:.2g} s"
        )
    if request.traces and not scanner.info.trace_rate:
        warn(f"{scanner.url}: the scanner sends no traces; only echo times are recorded")
    plan = ScanPlan(
        request.order,
        reach=board.max_range if request.max_range is None else request.max_range,
        blanking=board.blanking_end,
        air=ScanAir(air.speed_at, air.temperature_c, request.temperature),
        traces=request.traces,
        zero_here=request.zero_here,
    )
    print_detail(f"board {board.name!r}; speed of sound {plan.air.speed_of_sound(scanner.info.temperature_c):.2f} m/s")
    return plan


class _Terminal:
    """Shows the progress of a scan: the bar, the lines of --print and warnings. Counts the readings."""

    def __init__(self, scanner: "ConnectedScanner", request: ScanRequest, exit_stack: ExitStack) -> None:
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

    def warn(self, message: str) -> None:
        warn(message)

    def _print(self, line: str) -> None:
        # writing to a pipe may block; an interruption is safe, because the log has no incomplete reading now
        with self.interrupted.at_once():
            sys.stdout.write(line + "\n")
            sys.stdout.flush()


@contextmanager
def _interruption_reported(out: Path, terminal: _Terminal) -> Iterator[None]:
    """After an interruption, print the number of recorded readings when the log is closed."""
    try:
        yield
    except KeyboardInterrupt:
        count = terminal.log.count if terminal.log and terminal.count else 0
        kept = f"{counted_are(count, 'reading')} kept in {out}" if count else "nothing was recorded"
        with suppress(OSError):  # the terminal may be closed
            print_error(f"interrupted; {kept}")
        raise


def _warn_of_another_count(count: int, request: ScanRequest) -> None:
    """Warn if the number of readings is not the requested one: a replayed log has its own number of readings."""
    if count != request.order.readings:
        requested = counted(request.order.readings, "reading")
        warn(f"{requested} requested, {count} received: a replay plays the readings of its log")


def _report_ignored(scanner: "PluginScanner") -> None:
    """Print what of the received text was no reading."""
    kinds = ", ".join(f"{kind} ({count})" for kind, count in scanner.ignored.items())
    if kinds:
        print_note(f"ignored: {kinds}")


def _warn_of_the_link(scanner: "ConnectedScanner") -> None:
    link = scanner.statistics
    if link.reopened or link.resets:  # a short silence alone does not matter
        warn(f"the connection was lost {counted(link.losses, 'time')} and restored; check the cable")
    elif link.lost_readings:
        warn(f"the link lost {counted(link.lost_readings, 'reading')}, measured again; check the cable")
