"""The rows of a B-scan, computed in slices of time so that newer requests do not wait.

Each call continues where the last one ended. Each row is computed once for its reading and once for its prediction.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from sonarhw_compare.pictures import (
    BScan,
    RangeCells,
    bscan_of,
    cells_for,
    echo_row,
    heading_key,
    newest_by_heading,
    predicted_row,
    row_width,
    trace_row,
)
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.errors import SonarError
from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.scene.scene import Scene

_SAMPLE = 0.004  # m between samples of a predicted envelope, in warm air


@dataclass(frozen=True)
class MeasuredRow:
    """One measured row, and its reading."""

    reading: Reading
    levels: FloatArray  # (cells,)


@dataclass(frozen=True)
class BScanRows:
    """The rows computed so far, by `heading_key`."""

    board: Board
    cells: RangeCells
    traced: bool  # whether measured rows come from traces; else from echo times
    outline: PredictedScan | None  # the prediction of the predicted rows
    measured: Mapping[int, MeasuredRow] = field(default_factory=dict)
    predicted: Mapping[int, FloatArray] = field(default_factory=dict)
    done: float = 0.0  # share of all rows
    unreadable: str = ""  # error of the last unreadable trace

    def images(self) -> tuple[BScan, BScan]:
        """Return the measured and the predicted B-scan."""
        measured = bscan_of({key: row.levels for key, row in self.measured.items()}, self.cells)
        spacing = None if self.outline is None else row_width(self.outline.headings)
        return measured, bscan_of(self.predicted, self.cells, spacing)


def more_rows(
    scene: Scene, readings: tuple[Reading, ...], outline: PredictedScan | None, before: BScanRows | None, slice_: float
) -> BScanRows:
    """Return the rows of `before` that are still valid, and new rows computed within `slice_` s, at least one.

    A trace that cannot be read leaves a gap.
    """
    until = time.monotonic() + slice_
    zero = scene.pose.heading
    wanted = newest_by_heading(readings, scene.board, zero)
    rows = _still_valid(before, scene.board, wanted, outline)
    rows = _measured(rows, wanted, until)
    headings = {} if outline is None else _predicted_headings(outline, wanted, zero)
    if outline is not None:
        rows = _predicted(rows, outline, headings, until)
    expected = len(wanted) + len(headings)
    return replace(rows, done=(len(rows.measured) + len(rows.predicted)) / expected if expected else 1.0)


def _still_valid(
    before: BScanRows | None, board: Board, wanted: Mapping[int, Reading], outline: PredictedScan | None
) -> BScanRows:
    traced = next((reading for reading in wanted.values() if reading.trace is not None), None)
    if before is None or before.board is not board or before.traced != (traced is not None):
        return BScanRows(board, _cells(board, traced), traced is not None, outline)
    if before.outline is not outline:
        return replace(before, outline=outline, predicted={})
    return before


def _cells(board: Board, traced: Reading | None) -> RangeCells:
    """Return cells up to the end of the traces; without traces, up to the maximum range of the board."""
    if traced is None or traced.trace is None:
        return cells_for(board.max_range, _SAMPLE)
    try:
        metres = traced.speed_of_sound / 2
        return cells_for(float(traced.trace.times[-1]) * metres, max(_SAMPLE, metres / traced.trace.rate))
    except SonarError:
        return cells_for(board.max_range, _SAMPLE)


def _predicted_headings(outline: PredictedScan, wanted: Mapping[int, Reading], zero: float) -> dict[int, float]:
    """Return the headings to predict, rad, by key: those of the outline, and those of the readings if possible."""
    along = (
        {}
        if outline.only_at is not None
        else {key: zero + outline.board.turned(reading.angle) for key, reading in wanted.items()}
    )
    return {heading_key(heading): heading for heading in outline.headings.tolist()} | along


def _measured(rows: BScanRows, wanted: Mapping[int, Reading], until: float) -> BScanRows:
    computed = {key: rows.measured[key] for key, reading in wanted.items() if _is_of(rows.measured.get(key), reading)}
    unreadable = rows.unreadable
    for key in [key for key in wanted if key not in computed]:
        try:
            levels = _measured_row(wanted[key], rows)
        except SonarError as error:
            levels, unreadable = echo_row((), rows.cells), str(error)
        computed[key] = MeasuredRow(wanted[key], levels)
        if time.monotonic() > until:
            break
    return replace(rows, measured=computed, unreadable=unreadable)


def _is_of(row: MeasuredRow | None, reading: Reading) -> bool:
    return row is not None and row.reading is reading


def _measured_row(reading: Reading, rows: BScanRows) -> FloatArray:
    if rows.traced:
        trace = reading.trace
        return echo_row((), rows.cells) if trace is None else trace_row(trace, reading.speed_of_sound, rows.cells)
    return echo_row(reading.echo_ranges, rows.cells)


def _predicted(rows: BScanRows, outline: PredictedScan, headings: Mapping[int, float], until: float) -> BScanRows:
    computed = {key: rows.predicted[key] for key in headings if key in rows.predicted}
    for key in [key for key in headings if key not in computed]:
        if time.monotonic() > until:
            break
        computed[key] = predicted_row(outline, headings[key], rows.cells)
    return replace(rows, predicted=computed)
