"""The pictures of a report as SVG and PNG: the plan, ranges and residuals by heading, and the B-scan."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from sonarhw_sim.predict.predicted_scan import standpoints

from sonarhw.readings import FloatArray, Trace
from sonarhw_compare.matching.match import TOLERANCE, Comparison, Kind, Matched
from sonarhw_compare.matching.probability_score import CalibrationBin
from sonarhw_compare.pictures.bscan import BScan, RangeCells, bscan_of, cells_for, heading_key, predicted_row, trace_row
from sonarhw_compare.pictures.colours import EXTRA, LONG, MEASURED, MISSED, OWN_BODY, PREDICTED, SHORT
from sonarhw_compare.pictures.overlay_picture import draw_room
from sonarhw_compare.pictures.picture_file import picture_bytes
from sonarhw_compare.pictures.points import points_at
from sonarhw_compare.pictures.trace_levels import floor_of, in_db

# colour and marker of each class; the colours are those of the window
CLASSES: dict[Kind, tuple[str, str]] = {
    Kind.MATCH: (MEASURED, "o"),
    Kind.SHORT: (SHORT, "v"),
    Kind.LONG: (LONG, "^"),
    Kind.EXTRA: (EXTRA, "s"),
    Kind.MISSED: (MISSED, "x"),
    Kind.OWN_BODY: (OWN_BODY, "D"),
}
_MOST_RESIDUAL = 250.0  # mm; larger residuals are drawn at the edge
_BEYOND = 0.3  # margin around the room, of its longer side
_COLUMNS = 720  # of a B-scan
_SAMPLE = 0.004  # m, spacing of the samples of a predicted envelope


def plan_svg(comparison: Comparison) -> bytes:
    """Return the plan of the room with the measured points, by class, over the predicted ones."""
    figure, (axes,) = _figure((7.6, 6.4), 1)
    prediction = comparison.prediction
    draw_room(axes, prediction.room, prediction.place)

    def place(headings: FloatArray, ranges: FloatArray) -> FloatArray:
        return points_at(standpoints(prediction.board, prediction.place, headings), headings, ranges)

    predicted = place(prediction.headings, prediction.ranges)
    axes.plot(*predicted.T, "o", mfc="none", mec=PREDICTED, ms=7, label="predicted")
    _draw_classes(axes, comparison.rows, lambda headings, ranges: place(np.radians(headings), ranges), _drawn_at)
    axes.plot(*prediction.place.position, "D", color="black", ms=7, label="sensor")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal")
    _crop_to_room(axes, comparison, place)
    axes.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, title=f"{comparison.origin} readings")
    return picture_bytes(figure, ".svg")


def ranges_svg(comparison: Comparison) -> bytes:
    """Return measured and predicted ranges by heading, and their residuals below."""
    figure, (ranges, residuals) = _figure((10, 5.6), 2)
    prediction = comparison.prediction
    headings = np.degrees(prediction.headings) % 360
    ranges.plot(headings, prediction.ranges, "o", mfc="none", mec=PREDICTED, ms=6, label="predicted")
    _draw_classes(ranges, comparison.rows, _side_by_side, _drawn_at)
    ranges.set(ylabel="range (m)", ylim=(0, None))
    ranges.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, title=f"{comparison.origin} readings")
    residuals.axhspan(-TOLERANCE * 1000, TOLERANCE * 1000, color="#EAF3F8")
    _draw_classes(residuals, comparison.rows, _side_by_side, _residual)
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
    stated, observed, counts = np.array([(one.stated, one.observed, one.n) for one in bins]).reshape(-1, 3).T
    axes.plot([0, 1], [0, 1], ":", color="black")
    axes.errorbar(stated, observed, np.sqrt(stated * (1 - stated) / counts), fmt="o", color=MEASURED, capsize=3)
    axes.set(xlabel="stated probability of the most probable reading", ylabel="share that was measured")
    axes.set(xlim=(0, 1.03), ylim=(0, 1.03), aspect="equal")
    return picture_bytes(figure, ".svg")


def bscan_png(comparison: Comparison) -> bytes | None:
    """Return measured traces above predicted ones; None without recorded traces. Raises NotALog."""
    traced = [row for row in comparison.rows if row.reading.trace is not None]
    if not traced:
        return None
    cells = _cells(traced[0], comparison)
    rows = {heading_key(row.heading): row for row in traced}  # the newest of each heading
    measured = {key: _trace_row(row, cells) for key, row in rows.items()}
    prediction = comparison.prediction
    predicted = {key: predicted_row(prediction, row.heading, cells) for key, row in rows.items()}
    figure, panes = _figure((10, 6.4), 2)
    floor = floor_of(prediction.board)
    for axes, name, levels in zip(panes, (comparison.origin.value, "predicted"), (measured, predicted), strict=True):
        image = axes.imshow(
            _image(bscan_of(levels, cells), floor),
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


def _crop_to_room(axes: Axes, comparison: Comparison, place: Callable[[FloatArray, FloatArray], FloatArray]) -> None:
    """Crop the plan to the room, because multipath echoes may be far outside. The title states their number."""
    room = comparison.prediction.room
    corners = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2], [comparison.prediction.place.position]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    beyond = _BEYOND * float((high - low).max())
    low, high = low - beyond, high + beyond
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    drawn = np.array([(row.heading, at) for row in comparison.rows if (at := _drawn_at(row)) is not None])
    points = place(*drawn.T) if len(drawn) else np.empty((0, 2))
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
    axes: Axes,
    rows: Sequence[Matched],
    place: Callable[[FloatArray, FloatArray], FloatArray],
    value: Callable[[Matched], float | None],
) -> None:
    for kind, (colour, marker) in CLASSES.items():
        drawn = [(row.heading, value(row)) for row in rows if row.kind is kind]
        found = [(math.degrees(heading) % 360, at) for heading, at in drawn if at is not None]
        if found:
            points = place(*np.array(found).T)
            axes.plot(*points.T, marker, color=colour, ms=5, ls="none", label=f"{kind.label} ({len(found)})")


def _side_by_side(headings: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack((headings, values))


def _drawn_at(row: Matched) -> float | None:
    """Return the range at which a reading is drawn, m; for a missed echo, the predicted range."""
    return row.predicted if row.measured is None else row.measured


def _residual(row: Matched) -> float | None:
    if row.residual is None:
        return None
    return float(np.clip(row.residual * 1000, -_MOST_RESIDUAL, _MOST_RESIDUAL))


def _trace(row: Matched) -> Trace:
    assert row.reading.trace is not None
    return row.reading.trace


def _trace_row(row: Matched, cells: RangeCells) -> FloatArray:
    return trace_row(_trace(row), row.reading.speed_of_sound, cells)


def _cells(row: Matched, comparison: Comparison) -> RangeCells:
    """Return cells up to the end of the first trace."""
    trace, metres = _trace(row), row.reading.speed_of_sound / 2
    reach = float(trace.times[-1]) * metres if len(trace.samples) else comparison.prediction.board.max_range
    return cells_for(reach, max(_SAMPLE, metres / trace.rate))


def _image(bscan: BScan, floor: float) -> FloatArray:
    rows = bscan.rows_at(np.linspace(0, math.tau, _COLUMNS, endpoint=False))
    levels = np.vstack((bscan.levels, np.full((1, bscan.cells.count), np.nan)))  # row -1, for gaps
    return in_db(levels[rows], floor).T
