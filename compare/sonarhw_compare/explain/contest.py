"""Margins of the first echo: the changes of threshold or walls after which another echo would be reported.

The first echo over the detection threshold wins. When the threshold rises above the level of the winner, the next later
and louder echo wins. A step is one winner and the interval of thresholds in which it wins. Levels are those of the
carrier. The board's own receiver also detects the edges of a burst, so its margins differ slightly.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.predict.predicted_scan import Echo, PredictedPing, PredictedScan

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import TOLERANCE

_SAME_LENGTH = 1e-6  # m, for a path and its reverse


@dataclass(frozen=True)
class Step:
    """One winner and the thresholds with which it wins."""

    path: int  # the loudest of its arrival
    range: float  # m, as reported by the board
    level_db: float  # of its arrival, the highest threshold with which it wins
    above_db: float  # it wins above this, the level of the loudest earlier echo; -inf without one


@dataclass(frozen=True)
class Contest:
    """The winner at one heading, and the echoes that would win instead."""

    winner: Step | None  # None: no echo is detected
    margin_db: float | None  # level of the winner minus the threshold
    louder: Step | None  # winner with a threshold above that margin; None: no echo
    fainter: Step | None  # winner with a lower threshold: earlier, but not detected
    lacking_db: float | None  # threshold minus the level of `fainter`
    next: Echo | None  # the next detected echo after the winner
    behind: float | None  # m, its range minus that of the winner


@dataclass(frozen=True)
class WallChange:
    """The smallest shift of one wall after which a later echo becomes the first."""

    wall: str
    nearer: float  # m, along its normal towards the sensor; negative: away from it
    echo: Echo  # the new winner


def contest(prediction: PredictedScan, index: int) -> Contest:
    """Return the winner at heading `index` and the echoes that would win instead."""
    threshold, ping = prediction.board.threshold_db, prediction.ping(index)
    all_steps = steps(ping)
    row = next((k for k, step in enumerate(all_steps) if step.level_db >= threshold), len(all_steps))
    winner = all_steps[row] if row < len(all_steps) else None
    fainter = all_steps[row - 1] if row > 0 else None
    later = [echo for echo in ping.echoes if winner is not None and echo.range > winner.range]
    return Contest(
        winner,
        None if winner is None else winner.level_db - threshold,
        all_steps[row + 1] if row + 1 < len(all_steps) else None,
        fainter,
        None if fainter is None else threshold - fainter.level_db,
        later[0] if later else None,
        later[0].range - winner.range if later and winner is not None else None,
    )


def steps(ping: PredictedPing) -> tuple[Step, ...]:
    """Return each echo of a ping that wins with some threshold, nearest and faintest first."""
    lengths, levels, loudest = ping.scan.apparent_lengths, ping.levels, ping.loudest
    rows = np.flatnonzero(ping.scan.in_time & np.isfinite(levels))
    rows = rows[np.argsort(lengths[rows], kind="stable")]
    before = np.maximum.accumulate(np.append(-math.inf, levels[rows]))[:-1]
    records = rows[levels[rows] > before]
    ranges = ping.scan.board.reported(ping.arrival_lengths[records] / 2)
    above = before[levels[rows] > before]
    return tuple(
        Step(int(loudest[first]), float(distance), float(levels[first]), float(least))
        for first, distance, least in zip(records, ranges, above, strict=True)
    )


def change_for(prediction: PredictedScan, index: int, measured: float | None) -> float | None:
    """Return the change of the threshold (dB) with which the prediction matches the measured range.

    `measured` is in m, None for no echo. The result is 0 if they match already, and None if no threshold achieves it.
    """
    threshold, all_steps = prediction.board.threshold_db, steps(prediction.ping(index))
    if measured is None:
        return max(0.0, all_steps[-1].level_db - threshold) if all_steps else 0.0
    wanted = [step for step in all_steps if abs(step.range - measured) <= TOLERANCE]
    changes = [_into(threshold, step.above_db, step.level_db) for step in wanted]
    return min(changes, key=abs, default=None)


def _into(threshold: float, above: float, upto: float) -> float:
    """Return the change of `threshold` into the interval from `above` to `upto`."""
    if threshold > upto:
        return upto - threshold
    return max(0.0, above - threshold)


def wall_change(prediction: PredictedScan, index: int) -> WallChange | None:
    """Return the smallest shift of one wall, with its corners, after which another echo wins at heading `index`.

    None without such a wall. See `wall_changes` for the limits.
    """
    return min(wall_changes(prediction, index), key=lambda change: abs(change.nearer), default=None)


def wall_changes(prediction: PredictedScan, index: int) -> tuple[WallChange, ...]:
    """Return the smallest shift of one wall after which each later echo overtakes the winner at heading `index`.

    The result is correct to first order in the shift. Levels are assumed not to change, and sums of arrivals are
    ignored, so it may be wrong by half a wavelength. Diffracted echoes, those with the same length as the winner, and
    those that no shift within range helps are left out. Empty without a winner, or if the winner is diffracted.
    """
    winner, paths, lengths = int(prediction.winners[index]), prediction.paths, prediction.apparent_lengths
    if winner < 0 or paths.edges[winner] >= 0:
        return ()
    straight = [echo for echo in prediction.ping(index).echoes if paths.edges[echo.path] < 0]
    later = [echo for echo in straight if lengths[echo.path] - lengths[winner] > _SAME_LENGTH]
    rows = np.array([winner, *(echo.path for echo in later)], dtype=np.intp)
    growth = _growth(prediction, rows)
    with np.errstate(divide="ignore"):
        moves = (lengths[rows[1:]] - lengths[winner])[:, None] / (growth[:1] - growth[1:])
    walls = np.abs(moves).argmin(axis=1) if moves.size else np.empty(0, dtype=np.intp)
    return tuple(
        WallChange(prediction.room.names[wall], float(move[wall]), echo)
        for echo, move, wall in zip(later, moves, walls.tolist(), strict=True)
        if abs(move[wall]) < prediction.board.max_range
    )


def _growth(prediction: PredictedScan, rows: NDArray[np.intp]) -> FloatArray:
    """Return the derivative of path lengths by the shift of each wall towards the sensor, (rows, walls)."""
    # these imports take half a second, which would delay the start of the window
    from sonarhw_compare.fit.likelihood.echo_paths import echo_paths, growth_by_wall
    from sonarhw_compare.fit.values.free_walls import left_normals

    room = prediction.room
    paths = echo_paths(prediction.paths.select(rows), room, [], list(room.names[: len(room.walls)]))
    away = np.array(prediction.place.position) - room.walls[:, :2]
    return np.asarray(growth_by_wall(paths) * np.where((left_normals(room.walls) * away).sum(axis=1) > 0, 1.0, -1.0))
