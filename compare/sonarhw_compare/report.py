"""HTML reports about a scan and about a map. A page contains all its pictures and needs no other file."""

import math
import platform
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from statistics import median
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import harmless, in_degrees
from sonarhw.log import Log, LogMetadata
from sonarhw.readings import FloatArray, Origin, Reading, Trace, points_at
from sonarhw_compare import pictures
from sonarhw_compare.corrections import agreement_doubts
from sonarhw_compare.drawings import draw_map, draw_room, draw_sensor
from sonarhw_compare.explain import explain_reading, path_suffix, region_counts
from sonarhw_compare.fit.starting import Fit
from sonarhw_compare.map import Layer, RoomMap
from sonarhw_compare.match import TOLERANCE, Comparison, Kind, Matched, Summary, compare_readings
from sonarhw_compare.picture_file import picture_bytes
from sonarhw_compare.regions import LEAST_WIDTH, Region
from sonarhw_compare.rooms.outcome import MappedScans, RoomOfScans, found_room_figures, open_ends
from sonarhw_compare.scans import GivenScan
from sonarhw_compare.score import (
    CalibrationBin,
    ProbabilityScore,
    RegionMatch,
    calibration_text,
    compare_regions,
    score_comparison,
)

# The parts of HTML reports: page, tables and pictures. A page contains all its pictures and needs no other file.


Facts = Sequence[tuple[str, str]]

_MEDIA = {".svg": "svg+xml", ".png": "png"}
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 68em; margin: 2em auto; padding: 0 1em; }
h1 { margin-bottom: 0; } h2 { margin-top: 1.8em; border-bottom: 1px solid #ccc; }
img { max-width: 100%; } table { border-collapse: collapse; } .facts td:first-child { color: #555; }
td, th { padding: 2px 10px 2px 0; text-align: left; vertical-align: top; }
:is(.readings, .regions) td:nth-child(-n+5), .notes td:nth-child(-n+3), .surfaces :is(td, th):nth-child(n+2) {
  text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.surfaces { margin: 0.8em 0; }
:is(.regions, .notes, .surfaces) th { border-bottom: 1px solid #ccc; }
.readings th { position: sticky; top: 0; background: #fff; border-bottom: 1px solid #ccc; }
pre { background: #f4f4f2; padding: 1em; overflow-x: auto; } .lead { font-size: 1.15em; }
@media print { .readings th { position: static; } }
"""


def html_page(title: str, body: Iterable[str]) -> str:
    """Return a page; `title` is plain text, `body` are lines of HTML."""
    head = f'<head><meta charset="utf-8"><title>{escaped(title)}</title><style>{_STYLE}</style></head>'
    return "\n".join(("<!DOCTYPE html>", '<html lang="en">', head, "<body>", *body, "</body></html>\n"))


def table_head(kind: str, names: Iterable[str]) -> Iterator[str]:
    """Yield the begin of a table; `kind` is its class, `names` are the heads of its columns."""
    yield f'<table class="{kind}"><thead><tr>'
    yield "".join(f"<th>{name}</th>" for name in names) + "</tr></thead><tbody>"


def table_row(cells: Iterable[str]) -> str:
    """Return a row of a table."""
    return "<tr>" + "".join(f"<td>{escaped(cell)}</td>" for cell in cells) + "</tr>"


def metres(length: float | None) -> str:
    """Return a length (m) as text; empty without one."""
    return "" if length is None else f"{length:.3f}"


def escaped(name: str) -> str:
    """Return a name as HTML. Control characters and the bytes of a file name that is not UTF-8 are escapes."""
    return escape(harmless(name))


def facts_table(facts: Iterable[tuple[str, str]]) -> str:
    """Return a table of names and values."""
    rows = "".join(f"<tr><td>{escaped(name)}</td><td>{escaped(value)}</td></tr>" for name, value in facts)
    return f'<table class="facts">{rows}</table>'


def picture(suffix: str, content: bytes, meaning: str) -> str:
    """Return a picture from a file with this suffix; `meaning` is its text for readers that show none."""
    data = f"data:image/{_MEDIA[suffix]};base64,{b64encode(content).decode('ascii')}"
    return f'<img alt="{escape(meaning)}" src="{data}">'


# The HTML report about a found room, with certainty grid and regions of constant depth beside it as the baseline.


def map_report_html(mapped: MappedScans) -> str:
    """Return the report about the room found from scans."""
    assert mapped.found is not None
    return html_page("Found room", _body_of_map(mapped, mapped.found))


def _body_of_map(mapped: MappedScans, outcome: RoomOfScans) -> Iterator[str]:
    found, scans, figures = outcome.found, outcome.found.scans, found_room_figures(outcome.found)
    yield f"<h1>Room found from {len(scans)} scans</h1>"
    yield f"<p>{escaped(', '.join(scan.title for scan in scans))}</p>"
    yield (
        f'<p class="lead">{found.explained} of {found.echoes} echoes are within 5 cm of one that the found room '
        "predicts.</p>"
    )
    for doubt in mapped.doubts:
        yield f"<p><strong>Warning:</strong> {escaped(doubt)}.</p>"
    yield "<h2>The found room</h2>"
    yield _drawn(".svg", mapped.draw(), "Echoes, found room, and the room file of the logs")
    yield from _walls(figures["walls"])
    yield from _posts(figures["posts"])
    yield _open_ends(open_ends(found))
    for line in outcome.lines():
        yield f"<p>{escaped(line)}</p>"
    yield "<h2>Baseline: certainty grid and regions of constant depth</h2>"
    yield _drawn(".png", draw_map(mapped.baseline, mapped.known), "Certainty grid, arcs, walls, corners and edges")
    yield from _beside(outcome.room, mapped.baseline)
    yield "<h2>Made with</h2>"
    yield facts_table((("board", outcome.board.name), ("sonarhw", version("sonarhw")), ("NumPy", version("numpy"))))
    yield f"<details><summary>The room file</summary><pre>{escape(outcome.room.text)}</pre></details>"


def _walls(walls: Iterable[dict[str, Any]]) -> Iterator[str]:
    yield from table_head("surfaces", ("wall", "from (m)", "to (m)", "across ± (mm)", "angle ± (°)", "touches"))
    for number, wall in enumerate(walls, 1):
        start, end = wall["points_m"]
        errors = f"{wall['across_sd_m'] * 1000:.1f}", f"{wall['angle_sd_deg']:.2f}"
        yield table_row((f"wall {number}", _point(start), _point(end), *errors, str(wall["touches"])))
    yield "</tbody></table>"


def _posts(posts: Sequence[dict[str, Any]]) -> Iterator[str]:
    if not posts:
        return
    yield from table_head("surfaces", ("post", "centre (m)", "radius (mm)", "touches"))
    for number, post in enumerate(posts, 1):
        radius = f"{post['radius_m'] * 1000:.0f}"
        yield table_row((f"post {number}", _point(post["center_m"]), radius, str(post["touches"])))
    yield "</tbody></table>"


def _open_ends(ends: Sequence[tuple[float, float]]) -> str:
    if not ends:
        return "<p>No wall has an open end.</p>"
    return (
        f"<p>Beyond these open ends (m), the scans show nothing: {', '.join(f'({_point(end)})' for end in ends)}.</p>"
    )


def _beside(room: Room, baseline: RoomMap) -> Iterator[str]:
    """Yield a table of what the found room and the baseline contain."""
    yield from table_head("surfaces", ("", "walls", "their length (m)", "posts", "corners", "edges"))
    walls = room.walls
    whole = _length(walls[:, 2:] - walls[:, :2])
    yield table_row(("found room", str(len(walls)), f"{whole:.2f}", str(len(room.posts)), "", ""))
    layers = [("baseline, all echoes", baseline.plain)]
    if baseline.followed_room is not None:
        layers.append(("baseline, without echoes by several reflections", baseline.direct))
    for name, layer in layers:
        yield table_row((name, *_counts(layer)))
    yield "</tbody></table>"


def _counts(layer: Layer) -> tuple[str, ...]:
    walls, points = layer.features.walls, layer.features.points
    whole = _length(np.array([np.subtract(wall.end, wall.start) for wall in walls]).reshape(-1, 2))
    corners = sum(point.is_corner for point in points)
    return str(len(walls)), f"{whole:.2f}", "", str(corners), str(len(points) - corners)


def _length(along: FloatArray) -> float:
    return float(np.hypot(*along.T).sum())


def _point(position: Sequence[float]) -> str:
    return f"{position[0]:.3f}, {position[1]:.3f}"


def _drawn(suffix: str, figure: Figure, meaning: str) -> str:
    return picture(suffix, picture_bytes(figure, suffix), meaning)


# The pictures of a report as SVG and PNG: the plan, ranges and residuals by heading, and the B-scan.


# colour and marker of each class; the colours are those of the window
CLASSES: dict[Kind, tuple[str, str]] = {
    Kind.MATCH: (pictures.MEASURED, "o"),
    Kind.SHORT: (pictures.SHORT, "v"),
    Kind.LONG: (pictures.LONG, "^"),
    Kind.EXTRA: (pictures.EXTRA, "s"),
    Kind.MISSED: (pictures.MISSED, "x"),
    Kind.OWN_BODY: (pictures.OWN_BODY, "D"),
}
_MOST_RESIDUAL = 250.0  # mm; larger residuals are drawn at the edge
_BEYOND = 0.3  # margin around the room, of its longer side
_COLUMNS = 720  # of a B-scan
_SAMPLE = 0.004  # m, spacing of the samples of a predicted envelope


def plan_svg(comparison: Comparison) -> bytes:
    """Return the plan of the room with the measured points, by class, over the predicted ones."""
    figure, (axes,) = _figure((10, 6.4), 1)
    prediction = comparison.prediction
    draw_room(axes, prediction.room, prediction.place)
    predicted = points_at(prediction.standpoints, prediction.headings, prediction.ranges)
    axes.plot(*predicted.T, "o", mfc="none", mec=pictures.PREDICTED, ms=7, label="predicted")
    points = _points(comparison)
    _draw_classes(axes, comparison.rows, lambda row: None if _drawn_at(row) is None else tuple(points[row.index]))
    _crop_to_room(axes, comparison, points[~np.isnan(points[:, 0])])
    if prediction.poses is None:
        draw_sensor(axes, prediction)
    else:
        axes.plot(*prediction.poses[:, :2].T, "D-", color="black", ms=3, lw=1, label="sensor")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, title=f"{comparison.origin} readings")
    return picture_bytes(figure, ".svg", tight=True)  # axes of equal scale do not fill the figure


def ranges_svg(comparison: Comparison) -> bytes:
    """Return measured and predicted ranges by heading, and their residuals below."""
    figure, (ranges, residuals) = _figure((10, 5.6), 2)
    prediction = comparison.prediction
    headings = np.degrees(prediction.headings) % 360
    ranges.plot(headings, prediction.ranges, "o", mfc="none", mec=pictures.PREDICTED, ms=6, label="predicted")
    _draw_classes(ranges, comparison.rows, lambda row: _over_heading(row, _drawn_at(row)))
    ranges.set(ylabel="range (m)", ylim=(0, None))
    ranges.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, title=f"{comparison.origin} readings")
    residuals.axhspan(-TOLERANCE * 1000, TOLERANCE * 1000, color="#EAF3F8")
    _draw_classes(residuals, comparison.rows, lambda row: _over_heading(row, _residual(row)))
    residuals.set(
        xlabel="heading in the room (°)",
        ylabel=f"{comparison.origin} minus\npredicted (mm)",
        ylim=(-1.1 * _MOST_RESIDUAL, 1.1 * _MOST_RESIDUAL),
        xlim=(-4, 364),
        xticks=range(0, 361, 45),
    )
    return picture_bytes(figure, ".svg")


def calibration_svg(bins: Sequence[CalibrationBin]) -> bytes:
    """Return the share of readings that were measured as stated, over the stated probability, with its standard error.

    Probabilities that are right lie on the dotted line.
    """
    figure, (axes,) = _figure((4.6, 4.2), 1)
    stated, observed, counts = np.array([(tenth.stated, tenth.observed, tenth.n) for tenth in bins]).reshape(-1, 3).T
    axes.plot([0, 1], [0, 1], ":", color="black")
    axes.errorbar(
        stated, observed, np.sqrt(stated * (1 - stated) / counts), fmt="o", color=pictures.MEASURED, capsize=3
    )
    axes.set(xlabel="stated probability of the most probable reading", ylabel="share that was measured")
    axes.set(xlim=(0, 1.03), ylim=(0, 1.03), aspect="equal")
    return picture_bytes(figure, ".svg")


def bscan_png(comparison: Comparison) -> bytes | None:
    """Return measured traces above predicted ones; None without traces, or from many places. Raises NotALog."""
    prediction = comparison.prediction
    if prediction.poses is not None:
        return None  # a B-scan has one row for each heading
    traced = [(row, trace) for row in comparison.rows if (trace := row.reading.trace) is not None]
    if not traced:
        return None
    cells = _cells(traced[0][1], traced[0][0].reading.speed_of_sound, prediction.board)
    rows = {pictures.heading_key(row.heading): (row, trace) for row, trace in traced}  # the newest of each heading
    measured = {key: pictures.trace_row(trace, row.reading.speed_of_sound, cells) for key, (row, trace) in rows.items()}
    predicted = {key: pictures.predicted_row(prediction, row.heading, cells) for key, (row, _) in rows.items()}
    figure, panes = _figure((10, 6.4), 2)
    floor = pictures.floor_of(prediction.board)
    for axes, name, levels in zip(panes, (comparison.origin.value, "predicted"), (measured, predicted), strict=True):
        image = axes.imshow(
            _image(pictures.bscan_of(levels, cells), floor),
            extent=(0, 360, 0, cells.reach),
            origin="lower",
            aspect="auto",
            cmap="cividis",
            vmin=floor,
            vmax=0,
        )
        axes.set(ylabel=f"{name}: range (m)", xticks=range(0, 361, 45))
    panes[-1].set(xlabel="heading in the room (°)")
    figure.colorbar(image, ax=panes, label="dB of full scale")
    return picture_bytes(figure, ".png")


def _points(comparison: Comparison) -> FloatArray:
    """Return where each reading is drawn in the plan, (n, 2) m; NaN for silence."""
    prediction = comparison.prediction
    ranges = np.array([_drawn_at(row) for row in comparison.rows], dtype=np.float64)  # None is NaN
    return points_at(prediction.standpoints, prediction.headings, ranges)


def _crop_to_room(axes: Axes, comparison: Comparison, points: FloatArray) -> None:
    """Crop the plan to the room, because multipath echoes may be far outside. The title states their number."""
    room = comparison.prediction.room
    corners = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2], _positions(comparison.prediction)))
    low, high = corners.min(axis=0), corners.max(axis=0)
    beyond = _BEYOND * float((high - low).max())
    low, high = low - beyond, high + beyond
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    outside = int(((points < low) | (points > high)).any(axis=1).sum())
    if outside:
        axes.set_title(f"{outside} of {len(points)} are outside this plan", fontsize="medium", loc="right")


def _figure(size: tuple[float, float], rows: int) -> tuple[Figure, Sequence[Axes]]:
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    panes = [*figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]]
    for axes in panes:
        axes.grid(alpha=0.25)
    return figure, panes


def _draw_classes(
    axes: Axes, rows: Sequence[Matched], point_of: Callable[[Matched], tuple[float, float] | None]
) -> None:
    for kind, (colour, marker) in CLASSES.items():
        points = [point for row in rows if row.kind is kind and (point := point_of(row)) is not None]
        if points:
            axes.plot(
                *np.transpose(points), marker, color=colour, ms=5, ls="none", label=f"{kind.label} ({len(points)})"
            )


def _over_heading(row: Matched, value: float | None) -> tuple[float, float] | None:
    return None if value is None else (math.degrees(row.heading) % 360, value)


def _drawn_at(row: Matched) -> float | None:
    """Return the range at which a reading is drawn, m; for a missed echo, the predicted range."""
    return row.predicted if row.measured is None else row.measured


def _residual(row: Matched) -> float | None:
    if row.residual is None:
        return None
    return float(np.clip(row.residual * 1000, -_MOST_RESIDUAL, _MOST_RESIDUAL))


def _cells(trace: Trace, speed_of_sound: float, board: Board) -> pictures.RangeCells:
    """Return cells up to the end of a trace."""
    metres = speed_of_sound / 2
    reach = float(trace.times[-1]) * metres if len(trace.samples) else board.max_range
    return pictures.cells_for(reach, max(_SAMPLE, metres / trace.rate))


def _image(bscan: pictures.BScan, floor: float) -> FloatArray:
    rows = bscan.rows_at(np.linspace(0, math.tau, _COLUMNS, endpoint=False))
    levels = np.vstack((bscan.levels, np.full((1, bscan.cells.count), np.nan)))  # row -1, for gaps
    return pictures.in_db(levels[rows], floor).T


# The table of regions of constant depth in a report, measured beside predicted.


_HEAD = ("scan at (°)", "scan (m)", "predicted at (°)", "predicted (m)", "difference (mm)", "found")


def regions_table(comparison: Comparison) -> Iterator[str]:
    """Yield lines of HTML: an explanation, the number of regions, and a row for each, counter-clockwise."""
    regions = compare_regions(comparison)
    width = f"{math.degrees(LEAST_WIDTH):.0f}°"
    yield f"<p>Neighbouring headings with the same range over {width} or more: one echo, over the whole beam.</p>"
    yield f"<p>{region_counts(regions)}.</p>"
    rows = list(_rows(comparison, regions))
    if rows:
        yield '<table class="regions"><thead><tr>' + "".join(f"<th>{name}</th>" for name in _HEAD)
        yield "</tr></thead><tbody>"
        for cells in rows:
            yield "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
        yield "</tbody></table>"


def _rows(comparison: Comparison, regions: RegionMatch) -> Iterator[tuple[str, ...]]:
    for measured, predicted in regions.by_bearing():
        difference = "" if measured is None or predicted is None else millimetres(measured.range - predicted.range)
        if predicted is None:
            where = "only in the scan"
        else:
            where = f"{'only predicted' if measured is None else 'in both'}{path_suffix(comparison, predicted)}"
        yield *_depth(measured), *_depth(predicted), difference, where


def _depth(region: Region | None) -> tuple[str, str]:
    """Return the interval of headings and the range of a region, as text."""
    if region is None:
        return "", ""
    first, last = (in_degrees(region.bearing + side * region.width / 2, 1) for side in (-1, 1))
    return f"{first:.1f} to {last:.1f}", f"{region.range:.3f}"


def millimetres(length: float) -> str:
    """Return a difference (m) as text in millimetres: `+12`, `0`, `-3`."""
    whole = round(length * 1000)
    return f"{whole:+d}" if whole else "0"


# The HTML report about a scan: one file that contains all pictures and needs neither the log nor the program.


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
    along = scan.places(place)
    faced = board.faced(place) if along is None else [*map(board.faced, along[-MOST_READINGS:])]
    comparison = compare_readings(
        readings[-MOST_READINGS:],
        room,
        faced if fit is None else fit.place,
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


def _positions(prediction: PredictedScan) -> FloatArray:
    """Return the positions of the sensor, (n, 2) m."""
    return np.array([prediction.place.position]) if prediction.poses is None else prediction.poses[:, :2]


def _title(report: Report) -> str:
    prediction = report.comparison.prediction
    return f"{prediction.room.name}, {prediction.where}"


def _body(report: Report) -> Iterator[str]:
    comparison, log = report.comparison, report.log
    summary = comparison.summary()
    yield f"<h1>{escaped(_title(report))}</h1>"
    made = "recorded" if comparison.origin is Origin.MEASURED else f"{comparison.origin} readings"
    started = log.metadata.started if log else None
    when = f", {made} {datetime.fromtimestamp(started, UTC):%Y-%m-%d %H:%M:%S} UTC" if started else ""
    yield f"<p>{escaped(report.name)}{when}</p>"
    yield f'<p class="lead">{escape(_lead(summary))}</p>'
    for doubt in agreement_doubts(report.name, comparison):
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
    if comparison.prediction.poses is None:
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
    facts.append(("turntable step 0 at", f"{summary.heading_deg:z.1f}°"))
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
    if prediction.poses is not None:
        x, y = prediction.poses[-1, :2]
        where = [("first " + where[0][0], where[0][1]), ("last position", f"x {x:g} m, y {y:g} m")]
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
    if len(report.fit.alike) > 1:
        spans = f"{report.fit.spans_text}; the likeliest is taken"
        facts.append(("headings with as many, within a standard error", spans))
    return [*facts, *(("warning", doubt) for doubt in report.fit.doubts)]


def _air_of_ranges(report: Report) -> Facts:
    """Return the speed of sound of the ranges, the temperature of air with this speed, and the thermometer's."""
    readings = report.comparison.readings
    speeds = [reading.speed_of_sound for reading in readings if reading.speed_of_sound > 0]
    measured = [reading.temperature_c for reading in readings if reading.temperature_c is not None]
    facts = []
    if speeds:
        speed = median(speeds)
        facts.append(("speed of sound", f"{speed:.2f} m/s"))
        temperature = report.comparison.prediction.room.air.temperature_at(speed)
        facts.append(
            ("temperature for this speed", "outside -40 to 60 °C" if temperature is None else f"{temperature:.1f} °C")
        )
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
    for place, reading, text in report.notes:
        row = place - report.left_out
        here = report.comparison.heading + board.turned(reading.angle)
        heading = report.comparison.rows[row].heading if row >= 0 else here
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
