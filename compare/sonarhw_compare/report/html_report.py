"""The HTML report about a scan: one file that contains all pictures and needs neither the log nor the program."""

import math
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from statistics import median

from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room

from sonarhw.log import Log, LogMetadata
from sonarhw.readings import Origin, Reading
from sonarhw_compare.explain.sentences import explain_reading
from sonarhw_compare.fit.plain_fit import Fit
from sonarhw_compare.headings import heading_text, in_degrees
from sonarhw_compare.imports.given_scan import GivenScan
from sonarhw_compare.matching.few_explained import few_explained
from sonarhw_compare.matching.match import Comparison, Kind, Summary, compare_readings
from sonarhw_compare.matching.probability_score import ProbabilityScore, calibration_text, score_comparison
from sonarhw_compare.report.html_parts import (
    Facts,
    escaped,
    facts_table,
    html_page,
    metres,
    picture,
    table_head,
    table_row,
)
from sonarhw_compare.report.report_pictures import bscan_png, calibration_svg, plan_svg, ranges_svg
from sonarhw_compare.report.report_regions import millimetres, regions_table

MOST_READINGS = 3600  # only the newest are listed, so that the page stays readable


@dataclass(frozen=True)
class Report:
    """The content of a report."""

    name: str  # of the log
    comparison: Comparison
    log: Log | None = None
    link: Facts = ()  # statistics of the link, if known
    fit: Fit | None = None  # how pose and offset were fitted
    left_out: int = 0  # number of older readings that are not listed
    score: ProbabilityScore | None = None  # of the predicted probabilities
    notes: Sequence[tuple[int, Reading, str]] = ()  # place of the reading in the scan from 0, the reading, the note


def report_of(
    scan: GivenScan,
    room: Room,
    place: Place,
    board: Board,
    options: PredictionOptions,
    *,
    fit: Fit | None = None,
    link: Facts = (),
    notes: Mapping[int, str] | None = None,
) -> Report:
    """Return the report on a scan at a place, or at that of a fit; of more than 3600 readings, on the newest.

    `notes`: by the place of their reading, from 0; those on readings that are not listed are part of the report, too.
    """
    readings, log = scan.readings, scan.log
    comparison = compare_readings(
        readings[-MOST_READINGS:],
        room,
        board.faced(place) if fit is None else fit.place,
        board,
        options,
        offset=0.0 if fit is None else fit.offset,
    )
    comparison = replace(comparison, origin=scan.origin)
    pinned = [(place, readings[place], text) for place, text in sorted((notes or {}).items())]
    left_out = max(0, len(readings) - MOST_READINGS)
    return Report(scan.where, comparison, log, link, fit, left_out, score_comparison(comparison, options), pinned)


def report_html(report: Report) -> str:
    """Return the page. Raises NotALog if a trace can no longer be read."""
    return html_page(_title(report), _body(report))


def _title(report: Report) -> str:
    prediction = report.comparison.prediction
    return f"{prediction.room.name}, place {prediction.place.name}"


def _body(report: Report) -> Iterator[str]:
    comparison, log = report.comparison, report.log
    summary = comparison.summary()
    yield f"<h1>{escaped(_title(report))}</h1>"
    made = "recorded" if comparison.origin is Origin.MEASURED else f"{comparison.origin} readings"
    when = f", {made} {_date(log.metadata.started)}" if log and log.metadata.started else ""
    yield f"<p>{escaped(report.name)}{when}</p>"
    yield f'<p class="lead">{escape(_lead(summary))}</p>'
    for doubt in few_explained(report.name, summary.within_5cm, summary.n_echo):
        yield f"<p><strong>Warning:</strong> {escaped(doubt)}.</p>"
    yield "<h2>The scan in the room</h2>"
    both = f"{comparison.origin} and predicted"
    yield picture(".svg", plan_svg(comparison), f"Plan of the room with {both} points")
    yield "<h2>Range against heading</h2>"
    yield picture(".svg", ranges_svg(comparison), f"Ranges, {both}, and their residuals over heading")
    bscan = bscan_png(comparison)
    if bscan is not None:
        yield "<h2>B-scan</h2>"
        yield picture(".png", bscan, f"Traces side by side, {both}, heading by range")
    yield from _notes(report)
    yield "<h2>Figures</h2>"
    yield facts_table(_figures(summary))
    yield from _probabilities(report)
    yield "<h2>Regions of constant depth</h2>"
    yield from regions_table(comparison)
    yield from _settings(report)
    yield from _readings(report)


def _lead(summary: Summary) -> str:
    if summary.within_5cm is None:
        return f"No echo in {summary.n} readings."
    median = "" if summary.median_abs_error_m is None else f"; median error {summary.median_abs_error_m * 1000:.1f} mm"
    return f"{summary.within_5cm:.0%} of {summary.n_echo} echoes lie within 5 cm of the prediction{median}."


def _figures(summary: Summary) -> Facts:
    facts = [("readings", str(summary.n)), ("with an echo", str(summary.n_echo))]
    facts += [(kind.label, str(summary.classes[kind.value])) for kind in Kind]
    for name, share in (
        ("within 5 cm of the prediction", summary.within_5cm),
        ("within 5 cm of some predicted echo", summary.explained),
        ("separation of silence and echoes (balanced accuracy)", summary.no_echo_agreement),
    ):
        if share is not None:
            facts.append((name, f"{share:.1%}"))
    if summary.no_echo_roc_area is not None:
        facts.append(("area under the ROC curve of predicted levels", f"{summary.no_echo_roc_area:.2f}"))
    if summary.median_abs_error_m is not None:
        facts.append(("median error", f"{summary.median_abs_error_m * 1000:.1f} mm"))
    facts.append(("turntable step 0 at", heading_text(math.radians(summary.heading_deg))))
    if summary.offset_m:
        facts.append(("fitted range offset", f"{summary.offset_m * 1000:+z.1f} mm"))
    return facts


def _probabilities(report: Report) -> Iterator[str]:
    """Yield log score and calibration, and the calibration curve if the board has a spread of its threshold."""
    score, board = report.score, report.comparison.prediction.board
    if score is None or score.log_score is None:
        return
    yield "<h2>Predicted probabilities</h2>"
    yield facts_table(
        (
            ("log score", f"{score.log_score:.2f} (mean logarithm of the probability of a reading; 0 is best)"),
            ("most probable readings, stated and observed", calibration_text(score.calibration)),
        )
    )
    if board.threshold_sd_db:
        yield picture(".svg", calibration_svg(score.calibration), "Observed shares over stated probabilities")


def _settings(report: Report) -> Iterator[str]:
    prediction = report.comparison.prediction
    room, place, board = prediction.room, prediction.place, prediction.board
    where = [("position", f"x {place.position[0]:g} m, y {place.position[1]:g} m")]
    if place.height is not None:
        where.append(("height", f"{place.height:g} m"))
    air = room.air
    weather = [
        ("temperature", f"{air.temperature_c:g} °C"),
        ("relative humidity", f"{air.relative_humidity:.0%}"),
        ("pressure", f"{air.pressure_kpa:g} kPa"),
        ("speed of sound", f"{air.speed_of_sound:.2f} m/s"),
    ]
    reception = [("receiver", prediction.receiver.value), ("sound that comes back to the unit", prediction.unit.value)]
    versions = [("sonarhw", version("sonarhw")), ("Python", platform.python_version()), ("NumPy", version("numpy"))]
    for title, facts in (
        ("Place", where),
        ("Fit", _fit(report)),
        ("Air of the prediction", weather),
        ("Air of the ranges", _air_of_ranges(report)),
        ("Board", _board(board)),
        ("Prediction", reception),
        ("Log", _log(report)),
        ("Link", report.link),
        ("Made with", versions),
    ):
        if facts:
            yield f"<h2>{title}</h2>"
            yield facts_table(facts)
    for name, text in (("room file", room.text), ("board profile", board.text)):
        if text:
            yield f"<details><summary>The {name}</summary><pre>{escape(text)}</pre></details>"


def _fit(report: Report) -> Facts:
    if report.fit is None:
        return ()
    facts = [("grid", report.fit.search), ("chosen", "the values with the most readings within 5 cm")]
    return [*facts, *(("warning", doubt) for doubt in report.fit.doubts)]


def _air_of_ranges(report: Report) -> Facts:
    """Return the speed of sound of the ranges, the temperature of air with this speed, and the thermometer's."""
    readings = [row.reading for row in report.comparison.rows]
    speeds = [reading.speed_of_sound for reading in readings if reading.speed_of_sound > 0]
    measured = [reading.temperature_c for reading in readings if reading.temperature_c is not None]
    facts = []
    if speeds:
        speed = median(speeds)
        facts.append(("speed of sound", f"{speed:.2f} m/s"))
        at = report.comparison.prediction.room.air.temperature_at(speed)
        facts.append(("temperature for this speed", "outside -40 to 60 °C" if at is None else f"{at:.1f} °C"))
    if measured:
        facts.append(("thermometer", f"{median(measured):.1f} °C"))
    return facts


def _board(board: Board) -> Facts:
    gain = f"{len(board.gain_steps)} steps of {board.gain_step_db:g} dB" if board.gain_steps else "ideal"
    return (
        ("name", board.name),
        ("aperture radius", f"{board.aperture_radius * 1000:g} mm"),
        ("frequency", f"{board.frequency / 1000:g} kHz"),
        ("burst", f"{board.transmit_cycles} cycles"),
        ("blanking", f"{board.blanking * 1000:g} ms"),
        ("farthest range", f"{board.max_range:g} m"),
        ("threshold", f"{board.threshold_db:g} dB"),
        ("gain", "fixed" if board.fixed_gain else gain),
        ("range offset", f"{board.range_offset * 1000:g} mm"),
        ("home angle", f"{board.home_angle_deg:g}°"),
    )


def _log(report: Report) -> Facts:
    log = report.log
    if log is None:
        return ()
    facts = [*_made(log.metadata)]
    if log.info is not None:
        device = log.info
        number = f", serial number {device.serial}" if device.serial else ""
        facts.append(("device", f"{device.firmware}{number}, protocol {device.major}.{device.minor}"))
    scans = "one scan" if len(log.scans) == 1 else f"{len(log.scans)} scans"
    facts.append(("readings", f"{len(log.readings)} in {scans}, {sum(scan.missing for scan in log.scans)} lost"))
    facts.append(("frames", str(len(log.frames))))
    facts.append(("file", f"{log.condition}: {log.torn}" if log.torn else log.condition))
    facts += [("angles in doubt", scan.angle_warning) for scan in log.scans if scan.angle_warning]
    return facts


def _made(metadata: LogMetadata) -> Iterator[tuple[str, str]]:
    yield "made by", f"{metadata.made_by}, sonarhw {metadata.product_version}" if metadata.started else "unknown"
    if metadata.room_file:
        yield "recorded with room file", metadata.room_file


def _notes(report: Report) -> Iterator[str]:
    if not report.notes:
        return
    yield "<h2>Notes</h2>"
    yield from table_head("notes", ("no.", "heading (°)", "scan (m)", "note"))
    board = report.comparison.prediction.board
    for _, reading, text in report.notes:
        heading = report.comparison.heading + board.turned(reading.angle)
        yield table_row((str(reading.number), f"{in_degrees(heading, 1):.1f}", metres(reading.range), text))
    yield "</tbody></table>"


def _readings(report: Report) -> Iterator[str]:
    comparison = report.comparison
    notes = {place - report.left_out: f"; note: {text}" for place, _, text in report.notes}
    yield "<h2>Readings</h2>"
    if report.left_out:
        yield f"<p>The newest {len(comparison.rows)}; {report.left_out} older ones are left out.</p>"
    names = ("no.", "heading (°)", "scan (m)", "predicted (m)", "residual (mm)", "class", "explanation")
    yield from table_head("readings", names)
    for row in comparison.rows:
        cells = (
            str(row.reading.number),
            f"{in_degrees(row.heading, 1):.1f}",
            metres(row.measured),
            metres(row.predicted),
            "" if row.residual is None else millimetres(row.residual),
            row.kind.label,
            explain_reading(comparison, row.index) + notes.get(row.index, ""),
        )
        yield table_row(cells)
    yield "</tbody></table>"


def _date(started: float) -> str:
    return f"{datetime.fromtimestamp(started, UTC):%Y-%m-%d %H:%M:%S} UTC"
