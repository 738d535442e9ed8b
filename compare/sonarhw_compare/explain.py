"""Explanations of a reading: its cause as a sentence, its paths, its rivals, and what would change it."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import ROOM_TOLERANCE, Model, Receiver
from sonarhw_sim.board.profile import path_loss_db, stepped_gain_db
from sonarhw_sim.board.signal import is_stepped
from sonarhw_sim.predict.predicted_scan import Echo, PredictedPing, PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Room

from sonarhw import arguments
from sonarhw.errors import InputError, counted, heading_text, in_degrees, pose_heading_text
from sonarhw.readings import FloatArray, Origin
from sonarhw_compare.match import TOLERANCE, Comparison, Kind, Matched, Summary
from sonarhw_compare.regions import Region
from sonarhw_compare.score import (
    ProbabilityScore,
    RegionMatch,
    assigned_echoes,
    calibration_text,
    compare_regions,
    echo_statistics,
    score_comparison,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sonarhw_compare.fit.starting import Fit

# Margins of the first echo: the changes of threshold or walls after which another echo would be reported.
#
# The first echo over the detection threshold wins. When the threshold rises above the level of the winner, the next
# later and louder echo wins. A step is one winner and the interval of thresholds in which it wins. Levels are those
# of the carrier. The board's own receiver also detects the edges of a burst, so its margins differ slightly.


_SAME_LENGTH = 1e-6  # m, for a path and its reverse


@dataclass(frozen=True)
class Step:
    """One winner and the thresholds with which it wins."""

    path: int  # the loudest of its arrival
    range: float  # m, as reported by the board
    level_db: float  # of its arrival, the highest threshold with which it wins
    above_db: float  # it wins above this, the level of the loudest earlier echo; -inf without one


@dataclass(frozen=True)
class Contest:
    """The winner at one heading, and the echoes that would win instead."""

    winner: Step | None  # None: no echo is detected
    margin_db: float | None  # level of the winner minus the threshold
    louder: Step | None  # winner with a threshold above that margin; None: no echo
    fainter: Step | None  # winner with a lower threshold: earlier, but not detected
    lacking_db: float | None  # threshold minus the level of `fainter`
    next: Echo | None  # the next detected echo after the winner
    behind: float | None  # m, its range minus that of the winner


@dataclass(frozen=True)
class WallChange:
    """The smallest shift of one wall after which a later echo becomes the first."""

    wall: str
    nearer: float  # m, along its normal towards the sensor; negative: away from it
    echo: Echo  # the new winner


def contest(prediction: PredictedScan, index: int) -> Contest:
    """Return the winner at heading `index` and the echoes that would win instead."""
    threshold, ping = prediction.board.threshold_db, prediction.ping(index)
    all_steps = steps(ping)
    row = next((k for k, step in enumerate(all_steps) if step.level_db >= threshold), len(all_steps))
    winner = all_steps[row] if row < len(all_steps) else None
    fainter = all_steps[row - 1] if row > 0 else None
    later = [echo for echo in ping.echoes if winner is not None and echo.range > winner.range]
    return Contest(
        winner,
        None if winner is None else winner.level_db - threshold,
        all_steps[row + 1] if row + 1 < len(all_steps) else None,
        fainter,
        None if fainter is None else threshold - fainter.level_db,
        later[0] if later else None,
        later[0].range - winner.range if later and winner is not None else None,
    )


def steps(ping: PredictedPing) -> tuple[Step, ...]:
    """Return each echo of a ping that wins with some threshold, nearest and faintest first."""
    lengths, levels, loudest = ping.scan.apparent_lengths, ping.levels, ping.loudest
    rows = np.flatnonzero(ping.scan.in_time & np.isfinite(levels))
    rows = rows[np.argsort(lengths[rows], kind="stable")]
    before = np.maximum.accumulate(np.append(-math.inf, levels[rows]))[:-1]
    records = rows[levels[rows] > before]
    ranges = ping.scan.board.reported(ping.arrival_lengths[records] / 2)
    above = before[levels[rows] > before]
    return tuple(
        Step(int(loudest[first]), float(distance), float(levels[first]), float(least))
        for first, distance, least in zip(records, ranges, above, strict=True)
    )


def change_for(prediction: PredictedScan, index: int, measured: float | None) -> float | None:
    """Return the change of the threshold (dB) with which the prediction matches the measured range.

    `measured` is in m, None for no echo. The result is 0 if they match already, and None if no threshold achieves it.
    """
    threshold, all_steps = prediction.board.threshold_db, steps(prediction.ping(index))
    if measured is None:
        return max(0.0, all_steps[-1].level_db - threshold) if all_steps else 0.0
    wanted = [step for step in all_steps if abs(step.range - measured) <= TOLERANCE]
    changes = [_into(threshold, step.above_db, step.level_db) for step in wanted]
    return min(changes, key=abs, default=None)


def _into(threshold: float, above: float, upto: float) -> float:
    """Return the change of `threshold` into the interval from `above` to `upto`."""
    if threshold > upto:
        return upto - threshold
    return max(0.0, above - threshold)


def wall_change(prediction: PredictedScan, index: int) -> WallChange | None:
    """Return the smallest shift of one wall, with its corners, after which another echo wins at heading `index`.

    None without such a wall. See `wall_changes` for the limits.
    """
    return min(wall_changes(prediction, index), key=lambda change: abs(change.nearer), default=None)


def wall_changes(prediction: PredictedScan, index: int) -> tuple[WallChange, ...]:
    """Return the smallest shift of one wall after which each later echo overtakes the winner at heading `index`.

    The result is correct to first order in the shift. Levels are assumed not to change, and sums of arrivals are
    ignored, so it may be wrong by half a wavelength. Diffracted echoes, those with the same length as the winner, and
    those that no shift within range helps are left out. Empty without a winner, or if the winner is diffracted.
    """
    winner, paths, lengths = int(prediction.winners[index]), prediction.paths, prediction.apparent_lengths
    if winner < 0 or paths.edges[winner] >= 0:
        return ()
    straight = [echo for echo in prediction.ping(index).echoes if paths.edges[echo.path] < 0]
    later = [echo for echo in straight if lengths[echo.path] - lengths[winner] > _SAME_LENGTH]
    rows = np.array([winner, *(echo.path for echo in later)], dtype=np.intp)
    growth = _growth(prediction, index, rows)
    with np.errstate(divide="ignore"):
        moves = (lengths[rows[1:]] - lengths[winner])[:, None] / (growth[:1] - growth[1:])
    walls = np.abs(moves).argmin(axis=1) if moves.size else np.empty(0, dtype=np.intp)
    return tuple(
        WallChange(prediction.room.names[wall], float(move[wall]), echo)
        for echo, move, wall in zip(later, moves, walls.tolist(), strict=True)
        if abs(move[wall]) < prediction.board.max_range
    )


def _growth(prediction: PredictedScan, index: int, rows: NDArray[np.intp]) -> FloatArray:
    """Return the derivative of path lengths by the shift of each wall towards the sensor, (rows, walls).

    `rows` are paths at heading `index`.
    """
    # these imports take half a second, which would delay the start of the window
    from sonarhw_compare.fit.free_walls import left_normals
    from sonarhw_compare.fit.likelihood import echo_paths, growth_by_wall

    room = prediction.room
    paths = echo_paths(prediction.paths.select(rows), room, [], list(room.names[: len(room.walls)]))
    position = prediction.place.position if prediction.poses is None else prediction.poses[index, :2]
    away = np.array(position) - room.walls[:, :2]
    return np.asarray(growth_by_wall(paths) * np.where((left_normals(room.walls) * away).sum(axis=1) > 0, 1.0, -1.0))


# The sentence that explains a reading: its path, a near wall within blanking, and margins.


_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")

_NO_PATH = "no path: noise, or the board's own burst"
_SLIGHT_DB = 6.0  # largest change of the threshold that is mentioned: twice or half the amplitude
_BARELY_DB = 1.0  # largest margin that is mentioned
_BARELY = 0.01  # m, largest shift of a wall that is mentioned


LengthText = Callable[[float], str]  # formats a length, m


def in_metres(length: float) -> str:
    """Return a length in metres, to the millimetre."""
    return f"{length:.3f} m"


@arguments.checked(
    comparison=arguments.instance(Comparison, "the result of `compare`"),
    index=arguments.whole(0),
    text=arguments.function,
)
def explain_reading(comparison: Comparison, index: int, text: LengthText = in_metres) -> str:
    """Return one sentence on reading `index`: range, heading, path, a near wall within blanking, and small margins.

    `text` formats the lengths. Raises InputError if there is no such reading.
    """
    if index >= len(comparison.readings):
        raise InputError(f"index: expected a reading, 0 to {len(comparison.readings) - 1}, got {index}")
    row, prediction = comparison.row(index), comparison.prediction
    where = f"at {heading_text(row.heading)}"
    measured = f"no echo {where}" if row.measured is None else f"{text(row.measured)} {where}"
    if row.kind is Kind.OWN_BODY:
        return f"{measured}: own body, an echo of the carrier of the sensor and not of the room"
    change = _slight_change(row, prediction)
    parts = [f"{measured}: {_account(row, prediction, text, nearly=change is not None)}"]
    measured_m, predicted_m = row.measured, row.predicted
    if measured_m is not None and predicted_m is not None and row.path == prediction.winners[row.index]:
        added = receiver_part(prediction, row.index, text)
        other = text(predicted_m) != text(measured_m)
        parts += [*added, f"{text(predicted_m)} is predicted"] if added and other else added
    parts += _within_blanking(prediction, row.index, row.path, text)
    if change is not None:
        parts.append(f"{_other_threshold(change)} would make the model agree")
    elif row.kind in (Kind.MATCH, Kind.BOTH_SILENT) and _is_exact(prediction):
        parts += _barely(row.index, prediction, text)
    return "; ".join(parts)


def explain_heading(prediction: PredictedScan, index: int, text: LengthText = in_metres) -> str:
    """Return one sentence on the prediction at heading `index`, without a reading. `text` formats the lengths."""
    where, winner = heading_text(float(prediction.headings[index])), int(prediction.winners[index])
    range_ = float(prediction.ranges[index])
    if math.isnan(range_):
        parts = [f"no echo is predicted at {where}"]
    else:
        by = describe_path(prediction, winner) if winner >= 0 else _NO_PATH
        parts = [f"{text(range_)} predicted at {where}: {by}", *receiver_part(prediction, index, text)]
    parts += _within_blanking(prediction, index, winner, text)
    if _is_exact(prediction):
        parts += _barely(index, prediction, text)
    return "; ".join(parts)


def receiver_part(prediction: PredictedScan, index: int, text: LengthText) -> list[str]:
    """Return what the receiver adds to half of the path that is predicted at heading `index`; [] if that is nothing."""
    range_, path = float(prediction.ranges[index]), int(prediction.winners[index])
    half = float(prediction.apparent_lengths[path]) / 2 if path >= 0 else range_
    change = receiver_change(half, range_, text)
    return [f"half of the path is {text(half)}, and the receiver of the board {change}"] if change else []


def receiver_change(half: float, range_: float, text: LengthText) -> str:
    """Return what the receiver does to half of a path, as `adds 0.030 m`; empty if both lengths (m) read the same."""
    if text(half) == text(range_):
        return ""
    return f"{'adds' if range_ > half else 'subtracts'} {text(abs(range_ - half))}"


def _within_blanking(prediction: PredictedScan, index: int, path: int | None, text: LengthText) -> list[str]:
    """Return that the nearest echo lies within blanking, if it does and is not that of `path`."""
    blanked, paths = prediction.ping(index).blanked_echoes, prediction.paths
    if not blanked or blanked[0].path == path:
        return []
    nearest = blanked[0]
    single = paths.bounces[nearest.path] == 1 and paths.edges[nearest.path] < 0
    what = "the near wall" if single else f"a nearer echo, {', '.join(paths.via(nearest.path, prediction.room))},"
    return [f"{what} ({text(nearest.range)}) lies within blanking".replace(", (", " (")]


def _is_exact(prediction: PredictedScan) -> bool:
    """Report whether margins are exact, which they are with the paper's receiver only."""
    return prediction.receiver is Receiver.FIRST_ECHO


def _slight_change(row: Matched, prediction: PredictedScan) -> float | None:
    """Return the change of the threshold, dB, with which the model agrees; None unless it is small."""
    if row.kind in (Kind.MATCH, Kind.BOTH_SILENT) or not _is_exact(prediction):
        return None
    change = change_for(prediction, row.index, row.measured)
    return change if change is not None and 0 < abs(change) <= _SLIGHT_DB else None


def _barely(index: int, prediction: PredictedScan, text: LengthText) -> list[str]:
    """Return the small changes after which another echo wins: of the threshold, or of a wall if that is smaller."""
    margins, moved, said = contest(prediction, index), wall_change(prediction, index), []
    least = math.inf if moved is None else abs(moved.nearer) / _BARELY
    winner, margin, lacking = margins.winner, margins.margin_db, margins.lacking_db
    if margin is not None and margin <= _BARELY_DB:
        then = "silence" if margins.louder is None else text(margins.louder.range)
        # another path with the same range changes nothing
        if winner is None or then != text(winner.range):
            said.append((margin, f"it is only {margin:.1f} dB over the threshold; a higher threshold gives {then}"))
    if margins.fainter is not None and lacking is not None and lacking <= _BARELY_DB:
        fainter = text(margins.fainter.range)
        said.append((lacking, f"an echo at {fainter} is only {lacking:.1f} dB below the threshold"))
    if moved is not None and least <= 1 and all(least < change / _BARELY_DB for change, _ in said):
        return [f"with {_moved(moved, text)} it would be {describe_path(prediction, moved.echo.path)}"]
    return [sentence for _, sentence in said]


def _other_threshold(change: float) -> str:
    """Return a threshold with a change, dB: `a threshold 0.7 dB lower`."""
    return f"a threshold {max(abs(change), 0.1):.1f} dB {'higher' if change > 0 else 'lower'}"


def _moved(change: WallChange, text: LengthText) -> str:
    """Return a wall with its shift: `top 0.004 m nearer`."""
    return f"{change.wall} {text(abs(change.nearer))} {'nearer' if change.nearer > 0 else 'farther'}"


def describe_path(prediction: PredictedScan, path: int) -> str:
    """Return a path in words: `three reflections, bottom, top, bottom`."""
    bounces, edge = int(prediction.paths.bounces[path]), int(prediction.paths.edges[path])
    via = ", ".join(map(_named, prediction.paths.via(path, prediction.room)))
    parts = []
    if bounces:
        count = _COUNTS[bounces] if bounces < len(_COUNTS) else str(bounces)
        parts.append(f"{count} reflection{'s' if bounces > 1 else ''}")
    if edge >= 0:
        parts.append("bent by an edge")
    return f"{' and '.join(parts)}, {via}"


def _named(touched: str) -> str:
    """Return the name of a surface or edge; `panel/` is the free end of a wall."""
    return f"the end of {touched[:-1]}" if touched.endswith("/") else touched


def _account(row: Matched, prediction: PredictedScan, text: LengthText, *, nearly: bool) -> str:
    """Return the explanation of a reading; `nearly`: the model agrees with a slightly different threshold."""
    predicted = None if row.predicted is None else f"{text(row.predicted)} by {_winner(row, prediction)}"
    match row.kind:
        case Kind.BOTH_SILENT:
            return "none is predicted either"
        case Kind.MISSED:
            return f"the model predicts {predicted}"
        case Kind.MATCH if row.path is not None:
            return describe_path(prediction, row.path)
        case _ if row.path is not None:
            return f"a later echo, {describe_path(prediction, row.path)}; the model expects the first at {predicted}"
        case Kind.EXTRA if nearly:
            return "an echo of the model is slightly below the threshold here"
        case Kind.EXTRA if prediction.room.is_outside(prediction.place.position):
            return "the model predicts no echo here; the sensor is outside the walls"
        case Kind.EXTRA:
            return "the model predicts no echo here; an object may be missing in the room file"
        case _:
            nearer = "nearer" if row.kind is Kind.SHORT else "farther"
            unaccounted = "" if nearly else "; no path of the model accounts for it"
            return f"{nearer} than the model's {predicted}{unaccounted}"


def _winner(row: Matched, prediction: PredictedScan) -> str:
    first = int(prediction.winners[row.index])
    if first < 0:
        return _NO_PATH
    parts = describe_path(prediction, first)
    return parts if prediction.paths.bounces[first] else f"sound {parts}"


# Details of a comparison for JSON: each reading with its echoes, margins and explanation, and the regions.
#
# Lengths are in metres, angles in degrees and levels in dB; missing values are None.


Details = dict[str, Any]


def details(comparison: Comparison, notes: Mapping[int, str] | None = None) -> Details:
    """Return what `compare --json --explain` adds to the summary. `notes`: by the place of their reading, from 0."""
    texts = notes or {}
    return {
        "echoes": asdict(echo_statistics(comparison)),
        "readings": [
            reading_details(comparison, index) | {"note": texts.get(index)} for index in range(len(comparison.readings))
        ],
        "regions": region_details(comparison) if comparison.prediction.poses is None else None,
    }


def _pose_figures(pose: FloatArray) -> list[float]:
    """Return x and y, m, and the heading, degrees."""
    x, y, heading = pose.tolist()
    return [round(x, 6) + 0.0, round(y, 6) + 0.0, in_degrees(heading, 6)]


def reading_details(comparison: Comparison, index: int) -> Details:
    """Return one reading: measured and predicted echoes, path, margins and the echoes that might win instead."""
    row, prediction = comparison.row(index), comparison.prediction
    margins, moved = contest(prediction, row.index), wall_change(prediction, row.index)
    own_body = row.kind is Kind.OWN_BODY
    poses = prediction.poses
    pose = {} if poses is None else dict(zip(("x_m", "y_m", "yaw_deg"), _pose_figures(poses[row.index]), strict=True))
    return pose | {
        "turntable_deg": _degrees(row.reading.angle),
        "heading_deg": in_degrees(row.heading),
        "measured_m": row.measured,
        "predicted_m": row.predicted,
        "class": row.kind.value,
        "explanation": explain_reading(comparison, index),
        "echoes": [
            {
                "measured_m": measured,
                "predicted_m": echo and echo.range,
                "level_db": echo and echo.level_db,
                "via": echo and _via(prediction, echo.path),
            }
            for measured, echo in (() if own_body else assigned_echoes(comparison, index))
        ],
        "margin_db": margins.margin_db,
        "next": _echo(prediction, margins.next),
        "next_behind_m": margins.behind,
        "wall_change": None
        if moved is None
        else {"wall": moved.wall, "nearer_m": moved.nearer, "to": _echo(prediction, moved.echo)},
        "with_higher_threshold": _echo(prediction, margins.louder),
        "with_lower_threshold": _echo(prediction, margins.fainter),
        "lacking_db": margins.lacking_db,
        "threshold_change_db": None if own_body else change_for(prediction, row.index, row.measured),
    }


def region_details(comparison: Comparison) -> Details:
    """Return the regions of constant depth of both scans, pairs first."""
    regions = compare_regions(comparison)
    return {
        "pairs": [_pair(*pair) for pair in regions.pairs],
        "parts": [_pair(*pair) for pair in regions.parts],
        "only_measured": [_region(region) for region in regions.only_measured],
        "only_predicted": [_region(region) for region in regions.only_predicted],
    }


def _pair(measured: Region, predicted: Region) -> Details:
    return {
        "measured": _region(measured),
        "predicted": _region(predicted),
        "farther_m": measured.range - predicted.range,
        "turned_deg": _degrees(math.remainder(measured.bearing - predicted.bearing, math.tau)),
        "wider_deg": _degrees(measured.width - predicted.width),
    }


def _region(region: Region) -> Details:
    return {
        "range_m": region.range,
        "bearing_deg": in_degrees(region.bearing),
        "width_deg": _degrees(region.width),
        "readings": len(region),
    }


def _echo(prediction: PredictedScan, echo: Step | Echo | None) -> Details | None:
    if echo is None:
        return None
    return {"range_m": echo.range, "level_db": echo.level_db, "via": _via(prediction, echo.path)}


def _via(prediction: PredictedScan, path: int) -> list[str]:
    return list(prediction.paths.via(path, prediction.room))


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 9)


# All echoes that might be reported at one heading, ranked by how little would have to change for each to win.
#
# The first echo after blanking and over the detection threshold wins. The others are within blanking, too weak,
# behind the winner, or both too weak and behind. Levels include the steps of the gain of the board's own receiver.


FAINTEST_DB = 20.0  # below the threshold; no arrival begins with a fainter path
_CENTIMETRES_PER_DB = 1.0  # of the ranking: sentences mention margins below 1 dB and below 1 cm


@dataclass(frozen=True)
class RankedEcho:
    """One echo: one path, or several that arrive within one wavelength."""

    path: int  # row in the prediction's paths, of the loudest
    range: float  # m, as the board would report it
    level_db: float  # at the detector
    time: float  # s, by the board's clock
    wins: bool
    blanked: bool
    lacking_db: float  # threshold minus level; 0 or less: loud enough
    behind: float | None  # m, half of its path minus that of the winner; None: it wins, is nearer, or none wins
    half: float  # m, half of the path; the receiver of the board adds the rest of the winner's range

    @property
    def too_weak(self) -> bool:
        """Whether it is below the threshold."""
        return self.lacking_db > 0


@dataclass(frozen=True)
class Remedy:
    """The changes that would each let one echo win; None: there is none of this kind."""

    threshold_db: float | None = None  # change of the threshold
    blanking: float | None = None  # s by which blanking would have to end earlier
    wall: WallChange | None = None  # smallest shift of one wall


def ranked_echoes(prediction: PredictedScan, index: int) -> tuple[RankedEcho, ...]:
    """Return every echo up to 20 dB below the threshold at heading `index`: the winner, then by rank.

    The rank is the change that an echo lacks: 1 dB of level counts as much as 1 cm of range. Echoes within blanking
    come last, that with the latest time first.
    """
    echoes = [*_merged(prediction, index, _arrivals(prediction, index))]
    winner = next((echo for echo in echoes if echo.wins), None)
    if winner is not None:
        echoes = [_behind(echo, winner) for echo in echoes]
    return tuple(sorted(echoes, key=_rank))


def runner_up(ranked: Iterable[RankedEcho]) -> RankedEcho | None:
    """Return the first of ranked echoes that does not win; None without one."""
    return next((echo for echo in ranked if not echo.wins), None)


def remedy(prediction: PredictedScan, index: int, echo: RankedEcho) -> Remedy:
    """Return the changes that would each let an echo win at heading `index`.

    A shift of a wall is correct to first order. A change of the threshold is exact for the paper's receiver. The
    board's own also detects the edges of a burst, so it differs slightly there.
    """
    if echo.wins:
        return Remedy()
    if echo.blanked:
        return Remedy(blanking=prediction.board.blanking_end - echo.time)
    if echo.behind is None:
        return Remedy(threshold_db=-echo.lacking_db if echo.too_weak else None)
    step = next((step for step in steps(prediction.ping(index)) if step.path == echo.path), None)
    threshold = None if step is None else max(0.0, step.above_db - prediction.board.threshold_db)
    moved = next((move for move in wall_changes(prediction, index) if move.echo.path == echo.path), None)
    return Remedy(threshold_db=threshold, wall=moved)


def outcome_text(echo: RankedEcho, text: LengthText = in_metres) -> str:
    """Return what becomes of an echo: `wins`, `blanked`, `0.7 dB too weak`, `0.030 m behind the winner`.

    For the winner, also what the receiver of the board adds to its range.
    """
    if echo.wins:
        change = receiver_change(echo.half, echo.range, text)
        return f"wins, receiver {change}" if change else "wins"
    if echo.blanked:
        return "blanked"
    parts = [f"{echo.lacking_db:.1f} dB too weak"] if echo.too_weak else []
    if echo.behind is not None:
        parts.append(f"{text(echo.behind)} behind{'' if echo.too_weak else ' the winner'}")
    return ", ".join(parts) or "too short for the board's receiver"


def remedy_text(changes: Remedy, text: LengthText = in_metres) -> str:
    """Return what would let an echo win: `a threshold 0.7 dB lower`; empty if nothing is known."""
    parts = []
    if changes.threshold_db is not None:
        parts.append(_other_threshold(changes.threshold_db))
    if changes.wall is not None:
        parts.append(_moved(changes.wall, text))
    if changes.blanking is not None:
        parts.append(f"blanking {max(changes.blanking * 1e3, 0.01):.2f} ms shorter")
    return " or ".join(parts)


def _arrivals(prediction: PredictedScan, index: int) -> list[Echo]:
    """Return the arrivals over the threshold and those at most `FAINTEST_DB` below it."""
    board, winner = prediction.board, int(prediction.winners[index])
    lower = replace(prediction, board=replace(board, threshold_db=board.threshold_db - FAINTEST_DB))
    ping, fainter = prediction.ping(index), lower.ping(index)
    loud = [*ping.echoes, *ping.blanked_echoes]
    faint = [*fainter.echoes, *fainter.blanked_echoes]
    arrivals: dict[tuple[int, frozenset[tuple[str, ...]]], Echo] = {}
    for echo in (*loud, *(echo for echo in faint if echo.level_db < board.threshold_db)):
        via = prediction.paths.via(echo.path, prediction.room)
        # a path and its reverse are one echo
        same = round(echo.length / _SAME_LENGTH), frozenset((via, via[::-1]))
        if same not in arrivals or echo.path == winner:
            arrivals[same] = echo
    return [*arrivals.values()]


def _merged(prediction: PredictedScan, index: int, arrivals: list[Echo]) -> Iterable[RankedEcho]:
    """Yield an echo for each arrival; that of the winner has the range that the board reports."""
    winner, one_arrival = int(prediction.winners[index]), prediction.board.wavelength(prediction.room.air)
    lengths = prediction.apparent_lengths
    won = next((echo for echo in arrivals if echo.path == winner), None)
    if won is None and winner >= 0:
        # the board reports a path of an arrival of which another path is the loudest
        near = [echo for echo in arrivals if abs(echo.length - lengths[winner]) <= one_arrival]
        won = min(near, key=lambda echo: abs(echo.length - lengths[winner]), default=None)
    for echo in arrivals:
        if echo is not won:
            yield _unranked(prediction, echo)
    if winner >= 0:
        level = won.level_db if won is not None else prediction.ping(index).level_of_reading
        reported = float(prediction.ranges[index])
        yield replace(_unranked(prediction, Echo(winner, reported, level, float(lengths[winner]))), wins=True)


def _unranked(prediction: PredictedScan, echo: Echo) -> RankedEcho:
    board, time = prediction.board, echo.length / prediction.room.air.speed_of_sound
    level = echo.level_db
    if is_stepped(board, prediction.receiver) and time > 0:
        # the prediction's levels include the ideal gain
        ideal = path_loss_db(np.array([echo.length]), board)
        level += float((stepped_gain_db(np.array([time]), board) - ideal)[0])
    lacking = board.threshold_db - level
    return RankedEcho(
        echo.path, echo.range, level, time, False, time < board.blanking_end, lacking, None, echo.length / 2
    )


def _behind(echo: RankedEcho, winner: RankedEcho) -> RankedEcho:
    if echo.wins or echo.blanked or echo.time < winner.time:
        return echo
    return replace(echo, behind=max(0.0, echo.half - winner.half))


def _rank(echo: RankedEcho) -> tuple[bool, bool, float]:
    if echo.blanked:
        return not echo.wins, True, -echo.time
    lacking = max(echo.lacking_db, 0.0) + 100 * (echo.behind or 0.0) / _CENTIMETRES_PER_DB
    return not echo.wins, False, lacking if math.isfinite(lacking) else math.inf


# Text about regions of constant depth: their counts, and the path of a predicted region.


def region_counts(regions: RegionMatch) -> str:
    """Return the counts: `7 in both, 1 more part of these, 0 only in the scan, 2 only predicted`."""
    count = len(regions.parts)
    parts = f", {counted(count, 'more part')} of these" if count else ""
    return (
        f"{len(regions.pairs)} in both{parts}, {len(regions.only_measured)} only in the scan, "
        f"{len(regions.only_predicted)} only predicted"
    )


def path_suffix(comparison: Comparison, region: Region) -> str:
    """Return the path of a predicted region, `: one reflection, top`; empty if the prediction is noise."""
    path = int(comparison.prediction.winners[region.rows[len(region) // 2]])
    return "" if path < 0 else f": {describe_path(comparison.prediction, path)}"


# The result of `sonarhw compare`.


@dataclass(frozen=True)
class ScanComparison(Comparison):
    """A comparison with the fit before it, and the options from which probabilities are predicted."""

    fit: "Fit | None" = None
    model: Model = Model.RAY_FOLLOWING
    options: PredictionOptions = field(default_factory=PredictionOptions)
    pings: int = 1  # a reading is the median of so many
    room_tolerance: float = ROOM_TOLERANCE  # m

    @property
    def doubts(self) -> tuple[str, ...]:
        """A warning if a fitted value is at the edge of its search."""
        return () if self.fit is None else self.fit.doubts

    @cached_property
    def score(self) -> ProbabilityScore:
        """How well the probabilities predict the readings. Raises InputError."""
        options, tolerance = self.options, self.room_tolerance
        return score_comparison(self, options, model=self.model, pings=self.pings, room_tolerance=tolerance)

    def lines(self, notes: Mapping[int, str] | None = None) -> Iterator[str]:
        """Yield each reading with its class, cause and note, then the summary. `notes` are by place of the reading."""
        for row in self.rows:
            yield f"{row.kind.label:11}  {explain_reading(self, row.index)}"
            if notes and row.index in notes:
                yield f"{'':11}  note: {notes[row.index]}"
        yield ""
        yield from summary_lines(self.summary())
        if self.prediction.poses is not None:
            x, y, heading = self.prediction.poses[-1].tolist()
            yield f"the last of {self.prediction.where}: {x:z.4f}, {y:z.4f} m, {pose_heading_text(heading)}"
        yield from _score_lines(self.score)
        yield from () if self.fit is None else self.fit.lines()
        yield from _echo_lines(self)
        if self.prediction.poses is None:
            yield from region_lines(self)

    def figures(self, notes: Mapping[int, str] | None = None, *, explained: bool = False) -> dict[str, Any]:
        """Return the comparison under the keys of `compare --json`; `explained` adds every reading with its echoes."""
        fitted: dict[str, Any] | None = None
        if self.fit is not None:
            fit = self.fit
            fitted = {"free": list(fit.free), "search": fit.search, "at_edge": list(fit.at_edge)}
            fitted["headings_alike_deg"] = fit.spans_deg
        readings = details(self, notes) if explained else {}
        return asdict(self.summary()) | {"fit": fitted} | readings | asdict(self.score)

    def draw(self, changed: Room | None = None) -> "Figure":
        """Return a picture of the scan over its prediction, and what only the room `changed` has as found.

        Ranges are shaded by their probability if the board has a spread, and the model finds fainter paths.
        """
        from sonarhw_compare.drawings import draw_comparison
        from sonarhw_compare.pictures import shading_around

        shading, prediction = None, self.prediction
        still = prediction.poses is None
        if still and self.model is Model.RAY_FOLLOWING and prediction.board.states_spread:
            tolerance = self.room_tolerance
            shading = shading_around(prediction, self.options, pings=self.pings, room_tolerance=tolerance)
        return draw_comparison(self, shading, changed)


def summary_lines(summary: Summary) -> list[str]:
    """Return the summary of a comparison as lines of text."""
    classes = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in summary.classes.items() if count)
    what = "reading" if summary.origin == Origin.MEASURED else f"{summary.origin} reading"
    own_body = summary.classes["own_body"]
    left_out = f" of the room and {own_body} with one of the own body" if own_body else ""
    lines = [f"{counted(summary.n, what)}, {summary.n_echo} with an echo{left_out}: {classes}"]
    if summary.within_5cm is not None and summary.explained is not None:
        lines.append(
            f"within 5 cm of the prediction: {summary.within_5cm:.1%} of the echoes; "
            f"of any predicted echo: {summary.explained:.1%}"
        )
    if summary.median_abs_error_m is not None:
        lines.append(f"median error {summary.median_abs_error_m * 1000:.1f} mm")
    if summary.no_echo_agreement is not None and summary.no_echo_roc_area is not None:
        lines.append(
            f"detection of silence: {summary.no_echo_agreement:.1%} (balanced accuracy); "
            f"area under the ROC curve of predicted levels {summary.no_echo_roc_area:.2f}"
        )
    lines.append(
        f"sensor at {summary.x_m:z.4f}, {summary.y_m:z.4f} m, turntable step 0 at {summary.heading_deg:z.1f}°, "
        f"range offset {summary.offset_m * 1000:+z.0f} mm"
    )
    return lines


def _score_lines(score: ProbabilityScore) -> list[str]:
    if score.log_score is None:
        return []
    median = f", a reading is the median of {score.pings} pings" if score.pings > 1 else ""
    return [
        f"log score {score.log_score:.2f} (mean logarithm of the probability of a reading{median})",
        f"probability of the most probable readings, stated and observed: {calibration_text(score.calibration)}",
    ]


def _echo_lines(comparison: Comparison) -> Iterator[str]:
    """Yield lines about later echoes, and about the bias of the echoes."""
    echoes = echo_statistics(comparison)
    if echoes.explained is not None and echoes.echoes > comparison.summary().n_echo:
        yield f"of all {echoes.echoes} echoes, including later ones, {echoes.explained:.1%} are predicted"
    if echoes.bias_m is not None and echoes.spread_m is not None:
        yield (
            f"scan minus predicted echo: {round(echoes.bias_m * 1000, 1) + 0.0:+.1f} mm (median; "
            f"spread {echoes.spread_m * 1000:.1f} mm)"
        )


def region_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the counts of regions of constant depth in both scans, then a line for each region, counter-clockwise."""
    regions = compare_regions(comparison)
    yield f"regions of constant depth: {region_counts(regions)}"
    for measured, predicted in regions.by_bearing():
        in_scan = "not in the scan" if measured is None else f"scan {_depth(measured)}"
        expected = "not predicted" if predicted is None else f"predicted {_depth(predicted)}"
        path = "" if predicted is None else path_suffix(comparison, predicted)
        yield f"  {in_scan}, {expected}{path}"


def _depth(region: Region) -> str:
    return f"{region.range:.3f} m at {heading_text(region.bearing, 0)} over {math.degrees(region.width):.0f}°"
