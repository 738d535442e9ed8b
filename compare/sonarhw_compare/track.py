"""Where a robot is, from its odometry and its sonar: the log-likelihood of poses, and a particle filter on it.

`track_scan` follows a robot through a whole log.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sonarhw_sim.air import DEFAULT_BOARD, Model, Receiver
from sonarhw_sim.board.profile import Board, Mount
from sonarhw_sim.predict.batch import BOARD, ROOM, loaded_board, loaded_room
from sonarhw_sim.predict.prediction import CONE_HALF_ANGLE, SPREAD, SPREAD_BY_RANGE, PredictionOptions
from sonarhw_sim.rays.fan import distances_ahead
from sonarhw_sim.rays.paths import RAYS
from sonarhw_sim.room.room import Place, Room, place_at, warn_of_poses

from sonarhw import arguments
from sonarhw.errors import InputError, counted, counted_are, in_degrees, pose_heading_text
from sonarhw.readings import BoolArray, FloatArray, Reading, RobotPose, Table, moved_by, step_between
from sonarhw_compare.fit.likelihood import ReadingNoise, ScanArrays
from sonarhw_compare.fit.objective import Objective, Problem
from sonarhw_compare.fit.parameters import free_parameters
from sonarhw_compare.free_space import FreeSpace, find_free_space
from sonarhw_compare.range_table import RangeTable
from sonarhw_compare.scans import GivenScan, echoes_of

_NOISE = ReadingNoise(range=0.02, level=2.0, missed=0.1, lost=0.05, stray=0.05)
_CELL = 0.1  # m, side of the cells that share a search of paths
_MOST_CELLS = 4000  # whose paths are kept, some 50 kB each
_AT_ONCE = 512  # cells
_FAR = 7.0  # standard deviations of a range
_LONGER = 1.3  # ratio of two lengths up to which paths are searched
_RAYS = RAYS // 4  # of a search: a particle filter needs no faint paths through narrow gaps


@arguments.checked(
    room=ROOM,
    board=BOARD,
    degrees=arguments.flag,
    cell=arguments.number(0, 1, "m"),
    receiver=arguments.choice(Receiver, or_none=True),
)
def log_likelihood(
    room: Room | Path | str,
    poses: ArrayLike,
    headings: ArrayLike,
    ranges: ArrayLike,
    board: Board | Path | str = DEFAULT_BOARD,
    *,
    degrees: bool = False,
    cell: float = 0.0,
    receiver: Receiver | None = None,
) -> FloatArray:
    """Return the logarithm of the probability density of one set of readings at each of many poses, (k,) float.

    `poses` (k, 3) are x and y in m and the heading in rad, counter-clockwise from x. `headings` (m,) rad are relative
    to that of the pose, `ranges` (m,) m, NaN or inf for no echo. With `degrees`, all headings are degrees. The model is
    that of `fit` and `locate` (docs/explanation/fit_method.md), with errors of ranges of 2 cm and of levels of 2 dB, or
    the larger ones of the profile, 10 % of loud echoes missed, 5 % of pings lost and 0.05 stray echoes per metre. The
    difference of two values is the logarithm of the odds of two poses, if both were equally probable before.

    Sound is followed from each position, or, with a `cell` (m), from the middle of each square cell with a pose in it:
    the paths are moved to the pose, which is exact as long as they meet the same walls. In the laboratory, half of the
    values for 16 readings are then off by less than 0.1 for cells of 2 cm, 0.2 for 5 cm, and 0.5 for 10 cm. Raises
    InputError.
    """
    likelihood = PoseLikelihood(loaded_room(room), loaded_board(board), cell, receiver)
    rows = arguments.rows("poses", poses, (3,), "x and y in metres and a heading in radians")
    turns = arguments.in_radians("poses", rows[:, 2], degrees)
    warn_of_poses("poses", likelihood.room, rows[:, :2])
    angles = arguments.in_radians("headings", arguments.angles("headings", headings), degrees)
    echoes = echoes_of(ranges, len(angles))[:, 0, 0]
    arguments.warn_of_centimetres("ranges", echoes)
    return likelihood(np.column_stack((rows[:, :2], turns)), angles, echoes)


class PoseLikelihood:
    """The log-likelihood of poses by the paths of sound, which are kept from call to call for each cell of the room."""

    def __init__(self, room: Room, board: Board, cell: float = _CELL, receiver: Receiver | None = None) -> None:
        """`cell` is the side of a cell, m; 0: paths are searched at each pose and not kept."""
        if board.ring is not None:  # each sensor as a head at its distance from the middle, without the others' sound
            board = replace(board, ring=None, mount=Mount(ahead=board.ring.radius))
        self.room, self._board, self._cell = room, board, cell
        self._options = PredictionOptions(receiver=receiver, rays=_RAYS)
        self._free = free_parameters(("position", "heading"), ("scan",), room, board)
        self._noise = _NOISE._replace(
            range=max(_NOISE.range, board.range_sd, board.rounding / math.sqrt(12)),
            level=max(_NOISE.level, board.threshold_sd_db),
        )
        self._kept: OrderedDict[tuple[float, float], tuple[float, Objective]] = OrderedDict()

    def __call__(self, poses: FloatArray, angles: FloatArray, ranges: FloatArray) -> FloatArray:
        """Return the log-likelihood of readings at turntable angles (m,) rad with ranges (m,) m at poses (k, 3)."""
        scan = _scan_arrays(angles, ranges)
        totals = np.empty(len(poses))
        cells, longest = self._cells(poses), self._longest(ranges)
        for begin in range(0, len(cells), _AT_ONCE):
            some = cells[begin : begin + _AT_ONCE]
            for objective, (_, rows) in zip(self._near([middle for middle, _ in some], longest), some, strict=True):
                totals[rows] = objective.of_poses(scan, poses[rows], self._noise)
        return totals

    def _cells(self, poses: FloatArray) -> list[tuple[tuple[float, float], NDArray[np.intp]]]:
        """Return the position of each search, m, with the rows of its poses."""
        if self._cell == 0.0:
            return [((x, y), np.array([row])) for row, (x, y) in enumerate(poses[:, :2].tolist())]
        numbers, which = np.unique(np.floor(poses[:, :2] / self._cell).astype(np.int64), axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        rows = np.split(order, np.flatnonzero(np.diff(which.ravel()[order])) + 1)
        middles = (numbers + 0.5) * self._cell
        return [((x, y), part) for (x, y), part in zip(middles.tolist(), rows, strict=True)]

    def _longest(self, ranges: FloatArray) -> float:
        """Return the length, m, of the longest paths on which these ranges depend; silence depends on all."""
        board, most = self._board, 2 * self._board.max_range
        if not np.isfinite(ranges).all() or not len(ranges):
            return most
        beside = math.hypot(board.mount.ahead, board.mount.aside) + board.mount.separation + 2 * self._cell
        farthest = float(board.true_ranges(ranges).max()) + _FAR * self._noise.range + beside
        # one of a few lengths, so that the paths of a cell serve many readings
        steps = math.floor(math.log(most / (2 * farthest + board.wavelength(self.room.air)), _LONGER))
        return most * _LONGER ** -max(steps, 0)

    def _near(self, positions: list[tuple[float, float]], longest: float) -> list[Objective]:
        """Return the objective with the paths from each position, m, up to a length, m; those of a cell are kept."""
        kept = [self._kept.get(position, (0.0, None)) for position in positions]
        known = [objective if length >= longest else None for length, objective in kept]
        missing = [position for position, objective in zip(positions, known, strict=True) if objective is None]
        places = [Place("", position) for position in missing]
        none, board = _scan_arrays(np.zeros(1), np.full(1, np.nan)), self._board
        problem = Problem((none,), self.room, (), board, self._free, self._options, None, board.rounding)
        found = dict(zip(missing, problem.near_each(places, longest), strict=True))
        objectives = [objective or found[position] for position, objective in zip(positions, known, strict=True)]
        if self._cell:
            self._kept |= {position: (longest, objective) for position, objective in found.items()}
            for position in positions:
                self._kept.move_to_end(position)
            while len(self._kept) > _MOST_CELLS:
                self._kept.popitem(last=False)
        return objectives


def _scan_arrays(angles: FloatArray, ranges: FloatArray) -> ScanArrays:
    echoes = np.where(np.isfinite(ranges), ranges, np.nan)
    counts = np.isfinite(echoes).astype(np.int64)
    return ScanArrays(angles, np.ascontiguousarray(echoes[:, None]), counts, np.ones(len(angles), np.bool_))


class RangeLikelihood:
    """The log-likelihood of poses by one predicted range for each reading.

    A range is normal about the predicted one, or a stray, or there is no echo.
    """

    _NO_ECHO, _STRAY = 0.1, 0.1  # shares

    def __init__(
        self, predicted: Callable[[FloatArray, FloatArray], FloatArray], most: float, spread: float, by_range: float
    ) -> None:
        """`predicted` returns the ranges at poses (k, 3) and angles (m,), (k, m) m; NaN or over `most` (m): none.

        The standard deviation of a range is `spread` (m) and `by_range` times the range.
        """
        self._predicted, self._most = predicted, most
        self._spread, self._by_range = spread, by_range

    def __call__(self, poses: FloatArray, angles: FloatArray, ranges: FloatArray) -> FloatArray:
        """Return the log-likelihood of readings at turntable angles (m,) rad with ranges (m,) m at poses (k, 3)."""
        predicted = self._predicted(poses, angles)
        spread = self._spread + self._by_range * np.minimum(predicted, self._most)
        with np.errstate(over="ignore", invalid="ignore"):
            hit = np.exp(-0.5 * ((ranges - predicted) / spread) ** 2) / (spread * math.sqrt(math.tau))
        silent = ~np.isfinite(ranges)
        no_echo = ~(predicted <= self._most)
        hit = np.where(no_echo, 0.0, hit)
        echo = (1 - self._NO_ECHO - self._STRAY) * hit + self._STRAY / self._most
        none = np.where(no_echo, 1 - self._STRAY, self._NO_ECHO)
        return np.asarray(np.log(np.where(silent, none, echo)).sum(axis=1))


_RAYS_OF_CONE = 13
_TABLE_SPREAD = 0.03  # m: errors of a table, of the room and of ranges


def _by_nearest_wall(room: Room, board: Board, model: Model) -> RangeLikelihood:
    """Return the likelihood by the nearest wall, along the axis or in a cone, as other packages have it.

    The spread of ranges is that of maps made with Polaroid units.
    """
    half = CONE_HALF_ANGLE if model is Model.CONE else 0.0
    ahead = board.mount.ahead if board.ring is None else board.ring.radius
    fan = np.linspace(-half, half, _RAYS_OF_CONE) if half else np.zeros(1)

    def nearest(poses: FloatArray, angles: FloatArray) -> FloatArray:
        headings = poses[:, 2:] + board.turned(angles)
        aside = ahead * np.stack((np.cos(headings), np.sin(headings)), axis=-1)
        starts = np.repeat((poses[:, None, :2] + aside).reshape(-1, 2), len(fan), axis=0)
        rays = (headings[..., None] + fan).ravel()
        return np.asarray(distances_ahead(starts, rays, room.surfaces).reshape(*headings.shape, -1).min(axis=2))

    return RangeLikelihood(nearest, board.max_range, SPREAD, SPREAD_BY_RANGE)


@dataclass(frozen=True)
class Tracked:
    """The pose of a robot after an update."""

    position: tuple[float, float]  # m
    heading: float  # rad, counter-clockwise from x, -π..π
    deviations: tuple[float, float, float]  # standard deviations of x and y, m, and of the heading, rad
    effective: float  # number of particles that share the weight
    lost: bool  # whether the readings fit no particle


class Tracker:
    """A particle filter: the pose of a robot in a known room, from odometry and sonar. Results repeat with a seed."""

    _FEWER = 0.5  # share of effective particles below which they are drawn again
    _LEAST_TURN, _LEAST_STEP = math.radians(0.4), 0.002  # deviations of each update, rad and m
    _LOST = -0.5  # mean log-likelihood per reading of the best particle; that of a fitting one is 1 to 2
    _FORGET = 0.3  # share of the newest update in the mean of fits
    _SEARCHING = 10  # times as many particles are drawn anywhere, at a start anywhere and while the robot is lost

    def __init__(
        self,
        room: Room | Path | str,
        board: Board | Path | str = DEFAULT_BOARD,
        start: ArrayLike | Place | None = None,
        *,
        particles: int = 1000,
        spread: tuple[float, float] = (0.05, math.radians(3)),
        drift: tuple[float, float] = (0.05, math.radians(3)),
        model: Model = Model.RAY_FOLLOWING,
        cell: float = _CELL,
        table: RangeTable | None = None,
        seed: int = 0,
    ) -> None:
        """Begin at a pose, x and y in m and the heading in rad, or anywhere in the room.

        `spread` are the standard deviations of the start: of x and of y (m), and of the heading (rad). `drift` are
        those of the odometry: its share of the way, and the turn (rad) per metre. `model` is ray following, `cone` or
        `nearest`. `cell` (m) is the side of the cells that share a search of paths. With a `table` of this room and
        board, ranges are looked up instead, which is many times faster and knows nothing of levels. Raises InputError.
        """
        self._room = loaded_room(ROOM("room", room))
        self._board = loaded_board(BOARD("board", board))
        self._random = np.random.default_rng(arguments.whole(0)("seed", seed))
        self._drift = _pair("drift", drift)
        self._count = arguments.whole(1, 1_000_000)("particles", particles)
        model, cell = arguments.choice(Model)("model", model), arguments.number(0.01, 1.0, "m")("cell", cell)
        self._likelihood: PoseLikelihood | RangeLikelihood
        if table is not None:
            arguments.instance(RangeTable, "a table that `range_table` made")("table", table)
            if (table.room, table.board) != (self._room, self._board):
                raise InputError(f"table: expected one of room {self._room.name!r} and board {self._board.name!r}")
            self._likelihood = RangeLikelihood(table.ranges, self._board.max_range, _TABLE_SPREAD, 0.0)
        elif model in (Model.CONE, Model.NEAREST):
            self._likelihood = _by_nearest_wall(self._room, self._board, model)
        else:
            self._likelihood = PoseLikelihood(self._room, self._board, cell)
        self._free: FreeSpace = find_free_space(self._room)
        if start is None:
            self._particles = self._anywhere(self._SEARCHING * self._count)
        else:
            place = start if isinstance(start, Place) else place_at("start", start)
            deviations = np.array([spread_ := _pair("spread", spread)[0], spread_, _pair("spread", spread)[1]])
            pose = np.array([*place.position, place.heading])
            warn_of_poses("start", self._room, pose[None, :2])
            arguments.warn_of_degrees("start", pose[2:])
            self._particles = pose + deviations * self._random.standard_normal((self._count, 3))
        self._logs = np.zeros(len(self._particles))
        self._fit = 0.0  # mean log-likelihood per reading of the best particles
        self._has_warned = False

    @property
    def particles(self) -> FloatArray:
        """The particles: x, y (m) and heading (rad), (n, 3) float."""
        return self._particles.copy()

    @property
    def weights(self) -> FloatArray:
        """The weight of each particle, (n,) float; their sum is 1."""
        weights = np.exp(self._logs - self._logs.max())
        return np.asarray(weights / weights.sum())

    def update(self, odometry: ArrayLike, headings: ArrayLike, ranges: ArrayLike) -> Tracked:
        """Move by the odometry, weigh by the readings, and return the pose.

        `odometry` is the motion since the last update: ahead and to the left, m, in the frame of the robot before it,
        and the turn to the left, rad. `headings` (m,) rad are relative to the robot, `ranges` (m,) m, NaN for no echo.
        Raises InputError.
        """
        step = arguments.numbers_in("odometry", odometry, _ODOMETRY)
        if step.shape != (3,) or not np.isfinite(step).all():
            raise arguments.refusal("odometry", _ODOMETRY, odometry)
        angles = arguments.in_radians("headings", arguments.angles("headings", headings), False)
        echoes = echoes_of(ranges, len(angles))[:, 0, 0]
        self._move(step)
        self._doubt(step, echoes)
        if len(angles):
            logs = self._likelihood(self._particles, angles, echoes)
            self._judge(logs, len(angles))
            self._logs = self._logs + logs
        tracked = self._tracked()
        if tracked.lost and len(angles):
            self._search(angles, echoes)
        if tracked.effective < self._FEWER * len(self._logs) or len(self._logs) > self._count:
            self._draw_again()
        return tracked

    def _search(self, angles: FloatArray, echoes: FloatArray) -> None:
        """Add particles anywhere, and weigh all by the newest readings alone."""
        self._particles = np.vstack((self._particles, self._anywhere(self._SEARCHING * self._count)))
        self._logs = self._likelihood(self._particles, angles, echoes)

    def _move(self, step: FloatArray) -> None:
        ahead, left, turn = step.tolist()
        way, (share, turn_per_metre) = math.hypot(ahead, left), self._drift
        noise = self._random.standard_normal((len(self._particles), 3))
        along = self._LEAST_STEP + share * way
        steps = np.array([ahead, left]) + along * noise[:, :2]
        headings = self._particles[:, 2]
        cosines, sines = np.cos(headings), np.sin(headings)
        self._particles = np.column_stack(
            (
                self._particles[:, 0] + cosines * steps[:, 0] - sines * steps[:, 1],
                self._particles[:, 1] + sines * steps[:, 0] + cosines * steps[:, 1],
                headings + turn + (self._LEAST_TURN + turn_per_metre * way) * noise[:, 2],
            )
        )

    def _doubt(self, step: FloatArray, ranges: FloatArray) -> None:
        """Warn, at one update only, of steps and ranges that are probably in centimetres or degrees."""
        if self._has_warned:
            return
        doubts: list[str] = []
        if math.hypot(*step[:2]) > _LARGE_STEP:
            warn_of_poses("odometry", self._room, self._particles[:, :2], doubts.append)
        if abs(step[2]) >= math.tau:  # the difference of two headings is less
            doubts.append(f"odometry: a turn of {step[2]:g}, taken as radians; if it is degrees, use np.radians")
        arguments.warn_of_centimetres("ranges", ranges, doubts.append)
        for doubt in doubts:
            arguments.emit(doubt)
        self._has_warned = bool(doubts)

    def _judge(self, logs: FloatArray, readings: int) -> None:
        """Keep the mean of how well the best particle fits, per reading."""
        best = float(logs.max()) / readings
        self._fit += self._FORGET * (best - self._fit)

    def _tracked(self) -> Tracked:
        weights = self.weights
        x, y = weights @ self._particles[:, :2]
        turned = complex(weights @ np.exp(1j * self._particles[:, 2]))
        heading = math.atan2(turned.imag, turned.real)
        away = self._particles[:, :2] - (x, y)
        turns = np.remainder(self._particles[:, 2] - heading + math.pi, math.tau) - math.pi
        dx, dy = np.sqrt(weights @ away**2)
        deviations = float(dx), float(dy), math.sqrt(float(weights @ turns**2))
        effective = 1 / float((weights**2).sum())
        return Tracked((float(x), float(y)), heading, deviations, effective, self._fit < self._LOST)

    def drawn(self, count: int) -> FloatArray:
        """Return the positions of some particles, drawn by their weights, (count, 2) m."""
        return np.asarray(self._particles[self._rows(count, 0.5), :2])

    def _draw_again(self) -> None:
        """Draw the particles by their weights."""
        rows = self._rows(self._count, self._random.random())
        self._particles, self._logs = self._particles[rows], np.zeros(self._count)

    def _rows(self, count: int, begin: float) -> NDArray[np.intp]:
        """Return the rows of `count` particles by their weights, in steps from `begin` (0..1) of the first one on."""
        steps = (begin + np.arange(count)) / count
        return np.minimum(np.searchsorted(np.cumsum(self.weights), steps), len(self._particles) - 1)

    def _anywhere(self, count: int) -> FloatArray:
        middles, size = self._free.middles, self._free.spacing
        chosen = middles[self._random.integers(len(middles), size=count)]
        positions = chosen + size * (self._random.random((count, 2)) - 0.5)
        return np.column_stack((positions, math.tau * self._random.random(count)))


_LARGE_STEP = 1.0  # m, of an update
_ODOMETRY = "three finite numbers: ahead and to the left in metres, and the turn to the left in radians"


def _pair(name: str, values: object) -> tuple[float, float]:
    """Return two standard deviations, of lengths and of headings."""
    read = arguments.numbers_in(name, values, "two numbers, 0 or more")
    if read.shape != (2,) or not (read >= 0).all():
        raise InputError(f"{name}: expected two numbers, 0 or more, got {arguments.described(values)}")
    return float(read[0]), float(read[1])


# The trajectory of a robot through a log: updates of a tracker, each with the readings of one place.


_CLOUD = 100  # particles that are kept of each update, to be drawn
EVERYWHERE = "everywhere"  # in place of a start
_TOGETHER = 0.02  # m; readings from nearer poses are one update
_KNOWN, _KNOWN_TURN = 0.25, math.radians(30)  # standard deviations below which a robot is located


@dataclass(frozen=True, eq=False)
class Track(Table):
    """The trajectory of a robot in a room, one row for each of n updates."""

    scan: str  # name
    room: Room
    board: Board
    model: Model
    seed: int
    times: FloatArray  # (n,), s since the first reading
    poses: FloatArray  # (n, 3): x and y, m, and heading, rad
    deviations: FloatArray  # (n, 3): standard deviations, m, m and rad
    lost: BoolArray  # (n,): whether the readings fit no pose near the one stated
    odometry: FloatArray  # (n, 3): the poses of the odometry alone, from the first pose on
    readings: tuple[tuple[FloatArray, FloatArray], ...]  # headings relative to the robot, rad, and ranges, m, NaN: none
    clouds: FloatArray  # (n, k, 2): positions of some particles, drawn by their weights, m

    def __repr__(self) -> str:
        return f"Track({self.scan!r}, {counted(len(self.times), 'update')}, {self.travelled:.1f} m)"

    @property
    def located(self) -> BoolArray:
        """At which updates the robot is not lost, and its pose certain within 0.25 m and 30°, (n,)."""
        certain = (np.hypot(*self.deviations[:, :2].T) <= _KNOWN) & (self.deviations[:, 2] <= _KNOWN_TURN)
        return np.asarray(~self.lost & certain)

    @property
    def travelled(self) -> float:
        """The length of the way, by the odometry, m."""
        return float(np.hypot(*np.diff(self.odometry[:, :2], axis=0).T).sum())

    @property
    def doubts(self) -> tuple[str, ...]:
        """A warning if the robot is not located at the end."""
        if self.located[-1]:
            return ()
        why = "its readings fit no pose" if self.lost[-1] else "several poses fit"
        return (f"{self.scan}: the robot is not located at the end: {why}; check the room and the board",)

    def lines(self) -> Iterator[str]:
        """Yield the result as lines of text."""
        readings = sum(len(headings) for headings, _ in self.readings)
        yield (
            f"{counted(len(self.times), 'update')} with {counted(readings, 'reading')}, {self.travelled:.2f} m in "
            f"{self.times[-1]:.1f} s, model {self.model.value}"
        )
        yield from self._changes()
        x, y, heading = self.poses[-1].tolist()
        dx, dy, turn = self.deviations[-1].tolist()
        yield (
            f"at the end: x {x:z.3f} ± {dx:.3f} m, y {y:z.3f} ± {dy:.3f} m, heading {pose_heading_text(heading)} ± "
            f"{math.degrees(turn):.1f}°"
        )
        deviations = np.hypot(*self.deviations[self.located, :2].T)
        if len(deviations):
            yield f"standard deviation of the position: median {np.median(deviations) * 1000:.0f} mm"
        if self.located[0] and self.located[-1]:
            away = math.dist(self.poses[-1, :2], self.odometry[-1, :2])
            yield f"the odometry alone ends {away:.2f} m away"

    def _changes(self) -> Iterator[str]:
        """Yield a line for each time that the robot is found or lost."""
        way = np.cumsum(np.append(0.0, np.hypot(*np.diff(self.odometry[:, :2], axis=0).T)))
        before = None
        for located, time, metres in zip(self.located.tolist(), self.times.tolist(), way.tolist(), strict=True):
            if located is not before and (before is not None or not located):
                word = "located" if located else "lost" if before else "not located"
                yield f"{word} at {time:.1f} s, after {metres:.2f} m"
            before = located

    def figures(self) -> dict[str, Any]:
        """Return the result under the keys of `track --json`."""
        return {
            "scan": self.scan,
            "model": self.model.value,
            "seed": self.seed,
            "travelled_m": round(self.travelled, 6),
            "located": bool(self.located[-1]),
            "trajectory": [dict(zip(_COLUMNS, row, strict=True)) for row in self.rows()],
        }

    def rows(self) -> Iterator[tuple[float | int, ...]]:
        """Yield the rows of the trajectory: seconds, metres and degrees, and 1 where the robot is located."""
        columns = self.times, self.poses, self.deviations, self.located
        for time, (x, y, heading), (dx, dy, turn), located in zip(*(part.tolist() for part in columns), strict=True):
            degrees = in_degrees(heading, 6), round(math.degrees(turn), 6)
            lengths = (round(value, 6) for value in (x, y))
            yield round(time, 6), *lengths, degrees[0], round(dx, 6), round(dy, 6), degrees[1], int(located)

    def columns(self) -> dict[str, Any]:
        """Return the columns of `csv`."""
        return dict(zip(_COLUMNS, np.array([*self.rows()]).reshape(-1, len(_COLUMNS)).T, strict=True))

    def csv(self) -> str:
        """Return the trajectory as CSV, with a header."""
        lines = (",".join(f"{value:.9g}" for value in row) for row in self.rows())
        return "\n".join((",".join(_COLUMNS), *lines)) + "\n"


_COLUMNS = ("time_s", "x_m", "y_m", "yaw_deg", "x_sd_m", "y_sd_m", "yaw_sd_deg", "located")


class ScanTracker:
    """Follows the robot of a scan with poses, which may still grow. Only the steps between the poses are used."""

    def __init__(
        self, where: str, room: Room, board: Board, start: Place | None, *, seed: int = 0, **settings: Any
    ) -> None:
        """`where` names the scan in messages; the robot begins at `start`, or anywhere; `settings` are of `Tracker`."""
        self._tracker = Tracker(room, board, start, seed=seed, **settings)
        self._setting = where, room, board, settings.get("model", Model.RAY_FOLLOWING), seed
        self.readings = 0  # taken
        self._waiting: list[Reading] = []  # at the newest position
        self._poses: list[RobotPose] = []  # of the odometry, one for each update, as in the lists below
        self._times: list[float] = []
        self._rows: list[tuple[float, ...]] = []
        self._parts: list[tuple[FloatArray, FloatArray]] = []
        self._clouds: list[FloatArray] = []

    def take(
        self, readings: Sequence[Reading], *, whole: bool = True, progress: Callable[[float], None] = lambda _: None
    ) -> None:
        """Follow the robot through further readings; `progress` gets the share that is done.

        If the scan is not `whole`, the readings of the newest position wait for others from there. Raises InputError
        if a reading has no pose.
        """
        missing = sum(reading.pose is None for reading in readings)
        if missing:
            raise InputError(
                f"{self._setting[0]}: {counted_are(missing, 'reading')} without a pose; expected the odometry of a "
                "robot, which `sonarhw import FILE --x COL --y COL --yaw COL --out LOG.mcap` reads from a table; "
                "`sonarhw locate` finds the place of a scan"
            )
        self.readings += len(readings)
        updates = _updates([*self._waiting, *readings])
        self._waiting = [] if whole or not updates else updates.pop()[1]
        for number, (pose, group) in enumerate(updates):
            self._update(pose, group)
            progress((number + 1) / len(updates))

    @property
    def waits(self) -> bool:
        """Whether readings wait for others from their position."""
        return bool(self._waiting)

    def _update(self, pose: RobotPose, group: list[Reading]) -> None:
        headings, ranges = _together(pose, group)
        before = self._poses[-1] if self._poses else pose
        found = self._tracker.update(step_between(before, pose), headings, ranges)
        self._rows.append((*found.position, found.heading, *found.deviations, found.lost))
        self._parts.append((headings, ranges))
        self._clouds.append(self._tracker.drawn(_CLOUD))
        self._poses.append(pose)
        self._times.append(group[0].time)

    def track(self) -> Track:
        """Return the trajectory so far, of at least one update."""
        where, room, board, model, seed = self._setting
        table, times = np.array(self._rows, dtype=np.float64), np.array(self._times)
        first: RobotPose = (table[0, 0], table[0, 1], table[0, 2])
        alone = np.array([moved_by(first, step_between(self._poses[0], pose)) for pose in self._poses])
        poses, deviations, lost = table[:, :3], table[:, 3:6], table[:, 6] > 0
        parts, clouds = tuple(self._parts), np.array(self._clouds)
        return Track(where, room, board, model, seed, times - times[0], poses, deviations, lost, alone, parts, clouds)


def track_scan(
    scan: GivenScan,
    room: Room,
    board: Board,
    start: Place | None,
    *,
    seed: int = 0,
    progress: Callable[[float], None] = lambda _share: None,
    **settings: Any,
) -> Track:
    """Return the trajectory of the robot that made a scan with poses; `settings` are those of `Tracker`.

    The robot begins at `start`, or anywhere if it is None. Raises InputError if a reading has no pose.
    """
    tracker = ScanTracker(scan.where, room, board, start, seed=seed, **settings)
    tracker.take(scan.readings, progress=progress)
    return tracker.track()


def _updates(readings: Sequence[Reading]) -> list[tuple[RobotPose, list[Reading]]]:
    """Return groups of successive readings from nearly the same position, each heading once, with the first pose."""
    groups: list[tuple[RobotPose, list[Reading]]] = []
    angles: set[float] = set()
    for reading in readings:
        assert reading.pose is not None, "checked by the caller"
        near = bool(groups) and math.dist(groups[-1][0][:2], reading.pose[:2]) <= _TOGETHER
        again = reading.angle in angles and reading.ping == 0
        if not near or again:
            groups.append((reading.pose, []))
            angles = set()
        groups[-1][1].append(reading)
        angles.add(reading.angle)
    return groups


def _together(pose: RobotPose, readings: Sequence[Reading]) -> tuple[FloatArray, FloatArray]:
    """Return headings relative to a pose, rad, and ranges, m, of readings that were made on a way of a few cm."""
    turned = [reading.pose[2] - pose[2] for reading in readings if reading.pose is not None]
    headings = np.array([reading.angle + turn for reading, turn in zip(readings, turned, strict=True)])
    return headings, np.array([reading.range for reading in readings], dtype=np.float64)  # None is NaN
