"""All echoes that might be reported at one heading, ranked by how little would have to change for each to win.

The first echo after blanking and over the detection threshold wins. The others are within blanking, too weak, behind
the winner, or both too weak and behind. Levels include the steps of the gain of the board's own receiver.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.board.signal import is_stepped, path_loss_db, stepped_gain_db
from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan

from sonarhw_compare.explain.contest import WallChange, steps, wall_changes
from sonarhw_compare.explain.sentences import LengthText, in_metres, receiver_change

FAINTEST_DB = 20.0  # below the threshold; no arrival begins with a fainter path
_SAME_LENGTH = 1e-6  # m
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
    found = [*_merged(prediction, index, _arrivals(prediction, index))]
    winner = next((echo for echo in found if echo.wins), None)
    if winner is not None:
        found = [_behind(echo, winner) for echo in found]
    return tuple(sorted(found, key=_rank))


def runner_up(found: Iterable[RankedEcho]) -> RankedEcho | None:
    """Return the first of ranked echoes that does not win; None without one."""
    return next((echo for echo in found if not echo.wins), None)


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


def remedy_text(found: Remedy, text: LengthText = in_metres) -> str:
    """Return what would let an echo win: `a threshold 0.7 dB lower`; empty if nothing is known."""
    parts = []
    if found.threshold_db is not None:
        direction = "higher" if found.threshold_db > 0 else "lower"
        parts.append(f"a threshold {max(abs(found.threshold_db), 0.1):.1f} dB {direction}")
    if found.wall is not None:
        direction = "nearer" if found.wall.nearer > 0 else "farther"
        parts.append(f"{found.wall.wall} {text(abs(found.wall.nearer))} {direction}")
    if found.blanking is not None:
        parts.append(f"blanking {max(found.blanking * 1e3, 0.01):.2f} ms shorter")
    return " or ".join(parts)


def _arrivals(prediction: PredictedScan, index: int) -> list[Echo]:
    """Return the arrivals over the threshold and those at most `FAINTEST_DB` below it."""
    board, winner = prediction.board, int(prediction.winners[index])
    lower = replace(prediction, board=replace(board, threshold_db=board.threshold_db - FAINTEST_DB))
    ping, fainter = prediction.ping(index), lower.ping(index)
    loud = [*ping.echoes, *ping.blanked_echoes]
    faint = [*fainter.echoes, *fainter.blanked_echoes]
    found: dict[tuple[int, frozenset[tuple[str, ...]]], Echo] = {}
    for echo in (*loud, *(echo for echo in faint if echo.level_db < board.threshold_db)):
        via = prediction.paths.via(echo.path, prediction.room)
        # a path and its reverse are one echo
        same = round(echo.length / _SAME_LENGTH), frozenset((via, via[::-1]))
        if same not in found or echo.path == winner:
            found[same] = echo
    return [*found.values()]


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
