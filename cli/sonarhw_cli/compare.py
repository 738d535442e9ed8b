"""`sonarhw compare` and `sonarhw report`: a log and the prediction of a room, or two logs without one."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.picture_file import PICTURES
from sonarhw_sim.air import ROOM_TOLERANCE, Model

from sonarhw_cli import options
from sonarhw_cli.inputs import LogFile, at_height, note_assumed_heading, notes_beside, open_in_room, open_scan
from sonarhw_cli.outputs import checked_out, progress_of_fit, progress_of_share, text_output, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.explain import ScanComparison
    from sonarhw_sim.room.room import Room


# `sonarhw compare`: compare a log with the prediction of a room, reading by reading and as a whole.


Explained = Annotated[
    bool,
    typer.Option("--explain", help="With --json: add every reading, all its echoes and what would change it."),
]
ComparisonPicture = Annotated[
    Path | None,
    typer.Option(
        help="Draw the measured scan over the prediction, and shade ranges by their probability if the profile has "
        "a spread. With --find-missing, draw found walls and posts dashed.",
        metavar=options.PICTURE_FILE,
    ),
]
FindMissing = Annotated[
    bool,
    typer.Option(
        "--find-missing", help="Find changes of the room that explain misfits: new posts and walls, moved walls."
    ),
]
ChangedRoom = Annotated[
    Path | None, typer.Option(help="With --find-missing: write the changed room.", metavar="FILE.toml")
]
OtherLog = Annotated[
    Path | None,
    typer.Option("--with", help="Compare with another scan, by heading and without a room.", metavar="LOG"),
]
Sweep = Annotated[int | None, typer.Option(help="With --with or --with-sweep: only this sweep of LOG, from 1.", min=1)]
OtherSweep = Annotated[
    int | None,
    typer.Option(
        "--with-sweep", help="Only this sweep of the other scan, from 1; without --with: of LOG itself.", min=1
    ),
]
DifferenceFile = Annotated[
    str | None,
    typer.Option(help="Write the differences of two scans by heading, or - to standard output.", metavar="FILE.csv"),
]


def compare(
    log_file: LogFile,
    room_name: options.RoomOfLog = None,
    place: options.PlaceName = None,
    board: options.BoardOfLog = None,
    height: options.Height = None,
    receiver: options.ReceiverChoice = None,
    model: options.ModelChoice = Model.RAY_FOLLOWING,
    fit: options.FitOption = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
    explained: Explained = False,
    plot: ComparisonPicture = None,
    pings: options.PingsOfMedian = None,
    room_tolerance: options.RoomTolerance = None,
    missing: FindMissing = False,
    out: ChangedRoom = None,
    other: OtherLog = None,
    sweep: Sweep = None,
    other_sweep: OtherSweep = None,
    csv: DifferenceFile = None,
    force: options.Force = False,
) -> None:
    """Compare a log with its prediction. The class and path of every reading are printed, with its note from the
    notes file beside the log if it has one, then a summary.

    The log score and the calibration judge the predicted probabilities of the readings (`simulate --probability`).
    With --with, the log is compared with another scan instead.
    """
    if other is not None or other_sweep is not None:
        _compare_two(log_file, other or log_file, (sweep, other_sweep), as_json, csv, plot, force)
        return
    if out is not None:
        checked_out(out, (".toml",), force, log_file, room_name, board)
    if plot is not None:
        checked_out(plot, PICTURES, force, log_file, room_name, board, option="--plot")
    tolerance = ROOM_TOLERANCE if room_tolerance is None else room_tolerance
    settings = {"model": model, "receiver": receiver, "pings": pings or 1, "room_tolerance": tolerance}
    comparison = compare_log(log_file, room_name, place, board, fit, height, **settings)
    changed = _changed_room(comparison, as_json, out, force) if missing else None
    if plot is not None:
        write_figure(plot, comparison.draw(changed), force)
    if missing:
        return
    notes = notes_beside(log_file, comparison.readings).texts
    options.print_result(
        as_json, lambda: comparison.figures(notes, explained=explained), lambda: comparison.lines(notes)
    )
    for doubt in comparison.doubts:
        options.warn(doubt)


def compare_log(
    log_file: Path,
    room_name: str | None,
    place: str | None,
    board: str | None = None,
    fit: str = "",
    height: float | None = None,
    **settings: Any,
) -> "ScanComparison":
    """Compare a log with its prediction. Raises InputError.

    Room, place and board that are not given are taken from the log. `height` is that of a place X,Y,DEG.
    """
    if "heading" not in fit:
        note_assumed_heading(place)
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare import one_call

    where = at_height(place, height, room)
    with progress_of_fit(fit) as tick:
        return one_call.compare(scan, room, where, chosen, fit=fit, progress=tick, warn=options.warn, **settings)


def _changed_room(comparison: "ScanComparison", as_json: bool, out: Path | None, force: bool) -> "Room":
    """Print the causes of the misfits of a comparison, and write the changed room to the file `out`; return it."""
    from sonarhw_compare.one_call import find_missing

    with progress_of_share() as show:
        causes = find_missing(comparison, lambda share: show(share, "searching"))
    if out is not None and causes.causes:
        write_text(out, causes.room.text, force)
    options.print_result(as_json, lambda: asdict(comparison.summary()) | causes.figures(), causes.lines)
    if out is not None and not causes.causes:
        options.warn(f"{out}: not written, because the room is unchanged")
    return causes.room


def _compare_two(
    first_file: Path,
    second_file: Path,
    sweeps: tuple[int | None, int | None],
    as_json: bool,
    csv: str | None,
    plot: Path | None,
    force: bool,
) -> None:
    """Print the differences of two scans by heading. `sweeps` selects one sweep of each, by default all of them."""
    if plot is not None:
        checked_out(plot, PICTURES, force, first_file, second_file, option="--plot")
    if csv is not None:
        checked_out(csv, (".csv", options.STDOUT), force, first_file, second_file, option="--csv")
    first = open_scan(first_file)
    second = first if second_file == first_file else open_scan(second_file)
    from sonarhw_compare.one_call import compare_scans
    from sonarhw_compare.two_scans import CSV_HEADER

    difference = compare_scans(first, second, sweeps=sweeps, warn=options.warn)
    if plot is not None:
        from sonarhw_compare.drawings import draw_difference

        write_figure(plot, draw_difference(difference), force)
    if csv is not None:
        with text_output(csv, force) as file:
            options.write_rows(file, CSV_HEADER, (row.cells for row in difference.rows))
    if as_json or csv != options.STDOUT:
        options.print_result(as_json, difference.figures, difference.lines)


def report(
    log_file: LogFile,
    out: Annotated[Path, typer.Option("--out", help="File to write.", metavar="FILE.html")],
    room_name: options.RoomOfLog = None,
    place: options.PlaceName = None,
    board: options.BoardOfLog = None,
    receiver: options.ReceiverChoice = None,
    fit: options.FitOption = "",
    force: options.Force = False,
) -> None:
    """Write one HTML file about a scan. It has pictures, a summary, notes, every reading and the settings."""
    checked_out(out, (".html",), force, log_file, room_name, board)
    if "heading" not in fit:
        note_assumed_heading(place)
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare import one_call
    from sonarhw_compare.report import report_html

    with progress_of_fit(fit) as tick:
        made = one_call.report(scan, room, place, chosen, fit=fit, receiver=receiver, progress=tick, warn=options.warn)
    write_text(out, report_html(made), force)
