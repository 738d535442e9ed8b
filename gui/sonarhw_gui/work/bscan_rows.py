"""The rows of a B-scan, computed in slices of time so that newer requests do not wait.

A later call continues where the last one ended: each row is computed once for its reading and once for its prediction.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from sonarhw_compare.pictures.bscan import (
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

_SAMPLE = 0.004  # m: how far samples of a predicted envelope lie apart, in warm air


@dataclass(frozen=True)
class MeasuredRow:
    """One measured row, and the reading that it is made of."""

    reading: Reading
    levels: FloatArray  # (cells,)


@dataclass(frozen=True)
class BScanRows:
    """What has been worked out; rows by `heading_key`."""

    board: Board
    cells: RangeCells
    traced: bool  # measured rows are made of traces; else of echo times
    outline: PredictedScan | None  # what the predicted rows are of
    measured: Mapping[int, MeasuredRow] = field(default_factory=dict)
    predicted: Mapping[int, FloatArray] = field(default_factory=dict)
    done: float = 0.0  # share of the rows that there will be
    unreadable: str = ""  # why the last trace that could not be read could not

    def images(self) -> tuple[BScan, BScan]:
        """Measured and predicted."""
        measured = bscan_of({key: row.levels for key, row in self.measured.items()}, self.cells)
        spacing = None if self.outline is None else row_width(self.outline.headings)
        return measured, bscan_of(self.predicted, self.cells, spacing)


def more_rows(
    scene: Scene, readings: tuple[Reading, ...], outline: PredictedScan | None, before: BScanRows | None, slice_: float
) -> BScanRows:
    """As many rows more as `slice_` s allow, at least one where one is missing; those of `before` that are still true.

    A trace that cannot be read leaves a gap.
    """
    until = time.monotonic() + slice_
    zero = scene.pose.heading
    wanted = newest_by_heading(readings, zero)
    rows = _still_true(before, scene.board, wanted, outline)
    rows = _measured(rows, wanted, until)
    headings = {} if outline is None else _predicted_headings(outline, wanted, zero)
    if outline is not None:
        rows = _predicted(rows, outline, headings, until)
    expected = len(wanted) + len(headings)
    return replace(rows, done=(len(rows.measured) + len(rows.predicted)) / expected if expected else 1.0)


def _still_true(
    before: BScanRows | None, board: Board, wanted: Mapping[int, Reading], outline: PredictedScan | None
) -> BScanRows:
    traced = next((reading for reading in wanted.values() if reading.trace is not None), None)
    if before is None or before.board is not board or before.traced != (traced is not None):
        return BScanRows(board, _cells(board, traced), traced is not None, outline)
    if before.outline is not outline:
        return replace(before, outline=outline, predicted={})
    return before


def _cells(board: Board, traced: Reading | None) -> RangeCells:
    """Cells for as far as the traces reach; without any for as far as the board can hear."""
    if traced is None or traced.trace is None:
        return cells_for(board.max_range, _SAMPLE)
    try:
        metres = traced.speed_of_sound / 2
        return cells_for(float(traced.trace.times[-1]) * metres, max(_SAMPLE, metres / traced.trace.rate))
    except SonarError:
        return cells_for(board.max_range, _SAMPLE)


def _predicted_headings(outline: PredictedScan, wanted: Mapping[int, Reading], zero: float) -> dict[int, float]:
    """Where to predict, rad by key: along the readings, where paths serve all headings, and all round."""
    along = {} if outline.only_at is not None else {key: zero + reading.angle for key, reading in wanted.items()}
    return {heading_key(heading): heading for heading in outline.headings.tolist()} | along


def _measured(rows: BScanRows, wanted: Mapping[int, Reading], until: float) -> BScanRows:
    made = {key: rows.measured[key] for key, reading in wanted.items() if _is_of(rows.measured.get(key), reading)}
    unreadable = rows.unreadable
    for key in [key for key in wanted if key not in made]:
        try:
            levels = _measured_row(wanted[key], rows)
        except SonarError as error:
            levels, unreadable = echo_row((), rows.cells), str(error)
        made[key] = MeasuredRow(wanted[key], levels)
        if time.monotonic() > until:
            break
    return replace(rows, measured=made, unreadable=unreadable)


def _is_of(row: MeasuredRow | None, reading: Reading) -> bool:
    return row is not None and row.reading is reading


def _measured_row(reading: Reading, rows: BScanRows) -> FloatArray:
    if rows.traced:
        trace = reading.trace
        return echo_row((), rows.cells) if trace is None else trace_row(trace, reading.speed_of_sound, rows.cells)
    return echo_row(reading.echo_ranges, rows.cells)


def _predicted(rows: BScanRows, outline: PredictedScan, headings: Mapping[int, float], until: float) -> BScanRows:
    made = {key: rows.predicted[key] for key in headings if key in rows.predicted}
    for key in [key for key in headings if key not in made]:
        if time.monotonic() > until:
            break
        made[key] = predicted_row(outline, headings[key], rows.cells)
    return replace(rows, predicted=made)
