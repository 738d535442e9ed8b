"""`sonarhw report`: one HTML file about a scan: room, scan, comparison, every reading, settings."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_sim.choices import Receiver

from sonarhw_cli.console.log_input import LogFile, open_log, recorded_board, recorded_place, recorded_room
from sonarhw_cli.console.options import (
    Force,
    PlaceName,
    ReceiverChoice,
    checked_out,
    chosen_place,
    chosen_receiver,
)
from sonarhw_cli.console.output import whole_file
from sonarhw_cli.console.room_input import open_room

if TYPE_CHECKING:
    from sonarhw_compare.report.html_report import Report


def report(
    log_file: LogFile,
    out: Annotated[Path, typer.Option("--out", help="File to write.", metavar="FILE.html")],
    room_file: Annotated[
        Path | None, typer.Option("--room", help="Room file; default: the room inside the log.", metavar="ROOM")
    ] = None,
    place: PlaceName = None,
    board: Annotated[
        str | None, typer.Option(help="Board profile: name or file; default: the log's.", metavar="NAME|FILE.toml")
    ] = None,
    receiver: ReceiverChoice = None,
    force: Force = False,
) -> None:
    """Write everything about a scan into one HTML file: pictures, figures, every reading, settings."""
    from sonarhw_compare.report.html_report import report_html

    checked_out(out, (".html",), force, log_file, room_file, board)
    page = report_html(report_on(log_file, room_file, place, board, receiver))
    with whole_file(out) as file:
        file.write(page.encode())


def report_on(
    log_file: Path, room_file: Path | None, place: str | None, board: str | None, receiver: Receiver | None
) -> "Report":
    """The report on a log; what is not given is taken from the log, InputError where that says nothing."""
    from sonarhw_compare.report.html_report import report_of
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.predict.prediction import PredictionOptions

    room = None if room_file is None else open_room(room_file)
    log = open_log(log_file)
    room = room or recorded_room(log_file, log.metadata)
    here = chosen_place(room, place if place is not None else recorded_place(log.metadata, room))
    chosen = load_board(board) if board else recorded_board(log_file, log.metadata)
    options = PredictionOptions(receiver=chosen_receiver(receiver, chosen))
    return report_of(log_file.name, log.readings, room, here, chosen, options, log=log)
