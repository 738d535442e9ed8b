"""`sonarhw scan`: scan and record."""

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
from sonarhw.readings import Reading, ScanOrder
from sonarhw_cli.console.connect import RECONNECT, ScannerUrl, connect
from sonarhw_cli.console.interruption import Interruption, interruption, sigterm_raises
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import (
    DEFAULT_BOARD,
    LOG,
    Force,
    FromDegrees,
    PlaceName,
    StepDegrees,
    ToDegrees,
    check_temperature,
    checked_out,
    chosen_place,
    order_in_degrees,
)
from sonarhw_cli.console.output import standard_output
from sonarhw_cli.console.progress import progress
from sonarhw_cli.console.room_input import open_room
from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import Board

    from sonarhw.host.scanner import Scanner
    from sonarhw.log import LogMetadata
    from sonarhw.scan_recording import ScanPlan


@dataclass(frozen=True)
class _Wish:
    """What the person asked for."""

    order: ScanOrder
    out: Path
    force: bool
    board: str | None
    max_range: float | None  # m
    temperature: float | None  # °C
    traces: bool
    show: bool


def scan(
    url: ScannerUrl,
    out: Annotated[Path, typer.Option(help="Log to write.", metavar="LOG.mcap")],
    room: Annotated[Path | None, typer.Option(help="Room file, kept in the log.", metavar="ROOM")] = None,
    place: PlaceName = None,
    board: Annotated[
        str | None, typer.Option(help="Board profile; default: what the scanner says.", metavar="NAME|FILE.toml")
    ] = None,
    start: FromDegrees = 0.0,
    stop: ToDegrees = 360.0,
    step: StepDegrees = 5.0,
    sweeps: Annotated[int, typer.Option(help="Sweeps, to and fro.", min=1, max=65535)] = 1,
    pings: Annotated[int, typer.Option(help="Pings at each heading.", min=1, max=255)] = 1,
    max_range: Annotated[float | None, typer.Option(help="Listen no further than this, metres.")] = None,
    temperature: Annotated[
        float | None, typer.Option(help="Air, °C; default: the scanner's own, else the room's, else 20.")
    ] = None,
    traces: Annotated[bool, typer.Option("--traces", help="Record the receive signal of every ping.")] = False,
    show: Annotated[bool, typer.Option("--print", help="Write each reading to standard output as CSV.")] = False,
    reconnect: Annotated[
        float, typer.Option(help="Wait this long for a lost scanner to come back, seconds.", metavar="S", min=0)
    ] = RECONNECT,
    force: Force = False,
) -> None:
    """Scan and record a log; with --print each reading is also written out as it arrives."""
    wish = _Wish(
        order_in_degrees(start, stop, step, sweeps, pings), out, force, board, max_range, temperature, traces, show
    )
    checked_out(out, (LOG,), force, url, room, board)
    _check(wish)
    metadata, air = _room(room, place)
    with sigterm_raises(), connect(url, reconnect) as scanner:
        _record(scanner, wish, metadata, air)


def _check(wish: _Wish) -> None:
    from sonarhw_sim.board.profile import load_board

    _check_order(wish.order)
    if wish.show:
        standard_output()
    if wish.board is not None:
        load_board(wish.board)
    if wish.max_range is not None and not 0 < wish.max_range < math.inf:
        raise InputError(f"--max-range {wish.max_range:g}: expected metres above 0")
    check_temperature(wish.temperature)


def _check_order(order: ScanOrder) -> None:
    """Raise InputError for an order that no frame carries; whether the turntable goes there only the scanner knows."""
    from sonarhw.wire.limits import MOST_READINGS
    from sonarhw.wire.units import microdegrees_of

    if microdegrees_of(order.step) == 0:
        raise InputError(f"--step {math.degrees(order.step):g}: too fine; expected 0.000001 degrees or more")
    if order.readings > MOST_READINGS:
        raise InputError(
            f"--sweeps {order.sweeps}, --pings {order.pings}: {order.readings} readings of {order.headings} headings, "
            f"more than {MOST_READINGS}; make fewer"
        )


def _room(room_file: Path | None, place: str | None) -> "tuple[LogMetadata, Air]":
    """What the log will say about the room, and the air in it."""
    from sonarhw_sim.air import Air

    from sonarhw.log import LogMetadata

    if room_file is None:
        if place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return LogMetadata(made_by="scan", started=time.time()), Air()
    room = open_room(room_file)
    here = chosen_place(room, place)
    metadata = LogMetadata(
        made_by="scan", started=time.time(), room_file=room_file.name, room_text=room.text, place=here.name
    )
    return metadata, room.air


def _record(scanner: "Scanner", wish: _Wish, metadata: "LogMetadata", air: "Air") -> None:
    from sonarhw.log import LogWriter
    from sonarhw.scan_recording import record_scan

    board = _board(scanner, wish)
    metadata = replace(metadata, board=board.name, board_text=board.text)
    if wish.traces and not scanner.info.trace_rate:
        warn(f"{scanner.url}: sends no traces; only echo times are recorded")
    with ExitStack() as during:
        terminal = _Terminal(scanner, wish, during)
        during.enter_context(_interruption_reported(wish, terminal))
        terminal.interrupted = during.enter_context(interruption(scanner.stop))
        log = LogWriter(wish.out, metadata, overwrite=wish.force, warn=warn)
        record_scan(scanner, _plan(wish, board, air), log, terminal)
    typer.echo(f"{counted(terminal.count, 'reading')}, {terminal.echoes} with an echo, in {wish.out}", err=True)
    _warn_of_another_count(terminal.count, wish)
    _warn_of_the_link(scanner)


def _board(scanner: "Scanner", wish: _Wish) -> "Board":
    from sonarhw_sim.board.profile import board_names, load_board

    named = scanner.info.board
    return load_board(wish.board or (named if named in board_names() else DEFAULT_BOARD))


def _plan(wish: _Wish, board: "Board", air: "Air") -> "ScanPlan":
    from sonarhw.scan_recording import ScanAir, ScanPlan

    return ScanPlan(
        wish.order,
        reach=board.max_range if wish.max_range is None else wish.max_range,
        blanking=board.listens_from,
        air=ScanAir(air.speed_at, air.temperature_c, wish.temperature),
        traces=wish.traces,
    )


class _Terminal:
    """Shows the progress of a scan: the bar, the lines of --print, warnings; and counts the readings."""

    def __init__(self, scanner: "Scanner", wish: _Wish, during: ExitStack) -> None:
        """The bar is closed with `during`."""
        self.count = 0
        self.echoes = 0  # readings that have one
        self.interrupted: Interruption
        self._scanner = scanner
        self._wish = wish
        self._during = during
        self._advance: Callable[[], None]
        self._began: float | None = None

    @property
    def stop_wanted(self) -> bool:
        return self.interrupted.wanted

    def homed(self) -> None:
        # the bar names the state of the scanner: "lost" while it waits for it
        bar = progress(self._wish.order.readings, lambda: self._scanner.state.value)
        self._advance = self._during.enter_context(bar)
        if self._wish.show:
            self._print(HEADER)

    def reading(self, reading: Reading) -> None:
        self.count += 1
        self.echoes += bool(reading.echo_times)
        if self._began is None:
            self._began = min(self._scanner.scan_began, reading.time)
        if self._wish.show:
            self._print(row(reading, self._began))
        self._advance()

    def warn(self, message: str) -> None:
        warn(message)

    def _print(self, line: str) -> None:
        # a pipe that nothing reads blocks here; no part of the log is half written meanwhile
        with self.interrupted.at_once():
            sys.stdout.write(line + "\n")
            sys.stdout.flush()


@contextmanager
def _interruption_reported(wish: _Wish, terminal: _Terminal) -> Iterator[None]:
    """Print what an interrupted scan has left, once its log is closed."""
    try:
        yield
    except KeyboardInterrupt:
        count = terminal.count
        are = "is" if count == 1 else "are"
        kept = f"{counted(count, 'reading')} {are} kept in {wish.out}" if count else "nothing is recorded"
        with suppress(OSError):  # the terminal may be gone
            typer.echo(f"sonarhw: interrupted; {kept}", err=True)
        raise


def _warn_of_another_count(count: int, wish: _Wish) -> None:
    """A replayed log plays all its readings, whatever is ordered."""
    if count != wish.order.readings:
        more = "no more" if count < wish.order.readings else "so many, and a replay plays them all"
        warn(f"{count} of {counted(wish.order.readings, 'reading')} came: the log holds {more}")


def _warn_of_the_link(scanner: "Scanner") -> None:
    link = scanner.statistics
    if link.reopened or link.resets:  # a moment's silence alone does not matter
        warn(f"the scanner was lost {counted(link.losses, 'time')} on the way and came back; is the cable sound?")
    elif link.lost_readings:
        warn(f"measured again, for the link had lost them: {counted(link.lost_readings, 'reading')}")
