"""Predict a scan by one of the models: options, paths of a place, and the reading at each heading."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from sonarhw import arguments
from sonarhw.readings import FloatArray
from sonarhw_sim.air import EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.board.profile import Board, largest_gain
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.predicted_scan import (
    FAINTEST_PATCH,
    KEPT_BELOW_THRESHOLD,
    PredictedScan,
    SensorPair,
    faintest_kept,
    find_by_heading,
    joined,
    loud_enough,
    path_amplitudes,
    silent_scan,
    strengths,
    whole_microdegrees,
    with_own_body,
    with_readings,
)
from sonarhw_sim.rays.fan import TransducerAxes, first_hit
from sonarhw_sim.rays.paths import MAX_BOUNCES, RAYS, Paths, PathSearch
from sonarhw_sim.room.grid import Surfaces
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.space.sections import cut, paths_from, spanning_at

# ray following: paths are found once for a scan, unless more than the beam turns with the head


# dB. The number of diffracted paths is infinite. A board that detects each path alone needs those down to so far below
# its threshold; one that adds arrivals needs all that are kept.
DIFFRACTED_ALONE = 3.0


_OPTIONS: dict[str, arguments.Check] = {
    "unit": arguments.choice(Unit),
    "max_bounces": arguments.whole(0),
    "diffraction": arguments.flag,
    "rays": arguments.whole(1),
    "edge_strength": arguments.choice(EdgeStrength),
    "receiver": arguments.choice(Receiver),
    "noise": arguments.number(0),
    "seed": arguments.whole(0),
    "single": arguments.flag,
    "grain": arguments.whole(0),
    "sections": arguments.whole(1),
    "shadows": arguments.flag,
    "small": arguments.flag,
    "own_body": arguments.flag,
}
_OR_NONE = ("edge_strength", "receiver", "seed", "grain")


@dataclass(frozen=True)
class PredictionOptions:
    """Options of a prediction; the defaults are those of every command."""

    unit: Unit = Unit.PASS
    max_bounces: int = MAX_BOUNCES
    diffraction: bool = True
    rays: int = RAYS
    edge_strength: EdgeStrength | None = None  # None: that of the board profile
    receiver: Receiver | None = None  # None: that of the board profile
    noise: float = 0.0  # of the receiver, root mean square, 1 is full scale; no effect on the paper's receiver
    seed: int | None = None  # of random numbers; None: 0 for `noise`, and no random range errors
    single: bool = False  # only paths of one reflection or one edge
    grain: int | None = None  # seed of the speckle of rough surfaces; None: their mean power
    sections: int = 1  # number of horizontal sections across the face, for a place with a height
    shadows: bool = True  # whether sound bends past obstacles on the way out and back, and past thin posts
    small: bool = True  # whether small walls that sound meets as one thing are solved by the wave, up to 2 s for each
    own_body: bool = False  # also the echoes of the carrier's own body (`own_body` of the board)

    def __post_init__(self) -> None:
        for name, check in _OPTIONS.items():
            value = getattr(self, name)
            if value is not None or name not in _OR_NONE:
                object.__setattr__(self, name, check(name, value))

    def receiver_of(self, board: Board, model: Model = Model.RAY_FOLLOWING) -> Receiver:
        """Return the receiver of a prediction; models of nearest walls have the paper's, unless one is chosen."""
        return self.receiver or (board.receiver if model.follows_sound else Receiver.FIRST_ECHO)


def predict_scan(
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    options: PredictionOptions | None = None,
    paths: Paths | None = None,
) -> PredictedScan:
    """Return the scan that `board` would report at `place` and at `headings` (n,) rad in the room.

    The heading of the place is the actual one of the turntable's zero (`Board.faced`). Known `paths` of this place and
    board are reused if one search serves all headings.

    Raises InputError if the board is a ring and has no sensor at one of the headings.
    """
    options = options or PredictionOptions()
    if len(headings) and not paths_serve_all_headings(board, options.unit):
        return received_by(_scan_by_heading(room, place, board, headings, options), options)
    paths = paths_for(room, place, board, options) if paths is None else paths
    return weigh_paths(room, place, board, headings, paths, options)


def weigh_paths(
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    paths: Paths,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan of known paths that serve all headings, without paths that are too faint at every heading."""
    options = options or PredictionOptions()
    return received_by(scan_of_paths(room, place, board, headings, paths, options), options)


def scan_of_paths(
    room: Room, place: Place, board: Board, headings: FloatArray, paths: Paths, options: PredictionOptions
) -> PredictedScan:
    """Return the scan of `weigh_paths` without readings."""
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    paths = paths.select(loud_enough(room, board, paths, _kept_below(board, options)))
    return silent_scan(room, place, board, headings, paths, None, options.unit)


def _kept_below(board: Board, options: PredictionOptions) -> float:
    """Return how far below the threshold paths are kept, dB."""
    return KEPT_BELOW_THRESHOLD[options.receiver_of(board)]


def received_by(scan: PredictedScan, options: PredictionOptions) -> PredictedScan:
    """Return a scan without readings as the receiver of `options` reports it, with their noise."""
    receiver = options.receiver_of(scan.board)
    silent = replace(scan, receiver=receiver, noise=options.noise, seed=options.seed or 0, grain=options.grain)
    scan = with_readings(silent)
    return with_own_body(scan) if options.own_body and scan.board.own_body else scan


def paths_serve_all_headings(board: Board, unit: Unit) -> bool:
    """Return whether the paths are the same at every heading, so that one search is enough for a scan."""
    return board.mounting.turns_about_face and unit is not Unit.REFLECT


def paths_for(room: Room, place: Place, board: Board, options: PredictionOptions, until: float = math.inf) -> Paths:
    """Return every path that `board` could detect at `place` at any heading, if one search serves all headings.

    Only paths up to a length of `until` (m) are searched.
    """
    search = replace(search_for(room, board, options), until=until)
    return _paths(room, board.at_axis(place), board, search, options)


def search_for(room: Room, board: Board, options: PredictionOptions) -> PathSearch:
    """Return the search for all paths that `board` could detect."""
    max_length = 2 * board.max_range
    # other air hardly changes the level at an edge; a fixed gain changes it much
    gained = largest_gain(board, room.air, max_length) if board.fixed_gain else 1.0
    below = _kept_below(board, options) if board.sum_arrivals else DIFFRACTED_ALONE
    return PathSearch(
        max_length,
        board.wavelength(room.air),
        options.max_bounces,
        options.diffraction,
        options.rays,
        options.edge_strength or board.edge_strength,
        10 ** ((board.threshold_db - below) / 20) / gained,
        ka=board.wavenumber(room.air) * board.aperture_radius,
        shadows=options.shadows,
        small=options.small,
    )


def _paths(
    room: Room,
    place: Place,
    board: Board,
    search: PathSearch,
    options: PredictionOptions,
    receiver: tuple[float, float] | None = None,
) -> Paths:
    paths = paths_from(room, place, search, receiver, board.aperture_radius, options.sections)
    return paths.select(np.flatnonzero(paths.bounces + (paths.edges >= 0) <= 1)) if options.single else paths


def _scan_by_heading(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    search = search_for(room, board, options)
    faintest = faintest_kept(board, _kept_below(board, options))
    ka = board.wavenumber(room.air) * board.aperture_radius
    gained = largest_gain(board, room.air, search.max_length)

    def find(room_with_faces: Room, pair: SensorPair) -> Paths:
        start, end = replace(place, position=pair.sender.sender), pair.listener.receiver
        axes = TransducerAxes(np.array([pair.sender.heading]), np.array([pair.listener.heading]), ka, faintest / gained)
        search_pair = replace(search, max_length=pair.max_length, axes=axes)
        # with one point for both, a search uses every partial path twice
        paths = _paths(room_with_faces, start, board, search_pair, options, None if start.position == end else end)
        sender_headings = np.full(len(paths), pair.sender.heading)
        without_beam = strengths(room, board, paths)
        amplitudes = path_amplitudes(room, board, pair.listener.heading, paths, without_beam, sender_headings)
        return paths.select(
            np.flatnonzero(np.abs(amplitudes) >= np.where(paths.scattered, FAINTEST_PATCH, 1.0) * faintest)
        )

    return find_by_heading(room, place, board, headings, find, options.unit)


# models: each is a function with the arguments of `predict_scan` that returns a `PredictedScan`


CONE_HALF_ANGLE = math.radians(15)  # the "±15° cone" of robotics
_CONE_RAYS = 121
# Spread of readings of one surface at range z: σ = 0.01 m + 0.015 z, as used in maps made with Polaroid units, errors
# of the map included. The paper (§1, citing Lange, Korba, Wong 1989) only adds that the far tail is slightly longer.
# Its exponential form and its scale of σ/2 are our assumption.
SPREAD = 0.01  # m
SPREAD_BY_RANGE = 0.015
FAR_TAIL = 0.5


ModelFunction = Callable[[Room, Place, Board, FloatArray, PredictionOptions], PredictedScan]
_FUNCTIONS: dict[Model, ModelFunction] = {Model.RAY_FOLLOWING: predict_scan}


def predict_with(
    model: Model,
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan that `model` predicts for `board` at `place` and at `headings` (n,) rad in the room."""
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    return _FUNCTIONS[model](room, place, board, headings, options or PredictionOptions())


def predict_along(
    model: Model,
    room: Room,
    places: Sequence[Place],
    board: Board,
    headings: FloatArray,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan of a sensor that moves: the place and the heading (n,) rad in the room of each reading.

    The places are as in `predict_scan`, at least one.
    """
    groups = [[*rows] for _, rows in groupby(range(len(places)), key=lambda row: places[row])]
    return joined([predict_with(model, room, places[rows[0]], board, headings[rows], options) for rows in groups])


def predicts(model: Model) -> Callable[[ModelFunction], ModelFunction]:
    """Return a decorator that makes a function the prediction of `model`."""

    def register(function: ModelFunction) -> ModelFunction:
        _FUNCTIONS[model] = function
        return function

    return register


@predicts(Model.KUC_SIEGEL)
def _single_reflections(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    return predict_scan(room, place, board, headings, replace(options, max_bounces=1, single=True))


@predicts(Model.NEAREST)
def _nearest_ahead(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    options = replace(options, receiver=options.receiver_of(board, Model.NEAREST))
    scan = _nearest_wall(room, place, _without_blanking(board, options), headings, np.zeros(1))
    return received_by(scan if options.seed is None else _with_errors(scan, options.seed), options)


@predicts(Model.CONE)
def _nearest_in_cone(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    options = replace(options, receiver=options.receiver_of(board, Model.CONE))
    cone = np.linspace(-CONE_HALF_ANGLE, CONE_HALF_ANGLE, _CONE_RAYS)
    return received_by(_nearest_wall(room, place, _without_blanking(board, options), headings, cone), options)


def _without_blanking(board: Board, options: PredictionOptions) -> Board:
    """Return the board for the two models of nearest walls: with the paper's receiver, it has no blanking."""
    if options.receiver_of(board) is Receiver.BOARD:
        return board
    return replace(board, blanking=0.0, blanking_inhibit=None)


def _with_errors(scan: PredictedScan, seed: int) -> PredictedScan:
    """Return the scan with a random error on every range, a function of the seed and its heading."""
    assert scan.only_at is not None
    distances = scan.paths.lengths / 2
    drawn = np.array([_range_error(seed, float(heading)) for heading in scan.headings[scan.only_at]])
    errors = drawn * (SPREAD + SPREAD_BY_RANGE * distances)
    return replace(scan, lateness=2 * np.maximum(errors, -distances))


def _range_error(seed: int, heading: float) -> float:
    """Return an error of mean 0 in units of σ: normal with σ 1, plus exponential with scale FAR_TAIL."""
    random = np.random.default_rng((seed, 4, whole_microdegrees(heading)))
    return float(random.normal() + FAR_TAIL * (random.exponential() - 1))


def _nearest_wall(room: Room, place: Place, board: Board, headings: FloatArray, cone: FloatArray) -> PredictedScan:
    """Return a scan without readings: at each heading, the path to the nearest surface within heading + `cone`."""
    starts = np.array([board.mounting.pose(board.at_axis(place), float(heading)).receiver for heading in headings])
    spanning = spanning_at(room, place.height)
    section = cut(room, spanning)
    distances, directions, surfaces = _nearest_hits(starts.reshape(-1, 2), headings[:, None] + cone, section.surfaces)
    rows = np.argsort(distances, kind="stable")
    rows = rows[surfaces[rows] >= 0]
    distances, directions, surfaces = distances[rows], directions[rows], surfaces[rows]
    paths = Paths(
        lengths=2 * distances,
        departures=headings[rows],  # these models treat every surface as straight ahead
        arrivals=headings[rows],
        gains=np.ones(len(rows)),
        phases=np.zeros(len(rows)),
        spreads=np.zeros(len(rows)),
        surfaces=np.array(spanning, dtype=np.int32)[surfaces].reshape(-1, 1),
        edges=np.full(len(rows), -1, dtype=np.int32),
        bends=np.ones(len(rows), dtype=np.int32),
        elevations=np.zeros((len(rows), 2)),
        points=_there_and_back(starts[rows], directions, distances),
    )
    return silent_scan(room, place, board, headings, paths, rows)


@compiled
def _nearest_hits(
    starts: FloatArray, directions: FloatArray, surfaces: Surfaces
) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return distance, direction and surface of the nearest hit of each row of directions (n, m) from starts (n, 2).

    Distances and starts are in m, directions in rad. Without a hit, the distance is inf and the surface -1. Of equal
    distances, the first is used.
    """
    count = len(starts)
    distances, chosen, hit = np.full(count, np.inf), np.zeros(count), np.full(count, -1, np.intp)
    for k in range(count):
        for direction in directions[k]:
            dx, dy = math.cos(direction), math.sin(direction)
            distance, surface = first_hit(starts[k, 0], starts[k, 1], dx, dy, -1, surfaces)
            if distance < distances[k]:
                distances[k], chosen[k], hit[k] = distance, direction, surface
    return distances, chosen, hit


def _there_and_back(starts: FloatArray, directions: FloatArray, distances: FloatArray) -> FloatArray:
    touches = starts + distances[:, None] * np.column_stack((np.cos(directions), np.sin(directions)))
    points = np.full((len(directions), 4, 2), np.nan)
    points[:, 0], points[:, 1], points[:, 2] = starts, touches, starts
    return points
