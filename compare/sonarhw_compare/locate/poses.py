"""The possible poses of a scan in a whole room, with the probability of each.

A lattice over the free space of the room is scored at every heading (`pose_search`). The likelihood of a fit is then
maximized from the best maxima of the lattice and from the places of the room. The weights of these peaks are the
posterior for a uniform prior over the room, or for a normal one of the position or heading if it is roughly known.

Neighbouring readings of one echo have the same error: an edge that is too loud in the model is too loud at ten
headings. The likelihood assumes independent errors, so its logarithm is divided by the number of readings per
independent one.

No model of a real room is exact, and then one scan prefers one of two similar poses too clearly: another scan from the
same place would prefer the other. The posterior is therefore averaged over bootstrap samples of the readings (Huggins
and Miller, Reproducible model selection using bagged posteriors, Bayesian Analysis 18, 2023).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp, softmax
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, wall_distances

from sonarhw.errors import InputError, counted
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.fit.fitting import check_fit
from sonarhw_compare.fit.likelihood.objective import MODERATE, Problem, make_problem
from sonarhw_compare.fit.search.pose_search import QUICK, Scores, at_marks, best_apart, local_maxima, score_positions
from sonarhw_compare.fit.search.refine import Peak, covariance_of, highest, peak_at, refined
from sonarhw_compare.fit.values.fit_result import FitOptions, PlacedScan
from sonarhw_compare.fit.values.parameters import free_parameters
from sonarhw_compare.free_space import find_free_space
from sonarhw_compare.headings import turned_near
from sonarhw_compare.locate.pose_spread import NOWHERE, UNKNOWN, PoseSpread, scores_with_prior, with_prior
from sonarhw_compare.matching.block_bootstrap import drawn_blocks
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.matching.regions import angles_and_ranges, mean_run

_POSITIONS = 500  # of the lattice, about
_FINEST = 0.06  # m, smallest spacing
_MAXIMA = 12  # of the lattice, that are refined
_HOPELESS = 60.0  # largest deficit of the log-likelihood of the lattice for a start
_PROMISING = 12.0  # largest deficit of the tempered log-likelihood, after rough refinement, for a full one
_CLIMBS = 3  # most repetitions of the full refinement
_SAME = 0.03  # m between poses that count as the same
_SAME_HEADING = math.radians(10)
_LEAST = 1e-3  # smallest probability of a reported pose
FEWEST = 7  # independent readings of a scan whose probabilities mean something; a pose has four values
NEAR = 0.1  # m, largest distance of a pose that counts as a place of the room


@dataclass(frozen=True)
class Pose:
    """One possible pose."""

    position: tuple[float, float]  # m
    heading: float  # rad, of turntable step 0 in the room, -π..π
    offset: float  # m, added to every measured range
    probability: float
    deviations: tuple[float, float, float]  # standard deviations of x and y, m, and of the heading, rad


@dataclass(frozen=True)
class Located:
    """The possible poses of a scan."""

    room: Room
    board: Board
    readings: tuple[Reading, ...]
    poses: tuple[Pose, ...]  # most probable first; the probabilities add up to almost 1
    scores: Scores  # rough log-likelihoods of the lattice
    redundancy: float  # number of readings per independent reading
    explained: float  # share of the echoes within 5 cm of the prediction at the most probable pose

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the stated probabilities may be wrong, a line each."""
        independent = len(self.readings) / self.redundancy
        if independent >= FEWEST:
            return ()
        return (
            f"only {counted(round(independent), 'independent reading')}, expected at least {FEWEST}: a wrong pose may "
            "be stated as certain; scan a wider sector, or locate a scan from another place too",
        )

    @property
    def lattice(self) -> FloatArray:
        """Rough log-posterior of each position of the lattice, (p,); the best is 0, positions without paths -inf."""
        summed = logsumexp(self.scores.scores / self.redundancy, axis=1)
        return np.asarray(summed - summed.max())

    @property
    def peaks(self) -> list[tuple[float, float, float]]:
        """Poses (x, y, heading rad) of local maxima of the lattice, best first, also if they are very improbable."""
        return at_marks(self.board, local_maxima(self.scores, _MAXIMA, _HOPELESS))

    def place_near(self, pose: Pose, near: float = NEAR) -> str | None:
        """Return the name of the place nearest to a pose; None without one within `near` (m)."""
        away = {name: math.dist(pose.position, place.position) for name, place in self.room.places.items()}
        name = min(away, key=away.__getitem__, default=None)
        return None if name is None or away[name] > near else name

    def places(self, near: float = NEAR) -> dict[str, float]:
        """Return the probability of each place of the room, given that the scan was taken at one of them.

        A pose within `near` (m) of a place counts for the nearest one. Without such a pose, all are 0.
        """
        shares = dict.fromkeys(self.room.places, 0.0)
        for pose in self.poses:
            if (name := self.place_near(pose, near)) is not None:
                shares[name] += pose.probability
        whole = sum(shares.values())
        return {name: share / whole if whole else 0.0 for name, share in shares.items()}


def locate_scan(
    readings: Sequence[Reading],
    room: Room,
    board: Board,
    *,
    prediction: PredictionOptions | None = None,
    height: float | None = None,
    expected: Place = NOWHERE,
    spread: PoseSpread = UNKNOWN,
    tick: Callable[[float], None] = lambda _share: None,
) -> Located:
    """Return the possible poses of a scan in a room.

    `height` (m) of the transducer includes floor, ceiling and the heights of walls in the prediction. `expected` is the
    place at which the pose is known within `spread`. `tick` receives the completed share, 0..1. Raises InputError if no
    reading has an echo, the board is a ring of sensors, the height is not between floor and ceiling, or no position in
    the room has a path to an echo.
    """
    if height is not None:
        room.check_height(height)
    options = FitOptions(prediction=prediction or PredictionOptions())
    free = free_parameters(("position", "heading", "offset"), ("scan",), room, board)
    scan = PlacedScan(readings, Place("", (0.0, 0.0), height=height))
    check_fit([scan], board, free, options)
    readings = without_own_body(board.own_body, readings)
    redundancy = mean_run(*angles_and_ranges(readings))
    free = with_prior(free, expected, spread, redundancy)
    problem = make_problem([scan], room, board, free, options.prediction, all_echoes=options.all_echoes)
    scores = _score_lattice(problem, lambda share: tick(0.5 * share))
    scores = scores_with_prior(scores, expected, spread, redundancy)
    if not np.isfinite(scores.scores).any():
        raise InputError(
            f"room {room.name!r}, board {board.name!r}: from no position in this room can this board have an echo as "
            "near as those of the scan; check the room, the board and its blanking"
        )
    starts = _starts(scores, room, board)
    tops = _tops(problem, starts, redundancy, lambda share: tick(0.5 + 0.5 * share))
    poses = _weighed(_clear(_different(tops), room, board), redundancy)
    tick(1.0)
    explained = _explained(readings, room, board, poses[0], replace(scan.place, position=poses[0].position), options)
    return Located(room, board, tuple(readings), poses, scores, redundancy, explained)


def _explained(
    readings: Sequence[Reading], room: Room, board: Board, pose: Pose, place: Place, options: FitOptions
) -> float:
    echoes = [reading for reading in readings if reading.range is not None]
    headings = np.array([board.heading_at(reading.angle, pose.heading) for reading in echoes])
    place = board.faced(replace(place, heading=pose.heading))
    measured = np.array([reading.range for reading in echoes], dtype=np.float64) + pose.offset
    predicted = predict_scan(room, place, board, headings, options.prediction).ranges
    return float((np.abs(measured - predicted) <= TOLERANCE).mean())


def _score_lattice(problem: Problem, tick: Callable[[float], None]) -> Scores:
    room = problem.room
    whole = find_free_space(room)
    area = float(whole.free.sum()) * whole.spacing**2
    spacing = max(_FINEST, math.sqrt(area / _POSITIONS))
    positions = find_free_space(room, spacing).middles
    done = iter(range(len(positions)))
    return score_positions(
        problem.scans[0],
        room,
        problem.board,
        positions,
        spacing,
        problem.places[0].height,
        lambda: tick(next(done) / len(positions)),
    )


def _starts(scores: Scores, room: Room, board: Board) -> list[tuple[float, float, float]]:
    """Return the starts (x, y, heading): the best of the lattice, and the room's places with their best headings."""
    best = float(scores.scores.max())
    tops = best_apart(scores, _MAXIMA)
    tops = [pose for pose in tops if best - scores.scores[_nearest(scores, pose[:2])].max() < _HOPELESS]
    starts = at_marks(board, tops)
    for place in room.places.values():
        row = scores.scores[_nearest(scores, place.position)]
        if best - row.max() < _HOPELESS:
            starts.append((*place.position, float(scores.headings[row.argmax()])))
    return starts


def _nearest(scores: Scores, position: tuple[float, float]) -> int:
    return int(np.hypot(*(scores.positions - position).T).argmin())


def _tops(
    problem: Problem, starts: list[tuple[float, float, float]], redundancy: float, tick: Callable[[float], None]
) -> list[Peak]:
    """Return the maxima near these poses. All are refined roughly, and the promising ones fully."""
    rough = []
    for k, start in enumerate(starts):
        tick(0.5 * k / len(starts))
        values = problem.start()
        values[: len(start)] = start
        values = problem.with_noise(values, MODERATE)
        values = refined(problem, values, QUICK, (MODERATE,), searches=2, iterations=15)
        rough.append(peak_at(problem, values, QUICK))
    best = max(rough, key=lambda top: top.score)
    promising = _different([top for top in rough if best.score - top.score < _PROMISING * redundancy])
    tops = []
    for k, top in enumerate(promising):
        tick(0.5 + 0.5 * k / len(promising))
        tops.append(highest(problem, top.values, _CLIMBS))
    return tops


def _different(tops: list[Peak]) -> list[Peak]:
    """Return different maxima, best first."""
    kept: list[Peak] = []
    for top in sorted(tops, key=lambda one: -one.score):
        same = (
            math.dist(top.values[:2], other.values[:2]) < _SAME
            and abs(math.remainder(float(top.values[2] - other.values[2]), math.tau)) < _SAME_HEADING
            for other in kept
        )
        if not any(same):
            kept.append(top)
    return kept


def _clear(tops: list[Peak], room: Room, board: Board) -> list[Peak]:
    """Return the maxima at which the sensor touches no wall and no post; all if it does so everywhere."""
    mount = board.mount
    radius = max(math.hypot(mount.ahead, abs(mount.aside) + mount.separation / 2), board.aperture_radius)
    axes = [board.at_axis(board.faced(Place("", tuple(top.values[:2]), float(top.values[2])))) for top in tops]
    positions = np.array([axis.position for axis in axes])
    distances = wall_distances(positions, room.walls).min(axis=1)
    if len(room.posts):
        away = np.hypot(*(positions[:, None] - room.posts[:, :2]).transpose(2, 0, 1)) - room.posts[:, 2]
        distances = np.minimum(distances, away.min(axis=1))
    return [top for top, distance in zip(tops, distances, strict=True) if distance >= radius] or tops


def _within(room: Room, spread: FloatArray) -> FloatArray:
    """Return a covariance (3, 3) of x, y and heading, bounded by that of a uniform distribution over the room."""
    ends = room.walls.reshape(-1, 2)
    sides = np.maximum(np.append(np.ptp(ends, axis=0), math.tau), 1e-3)
    return np.asarray(np.linalg.inv(np.linalg.inv(spread) + np.diag(12 / sides**2)))


def _weighed(tops: list[Peak], redundancy: float) -> tuple[Pose, ...]:
    """Return the poses at the maxima, most probable first; probabilities are volumes under peaks of the posterior."""
    promising = [top for top in tops if (tops[0].score - top.score) / redundancy < -math.log(_LEAST)]
    room = tops[0].objective.problem.room
    spreads = [_within(room, redundancy * covariance_of(top.objective, top.values)[:3, :3]) for top in promising]
    volumes = np.array([0.5 * np.linalg.slogdet(spread)[1] for spread in spreads])
    shares = _bagged(promising, volumes, redundancy)
    poses = [
        _pose(top.values, share, np.sqrt(np.diag(spread)) * top.objective.problem.widenings[:3])
        for top, share, spread in zip(promising, shares.tolist(), spreads, strict=True)
    ]
    return tuple(sorted((pose for pose in poses if pose.probability >= _LEAST), key=lambda pose: -pose.probability))


def _bagged(tops: list[Peak], volumes: FloatArray, redundancy: float) -> FloatArray:
    """Return the probability of each peak (k,), from logarithms of volumes (k,); the mean over bootstrap samples."""
    by_reading = np.array([top.objective.by_reading(top.values, 0) for top in tops])
    priors = np.array([top.score for top in tops]) - by_reading.sum(axis=1)
    readings = by_reading.shape[1]
    counts = drawn_blocks(readings, redundancy, np.random.default_rng(0))
    # samples are as large as the scan, also if it is no whole number of blocks
    counts *= readings / counts.sum(axis=1, keepdims=True)
    weights = (counts @ by_reading.T + priors) / redundancy + volumes
    return np.asarray(softmax(weights, axis=1).mean(axis=0))


def _pose(values: FloatArray, probability: float, deviations: FloatArray) -> Pose:
    x, y, heading, offset = values[:4].tolist()
    dx, dy, turn = deviations.tolist()
    return Pose((x, y), turned_near(heading), offset, probability, (dx, dy, turn))
