"""`sonarhw report`: write one HTML file about a scan: room, scan, comparison, every reading, settings."""

from pathlib import Path
from typing import Annotated

import typer

from sonarhw_cli.comparison.compare_command import warn_of_few_explained
from sonarhw_cli.console.log_input import LogFile, notes_beside, open_in_room
from sonarhw_cli.console.options import BoardOfLog, FitOption, Force, PlaceName, ReceiverChoice, RoomOfLog
from sonarhw_cli.console.output import checked_out, write_text
from sonarhw_cli.console.progress import progress_of_fit
from sonarhw_cli.console.room_input import print_place


def report(
    log_file: LogFile,
    out: Annotated[Path, typer.Option("--out", help="File to write.", metavar="FILE.html")],
    room_name: RoomOfLog = None,
    place: PlaceName = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    fit: FitOption = "",
    force: Force = False,
) -> None:
    """Write one HTML file about a scan. It has pictures, a summary, notes, every reading and the settings."""
    checked_out(out, (".html",), force, log_file, room_name, board)
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare.one_call import fitted_report
    from sonarhw_compare.report import report_html
    from sonarhw_sim.predict.prediction import PredictionOptions

    here = scan.place(room, place)
    print_place(room, here)
    notes, options = notes_beside(log_file, scan.readings), PredictionOptions(receiver=receiver)
    with progress_of_fit(fit) as tick:
        made = fitted_report(scan, room, here, chosen, fit, notes, options=options, tick=tick)
    warn_of_few_explained(log_file, made.comparison)
    write_text(out, report_html(made), force)
