"""The sentence for a reading: what was heard, by which path, what was not heard for being too near, and how near a
thing it was.

Takes a comparison and the index of a reading; hands on one line for a person.
"""

import math
from collections.abc import Callable

from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw_compare.explain.contest import WallChange, change_for, contest, wall_change
from sonarhw_compare.headings import heading_text
from sonarhw_compare.matching.match import Comparison, Kind, Matched

_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")

_SLIGHT_DB = 6.0  # a change of the threshold worth telling: twice or half the amplitude
_BARELY_DB = 1.0  # a margin worth telling
_BARELY = 0.01  # m: a move of a wall worth telling


LengthText = Callable[[float], str]  # a length, m, as people read it


def in_metres(length: float) -> str:
    """A length in metres, to the millimetre."""
    return f"{length:.3f} m"


def explain_reading(comparison: Comparison, index: int, text: LengthText = in_metres) -> str:
    """One sentence on reading `index`: range, heading, the path that accounts for it, and the near wall if blanked.

    `text` writes its lengths.
    """
    row, prediction = comparison.rows[index], comparison.prediction
    room = prediction.room
    at = f"at {heading_text(row.heading)}"
    heard = f"no echo {at}" if row.measured is None else f"{text(row.measured)} {at}"
    change = _slight_change(row, prediction)
    parts = [f"{heard}: {_account(row, prediction, text, nearly=change is not None)}"]
    blanked = prediction.blanked_echoes(row.index)
    if blanked and blanked[0].path != row.path:
        nearest = blanked[0]
        single = prediction.paths.bounces[nearest.path] == 1 and prediction.paths.edges[nearest.path] < 0
        what = "the near wall" if single else f"a nearer echo, {', '.join(prediction.paths.via(nearest.path, room))},"
        parts.append(f"{what} ({text(nearest.range)}) lies within blanking".replace(", (", " ("))
    if change is not None:
        direction = "higher" if change > 0 else "lower"
        parts.append(f"a threshold {max(abs(change), 0.1):.1f} dB {direction} would make the model agree")
    elif row.kind in (Kind.MATCH, Kind.BOTH_SILENT) and _is_exact(prediction):
        parts += _barely(row, prediction, text)
    return "; ".join(parts)


def _is_exact(prediction: PredictedScan) -> bool:
    """Whether a threshold can be told by how much: with the paper's receiver alone, whose levels are exact."""
    return prediction.receiver is Receiver.FIRST_ECHO


def _slight_change(row: Matched, prediction: PredictedScan) -> float | None:
    """The change of the threshold, dB, that would make the model agree, where a slight one does."""
    if row.kind in (Kind.MATCH, Kind.BOTH_SILENT) or not _is_exact(prediction):
        return None
    change = change_for(prediction, row.index, row.measured)
    return change if change is not None and 0 < abs(change) <= _SLIGHT_DB else None


def _barely(row: Matched, prediction: PredictedScan, text: LengthText) -> list[str]:
    """What changes hardly worth the name would have made another win: of threshold, or of a wall where that is less."""
    found, moved, said = contest(prediction, row.index), wall_change(prediction, row.index), []
    least = math.inf if moved is None else abs(moved.nearer) / _BARELY
    if found.margin_db is not None and found.margin_db <= _BARELY_DB:
        then = "silence" if found.louder is None else text(found.louder.range)
        if found.winner is None or then != text(found.winner.range):  # another path of the same range is no news
            said.append((found.margin_db, f"it is only {found.margin_db:.1f} dB over the threshold, then comes {then}"))
    if found.fainter is not None and found.lacking_db is not None and found.lacking_db <= _BARELY_DB:
        said.append((found.lacking_db, f"an echo at {text(found.fainter.range)} lacks only {found.lacking_db:.1f} dB"))
    if moved is not None and least <= 1 and all(least < change / _BARELY_DB for change, _ in said):
        return [_overtaken(moved, prediction, text)]
    return [sentence for _, sentence in said]


def _overtaken(moved: WallChange, prediction: PredictedScan, text: LengthText) -> str:
    direction = "nearer" if moved.nearer > 0 else "farther"
    way = describe_path(prediction, moved.echo.path)
    return f"it would be {way}, were {moved.wall} {text(abs(moved.nearer))} {direction}"


def describe_path(prediction: PredictedScan, path: int) -> str:
    """A path in words: `three reflections, bottom, top, bottom`."""
    bounces, edge = int(prediction.paths.bounces[path]), int(prediction.paths.edges[path])
    via = ", ".join(map(_named, prediction.paths.via(path, prediction.room)))
    ways = []
    if bounces:
        count = _COUNTS[bounces] if bounces < len(_COUNTS) else str(bounces)
        ways.append(f"{count} reflection{'s' if bounces > 1 else ''}")
    if edge >= 0:
        ways.append("bent by an edge")
    return f"{' and '.join(ways)}, {via}"


def _named(touched: str) -> str:
    """What a path touched: `panel/`, the free end of a wall, is said in words."""
    return f"the end of {touched[:-1]}" if touched.endswith("/") else touched


def _account(row: Matched, prediction: PredictedScan, text: LengthText, *, nearly: bool) -> str:
    """What accounts for a reading; `nearly`: the model would agree with a slightly different threshold."""
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
            return "no path of the model is quite loud enough here"
        case Kind.EXTRA if prediction.room.is_outside(prediction.place.position):
            return "no path of the model is heard here; the sensor stands outside the walls"
        case Kind.EXTRA:
            return "no path of the model is heard here; something may stand in the room that the file does not know"
        case _:
            nearer = "nearer" if row.kind is Kind.SHORT else "farther"
            unaccounted = "" if nearly else "; no path of the model accounts for it"
            return f"{nearer} than the model's {predicted}{unaccounted}"


def _winner(row: Matched, prediction: PredictedScan) -> str:
    first = int(prediction.winners[row.index])
    if first < 0:
        return "no path: noise, or the board's own burst"
    ways = describe_path(prediction, first)
    return ways if prediction.paths.bounces[first] else f"sound {ways}"
