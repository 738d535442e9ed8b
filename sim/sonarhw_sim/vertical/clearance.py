"""Which paths of the plan sound can take at the heights that it has on its way: what it touches and passes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.weighing import BoolArray
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.vertical.level_sequences import LevelSequence
from sonarhw_sim.vertical.plan import Plan

_AT_END = 1e-8  # m: a surface that touches a leg this near to its end is the one on which it starts or ends
_INSIDE = 1e-7  # m: a leg this deep in a post crosses it
_ON_END = 1e-9  # m: a surface is touched this far beyond its upper or lower end


@dataclass(frozen=True)
class Courses:
    """The ways of paths in the plan: how far along each are its points, and the low surfaces that it passes."""

    plan: Plan
    paths: Paths
    at: FloatArray  # (n, p), m: length in the plan up to each point, NaN where there is none
    met: IntArray  # (n, p): the surface touched at each point; -1: none
    rows: NDArray[np.intp]  # (c,): path of each passage
    passed: IntArray  # (c,): surface
    begins: FloatArray  # (c,), m: length in the plan where the passage begins
    ends: FloatArray  # (c,), m

    def clear(self, sequence: LevelSequence, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those of these rows that touch all their surfaces, and pass the others, at the heights of sound."""
        if self.plan.passing is None:
            return rows
        slopes = sequence.climb / self.paths.lengths
        return rows[self._touching(sequence, rows, slopes) & ~self._blocked(sequence, slopes)[rows]]

    def _touching(self, sequence: LevelSequence, rows: NDArray[np.intp], slopes: FloatArray) -> BoolArray:
        heights = sequence.heights_at(np.nan_to_num(self.at[rows]) * slopes[rows, None])
        # surface -1, "none", selects the last
        lower, upper = np.vstack((self.plan.room.heights, [-np.inf, np.inf])).T[:, self.met[rows]]
        touching = np.all((lower - _ON_END <= heights) & (heights <= upper + _ON_END), axis=1)
        bent = np.flatnonzero(self.paths.edges[rows] >= 0)
        edges = self.paths.edges[rows[bent]]
        touching[bent] &= self.plan.edges_exist(edges, heights[bent, self.paths.bends[rows[bent]] + 1])
        return np.asarray(touching)

    def _blocked(self, sequence: LevelSequence, slopes: FloatArray) -> BoolArray:
        """Return which paths meet a surface that they should pass, (n,) bool."""
        begins, ends = self.begins * slopes[self.rows], self.ends * slopes[self.rows]
        first, last = sequence.heights_at(begins), sequence.heights_at(ends)
        lowest, highest = np.minimum(first, last), np.maximum(first, last)
        for climbed, height in zip(sequence.climbs[1:-1], sequence.heights[1:-1], strict=True):
            within = (begins < climbed) & (climbed < ends)
            lowest, highest = (
                np.where(within, np.minimum(lowest, height), lowest),
                np.where(within, np.maximum(highest, height), highest),
            )
        lower, upper = self.plan.room.heights[self.passed].T
        blocked = np.zeros(len(self.paths), np.bool_)
        blocked[self.rows[(highest >= lower) & (lowest <= upper)]] = True
        return blocked


def courses_of(plan: Plan, paths: Paths) -> Courses:
    """Return the ways of paths in the plan."""
    legs = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), -1, 0))
    at = np.hstack((np.zeros((len(paths), 1)), np.cumsum(legs, axis=1)))
    met = np.full(at.shape, -1, np.int32)
    row, touch = np.nonzero(paths.surfaces >= 0)
    met[row, touch + 1 + ((paths.edges[row] >= 0) & (touch >= paths.bends[row]))] = paths.surfaces[row, touch]
    low = [] if plan.passing is None else np.flatnonzero(plan.passing.low).tolist()
    row, leg = np.nonzero(np.isfinite(legs) & (legs > 2 * _AT_END))
    starts, lengths = paths.points[row, leg], legs[row, leg]
    courses = (paths.points[row, leg + 1] - starts) / lengths[:, None]
    crossed = [_crossed(plan, surface, starts, courses, lengths) for surface in low]
    which = np.concatenate([np.empty(0, np.intp), *(rows for rows, _, _ in crossed)])
    before = at[row, leg][which]
    return Courses(
        plan,
        paths,
        at,
        met,
        row[which],
        np.repeat(np.array(low, np.int32), [len(rows) for rows, _, _ in crossed]),
        before + np.concatenate([np.empty(0), *(begins for _, begins, _ in crossed)]),
        before + np.concatenate([np.empty(0), *(ends for _, _, ends in crossed)]),
    )


def _crossed(
    plan: Plan, surface: int, starts: FloatArray, courses: FloatArray, lengths: FloatArray
) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Return which legs (l,) cross a surface, and where along them this begins and ends, (c,) m."""
    walls, posts = plan.room.walls, plan.room.posts
    if surface >= len(walls):
        x, y, radius = posts[surface - len(walls)]
        ahead = ((np.array([x, y]) - starts) * courses).sum(axis=1)
        nearest = starts + np.clip(ahead, 0.0, lengths)[:, None] * courses
        rows = np.flatnonzero(np.hypot(*(nearest - [x, y]).T) < radius - _INSIDE)
        aside = np.hypot(*(starts + ahead[:, None] * courses - [x, y])[rows].T)
        half = np.sqrt(radius**2 - aside**2)
        return rows, np.maximum(ahead[rows] - half, 0.0), np.minimum(ahead[rows] + half, lengths[rows])
    (x, y), along = walls[surface, :2], walls[surface, 2:] - walls[surface, :2]
    across = courses[:, 0] * along[1] - courses[:, 1] * along[0]
    aslant = across != 0.0
    across = np.where(aslant, across, 1.0)
    rx, ry = x - starts[:, 0], y - starts[:, 1]
    ahead = (rx * along[1] - ry * along[0]) / across
    share = (rx * courses[:, 1] - ry * courses[:, 0]) / across
    crosses = aslant & (ahead > _AT_END) & (ahead < lengths - _AT_END) & (share >= -1e-12) & (share <= 1 + 1e-12)
    rows = np.flatnonzero(crosses)
    return rows, ahead[rows], ahead[rows]
