"""`sonarhw scan`: scan and record."""

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError, LinkError, NoAnswer
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
    scan_order,
    speed_of_air,
)
from sonarhw_cli.console.output import standard_output
from sonarhw_cli.console.progress import progress
from sonarhw_cli.console.room_input import open_room

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board

    from sonarhw.host.scanner import Scanner
    from sonarhw.log import LogMetadata, LogWriter


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
    temperature: Annotated[float | None, typer.Option(help="Air, °C; default: the scanner's own, else 20.")] = None,
    traces: Annotated[bool, typer.Option("--traces", help="Record the receive signal of every ping.")] = False,
    show: Annotated[bool, typer.Option("--print", help="Write each reading to standard output as CSV.")] = False,
    reconnect: Annotated[
        float, typer.Option(help="Wait this long for a lost scanner to come back, seconds.", metavar="S", min=0)
    ] = RECONNECT,
    force: Force = False,
) -> None:
    """Scan and record a log; with --print each reading is also written out as it arrives."""
    wish = _Wish(scan_order(start, stop, step, sweeps, pings), out, force, board, max_range, temperature, traces, show)
    checked_out(out, (LOG,), force, url, room, board)
    _check(wish)
    metadata = _metadata(room, place)
    with sigterm_raises(), connect(url, reconnect) as scanner:
        _record(scanner, wish, metadata)


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


def _metadata(room_file: Path | None, place: str | None) -> "LogMetadata":
    from sonarhw.log import LogMetadata

    if room_file is None:
        if place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return LogMetadata(made_by="scan", started=time.time())
    room = open_room(room_file)
    here = chosen_place(room, place)
    return LogMetadata(
        made_by="scan", started=time.time(), room_file=room_file.name, room_text=room.text, place=here.name
    )


def _record(scanner: "Scanner", wish: _Wish, metadata: "LogMetadata") -> None:
    from dataclasses import replace

    from sonarhw.log import LogWriter

    board = _board(scanner, wish)
    metadata = replace(metadata, board=board.name, board_text=board.text)
    taken = _Taken()
    with (
        _what_is_kept_told(wish, taken),
        interruption(scanner.stop) as interrupted,
        LogWriter(wish.out, metadata, overwrite=wish.force, warn=_warn) as log,
        _no_log_without_readings(log, taken, interrupted),
    ):
        scanner.record(log)
        try:
            _prepare(scanner, wish, board)
            if not interrupted.wanted:
                scanner.home()
            if not interrupted.wanted:
                _take(scanner, wish, taken, interrupted)
        except (LinkError, NoAnswer) as error:
            kept = f"; {_are(taken.count)} kept in {wish.out}" if taken.count else ""
            raise type(error)(f"{error}{kept}") from error
    typer.echo(f"{counted(taken.count, 'reading')}, {taken.echoes} with an echo, in {wish.out}", err=True)
    _warn_of_another_count(taken, wish)
    _warn_of_the_link(scanner)


@contextmanager
def _what_is_kept_told(wish: _Wish, taken: "_Taken") -> Iterator[None]:
    """Say what an interrupted scan has left, once its log is closed."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"{_are(taken.count)} kept in {wish.out}" if taken.count else "nothing is recorded"
        with suppress(OSError):  # the terminal may be gone
            typer.echo(f"sonarhw: interrupted; {kept}", err=True)
        raise


def _warn_of_another_count(taken: "_Taken", wish: _Wish) -> None:
    """A replayed log plays what it holds, whatever is ordered."""
    if taken.count != wish.order.readings:
        more = "no more" if taken.count < wish.order.readings else "so many, and a replay plays them all"
        _warn(f"{taken.count} of {counted(wish.order.readings, 'reading')} came: the log holds {more}")


def _warn_of_the_link(scanner: "Scanner") -> None:
    books = scanner.statistics
    if books.reopened or books.resets:  # a moment's silence alone is no matter
        _warn(f"the scanner was lost {counted(books.losses, 'time')} on the way and came back; is the cable sound?")
    elif books.lost_readings:
        _warn(f"measured again, for the link had lost them: {counted(books.lost_readings, 'reading')}")
    if scanner.unchecked:
        _warn(scanner.unchecked)


def _are(readings: int) -> str:
    return f"{counted(readings, 'reading')} {'is' if readings == 1 else 'are'}"


@dataclass
class _Taken:
    """How far the scan has come."""

    count: int = 0
    echoes: int = 0  # readings that have one


@contextmanager
def _no_log_without_readings(log: "LogWriter", taken: _Taken, interrupted: Interruption) -> Iterator[None]:
    """Where a scan ends before its first reading, leave nothing: the next try is free, an old log is as it was."""
    failed = True
    try:
        yield
        failed = interrupted.wanted
    finally:
        if failed and taken.count == 0:
            log.drop()


def _warn(line: str) -> None:
    typer.echo(f"sonarhw: warning: {line}", err=True)


def _warn_where_room_is_short(scanner: "Scanner", wish: _Wish) -> None:
    """Say before the scan begins that the disk will be full before it ends."""
    from sonarhw.disk_room import free_bytes, log_size

    settings = scanner.settings
    samples = settings.listen * scanner.info.trace_rate if settings and settings.trace else 0.0
    need, free = log_size(wish.order.readings, samples), free_bytes(wish.out)
    if free is not None and free < need:
        _warn(
            f"{wish.out}: the scan takes some {need / 1e6:.1f} MB and its disk has {free / 1e6:.1f} MB free, "
            f"enough for {free / need:.0%} of it; make room"
        )


def _board(scanner: "Scanner", wish: _Wish) -> "Board":
    from sonarhw_sim.board.profile import board_names, load_board

    named = scanner.info.board
    return load_board(wish.board or (named if named in board_names() else DEFAULT_BOARD))


def _prepare(scanner: "Scanner", wish: _Wish, board: "Board") -> None:
    speed = speed_of_air(wish.temperature, scanner.info.temperature_c)
    reach = board.max_range if wish.max_range is None else wish.max_range
    if wish.traces and not scanner.info.trace_rate:
        _warn(f"{scanner.url}: sends no traces; only echo times are recorded")
    scanner.configure(2 * reach / speed, board.listens_from, wish.traces, speed)
    _warn_where_room_is_short(scanner, wish)


def _take(scanner: "Scanner", wish: _Wish, taken: _Taken, interrupted: Interruption) -> None:
    # what the scanner is doing: a lost one is waited for
    bar = progress(wish.order.readings, lambda: scanner.state.value)
    with bar as advance, _printed(wish, scanner, interrupted) as show:
        for reading in scanner.scan(wish.order):
            taken.count += 1
            taken.echoes += bool(reading.echo_times)
            show(reading)
            advance()


@contextmanager
def _printed(wish: _Wish, scanner: "Scanner", interrupted: Interruption) -> Iterator[Callable[[Reading], None]]:
    from sonarhw.export.csv_rows import HEADER, row

    def line(text: str) -> None:
        # a pipe that nobody reads blocks here; nothing of the log is half written meanwhile
        with interrupted.at_once():
            sys.stdout.write(text + "\n")
            sys.stdout.flush()

    began: list[float] = []

    def show(reading: Reading) -> None:
        if not began:
            began.append(min(scanner.scan_began, reading.time))
        line(row(reading, began[0]))

    if wish.show:
        line(HEADER)
    yield show if wish.show else lambda reading: None
