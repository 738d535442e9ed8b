"""`sonarhw import`: convert CSV scans of other programs to logs."""

import math
import time
from enum import StrEnum
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import LOG, Force, checked_out
from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw.readings import Reading

_FAR = 20.0  # m; beyond the range of any such board


class TurnDirection(StrEnum):
    """The direction in which the turntable angles of a file increase."""

    CCW = "ccw"
    CW = "cw"


def import_csv(
    file: Annotated[Path, typer.Argument(help="CSV file with a header line.", metavar="CSV")],
    out: Annotated[Path, typer.Option("--out", help="Log to write (*.mcap).")],
    heading: Annotated[str, typer.Option("--heading", help="Column of the turntable angle, degrees.", metavar="COL")],
    distance: Annotated[
        str, typer.Option("--range", help="Column of the range; an empty field means no echo.", metavar="COL")
    ],
    scale: Annotated[float, typer.Option(help="Metres per unit of the range column.")] = 1.0,
    turn: Annotated[TurnDirection, typer.Option(help="Direction in which these angles increase.")] = TurnDirection.CCW,
    heading_zero: Annotated[
        float, typer.Option("--heading-zero", help="Turntable angle for the value 0 in the column, degrees.")
    ] = 0.0,
    no_echo: Annotated[
        float | None, typer.Option("--no-echo", help="Value in the range column that means no echo.")
    ] = None,
    time_column: Annotated[
        str | None, typer.Option("--time", help="Column of the time, s; default: readings 0.1 s apart.")
    ] = None,
    force: Force = False,
) -> None:
    """Convert a CSV scan of another program to a log."""
    from sonarhw_compare.imports.foreign_csv import CsvColumns, Meaning, likely_no_echo, read_foreign_scan

    from sonarhw.export.encoded_log import write_scan
    from sonarhw.log import LogMetadata

    checked_out(out, (LOG,), force, file)
    _check_options(scale, heading_zero)
    sign = -1.0 if turn is TurnDirection.CW else 1.0
    readings = read_foreign_scan(
        file, CsvColumns(heading, distance, time_column), Meaning(scale, sign, heading_zero, no_echo)
    )
    write_scan(out, LogMetadata("import", time.time()), readings, overwrite=force)
    echoes = sum(reading.range is not None for reading in readings)
    typer.echo(f"{out}: {counted(len(readings), 'reading')}, {echoes} with an echo")
    _warn_of_far_ranges(readings, scale)
    if no_echo is None and (likely := likely_no_echo(file, CsvColumns(heading, distance))):
        warn(f"{likely[1]} ranges are {likely[0]:g}; if this means no echo, add --no-echo {likely[0]:g}")


def _warn_of_far_ranges(readings: "list[Reading]", scale: float) -> None:
    ranges = [reading.range for reading in readings if reading.range is not None]
    if ranges and (middle := median(ranges)) > _FAR:
        warn(
            f"half of the ranges are over {middle:.4g} m, beyond the range of such a board; "
            f"if they are centimetres, use --scale {scale / 100:g}"
        )


def _check_options(scale: float, heading_zero: float) -> None:
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(f"--scale {scale:g}: expected a number above 0, such as 0.01 for centimetres")
    if not math.isfinite(heading_zero):
        raise InputError(f"--heading-zero {heading_zero:g}: expected degrees")
