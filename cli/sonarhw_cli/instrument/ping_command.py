"""`sonarhw ping`: the echoes of a ranging board without a turntable, live in the terminal."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import counted
from sonarhw_cli.console.connect import ScannerUrl, board_of, connect_turntable
from sonarhw_cli.console.interruption import Interruption, interruption
from sonarhw_cli.console.lines import print_line, print_note, warn
from sonarhw_cli.console.options import LOG, BoardOfScanner, Force, MaxRange, Temperature, check_scan_values
from sonarhw_cli.console.output import checked_out

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board

    from sonarhw.host.scanner import Scanner, ScanPlan
    from sonarhw.readings import Reading, Trace

MOST_PINGS = 65535  # largest number that fits into the scan command
LEVELS = " .:-=+*#%@"  # of a trace, each LEVEL_DB stronger; the last one reaches full scale
LEVEL_DB = 5.0
COLUMNS = 60  # characters of a trace


PingCount = Annotated[int | None, typer.Option(help="Number of pings; default: until Ctrl-C.", min=1, max=MOST_PINGS)]
ShowTraces = Annotated[
    bool, typer.Option("--traces", help="Also show the receive signal of every ping, as one row of characters.")
]


def ping(
    url: ScannerUrl,
    count: PingCount = None,
    out: Annotated[Path | None, typer.Option(help="Also write a log.", metavar="LOG.mcap")] = None,
    board: BoardOfScanner = None,
    max_range: MaxRange = None,
    temperature: Temperature = None,
    traces: ShowTraces = False,
    force: Force = False,
) -> None:
    """Ping at the present angle, and print the readings.

    Each is printed as it arrives. The turntable is not homed or turned and its motor stays off, so a ranging board
    alone is enough.
    """
    if out is not None:
        checked_out(out, (LOG,), force, url, board)
    check_scan_values(board, max_range, temperature)
    with connect_turntable(url) as scanner:
        profile = board_of(scanner, board)
        plan = _plan(count or MOST_PINGS, profile, max_range, temperature, traces)
        if traces and not scanner.info.trace_rate:
            warn(f"{url}: the scanner sends no traces; only echo times are shown")
        terminal = _Terminal(plan.reach)
        try:
            _run(scanner, plan, profile, out, force, terminal)
        finally:
            if terminal.count:
                kept = "" if out is None else f", in {out}"
                print_note(f"{counted(terminal.count, 'reading')}, {terminal.echoes} with an echo{kept}")


def _plan(count: int, board: "Board", max_range: float | None, temperature: float | None, traces: bool) -> "ScanPlan":
    from sonarhw.host.scanner import ScanPlan
    from sonarhw.readings import ScanAir, pings_in_place

    reach = board.max_range if max_range is None else max_range
    return ScanPlan(
        pings_in_place(count), reach, board.blanking_end, ScanAir(chosen_temperature=temperature), traces=traces
    )


def _run(
    scanner: "Scanner", plan: "ScanPlan", board: "Board", out: Path | None, force: bool, terminal: "_PingTerminal"
) -> None:
    from sonarhw.host.scanner import record_scan, run_scan
    from sonarhw.log import LogMetadata, LogWriter

    with interruption(scanner.stop) as terminal.interrupted:
        if out is None:
            run_scan(scanner, plan, terminal)
            return
        metadata = LogMetadata(made_by="ping", started=time.time(), board=board.name, board_text=board.text)
        record_scan(scanner, plan, LogWriter(out, metadata, overwrite=force, warn=warn), terminal)


class _Terminal:
    """Prints the readings as they arrive, and counts them."""

    def __init__(self, reach: float) -> None:
        """`reach` is the range at the end of a printed trace, m."""
        self.interrupted: Interruption
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
            print_line(f"{reading.time - self._began:9.3f} s  {row}{ranges + ' m' if ranges else 'no echo'}")

    def warn(self, message: str) -> None:
        warn(message)


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
