"""The predicted echo nearest to a measured range, at many headings at once."""

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.weighing import Candidates, Sought, beam_table, nearest_detected
from sonarhw_sim.predict.levels import strengths
from sonarhw_sim.predict.predicted_scan import PredictedScan

IntArray = NDArray[np.intp]


def nearest_paths(scan: PredictedScan, rows: IntArray, measured: FloatArray, reach: float) -> IntArray:
    """Return the path of the echo that is nearest to each measured range, (k,) int; -1: none within `reach` (m).

    `rows` (k,) are headings of the scan, and `measured` (k,) the ranges there, m. The echoes are those of
    `PredictedPing.echoes`.
    """
    if scan.only_at is not None or scan.paths.scattered.any():
        return _one_by_one(scan, rows, measured, reach)
    room, board, paths = scan.room, scan.board, scan.paths
    headings, lengths = scan.headings[rows], scan.apparent_lengths
    ka, span = board.wavenumber(room.air) * board.aperture_radius, board.wavelength(room.air)
    candidates = Candidates(
        paths.leaving,
        paths.arriving,
        strengths(room, board, paths),
        scan.all_together,
        scan.blocked_by_face(paths, headings),
        10 ** (board.threshold_db / 20),
        ka,
        beam_table(ka),
    )
    ranges = board.reported(lengths / 2)
    sought = Sought(measured, reach, lengths, ranges, scan.in_time, span if board.sum_arrivals else -1.0)
    return np.asarray(nearest_detected(headings, candidates, sought))


def _one_by_one(scan: PredictedScan, rows: IntArray, measured: FloatArray, reach: float) -> IntArray:
    """Return `nearest_paths` where rough surfaces, or paths of one heading only, need the sound of every heading."""
    found = np.full(len(rows), -1, dtype=np.intp)
    for k, (row, distance) in enumerate(zip(rows.tolist(), measured.tolist(), strict=True)):
        echoes = scan.ping(row).echoes
        nearest = min(echoes, key=lambda echo: abs(echo.range - distance), default=None)
        if nearest is not None and abs(nearest.range - distance) <= reach:
            found[k] = nearest.path
    return found
