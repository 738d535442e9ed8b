"""`sonarhw scan`: scan, and record a log."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import counted, counted_are
from sonarhw.export import HEADER, row
from sonarhw_cli.console.connect import RECONNECT, Reconnect, ScannerUrl, board_of, connect
from sonarhw_cli.console.interruption import Interruption, interruption
from sonarhw_cli.console.lines import print_error, print_note, warn
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
    order_in_degrees,
    warn_of_radians,
)
from sonarhw_cli.console.output import checked_out
from sonarhw_cli.console.progress import progress
from sonarhw_cli.instrument.scan_request import (
    ScanRequest,
    check_request,
    log_metadata,
    refuse_orders,
    room_and_place,
    scan_plan,
)

if TYPE_CHECKING:
    from sonarhw_sim.air import Air

    from sonarhw.host.scanner import ConnectedScanner
    from sonarhw.log import LogMetadata, LogWriter
    from sonarhw.plugins.plugin_scanner import PluginScanner
    from sonarhw.readings import Reading


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
    from sonarhw.plugins.device_plugin import takes_orders

    if not takes_orders(url):
        refuse_orders(context)
    order = order_in_degrees(start, stop, step, sweeps, pings)
    warn_of_radians(start, stop)
    request = ScanRequest(order, board, max_range, temperature, traces, show, zero_here, not takes_orders(url))
    checked_out(out, (LOG,), force, url, room, board)
    check_request(request)
    where = room_and_place(room, place, out)
    with connect(url, reconnect) as scanner:
        metadata, air = log_metadata(room, where), where[0].air if where else None
        _record(scanner, request, out, force, metadata, air)


def _record(
    scanner: "ConnectedScanner",
    request: ScanRequest,
    out: Path,
    force: bool,
    metadata: "LogMetadata",
    room_air: "Air | None",
) -> None:
    from sonarhw.host.scanner import record_scan
    from sonarhw.log import LogWriter
    from sonarhw.plugins.plugin_scanner import PluginScanner

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
