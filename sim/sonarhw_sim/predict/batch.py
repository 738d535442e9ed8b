"""The ranges at many poses in one call: paths of many poses are searched together, no farther than readings need.

Most readings are of sound that travels a small part of the board's range, and nearly all paths are longer. So paths are
searched up to a short length first, and farther only at poses and headings whose reading is not certain by then.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sonarhw import arguments
from sonarhw.errors import InputError
from sonarhw.readings import BoolArray, FloatArray
from sonarhw_sim.air import DEFAULT_BOARD, Receiver, Unit
from sonarhw_sim.board.beam import PathsAndBeam, Sought, amplitudes_at, arrival_levels, beam_table, detected, together
from sonarhw_sim.board.profile import Board, largest_gain, load_board, with_body
from sonarhw_sim.board.receiver import Sound, first_echoes
from sonarhw_sim.compiled import compiled, rows_in_parts
from sonarhw_sim.predict.predicted_scan import (
    KEPT_BELOW_THRESHOLD,
    ReportedPaths,
    decibels,
    faintest_kept,
    is_blanked,
    is_in_range,
    loud_enough,
    pairs_heard,
    paths_of_readings,
    strengths,
    turned,
)
from sonarhw_sim.predict.prediction import (
    DIFFRACTED_ALONE,
    PredictionOptions,
    paths_serve_all_headings,
    predict_scan,
    search_for,
)
from sonarhw_sim.predict.settled import STEP, certain_length, is_planar, predict_readings
from sonarhw_sim.rays.fan import TransducerAxes, distances_ahead, loudest_aside
from sonarhw_sim.rays.paths import RAYS, Paths, PathSearch, find_paths_of_places
from sonarhw_sim.room.room import Place, Room, load_room, warn_of_poses
from sonarhw_sim.room.room_file import MAX_COORDINATE

# A board that detects only loud echoes needs a quarter of the rays, 0.25° apart, and fewer for a short search. Another
# board, or one whose own receiver adds all sound, also detects what returns through narrow gaps and off posts.
_LOUD = -30.0  # dB: the least threshold for loud echoes
_FEW_RAYS, _LEAST_RAYS = RAYS // 4, 360
_STEP_OF_FEW = 4  # from one ray that is always followed to the next
_STEP, _STEP_BY_POSTS = 8, 2  # the same of all rays; posts widen the gaps between those that they reflect
_LEAST_POSES = 8  # fewer take about as long as a thread needs to begin
_TOGETHER = 128  # poses of one search, whose paths fit into the cache of a processor
_APART = 1e4  # m: lengths of paths of two poses differ by more
_STAGES, _LONGER = 6, 1.5  # lengths of searches, and the ratio of two of them
_BEYOND = 1.6  # times the way to the surface straight ahead and back: by then, most echoes have begun
_MOST_OPEN = 0.75  # share of headings: for fewer, only rays near their beams are followed
_AT_ONCE = 4096  # poses, so that memory does not grow with their number
POSES = "x and y in metres and a heading in radians"


ROOM = arguments.instance((Room, Path, str), "a room, its name or its file; `room_from_arrays` makes one of arrays")
BOARD = arguments.instance((Board, Path, str), "a board, its name or its file")


def loaded_room(room: Room | Path | str) -> Room:
    """Return a room that is given as such, or by its name or file. Raises InputError."""
    return room if isinstance(room, Room) else load_room(room)


def loaded_board(board: Board | Path | str) -> Board:
    """Return a board that is given as such, or by its name or file. Raises InputError."""
    return board if isinstance(board, Board) else load_board(board)


@arguments.checked(
    room=ROOM,
    board=BOARD,
    levels=arguments.flag,
    paths=arguments.flag,
    degrees=arguments.flag,
    height=arguments.number(unit="m"),
    options=arguments.instance(PredictionOptions, "PredictionOptions"),
)
def predict_ranges(
    room: Room | Path | str,
    poses: ArrayLike,
    headings: ArrayLike | None = None,
    board: Board | Path | str = DEFAULT_BOARD,
    *,
    levels: bool = False,
    paths: bool = False,
    degrees: bool = False,
    height: float | None = None,
    options: PredictionOptions | None = None,
) -> FloatArray | tuple[FloatArray | ReportedPaths, ...]:
    """Return the range that a board reports at each of many poses and headings, (n, m) float, m; NaN without an echo.

    `poses` (n, 3) are x and y in m and the heading in rad, counter-clockwise from x; without headings, (n, 2), these
    are 0. `headings` (m,) rad are relative to that of the pose, by default a whole turn in steps of 5 degrees, or those
    of the sensors of a ring. With `degrees`, all headings are degrees. `height` (m) of the transducer includes floor
    and ceiling. `levels` adds the level of the loudest arrival over the threshold, (n, m) dB, and `paths` the paths
    that gave the readings (`ReportedPaths`: lengths, levels, surfaces, edges), (n, m) each; the result is then a tuple.

    The poses share the cores. Memory is needed for the result and the paths of some poses on each core. Readings are
    those of `predict`, but for 0.1 % at the border between two echoes, because fewer rays are followed. From a
    pose inside a post, there is no echo. Raises InputError. Warns if most poses are beyond the walls.
    """
    room, profile = loaded_room(room), loaded_board(board)
    rows = arguments.rows("poses", poses, (2, 3), POSES)
    if (np.abs(rows[:, :2]) > MAX_COORDINATE).any():
        raise InputError(f"poses: expected x and y in metres, none over {MAX_COORDINATE:g}")
    turns = arguments.in_radians("poses", rows[:, 2], degrees) if rows.shape[1] == 3 else np.zeros(len(rows))
    warn_of_poses("poses", room, rows[:, :2])
    if height is not None:
        room.check_height(height)
    angles = angles_of(headings, profile, degrees)
    placed = np.column_stack((rows[:, :2], turns))
    wanted = _Wanted(levels, paths, (options or PredictionOptions()).max_bounces)
    sensors = None
    if height is None and is_planar(room, profile, options or PredictionOptions()):
        sensors = sensors_of(room, profile, angles)
    if sensors is not None:
        readings = _in_plan(room, placed, sensors, profile, options or _options_of(profile), wanted)
    else:
        places = [Place("", (x, y), turn, height) for x, y, turn in placed.tolist()]
        readings = _one_by_one(room, places, angles, profile, options or _options_of(profile), wanted)
    more: list[FloatArray | ReportedPaths] = [readings.over_threshold] if levels else []
    if paths:
        more.append(readings.paths.trimmed())
    return (readings.ranges, *more) if more else readings.ranges


def angles_of(headings: ArrayLike | None, board: Board, degrees: bool) -> FloatArray:
    """Return headings relative to that of the pose, rad."""
    if headings is not None:
        return arguments.in_radians("headings", arguments.angles("headings", headings), degrees)
    return np.radians(np.arange(0, 360, STEP)) if board.ring is None else board.ring.headings(Place("", (0.0, 0.0)))


@dataclass(frozen=True)
class _Wanted:
    """What is wanted beside ranges."""

    levels: bool
    paths: bool
    most_bounces: int


class _Readings(NamedTuple):
    """Readings of n poses at m headings, to be filled in; what is not wanted has no columns."""

    ranges: FloatArray  # (n, m), m; NaN: no echo
    over_threshold: FloatArray  # (n, m), dB, of the loudest arrival in time
    paths: ReportedPaths

    @classmethod
    def empty(cls, poses: int, headings: int, wanted: _Wanted) -> "_Readings":
        of_levels, of_paths = (headings if is_wanted else 0 for is_wanted in (wanted.levels, wanted.paths))
        return cls(
            np.full((poses, headings), np.nan),
            np.full((poses, of_levels), -np.inf),
            ReportedPaths.empty((poses, of_paths), wanted.most_bounces),
        )

    def of_poses(self, count: int) -> "_Readings":
        """Return these readings of single sensors as those of so many poses."""
        ranges, over_threshold, paths = self
        lengths, levels, surfaces, edges = paths
        most = surfaces.shape[-1]
        return _Readings(
            ranges.reshape(count, -1),
            over_threshold.reshape(count, -1),
            ReportedPaths(
                lengths.reshape(count, -1),
                levels.reshape(count, -1),
                surfaces.reshape(count, -1, most),
                edges.reshape(count, -1),
            ),
        )

    def fill(self, rows: slice, other: "_Readings") -> None:
        """Set the readings of the poses in `rows` to others."""
        self.ranges[rows], self.over_threshold[rows] = other.ranges, other.over_threshold
        self.paths.fill((rows,), other.paths)


def _in_parts(count: int, of_part: Callable[[int, int], _Readings]) -> _Readings:
    """Return the readings of `of_part(begin, end)` for all of `count` poses."""

    def as_arrays(begin: int, end: int) -> tuple[NDArray[Any], ...]:
        part = of_part(begin, end)
        return part.ranges, part.over_threshold, *part.paths

    ranges, over_threshold, *paths = rows_in_parts(as_arrays, count, _LEAST_POSES)
    return _Readings(ranges, over_threshold, ReportedPaths(*paths))


def _one_by_one(
    room: Room,
    places: list[Place],
    angles: FloatArray,
    board: Board,
    options: PredictionOptions,
    wanted: _Wanted,
) -> _Readings:
    """Return the readings of single predictions."""

    def predicted(begin: int, end: int) -> _Readings:
        readings = _Readings.empty(end - begin, len(angles), wanted)
        for row, place in enumerate(places[begin:end]):
            faced = board.faced(place)
            # the loudest arrival may be later than the reading
            predict = predict_scan if wanted.levels else predict_readings
            scan = predict(room, faced, board, faced.heading + board.turned(angles), options)
            readings.ranges[row] = scan.ranges
            if wanted.levels:
                readings.over_threshold[row] = scan.over_threshold
            if wanted.paths:
                readings.paths.fill((row,), scan.reported_paths)
        return readings

    return _in_parts(len(places), predicted)


@dataclass(frozen=True)
class Sensors:
    """Where transducers are, for a robot at the origin that faces along x; k places with h headings each."""

    senders: FloatArray  # (k, 2), m
    receivers: FloatArray | None  # (k, 2), m; None: as the senders
    headings: FloatArray  # (k, h), rad
    turns: bool  # whether the paths from a place serve all headings

    def at(self, poses: FloatArray) -> tuple[FloatArray, FloatArray | None, FloatArray]:
        """Return senders and receivers (n * k, 2) m, and headings (n * k, h) rad in the room, for poses (n, 3)."""
        receivers = None if self.receivers is None else _moved(self.receivers, poses)
        headings = poses[:, 2, None, None] + self.headings
        return _moved(self.senders, poses), receivers, headings.reshape(-1, self.headings.shape[1])


def _moved(points: FloatArray, poses: FloatArray) -> FloatArray:
    """Return points (k, 2) of a robot at the origin for each of its poses (n, 3), (n * k, 2)."""
    (x, y), cosine, sine = points.T, np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    turned = np.stack((x * cosine - y * sine, x * sine + y * cosine), axis=-1)
    return np.asarray((poses[:, None, :2] + turned).reshape(-1, 2))


def sensors_of(room: Room, board: Board, angles: FloatArray) -> Sensors | None:
    """Return the transducers at turntable angles (m,) rad; None if one may hear the pings of others.

    Raises InputError if the board is a ring and has no sensor at one of the angles.
    """
    axis = _axis(board, np.zeros(3))
    headings = axis.heading + board.turned(angles)
    if paths_serve_all_headings(board, Unit.PASS):
        return Sensors(np.array([axis.position]), None, headings[None], True)
    senders, receivers = [], []
    for heading in headings.tolist():
        listener, others = board.mounting.pose(axis, heading), board.mounting.senders(axis, heading)
        pairs = [*pairs_heard(listener, others, 2 * board.max_range, room.air.speed_of_sound)]
        if len(pairs) != 1 or pairs[0].lateness:
            return None
        senders.append(pairs[0].sender.sender)
        receivers.append(listener.receiver)
    apart = None if senders == receivers else np.array(receivers).reshape(-1, 2)
    return Sensors(np.array(senders).reshape(-1, 2), apart, headings[:, None], False)


@dataclass(frozen=True)
class _Batch:
    """Places of transducers of a board in a room, and what is known of their readings."""

    room: Room
    board: Board
    options: PredictionOptions
    positions: FloatArray  # (n, 2), m
    receivers: FloatArray | None  # (n, 2), m; None: as the positions
    headings: FloatArray  # (n, m), rad in the room
    turns: bool  # whether the paths from a place serve all headings; else it has one
    wanted: _Wanted
    readings: _Readings  # (n, m), with ranges at detection. To be filled in
    open: BoolArray  # (n, m): whether a reading is not known yet. To be filled in

    @property
    def receiver(self) -> Receiver:
        """The receiver of the readings."""
        return self.options.receiver_of(self.board)


def _in_plan(
    room: Room, poses: FloatArray, sensors: Sensors, board: Board, options: PredictionOptions, wanted: _Wanted
) -> _Readings:
    """Return the readings of sensors at poses (n, 3), of sound in the plan."""
    # a body is another post of the room at each pose
    body, at_once = board.mounting.body_radius, 1 if board.mounting.body_radius else _AT_ONCE
    count = sensors.headings.size

    def read(here: FloatArray) -> _Readings:
        around = with_body(room, _axis(board, here[0]), body) if body else room
        placed = sensors.at(here)
        sensor_count, of_each = placed[2].shape
        readings, open_ = _Readings.empty(sensor_count, of_each, wanted), np.ones((sensor_count, of_each), np.bool_)
        _read(_Batch(around, board, options, *placed, sensors.turns, wanted, readings, open_))
        return readings._replace(ranges=board.reported(readings.ranges)).of_poses(len(here))

    def predicted(begin: int, end: int) -> _Readings:
        readings = _Readings.empty(end - begin, count, wanted)
        for k in range(begin, end, at_once):
            here = poses[k : min(k + at_once, end)]
            readings.fill(slice(k - begin, k - begin + len(here)), read(here))
        return readings

    return _in_parts(len(poses), predicted)


def _axis(board: Board, pose: FloatArray) -> Place:
    """Return the turning axis of a board at a pose (3,)."""
    x, y, turn = pose.tolist()
    return board.at_axis(board.faced(Place("", (x, y), turn)))


def _read(batch: _Batch) -> None:
    """Fill in all readings: at each pose from paths up to the range by the surfaces ahead, then from longer ones."""
    lengths = 2 * batch.board.max_range * _LONGER ** np.arange(1 - _STAGES, 1.0)
    first = np.minimum(np.searchsorted(lengths, _reach_ahead(batch)), _STAGES - 1)
    # few paths of few poses are searched at once in less time; and the loudest arrival may be the last
    if batch.wanted.levels or (len(first) < _LEAST_POSES and batch.receiver is Receiver.FIRST_ECHO):
        first[:] = _STAGES - 1
    for stage, length in enumerate(lengths.tolist()):
        rows = np.flatnonzero((first <= stage) & batch.open.any(axis=1))
        for k in range(0, len(rows), _TOGETHER):
            _read_up_to(length, batch, rows[k : k + _TOGETHER])


def _reach_ahead(batch: _Batch) -> FloatArray:
    """Return a length, m, of paths that most readings of each pose need, (n,): by the surface straight ahead."""
    count = batch.headings.shape[1]
    starts = np.repeat(batch.positions, count, axis=0)
    ahead = distances_ahead(starts, batch.headings.ravel(), batch.room.surfaces).reshape(-1, count)
    return np.asarray(2 * _BEYOND * np.median(ahead, axis=1)) if count else np.zeros(len(ahead))


def _read_up_to(length: float, batch: _Batch, rows: NDArray[np.intp]) -> None:
    """Fill in the readings of these poses that are certain from paths up to a length, m."""
    try:
        paths, begins = _paths_up_to(length, batch, rows)
    except InputError:
        if len(rows) == 1:
            raise
        # too many paths at once
        for half in np.array_split(rows, 2):
            _read_up_to(length, batch, half)
        return
    row, column = np.nonzero(batch.open[rows])
    headings, of_heading = batch.headings[rows[row], column], np.column_stack((begins[row], begins[row + 1]))
    read = _by_board if batch.receiver is Receiver.BOARD else _by_first_echo
    distances, winners, known = read(length, batch, paths, begins, headings, of_heading)
    if length >= 2 * batch.board.max_range:
        known[:] = True
    row, column = rows[row[known]], column[known]
    batch.readings.ranges[row, column], batch.open[row, column] = distances[known], False
    if batch.wanted.levels or batch.wanted.paths:
        _describe(batch, (row, column), paths, begins, headings[known], of_heading[known], winners[known])


def _describe(
    batch: _Batch,
    readings: tuple[NDArray[np.intp], NDArray[np.intp]],
    paths: Paths,
    begins: NDArray[np.intp],
    headings: FloatArray,
    of_heading: NDArray[np.intp],
    winners: NDArray[np.intp],
) -> None:
    """Fill in levels and paths of these readings, at headings (h,) rad; `winners` (h,) are the rows of their paths."""
    by_board, all_arrivals = batch.receiver is Receiver.BOARD, batch.wanted.levels
    weighed, in_time = _weighed(batch, paths, begins), _in_time(batch, paths)
    levels = arrival_levels(headings, of_heading, weighed, in_time, winners, by_board, all_arrivals)
    if all_arrivals:
        batch.readings.over_threshold[readings] = decibels(levels.loudest) - batch.board.threshold_db
    if batch.wanted.paths:
        batch.readings.paths.fill(readings, paths_of_readings(paths, winners, decibels(levels.of_readings)))


def _in_time(batch: _Batch, paths: Paths) -> BoolArray:
    """Return which paths arrive after blanking and within range, (p,)."""
    return ~is_blanked(paths.lengths, batch.board, batch.room) & is_in_range(paths.lengths, batch.board)


def _weighed(batch: _Batch, paths: Paths, begins: NDArray[np.intp]) -> PathsAndBeam:
    """Return paths as what the board may detect; those of each place begin at a row, (n + 1,)."""
    room, board = batch.room, batch.board
    apart = np.repeat(_APART * np.arange(len(begins) - 1), np.diff(begins))
    sets = together(paths.lengths, paths.phases, board.wavelength(room.air), board, apart)
    ka = board.wavenumber(room.air) * board.aperture_radius
    return PathsAndBeam(
        paths.leaving,
        paths.arriving,
        strengths(room, board, paths),
        sets,
        np.empty((0, 0), np.bool_),
        10 ** (board.threshold_db / 20),
        ka,
        beam_table(ka),
    )


def _paths_up_to(length: float, batch: _Batch, rows: NDArray[np.intp]) -> tuple[Paths, NDArray[np.intp]]:
    """Return the paths up to a length from these poses, and where those of each begin, (n + 1,)."""
    room, board, options = batch.room, batch.board, batch.options
    rays, step = _rays_up_to(length, batch)
    search = replace(search_for(room, board, options), max_length=length, rays=rays, step=step)
    headings, receivers = batch.headings[rows], None if batch.receivers is None else batch.receivers[rows]
    if batch.turns:
        search = replace(search, leaving=_leaving(search, headings, batch.open[rows]))
    else:
        search = replace(search, axes=_axes(batch, headings[:, 0]))
    paths, begins = find_paths_of_places(room, batch.positions[rows], search, receivers)
    kept = _loud_enough(batch, paths, None if batch.turns else np.repeat(headings[:, 0], np.diff(begins)))
    return paths.select(kept), np.searchsorted(kept, begins)


def _rays_up_to(length: float, batch: _Batch) -> tuple[int, int]:
    """Return the number of rays of a search, and the step from one that is always followed to the next."""
    room, board, rays = batch.room, batch.board, batch.options.rays
    if not _is_for_loud_echoes(board, batch.receiver):
        step = _STEP_BY_POSTS if len(room.posts) else _STEP
    else:
        # as near to each other at the end of a short search as at that of a long one
        shorter = math.ceil(rays * length / (2 * board.max_range))
        rays, step = max(min(_LEAST_RAYS, rays), shorter), _STEP_OF_FEW
    # a body widens the gaps as posts do, at each pose
    return rays, 1 if board.mounting.body_radius else step


def _options_of(board: Board) -> PredictionOptions:
    return PredictionOptions(rays=_FEW_RAYS if _is_for_loud_echoes(board, board.receiver) else RAYS)


def _is_for_loud_echoes(board: Board, receiver: Receiver) -> bool:
    return receiver is Receiver.FIRST_ECHO and board.threshold_db >= _LOUD


def _loud_enough(batch: _Batch, paths: Paths, headings: FloatArray | None) -> NDArray[np.intp]:
    """Return the rows of paths that may matter at any heading, or at the heading (p,) rad of each."""
    room, board, below = batch.room, batch.board, KEPT_BELOW_THRESHOLD[batch.receiver]
    if headings is None:
        return loud_enough(room, board, paths, below)
    ka = board.wavenumber(room.air) * board.aperture_radius
    ahead = turned(paths.leaving, -headings), turned(paths.arriving, -headings)
    amplitudes = amplitudes_at(0.0, *ahead, strengths(room, board, paths), ka, beam_table(ka))
    return np.flatnonzero(np.abs(amplitudes) >= faintest_kept(board, below))


def _axes(batch: _Batch, headings: FloatArray) -> TransducerAxes:
    """Return the axes of transducers that send and receive along headings (n,) rad."""
    room, board = batch.room, batch.board
    below = KEPT_BELOW_THRESHOLD[batch.receiver]
    if batch.receiver is Receiver.FIRST_ECHO and not board.sum_arrivals:
        below = DIFFRACTED_ALONE
    faintest = faintest_kept(board, below) / largest_gain(board, room.air, 2 * board.max_range)
    return TransducerAxes(headings, headings, board.wavenumber(room.air) * board.aperture_radius, faintest)


def _leaving(search: PathSearch, headings: FloatArray, open_: BoolArray) -> FloatArray:
    """Return the most amplitude of each ray of the search at departure, at headings (n, m) that are open, (n, d)."""
    assert search.ka is not None
    leaving = np.zeros((len(headings), search.rays))
    _fill_leaving(search.directions, headings, open_, loudest_aside(search.ka), leaving)
    return leaving


@compiled
def _fill_leaving(
    directions: FloatArray, headings: FloatArray, open_: BoolArray, table: FloatArray, leaving: FloatArray
) -> None:
    """Fill in the result of `_leaving`; `table` is the most amplitude by the angle from the axis, from 0 to π."""
    for place in range(headings.shape[0]):
        count = 0
        for k in range(headings.shape[1]):
            count += open_[place, k]
        if count >= _MOST_OPEN * headings.shape[1]:
            leaving[place] = 1.0
            continue
        for k in range(headings.shape[1]):
            if not open_[place, k]:
                continue
            heading = headings[place, k] % math.tau
            for ray in range(directions.shape[0]):
                aside = abs(directions[ray] - heading)
                aside = abs(min(aside, math.tau - aside))
                amplitude = table[int(aside / math.pi * (table.shape[0] - 1))]
                leaving[place, ray] = max(leaving[place, ray], amplitude)


def _by_first_echo(
    length: float,
    batch: _Batch,
    paths: Paths,
    begins: NDArray[np.intp],
    headings: FloatArray,
    of_heading: NDArray[np.intp],
) -> tuple[FloatArray, NDArray[np.intp], BoolArray]:
    """Return the distance at each heading (h,) by the paper's receiver, m, its path, and whether both are certain.

    The path is a row, or -1 without an echo. Certain readings are those that no longer path can change.
    """
    in_time = np.flatnonzero(_in_time(batch, paths))
    here, begins, of_heading = paths.select(in_time), *(np.searchsorted(in_time, rows) for rows in (begins, of_heading))
    every, none = np.ones(len(here), np.bool_), np.zeros(len(headings))
    sought = Sought(True, none, np.inf, here.lengths, here.lengths / 2, every, -1.0)
    winners = np.append(in_time, -1)[detected(headings, of_heading, _weighed(batch, here, begins), sought)]
    # row -1, "no echo", selects the appended value
    lengths = np.append(paths.lengths, np.nan)[winners]
    certain = certain_length(length, batch.room, batch.board, Receiver.FIRST_ECHO)
    return lengths / 2, winners, np.asarray(lengths <= certain)


def _by_board(
    length: float,
    batch: _Batch,
    paths: Paths,
    _begins: NDArray[np.intp],
    headings: FloatArray,
    of_heading: NDArray[np.intp],
) -> tuple[FloatArray, NDArray[np.intp], BoolArray]:
    """Return what `_by_first_echo` returns, by the board's own receiver."""
    speed = batch.room.air.speed_of_sound
    amplitudes = strengths(batch.room, batch.board, paths) * np.exp(1j * paths.phases)
    sound = Sound(paths.lengths / speed, amplitudes, paths.leaving, paths.arriving, np.empty((0, 0), np.bool_))
    times, winners = first_echoes(headings, sound, batch.board, speed, of_heading)
    certain = certain_length(length, batch.room, batch.board, Receiver.BOARD)
    return times * speed / 2, winners, np.asarray(times * speed <= certain)
