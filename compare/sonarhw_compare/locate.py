"""The possible poses of a scan in a whole room, each with its probability and uncertainty, and files of poses."""

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp, softmax
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, place_at

from sonarhw.errors import InputError, counted, deviation_text, estimate_degrees, estimate_text, turned_near
from sonarhw.readings import FloatArray, Reading, angle_difference
from sonarhw_compare.corrections import MIRRORED
from sonarhw_compare.fit.fitting import check_fit
from sonarhw_compare.fit.objective import MODERATE, Problem, make_problem
from sonarhw_compare.fit.parameters import Parameter, free_parameters
from sonarhw_compare.fit.quantities import HEADING, Quantity, X, Y
from sonarhw_compare.fit.result import FitOptions, PlacedScan
from sonarhw_compare.fit.search import Peak, covariance_of, highest, peak_at, refined
from sonarhw_compare.fit.starting import HEADINGS, QUICK, Scores, at_marks, best_apart, local_maxima, score_positions
from sonarhw_compare.foreign_rows import opened, short_lines
from sonarhw_compare.free_space import distances_to, find_free_space
from sonarhw_compare.match import TOLERANCE, drawn_blocks, explains_few, few_explained
from sonarhw_compare.regions import angles_and_ranges, mean_run

# How well the pose of a scan is known before its readings are used, as a prior of its location.


_FINEST_SPREAD, _FINEST_TURN = 0.001, math.radians(0.1)  # m, rad: of what is exact; a search needs some width


@dataclass(frozen=True)
class PoseSpread:
    """Standard deviations of a pose; 0 is exact, infinite is unknown."""

    xy: float = 0.0  # m, of x and of y
    heading: float = 0.0  # rad
    around: Place | None = None  # where the pose is expected; None: where a search begins

    @property
    def is_whole(self) -> bool:
        """Whether position and heading are known."""
        return math.isfinite(self.xy) and math.isfinite(self.heading)

    @property
    def with_width(self) -> "PoseSpread":
        """The spread, at least 1 mm and 0.1°."""
        return replace(self, xy=max(self.xy, _FINEST_SPREAD), heading=max(self.heading, _FINEST_TURN))


UNKNOWN = PoseSpread(math.inf, math.inf)
WRITTEN = 0.1  # m, largest standard deviation of a position that helps to determine headings
_WRITTEN_POSITIONS = 3  # two scans agree at several pairs of headings


def determine_headings(spreads: Sequence[PoseSpread]) -> bool:
    """Return whether so many positions are known that unknown headings follow from all scans together."""
    return sum(spread.xy <= WRITTEN for spread in spreads) >= _WRITTEN_POSITIONS


NOWHERE = Place("", (0.0, 0.0))


def known_heading(heading: float | None, deviation: float) -> tuple[Place, PoseSpread]:
    """Return place and spread of a pose of which only the heading is known (rad), or nothing (None).

    Raises InputError if the heading is not finite, or the standard deviation is negative.
    """
    if heading is None:
        return NOWHERE, UNKNOWN
    if not (math.isfinite(heading) and deviation >= 0):
        raise InputError(
            f"heading {math.degrees(heading):g} ± {math.degrees(deviation):g}°: expected a finite heading and a "
            "standard deviation of 0° or more"
        )
    return replace(NOWHERE, heading=heading), PoseSpread(math.inf, deviation)


def with_prior(
    parameters: Sequence[Parameter], expected: Place, spread: PoseSpread, redundancy: float
) -> tuple[Parameter, ...]:
    """Return the parameters of a scan with normal priors of position and heading, where these are known.

    The log-likelihood will be divided by `redundancy`, and the prior with it, so its information is that many times as
    much here.
    """
    wide, (x, y) = spread.with_width, expected.position
    priors: dict[Quantity, tuple[float, float]] = {
        X: (x, wide.xy),
        Y: (y, wide.xy),
        HEADING: (expected.heading, wide.heading),
    }
    changed = list(parameters)
    for row, parameter in enumerate(changed):
        middle, deviation = priors.get(parameter.quantity, (0.0, math.inf))
        if math.isfinite(deviation):
            changed[row] = replace(parameter, expected=middle, deviation=deviation / math.sqrt(redundancy))
    return tuple(changed)


def scores_with_prior(scores: Scores, expected: Place, spread: PoseSpread, redundancy: float) -> Scores:
    """Return the scores of a lattice plus the logarithm of the prior, widened by a step of the lattice.

    If the heading is known, those of the lattice are within half a turn of it, as a normal prior needs them.
    """
    if math.isfinite(spread.heading):
        turns = angle_difference(scores.headings, expected.heading)
        by_heading = _log_normal(turns, math.hypot(spread.heading, math.tau / HEADINGS))
        weighed = scores.scores + redundancy * by_heading
        scores = replace(scores, headings=expected.heading + turns, scores=weighed)
    if math.isfinite(spread.xy):
        away = np.hypot(*(scores.positions - expected.position).T)
        by_position = _log_normal(away, math.hypot(spread.xy, scores.spacing))
        scores = replace(scores, scores=scores.scores + redundancy * by_position[:, None])
    return scores


def _log_normal(away: FloatArray, deviation: float) -> FloatArray:
    """Return the logarithm of a normal distribution, 0 in its middle."""
    return np.asarray(-0.5 * (away / deviation) ** 2)


# The possible poses of a scan in a whole room, with the probability of each.
#
# A lattice over the free space of the room is scored at every heading (`pose_search`). The likelihood of a fit is
# then maximized from the best maxima of the lattice and from the places of the room. The weights of these peaks are
# the posterior for a uniform prior over the room, or for a normal one of the position or heading if it is roughly
# known.
#
# Neighbouring readings of one echo have the same error: an edge that is too loud in the model is too loud at ten
# headings. The likelihood assumes independent errors, so its logarithm is divided by the number of readings per
# independent one.
#
# No model of a real room is exact, and then one scan prefers one of two similar poses too clearly: another scan from
# the same place would prefer the other. The posterior is therefore averaged over bootstrap samples of the readings
# (Huggins and Miller, Reproducible model selection using bagged posteriors, Bayesian Analysis 18, 2023).


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
_ANY_HEADING = math.radians(90)  # standard deviation above which the heading counts as unknown
_CONTRADICTION = 4.0  # standard deviations between the known heading and the located one
_MIRRORED_MAXIMA = 4  # of the lattice of a mirrored scan, that are refined
_CLEARLY = 3.0  # log-likelihood of independent readings by which a mirrored scan must be better
_RIVAL = 0.25  # a second pose with more than this share of the first's probability makes the answer ambiguous


@dataclass(frozen=True)
class Pose:
    """One possible pose."""

    position: tuple[float, float]  # m
    heading: float  # rad, of turntable step 0 in the room, -π..π
    offset: float  # m, added to every measured range
    probability: float
    deviations: tuple[float, float, float]  # standard deviations of x and y, m, and of the heading, rad

    @property
    def place(self) -> Place:
        """The place with its heading, for `compare`, `fit` and other tasks."""
        return place_at("pose", (*self.position, self.heading))

    def figures(self, place: Place | None) -> dict[str, float | str | None]:
        """Return the pose under the keys of `locate --json`; `place`: the place of the room that it is near."""
        dx, dy, turn = self.deviations
        return {
            "x_m": round(self.position[0], 6) + 0.0,
            "y_m": round(self.position[1], 6) + 0.0,
            "heading_deg": self._heading_degrees(place),
            "offset_m": round(self.offset, 6) + 0.0,
            "probability": round(self.probability, 6),
            "place": None if place is None else place.name,
            "x_deviation_m": round(dx, 6),
            "y_deviation_m": round(dy, 6),
            "heading_deviation_deg": round(math.degrees(turn), 6) if turn <= _ANY_HEADING else None,
        }

    def line(self, place: Place | None) -> str:
        """Return the pose with its uncertainty as a line of text; `place`: the place of the room that it is near."""
        dx, dy, turn = self.deviations
        x, y = (estimate_text(value, spread) for value, spread in zip(self.position, (dx, dy), strict=True))
        along_x, along_y = (deviation_text(spread * 1000, "") for spread in (dx, dy))
        degrees = math.degrees(turn)
        heading = f"{estimate_text(self._heading_degrees(place), degrees)}° (± {deviation_text(degrees, '°')})"
        offset = round(self.offset * 1000)
        return (
            f"{self.probability:6.1%}  at {x}, {y} m (± {along_x}, {along_y} mm), turntable step 0 at "
            f"{heading if turn <= _ANY_HEADING else 'an unknown heading'}, "
            f"range offset {f'{offset:+d}' if offset else '0'} mm{'' if place is None else f'; {place.name}'}"
        )

    def _heading_degrees(self, place: Place | None) -> float:
        """Return the heading, degrees, on the same turn as that of the place."""
        return estimate_degrees(self.heading, 0.0 if place is None else place.heading, 6)


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
    scan: str = "the scan"  # its name in texts
    expected: Place = NOWHERE  # what was known before, within `spread`
    spread: PoseSpread = UNKNOWN
    mirrored: Pose | None = None  # of the scan with its angles reversed, if this fits the room clearly better
    mirrored_explained: float = 0.0  # share of the echoes within 5 cm there

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the poses or their probabilities may be wrong, a line each."""
        echoes = sum(reading.range is not None for reading in self.readings)
        if self.mirrored is not None:
            x, y = self.mirrored.position
            return (
                f"{self.scan}: the angles are probably clockwise, so the poses are wrong: mirrored, "
                f"{self.mirrored_explained:.0%} instead of {self.explained:.0%} of {echoes} echoes are explained, at "
                f"{x:.2f}, {y:.2f} m; {MIRRORED.correction}",
            )
        few = few_explained(self.scan, self.explained, echoes, located=True)
        contradicted = (_heading_doubts(pose, self.expected, self.spread) for pose in self.poses[:1])
        reasons = [doubt for doubts in contradicted for doubt in doubts]
        independent = len(self.readings) / self.redundancy
        if independent < FEWEST:
            reasons.insert(
                0,
                f"only {counted(round(independent), 'independent reading')}, expected at least {FEWEST}: a wrong pose "
                "may be stated as certain; scan a wider sector, or locate a scan from another place too",
            )
        return (*few, *(f"{self.scan}: {reason}" for reason in reasons))

    def lines(self, near: float = NEAR) -> Iterator[str]:
        """Yield the result as lines of text: each pose, and whether the scan distinguishes them."""
        for pose in self.poses:
            yield pose.line(self._place_near(pose, near))
        yield f"{self.explained:.0%} of the echoes are within 5 cm of an echo predicted for the first pose"
        first, *others = (pose.probability for pose in self.poses)
        if others and others[0] > _RIVAL * first:
            yield "the scan cannot distinguish these poses: the room looks nearly the same from them"
        places = self.places(near)
        if _likely_place(places) is not None:
            shares = ", ".join(f"{name} {share:.1%}" for name, share in places.items() if share >= 0.001)
            yield f"assuming one of the room's places: {shares}"

    def figures(self, near: float = NEAR) -> dict[str, Any]:
        """Return the result under the keys of `locate --json`; a pose within `near` (m) of a place counts as there."""
        places = self.places(near)
        return {
            "poses": [pose.figures(self._place_near(pose, near)) for pose in self.poses],
            "place": _likely_place(places),
            "places": {name: round(share, 6) for name, share in places.items()},
            "readings_alike": round(self.redundancy, 3),
            "explained": round(self.explained, 6),
            "fits_room": self.fits_room,
            "mirrored": None if self.mirrored is None else self.mirrored.figures(self._place_near(self.mirrored, near)),
        }

    @property
    def fits_room(self) -> bool:
        """Whether the first pose explains enough echoes, and no mirrored one clearly more."""
        return not explains_few(self.explained) and self.mirrored is None

    def _place_near(self, pose: Pose, near: float) -> Place | None:
        return self.room.places.get(self.place_near(pose, near) or "")

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


def _heading_doubts(pose: Pose, expected: Place, spread: PoseSpread) -> tuple[str, ...]:
    """Return a warning if a pose contradicts the known heading."""
    turn = abs(math.remainder(pose.heading - expected.heading, math.tau))
    if turn <= _CONTRADICTION * math.hypot(spread.heading, pose.deviations[2]):
        return ()
    return (
        f"step 0 of the first pose is {math.degrees(turn):.0f}° from the known heading, which is unlikely with its "
        "standard deviation; check both",
    )


def _likely_place(places: dict[str, float]) -> str | None:
    """Return the most probable of the room's places; None if none is possible."""
    best = max(places, key=places.__getitem__, default=None)
    return best if best is not None and places[best] > 0 else None


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
    reversed_scores = replace(scores, scores=scores.scores if scores.mirrored is None else scores.mirrored)
    scores, reversed_scores = (
        scores_with_prior(one, expected, spread, redundancy) for one in (scores, reversed_scores)
    )
    possible = np.isfinite(scores.scores).any()
    starts = _starts(scores, room, board) if possible else []
    tops = _tops(problem, starts, redundancy, lambda share: tick(0.5 + 0.4 * share)) if starts else []
    if not tops:
        raise InputError(
            f"room {room.name!r}, board {board.name!r}: from no position in this room can this board have an echo as "
            "near as those of the scan; check the room, the board and its blanking"
        )
    chosen = _clear(_different(tops), room, board)
    poses = _weighed(chosen, redundancy)
    explained = _explained(readings, room, board, poses[0], scan.place, options)
    located = Located(room, board, tuple(readings), poses, scores, redundancy, explained)
    located = replace(located, expected=expected, spread=spread)
    turned = [replace(reading, angle=-reading.angle) for reading in readings]
    as_turned = make_problem(
        [replace(scan, readings=turned)], room, board, free, options.prediction, all_echoes=options.all_echoes
    )
    top = _better_mirrored(as_turned, reversed_scores, max(chosen, key=lambda peak: peak.score).score, redundancy)
    tick(1.0)
    if top is None:
        return located
    pose = _weighed([top], redundancy)[0]
    share = _explained(turned, room, board, pose, scan.place, options)
    return (
        replace(located, mirrored=pose, mirrored_explained=share)
        if share > explained and not explains_few(share)
        else located
    )


def _better_mirrored(problem: Problem, scores: Scores, best: float, redundancy: float) -> Peak | None:
    """Return the best maximum of a mirrored scan, if it is clearly better than that of the scan, `best`.

    A room with an axis of symmetry explains both equally well.
    """
    starts = _starts(scores, problem.room, problem.board)[:_MIRRORED_MAXIMA]
    if not starts:
        return None
    tops = _clear(_different(_tops(problem, starts, redundancy, lambda _share: None)), problem.room, problem.board)
    top = max(tops, key=lambda peak: peak.score)
    return top if (top.score - best) / redundancy > _CLEARLY else None


def _explained(
    readings: Sequence[Reading], room: Room, board: Board, pose: Pose, place: Place, options: FitOptions
) -> float:
    echoes = [reading for reading in readings if reading.range is not None]
    headings = np.array([board.heading_at(reading.angle, pose.heading) for reading in echoes])
    place = board.faced(replace(place, position=pose.position, heading=pose.heading))
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
        mirrored=True,
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
    for top in sorted(tops, key=lambda peak: -peak.score):
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
    distances = distances_to(room, np.array([axis.position for axis in axes]))
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


# Poses of scans with their uncertainty, from a CSV file.


HEADER = "log,x_m,y_m,heading_deg,sd_xy_m,sd_heading_deg"
_WHAT = "a table of poses (CSV)"
_MOST_XY, _MOST_DEG = 100.0, 180.0  # standard deviations, m and °; what is known no better is unknown
_SHOWN = 4  # names of rows, in an error

_Poses = dict[str, tuple[Place, PoseSpread]]  # by the name of the log in its row


def read_poses(path: Path, logs: Sequence[Path]) -> list[tuple[Place, PoseSpread]]:
    """Return place and spread for each of `logs`; an empty standard deviation is exact.

    A row names a log by its path as in `logs`, or by its file name if no other log has this name. Without x and y, the
    position is unknown; without a heading, the heading is.

    Raises InputError with file and line if the file is unreadable or not of this form, or lacks a log.
    """
    with opened(path, _WHAT) as text:
        poses = _poses(path, short_lines(path, text, _WHAT))
    chosen = [_pose_of(log, logs, poses, path) for log in logs]
    if chosen and not chosen[0][1].is_whole and not determine_headings([spread for _, spread in chosen]):
        raise InputError(
            f"{path}: {logs[0].name}: expected position and heading of the first log, or positions of three logs "
            f"within {WRITTEN * 100:g} cm; others may be unknown"
        )
    return chosen


def _pose_of(log: Path, logs: Sequence[Path], poses: _Poses, path: Path) -> tuple[Place, PoseSpread]:
    """Return place and spread of a log. Raises InputError if no row names it, or not it alone."""
    if (pose := poses.get(str(log))) is not None:
        return pose
    rows = [name for name in poses if Path(name).name == log.name]
    alike = [str(other) for other in logs if other.name == log.name]
    if rows and (len(rows) > 1 or len(alike) > 1):
        named = " and ".join(alike if len(alike) > 1 else rows)
        raise InputError(f"{path}: {named} have the same file name; expected rows with their paths, such as {log}")
    if not rows:
        some = ", ".join([*list(poses)[:_SHOWN], *(["…"] if len(poses) > _SHOWN else [])]) or "no log"
        raise InputError(
            f"{path}: no row for {log.name}; expected one for each log, with its name in the first column; "
            f"the rows are for {some}"
        )
    return poses[rows[0]]


def _poses(path: Path, lines: Iterator[str]) -> _Poses:
    """Return place and spread of each line below the header."""
    header = next(lines, None)
    if header is None:
        raise InputError(f"{path}: the file is empty; expected the header {HEADER} and one line per log")
    if header.strip() != HEADER:
        raise InputError(f"{path}: line 1: {_other_header(header.strip())}")
    poses: _Poses = {}
    for number, row in enumerate(csv.reader(lines), start=2):
        if row:
            name, pose = _pose_of_row(row, f"{path}: line {number}")
            if name in poses:
                raise InputError(f"{path}: line {number}: {name} was given before")
            poses[name] = pose
    return poses


_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}


def _other_header(header: str) -> str:
    """Return what is wrong with a header."""
    other = next((words for mark, words in _OTHER_SEPARATORS.items() if mark in header and "," not in header), None)
    if other is None:
        return f"expected the header {HEADER}, got {header!r}"
    return f"the columns are separated by {other}; expected commas, points in numbers, and the header {HEADER}"


def _pose_of_row(row: Sequence[str], where: str) -> tuple[str, tuple[Place, PoseSpread]]:
    if len(row) != len(HEADER.split(",")):
        extra = "; write numbers with a point, not a comma" if len(row) > len(HEADER.split(",")) else ""
        raise InputError(f"{where}: expected {len(HEADER.split(','))} columns ({HEADER}), got {len(row)}{extra}")
    name, *cells = (cell.strip() for cell in row)
    x, y, heading, xy, turn = (_number(cell, where) for cell in cells)
    if min(xy, turn) < 0:
        raise InputError(f"{where}: expected standard deviations of 0 or more, got {min(xy, turn):g}")
    if xy > _MOST_XY or turn > _MOST_DEG:
        raise InputError(
            f"{where}: expected standard deviations of at most {_MOST_XY:g} m and {_MOST_DEG:g}°, got {xy:g} m and "
            f"{turn:g}°; leave position or heading, and its standard deviation, empty if it is unknown"
        )
    has_position, has_heading = bool(cells[0] and cells[1]), bool(cells[2])
    if not has_position and (cells[0] or cells[1] or cells[3]):
        raise InputError(f"{where}: expected x and y, or neither and no sd_xy_m: the position is unknown")
    if not has_heading and cells[4]:
        raise InputError(f"{where}: expected a heading, or no sd_heading_deg: the heading is unknown")
    spread = PoseSpread(xy if has_position else math.inf, math.radians(turn) if has_heading else math.inf)
    return str(Path(name)), (Place(Path(name).stem, (x, y), math.radians(heading)), spread)


def _number(text: str, where: str) -> float:
    try:
        value = float(text or 0)
    except ValueError as error:
        raise InputError(f"{where}: expected a number, such as 1.5, got {text!r}") from error
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {text}")
    return value
