"""The possible poses of a scan in a whole room, each with its probability and uncertainty, and files of poses."""

import csv
import math
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import expit, logit, logsumexp
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.settled import predict_readings
from sonarhw_sim.room.room import Place, Room, place_at

from sonarhw.errors import InputError, counted, deviation_text, estimate_degrees, estimate_text, turned_near
from sonarhw.readings import FloatArray, Reading, angle_difference
from sonarhw_compare.corrections import AS_READ, MIRRORED, OTHER_UNITS, Correction
from sonarhw_compare.fit.fitting import check_fit
from sonarhw_compare.fit.likelihood import PathMemory
from sonarhw_compare.fit.objective import MODERATE, Problem, make_problem, scan_arrays
from sonarhw_compare.fit.parameters import Parameter, free_parameters
from sonarhw_compare.fit.quantities import HEADING, OFFSET, THRESHOLD, Quantity, X, Y
from sonarhw_compare.fit.result import FitOptions, PlacedScan
from sonarhw_compare.fit.search import Peak, covariance_of, highest, peak_at, refined
from sonarhw_compare.fit.starting import HEADINGS, QUICK, Scores, at_marks, best_apart, local_maxima, score_positions
from sonarhw_compare.foreign_rows import opened, short_lines
from sonarhw_compare.free_space import distances_to, find_free_space
from sonarhw_compare.match import TOLERANCE, explains_few, few_explained
from sonarhw_compare.regions import angles_and_ranges, shares_of_readings

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
    parameters: Sequence[Parameter], board: Board, expected: Place, spread: PoseSpread
) -> tuple[Parameter, ...]:
    """Return the parameters of a scan with normal priors of position, heading and sensor, where these are known.

    Range offset and threshold have the spreads of the board, the threshold else the tolerance of a fit.
    """
    wide, (x, y) = spread.with_width, expected.position
    priors: dict[Quantity, tuple[float, float]] = {
        X: (x, wide.xy),
        Y: (y, wide.xy),
        HEADING: (expected.heading, wide.heading),
        OFFSET: (0.0, board.range_sd or math.inf),
        THRESHOLD: (board.threshold_db, board.threshold_sd_db or _THRESHOLD_TOLERANCE),
    }
    changed = list(parameters)
    for row, parameter in enumerate(changed):
        middle, deviation = priors.get(parameter.quantity, (0.0, math.inf))
        if math.isfinite(deviation):
            changed[row] = replace(parameter, expected=middle, deviation=deviation)
    return tuple(changed)


def scores_with_prior(scores: Scores, expected: Place, spread: PoseSpread) -> Scores:
    """Return the scores of a lattice plus the logarithm of the prior, widened by a step of the lattice.

    If the heading is known, those of the lattice are within half a turn of it, as a normal prior needs them.
    """
    if math.isfinite(spread.heading):
        turns = angle_difference(scores.headings, expected.heading)
        by_heading = _log_normal(turns, math.hypot(spread.heading, math.tau / HEADINGS))
        weighed = scores.scores + by_heading
        scores = replace(scores, headings=expected.heading + turns, scores=weighed)
    if math.isfinite(spread.xy):
        away = np.hypot(*(scores.positions - expected.position).T)
        by_position = _log_normal(away, math.hypot(spread.xy, scores.spacing))
        scores = replace(scores, scores=scores.scores + by_position[:, None])
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
# headings. The likelihood assumes independent errors, so each reading counts as a share of an independent one, from the
# lattice to the probabilities. How alike the errors of neighbours are is learned on scans of real sensors, with which
# the stated probabilities of poses are those of being right (`benchmarks.real.located_scans --learn`).
#
# Beside the poses of the scan, there are other explanations: its angles or the unit of its ranges were read wrongly, or
# it is not from this room. All probabilities together are 1.


_POSITIONS = 500  # of the lattice, about
_FINEST = 0.06  # m, smallest spacing
_MAXIMA = 12  # of the lattice, that are refined
_HOPELESS = 20.0  # largest deficit of the log-likelihood of the lattice for a start
_PROMISING = 12.0  # largest deficit of the log-likelihood, after rough refinement, for a full one
_CLIMBS = 3  # most repetitions of the full refinement
_POSE = 3  # values of a peak: x, y, heading; sensor and noise follow
_SAME = 0.03  # m between poses that count as the same
_SAME_HEADING = math.radians(10)
_LEAST = 1e-3  # smallest probability of a reported pose
FEWEST = 7  # independent readings of a scan whose probabilities mean something; a pose has four values
_ROUGHLY = 0.5  # m, within which people state a place
NEAR = 0.1  # m, largest distance of a pose that counts as a place of the room
_ANY_HEADING = math.radians(90)  # standard deviation above which the heading counts as unknown
_CONTRADICTION = 4.0  # standard deviations between the known heading and the located one
_OTHER_MAXIMA = 4  # of the lattice of a scan that is read in another way, that are refined
_UNLIKELY_WAY = 8.0  # largest deficit of the log-likelihood of such a lattice for a refinement
CLOCKWISE, _OTHER_UNIT = 0.05, 0.005  # prior probabilities of clockwise angles, and of each other unit
_NEAREST = 0.05  # of the diagonal of the room, least median range in another unit
_MENTIONED = 0.01  # least probability of another way to read the scan that is printed
_THRESHOLD_TOLERANCE = 3.0  # dB, if the board states no spread
_RIVAL = 0.25  # a second pose with more than this share of the first's probability makes the answer ambiguous


@dataclass(frozen=True)
class Pose:
    """One possible pose."""

    position: tuple[float, float]  # m
    heading: float  # rad, of turntable step 0 in the room, -π..π
    offset: float  # m, added to every measured range
    probability: float
    deviations: tuple[float, float, float]  # standard deviations of x and y, m, and of the heading, rad
    log_likelihood: float = 0.0  # of independent readings, with prior
    log_volume: float = 0.0  # of the peak of the posterior
    by_reading: FloatArray | None = field(default=None, compare=False, repr=False)  # (n,), log-likelihood of each alone

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
class Learned:
    """What is learned on scans of real sensors at known places: `learned.toml` beside this module."""

    alike: float  # correlation of the errors of neighbouring readings with the same range
    usual_explained: float  # mean share of the echoes within 5 cm of the prediction at the right pose
    usual_explained_sd: float  # its standard deviation between scans
    missing: float  # probability that the right pose in the right room is not among the poses
    wrong_room_at_usual: float  # probability of a wrong room, if the usual share is explained
    wrong_room_by_share: float  # rise of its log-odds if 1 % less is explained

    def chance_of_nothing(self, explained: float) -> float:
        """Return the probability that no pose of a scan is right, from the share of the echoes that is explained."""
        odds = logit(self.wrong_room_at_usual) + self.wrong_room_by_share * 100 * (self.usual_explained - explained)
        return 1 - (1 - self.missing) * (1 - float(expit(odds)))


@cache
def learned() -> Learned:
    """Return the content of `learned.toml`."""
    return Learned(**tomllib.loads(Path(__file__).with_name("learned.toml").read_text(encoding="utf-8")))


@dataclass(frozen=True)
class OtherReading:
    """The scan read in another way, with its most probable pose; the probability is that of all its poses."""

    correction: Correction
    pose: Pose
    explained: float  # share of the echoes within 5 cm there
    poses: tuple[Pose, ...] = ()  # most probable first


@dataclass(frozen=True)
class Located:
    """The possible poses of a scan."""

    room: Room
    board: Board
    readings: tuple[Reading, ...]
    poses: tuple[Pose, ...]  # most probable first
    scores: Scores  # rough log-likelihoods of the lattice
    redundancy: float  # number of readings per independent reading
    explained: float  # share of the echoes within 5 cm of the prediction at the most probable pose
    scan: str = "the scan"  # its name in texts
    expected: Place = NOWHERE  # what was known before, within `spread`
    spread: PoseSpread = UNKNOWN
    others: tuple[OtherReading, ...] = ()  # of the scan with clockwise angles, or in another unit
    nothing: float = 0.0  # probability that no pose is right: another room, another board, or a pose that is missing
    stated: Place | None = None  # where the scanner stood, as its log says; it has no effect on the poses

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the poses or their probabilities may be wrong, a line each."""
        echoes = sum(reading.range is not None for reading in self.readings)
        if (other := self.better_read) is not None:
            x, y = other.pose.position
            return (
                f"{self.scan}: probably read wrongly ({other.pose.probability:.0%}), so the poses are wrong: "
                f"{other.correction.name}, {other.explained:.0%} instead of {self.explained:.0%} of {echoes} echoes "
                f"are explained, at {x:.2f}, {y:.2f} m; {other.correction.correction}",
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
        reasons += self._read_otherwise_at_a_place()
        return (*few, *(f"{self.scan}: {reason}" for reason in reasons))

    def _read_otherwise_at_a_place(self) -> list[str]:
        """Return a warning if only the scan that is read in another way was made at a known place."""
        if any(map(self._at_known_place, self.poses)):
            return []
        for other in self.others:
            place = next(filter(None, map(self._at_known_place, other.poses)), None)
            if place is not None and other.pose.probability >= _MENTIONED:
                x, y = place.position
                return [
                    f"no pose is within {NEAR * 100:g} cm of {place.name} ({x:g}, {y:g} m), but one is with "
                    f"{other.correction.name.removeprefix('with ')}; if the scanner stood there, "
                    f"{other.correction.correction}"
                ]
        return []

    def _at_known_place(self, pose: Pose) -> Place | None:
        """Return the place of the room or of the log that is within 10 cm of a pose."""
        stated = () if self.stated is None else (self.stated,)
        places = (*self.room.places.values(), *stated)
        return next((place for place in places if math.dist(place.position, pose.position) <= NEAR), None)

    @property
    def chosen(self) -> Pose:
        """The pose for the next command: the first, or one that is about as probable and nearer to the known place.

        That is the place of the log, else the only place of the room; else any place of the room within 10 cm.
        """
        rivals = [pose for pose in self.poses if pose.probability > _RIVAL * self.poses[0].probability]
        places = [self.stated] if self.stated is not None else [*self.room.places.values()]
        if len(places) != 1:
            return next((pose for pose in rivals if self._at_known_place(pose) is not None), self.poses[0])
        nearest = min(rivals, key=lambda pose: math.dist(pose.position, places[0].position))
        return nearest if math.dist(nearest.position, places[0].position) <= _ROUGHLY else self.poses[0]

    def lines(self, near: float = NEAR) -> Iterator[str]:
        """Yield the result as lines of text: each pose, and whether the scan distinguishes them."""
        for pose in self.poses:
            yield pose.line(self._place_near(pose, near))
        for other in self.others:
            if other.pose.probability >= _MENTIONED:
                x, y = other.pose.position
                yield f"{other.pose.probability:6.1%}  {other.correction.name}, at {x:.2f}, {y:.2f} m"
        yield f"{self.nothing:6.1%}  none of these"
        yield f"{self.explained:.0%} of the echoes are within 5 cm of an echo predicted for the first pose{self._usual}"
        first, *others = (pose.probability for pose in self.poses)
        if others and others[0] > _RIVAL * first:
            yield f"the scan cannot distinguish these poses: the room looks nearly the same from them{self._why_chosen}"
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
            "usual_explained": learned().usual_explained,
            "mirrored": None if (pose := self.mirrored) is None else pose.figures(self._place_near(pose, near)),
            "other_readings": [
                {"correction": other.correction.name, "explained": round(other.explained, 6)}
                | other.pose.figures(self._place_near(other.pose, near))
                for other in self.others
            ],
            "none": round(self.nothing, 6),
        }

    @property
    def fits_room(self) -> bool:
        """Whether the first pose explains enough echoes, and the scan was probably read rightly."""
        return not explains_few(self.explained) and self.better_read is None

    @property
    def _why_chosen(self) -> str:
        """Why the next command has another pose than the first."""
        if self.chosen is self.poses[0]:
            return ""
        x, y = self.chosen.position
        return f"; that at {x:.2f}, {y:.2f} m is nearest to the known place"

    @property
    def better_read(self) -> OtherReading | None:
        """The other way to read the scan, if it is more probable than all poses together, and than none of these."""
        best = max(self.others, key=lambda other: other.pose.probability, default=None)
        poses = sum(pose.probability for pose in self.poses)
        return best if best is not None and best.pose.probability > max(poses, self.nothing) else None

    @property
    def mirrored(self) -> Pose | None:
        """The most probable pose of the scan with its angles reversed, if these are probably clockwise."""
        other = self.better_read
        return other.pose if other is not None and other.correction == MIRRORED else None

    @property
    def _usual(self) -> str:
        """What other sensors explain, if it is more."""
        usual = learned()
        if self.explained >= usual.usual_explained - usual.usual_explained_sd:
            return ""
        return f"; scans of real sensors at the right pose have {usual.usual_explained:.0%} on average"

    def _place_near(self, pose: Pose, near: float) -> Place | None:
        return self.room.places.get(self.place_near(pose, near) or "")

    @property
    def lattice(self) -> FloatArray:
        """Rough log-posterior of each position of the lattice, (p,); the best is 0, positions without paths -inf."""
        summed = logsumexp(self.scores.scores, axis=1)
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
    rightly: bool = False,
    tick: Callable[[float], None] = lambda _share: None,
) -> Located:
    """Return the possible poses of a scan in a room.

    `height` (m) of the transducer includes floor, ceiling and the heights of walls in the prediction. `expected` is the
    place at which the pose is known within `spread`. `rightly`: the scan is of this room and was read rightly, so only
    its poses are compared. `tick` receives the completed share, 0..1. Raises InputError if no reading has an echo, the
    board is a ring of sensors, the height is not between floor and ceiling, or no position in the room has a path to an
    echo.
    """
    if height is not None:
        room.check_height(height)
    options = FitOptions(prediction=prediction or PredictionOptions())
    free = free_parameters(("position", "heading", "offset", "threshold"), ("scan",), room, board)
    scan = PlacedScan(readings, Place("", (0.0, 0.0), height=height))
    check_fit([scan], board, free, options)
    scan = replace(scan, readings=without_own_body(board.own_body, readings))
    shares = shares_of_readings(*angles_and_ranges(scan.readings), learned().alike)
    free = with_prior(free, board, expected, spread)
    problem = make_problem([scan], room, board, free, options.prediction, all_echoes=options.all_echoes)
    problem = replace(problem, shares=(shares,))
    ways = (AS_READ, *(() if rightly else _other_ways(scan.readings, room, board)))
    scores, *others = (
        scores_with_prior(one, expected, spread)
        for one in _score_lattice(problem, ways[1:], lambda share: tick(0.5 * share))
    )
    possible = np.isfinite(scores.scores).any()
    starts = _starts(scores, room, board) if possible else []
    tops = _tops(problem, starts, lambda share: tick(0.5 + 0.3 * share)) if starts else []
    if not tops:
        raise InputError(
            f"room {room.name!r}, board {board.name!r}: from no position in this room can this board have an echo as "
            "near as those of the scan; check the room, the board and its blanking"
        )
    peaks = [tops]
    for way, rough in zip(ways[1:], others, strict=True):
        arrays = scan_arrays(_read_as(scan, way).readings, None, all_echoes=options.all_echoes)
        read = replace(problem, scans=(arrays,), memory=PathMemory())
        peaks.append(_tops_read(way, read, rough, float(scores.scores.max())))
    best = max((top for tops in peaks for top in tops), key=lambda top: top.score)
    found = [
        _peaks_as_poses(_with_sensor_of(best, tops), _gained(way, problem))
        for way, tops in zip(ways, peaks, strict=True)
    ]
    located = Located(room, board, tuple(scan.readings), (), scores, len(shares) / float(shares.sum()), 0.0)
    located = replace(located, expected=expected, spread=spread)
    chosen = [(way, poses) for way, poses in zip(ways, found, strict=True) if poses]

    def explained(way: Correction, pose: Pose) -> float:
        # an echo within 5 cm of the range in the log: a smaller room would explain more echoes within 5 cm of its own
        tolerance = min(1.0, way.scale) * TOLERANCE
        return _explained(_read_as(scan, way), room, board, pose, options, tolerance)

    located = _with_probabilities(located, chosen, explained, rightly)
    tick(1.0)
    return located


def _other_ways(readings: Sequence[Reading], room: Room, board: Board) -> tuple[Correction, ...]:
    """Return the other ways to read a scan: clockwise, and in those units in which its ranges fit into the room."""
    ranges = np.array([reading.range for reading in readings if reading.range is not None])
    diagonal = float(np.hypot(*np.ptp(room.walls.reshape(-1, 2), axis=0)))
    nearest, farthest = _NEAREST * diagonal, min(diagonal, board.max_range)
    units = (one for one in OTHER_UNITS if ranges.max() * one.scale <= farthest)
    return (MIRRORED, *(one for one in units if float(np.median(ranges)) * one.scale >= nearest))


def _read_as(scan: PlacedScan, way: Correction) -> PlacedScan:
    """Return a scan with its angles or ranges corrected."""
    readings = [
        replace(
            reading,
            angle=way.turn * reading.angle,
            echo_times=tuple(way.scale * time for time in reading.echo_times),
        )
        for reading in scan.readings
    ]
    return scan if way == AS_READ else replace(scan, readings=readings)


def _gained(way: Correction, problem: Problem) -> float:
    """Return what a way to read a scan adds to the log-likelihood.

    A density of ranges in another unit is one of the measured ranges times the factor between them.
    """
    return math.log(way.scale) * float(problem.shares[0] @ (problem.scans[0].counts > 0))


def _tops_read(way: Correction, problem: Problem, scores: Scores, best: float) -> list[Peak]:
    """Return the maxima of a scan that is read in another way; none if its lattice is far below `best`."""
    starts = _starts(scores, problem.room, problem.board)[:_OTHER_MAXIMA]
    if not starts or scores.scores.max() + _gained(way, problem) - best < -_UNLIKELY_WAY:
        return []
    return _tops(problem, starts, lambda _share: None)


def _prior(way: Correction, ways: int) -> float:
    """Return the prior probability of a way to read a scan, of several."""
    if way == AS_READ:
        return 1 - CLOCKWISE - _OTHER_UNIT * (ways - 2) if ways > 1 else 1.0
    return CLOCKWISE if way == MIRRORED else _OTHER_UNIT


def _with_probabilities(
    located: Located,
    found: Sequence[tuple[Correction, Sequence[Pose]]],
    explained: Callable[[Correction, Pose], float],
    rightly: bool,
) -> Located:
    """Return a scan with its poses, and those of the scan read in other ways, with their probabilities.

    `found` begins with those of the scan as it is. `rightly`: one of the poses is right.
    """
    weights = [
        np.array([pose.log_likelihood + pose.log_volume for pose in poses]) + math.log(_prior(way, len(found)))
        for way, poses in found
    ]
    whole = logsumexp(np.concatenate(weights))
    shares = [np.exp(of_way - whole) for of_way in weights]
    best = [poses[int(of_way.argmax())] for (_, poses), of_way in zip(found, shares, strict=True)]
    fits = [explained(way, pose) for (way, _), pose in zip(found, best, strict=True)]
    likely = fits[int(np.argmax([of_way.sum() for of_way in shares]))]
    nothing = 0.0 if rightly else learned().chance_of_nothing(likely)
    poses = [
        replace(pose, probability=(1 - nothing) * share)
        for pose, share in zip(found[0][1], shares[0].tolist(), strict=True)
        if share >= _LEAST * shares[0].sum()
    ]
    others = [
        OtherReading(
            way, replace(pose, probability=(1 - nothing) * float(of_way.sum())), fit, _most_probable(of_way, poses)
        )
        for (way, poses), pose, of_way, fit in list(zip(found, best, shares, fits, strict=True))[1:]
    ]
    return replace(
        located,
        poses=tuple(sorted(poses, key=lambda pose: -pose.probability)),
        explained=fits[0],
        others=tuple(sorted(others, key=lambda other: -other.pose.probability)),
        nothing=nothing,
    )


def _most_probable(shares: FloatArray, poses: Sequence[Pose]) -> tuple[Pose, ...]:
    """Return the poses that are not very improbable among these, most probable first."""
    likely = [k for k in np.argsort(-shares, kind="stable").tolist() if shares[k] > _RIVAL * shares.max()]
    return tuple(poses[k] for k in likely)


def _explained(scan: PlacedScan, room: Room, board: Board, pose: Pose, options: FitOptions, tolerance: float) -> float:
    echoes = [reading for reading in scan.readings if reading.range is not None]
    headings = np.array([board.heading_at(reading.angle, pose.heading) for reading in echoes])
    place = board.faced(replace(scan.place, position=pose.position, heading=pose.heading))
    measured = np.array([reading.range for reading in echoes], dtype=np.float64) + pose.offset
    predicted = predict_readings(room, place, board, headings, options.prediction).ranges
    return float((np.abs(measured - predicted) <= tolerance).mean())


def _score_lattice(problem: Problem, others: Sequence[Correction], tick: Callable[[float], None]) -> list[Scores]:
    """Return the scores of a scan, and of the scan read in other ways."""
    room = problem.room
    whole = find_free_space(room)
    area = float(whole.free.sum()) * whole.spacing**2
    spacing = max(_FINEST, math.sqrt(area / _POSITIONS))
    positions = find_free_space(room, spacing).middles
    done = iter(range(len(positions)))
    scores = score_positions(
        problem.scans[0],
        room,
        problem.board,
        positions,
        spacing,
        problem.places[0].height,
        lambda: tick(next(done) / len(positions)),
        [(way.turn, way.scale) for way in others],
        problem.shares[0],
    )
    return [scores, *(replace(scores, scores=other) for other in scores.others)]


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


def _tops(problem: Problem, starts: list[tuple[float, float, float]], tick: Callable[[float], None]) -> list[Peak]:
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
    promising = _different([top for top in rough if best.score - top.score < _PROMISING])
    tops = []
    for k, top in enumerate(promising):
        tick(0.5 + 0.5 * k / len(promising))
        tops.append(highest(problem, top.values, _CLIMBS))
    return tops


def _with_sensor_of(best: Peak, tops: Sequence[Peak]) -> list[Peak]:
    """Return the maxima, each also refined with the sensor and noise of the best one, if it is then higher.

    All poses have one sensor. A maximisation that ended at another step of the likelihood would decide between them.
    """

    def again(top: Peak) -> Peak:
        begin = np.concatenate((top.values[:_POSE], best.values[_POSE:]))
        return highest(top.objective.problem, begin, _CLIMBS)

    return [top if top is best else max(top, again(top), key=lambda peak: peak.score) for top in tops]


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


def _peaks_as_poses(tops: Sequence[Peak], gained: float) -> list[Pose]:
    """Return the poses at different maxima, best first, without those that are very improbable.

    `gained` is added to the log-likelihood.
    """
    if not tops:
        return []
    tops = _different(list(tops))
    least = tops[0].score + math.log(_LEAST)
    room, board = tops[0].objective.problem.room, tops[0].objective.problem.board
    return [_pose(top, gained) for top in _clear([top for top in tops if top.score >= least], room, board)]


def _pose(top: Peak, gained: float) -> Pose:
    problem = top.objective.problem
    spread = _within(problem.room, covariance_of(top.objective, top.values)[:3, :3])
    dx, dy, turn = (np.sqrt(np.diag(spread)) * problem.widenings[:3]).tolist()
    x, y, heading, offset = top.values[:4].tolist()
    volume = 0.5 * float(np.linalg.slogdet(spread)[1])
    by_reading = top.objective.by_reading(top.values, 0)
    return Pose((x, y), turned_near(heading), offset, 0.0, (dx, dy, turn), top.score + gained, volume, by_reading)


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
