"""Where to begin: every position of a lattice and every heading, scored roughly, the best ones handed on.

Takes a scan, a room and a board; hands on log-likelihoods (positions, headings), and their best maxima. At each
position a few hundred rays find the paths of few reflections, once; from those comes what the first echo would be at
each of 180 headings, and against that table the scan is laid in all its turns.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.weighing import beam, beam_table
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.levels import is_blanked, strengths
from sonarhw_sim.predict.prediction import PredictionOptions, search_for
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.sections import paths_from

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import Heard

HEADINGS = 180  # tried all round: 2° apart
QUICK = PredictionOptions(rays=720, max_bounces=3)
_POSITIONS = 600  # of a lattice, about
_FINEST = 0.06  # m, from one to the next
_CANDIDATES = 4  # echoes a heading may have
_SOFT = 4.0  # dB: how sharp the threshold is in a rough score
_HARDLY = 0.02  # chance under which an echo is no candidate
_STRAY = 0.05  # likelihood of a reading that no candidate explains, where a perfect one has 1
_LOST = 0.05
_APART = math.radians(15)


@dataclass(frozen=True)
class Scores:
    """How well a scan agrees with a room from each position and heading."""

    positions: FloatArray  # (p, 2), m
    headings: FloatArray  # (h,), rad
    scores: FloatArray  # (p, h), natural logarithms; -inf where no sound comes back
    spacing: float  # m, from one position to the next


def lattice(lower: tuple[float, float], upper: tuple[float, float]) -> tuple[FloatArray, float]:
    """Positions (p, 2) all over a rectangle, some 600 and no nearer than 6 cm, and their spacing, m."""
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
    scan: Heard,
    room: Room,
    board: Board,
    positions: FloatArray,
    spacing: float,
    height: float | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Scores:
    """The scan held against the room from each of `positions` (p, 2); `tick` is called for each that is done.

    An error of half the spacing costs little. Positions from which no sound comes back score -inf.
    """
    headings = np.arange(HEADINGS, dtype=np.float64) * (math.tau / HEADINGS)
    scores = np.full((len(positions), HEADINGS), -math.inf)
    first = scan.ranges[:, 0]
    farthest = min(board.max_range, float(np.nanmax(first, initial=0.0)) + 3 * spacing)
    search = replace(search_for(room, board, QUICK), max_length=2 * farthest)
    ka = board.wavenumber(room.air) * board.aperture_radius
    bins = np.round(scan.angles * (HEADINGS / math.tau)).astype(np.int64) % HEADINGS
    width = max(0.7 * spacing, 0.03)
    for row, (x, y) in enumerate(positions.tolist()):
        tick()
        paths = paths_from(room, Place("", (x, y), height=height), search, None, board.aperture_radius)
        paths = paths.select(np.flatnonzero(~is_blanked(paths.lengths, board, room)))
        if len(paths):
            level = 20 * np.log10(np.maximum(strengths(room, board, paths), 1e-12)) - board.threshold_db
            told = paths.lengths / 2 + board.range_offset
            table = _candidates(headings, paths.leaving, paths.arriving, level, ka, beam_table(ka))
            scores[row] = _score(first, bins, told, *table, width)
    return Scores(positions, headings, scores, spacing)


@compiled
def _candidates(
    headings: FloatArray, leaving: FloatArray, arriving: FloatArray, level: FloatArray, ka: float, table: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """The paths that may be heard first at each heading (h, c), -1 behind; the chance of each (h, c); of none (h,)."""
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
    told: FloatArray,
    chosen: NDArray[np.int64],
    chances: FloatArray,
    silent: FloatArray,
    width: float,
) -> FloatArray:
    """Log-likelihood of a scan in each of its turns, (h,)."""
    count = chosen.shape[0]
    scores = np.zeros(count)
    for i in range(ranges.shape[0]):
        for h in range(count):
            likelihood = _LOST + (1.0 - _LOST) * silent[h] if math.isnan(ranges[i]) else _STRAY
            for c in range(_CANDIDATES):
                if chosen[h, c] < 0 or math.isnan(ranges[i]):
                    break
                away = (ranges[i] - told[chosen[h, c]]) / width
                likelihood += chances[h, c] / (1.0 + away * away)
            scores[(h - bins[i]) % count] += math.log(likelihood)
    return scores


def maxima(scores: Scores, most: int) -> list[tuple[float, float, float]]:
    """The best positions and headings (x, y, rad), none within 2.5 spacings and 15° of a better one, at most `most`."""
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
