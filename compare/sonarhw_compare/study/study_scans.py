"""Prediction of the scans of a study, as two Arrow tables.

One table has a row for each scan, with the varied values and the figures of the scan. The other has a row for each
heading. The result of a scan does not depend on the other scans of a call.
"""

from collections import OrderedDict
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from sonarhw_sim.air import Model
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import paths_for, paths_serve_all_headings, predict_with, search_for, weigh_paths
from sonarhw_sim.rays.fan import distances_ahead
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.space.sections import cut, spanning_at

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.study.arrow import pa
from sonarhw_compare.study.cases import Case, Cases
from sonarhw_compare.study.spec import Study

_PATHS_KEPT = 16  # sets of paths, for points of the grid that use the same place again soon


@dataclass(frozen=True)
class ScanColumns:
    """The columns of one scan, (n,) each; NaN for no echo."""

    heading_deg: FloatArray
    range_m: FloatArray
    path_m: FloatArray
    level_db: FloatArray
    bounces: FloatArray
    bent: FloatArray  # 1 if the path is diffracted at an edge, else 0
    axis_m: FloatArray  # m, straight ahead to the first wall or post; NaN without one


class PathCache:
    """Cache of the paths of the last few places, so that sound is followed once for each place."""

    def __init__(self) -> None:
        self._kept: OrderedDict[object, Paths] = OrderedDict()

    def of(self, case: Case) -> Paths:
        """Return all paths that the board of a case can detect, at any threshold of its study."""
        options = case.options
        search = search_for(case.room, case.most_sensitive, options)
        key = case.where, search, case.board.aperture_radius, options.sections
        paths = self._kept.pop(key, None)
        if paths is None:
            paths = paths_for(case.room, case.place, case.most_sensitive, options)
        self._kept[key] = paths
        if len(self._kept) > _PATHS_KEPT:
            self._kept.popitem(last=False)
        return paths


@lru_cache(maxsize=4)
def cases_of(study: Study) -> Cases:
    """Return the cases of a study, computed once in a process."""
    return Cases(study)


def predict_case(case: Case, cache: PathCache) -> PredictedScan:
    """Return the predicted scan of a case."""
    room, place, board, options = case.room, case.place, case.board, case.options
    if case.model is Model.RAY_FOLLOWING and paths_serve_all_headings(board, options.unit):
        return weigh_paths(room, place, board, case.headings, cache.of(case), options)
    return predict_with(case.model, room, place, board, case.headings, options)


def columns_of(scan: PredictedScan) -> ScanColumns:
    """Return the columns of a scan."""
    echo = scan.winners >= 0
    winners = scan.winners[echo]

    def at_echoes(values: FloatArray) -> FloatArray:
        filled = np.full(len(echo), np.nan)
        filled[echo] = values
        return filled

    return ScanColumns(
        # rounded as in the output of all commands
        np.asarray(np.round(np.degrees(scan.headings), 9), dtype=np.float64),
        scan.ranges,
        at_echoes(scan.paths.lengths[winners]),
        at_echoes(np.array([scan.ping(int(k)).level_of_reading for k in np.flatnonzero(echo)])),
        at_echoes(scan.paths.bounces[winners].astype(np.float64)),
        at_echoes((scan.paths.edges[winners] >= 0).astype(np.float64)),
        _axis_distances(scan),
    )


def _axis_distances(scan: PredictedScan) -> FloatArray:
    height = scan.place.height
    room = scan.room if height is None else cut(scan.room, spanning_at(scan.room, height))
    ahead = distances_ahead(scan.standpoints, scan.headings, room.surfaces)
    return np.where(np.isfinite(ahead), ahead, np.nan)


def figures_of(columns: ScanColumns) -> dict[str, float]:
    """Return the figures of one scan; shares are of its echoes, NaN without echoes."""
    echo = ~np.isnan(columns.range_m)
    count = int(echo.sum())
    several = columns.bounces[echo] + columns.bent[echo] > 1
    errors = np.abs(columns.range_m - columns.axis_m)[echo]
    found = errors[~np.isnan(errors)]
    return {
        "n": len(echo),
        "n_echo": count,
        "by_several": float(several.mean()) if count else np.nan,
        "by_edge": float(columns.bent[echo].mean()) if count else np.nan,
        "within_5cm_of_axis": float((errors <= TOLERANCE).mean()) if count else np.nan,
        "median_abs_error_m": float(np.median(found)) if len(found) else np.nan,
    }


def predict_scans(study: Study, first: int, last: int) -> "tuple[pa.Table, pa.Table]":
    """Return the tables of scans and of headings for scans `first` to `last` (excluded).

    Raises InputError if drawn values of a scan do not fit together.
    """
    cases, cache = cases_of(study), PathCache()
    rows, readings, numbers = [], [], []
    for number in range(first, last):
        case = cases.case(number)
        columns = columns_of(predict_case(case, cache))
        rows.append(_description(case) | figures_of(columns))
        if study.rows == "headings":
            readings.append(columns)
            numbers.append(np.full(len(columns.range_m), number))
    return _scan_table(rows), _reading_table(numbers, readings)


def _description(case: Case) -> dict[str, object]:
    x, y = case.place.position
    here = {"room": case.room_name, "place": case.place.name, "x_m": x, "y_m": y, "board": case.board_name}
    return {"scan": case.number, "draw": case.draw} | here | case.values


def _scan_table(rows: list[dict[str, object]]) -> "pa.Table":
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    return pa.table({key: pa.array(np.array(values), from_pandas=True) for key, values in columns.items()})


def _reading_table(
    numbers: list[np.ndarray[tuple[int], np.dtype[np.int64]]], readings: list[ScanColumns]
) -> "pa.Table":
    if not readings:
        return pa.table({})
    several = {key: np.concatenate([getattr(one, key) for one in readings]) for key in vars(readings[0])}
    table = {"scan": pa.array(np.concatenate(numbers))}
    table |= {key: pa.array(values, from_pandas=True) for key, values in several.items()}
    table["bounces"] = table["bounces"].cast(pa.int16())
    table["bent"] = table["bent"].cast(pa.bool_())
    return pa.table(table)
