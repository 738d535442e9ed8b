"""Starting poses of a fit: a rough likelihood at each position of a lattice, and a plain fit of one pose."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from sonarhw_sim.air import Model
from sonarhw_sim.board.beam import beam, beam_table
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.predicted_scan import is_blanked, strengths
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with, search_for
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.space.sections import paths_from_each

from sonarhw.errors import InputError, estimate_degrees, turned_near
from sonarhw.readings import FloatArray, Reading, angle_difference
from sonarhw_compare.fit.likelihood import ScanArrays, with_reverses, with_summed_patches
from sonarhw_compare.fit.objective import COARSE, Problem, make_problem
from sonarhw_compare.fit.parameters import Parameter, free_parameters
from sonarhw_compare.fit.quantities import HEADING, THRESHOLD, PlaceQuantity, Quantity, X, Y
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.fit.search import refined
from sonarhw_compare.match import TOLERANCE
from sonarhw_compare.regions import angles_and_ranges

# Rough log-likelihood of a scan at every position of a lattice and every heading, and its best poses.
#
# At each position, a few hundred rays find the paths with few reflections. These paths give the candidates for the
# first echo at each of 180 headings. The scan is compared with this table in all 180 rotations.


HEADINGS = 180  # 2° apart
QUICK = PredictionOptions(rays=720, max_bounces=3)
_POSITIONS = 600  # in a lattice, about
_FINEST = 0.06  # m, smallest spacing
_CANDIDATES = 4  # echoes of one heading, at most
_SOFT = 4.0  # dB, width of the detection threshold
_HARDLY = 0.02  # smallest detection probability of a candidate
_STRAY = 0.05  # likelihood of a reading without a matching candidate; an exact match has 1
_LOST = 0.05  # likelihood of no echo where one is certain
_APART = math.radians(15)  # between chosen poses
_FAR_APART = math.radians(45)  # between local maxima
_EQUAL = 9  # decimals of scores and errors that are compared; those of symmetric poses differ in their last digits


@dataclass(frozen=True)
class Scores:
    """Log-likelihoods of a scan by position and heading."""

    positions: FloatArray  # (p, 2), m
    headings: FloatArray  # (h,), rad
    scores: FloatArray  # (p, h), natural logarithms; -inf without any path
    spacing: float  # m, between positions
    others: tuple[FloatArray, ...] = ()  # (p, h) each, those of the scan read in other ways


def lattice(lower: tuple[float, float], upper: tuple[float, float]) -> tuple[FloatArray, float]:
    """Return a lattice in a rectangle, (p, 2) m, and its spacing, m: about 600 positions, at least 6 cm apart."""
    sides = np.array(upper) - lower
    spacing = max(
        _FINEST, math.sqrt(max(float(sides[0] * sides[1]), 0.0) / _POSITIONS), float(sides.max()) / _POSITIONS
    )
    xs, ys = (
        low + side * (np.arange(count) + 0.5) / count
        for low, side, count in ((lower[k], sides[k], max(1, math.ceil(sides[k] / spacing))) for k in range(2))
    )
    return np.array([(x, y) for x in xs for y in ys], dtype=np.float64), spacing


def score_positions(
    scan: ScanArrays,
    room: Room,
    board: Board,
    positions: FloatArray,
    spacing: float,
    height: float | None = None,
    tick: Callable[[], None] = lambda: None,
    others: Sequence[tuple[float, float]] = (),
    shares: FloatArray | None = None,
) -> Scores:
    """Return the scores of a scan at each of `positions` (p, 2) of the turning axis; `tick` is called once for each.

    An error of half the spacing lowers the score little. Positions without any path score -inf. The scan is also scored
    as read in `others`: with these factors of its turntable angles and of its ranges. `shares` (n,) are those of an
    independent reading that the readings count as, by default 1 each.
    """
    headings = np.arange(HEADINGS, dtype=np.float64) * (math.tau / HEADINGS)
    ways = [(1.0, 1.0), *others]
    scores = np.full((len(ways), len(positions), HEADINGS), -math.inf)
    first = np.ascontiguousarray(scan.ranges[:, 0])  # one type of array, so one kernel
    longest = float(np.nanmax(first, initial=0.0)) * max(scale for _, scale in ways)
    farthest = min(board.max_range, longest + 3 * spacing)
    # scores weigh each path alone, so they need no faint paths that are loud together
    search = replace(search_for(room, replace(board, sum_arrivals=False), QUICK), max_length=2 * farthest)
    ka = board.wavenumber(room.air) * board.aperture_radius
    bins = [
        np.round(board.heading_at(turn * scan.angles, 0.0) * (HEADINGS / math.tau)).astype(np.int64) % HEADINGS
        for turn, _ in ways
    ]
    width = max(0.7 * spacing, 0.03)
    shares = np.ones(len(first)) if shares is None else shares
    places = [Place("", (x, y), height=height) for x, y in positions.tolist()]
    for row, paths in enumerate(paths_from_each(room, places, search, board.aperture_radius)):
        tick()
        paths = with_reverses(with_summed_patches(paths, room, board), board)
        paths = paths.select(np.flatnonzero(~is_blanked(paths.lengths, board, room)))
        if len(paths):
            level = 20 * np.log10(np.maximum(strengths(room, board, paths), 1e-12)) - board.threshold_db
            reported = board.unrounded(paths.lengths / 2)
            table = _candidates(headings, paths.leaving, paths.arriving, level, ka, beam_table(ka))
            for way, (_, scale) in enumerate(ways):
                scores[way, row] = _score(scale * first, shares, bins[way], reported, *table, width)
    return Scores(positions, headings, scores[0], spacing, tuple(scores[1:]))


@compiled
def _candidates(
    headings: FloatArray, leaving: FloatArray, arriving: FloatArray, level: FloatArray, ka: float, table: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return candidates for the first echo (h, c), padded with -1, their probabilities, and those of no echo (h,)."""
    chosen = np.full((headings.shape[0], _CANDIDATES), -1, np.int64)
    chances, silent = np.zeros((headings.shape[0], _CANDIDATES)), np.ones(headings.shape[0])
    for h in range(headings.shape[0]):
        x, y = math.cos(headings[h]), math.sin(headings[h])
        found = 0
        for k in range(level.shape[0]):
            ahead, home = leaving[k, 0] * x + leaving[k, 1] * y, arriving[k, 0] * x + arriving[k, 1] * y
            if ahead <= 0.0 or home <= 0.0:
                continue
            amplitude = beam(ahead, ka, table) * beam(home, ka, table)
            over = level[k] + 20.0 * math.log10(max(amplitude, 1e-12))
            if over < -3.0 * _SOFT:
                continue
            chance = 1.0 / (1.0 + math.exp(-1.7 * over / _SOFT))
            if chance * silent[h] < _HARDLY:
                continue
            chosen[h, found], chances[h, found] = k, chance * silent[h]
            silent[h] *= 1.0 - chance
            found += 1
            if found == _CANDIDATES:
                break
    return chosen, chances, silent


@compiled
def _score(
    ranges: FloatArray,
    shares: FloatArray,
    bins: NDArray[np.int64],
    reported: FloatArray,
    chosen: NDArray[np.int64],
    chances: FloatArray,
    silent: FloatArray,
    width: float,
) -> FloatArray:
    """Return the log-likelihood of a scan in each rotation, (h,)."""
    count = chosen.shape[0]
    scores = np.zeros(count)
    for i in range(ranges.shape[0]):
        for h in range(count):
            likelihood = _LOST + (1.0 - _LOST) * silent[h] if math.isnan(ranges[i]) else _STRAY
            for c in range(_CANDIDATES):
                if chosen[h, c] < 0 or math.isnan(ranges[i]):
                    break
                away = (ranges[i] - reported[chosen[h, c]]) / width
                likelihood += chances[h, c] / (1.0 + away * away)
            scores[(h - bins[i]) % count] += shares[i] * math.log(likelihood)
    return scores


def at_marks(board: Board, poses: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Return poses (x, y, heading rad) of the turning axis as those of the mark that a place stands for."""
    marks = []
    for x, y, heading in poses:
        dx, dy = board.at_axis(board.faced(Place("", (0.0, 0.0), heading))).position
        marks.append((x - dx, y - dy, heading))
    return marks


def best_apart(scores: Scores, most: int) -> list[tuple[float, float, float]]:
    """Return up to `most` poses (x, y, heading rad), best first, none within 2.5 spacings and 15° of a chosen one.

    They are starts for a search. Unlike `local_maxima`, they include poses on the slope of a better one, from which
    the search may climb elsewhere.
    """
    order = np.argsort(scores.scores.round(_EQUAL), axis=None, kind="stable")[::-1]
    chosen: list[tuple[float, float, float]] = []
    for row, column in zip(*np.unravel_index(order[: 400 * most], scores.scores.shape), strict=True):
        if len(chosen) == most or not math.isfinite(scores.scores[row, column]):
            break
        (x, y), heading = scores.positions[row].tolist(), float(scores.headings[column])
        near = (
            math.hypot(x - a, y - b) < 2.5 * scores.spacing and abs(math.remainder(heading - c, math.tau)) < _APART
            for a, b, c in chosen
        )
        if not any(near):
            chosen.append((x, y, heading))
    return chosen


def local_maxima(scores: Scores, most: int, hopeless: float) -> list[tuple[float, float, float]]:
    """Return up to `most` poses (x, y, heading rad), best first, with no better one within 2.5 spacings and 45°.

    None is worse than the best by `hopeless` or more. They show in which other poses the scan fits, too.
    """
    width = 2 * round(_FAR_APART / (math.tau / scores.scores.shape[1])) + 1
    compared = scores.scores.round(_EQUAL)
    nearby = maximum_filter1d(compared, width, axis=1, mode="wrap")
    least, maxima = float(compared.max()) - hopeless, []
    for row, position in enumerate(scores.positions):
        near = np.hypot(*(scores.positions - position).T) < 2.5 * scores.spacing
        is_best = (compared[row] == nearby[near].max(axis=0)) & (compared[row] > least)
        maxima += [(float(compared[row, column]), row, int(column)) for column in np.flatnonzero(is_best)]
    return [
        (*scores.positions[row].tolist(), float(scores.headings[column]))
        for _, row, column in sorted(maxima, reverse=True)[:most]
    ]


# Starting poses of a fit, for each scan separately.
#
# Where the position is free, `pose_search` scores a lattice over the region that the prior and the bounds allow.


_ROUGH = 16  # poses of the lattice that are scored again
_CLIMBED = 6  # of these, that are refined
_SURE = 4.0  # standard deviations of the prior that are searched
_SAME = 0.02  # m between positions that count as the same
_SAME_HEADING = math.radians(3)

Tick = Callable[[float], None]


@dataclass(frozen=True)
class ScoredValues:
    """Values of a problem and their score."""

    values: FloatArray  # (size,) of the whole problem
    score: float  # log-likelihood and prior, natural logarithm


def starting_poses(problem: Problem, scan: int, tick: Tick) -> list[ScoredValues]:
    """Return the best poses of a scan, best first; a single one if its pose is not free.

    Their scores are those of this scan alone with coarse noise. `tick` receives the completed share, 0..1.
    """
    rows = problem.pose_rows(scan)
    if not rows:
        return [ScoredValues(problem.start(), 0.0)]
    # a wrong offset would shift the place
    rows += [row for row, parameter in enumerate(problem.parameters) if parameter.quantity.shifts_place]
    alone = _alone(problem, scan, rows)
    starts = [alone.with_noise(pose, COARSE) for pose in _poses(alone, lambda share: tick(0.6 * share))]
    scored = sorted(
        ((round(alone.near(start, QUICK)(start), _EQUAL), k) for k, start in enumerate(starts)), reverse=True
    )
    poses: list[ScoredValues] = []
    for done, (_, k) in enumerate(scored[:_CLIMBED]):
        tick(0.6 + 0.4 * done / _CLIMBED)
        top = refined(alone, starts[k], QUICK, (COARSE,), searches=2, iterations=3)
        if not any(is_same(alone, top, one.values) for one in poses):
            poses.append(ScoredValues(top, alone.near(top, QUICK)(top)))
    poses.sort(key=lambda one: -one.score)
    return [replace(one, values=_in_whole(problem, rows, one.values)) for one in poses]


def _alone(problem: Problem, scan: int, rows: list[int]) -> Problem:
    """Return the problem of the pose of one scan, with all other values at their start."""
    parameters = tuple(
        replace(parameter, scan=0) if isinstance(parameter.quantity, PlaceQuantity) else parameter
        for parameter in (problem.parameters[row] for row in rows)
    )
    return replace(
        problem,
        scans=(problem.scans[scan],),
        places=(problem.places[scan],),
        parameters=parameters,
        reported_speed=None,
    )


def _in_whole(problem: Problem, rows: list[int], values: FloatArray) -> FloatArray:
    whole = problem.start()
    whole[rows] = values[: len(rows)]
    return whole


def _poses(problem: Problem, tick: Tick) -> list[FloatArray]:
    """Return values of the parameters at the best poses of the lattice."""
    place, free = problem.places[0], {parameter.quantity: parameter for parameter in problem.parameters}
    spans = [
        _span(free[quantity]) if quantity in free else (coordinate, coordinate)
        for quantity, coordinate in zip((X, Y), place.position, strict=True)
    ]
    positions, spacing = lattice((spans[0][0], spans[1][0]), (spans[0][1], spans[1][1]))
    done = iter(range(len(positions)))
    scores = score_positions(
        problem.scans[0],
        problem.room,
        problem.board,
        positions,
        spacing,
        place.height,
        lambda: tick(next(done) / len(positions)),
    )
    scores = _within(scores, free.get(HEADING), place.heading)
    chosen = at_marks(problem.board, best_apart(scores, _ROUGH)) or [(*place.position, place.heading)]
    starts = []
    for pose in chosen:
        values = problem.start()
        at_pose: dict[Quantity, float] = dict(zip((X, Y, HEADING), pose, strict=True))
        for row, parameter in enumerate(problem.parameters):
            values[row] = at_pose.get(parameter.quantity, values[row])
        starts.append(values)
    return starts


def _span(parameter: Parameter) -> tuple[float, float]:
    """Return the lower and upper value of a parameter that are searched."""
    if parameter.expected is None or parameter.deviation is None:
        return parameter.lower, parameter.upper
    reach = _SURE * parameter.deviation
    return max(parameter.lower, parameter.expected - reach), min(parameter.upper, parameter.expected + reach)


def _within(scores: Scores, heading: Parameter | None, given: float) -> Scores:
    """Return the scores of the allowed headings, shifted by whole turns into the range of the parameter."""
    lower, upper = (given, given) if heading is None else _span(heading)
    middle = (lower + upper) / 2
    if not math.isfinite(upper - lower):
        return scores
    half = math.pi / scores.headings.size
    turned = middle + angle_difference(scores.headings, middle)
    allowed = np.abs(turned - middle) <= (upper - lower) / 2 + half
    return replace(
        scores,
        headings=np.clip(turned, lower, upper),
        scores=np.where(allowed, scores.scores, -math.inf),
    )


def is_same(problem: Problem, values: FloatArray, other: FloatArray) -> bool:
    """Report whether all poses of two solutions agree within 2 cm and 3°."""
    for row, parameter in enumerate(problem.parameters):
        difference = float(values[row] - other[row])
        if parameter.quantity.is_angle and abs(math.remainder(difference, math.tau)) > _SAME_HEADING:
            return False
        if parameter.quantity in (X, Y) and abs(difference) > _SAME:
            return False
    return True


# Grid search for the turntable heading, the range offset and the position at which most readings match the model.


PLAIN_HEADINGS = 720  # 0.5° apart
OFFSETS = np.linspace(-0.06, 0.06, 25)  # m
REACH = 0.03  # m, largest error of a measured position
STEP = 0.01  # m, between positions
PARAMETERS = ("heading", "offset", "position")
_GAP = math.radians(3)  # between headings, largest in a run; counts differ with the steps of the turntable
_CLOSER = 0.5  # of the mean error, below which a fit wins over one with a few more matching readings


@dataclass(frozen=True)
class Fit:
    """The result of the grid search."""

    offset: float  # m, added to every measured range
    place: Place  # fitted; its heading is the actual one of turntable step 0
    free: tuple[str, ...] = ()  # names of the fitted quantities, in the order of PARAMETERS
    moved: float = 0.0  # m from the given position
    # rad: if the heading was fitted, those of the grid with as many matching readings, within a standard error
    alike: tuple[float, ...] = ()

    @property
    def heading(self) -> float:
        """Heading of turntable step 0 in the room, rad."""
        return self.place.heading

    @property
    def at_edge(self) -> tuple[str, ...]:
        """The fitted quantities whose value is at the edge of its search. The best value may lie beyond."""
        edges = {
            "offset": abs(self.offset) > OFFSETS[-1] - 1e-9,
            "position": self.moved > REACH - STEP / 2,
        }
        return tuple(name for name in self.free if edges.get(name, False))

    @property
    def search(self) -> str:
        """The grid that was searched, as a clause."""
        step = float(OFFSETS[1] - OFFSETS[0])
        grids = {
            "heading": f"heading in steps of {360 / PLAIN_HEADINGS:g}°",
            "offset": f"offset within {OFFSETS[-1] * 1000:.0f} mm in steps of {step * 1000:.0f} mm",
            "position": f"position within {REACH * 100:.0f} cm in steps of {STEP * 100:.0f} cm",
        }
        return "; ".join(grids[name] for name in self.free)

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        """First and last heading, rad, of each run of headings with as many matching readings."""
        if not self.alike:
            return ()
        headings = np.sort(self.heading + angle_difference(np.array(self.alike), self.heading))
        runs = np.split(headings, np.flatnonzero(np.diff(headings) > _GAP) + 1)
        return tuple((float(run[0]), float(run[-1])) for run in runs)

    @property
    def spans_deg(self) -> list[list[float]]:
        """The same in degrees, near the fitted heading."""
        return [[estimate_degrees(end, self.heading, 1) for end in span] for span in self.spans]

    @property
    def spans_text(self) -> str:
        """The same in words."""
        return " and ".join(f"{begin:.1f}° to {end:.1f}°" for begin, end in self.spans_deg)

    def lines(self) -> Iterator[str]:
        """Yield lines of text: how the grid was searched, which headings explain as much, and what `fit` adds."""
        yield f"fitted on a grid for the most readings within 5 cm: {self.search}"
        if len(self.alike) > 1:
            yield f"as many, within a standard error, with step 0 at {self.spans_text}; the likeliest of these is taken"
        yield "`sonarhw fit` searches between these steps and farther, and adds credible intervals"

    @property
    def doubts(self) -> tuple[str, ...]:
        """A warning if a value is at the edge of its search."""
        edge = " and ".join(self.at_edge)
        return (f"{edge} at the edge of the grid; a better fit may lie beyond",) if edge else ()


def fit_scan(
    readings: Sequence[Reading],
    room: Room,
    place: Place,
    board: Board,
    free: frozenset[str],
    *,
    model: Model = Model.RAY_FOLLOWING,
    options: PredictionOptions | None = None,
    tick: Callable[[float], None] = lambda _share: None,
) -> Fit:
    """Return the heading, offset and position at which most readings are within 5 cm of the model.

    Only those named in `free` change; the others stay at the place's heading and position, and at offset 0. Ties go to
    the smaller mean error, then to the smaller offset, then to the nearer position. If the number of readings is the
    same within a standard error, a fit with less than half of the mean error is preferred. `tick` receives the share
    that is done, 0..1. Raises InputError if `free` has an unknown name, no reading has an echo, or the board is a ring.
    """
    readings = without_own_body(board.own_body, readings)
    _check(readings, free)
    if board.ring is not None:
        raise InputError(f"fit: board {board.name!r} is a ring of sensors and has no turntable to fit")
    place = board.faced(place)

    def searched(here: Place, begin: float, end: float) -> Fit:
        places = places_near(here) if "position" in free else [here]

        def tables() -> Iterator[tuple[Place, FloatArray]]:
            for done, near in enumerate(places):
                tick(begin + (end - begin) * done / len(places))
                yield near, predict_with(model, room, near, board, all_round(), options).ranges

        return best_agreement(readings, tables(), free, board)

    if "heading" in free and (board.axis_x or board.axis_y):
        # where the turning axis is depends on the heading, which is found without it first
        rough = searched(place, 0.0, 0.5)
        best = searched(replace(place, heading=rough.heading), 0.5, 1.0)
    else:
        best = searched(place, 0.0, 1.0)
    tick(1.0)
    moved = math.dist(best.place.position, place.position)
    best = replace(best, place=replace(best.place, heading=turned_near(best.heading, place.heading)))
    return replace(best, free=tuple(name for name in PARAMETERS if name in free), moved=moved)


def likely_fit(
    readings: Sequence[Reading],
    room: Room,
    place: Place,
    board: Board,
    free: frozenset[str],
    *,
    model: Model = Model.RAY_FOLLOWING,
    options: PredictionOptions | None = None,
    tick: Callable[[float], None] = lambda _share: None,
) -> Fit:
    """Return the result of `fit_scan` with the most likely of the headings at which as many readings match.

    A wide beam receives the echo of a wall over many degrees, so as many readings match over several degrees. A
    baseline model has no likelihood; it takes the middle of these headings. Offset and position, if they are free, are
    searched again with the heading.
    """
    fit = fit_scan(readings, room, place, board, free, model=model, options=options, tick=tick)
    if len(fit.alike) < 2:
        return fit
    of_room, others, best = without_own_body(board.own_body, readings), free - {"heading"}, fit
    for _ in range(2 if others else 1):  # the first heading leads to a better position
        if model is Model.RAY_FOLLOWING:
            heading = _likely_heading(best, of_room, room, board, options or PredictionOptions())
        else:
            heading = next(sum(span) / 2 for span in fit.spans if span[0] <= fit.heading <= span[1])
        heading = turned_near(heading, board.faced(place).heading)
        best = replace(best, place=replace(best.place, heading=heading))
        if others:
            turned = replace(place, heading=heading - board.heading_at(0.0, 0.0))
            best = fit_scan(readings, room, turned, board, others, model=model, options=options)
        best = replace(best, free=fit.free, alike=fit.alike)
    return best


def _likely_heading(
    fit: Fit, readings: Sequence[Reading], room: Room, board: Board, options: PredictionOptions
) -> float:
    """Return the most likely of the headings at which as many readings match, rad.

    The likelihood is that of `sonarhw fit`, which judges silent readings, later echoes and the sizes of errors. The
    detection threshold is free, since that of a profile is rarely exact.
    """
    home, headings = board.heading_at(0.0, 0.0), np.array(fit.alike)
    place = replace(fit.place, heading=fit.heading - home)
    # a place of the likelihood is one of a room file, and the offset is part of the board
    shifted = replace(board, range_offset=board.range_offset - fit.offset)
    free = free_parameters((HEADING.name, THRESHOLD.name), ("",), room, shifted)
    problem = make_problem([PlacedScan(readings, place)], room, shifted, free, options, all_echoes=True)

    def best_of(values: FloatArray) -> FloatArray:
        """Return the values with the best of the headings."""
        tried = np.tile(values, (len(headings), 1))
        tried[:, 0] = headings - home
        return np.asarray(tried[int(problem.near(values).many(tried).round(_EQUAL).argmax())])

    coarse = best_of(problem.with_noise(problem.start(), COARSE))
    return float(best_of(refined(problem, coarse))[0]) + home


def all_round() -> FloatArray:
    """Return the headings in the room for the range tables of `best_agreement`, (720,) rad."""
    return np.arange(PLAIN_HEADINGS, dtype=np.float64) * (math.tau / PLAIN_HEADINGS)


def places_near(place: Place) -> list[Place]:
    """Return the place at each position within 3 cm of its own, on a grid of 1 cm, nearest first."""
    steps = np.arange(-round(REACH / STEP), round(REACH / STEP) + 1) * STEP
    moves = [(float(x), float(y)) for x in steps for y in steps if math.hypot(x, y) <= REACH + 1e-9]
    x, y = place.position
    return [replace(place, position=(x + dx, y + dy)) for dx, dy in sorted(moves, key=lambda move: math.hypot(*move))]


def best_agreement(
    readings: Sequence[Reading], tables: Iterable[tuple[Place, FloatArray]], free: frozenset[str], board: Board
) -> Fit:
    """Return the fit of readings of `board` with most of them within 5 cm of a table, among one or more places.

    A table has the predicted ranges of a place at the headings of `all_round`, (720,) m, NaN for no echo.
    """
    angles, measured = angles_and_ranges(readings)
    offsets = OFFSETS if "offset" in free else np.zeros(1)
    starts, places, counts, means = [], [], [], []
    for place, table in tables:
        start = 0.0 if "heading" in free else place.heading
        rows = np.round((start + board.turned(angles)) * (PLAIN_HEADINGS / math.tau)).astype(np.intp)
        turns = PLAIN_HEADINGS if "heading" in free else 1
        matching, errors = _agreement(table, rows, measured, offsets, turns, TOLERANCE)
        starts.append(start)
        places.append(place)
        counts.append(matching)
        means.append(errors)
    if not places:
        raise ValueError("no places to choose from")
    echoes, all_counts = int(np.isfinite(measured).sum()), np.array(counts)
    chosen, turn, offset = _chosen(all_counts, np.array(means), offsets, echoes)
    alike = np.empty(0, dtype=np.intp)
    if "heading" in free:
        most = float(all_counts.max())
        alike = np.flatnonzero(all_counts[chosen, :, offset] >= most - _standard_error(most, echoes))
    heading = starts[chosen] + turn * math.tau / PLAIN_HEADINGS
    headings = (alike * (math.tau / PLAIN_HEADINGS)).tolist()
    return Fit(float(offsets[offset]), replace(places[chosen], heading=heading), alike=tuple(headings))


def agreement_by_turn(table: FloatArray, headings: FloatArray, measured: FloatArray, tolerance: float) -> FloatArray:
    """Return how many of the ranges `measured` (n,) m at `headings` (n,) rad match a table, at each turn of the scan.

    The table is one of `best_agreement`; the result (720,) has one number for each step of its headings.
    """
    rows = np.round(headings * (PLAIN_HEADINGS / math.tau)).astype(np.intp)
    counts, _ = _agreement(table, rows, measured, np.zeros(1), PLAIN_HEADINGS, tolerance)
    return np.asarray(counts[:, 0])


def _chosen(counts: FloatArray, means: FloatArray, offsets: FloatArray, echoes: int) -> tuple[int, int, int]:
    """Return place, turn and offset of the best fit; `counts` and `means` (m) are (places, turns, offsets).

    Most matching readings win, then the smaller mean error. A fit with less than half of that error wins instead if its
    count is the same within a standard error: a reading or two near the limit of 5 cm does not justify a wrong place.
    """
    most = float(counts.max())

    def least(errors: FloatArray, rows: NDArray[np.intp]) -> int:
        """Return the row with the smallest error, or of equal ones with the smallest offset."""
        sizes = np.abs(offsets)[rows % len(offsets)]
        return int(rows[np.lexsort((sizes, errors.round(_EQUAL)))[0]])

    counts_of, means_of = counts.ravel(), means.ravel()
    rows = np.flatnonzero(counts_of == most)
    best = least(means_of[rows], rows)
    mean = float(means_of[best])
    alike = most - _standard_error(most, echoes)
    closer = np.flatnonzero((counts_of >= alike) & (means_of < mean * _CLOSER))
    if len(closer):
        # each reading that does not match has an error of 5 cm or more
        best = least(counts_of[closer] * means_of[closer] + (echoes - counts_of[closer]) * TOLERANCE, closer)
    place, turn, offset = np.unravel_index(best, counts.shape)
    return int(place), int(turn), int(offset)


def _standard_error(matching: float, echoes: int) -> float:
    """Return the standard error of a number of matching readings, 1 or more."""
    return max(1.0, math.sqrt(matching * (1 - matching / echoes)))


def _check(readings: Sequence[Reading], free: frozenset[str]) -> None:
    unknown = free.difference(PARAMETERS)
    if unknown:
        raise InputError(f"fit {sorted(unknown)[0]}: unknown parameter; expected some of {', '.join(PARAMETERS)}")
    if all(reading.range is None for reading in readings):
        raise InputError("nothing to fit: no reading of this scan has an echo")


@compiled
def _agreement(
    table: FloatArray,
    rows: NDArray[np.intp],
    measured: FloatArray,
    offsets: FloatArray,
    turns: int,
    tolerance: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the number of matching readings and their mean error, m, by turn and offset, (turns, offsets) each."""
    counts, means = np.zeros((turns, len(offsets))), np.zeros((turns, len(offsets)))
    for turn in range(turns):
        for k in range(len(rows)):
            predicted = table[(rows[k] + turn) % len(table)]
            for j in range(len(offsets)):
                error = abs(measured[k] + offsets[j] - predicted)
                if error <= tolerance:
                    counts[turn, j] += 1.0
                    means[turn, j] += error
        for j in range(len(offsets)):
            means[turn, j] /= max(counts[turn, j], 1.0)
    return counts, means
