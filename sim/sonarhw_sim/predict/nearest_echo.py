"""The predicted echo nearest to a measured range, at many headings at once."""

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.weighing import Sought, nearest_detected
from sonarhw_sim.predict.board_readings import paths_and_beam
from sonarhw_sim.predict.predicted_scan import PredictedScan

IntArray = NDArray[np.intp]


def nearest_paths(scan: PredictedScan, rows: IntArray, measured: FloatArray, reach: float) -> IntArray:
    """Return the path of the echo that is nearest to each measured range, (k,) int; -1: none within `reach` (m).

    `rows` (k,) are headings of the scan, and `measured` (k,) the ranges there, m. The echoes are those of
    `PredictedPing.echoes`.
    """
    if scan.only_at is not None or scan.paths.scattered.any():
        return _one_by_one(scan, rows, measured, reach)
    board, lengths = scan.board, scan.apparent_lengths
    span = board.wavelength(scan.room.air) if board.sum_arrivals else -1.0
    sought = Sought(measured, reach, lengths, board.reported(lengths / 2), scan.in_time, span)
    headings = scan.headings[rows]
    return np.asarray(
        nearest_detected(headings, paths_and_beam(scan, headings, slice(None), scan.all_together), sought)
    )


def _one_by_one(scan: PredictedScan, rows: IntArray, measured: FloatArray, reach: float) -> IntArray:
    """Return `nearest_paths` where rough surfaces, or paths of one heading only, need the sound of every heading."""
    found = np.full(len(rows), -1, dtype=np.intp)
    for k, (row, distance) in enumerate(zip(rows.tolist(), measured.tolist(), strict=True)):
        echoes = scan.ping(row).echoes
        nearest = min(echoes, key=lambda echo: abs(echo.range - distance), default=None)
        if nearest is not None and abs(nearest.range - distance) <= reach:
            found[k] = nearest.path
    return found
