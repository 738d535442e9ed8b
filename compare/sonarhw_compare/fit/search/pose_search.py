"""Rough log-likelihood of a scan at every position of a lattice and every heading, and its best poses.

At each position, a few hundred rays find the paths with few reflections. These paths give the candidates for the first
echo at each of 180 headings. The scan is compared with this table in all 180 rotations.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from sonarhw_sim.board.beam import beam, beam_table
from sonarhw_sim.board.profile import Board
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.predicted_scan import is_blanked, strengths
from sonarhw_sim.predict.prediction import PredictionOptions, search_for
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.space.sections import paths_from

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ScanArrays
from sonarhw_compare.fit.likelihood.echo_paths import with_reverses
from sonarhw_compare.fit.likelihood.rough_paths import with_summed_patches

HEADINGS = 180  # 2° apart
QUICK = PredictionOptions(rays=720, max_bounces=3)
_POSITIONS = 600  # in a lattice, about
_FINEST = 0.06  # m, smallest spacing
_CANDIDATES = 4  # echoes of one heading, at most
_SOFT = 4.0  # dB, width of the detection threshold
_HARDLY = 0.02  # smallest detection probability of a candidate
_STRAY = 0.05  # likelihood of a reading without a matching candidate; an exact match has 1
_LOST = 0.05  # likelihood of no echo where one is certain
_APART = math.radians(15)  # between chosen poses
_FAR_APART = math.radians(45)  # between local maxima


@dataclass(frozen=True)
class Scores:
    """Log-likelihoods of a scan by position and heading."""

    positions: FloatArray  # (p, 2), m
    headings: FloatArray  # (h,), rad
    scores: FloatArray  # (p, h), natural logarithms; -inf without any path
    spacing: float  # m, between positions


def lattice(lower: tuple[float, float], upper: tuple[float, float]) -> tuple[FloatArray, float]:
    """Return a lattice in a rectangle, (p, 2) m, and its spacing, m: about 600 positions, at least 6 cm apart."""
    sides = np.array(upper) - lower
    spacing = max(
        _FINEST, math.sqrt(max(float(sides[0] * sides[1]), 0.0) / _POSITIONS), float(sides.max()) / _POSITIONS
    )
    xs, ys = (
        low + side * (np.arange(count) + 0.5) / count
        for low, side, count in ((lower[k], sides[k], max(1, math.ceil(sides[k] / spacing))) for k in range(2))
    )
    return np.array([(x, y) for x in xs for y in ys], dtype=np.float64), spacing


def score_positions(
    scan: ScanArrays,
    room: Room,
    board: Board,
    positions: FloatArray,
    spacing: float,
    height: float | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Scores:
    """Return the scores of a scan at each of `positions` (p, 2) of the turning axis; `tick` is called once for each.

    An error of half the spacing lowers the score little. Positions without any path score -inf.
    """
    headings = np.arange(HEADINGS, dtype=np.float64) * (math.tau / HEADINGS)
    scores = np.full((len(positions), HEADINGS), -math.inf)
    first = np.ascontiguousarray(scan.ranges[:, 0])  # one type of array, so one kernel
    farthest = min(board.max_range, float(np.nanmax(first, initial=0.0)) + 3 * spacing)
    # scores weigh each path alone, so they need no faint paths that are loud together
    search = replace(search_for(room, replace(board, sum_arrivals=False), QUICK), max_length=2 * farthest)
    ka = board.wavenumber(room.air) * board.aperture_radius
    bins = np.round(board.heading_at(scan.angles, 0.0) * (HEADINGS / math.tau)).astype(np.int64) % HEADINGS
    width = max(0.7 * spacing, 0.03)
    for row, (x, y) in enumerate(positions.tolist()):
        tick()
        paths = paths_from(room, Place("", (x, y), height=height), search, None, board.aperture_radius)
        paths = with_reverses(with_summed_patches(paths, room, board), board)
        paths = paths.select(np.flatnonzero(~is_blanked(paths.lengths, board, room)))
        if len(paths):
            level = 20 * np.log10(np.maximum(strengths(room, board, paths), 1e-12)) - board.threshold_db
            reported = board.unrounded(paths.lengths / 2)
            table = _candidates(headings, paths.leaving, paths.arriving, level, ka, beam_table(ka))
            scores[row] = _score(first, bins, reported, *table, width)
    return Scores(positions, headings, scores, spacing)


@compiled
def _candidates(
    headings: FloatArray, leaving: FloatArray, arriving: FloatArray, level: FloatArray, ka: float, table: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return candidates for the first echo (h, c), padded with -1, their probabilities, and those of no echo (h,)."""
    chosen = np.full((headings.shape[0], _CANDIDATES), -1, np.int64)
    chances, silent = np.zeros((headings.shape[0], _CANDIDATES)), np.ones(headings.shape[0])
    for h in range(headings.shape[0]):
        x, y = math.cos(headings[h]), math.sin(headings[h])
        found = 0
        for k in range(level.shape[0]):
            ahead, home = leaving[k, 0] * x + leaving[k, 1] * y, arriving[k, 0] * x + arriving[k, 1] * y
            if ahead <= 0.0 or home <= 0.0:
                continue
            amplitude = beam(ahead, ka, table) * beam(home, ka, table)
            over = level[k] + 20.0 * math.log10(max(amplitude, 1e-12))
            if over < -3.0 * _SOFT:
                continue
            chance = 1.0 / (1.0 + math.exp(-1.7 * over / _SOFT))
            if chance * silent[h] < _HARDLY:
                continue
            chosen[h, found], chances[h, found] = k, chance * silent[h]
            silent[h] *= 1.0 - chance
            found += 1
            if found == _CANDIDATES:
                break
    return chosen, chances, silent


@compiled
def _score(
    ranges: FloatArray,
    bins: NDArray[np.int64],
    reported: FloatArray,
    chosen: NDArray[np.int64],
    chances: FloatArray,
    silent: FloatArray,
    width: float,
) -> FloatArray:
    """Return the log-likelihood of a scan in each rotation, (h,)."""
    count = chosen.shape[0]
    scores = np.zeros(count)
    for i in range(ranges.shape[0]):
        for h in range(count):
            likelihood = _LOST + (1.0 - _LOST) * silent[h] if math.isnan(ranges[i]) else _STRAY
            for c in range(_CANDIDATES):
                if chosen[h, c] < 0 or math.isnan(ranges[i]):
                    break
                away = (ranges[i] - reported[chosen[h, c]]) / width
                likelihood += chances[h, c] / (1.0 + away * away)
            scores[(h - bins[i]) % count] += math.log(likelihood)
    return scores


def at_marks(board: Board, poses: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Return poses (x, y, heading rad) of the turning axis as those of the mark that a place stands for."""
    marks = []
    for x, y, heading in poses:
        dx, dy = board.at_axis(board.faced(Place("", (0.0, 0.0), heading))).position
        marks.append((x - dx, y - dy, heading))
    return marks


def best_apart(scores: Scores, most: int) -> list[tuple[float, float, float]]:
    """Return up to `most` poses (x, y, heading rad), best first, none within 2.5 spacings and 15° of a chosen one.

    They are starts for a search. Unlike `local_maxima`, they include poses on the slope of a better one, from which
    the search may climb elsewhere.
    """
    order = np.argsort(scores.scores, axis=None)[::-1]
    chosen: list[tuple[float, float, float]] = []
    for row, column in zip(*np.unravel_index(order[: 400 * most], scores.scores.shape), strict=True):
        if len(chosen) == most or not math.isfinite(scores.scores[row, column]):
            break
        (x, y), heading = scores.positions[row].tolist(), float(scores.headings[column])
        near = (
            math.hypot(x - a, y - b) < 2.5 * scores.spacing and abs(math.remainder(heading - c, math.tau)) < _APART
            for a, b, c in chosen
        )
        if not any(near):
            chosen.append((x, y, heading))
    return chosen


def local_maxima(scores: Scores, most: int, hopeless: float) -> list[tuple[float, float, float]]:
    """Return up to `most` poses (x, y, heading rad), best first, with no better one within 2.5 spacings and 45°.

    None is worse than the best by `hopeless` or more. They show in which other poses the scan fits, too.
    """
    width = 2 * round(_FAR_APART / (math.tau / scores.scores.shape[1])) + 1
    nearby = maximum_filter1d(scores.scores, width, axis=1, mode="wrap")
    least, found = float(scores.scores.max()) - hopeless, []
    for row, position in enumerate(scores.positions):
        near = np.hypot(*(scores.positions - position).T) < 2.5 * scores.spacing
        is_best = (scores.scores[row] == nearby[near].max(axis=0)) & (scores.scores[row] > least)
        found += [(float(scores.scores[row, column]), row, int(column)) for column in np.flatnonzero(is_best)]
    return [
        (*scores.positions[row].tolist(), float(scores.headings[column]))
        for _, row, column in sorted(found, reverse=True)[:most]
    ]
