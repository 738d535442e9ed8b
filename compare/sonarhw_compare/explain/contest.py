"""The contest of echoes: which wins at a heading, by what margin, and what would have to change for another to win.

Takes a prediction and a heading; hands on the steps of its contest. The first echo over the threshold is reported. So
as the threshold rises, the winner stays until its own level, and then the next later echo that is louder takes over:
each step is one winner and the thresholds between which it wins. Levels are those of the carrier; the board's own
receiver also hears the edges of a burst, and its margins differ a little.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan
from sonarhw_sim.rays.paths import SLACK

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import TOLERANCE

_SAME_LENGTH = 1e-6  # m: a way and the same way back


@dataclass(frozen=True)
class Step:
    """One winner, and the thresholds with which it wins."""

    path: int
    range: float  # m, as the board would report it
    level_db: float  # wins with thresholds up to this
    above_db: float  # and over this, the level of the loudest that comes before; -inf where nothing does


@dataclass(frozen=True)
class Contest:
    """Who wins at one heading, and who would."""

    winner: Step | None  # None: silence
    margin_db: float | None  # by how much the winner is over the threshold
    louder: Step | None  # who wins as soon as the threshold rises by that margin; None: nobody, silence
    fainter: Step | None  # who would win were the threshold lower: earlier, but not heard
    lacking_db: float | None  # by how much lower for it
    next: Echo | None  # the first audible echo behind the winner
    behind: float | None  # m, by how much


@dataclass(frozen=True)
class WallChange:
    """The least move of one wall with which a later echo overtakes the winner."""

    wall: str
    nearer: float  # m, along its normal towards the sensor; below 0 farther
    echo: Echo  # who wins then


def contest(prediction: PredictedScan, index: int) -> Contest:
    """The contest at heading `index`."""
    threshold = prediction.board.threshold_db
    heard = steps(prediction, index)
    row = next((k for k, step in enumerate(heard) if step.level_db >= threshold), len(heard))
    winner = heard[row] if row < len(heard) else None
    fainter = heard[row - 1] if row > 0 else None
    later = [echo for echo in prediction.echoes(index) if winner is not None and echo.range > winner.range]
    return Contest(
        winner,
        None if winner is None else winner.level_db - threshold,
        heard[row + 1] if row + 1 < len(heard) else None,
        fainter,
        None if fainter is None else threshold - fainter.level_db,
        later[0] if later else None,
        later[0].range - winner.range if later and winner is not None else None,
    )


def steps(prediction: PredictedScan, index: int) -> tuple[Step, ...]:
    """Everyone who wins at heading `index` with some threshold, nearest and faintest first."""
    lengths, levels = prediction.apparent_lengths, prediction.levels_at(index)
    listened = ~prediction.blanked & (lengths <= 2 * prediction.board.max_range + SLACK) & np.isfinite(levels)
    rows = np.flatnonzero(listened)
    rows = rows[np.argsort(lengths[rows], kind="stable")]
    before = np.maximum.accumulate(np.append(-math.inf, levels[rows]))[:-1]
    records = rows[levels[rows] > before]
    ranges = prediction.board.reported(lengths[records] / 2)
    above = before[levels[rows] > before]
    return tuple(
        Step(int(path), float(distance), float(levels[path]), float(least))
        for path, distance, least in zip(records, ranges, above, strict=True)
    )


def change_for(prediction: PredictedScan, index: int, measured: float | None) -> float | None:
    """By how much (dB) the threshold would have to change for the model to say what was measured.

    `measured` is a range (m), None silence. 0 where it says so; None where no threshold makes it.
    """
    threshold, heard = prediction.board.threshold_db, steps(prediction, index)
    if measured is None:
        return max(0.0, heard[-1].level_db - threshold) if heard else 0.0
    wanted = [step for step in heard if abs(step.range - measured) <= TOLERANCE]
    changes = [_into(threshold, step.above_db, step.level_db) for step in wanted]
    return min(changes, key=abs, default=None)


def _into(threshold: float, above: float, upto: float) -> float:
    """What is missing from `threshold` to lie over `above` and no higher than `upto`."""
    if threshold > upto:
        return upto - threshold
    return max(0.0, above - threshold)


def wall_change(prediction: PredictedScan, index: int) -> WallChange | None:
    """The least move of one wall, corners staying corners, after which another echo wins at heading `index`.

    To first order in the move, with levels as they are. Echoes that an edge bends, or that no wall parts from the
    winner, are left out; None where nobody is left, or where the winner is silence or itself bent.
    """
    winner, paths, lengths = int(prediction.winners[index]), prediction.paths, prediction.apparent_lengths
    if winner < 0 or paths.edges[winner] >= 0:
        return None
    straight = [echo for echo in prediction.echoes(index) if paths.edges[echo.path] < 0]
    later = [echo for echo in straight if lengths[echo.path] - lengths[winner] > _SAME_LENGTH]
    rows = np.array([winner, *(echo.path for echo in later)], dtype=np.intp)
    growth = _growth(prediction, rows)
    with np.errstate(divide="ignore"):
        moves = (lengths[rows[1:]] - lengths[winner])[:, None] / (growth[:1] - growth[1:])
    if not (np.abs(moves) < prediction.board.max_range).any():
        return None
    row, wall = np.unravel_index(np.abs(moves).argmin(), moves.shape)
    return WallChange(prediction.room.names[wall], float(moves[row, wall]), later[row])


def _growth(prediction: PredictedScan, rows: NDArray[np.intp]) -> FloatArray:
    """By how much paths grow for every metre that a wall moves towards the sensor, (rows, walls)."""
    # what comes along takes half a second, at the start of the window
    from sonarhw_compare.fit.likelihood.echo_paths import echo_paths, growth_by_wall
    from sonarhw_compare.fit.values.free_walls import left_normals

    room = prediction.room
    paths = echo_paths(prediction.paths.select(rows), room, [], list(room.names[: len(room.walls)]))
    away = np.array(prediction.place.position) - room.walls[:, :2]
    return np.asarray(growth_by_wall(paths) * np.where((left_normals(room.walls) * away).sum(axis=1) > 0, 1.0, -1.0))
