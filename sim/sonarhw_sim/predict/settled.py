"""A prediction in one call, from paths no longer than its readings need; the others are searched when asked for.

Most readings are of sound that travels a small part of the board's range, and nearly all paths are longer. So a few
rays estimate how far the readings need paths, and all rays are followed so far. Readings are those of the whole search.
A heading without an echo needs all paths, so a scan with one is searched as a whole.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from sonarhw import arguments
from sonarhw.readings import FloatArray
from sonarhw_sim.air import DEFAULT_BOARD, Model, Receiver, Unit
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.board.signal import RATE, pulse_table
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import (
    PredictionOptions,
    paths_for,
    paths_serve_all_headings,
    predict_scan,
    predict_with,
    scan_of_paths,
    search_for,
    weigh_paths,
)
from sonarhw_sim.rays.fan import distances_ahead
from sonarhw_sim.rays.paths import Paths, paths_of_few_rays
from sonarhw_sim.room.room import Place, Room, load_room, place_doubts

_FEW_RAYS, _MANY_RAYS = 360, 1440
_AHEAD = 3.1  # times the way to the farthest surface ahead and back: how far the few rays are followed first
_CERTAIN = 0.99  # of the length of a search: near its end, rays that posts spread may miss a path
_BEYOND = 1.01  # of the length that the few rays find
_FAR_APART = 1.5  # ratio of the longest reading to most: the readings of most headings are searched first
_MOST = 0.95  # share of headings
_LONGER = 1.3  # ratio of two searches
_MANY = 6.0  # reflections of sound on the longest paths: with fewer, the whole search takes as long as two shorter ones
_WHOLE = 0.85  # of the whole length: a search so long takes about as much time as the whole one


def predict_readings(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions | None = None
) -> PredictedScan:
    """Return the scan of `predict_scan`, with paths that are not searched before they are asked for.

    Readings, `PredictedScan.reported_paths` and the scan's `near` do without them. Raises what `predict_scan` raises;
    for too many paths, only when these are searched.
    """
    options, headings = options or PredictionOptions(), np.ascontiguousarray(headings, dtype=np.float64)
    one_search = place.height is None and paths_serve_all_headings(board, options.unit)
    all_rays = options.rays >= _MANY_RAYS  # fewer take as long as the estimate
    if not (len(headings) and one_search and all_rays and is_planar(room, board, options)):
        return predict_scan(room, place, board, headings, options)
    for length in _lengths(room, place, board, headings, options):
        scan = weigh_paths(room, place, board, headings, paths_for(room, place, board, options, length), options)
        if _is_settled(scan, length):
            return replace(scan, paths=PathsOnDemand.of(scan.paths, partial(_all_paths, scan, options)))
    return predict_scan(room, place, board, headings, options)


def is_planar(room: Room, board: Board, options: PredictionOptions) -> bool:
    """Return whether sound travels in the plan, without noise, scattering, and faces in its way."""
    return (
        options.unit is Unit.PASS
        and not (options.noise or options.single or (options.own_body and board.own_body))
        and not room.tables
        and not room.scattered[: room.levels.start].any()
    )


def certain_length(length: float, room: Room, board: Board, receiver: Receiver) -> float:
    """Return twice the distance, m, up to which readings are certain if all paths up to `length` (m) are known."""
    if receiver is Receiver.BOARD:
        # pulses begin before their path ends, and the sample after a detection decides on its time
        speed = room.air.speed_of_sound
        return length - (pulse_table(board, speed).lead + 2) / RATE * speed
    return length - (board.wavelength(room.air) if board.sum_arrivals else 0.0)


def _lengths(room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions) -> list[float]:
    """Return the lengths (m) of searches that are likely to settle all readings, shorter ones first."""
    whole, start = _WHOLE * 2 * board.max_range, np.array(board.at_axis(place).position)
    distances = distances_ahead(np.tile(start, (len(headings), 1)), headings, room.surfaces)
    # Sound that leaves the room seldom returns, and only all paths show it. In a large room, readings need most paths,
    # and these are few.
    if not _MANY * distances.mean() < whole:
        return []
    ahead = 2 * float(distances.max())
    needed, receiver = np.sort(_estimated(room, place, board, headings, options, ahead)), options.receiver_of(board)
    most, farthest = float(needed[math.ceil(_MOST * len(needed)) - 1]), float(needed[-1])
    lengths = [farthest, _LONGER * farthest]
    if farthest > _FAR_APART * most:
        # at the others, an earlier echo is likely, of sound past an edge or through a gap, which the few rays miss
        lengths.insert(0, most)
    later = whole - certain_length(whole, room, board, receiver)
    lengths = [(_BEYOND * length + later) / _CERTAIN for length in lengths[:2]]  # three take longer than the whole
    return [length for length in lengths if length <= whole]


def _estimated(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions, ahead: float
) -> FloatArray:
    """Return about how long paths have to be for each reading, (n,) m; inf: nearly as long as possible, or longer.

    `ahead` (m) is the way to the farthest surface straight ahead and back.
    """
    search, longest = replace(search_for(room, board, options), rays=_FEW_RAYS), _WHOLE * 2 * board.max_range
    rough, lengths = replace(options, receiver=Receiver.FIRST_ECHO), np.empty(0)
    for length in sorted({min(_AHEAD * ahead, longest), longest}):
        paths = paths_of_few_rays(room, board.at_axis(place).position, replace(search, until=length))
        lengths = 2 * weigh_paths(room, place, board, headings, paths, rough).distances
        if not np.isnan(lengths).any():
            break
    return np.where(np.isnan(lengths), math.inf, lengths)


def _is_settled(scan: PredictedScan, length: float) -> bool:
    """Return whether no path that is longer than `length` (m) changes a reading of the scan or its level."""
    certain, board = _CERTAIN * length, scan.board
    if not (2 * scan.distances <= certain_length(certain, scan.room, board, scan.receiver)).all():
        return False
    ends = scan.paths.lengths[scan.winners[scan.winners >= 0]] + board.wavelength(scan.room.air)
    return bool((ends <= certain).all())


def _all_paths(scan: PredictedScan, options: PredictionOptions) -> Paths:
    """Return all paths of the scan of `predict_scan`."""
    room, place, board = scan.room, scan.place, scan.board
    return scan_of_paths(room, place, board, scan.headings, paths_for(room, place, board, options), options).paths


class PathsOnDemand(Paths):
    """Paths of which only the first are known until a column of all is asked for, which then are `Paths`."""

    @staticmethod
    def of(first: Paths, search: Callable[[], Paths]) -> Paths:
        """Return the paths that `search` returns, which begin with `first`."""
        paths = object.__new__(PathsOnDemand)
        paths.__dict__.update(_first=first, _search=search)
        return paths

    @property
    def known(self) -> Paths:
        """The paths that are known without a search."""
        first: Paths = self.__dict__["_first"]
        return first

    def __getattr__(self, name: str) -> object:
        """Return a column, after the search for all paths."""
        if name not in (column.name for column in fields(Paths)):
            raise AttributeError(name)
        everything = self.__dict__["_search"]()
        self.__dict__.update(everything.__dict__)
        object.__setattr__(self, "__class__", Paths)
        return self.__dict__[name]


# a prediction in one call: `predict` of `sonarhw`


STEP = 5  # degrees, as in `sonarhw simulate`


@arguments.checked(
    room=arguments.instance((Room, Path, str), "a room, its name or its file; `room_from_arrays` makes one of arrays"),
    board=arguments.instance((Board, Path, str), "a board, its name or its file"),
    degrees=arguments.flag,
    model=arguments.choice(Model),
    options=arguments.instance(PredictionOptions, "PredictionOptions"),
)
def predict(
    room: Room | Path | str,
    place: Place | Sequence[float] | FloatArray | str | None = None,
    board: Board | Path | str = DEFAULT_BOARD,
    headings: ArrayLike | None = None,
    *,
    degrees: bool = False,
    model: Model = Model.RAY_FOLLOWING,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan that a board is predicted to report at a place of a room.

    Room and board are objects, names or files. The place is a name, x and y in m with no heading or one in rad, or an
    object; by default the only place of the room. `headings` (n,) are rad in the room, or degrees with `degrees`; by
    default a whole turn in steps of 5 degrees, or those of the sensors of a ring. The default options have the receiver
    of the board profile. Raises InputError. Emits a Python warning if the place is outside the room or inside an
    object, if headings are probably degrees, or if noise hides the echoes.
    """
    room = room if isinstance(room, Room) else load_room(room)
    profile = board if isinstance(board, Board) else load_board(board)
    here = room.place(place)
    for doubt in place_doubts(room, here):
        arguments.emit(doubt)
    if headings is None:
        radians = np.radians(np.arange(0, 360, STEP)) if profile.ring is None else profile.ring.headings(here)
    else:
        radians = arguments.angles("headings", headings)
        radians = arguments.in_radians("headings", radians, degrees)
    if model is Model.RAY_FOLLOWING:
        scan = predict_readings(room, here, profile, radians, options)
    else:
        scan = predict_with(model, room, here, profile, radians, options)
    for doubt in noise_doubts(profile, scan.noise, scan.receiver):
        arguments.emit(doubt)
    return scan


_LOUD_NOISE, _QUIET_NOISE = 0.4, 0.2  # of the threshold: a third and a twelfth of the laboratory's readings are noise


def noise_doubts(board: Board, noise: float, receiver: Receiver) -> tuple[str, ...]:
    """Return a warning if the noise (rms, 1 is full scale) crosses the threshold in many pings before an echo does."""
    threshold = 10 ** (board.threshold_db / 20)
    if receiver is not Receiver.BOARD or noise < _LOUD_NOISE * threshold:
        return ()
    return (
        f"noise {noise:g}: crosses the threshold, {threshold:.2g} of full scale, in many pings, so that many readings "
        f"are of noise; with {_QUIET_NOISE * threshold:.2g}, most are of echoes",
    )
