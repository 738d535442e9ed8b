"""A complete fit: starting poses, refinement, several solutions, uncertainties and warnings."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from sonarhw_sim.air import Receiver, Unit
from sonarhw_sim.board.profile import Board, parse_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.room.room_writing import with_air, with_place

from sonarhw.errors import InputError, counted, harmless, turned_near
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.corrections import correction_doubt
from sonarhw_compare.edits import below_header, set_marked
from sonarhw_compare.fit.objective import COARSE, MODERATE, Problem, make_problem
from sonarhw_compare.fit.parameters import (
    Parameter,
    applied,
    check_words,
    free_parameters,
    present_value,
    values_by_part,
    with_priors,
)
from sonarhw_compare.fit.quantities import HEADING, NEAR, AirQuantity, BoardQuantity, PlaceQuantity, Quantity, X, Y
from sonarhw_compare.fit.result import (
    Estimate,
    FitOptions,
    FitResult,
    FitWarning,
    Mismatch,
    Mode,
    PlacedScan,
    Progress,
    pose_text,
)
from sonarhw_compare.fit.search import Marginals, Peak, highest, marginals_of, peak_at, refined, underestimated
from sonarhw_compare.fit.starting import ScoredValues, is_same, starting_poses
from sonarhw_compare.match import Comparison, Summary, compare_readings, explains_few, few_explained_line
from sonarhw_compare.regions import mean_run
from sonarhw_compare.scans import BoardInput, GivenScan, PlaceInput, RoomInput, common_board

# What a fit of given scans begins with: their room, board and places, and the parameters.


@dataclass(frozen=True)
class FitSetting:
    """The arguments of `fit_scans`."""

    room: Room
    board: Board
    scans: tuple[PlacedScan, ...]
    parameters: tuple[Parameter, ...]


def fit_setting(
    scans: Sequence[GivenScan],
    room: RoomInput | None,
    places: Sequence[PlaceInput],
    board: BoardInput | None,
    words: Sequence[str],
    priors: Sequence[str],
) -> FitSetting:
    """Return the setting of a fit of the quantities in `words`, with their `priors`.

    Room, places (none, or one for each scan) and board that are not given are taken from the logs. Raises InputError if
    the logs do not contain them, or contain different ones.
    """
    check_count(places, len(scans))
    check_words(words, priors)
    room = _common_room(scans) if room is None else scans[0].room(room)
    board = common_board(scans, board)
    names = _names(scans)
    parameters = free_parameters(words, names, room, board)
    fixed = [name for name in ("x", "y") if all(parameter.quantity.name != name for parameter in parameters)]
    chosen = [room.place(place) for place in places] or [_recorded(scan, room, fixed) for scan in scans]
    placed = placed_scans(scans, chosen)
    if places:
        parameters = tuple(_near(parameter, placed) for parameter in parameters)
    return FitSetting(room, board, placed, with_priors(parameters, priors))


def placed_scans(scans: Sequence[GivenScan], places: Sequence[Place]) -> tuple[PlacedScan, ...]:
    """Return scans at these places, each with a name of its own: that of its log, numbered if several have it."""
    return tuple(
        PlacedScan(scan.readings, place, name, scan.where)
        for scan, place, name in zip(scans, places, _names(scans), strict=True)
    )


def check_count(places: Sequence[PlaceInput], scans: int) -> None:
    """Raise InputError unless there is no place, or one for each scan."""
    if places and len(places) != scans:
        raise InputError(f"places: expected one for each of {counted(scans, 'log')}, got {len(places)}")


def _common_room(scans: Sequence[GivenScan]) -> Room:
    """Return the room inside the logs. Raises InputError if there is none, or if they have different ones."""
    first = scans[0]
    room = first.room()
    for scan in scans:
        if scan.room_text not in ("", room.text):
            raise InputError(f"{first.where} and {scan.where} contain different rooms; give one room for both")
    return room


def _names(scans: Sequence[GivenScan]) -> list[str]:
    stems = [Path(scan.where).stem for scan in scans]
    return stems if len(set(stems)) == len(stems) else [f"{stem}{k + 1}" for k, stem in enumerate(stems)]


def _recorded(scan: GivenScan, room: Room, fixed: Sequence[str]) -> Place:
    """Return the place of a log. Raises InputError if it is unknown although a coordinate is fixed."""
    recorded = scan.recorded_place(room)
    if recorded is not None:
        return room.place(recorded)
    if len(room.places) == 1:
        return room.place(None)
    if not fixed:
        # the whole room is searched, so the place may be unknown
        return Place("", _middle(room))
    reason = f"{' and '.join(fixed)} {'is' if len(fixed) == 1 else 'are'} fixed"
    raise InputError(f"{scan.where}: its place is unknown, and {reason}; give a place, or free the position")


def _middle(room: Room) -> tuple[float, float]:
    ends = room.walls.reshape(-1, 2)
    x, y = ((ends.min(axis=0) + ends.max(axis=0)) / 2).tolist()
    return x, y


def _near(parameter: Parameter, scans: Sequence[PlacedScan]) -> Parameter:
    if parameter.quantity not in (X, Y):
        return parameter
    coordinate = scans[parameter.scan or 0].place.position[0 if parameter.quantity is X else 1]
    return replace(parameter, lower=coordinate - NEAR, upper=coordinate + NEAR)


# Warnings of a fit: several solutions, parameters that the data do not determine, values at their bounds.


_INSEPARABLE = 0.95  # smallest correlation that is reported
_SAYS_NOTHING = 0.6  # of the standard deviation of the prior
_AT_BOUND = 0.01  # of the range between the bounds
_MANY_STRAYS = 0.3  # per metre


def warnings_of(result: FitResult, underestimated: Sequence[Parameter] = ()) -> tuple[FitWarning, ...]:
    """Return a warning for each limit of a fit; `underestimated` are parameters whose deviations are too small."""
    warnings: list[FitWarning] = [*_several_solutions(result)]
    if underestimated:
        several = ", ".join(parameter.name for parameter in underestimated)
        text = f"± cannot be trusted: {several} can change together by far more; fix one of them, or give a prior"
        warnings.append(FitWarning("underestimated", text))
    for parameter in result.parameters:
        warnings += _undetermined(parameter, result.estimates[parameter.name])
    names = list(result.estimates)
    for i in range(len(names)):
        warnings += [
            _known_together(names[i], names[j], float(result.correlations[i, j]))
            for j in range(i)
            if abs(result.correlations[i, j]) > _INSEPARABLE
        ]
    warnings += [FitWarning("mismatch", str(mismatch)) for mismatch in result.mismatches]
    if result.noise["stray_per_m"] > _MANY_STRAYS:
        text = "many echoes match no path of the model; an object may be missing in the room file"
        warnings.append(FitWarning("many strays", text))
    return tuple(warnings)


def _known_together(name: str, other: str, correlation: float) -> FitWarning:
    text = f"{name} and {other} are only known together (correlation {correlation:+.2f})"
    return FitWarning("known together", text)


def unexplained(scans: Sequence[PlacedScan], agreement: Sequence[Summary]) -> tuple[FitWarning, ...]:
    """Return a warning for each scan that the result explains badly."""
    return tuple(
        FitWarning("few explained", few_explained_line(scan.title or "this scan", share, summary.n_echo), share)
        for scan, summary in zip(scans, agreement, strict=True)
        if (share := summary.within_5cm) is not None and explains_few(share)
    )


def _corrections(scans: Sequence[PlacedScan], compared: Sequence[Comparison]) -> tuple[FitWarning, ...]:
    """Return a warning for each scan that a turn or unit other than those of its readings would explain better."""
    doubts = (
        correction_doubt(scan.title or "this scan", comparison)
        for scan, comparison in zip(scans, compared, strict=True)
    )
    return tuple(FitWarning("correction", doubt) for doubt in doubts if doubt)


def _several_solutions(result: FitResult) -> list[FitWarning]:
    shown = tuple(parameter for parameter in result.parameters if isinstance(parameter.quantity, PlaceQuantity))
    poses = [tuple(mode.values[one.name] for one in shown) for mode in result.modes]
    # solutions that differ only in digits that are not printed are one
    texts = list(dict.fromkeys(pose_text(shown, pose, poses[0]) for pose in poses))
    if len(texts) < 2:
        return []
    equal = f"{len(texts)} solutions explain the scan about equally well, the room may be symmetric"
    first = "; the first is that at the stated place" if result.modes[0].score < 0 else ""
    return [FitWarning("several solutions", f"{equal}: {'; '.join(texts)}{first}")]


def is_unconstrained(parameter: Parameter, estimate: Estimate) -> bool:
    """Report whether an estimate is about as uncertain as its prior."""
    lower, upper = _bounds(parameter)
    before = (upper - lower) / math.sqrt(12)
    if parameter.deviation is not None:
        before = min(before, parameter.deviation)
    return estimate.deviation > _SAYS_NOTHING * before


def _bounds(parameter: Parameter) -> tuple[float, float]:
    return (-math.pi, math.pi) if parameter.quantity.is_angle else (parameter.lower, parameter.upper)


def _undetermined(parameter: Parameter, estimate: Estimate) -> list[FitWarning]:
    lower, upper = _bounds(parameter)
    if is_unconstrained(parameter, estimate):
        text = f"the scan hardly constrains {parameter.name}: ± is as wide as the prior"
        return [FitWarning("unconstrained", text)]
    if not parameter.quantity.is_angle:
        for bound in (lower, upper):
            if abs(estimate.value - bound) < _AT_BOUND * (upper - lower):
                text = f"{parameter.name} is at its bound, {bound:g} {parameter.quantity.unit}".rstrip()
                return [FitWarning("at bound", text)]
    return []


# Which walls, levels or turntable the scan shows to be wrong, found one after the other.
#
# The value is chosen that explains most if it alone is off. Further ones are added while they explain much more.


_CLEAR = 20.0  # smallest gain, chi-squared of one value, that is reported; by chance, 1 is expected
_SIMILAR = 6.0  # largest difference of the gains of values that the scan cannot tell apart
_MOST = 3


def shown_mismatches(
    tolerated: Sequence[Parameter], shifts: FloatArray, covariance: FloatArray
) -> tuple[Mismatch, ...]:
    """Return the values that a scan shows to be off, clearest first.

    `shifts` (t,) from the values of room and board, and `covariance` (t, t), are those of the posterior.
    """
    if not len(shifts):
        return ()
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    information = np.linalg.pinv(covariance / np.outer(scale, scale))
    pull = information @ (shifts / scale)
    chosen: list[int] = []
    others: list[tuple[str, ...]] = []
    while len(chosen) < min(_MOST, len(shifts)):
        gains = _gains(information, pull, chosen)
        best = int(gains.argmax())
        if gains[best] < _CLEAR:
            break
        similar = np.flatnonzero(gains > max(gains[best] - _SIMILAR, _CLEAR / 2))
        others.append(tuple(tolerated[row].name for row in similar.tolist() if row != best))
        chosen.append(best)
    among = information[np.ix_(chosen, chosen)]
    sizes, spreads = np.linalg.solve(among, pull[chosen]), np.sqrt(np.diag(np.linalg.inv(among)))
    return tuple(
        Mismatch(tolerated[row], float(size * scale[row]), float(spread * scale[row]), also)
        for row, size, spread, also in zip(chosen, sizes, spreads, others, strict=True)
    )


def _gains(information: FloatArray, pull: FloatArray, chosen: list[int]) -> FloatArray:
    """Return what each value alone explains, chi-squared (t,), if the chosen ones are already off; 0 for those."""
    across = information[:, chosen]
    solved = np.linalg.solve(information[np.ix_(chosen, chosen)], np.column_stack((across.T, pull[chosen])))
    left = pull - across @ solved[:, -1]
    stiffness = np.diag(information) - (across * solved[:, :-1].T).sum(axis=1)
    gains = np.where(stiffness > 1e-9, left**2 / np.maximum(stiffness, 1e-9), 0.0)
    gains[chosen] = 0.0
    return np.asarray(gains)


_PROMISING = 25.0  # largest deficit of the coarse log-likelihood, for independent readings, of another solution
_OTHERS = 3  # other poses of a scan that are refined
_CLIMBS = 5  # most repetitions of a refinement
_AS_GOOD = 6.0  # largest deficit of the log-likelihood of a solution that is reported


def fit_scans(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    free: Sequence[Parameter],
    *,
    options: FitOptions | None = None,
    progress: Progress | None = None,
) -> FitResult:
    """Return the values of the `free` parameters that explain `scans` best, with their uncertainties.

    `progress` receives the completed share and the name of the present step; it can end the fit by an exception. Raises
    InputError if nothing is free, a scan has no echo, the board is a ring, or the unit is not `pass`.
    """
    options = options or FitOptions()
    check_fit(scans, board, free, options)
    problem = make_problem(scans, room, board, free, options.prediction, all_echoes=options.all_echoes)

    def tick(step: str, begin: float, end: float, share: float) -> None:
        if progress is not None:
            progress(begin + (end - begin) * share, step)

    sampling = partial(tick, "sampling", 0.7, 1.0)

    # for uncertainties and for the comparison of solutions
    weighted = problem.with_redundancies(_redundancies(problem))
    starts = _starting_poses(problem, options, partial(tick, "searching", 0.0, 0.5))
    solutions = _solutions(problem, weighted, starts, partial(tick, "refining", 0.5, 0.7))
    solutions = _nearest_first(scans, problem, solutions)
    marginals = marginals_of(weighted, solutions[0].values, options, sampling)
    sampling(1.0)
    result = _result(problem, marginals, solutions)
    ridge = underestimated(weighted, solutions[0].values, marginals.narrow)
    result = replace(result, warnings=warnings_of(result, ridge))
    compared = _compared(scans, result, options.prediction)
    agreed = tuple(comparison.summary() for comparison in compared)
    warnings = (*unexplained(scans, agreed), *_corrections(scans, compared), *result.warnings)
    return replace(result, agreement=agreed, warnings=warnings)


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
    problem: Problem, weighted: Problem, poses: list[list[ScoredValues]], tick: Callable[[float], None]
) -> list[ScoredValues]:
    """Return the best solution, followed by others that are about as good according to `weighted`.

    Raises InputError if the board cannot have made the readings anywhere.
    """
    starts = list(_starts(weighted, poses))
    stages = COARSE, MODERATE
    rough = [peak_at(problem, refined(problem, start, stages=stages, tick=lambda: tick(0.0))) for start in starts]
    rough.sort(key=lambda peak: -peak.score)
    tops: list[Peak] = []
    count, promising = len(problem.parameters), _PROMISING / min(float(one.mean()) for one in weighted.shares)
    for done, peak in enumerate(rough):
        tick(done / len(rough))
        if rough[0].score - peak.score < promising and not any(
            is_same(problem, peak.values, other.values) for other in tops
        ):
            # the noise does not depend on the solution, so that of the best one is the start for all
            begin = np.concatenate((peak.values[:count], (tops or rough)[0].values[count:]))
            top = highest(problem, begin, _CLIMBS, partial(tick, done / len(rough)))
            # paths that are searched again may leave an echo without any
            tops.append(top if math.isfinite(top.score) else peak_at(problem, begin))
    tops.sort(key=lambda peak: -peak.score)
    scored = [ScoredValues(top.values, weighted.near(top.values)(top.values)) for top in tops]
    if not scored or not math.isfinite(scored[0].score):
        raise InputError(
            f"room {problem.room.name!r}, board {problem.board.name!r}: from no pose in this room can this board have "
            "an echo as near as those of the scans; check the room, the board and its blanking"
        )
    return [peak for peak in scored if scored[0].score - peak.score < _AS_GOOD]


def _nearest_first(scans: Sequence[PlacedScan], problem: Problem, solutions: list[ScoredValues]) -> list[ScoredValues]:
    """Return the solutions, those first at which all scans stand near their stated places.

    The scans are about equally likely at all of these solutions.
    """

    def is_far(solution: ScoredValues) -> bool:
        _, places, _ = problem.setting(solution.values[: len(problem.parameters)])
        pairs = zip((scan.place for scan in scans), places, strict=True)
        return any(stated.name and math.dist(stated.position, fitted.position) > NEAR for stated, fitted in pairs)

    return sorted(solutions, key=is_far)


def _starts(problem: Problem, poses: list[list[ScoredValues]]) -> Iterator[FloatArray]:
    """Yield the best poses of all scans together, then the same with another pose of one scan."""
    best = problem.start()
    for scan, several in enumerate(poses):
        rows = problem.pose_rows(scan)
        best[rows] = several[0].values[rows]
    yield best
    for scan, several in enumerate(poses):
        rows = problem.pose_rows(scan)
        for other in several[1 : 1 + _OTHERS]:
            if several[0].score - other.score < _PROMISING / problem.shares[scan].mean():
                start = best.copy()
                start[rows] = other.values[rows]
                yield start


def _result(problem: Problem, marginals: Marginals, solutions: list[ScoredValues]) -> FitResult:
    count, whole = len(problem.parameters), marginals.problem
    highest_score = max(solution.score for solution in solutions)
    turns = _turns(problem, marginals.middle)
    middle, lower, upper = (values + turns for values in (marginals.middle, marginals.lower, marginals.upper))
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
        estimates={values.name: estimate for values, estimate in zip(problem.parameters, estimates, strict=False)},
        correlations=np.asarray(marginals.covariance[:count, :count] / np.outer(safe, safe)),
        noise={values.name: math.exp(value) for values, value in noise},
        warnings=(),
        modes=tuple(_mode(problem, solution, highest_score) for solution in solutions),
        room=room,
        places=places,
        board=board,
        score=solutions[0].score,
        samples=(marginals.samples + turns)[:, :count],
        tolerated={
            values.name: estimate for values, estimate in zip(marginals.tolerated, estimates[count:], strict=True)
        },
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


def _compared(scans: Sequence[PlacedScan], result: FitResult, prediction: PredictionOptions) -> tuple[Comparison, ...]:
    """Return each scan compared with the prediction from its fitted place, room and board."""
    return tuple(
        compare_readings(_ranged(scan.readings, result), result.room, place, result.board, prediction)
        for scan, place in zip(scans, result.places, strict=True)
    )


def _ranged(readings: Sequence[Reading], result: FitResult) -> Sequence[Reading]:
    """Return the readings, with ranges from the fitted speed of sound if the air was fitted."""
    if not any(isinstance(parameter.quantity, AirQuantity) for parameter in result.parameters):
        return readings
    return [replace(reading, speed_of_sound=result.room.air.speed_of_sound) for reading in readings]


# Room files and board profiles with fitted values.
#
# Comments, layout and all values that were not free stay unchanged. A profile marks its fitted values, a room file
# lists them at its top.


Values = Mapping[Parameter, float]


def fitted_room(room: Room, values: Values, places: Sequence[Place]) -> Room:
    """Return the room with these values; `places` are the fitted places of the scans, with the names for the room file.

    Raises InputError if the result is not a valid room, such as a place inside a post or a wall without length.
    """
    for parts, by_part in values_by_part(values).items():
        room = parts.write(room, by_part)
    for parameter, value in values.items():
        if isinstance(quantity := parameter.quantity, AirQuantity):
            number = getattr(quantity.put(room.air, value), quantity.key)
            room = with_air(room, replace(room.air, **{quantity.key: round(number, quantity.digits)}))
    if any(isinstance(parameter.quantity, PlaceQuantity) for parameter in values):
        for place in places:
            room = with_place(room, _rounded(place))
    return room


def _rounded(place: Place) -> Place:
    x, y = (round(coordinate, X.digits) + 0.0 for coordinate in place.position)
    return replace(place, position=(x, y), heading=math.radians(round(math.degrees(place.heading), HEADING.digits)))


def with_listed_findings(room: Room, before: str, findings: Sequence[str], logs: Sequence[str]) -> Room:
    """Return the room with a header that lists the `findings`, as lines of `finding`; `before` is the old room's name.

    A header, and not comments beside the values, because a wall's shift changes several points, and tables within one
    line cannot contain comments.
    """
    header = [
        f"# Fitted by `sonarhw fit`{_on(logs)}, beginning with room {before!r}:",
        *(f"#   {harmless(finding)}" for finding in findings),
    ]
    return parse_room("\n".join([*header, room.text]), f"room {room.name!r}")


def _written(quantity: Quantity, value: float) -> str:
    return f"{value * quantity.per_unit:z.{quantity.digits}f}"


def _unit(quantity: Quantity) -> str:
    return quantity.unit if quantity.is_angle or not quantity.unit else f" {quantity.unit}"


def _on(logs: Sequence[str]) -> str:
    return f" on {', '.join(logs)}" if logs else ""


def fitted_board(
    board: Board,
    values: Values,
    name: str,
    deviations: Values | None = None,
    logs: Sequence[str] = (),
    unconstrained: Sequence[str] = (),
) -> Board:
    """Return the board with these values and another name. Raises InputError if a value is not allowed.

    The text marks each fitted value, with ± its standard deviation if given, and names the `logs` and the
    `unconstrained` quantities, whose values are kept. Comments of the old
    profile are quoted under its name, because they describe the old values only.
    """
    profile: Any = tomlkit.parse(board.text)
    profile["name"] = name
    names = []
    for parameter, quantity, value in board_values(board, values):
        deviation = None if deviations is None else deviations.get(parameter)
        spread = "" if deviation is None else f" ± {deviation:.{quantity.digits}f}"
        table, key = table_and_key(profile, quantity)
        set_marked(table, key, value, quantity.read(board), f"fitted{spread}")
        names.append(quantity.name)
    text = _with_provenance(tomlkit.dumps(profile), board.name, names, logs, unconstrained)
    return parse_board(text, f"profile {name!r}")


def board_values(board: Board, values: Values) -> Iterator[tuple[Parameter, BoardQuantity, float]]:
    """Yield each fitted value of a board as its profile states it; `board` is the one of the fit."""
    for parameter, value in values.items():
        if isinstance(quantity := parameter.quantity, BoardQuantity):
            yield parameter, quantity, round(quantity.read(quantity.put(board, value)), quantity.digits)


def table_and_key(profile: Any, quantity: BoardQuantity) -> tuple[Any, str]:
    """Return the table of a profile's TOML document that contains a quantity, and its key there."""
    section, _, key = quantity.key.rpartition(".")
    return profile.setdefault(section, tomlkit.table()) if section else profile, key


def _with_provenance(
    text: str, before: str, names: Sequence[str], logs: Sequence[str], unconstrained: Sequence[str]
) -> str:
    """Return the text below a header with the fitted values; its old header is quoted as that of profile `before`."""
    fitted = ", ".join(names) or "no value"
    header = [f"# Fitted by `sonarhw fit`{_on(logs)}, beginning with profile {before!r}: {fitted}."]
    if unconstrained:
        header.append(f"# Kept, the scans hardly constrain it: {', '.join(unconstrained)}.")
    return below_header(header, text, before)


@dataclass(frozen=True)
class FittedScans(FitResult):
    """The result of a fit of given scans, and what the fit began with. Its files are those of `sonarhw fit`."""

    setting: FitSetting = field(kw_only=True)

    def room_file(self) -> Room:
        """Return the fitted room with a list of its fitted values.

        A place of the room keeps its name. A place that is not in the room, or that several scans have, gets the name
        of its scan. Values that the scans hardly constrain stay as they were.
        """
        setting, values = self.setting, self._constrained()
        names = [scan.place.name for scan in setting.scans]
        own = {name for name in setting.room.places if names.count(name) == 1}
        poses = {one: value for one, value in values.items() if isinstance(one.quantity, PlaceQuantity)}
        fitted = applied(poses, setting.room, [scan.place for scan in setting.scans], setting.board)[1]
        places = [
            replace(place, name=scan.place.name if scan.place.name in own else scan.name)
            for place, scan in zip(fitted, setting.scans, strict=True)
        ]
        lines = [
            self._listed(parameter)
            for parameter in self.parameters
            if not isinstance(parameter.quantity, BoardQuantity)
        ]
        fitted_file = fitted_room(setting.room, values, places)
        return with_listed_findings(fitted_file, setting.room.name, lines, self._log_names)

    def board_file(self, name: str) -> Board:
        """Return the fitted board profile with this name; values that the scans hardly constrain stay as they were."""
        values = self._constrained()
        deviations = {value: self.estimates[value.name].deviation for value in values}
        unconstrained = [
            parameter.name
            for parameter in self.parameters
            if parameter not in values and isinstance(parameter.quantity, BoardQuantity)
        ]
        return fitted_board(self.setting.board, values, name, deviations, self._log_names, unconstrained)

    def _constrained(self) -> dict[Parameter, float]:
        """Return the fitted values, without those that the scans hardly constrain and that have a former value."""
        return {
            parameter: self.estimates[parameter.name].value
            for parameter in self.parameters
            if self._before(parameter) is None or not is_unconstrained(parameter, self.estimates[parameter.name])
        }

    def _listed(self, parameter: Parameter) -> str:
        """Return one line: the fitted value with its deviation and the former value, or that the former one is kept."""
        quantity, estimate, before = parameter.quantity, self.estimates[parameter.name], self._before(parameter)
        if before is not None and is_unconstrained(parameter, estimate):
            return f"{parameter.name} {_written(quantity, before)}: kept, the scans hardly constrain it"
        value, deviation = (_written(quantity, number) for number in (estimate.value, estimate.deviation))
        former = "" if before is None else f"; before: {_written(quantity, before)}"
        return f"{parameter.name} {value} ± {deviation}{_unit(quantity)}{former}"

    def _before(self, parameter: Parameter) -> float | None:
        """Return the value before the fit; None for the pose of a scan whose place is unknown."""
        place = self.setting.scans[parameter.scan or 0].place
        if isinstance(parameter.quantity, PlaceQuantity) and not place.name:
            return None
        return present_value(parameter, place, self.setting.room, self.setting.board)

    @property
    def _log_names(self) -> list[str]:
        return [Path(scan.file).name for scan in self.setting.scans]
