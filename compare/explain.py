"""The sentence for a reading: what was heard, by which path, and what was not heard for being too near.

Takes a comparison and the index of a reading; hands on one line for a person.
"""

import math

from compare.match import Comparison, Kind, Matched
from sim.predicted_scan import PredictedScan

_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def explain(comparison: Comparison, index: int) -> str:
    """One sentence on reading `index`: range, heading, the path that accounts for it, and the near wall if blanked."""
    row, prediction = comparison.rows[index], comparison.prediction
    room = prediction.room
    at = f"at {math.degrees(row.heading) % 360:.1f}°"
    heard = f"no echo {at}" if row.measured is None else f"{row.measured:.3f} m {at}"
    parts = [f"{heard}: {_account(row, prediction)}"]
    blanked = prediction.blanked_echoes(row.index)
    if blanked and blanked[0].path != row.path:
        nearest = blanked[0]
        single = prediction.paths.bounces[nearest.path] == 1 and prediction.paths.edges[nearest.path] < 0
        what = "the near wall" if single else f"a nearer echo, {', '.join(prediction.paths.via(nearest.path, room))},"
        parts.append(f"{what} ({nearest.range:.3f} m) lies within blanking".replace(", (", " ("))
    return "; ".join(parts)


def describe_path(prediction: PredictedScan, path: int) -> str:
    """A path in words: `three reflections, bottom, top, bottom`."""
    bounces, edge = int(prediction.paths.bounces[path]), int(prediction.paths.edges[path])
    via = ", ".join(prediction.paths.via(path, prediction.room))
    ways = []
    if bounces:
        count = _COUNTS[bounces] if bounces < len(_COUNTS) else str(bounces)
        ways.append(f"{count} reflection{'s' if bounces > 1 else ''}")
    if edge >= 0:
        ways.append("bent by an edge")
    return f"{' and '.join(ways)}, {via}"


def _account(row: Matched, prediction: PredictedScan) -> str:
    first = prediction.winners[row.index]
    ways = describe_path(prediction, int(first)) if first >= 0 else "no path: noise, or the board's own burst"
    predicted = None if row.predicted is None else f"{row.predicted:.3f} m by {ways}"
    match row.kind:
        case Kind.BOTH_SILENT:
            return "none is predicted either"
        case Kind.MISSED:
            return f"the model predicts {predicted}"
        case Kind.MATCH if row.path is not None:
            return describe_path(prediction, row.path)
        case _ if row.path is not None:
            return f"a later echo, {describe_path(prediction, row.path)}; the model expects the first at {predicted}"
        case Kind.EXTRA:
            return "no path of the model is heard here; something may stand in the room that the file does not know"
        case _:
            nearer = "nearer" if row.kind is Kind.SHORT else "farther"
            return f"{nearer} than the model's {predicted}; no path of the model accounts for it"
