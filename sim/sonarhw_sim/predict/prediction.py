"""The prediction: the reading of the board at each heading, and its path.

Paths are found once for a whole scan, then weighted by the transducer at each heading and compared with blanking,
threshold and range. If more than the beam turns with the head, every heading has paths of its own
(`sonarhw_sim.predict.by_heading`).
"""

from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.board.gain import largest_gain
from sonarhw_sim.board.mount import FACE_REFLECTANCES
from sonarhw_sim.board.profile import Board
from sonarhw_sim.choices import EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.predict.board_readings import with_own_body, with_readings
from sonarhw_sim.predict.by_heading import SensorPair, find_by_heading
from sonarhw_sim.predict.levels import KEPT_BELOW_THRESHOLD, faintest_kept, loud_enough, path_amplitudes, strengths
from sonarhw_sim.predict.predicted_scan import PredictedScan, silent_scan
from sonarhw_sim.rays.detectable import TransducerAxes
from sonarhw_sim.rays.paths import MAX_BOUNCES, RAYS, Paths, PathSearch
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.sections import paths_from

# dB. The number of diffracted paths is infinite. A board that detects each path alone needs those down to so far below
# its threshold; one that adds arrivals needs all that are kept.
_DIFFRACTED_ALONE = 3.0
_PATCH = 0.01  # share of the faintest amplitude of other paths: the power of many patches adds up


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
    own_body: bool = False  # also the echoes of the carrier's own body (`own_body` of the board)

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


def paths_for(room: Room, place: Place, board: Board, options: PredictionOptions) -> Paths:
    """Return every path that `board` could detect at `place` at any heading, if one search serves all headings."""
    return _paths(room, board.at_axis(place), board, search_for(room, board, options), options)


def search_for(room: Room, board: Board, options: PredictionOptions) -> PathSearch:
    """Return the search for all paths that `board` could detect."""
    max_length = 2 * board.max_range
    # other air hardly changes the level at an edge; a fixed gain changes it much
    gained = largest_gain(board, room.air, max_length) if board.fixed_gain else 1.0
    below = _kept_below(board, options) if board.sum_arrivals else _DIFFRACTED_ALONE
    return PathSearch(
        max_length,
        board.wavelength(room.air),
        options.max_bounces,
        options.diffraction,
        options.rays,
        options.edge_strength or board.edge_strength,
        10 ** ((board.threshold_db - below) / 20) / gained,
        ka=board.wavenumber(room.air) * board.aperture_radius,
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
        axes = TransducerAxes(pair.sender.heading, pair.listener.heading, ka, faintest / gained)
        search_pair = replace(search, max_length=pair.max_length, axes=axes)
        # with one point for both, a search uses every partial path twice
        paths = _paths(room_with_faces, start, board, search_pair, options, None if start.position == end else end)
        sender_headings = np.full(len(paths), pair.sender.heading)
        without_beam = strengths(room, board, paths)
        amplitudes = path_amplitudes(room, board, pair.listener.heading, paths, without_beam, sender_headings)
        return paths.select(np.flatnonzero(np.abs(amplitudes) >= np.where(paths.scattered, _PATCH, 1.0) * faintest))

    found = find_by_heading(room, board.at_axis(place), board, headings, find, FACE_REFLECTANCES[options.unit])
    scan = silent_scan(found.room, place, board, headings, found.paths, found.only_at, options.unit)
    return replace(scan, sender_headings=found.sender_headings, lateness=found.lateness)
