"""Headings, places, turntable scale and threshold to begin a calibration with: those that most readings match."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from sonarhw_sim.board.profile import ON_AXIS, Board, without_own_body
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.plain_fit import all_round, best_agreement, places_near
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.known_room.detection_rule import best_pairs
from sonarhw_compare.matching.block_bootstrap import drawn_blocks
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.matching.regions import angles_and_ranges, mean_run

SCALES = np.arange(0.90, 1.141, 0.01)
# tried with each scale, dB: a sensor that hears more sees wider arcs, as a turntable does that turns less than it says
_THRESHOLDS = (-6.0, -4.5, -3.0, -1.5, 0.0, 1.5, 3.0, 4.5, 6.0)
_FREE = frozenset({"heading", "offset"})


@dataclass(frozen=True)
class StartingTurntable:
    """Where the calibration begins."""

    scale: float
    scale_deviation: float  # from a bootstrap of blocks of readings
    threshold_db: float
    places: tuple[Place, ...]  # within 3 cm of those given; the heading is the actual one of the turntable's zero


def starting_turntable(
    scans: Sequence[PlacedScan], room: Room, board: Board, tick: Callable[[float], None]
) -> StartingTurntable:
    """Return scale and threshold, shared by all scans, and the pose of each with which most of their echoes match."""
    # a face beside the axis would need a search for paths at every heading; the range offset stands for it
    plain = replace(board, mount=ON_AXIS)
    scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    boards = [replace(plain, threshold_db=board.threshold_db + change) for change in _THRESHOLDS]
    matches = np.array([_matches(scans, room, one) for one in boards])
    row, column = _best(matches, np.ones((1, matches.shape[2])))[0]
    scales = board.turntable_scale * SCALES
    redundancy = float(np.mean([mean_run(*angles_and_ranges(scan.readings)) for scan in scans]))
    drawn = _best(matches, drawn_blocks(matches.shape[2], redundancy, np.random.default_rng(0)))
    deviation = math.hypot(float(np.std(scales[[k for _, k in drawn]])), SCALES[1] - SCALES[0])
    plain, scale = boards[row], float(scales[column])
    turned = replace(plain, turntable_scale=scale)
    fits = []
    for k, scan in enumerate(scans):
        tick(k / len(scans))
        near = ((place, predict_scan(room, place, turned, all_round()).ranges) for place in places_near(scan.place))
        fits.append(best_agreement(scan.readings, near, _FREE | {"position"}, turned))
    return StartingTurntable(scale, deviation, plain.threshold_db, tuple(fit.place for fit in fits))


def _matches(scans: Sequence[PlacedScan], room: Room, board: Board) -> BoolArray:
    """Return whether each of the r readings of all scans matches with each of SCALES, (scales, r)."""
    tables = [predict_scan(room, scan.place, board, all_round()).ranges for scan in scans]
    boards = [replace(board, turntable_scale=board.turntable_scale * scale) for scale in SCALES.tolist()]
    return np.array(
        [
            np.concatenate([_matching(scan, table, one) for scan, table in zip(scans, tables, strict=True)])
            for one in boards
        ]
    )


def _best(matches: BoolArray, weights: FloatArray) -> list[tuple[int, int]]:
    """Return threshold and scale (rows) with the most matches, for each row of `weights` (w, r) of the readings."""
    counts = np.einsum("wr,tsr->wts", weights, matches, optimize=True)
    # single counts are noisy: the best of three neighbours together. The present values win ties.
    smooth = uniform_filter1d(counts, 3, axis=2, mode="nearest")
    smooth -= np.add.outer(np.abs(_THRESHOLDS), np.abs(SCALES - 1.0)) * 1e-6
    return best_pairs(smooth)


def _matching(scan: PlacedScan, table: FloatArray, board: Board) -> BoolArray:
    """Return whether each reading matches at the heading and offset with the most matches."""
    fit = best_agreement(scan.readings, [(scan.place, table)], _FREE, board)
    angles, measured = angles_and_ranges(scan.readings)
    rows = np.round((fit.heading + board.turned(angles)) * (len(table) / math.tau)).astype(np.intp) % len(table)
    return np.asarray(np.abs(measured + fit.offset - table[rows]) <= TOLERANCE)
