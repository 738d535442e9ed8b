"""A complete fit: starting poses, refinement, several solutions, uncertainties and warnings."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from sonarhw_sim.air import Receiver, Unit
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Room

from sonarhw.errors import Cancelled, InputError
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.fit.fit_warnings import unexplained, warnings_of
from sonarhw_compare.fit.likelihood.objective import COARSE, MODERATE, Problem, make_problem
from sonarhw_compare.fit.marginals import Marginals, marginals_of
from sonarhw_compare.fit.mismatches import shown_mismatches
from sonarhw_compare.fit.search.refine import Peak, highest, peak_at, refined
from sonarhw_compare.fit.search.ridges import underestimated
from sonarhw_compare.fit.search.starting_poses import ScoredValues, is_same, starting_poses
from sonarhw_compare.fit.values.fit_result import Estimate, FitOptions, FitResult, Mode, PlacedScan, Progress
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import AirQuantity
from sonarhw_compare.headings import turned_near
from sonarhw_compare.matching.match import Summary, compare_readings
from sonarhw_compare.matching.regions import mean_run

_PROMISING = 25.0  # largest deficit of the coarse log-likelihood, for independent readings, of another solution
_OTHERS = 3  # other poses of a scan that are refined
_CLIMBS = 5  # most repetitions of a refinement
_AS_GOOD = 6.0  # largest deficit of the log-likelihood of a solution that is reported


@dataclass(frozen=True)
class _Part:
    """A step of a fit, with the shares of the whole fit at its start and end."""

    step: str
    begin: float
    end: float


_SEARCH, _CLIMB, _SAMPLE = _Part("searching", 0.0, 0.5), _Part("refining", 0.5, 0.7), _Part("sampling", 0.7, 1.0)


def fit_scans(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    free: Sequence[Parameter],
    *,
    options: FitOptions | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> FitResult:
    """Return the values of the `free` parameters that explain `scans` best, with their uncertainties.

    `progress` receives the completed share and the name of the present step. As soon as `cancelled` returns True, the
    fit raises `sonarhw.errors.Cancelled`. Raises InputError if nothing is free, a scan has no echo, the board is a
    ring, or the unit is not `pass`.
    """
    options = options or FitOptions()
    check_fit(scans, board, free, options)
    problem = make_problem(scans, room, board, free, options.prediction, all_echoes=options.all_echoes)

    def tick(part: _Part, share: float) -> None:
        if cancelled is not None and cancelled():
            raise Cancelled("the fit was cancelled")
        if progress is not None:
            progress(part.begin + (part.end - part.begin) * share, part.step)

    # for uncertainties and for the comparison of solutions
    weighted = replace(problem, redundancies=_redundancies(problem))
    found = _starting_poses(problem, options, lambda share: tick(_SEARCH, share))
    solutions = _solutions(problem, weighted, found, lambda share: tick(_CLIMB, share))
    marginals = marginals_of(weighted, solutions[0].values, options, lambda share: tick(_SAMPLE, share))
    tick(_SAMPLE, 1.0)
    result = _result(problem, marginals, solutions)
    ridge = underestimated(weighted, solutions[0].values, marginals.narrow)
    result = replace(result, warnings=warnings_of(result, ridge))
    agreed = _agreement(scans, result, options.prediction)
    return replace(result, agreement=agreed, warnings=(*unexplained(scans, agreed), *result.warnings))


def check_fit(scans: Sequence[PlacedScan], board: Board, free: Sequence[Parameter], options: FitOptions) -> None:
    """Raise InputError if such a fit is not possible."""
    if not free:
        raise InputError("nothing is free; name the quantities to fit")
    if not scans:
        raise InputError("nothing to fit: no scan was given")
    for scan in scans:
        if all(reading.range is None for reading in scan.readings):
            raise InputError(f"nothing to fit: no reading of {scan.title or 'this scan'} has an echo")
    if board.ring is not None:
        raise InputError(f"board {board.name!r} is a ring of sensors and has no turntable to fit")
    if options.prediction.unit is not Unit.PASS:
        raise InputError("a fit needs unit pass, where sound passes the sensor; block and reflect are for predictions")


def _starting_poses(problem: Problem, options: FitOptions, tick: Callable[[float], None]) -> list[list[ScoredValues]]:
    """Return the starting poses of each scan."""
    count = len(problem.scans)
    if not options.global_search:
        return [[ScoredValues(problem.start(), 0.0)] for _ in range(count)]

    def tick_of(scan: int) -> Callable[[float], None]:
        return lambda share: tick((scan + share) / count)

    return [starting_poses(problem, scan, tick_of(scan)) for scan in range(count)]


def _solutions(
    problem: Problem, weighted: Problem, found: list[list[ScoredValues]], tick: Callable[[float], None]
) -> list[ScoredValues]:
    """Return the best solution, followed by others that are about as good according to `weighted`."""
    starts = list(_starts(weighted, found))
    stages = COARSE, MODERATE
    rough = [peak_at(problem, refined(problem, start, stages=stages, tick=lambda: tick(0.0))) for start in starts]
    rough.sort(key=lambda one: -one.score)
    tops: list[Peak] = []
    count, promising = len(problem.parameters), _PROMISING * max(weighted.redundancies)
    for done, one in enumerate(rough):
        tick(done / len(rough))
        if rough[0].score - one.score < promising and not any(
            is_same(problem, one.values, other.values) for other in tops
        ):
            # the noise does not depend on the solution, so that of the best one is the start for all
            begin = np.concatenate((one.values[:count], (tops or rough)[0].values[count:]))
            tops.append(highest(problem, begin, _CLIMBS, partial(tick, done / len(rough))))
    tops.sort(key=lambda one: -one.score)
    scored = [ScoredValues(one.values, weighted.near(one.values)(one.values)) for one in tops]
    return [one for one in scored if scored[0].score - one.score < _AS_GOOD]


def _starts(problem: Problem, found: list[list[ScoredValues]]) -> Iterator[FloatArray]:
    """Yield the best poses of all scans together, then the same with another pose of one scan."""
    best = problem.start()
    for scan, several in enumerate(found):
        rows = problem.pose_rows(scan)
        best[rows] = several[0].values[rows]
    yield best
    for scan, several in enumerate(found):
        rows = problem.pose_rows(scan)
        for other in several[1 : 1 + _OTHERS]:
            if several[0].score - other.score < _PROMISING * problem.redundancies[scan]:
                start = best.copy()
                start[rows] = other.values[rows]
                yield start


def _result(problem: Problem, marginals: Marginals, solutions: list[ScoredValues]) -> FitResult:
    count, whole, best = len(problem.parameters), marginals.problem, solutions[0]
    turns = _turns(problem, marginals.middle)
    middle, lower, upper = (one + turns for one in (marginals.middle, marginals.lower, marginals.upper))
    deviations = np.sqrt(np.diag(marginals.covariance))
    estimates = [
        _estimate(parameter, middle[row], deviations[row], lower[row], upper[row])
        for row, parameter in enumerate(whole.parameters)
    ]
    safe = np.maximum(deviations[:count], 1e-300)
    noise = zip(problem.noises, middle[len(whole.parameters) :].tolist(), strict=True)
    room, places, board = problem.setting(middle[:count])
    return FitResult(
        parameters=problem.parameters,
        estimates={one.name: estimate for one, estimate in zip(problem.parameters, estimates, strict=False)},
        correlations=np.asarray(marginals.covariance[:count, :count] / np.outer(safe, safe)),
        noise={one.name: math.exp(value) for one, value in noise},
        warnings=(),
        modes=tuple(_mode(problem, one, best.score) for one in solutions),
        room=room,
        places=places,
        board=board,
        score=best.score,
        samples=(marginals.samples + turns)[:, :count],
        tolerated={one.name: estimate for one, estimate in zip(marginals.tolerated, estimates[count:], strict=True)},
        mismatches=shown_mismatches(marginals.tolerated, *marginals.shifts),
    )


def _redundancies(problem: Problem) -> tuple[float, ...]:
    """Return the number of readings per independent reading, by scan.

    Neighbouring readings of one echo have the same error where the board rounds, or where the model of its receiver is
    only approximate.
    """
    if not problem.rounding and problem.receiver is Receiver.FIRST_ECHO:
        return (1.0,) * len(problem.scans)
    return tuple(mean_run(scan.angles, scan.ranges[:, 0]) for scan in problem.scans)


def _turns(problem: Problem, values: FloatArray) -> FloatArray:
    """Return the full turns, rad, that bring each heading near that of its scan's given place, (size,)."""
    turns = np.zeros_like(values)
    for row, parameter in enumerate(problem.parameters):
        if parameter.quantity.is_angle:
            turns[row] = turned_near(values[row], problem.places[parameter.scan or 0].heading) - values[row]
    return turns


def _estimate(parameter: Parameter, value: float, deviation: float, lower: float, upper: float) -> Estimate:
    # the interval of a heading is at most a full circle
    if parameter.quantity.is_angle:
        lower, upper = max(lower, value - math.pi), min(upper, value + math.pi)
        deviation = min(deviation, math.pi)
    return Estimate(float(value), float(deviation), float(lower), float(upper))


def _mode(problem: Problem, solution: ScoredValues, best: float) -> Mode:
    turned = solution.values + _turns(problem, solution.values)
    values = {parameter.name: float(value) for parameter, value in zip(problem.parameters, turned, strict=False)}
    return Mode(values, solution.score - best)


def _agreement(scans: Sequence[PlacedScan], result: FitResult, prediction: PredictionOptions) -> tuple[Summary, ...]:
    """Return one summary for each scan, compared with the prediction from its fitted place, room and board."""
    return tuple(
        compare_readings(_ranged(scan.readings, result), result.room, place, result.board, prediction).summary()
        for scan, place in zip(scans, result.places, strict=True)
    )


def _ranged(readings: Sequence[Reading], result: FitResult) -> Sequence[Reading]:
    """Return the readings, with ranges from the fitted speed of sound if the air was fitted."""
    if not any(isinstance(parameter.quantity, AirQuantity) for parameter in result.parameters):
        return readings
    return [replace(reading, speed_of_sound=result.room.air.speed_of_sound) for reading in readings]
