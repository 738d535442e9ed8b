"""Headings, places and turntable scale to begin a calibration with, by a search for the most matching readings."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.board.mount import ON_AXIS, without_own_body
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import Place, Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.plain_fit import all_round, best_agreement, places_near
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.matching.regions import angles_and_ranges

SCALES = np.arange(0.90, 1.141, 0.01)
_LOUDER_DB = 2.0  # by so much the threshold is lowered, because geometry shows in echoes, and not in silence
_FREE = frozenset({"heading", "offset"})


@dataclass(frozen=True)
class StartingTurntable:
    """Where the calibration begins."""

    scale: float
    headings: tuple[float, ...]  # rad, actual one of the turntable's zero, of each scan
    places: tuple[Place, ...]  # within 3 cm of those given


def starting_turntable(
    scans: Sequence[PlacedScan], room: Room, board: Board, tick: Callable[[float], None] = lambda _share: None
) -> StartingTurntable:
    """Return the scale, shared by all scans, and the pose of each with which most of their echoes match."""
    # a face beside the axis would need a search for paths at every heading; the range offset stands for it
    plain = replace(board, mount=ON_AXIS, threshold_db=board.threshold_db - _LOUDER_DB)
    scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    tables = [predict_scan(room, scan.place, plain, all_round()).ranges for scan in scans]
    scales = board.turntable_scale * SCALES
    counts = []
    for scale in scales.tolist():
        turned = replace(plain, turntable_scale=scale)
        counts.append(sum(_matching(scan, table, turned) for scan, table in zip(scans, tables, strict=True)))
    # the best of neighbours together: single counts are noisy. The present scale wins ties.
    smooth = np.convolve(np.pad(np.array(counts), 1, mode="edge"), np.ones(3) / 3, mode="valid")
    ahead = np.abs(SCALES - 1.0) * 1e-6
    scale = float(scales[int((smooth - ahead).argmax())])
    turned = replace(plain, turntable_scale=scale)
    fits = []
    for k, scan in enumerate(scans):
        tick(k / len(scans))
        near = ((place, predict_scan(room, place, turned, all_round()).ranges) for place in places_near(scan.place))
        fits.append(best_agreement(scan.readings, near, _FREE | {"position"}, turned))
    return StartingTurntable(scale, tuple(fit.heading for fit in fits), tuple(fit.place for fit in fits))


def _matching(scan: PlacedScan, table: FloatArray, board: Board) -> int:
    """Return the number of readings that match at the best heading and offset."""
    fit = best_agreement(scan.readings, [(scan.place, table)], _FREE, board)
    angles, measured = angles_and_ranges(scan.readings)
    rows = np.round((fit.heading + board.turned(angles)) * (len(table) / math.tau)).astype(np.intp) % len(table)
    return int((np.abs(measured + fit.offset - table[rows]) <= TOLERANCE).sum())
