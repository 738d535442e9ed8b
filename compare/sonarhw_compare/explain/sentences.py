"""The sentence that explains a reading: its path, a near wall within blanking, and margins."""

import math
from collections.abc import Callable

from sonarhw_sim.air import Receiver
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw_compare.explain.contest import WallChange, change_for, contest, wall_change
from sonarhw_compare.headings import heading_text
from sonarhw_compare.matching.match import Comparison, Kind, Matched

_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")

_NO_PATH = "no path: noise, or the board's own burst"
_SLIGHT_DB = 6.0  # largest change of the threshold that is mentioned: twice or half the amplitude
_BARELY_DB = 1.0  # largest margin that is mentioned
_BARELY = 0.01  # m, largest shift of a wall that is mentioned


LengthText = Callable[[float], str]  # formats a length, m


def in_metres(length: float) -> str:
    """Return a length in metres, to the millimetre."""
    return f"{length:.3f} m"


def explain_reading(comparison: Comparison, index: int, text: LengthText = in_metres) -> str:
    """Return one sentence on reading `index`: range, heading, path, a near wall within blanking, and small margins.

    `text` formats the lengths.
    """
    row, prediction = comparison.rows[index], comparison.prediction
    at = f"at {heading_text(row.heading)}"
    measured = f"no echo {at}" if row.measured is None else f"{text(row.measured)} {at}"
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
        direction = "higher" if change > 0 else "lower"
        parts.append(f"a threshold {max(abs(change), 0.1):.1f} dB {direction} would make the model agree")
    elif row.kind in (Kind.MATCH, Kind.BOTH_SILENT) and _is_exact(prediction):
        parts += _barely(row.index, prediction, text)
    return "; ".join(parts)


def explain_heading(prediction: PredictedScan, index: int, text: LengthText = in_metres) -> str:
    """Return one sentence on the prediction at heading `index`, without a reading. `text` formats the lengths."""
    at, winner = heading_text(float(prediction.headings[index])), int(prediction.winners[index])
    range_ = float(prediction.ranges[index])
    if math.isnan(range_):
        parts = [f"no echo is predicted at {at}"]
    else:
        by = describe_path(prediction, winner) if winner >= 0 else _NO_PATH
        parts = [f"{text(range_)} predicted at {at}: {by}", *receiver_part(prediction, index, text)]
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
        at = text(margins.fainter.range)
        said.append((lacking, f"an echo at {at} is only {lacking:.1f} dB below the threshold"))
    if moved is not None and least <= 1 and all(least < change / _BARELY_DB for change, _ in said):
        return [_overtaken(moved, prediction, text)]
    return [sentence for _, sentence in said]


def _overtaken(moved: WallChange, prediction: PredictedScan, text: LengthText) -> str:
    direction = "nearer" if moved.nearer > 0 else "farther"
    path = describe_path(prediction, moved.echo.path)
    return f"with {moved.wall} {text(abs(moved.nearer))} {direction} it would be {path}"


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
