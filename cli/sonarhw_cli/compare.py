"""`sonarhw compare`, also of two logs and with `--find-missing`, and `sonarhw report`."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.headings import heading_text, in_degrees
from sonarhw_compare.picture_file import PICTURES
from sonarhw_sim.air import ROOM_TOLERANCE, Model, Receiver

from sonarhw.errors import InputError, counted
from sonarhw_cli.inputs import LogFile, notes_beside, open_in_room, open_scan, print_place
from sonarhw_cli.options import (
    PICTURE_FILE,
    BoardOfLog,
    FitOption,
    Force,
    ModelChoice,
    PingsOfMedian,
    PlaceName,
    ReceiverChoice,
    RoomOfLog,
    RoomTolerance,
    print_json,
    print_line,
    warn,
    write_rows,
)
from sonarhw_cli.outputs import checked_out, progress_of_fit, progress_of_share, text_output, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.fit.starting import Fit
    from sonarhw_compare.match import Comparison, Summary
    from sonarhw_compare.pictures import RangeShading
    from sonarhw_compare.regions import Region
    from sonarhw_compare.rooms.causes import FoundCauses
    from sonarhw_compare.scans import GivenScan, PlacedNotes
    from sonarhw_compare.score import ProbabilityScore
    from sonarhw_compare.two_scans import HeadingDifference, HeadingSeries, ScanDifference
    from sonarhw_sim.room.room import Place, Room

# `sonarhw compare A.mcap --with B.mcap`: two scans by heading, without a room.


_HEADER = "heading_deg,first_m,second_m,difference_m,limit_m,change,first_pings,first_echoes,second_pings,second_echoes"
_APART = 0.02  # m, between places that count as one


def compare_two(
    first_file: Path,
    second_file: Path,
    sweeps: tuple[int | None, int | None],
    *,
    as_json: bool,
    csv: str | None,
    plot: Path | None,
    force: bool,
) -> None:
    """Print the differences of two scans by heading. `sweeps` selects one sweep of each, by default all of them."""
    from sonarhw_compare.drawings import draw_difference
    from sonarhw_compare.two_scans import scan_difference

    if plot is not None:
        checked_out(plot, PICTURES, force, first_file, second_file, option="--plot")
    if csv is not None:
        checked_out(csv, (".csv", "-"), force, first_file, second_file, option="--csv")
    first = open_scan(first_file)
    second = first if second_file == first_file else open_scan(second_file)
    difference = scan_difference(*_series(first, second, sweeps))
    names = _names(first_file, second_file, sweeps)
    if plot is not None:
        write_figure(plot, draw_difference(difference, names), force)
    if csv is not None:
        with text_output(csv, force) as out:
            write_rows(out, _HEADER, map(_row, difference.rows))
    if as_json:
        print_json(_figures_of_two(difference))
    elif csv != "-":
        for line in _lines(difference, names):
            print_line(line)


def _series(
    first: "GivenScan", second: "GivenScan", sweeps: tuple[int | None, int | None]
) -> "tuple[HeadingSeries, HeadingSeries]":
    """Return both scans by heading in the room, or by turntable angle if a log contains no place."""
    rooms = [scan.recorded_room for scan in (first, second)]
    names = [room.name for room in rooms if room is not None]
    if len(set(names)) > 1:
        warn(f"the logs contain different rooms, {names[0]!r} and {names[1]!r}; differences show this, too")
    places = [_place(scan, room) for scan, room in zip((first, second), rooms, strict=True)]
    if places[0] is not None and places[1] is not None:
        apart = math.dist(places[0].position, places[1].position)
        if apart > _APART:
            warn(f"the places of the scans are {apart:.2f} m apart; differences by heading show this, too")
        headings = [place.heading for place in places if place is not None]
    else:
        headings = [0.0, 0.0]
    one, other = (_series_of(*given) for given in zip((first, second), headings, sweeps, strict=True))
    return one, other


def _place(scan: "GivenScan", room: "Room | None") -> "Place | None":
    if room is None:
        return None
    wanted = scan.recorded_place(room)
    return None if wanted is None else room.place(wanted)


def _series_of(scan: "GivenScan", heading: float, sweep: int | None) -> "HeadingSeries":
    from sonarhw_compare.two_scans import heading_series

    readings = [reading for reading in scan.readings if sweep is None or reading.sweep == sweep - 1]
    if not readings:
        last = max(reading.sweep for reading in scan.readings) + 1
        raise InputError(f"{scan.where}: has no sweep {sweep}; its sweeps: 1 to {last}")
    return heading_series(readings, scan.board(), heading)


def _names(first: Path, second: Path, sweeps: tuple[int | None, int | None]) -> tuple[str, str]:
    """Return the names of the scans for lines and legends."""
    same_name = first != second and first.name == second.name
    one, other = (
        f"{file if same_name else file.name}{'' if sweep is None else f', sweep {sweep}'}"
        for file, sweep in zip((first, second), sweeps, strict=True)
    )
    return one, other


def _row(row: "HeadingDifference") -> list[float | int | str | None]:
    first, second = row.first, row.second
    values = [in_degrees(row.heading), first.median, second.median, row.difference, row.limit, row.change.value]
    return [*values, first.pings, first.heard, second.pings, second.heard]


def _figures_of_two(difference: "ScanDifference") -> dict[str, Any]:
    return {
        "headings": len(difference.rows),
        "unpaired": list(difference.unpaired),
        "median_difference_m": difference.median,
        "noise_m": list(difference.noises),
        "changes": {change.name.lower(): count for change, count in difference.changes.items()},
        "stretches": [
            {
                "change": run[0].change.name.lower(),
                "from_deg": in_degrees(run[0].heading),
                "to_deg": in_degrees(run[-1].heading),
                "headings": len(run),
                "median_difference_m": _median_of(run),
            }
            for run in difference.stretches
        ],
    }


def _median_of(run: "tuple[HeadingDifference, ...]") -> float | None:
    apart = [row.difference for row in run if row.difference is not None]
    return median(apart) if apart else None


def _lines(difference: "ScanDifference", names: tuple[str, str]) -> list[str]:
    found = ", ".join(f"{count} {change.value}" for change, count in difference.changes.items() if count)
    lines = [
        f"first: {names[0]}; second: {names[1]}",
        f"{counted(len(difference.rows), 'heading')} in both: {found}",
    ]
    if difference.median is not None:
        first, second = (f"{noise * 1000:.1f}" for noise in difference.noises)
        lines.append(
            f"second minus first: {difference.median * 1000:+z.1f} mm (median); "
            f"noise of a ping: {first} and {second} mm (standard deviation)"
        )
    for which, lonely in zip(("first", "second"), difference.unpaired, strict=True):
        if lonely:
            lines.append(f"{counted(lonely, 'heading')} of the {which} scan not compared: the other has none near")
    return [*lines, *(_stretch_line(run) for run in difference.stretches)]


def _stretch_line(run: "tuple[HeadingDifference, ...]") -> str:
    where = heading_text(run[0].heading)
    if len(run) > 1:
        where += f" to {heading_text(run[-1].heading)}"
    by = _median_of(run)
    amount = "" if by is None else f" by {abs(by) * 100:.1f} cm{' (median)' if len(run) > 1 else ''}"
    scans = (
        f"{name} {_span([one.median for one in readings if one.median is not None])}"
        for name, readings in (("first", [row.first for row in run]), ("second", [row.second for row in run]))
        if any(one.median is not None for one in readings)
    )
    return f"  {where}: {counted(len(run), 'heading')} {run[0].change.value}{amount}: {', '.join(scans)}"


def _span(ranges: list[float]) -> str:
    """Return the smallest and the largest range of a scan, or both as one if they are equal."""
    least, most = f"{min(ranges):.3f}", f"{max(ranges):.3f}"
    return f"{least} m" if least == most else f"{least} to {most} m"


# `sonarhw compare LOG --find-missing`: the changes of the room that explain misfits.


def find_missing(
    comparison: "Comparison", receiver: "Receiver | None", *, as_json: bool, out: Path | None, force: bool
) -> "Room":
    """Print the causes of the misfits of a comparison, and write the changed room to the file `out`; return it."""
    found = _found(comparison, receiver)
    if out is not None and found.causes:
        write_text(out, found.room.text, force)
    if as_json:
        print_json(asdict(comparison.summary()) | _figures_of_causes(found))
    else:
        _print_causes(found)
    if out is not None and not found.causes:
        warn(f"{out}: not written, because the room is unchanged")
    return found.room


def _found(comparison: "Comparison", receiver: "Receiver | None") -> "FoundCauses":
    from sonarhw_compare.rooms.causes import find_causes

    prediction = comparison.prediction
    board = prediction.board
    # the comparison adds its offset to measured ranges; the place of a room file does not contain the board's zero
    board = replace(board, range_offset=board.range_offset - comparison.offset, receiver=receiver or board.receiver)
    place = replace(prediction.place, heading=comparison.heading - board.heading_at(0.0, 0.0))
    readings = [row.reading for row in comparison.rows]
    with progress_of_share() as show:
        return find_causes(readings, prediction.room, place, board, lambda share: show(share, "searching"))


def _print_causes(found: "FoundCauses") -> None:
    from sonarhw_compare.rooms.causes import cause_text, explained_text, left_text

    if not found.causes:
        print_line("no change of the room explains misfits")
    for number, cause in enumerate(found.causes, 1):
        print_line(f"{number}. {cause_text(cause)} (log-likelihood +{cause.gain:.0f})")
    print_line(explained_text(found))
    print_line(left_text(found))


def _figures_of_causes(found: "FoundCauses") -> dict[str, Any]:
    from sonarhw_compare.rooms.causes import cause_text

    after = found.after.summary()
    return {
        "causes": [
            {
                "text": cause_text(cause),
                "kind": type(cause.change).__name__,
                "change": vars(cause.change),
                "log_likelihood": cause.gain,
                "readings": list(cause.readings),
                "classes": {kind.value: count for kind, count in cause.kinds},
                "sectors_deg": [[in_degrees(first), in_degrees(last)] for first, last in cause.sectors],
            }
            for cause in found.causes
        ],
        "after": {"within_5cm": after.within_5cm, "explained": after.explained, "misfits": len(found.left)},
    }


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
        metavar=PICTURE_FILE,
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
    room_name: RoomOfLog = None,
    place: PlaceName = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    model: ModelChoice = Model.RAY_FOLLOWING,
    fit: FitOption = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
    explained: Explained = False,
    plot: ComparisonPicture = None,
    pings: PingsOfMedian = None,
    room_tolerance: RoomTolerance = None,
    missing: FindMissing = False,
    out: ChangedRoom = None,
    other: OtherLog = None,
    sweep: Sweep = None,
    other_sweep: OtherSweep = None,
    csv: DifferenceFile = None,
    force: Force = False,
) -> None:
    """Compare a log with its prediction. The class and path of every reading are printed, with its note from the
    notes file beside the log if it has one, then a summary.

    The log score and the calibration judge the predicted probabilities of the readings (`simulate --probability`).
    With --with, the log is compared with another scan instead.
    """
    if other is not None or other_sweep is not None:
        of_prediction = {
            "--room": room_name, "--place": place, "--board": board, "--receiver": receiver,
            "--model": model is not Model.RAY_FOLLOWING, "--fit": fit, "--explain": explained, "--pings": pings,
            "--room-tolerance": room_tolerance, "--find-missing": missing, "--out": out,
        }  # fmt: skip
        _check_not_given(of_prediction, "not used with --with, which compares two scans without a prediction")
        if other is None and sweep is None:
            raise InputError("--with-sweep: without --with, give the other sweep of the log with --sweep")
        compare_two(log_file, other or log_file, (sweep, other_sweep), as_json=as_json, csv=csv, plot=plot, force=force)
        return
    _check_not_given({"--sweep": sweep, "--csv": csv}, "needs --with LOG or --with-sweep N")
    if not missing:
        _check_not_given({"--out": out}, "needs --find-missing; --plot writes a picture")
    if not as_json:
        _check_not_given({"--explain": explained}, "needs --json; without both, a sentence explains every reading")
    if out is not None:
        checked_out(out, (".toml",), force, log_file, room_name, board)
    if plot is not None:
        checked_out(plot, PICTURES, force, log_file, room_name, board, option="--plot")
    comparison, found = compare_log(log_file, room_name, place, board, model, fit, receiver)
    tolerance = ROOM_TOLERANCE if room_tolerance is None else room_tolerance
    probabilities = _Probabilities(model, receiver, pings or 1, tolerance)
    changed = find_missing(comparison, receiver, as_json=as_json, out=out, force=force) if missing else None
    if plot is not None:
        from sonarhw_compare.drawings import draw_comparison

        write_figure(plot, draw_comparison(comparison, probabilities.shading(comparison), changed), force)
    if missing:
        return
    score = probabilities.score(comparison)
    notes = notes_beside(log_file, [row.reading for row in comparison.rows])
    if as_json:
        print_json(_figures(comparison, found, explained, notes) | asdict(score))
    else:
        _print(comparison, found, score, notes)
    for doubt in () if found is None else found.doubts:
        warn(doubt)


def _check_not_given(options: Mapping[str, object], reason: str) -> None:
    """Raise InputError with the reason if one of the options has a value."""
    for option, value in options.items():
        if value is not None and value is not False and value != "":
            raise InputError(f"{option}: {reason}")


def compare_log(
    log_file: Path,
    room_name: str | None,
    place: str | None,
    board: str | None = None,
    model: Model = Model.RAY_FOLLOWING,
    fit: str = "",
    receiver: Receiver | None = None,
) -> "tuple[Comparison, Fit | None]":
    """Compare a log with its prediction. Return the fit too, if quantities are fitted.

    Room, place and board that are not given are taken from the log. Raises InputError if it does not contain them.
    """
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare.one_call import fitted_comparison
    from sonarhw_sim.predict.prediction import PredictionOptions

    here = scan.place(room, place)
    print_place(room, here)
    with progress_of_fit(fit) as tick:
        comparison, found = fitted_comparison(
            scan, room, here, chosen, fit, model=model, options=PredictionOptions(receiver=receiver), tick=tick
        )
    warn_of_few_explained(log_file, comparison)
    return comparison, found


@dataclass(frozen=True)
class _Probabilities:
    """The options from which the probabilities of the readings are predicted."""

    model: Model
    receiver: Receiver | None
    pings: int
    room_tolerance: float  # m

    def score(self, comparison: "Comparison") -> "ProbabilityScore":
        """Return how well the probabilities predict the readings."""
        from sonarhw_compare.score import score_comparison
        from sonarhw_sim.predict.prediction import PredictionOptions

        options = PredictionOptions(receiver=self.receiver)
        return score_comparison(
            comparison, options, model=self.model, pings=self.pings, room_tolerance=self.room_tolerance
        )

    def shading(self, comparison: "Comparison") -> "RangeShading | None":
        """Return the shading of the ranges; None without a spread, and for models that find no fainter paths."""
        from sonarhw_compare.pictures import shading_around
        from sonarhw_sim.predict.prediction import PredictionOptions

        if self.model is not Model.RAY_FOLLOWING or not comparison.prediction.board.states_spread:
            return None
        options = PredictionOptions(receiver=self.receiver)
        return shading_around(comparison.prediction, options, pings=self.pings, room_tolerance=self.room_tolerance)


def warn_of_few_explained(log_file: Path, comparison: "Comparison") -> None:
    """Warn if the prediction explains few echoes, as with a wrong room or place."""
    from sonarhw_compare.match import few_explained

    summary = comparison.summary()
    for doubt in few_explained(str(log_file), summary.within_5cm, summary.n_echo):
        warn(doubt)


def _figures(comparison: "Comparison", found: "Fit | None", explained: bool, notes: "PlacedNotes") -> dict[str, object]:
    from sonarhw_compare.explain import details

    fitted = None
    if found is not None:
        fitted = {"free": list(found.free), "search": found.search, "at_edge": list(found.at_edge)}
    return asdict(comparison.summary()) | {"fit": fitted} | (details(comparison, notes.texts) if explained else {})


def _print(comparison: "Comparison", found: "Fit | None", score: "ProbabilityScore", notes: "PlacedNotes") -> None:
    from sonarhw_compare.explain import explain_reading

    for row in comparison.rows:
        print_line(f"{row.kind.label:11}  {explain_reading(comparison, row.index)}")
        if row.index in notes.texts:
            print_line(f"{'':11}  note: {notes.texts[row.index]}")
    print_line()
    for line in summary_lines(comparison.summary()):
        print_line(line)
    for line in _score_lines(score):
        print_line(line)
    for line in () if found is None else found.lines():
        print_line(line)
    for line in _more_lines(comparison):
        print_line(line)


def _more_lines(comparison: "Comparison") -> list[str]:
    """Return lines about later echoes, the bias of the echoes, and the regions of constant depth."""
    from sonarhw_compare.score import echo_statistics

    lines, echoes = [], echo_statistics(comparison)
    if echoes.explained is not None and echoes.echoes > comparison.summary().n_echo:
        lines.append(f"of all {echoes.echoes} echoes, including later ones, {echoes.explained:.1%} are predicted")
    if echoes.bias_m is not None and echoes.spread_m is not None:
        lines.append(
            f"scan minus predicted echo: {round(echoes.bias_m * 1000, 1) + 0.0:+.1f} mm (median; "
            f"spread {echoes.spread_m * 1000:.1f} mm)"
        )
    return [*lines, *region_lines(comparison)]


def _score_lines(score: "ProbabilityScore") -> list[str]:
    from sonarhw_compare.score import calibration_text

    if score.log_score is None:
        return []
    median = f", a reading is the median of {score.pings} pings" if score.pings > 1 else ""
    return [
        f"log score {score.log_score:.2f} (mean logarithm of the probability of a reading{median})",
        f"probability of the most probable readings, stated and observed: {calibration_text(score.calibration)}",
    ]


def region_lines(comparison: "Comparison") -> list[str]:
    """Return the counts of regions of constant depth in both scans, then a line for each region, counter-clockwise."""
    from sonarhw_compare.explain import path_suffix, region_counts
    from sonarhw_compare.score import compare_regions

    found = compare_regions(comparison)
    lines = [f"regions of constant depth: {region_counts(found)}"]
    for measured, predicted in found.by_bearing():
        path = "" if predicted is None else path_suffix(comparison, predicted)
        lines.append(f"  {_pair(measured, predicted)}{path}")
    return lines


def _pair(measured: "Region | None", predicted: "Region | None") -> str:
    in_scan = "not in the scan" if measured is None else f"scan {_depth(measured)}"
    return f"{in_scan}, {'not predicted' if predicted is None else f'predicted {_depth(predicted)}'}"


def _depth(region: "Region") -> str:
    return f"{region.range:.3f} m at {heading_text(region.bearing, 0)} over {math.degrees(region.width):.0f}°"


def summary_lines(summary: "Summary") -> list[str]:
    """Return the summary of a comparison as lines of text."""
    from sonarhw.readings import Origin

    classes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in summary.classes.items() if count)
    what = "reading" if summary.origin == Origin.MEASURED else f"{summary.origin} reading"
    own_body = summary.classes["own_body"]
    apart = f" of the room and {own_body} with one of the own body" if own_body else ""
    lines = [f"{counted(summary.n, what)}, {summary.n_echo} with an echo{apart}: {classes}"]
    if summary.within_5cm is not None and summary.explained is not None:
        lines.append(
            f"within 5 cm of the prediction: {summary.within_5cm:.1%} of the echoes; "
            f"of any predicted echo: {summary.explained:.1%}"
        )
    if summary.median_abs_error_m is not None:
        lines.append(f"median error {summary.median_abs_error_m * 1000:.1f} mm")
    if summary.no_echo_agreement is not None and summary.no_echo_roc_area is not None:
        lines.append(
            f"detection of silence: {summary.no_echo_agreement:.1%} (balanced accuracy); "
            f"area under the ROC curve of predicted levels {summary.no_echo_roc_area:.2f}"
        )
    heading = heading_text(math.radians(summary.heading_deg))
    lines.append(
        f"sensor at {summary.x_m:z.4f}, {summary.y_m:z.4f} m, turntable step 0 at {heading}, "
        f"range offset {summary.offset_m * 1000:+z.0f} mm"
    )
    return lines


# `sonarhw report`: write one HTML file about a scan: room, scan, comparison, every reading, settings.


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
