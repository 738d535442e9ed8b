"""Maps from scans alone: walls, corners and edges from regions of constant depth, and an occupancy grid."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from sonarhw_sim.board.profile import Board
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.predict.prediction import CONE_HALF_ANGLE
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Room, parse_room

from sonarhw import arguments
from sonarhw.errors import counted, in_degrees
from sonarhw.readings import BoolArray, FloatArray, angle_difference
from sonarhw_compare.arcs import (
    CERTAIN,
    FARTHEST,
    Arc,
    ArcTable,
    arcs_of,
    common_lines,
    common_points,
    count_places,
    direction,
    headings_and_ranges,
    mappable,
    table_of,
)
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.match import compare_readings
from sonarhw_compare.rooms.draft import REFLECTANCE

# Occupancy grid from readings as cones (Moravec and Elfes, High Resolution Maps from Wide Angle Sonar, 1985).
#
# A reading raises the certainty that cells in front of its range within ±15° are empty, and that cells at its range
# are occupied. For multipath echoes, both are wrong. Readings without an echo are ignored, because an oblique wall
# returns none.


CELL = 0.02  # m
DEPTH = 0.05  # m, uncertainty of the range of a reading, to each side
_MARGIN = 0.2  # m around the farthest reading
_MOST_CELLS = 1200  # along a side
_RIM = math.tan(CONE_HALF_ANGLE)


@dataclass(frozen=True)
class CertaintyGrid:
    """Square cells, row by row from the lower left corner."""

    left: float  # m
    bottom: float  # m
    cell: float  # m
    empty: FloatArray  # (rows, columns), certainty 0..1 that a cell is empty
    occupied: FloatArray  # (rows, columns), certainty 0..1 that a cell is occupied

    @property
    def certainty(self) -> FloatArray:
        """The larger certainty (their eq. 7), (rows, columns): -1 is empty, 0 unknown, 1 occupied."""
        return np.where(self.occupied >= self.empty, self.occupied, -self.empty)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top, m."""
        rows, columns = self.empty.shape
        return self.left, self.left + columns * self.cell, self.bottom, self.bottom + rows * self.cell

    def at(self, points: FloatArray) -> FloatArray:
        """Return the certainty at points (n, 2) m, (n,); 0 outside."""
        column, row = np.floor((points - (self.left, self.bottom)) / self.cell).astype(int).T
        rows, columns = self.empty.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, self.certainty[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], 0.0)


def certainty_grid(
    scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray], cell: float | None = None
) -> CertaintyGrid:
    """Return the grid from all readings that are `kept` ((n,) bool for each scan), in cells of `cell` (m)."""
    positions, headings, ranges = _cones(scans, board, kept)
    ends = positions + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    corners = np.vstack((positions, ends, *(np.array([scan.place.position]) for scan in scans)))
    low, high = corners.min(axis=0) - _MARGIN, corners.max(axis=0) + _MARGIN
    cell = max(CELL, float((high - low).max()) / _MOST_CELLS) if cell is None else cell
    columns, rows = np.ceil((high - low) / cell).astype(int)
    empty, occupied = np.zeros((rows, columns)), np.zeros((rows, columns))
    # first all empty cells; occupied cells are then among the others (their section 4)
    for mark in (_mark_empty, _mark_occupied):
        for (x, y), heading, distance in zip(
            (positions - low).tolist(), headings.tolist(), ranges.tolist(), strict=True
        ):
            mark(empty, occupied, cell, x, y, heading, distance)
    most = occupied.max(initial=0.0)
    return CertaintyGrid(float(low[0]), float(low[1]), cell, empty, occupied / most if most else occupied)


def _cones(
    scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions (n, 2), headings (n,) and ranges (n,) of the readings with an echo."""
    positions, directions, distances = [], [], []
    for scan, wanted in zip(scans, kept, strict=True):
        headings, ranges = headings_and_ranges(scan, board)
        use = wanted & ~np.isnan(ranges)
        positions.append(standpoints(board, board.faced(scan.place), headings[use]))
        directions.append(headings[use])
        distances.append(ranges[use])
    return np.vstack(positions), np.concatenate(directions), np.concatenate(distances)


@compiled_part
def _window(shape: tuple[int, int], cell: float, x: float, y: float, reach: float) -> tuple[int, int, int, int]:
    """Return first and last row and column of the cells within reach of a point; the last ones are excluded."""
    low_row, high_row = int((y - reach) / cell), int((y + reach) / cell) + 1
    low_column, high_column = int((x - reach) / cell), int((x + reach) / cell) + 1
    return max(0, low_row), min(shape[0], high_row), max(0, low_column), min(shape[1], high_column)


@compiled_part
def _seen(cell: float, row: int, column: int, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return the distance of a cell, m, and the weight of the cone there: 1 on its axis, 0 from its rim on."""
    dx, dy = (column + 0.5) * cell - x, (row + 0.5) * cell - y
    ahead, aside = dx * math.cos(heading) + dy * math.sin(heading), dy * math.cos(heading) - dx * math.sin(heading)
    if ahead <= 0.0 or abs(aside) >= ahead * _RIM:
        return 0.0, 0.0
    return math.hypot(ahead, aside), 1.0 - (math.atan2(aside, ahead) / CONE_HALF_ANGLE) ** 2


@compiled
def _mark_empty(
    empty: FloatArray, _occupied: FloatArray, cell: float, x: float, y: float, heading: float, distance: float
) -> None:
    """Raise the certainty of empty cells in front of the range; x, y are in m from the corner of the grid."""
    before = distance - DEPTH
    first_row, last_row, first_column, last_column = _window(empty.shape, cell, x, y, before)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            away, share = _seen(cell, row, column, x, y, heading)
            if share > 0.0 and away < before:
                empty[row, column] += share * (1.0 - (away / before) ** 2) * (1.0 - empty[row, column])


@compiled
def _mark_occupied(
    empty: FloatArray, occupied: FloatArray, cell: float, x: float, y: float, heading: float, distance: float
) -> None:
    """Raise the certainty of occupied cells at the range. One object made the echo, so its arc adds 1 in all."""
    first_row, last_row, first_column, last_column = _window(empty.shape, cell, x, y, distance + DEPTH)
    certainties = np.zeros((max(0, last_row - first_row), max(0, last_column - first_column)))
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            away, share = _seen(cell, row, column, x, y, heading)
            off = (away - distance) / DEPTH
            if share > 0.0 and abs(off) < 1.0:
                certainties[row - first_row, column - first_column] = (
                    share * (1.0 - off**2) * (1.0 - empty[row, column])
                )
    whole = certainties.sum()
    if whole > 0.0:
        for row in range(first_row, last_row):
            for column in range(first_column, last_column):
                more = certainties[row - first_row, column - first_column] / whole
                occupied[row, column] += more * (1.0 - occupied[row, column])


# Walls, corners and edges that arcs from several places agree on.
#
# The lines and points that two arcs have in common are compared with all arcs, and the best supported ones are accepted
# first.


CONFIRMING = 3  # places that must agree on a feature; two places always agree on something
_WALLS_FIRST = 1.01  # weight of walls, which win if both fit equally well, because rooms have more walls
_AT_CORNER = 0.08  # m, largest distance of a corner from its walls
_SHORTEST = 0.1  # m, least length of a wall


@dataclass(frozen=True)
class Wall:
    """A straight wall between the outermost points at which arcs touch it."""

    start: tuple[float, float]  # m
    end: tuple[float, float]
    normal: float  # rad, direction from the sensors to the wall
    arcs: tuple[int, ...]
    possible: bool = False  # a scan contradicts it, although three places agree on it


@dataclass(frozen=True)
class Point:
    """A corner, where two found walls meet, or an edge, where they do not."""

    position: tuple[float, float]  # m
    is_corner: bool
    arcs: tuple[int, ...]


@dataclass(frozen=True)
class Features:
    """The features that arcs from several places agree on."""

    arcs: tuple[Arc, ...]
    walls: tuple[Wall, ...]
    points: tuple[Point, ...]

    @property
    def confirmed(self) -> bool:
        """Whether three places agree on each feature. If only two places have arcs, agreement may be chance."""
        return count_places(arc.centre for arc in self.arcs) >= CONFIRMING

    @property
    def alone(self) -> tuple[Arc, ...]:
        """The arcs that belong to no feature."""
        members = [feature.arcs for feature in self.walls] + [feature.arcs for feature in self.points]
        taken = {arc for several in members for arc in several}
        return tuple(arc for number, arc in enumerate(self.arcs) if number not in taken)


class _Hypothesis(NamedTuple):
    """A wall or a point that some arcs may have in common."""

    is_wall: bool
    values: FloatArray  # (2,): of a wall, the direction to it, rad, and its distance from 0, 0, m; of a point, m

    def misfits(self, arcs: ArcTable) -> FloatArray:
        """Return the misfit of each arc, in standard deviations, (n,)."""
        x, y = self.values.tolist()
        return arcs.misfits(*(arcs.to_line(x, y) if self.is_wall else arcs.to_post(x, y)))


def find_features(arcs: Sequence[Arc]) -> Features:
    """Return the features of arcs; an arc belongs to at most one feature, and a feature needs at least two places."""
    walls, points = [], []
    for (is_wall, values), members in _agreed(arcs, table_of(arcs, CERTAIN)):
        if is_wall:
            walls.append(_wall(arcs, members, *values.tolist()))
        else:
            points.append((values, members))
    made = tuple(
        Point((float(position[0]), float(position[1])), _is_corner(position, walls), members)
        for position, members in points
    )
    return Features(tuple(arcs), tuple(walls), made)


def _agreed(arcs: Sequence[Arc], columns: ArcTable) -> Iterator[tuple[_Hypothesis, tuple[int, ...]]]:
    """Yield features with the rows of their arcs, best supported first."""
    hypotheses = list(_hypotheses(arcs))
    if not hypotheses:
        return
    misfits = np.array([hypothesis.misfits(columns) for hypothesis in hypotheses])
    weights = np.where([hypothesis.is_wall for hypothesis in hypotheses], _WALLS_FIRST, 1.0)
    free = np.ones(len(arcs), dtype=np.bool_)
    least = min(CONFIRMING, count_places(columns.centres))
    while (best := _best(misfits, weights, free, columns.centres, least)) is not None:
        members = np.flatnonzero(free & (misfits[best] < FARTHEST))
        fitted = _fitted(columns.of(members), hypotheses[best])
        agreed = np.flatnonzero(free & (fitted.misfits(columns) < FARTHEST))
        # after the fit, an arc may no longer belong
        if count_places(columns.centres[agreed]) < least:
            agreed, fitted = members, hypotheses[best]
        free[agreed] = False
        yield fitted, tuple(agreed.tolist())


def _best(misfits: FloatArray, weights: FloatArray, free: BoolArray, centres: FloatArray, least: int) -> int | None:
    """Return the hypothesis with the best support by free arcs of at least `least` places; None without one."""
    members = free & (misfits < FARTHEST)
    support = np.where(members, FARTHEST**2 - misfits**2, 0.0).sum(axis=1) * weights
    support[members.sum(axis=1) < least] = 0.0
    for row in np.argsort(-support, kind="stable").tolist():
        if support[row] <= 0:
            return None
        if count_places(centres[members[row]]) >= least:
            return int(row)
    return None


def _hypotheses(arcs: Sequence[Arc]) -> Iterator[_Hypothesis]:
    """Yield the lines and points of each pair of arcs."""
    for pair in combinations(arcs, 2):
        yield from (_Hypothesis(True, np.array(line)) for line in common_lines(*pair))
        yield from (_Hypothesis(False, np.array(point)) for point in common_points(*pair))


def _fitted(arcs: ArcTable, start: _Hypothesis) -> _Hypothesis:
    """Return the line or point with the smallest misfit to arcs."""

    def misfits(values: FloatArray) -> FloatArray:
        return start._replace(values=values).misfits(arcs)

    return start._replace(values=least_squares(misfits, start.values).x)


def _wall(arcs: Sequence[Arc], members: tuple[int, ...], normal: float, distance: float) -> Wall:
    """Return the part of a line from the first to the last point at which arcs touch it."""
    across, along = direction(normal), direction(normal + math.pi / 2)
    touched = [float(np.dot(arcs[member].centre, along)) for member in members]
    low, high = min(touched), max(touched)
    more = max(0.0, _SHORTEST - (high - low)) / 2
    start, end = (distance * across + length * along for length in (low - more, high + more))
    return Wall((float(start[0]), float(start[1])), (float(end[0]), float(end[1])), normal % math.tau, members)


def _is_corner(point: FloatArray, walls: Sequence[Wall]) -> bool:
    """Report whether two of the walls, extended, meet at a point."""
    near = [wall for wall in walls if abs(np.dot(point - wall.start, direction(wall.normal))) < _AT_CORNER]
    return any(abs(math.sin(one.normal - other.normal)) > 0.3 for one, other in combinations(near, 2))


# Walls that a scan contradicts: seen at right angles, a wall sends its echo back, so nothing behind it is detected.
#
# The certainty grid does not show this. Its cones of multipath echoes reach through true walls, too.


_BEAM = math.radians(5)  # to each side of the perpendicular; wider, other objects are detected
_BEHIND = 0.1  # m, least distance of the echoes behind the wall
_FROM_END = 0.05  # m, from the perpendicular to the ends of the wall, whose exact position is unknown


def with_possible_walls(
    features: Features, scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray]
) -> Features:
    """Return the features; walls through which a scan detects something behind them are marked as possible."""
    walls = tuple(
        replace(
            wall,
            possible=any(_sees_through(scan, wall, board, wanted) for scan, wanted in zip(scans, kept, strict=True)),
        )
        for wall in features.walls
    )
    return replace(features, walls=walls)


def _sees_through(scan: PlacedScan, wall: Wall, board: Board, kept: BoolArray) -> bool:
    """Report whether most echoes of a scan near the perpendicular to a wall come from behind the wall."""
    start, end = np.array(wall.start), np.array(wall.end)
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    to_start = start - np.array(scan.place.position)
    foot = to_start - (to_start @ along) * along
    if not _FROM_END <= -float(to_start @ along) <= length - _FROM_END:
        return False
    headings, ranges = headings_and_ranges(scan, board)
    differences = angle_difference(headings, math.atan2(foot[1], foot[0]))
    facing = ranges[kept & (np.abs(differences) <= _BEAM) & ~np.isnan(ranges)]
    return bool(len(facing) and np.median(facing) > np.hypot(*foot) + _BEHIND)


# Rejection of readings from several reflections, by following sound in a room.
#
# The room is that of a file, or consists of the walls found in the scans. A reading is rejected if the path that
# explains it is reflected at more than one point.


_MEET = 1.0  # m, by which found walls are extended at most, to meet one another
_BEYOND = 0.1  # m behind a wall; a leg that ends farther behind it crosses the wall
_ONE_POINT = 1e-3  # m between reflections that count as one point


def reflections_of(
    scans: Sequence[PlacedScan], room: Room, board: Board, tick: Callable[[], None] = lambda: None
) -> tuple[NDArray[np.intp], ...]:
    """Return the number of points at which the path of each reading is reflected, 0 without a path, (n,) by scan.

    A reading is direct unless there are several. `tick` is called before each scan.
    """
    counts = []
    for scan in scans:
        tick()
        comparison = compare_readings(scan.readings, room, board.faced(scan.place), board)
        points = _reflection_points(comparison.prediction.paths)
        paths = (row.path for row in comparison.rows)
        counts.append(np.array([0 if path is None else max(1, points[path]) for path in paths], dtype=np.intp))
    return tuple(counts)


def _reflection_points(paths: Paths) -> NDArray[np.intp]:
    """Return the number of points at which each path is reflected, (n,); an inner corner counts once."""
    between = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), 2, 0))
    # the last leg ends at the sensor; later entries are NaN
    return np.asarray((between > _ONE_POINT).sum(axis=1) - 1)


def room_of(features: Features) -> Room | None:
    """Return a room of the confirmed walls that sound can reach, extended until they meet; None without walls."""
    walls = tuple(wall for wall in reachable_walls(features) if not wall.possible)
    if not walls:
        return None
    lines = [_longer(wall, walls) for wall in walls]
    text = ['name = "found"', "[materials.found]", f"reflectance = {REFLECTANCE}"]
    for number, (start, end) in enumerate(lines):
        text += ["[[walls]]", f'name = "wall {number}"', 'material = "found"']
        text.append(f"points = [[{start[0]:.6f}, {start[1]:.6f}], [{end[0]:.6f}, {end[1]:.6f}]]")
    return parse_room("\n".join(text), "the walls that were found")


def reachable_walls(features: Features) -> tuple[Wall, ...]:
    """Return the walls without a nearer wall in front, seen from most of their places; the others are images."""
    arcs = features.arcs
    near_first = sorted(features.walls, key=lambda wall: float(np.mean([arcs[k].range for k in wall.arcs])))
    kept: list[Wall] = []
    for wall in near_first:
        hidden = [any(_passes(arcs[k], wall, other) for other in kept) for k in wall.arcs]
        if np.mean(hidden) <= 0.5:
            kept.append(wall)
    return tuple(kept)


def _passes(arc: Arc, wall: Wall, other: Wall) -> bool:
    """Report whether the straight line from the place of an arc to its wall crosses another wall."""
    start = np.array(arc.centre)
    return _crosses(start, start + arc.range * direction(wall.normal), np.array(other.start), np.array(other.end))


def _crosses(start: FloatArray, end: FloatArray, first: FloatArray, last: FloatArray) -> bool:
    """Report whether a leg crosses a slightly extended wall and ends well behind it."""
    along = (last - first) / np.hypot(*(last - first))
    normal = np.array([-along[1], along[0]])
    before, behind = (start - first) @ normal, (end - first) @ normal
    if before * behind >= 0 or abs(behind) < _BEYOND:
        return False
    meeting = (start + (end - start) * before / (before - behind) - first) @ along
    return bool(-_BEYOND <= meeting <= np.hypot(*(last - first)) + _BEYOND)


def _longer(wall: Wall, walls: Sequence[Wall]) -> tuple[FloatArray, FloatArray]:
    """Return the ends of a wall, extended by at most 1 m to where it meets others."""
    start, end = np.array(wall.start), np.array(wall.end)
    along = (end - start) / np.hypot(*(end - start))
    low, high = 0.0, float(np.hypot(*(end - start)))
    meetings = [meeting for other in walls if other is not wall for meeting in _meeting(start, along, other)]
    before = [meeting for meeting in meetings if low - _MEET <= meeting <= low]
    behind = [meeting for meeting in meetings if high <= meeting <= high + _MEET]
    return start + min(before, default=low) * along, start + max(behind, default=high) * along


def _meeting(start: FloatArray, along: FloatArray, other: Wall) -> list[float]:
    """Return where a line crosses another wall or its extension, m along the line; an empty list if it does not."""
    normal = direction(other.normal)
    slope = float(along @ normal)
    if abs(slope) < math.sin(math.radians(10)):
        return []
    along_wall = float((np.array(other.start) - start) @ normal) / slope
    point, first, last = start + along_wall * along, np.array(other.start), np.array(other.end)
    share = float((point - first) @ (last - first)) / float((last - first) @ (last - first))
    reach = _MEET / float(np.hypot(*(last - first)))
    return [along_wall] if -reach <= share <= 1 + reach else []


# The map from several scans: grid and features of all readings, and of those without several reflections.


@dataclass(frozen=True)
class Layer:
    """Grid and features of some of the readings."""

    kept: tuple[BoolArray, ...]  # (n,) for each scan
    grid: CertaintyGrid
    features: Features

    def line(self, title: str) -> str:
        """Return the counts of the features as a line of text."""
        features = self.features
        corners = sum(point.is_corner for point in features.points)
        maybe = "" if features.confirmed else "possible "
        possible = sum(wall.possible for wall in features.walls) if features.confirmed else 0
        counts = (
            counted(len(features.walls) - possible, f"{maybe}wall"),
            *([counted(possible, "possible wall")] if possible else []),
            counted(corners, f"{maybe}corner"),
            counted(len(features.points) - corners, f"{maybe}edge"),
        )
        return (
            f"{title}: {counted(len(features.arcs), 'region')} of constant depth, {', '.join(counts)}; "
            f"{counted(len(features.alone), 'region')} unexplained"
        )

    def figures(self) -> dict[str, Any]:
        """Return the features for JSON."""
        features = self.features
        return {
            "regions": len(features.arcs),
            "unexplained": len(features.alone),
            "walls": [
                {
                    "start_m": rounded_point(wall.start),
                    "end_m": rounded_point(wall.end),
                    "normal_deg": in_degrees(wall.normal, 3),
                    "regions": len(wall.arcs),
                    "confirmed": features.confirmed and not wall.possible,
                }
                for wall in features.walls
            ],
            "points": [
                {
                    "position_m": rounded_point(point.position),
                    "kind": "corner" if point.is_corner else "edge",
                    "regions": len(point.arcs),
                }
                for point in features.points
            ],
        }


@dataclass(frozen=True)
class RoomMap:
    """A room as estimated from scans."""

    scans: tuple[PlacedScan, ...]
    plain: Layer  # of all readings
    # the room in which sound is followed: the given one, else one of the confirmed walls. None: not followed
    followed_room: Room | None
    direct: Layer  # without readings from several reflections
    explained: tuple[BoolArray, ...]  # readings with a path in that room, (n,) for each scan

    @property
    def places(self) -> int:
        """The number of different positions of the scans."""
        return count_places(scan.place.position for scan in self.scans)

    @property
    def echoes(self) -> int:
        """The number of readings with an echo."""
        return self._echoes_not(tuple(np.zeros_like(kept) for kept in self.direct.kept))

    @property
    def rejected(self) -> int:
        """The number of rejected readings with an echo."""
        return self._echoes_not(self.direct.kept)

    @property
    def undetermined(self) -> int:
        """The number of echoes without a path: whether they came by several reflections is not determined."""
        return self._echoes_not(self.explained)

    def lines(self, where: str) -> Iterator[str]:
        """Yield the map as lines of text; `where` names the room in which sound was followed."""
        yield self.plain.line("all readings")
        if self.followed_room is None:
            yield (
                f"not determined which of {counted(self.echoes, 'reading')} came by several reflections: there are no "
                f"confirmed walls to follow sound in; give the room, or scans from {CONFIRMING} places"
            )
            return
        yield self.direct.line("direct readings")
        yield f"{counted(self.rejected, 'reading')} removed: in {where}, they came by several reflections"
        if self.undetermined:
            kept = counted(self.undetermined, "reading")
            yield f"{kept} kept but not determined: no path in {where} explains the echo"

    def figures(self) -> dict[str, Any]:
        """Return the map under the keys of `map --json`; headings in degrees."""
        return {
            "readings": sum(len(scan.readings) for scan in self.scans),
            "places": self.places,
            "confirmed": self.plain.features.confirmed,
            "rejected": self.rejected,
            "undetermined": self.undetermined,
            "all": self.plain.figures(),
            "direct": self.direct.figures(),
        }

    def _echoes_not(self, among: tuple[BoolArray, ...]) -> int:
        return sum(
            reading.range is not None and not inside
            for scan, rows in zip(self.scans, among, strict=True)
            for reading, inside in zip(scan.readings, rows.tolist(), strict=True)
        )


@arguments.checked(
    scans=arguments.instances(PlacedScan, "a list of PlacedScan"),
    board=arguments.instance(Board, "a board"),
    room=arguments.instance(Room, "a room"),
    tick=arguments.function,
)
def map_scans(
    scans: Sequence[PlacedScan],
    board: Board,
    room: Room | None = None,
    tick: Callable[[float], None] = lambda _share: None,
) -> RoomMap:
    """Return the map from scans at known places. Readings of the carrier's own body are left out.

    Sound is followed in `room` if given, or else in a room of the walls that three places agree on. `tick` receives the
    completed share, 0..1. Raises InputError if no reading has an echo, a scan is given twice or the board is a ring.
    """
    scans, parts = mappable(scans, board), count()

    def begin_part() -> None:
        # a layer of all readings, one part for each scan, a layer of the kept readings
        tick(next(parts) / (len(scans) + 2))

    begin_part()
    plain = _layer(scans, board, tuple(np.ones(len(scan.readings), dtype=np.bool_) for scan in scans))
    followed = room_of(plain.features) if plain.features.confirmed else None
    followed_room = followed if room is None else room
    direct, explained = plain, tuple(np.zeros_like(kept) for kept in plain.kept)
    if followed_room is not None:
        reflections = reflections_of(scans, followed_room, board, begin_part)
        begin_part()
        direct = _layer(scans, board, tuple(points <= 1 for points in reflections))
        explained = tuple(points > 0 for points in reflections)
    tick(1.0)
    return RoomMap(tuple(scans), plain, followed_room, direct, explained)


def _layer(scans: Sequence[PlacedScan], board: Board, kept: tuple[BoolArray, ...]) -> Layer:
    features = find_features(arcs_of(scans, board, CERTAIN, kept))
    return Layer(kept, certainty_grid(scans, board, kept), with_possible_walls(features, scans, board, kept))


def rounded_point(point: tuple[float, float]) -> list[float]:
    """Return x and y rounded to µm."""
    return [round(coordinate, 6) + 0.0 for coordinate in point]
