"""`sonarhw compare`: compare a log with the prediction of a room, reading by reading and as a whole."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, BinaryIO

import typer
from sonarhw_compare.headings import heading_text
from sonarhw_sim.choices import Model, Receiver

from sonarhw.errors import InputError
from sonarhw_cli.console.log_input import LogFile, open_in_room, recorded_place
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import (
    BoardOfLog,
    Force,
    ModelChoice,
    PlaceName,
    ReceiverChoice,
    RoomOfLog,
    checked_out,
    chosen_place,
    chosen_receiver,
)
from sonarhw_cli.console.output import atomic_file
from sonarhw_cli.console.progress import progress_of_share

if TYPE_CHECKING:
    from sonarhw_compare.matching.match import Comparison, Summary
    from sonarhw_compare.matching.regions import Region


def compare(
    log_file: LogFile,
    room_file: RoomOfLog = None,
    place: PlaceName = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    model: ModelChoice = Model.RAY_FOLLOWING,
    fit: Annotated[
        str,
        typer.Option(
            help="Quantities to fit before the comparison; the position within 3 cm.", metavar="heading,offset,position"
        ),
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
    explained: Annotated[
        bool,
        typer.Option("--explain", help="With --json: add every reading, all its echoes and what would change it."),
    ] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the measured scan over the prediction.", metavar="FILE.png")
    ] = None,
    force: Force = False,
) -> None:
    """Compare a log with its prediction. The class and path of every reading are printed, then a summary."""
    if explained and not as_json:
        raise InputError("--explain: needs --json; without both, every reading is explained in a sentence")
    if plot is not None:
        checked_out(plot, (".png",), force, log_file, room_file, board, option="--plot")
    comparison = compare_log(log_file, room_file, place, board, model, fit, receiver)
    if plot is not None:
        with atomic_file(plot, "--plot") as file:
            draw_comparison(comparison, file)
    if as_json:
        typer.echo(json.dumps(_figures(comparison, explained), indent=2))
    else:
        _print(comparison)


def compare_log(
    log_file: Path,
    room_file: Path | None = None,
    place: str | None = None,
    board: str | None = None,
    model: Model = Model.RAY_FOLLOWING,
    fit: str = "",
    receiver: Receiver | None = None,
) -> "Comparison":
    """Compare a log with its prediction.

    Room, place and board that are not given are taken from the log. Raises InputError if it does not contain them.
    """
    from sonarhw_compare.fit.plain_fit import fit_scan
    from sonarhw_compare.matching.match import compare_readings
    from sonarhw_sim.predict.prediction import PredictionOptions

    log, room, chosen = open_in_room(log_file, room_file, board)
    here = chosen_place(room, place if place is not None else recorded_place(log.metadata, room))
    if not log.readings:
        raise InputError(f"{log_file}: contains no readings; nothing to compare")
    options = PredictionOptions(receiver=chosen_receiver(receiver, chosen))
    heading, offset = chosen.heading_at(0.0, here.heading), 0.0
    if fit:
        free = frozenset(name.strip() for name in fit.split(","))
        with progress_of_share() as show:
            found = fit_scan(
                log.readings,
                room,
                here,
                chosen,
                free,
                model=model,
                options=options,
                tick=lambda share: show(share, "fitting"),
            )
        heading, offset, here = found.heading, found.offset, found.place
    return compare_readings(
        log.readings, room, here, chosen, heading=heading, offset=offset, model=model, options=options
    )


def draw_comparison(comparison: "Comparison", out: BinaryIO) -> None:
    """Draw the measured scan over the prediction in the plan of the room, as PNG."""
    from sonarhw_compare.pictures.overlay_picture import draw_plan

    measured = [(row.heading, row.measured) for row in comparison.rows if row.measured is not None]
    draw_plan(comparison.prediction, measured).savefig(out, format="png")


def _figures(comparison: "Comparison", explained: bool) -> dict[str, object]:
    from sonarhw_compare.explain.details import details

    return asdict(comparison.summary()) | (details(comparison) if explained else {})


def _print(comparison: "Comparison") -> None:
    from sonarhw_compare.explain.sentences import explain_reading

    for row in comparison.rows:
        typer.echo(f"{row.kind.replace('_', ' '):11}  {explain_reading(comparison, row.index)}")
    typer.echo()
    for line in summary_lines(comparison.summary()):
        typer.echo(line)
    for line in _more_lines(comparison):
        typer.echo(line)


def _more_lines(comparison: "Comparison") -> list[str]:
    """Return lines about later echoes, the bias of the echoes, and the regions of constant depth."""
    from sonarhw_compare.matching.assign import echo_statistics

    lines, echoes = [], echo_statistics(comparison)
    if echoes.explained is not None and echoes.echoes > comparison.summary().n_echo:
        lines.append(f"of all {echoes.echoes} echoes, including later ones, {echoes.explained:.1%} are predicted")
    if echoes.bias_m is not None and echoes.spread_m is not None:
        lines.append(
            f"measured minus predicted echo: {round(echoes.bias_m * 1000, 1) + 0.0:+.1f} mm (median; "
            f"spread {echoes.spread_m * 1000:.1f} mm)"
        )
    return [*lines, *region_lines(comparison)]


def region_lines(comparison: "Comparison") -> list[str]:
    """Return the counts of regions of constant depth in both scans, then a line for each region, counter-clockwise."""
    from sonarhw_compare.explain.region_words import path_suffix, region_counts
    from sonarhw_compare.matching.region_match import compare_regions

    found = compare_regions(comparison)
    lines = [f"regions of constant depth: {region_counts(found)}"]
    for measured, predicted in found.by_bearing():
        path = "" if predicted is None else path_suffix(comparison, predicted)
        lines.append(f"  {_pair(measured, predicted)}{path}")
    return lines


def _pair(measured: "Region | None", predicted: "Region | None") -> str:
    both = (("measured", measured), ("predicted", predicted))
    found = [f"{scan} {_depth(region)}" for scan, region in both if region is not None]
    return ", ".join(found + [f"not {scan}" for scan, region in both if region is None])


def _depth(region: "Region") -> str:
    return f"{region.range:.3f} m at {heading_text(region.bearing, 0)} over {math.degrees(region.width):.0f}°"


def summary_lines(summary: "Summary") -> list[str]:
    """Return the summary of a comparison as lines of text."""
    classes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in summary.classes.items() if count)
    lines = [f"{counted(summary.n, 'reading')}, {summary.n_echo} with an echo: {classes}"]
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
        f"sensor at {summary.x_m:.4f}, {summary.y_m:.4f} m, turntable step 0 at {heading}, "
        f"range offset {summary.offset_m * 1000:+z.0f} mm"
    )
    return lines
