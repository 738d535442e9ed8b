"""`sonarhw import`: convert CSV scans of other programs to logs."""

import math
import time
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.completions import complete_board
from sonarhw_cli.console.lines import print_note
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import LOG, Force, PlaceName, RoomToStore, checked_out, chosen_place
from sonarhw_cli.console.room_input import open_room
from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw.log import LogMetadata
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
    decimal_comma: Annotated[
        bool,
        typer.Option("--decimal-comma", help="Numbers have decimal commas; semicolons or tabs separate the columns."),
    ] = False,
    room: RoomToStore = None,
    place: PlaceName = None,
    board: Annotated[
        str | None,
        typer.Option(
            help="Board profile: name or file; stored in the log.",
            metavar="NAME|FILE.toml",
            autocompletion=complete_board,
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Convert a CSV scan of another program to a log.

    With --room, --place and --board, compare, report and fit need no options for them.
    """
    from sonarhw_compare.imports.foreign_csv import CsvColumns, Meaning, likely_no_echo, read_foreign_scan

    from sonarhw.export.encoded_log import write_scan

    checked_out(out, (LOG,), force, file, room, board)
    _check_options(scale, heading_zero)
    metadata = _metadata(room, place, board)
    sign = -1.0 if turn is TurnDirection.CW else 1.0
    columns = CsvColumns(heading, distance, time_column, decimal_comma)
    readings = read_foreign_scan(file, columns, Meaning(scale, sign, heading_zero, no_echo))
    write_scan(out, metadata, readings, overwrite=force)
    echoes = sum(reading.range is not None for reading in readings)
    print_note(f"{counted(len(readings), 'reading')}, {echoes} with an echo, in {out}")
    _warn_of_far_ranges(readings, scale)
    if no_echo is None and (likely := likely_no_echo(file, columns)):
        warn(f"{likely[1]} ranges are {likely[0]:g}; if this means no echo, add --no-echo {likely[0]:g}")


def _metadata(room_name: str | None, place: str | None, board: str | None) -> "LogMetadata":
    """Return the metadata of the log. The place may be unknown, also in a room with several places."""
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.named_file import file_name

    from sonarhw.log import LogMetadata

    metadata = LogMetadata("import", time.time())
    if board is not None:
        profile = load_board(board)
        metadata = replace(metadata, board=profile.name, board_text=profile.text)
    if room_name is None:
        if place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return metadata
    room = open_room(room_name)
    here = "" if place is None and len(room.places) != 1 else chosen_place(room, place).name
    return replace(metadata, room_file=file_name(room_name), room_text=room.text, place=here)


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
