"""The places and headings from which another scan makes a found room most certain.

The gain of a place is the expected decrease of the entropy of walls and posts, ½ ln det(I + D J Jᵀ D / σ²) in nats: D
has their present standard deviations, J the derivative of each predicted range by them (Cover and Thomas, Elements of
Information Theory, 2006, section 8.4, for normal distributions). Correlations of the present errors, echoes that appear
or disappear, and surfaces that no scan has touched are left out.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray
from sonarhw_compare.free_space import find_free_space
from sonarhw_compare.room_finding.evidence import FOLLOWED, REFLECTANCE
from sonarhw_compare.room_finding.refining.range_errors import RANGE, LengthSlopes
from sonarhw_compare.room_finding.room_search import FoundRoom

_PLACES = 60  # that are tried, about
_CLEARANCE = 0.15  # m, of a place from walls and posts
_HEADINGS, _SECTORS = 72, 12  # of a scan
_LARGEST = 0.1  # m or rad, standard deviation of a wall or end; a larger one is not linear, and counts as this one
_MOST_OF_GAIN = 0.6  # share of the sum over headings that the reported sectors have


@dataclass(frozen=True)
class NextPlace:
    """A place for the next scan."""

    position: tuple[float, float]  # m
    gain: float  # nats
    sectors: tuple[tuple[float, float], ...]  # rad, first and last heading of each run of 30° sectors


def next_places(
    found: FoundRoom,
    room: Room,
    board: Board,
    count: int = 3,
    tick: Callable[[float], None] = lambda _share: None,
    best: Callable[[tuple[NextPlace, ...]], None] = lambda _places: None,
) -> tuple[NextPlace, ...]:
    """Return the `count` best places, best first, each farther than 0.3 m from the better ones.

    `room` is the found room with its places. `tick` receives the completed share, 0..1, and `best` the best places so
    far whenever they change; places all over the room come first.
    """
    moves = [move for move in found.deviations if move.what in ("wall", "post") and found.deviations[move] > 0]
    draft_room, by_move = found.draft.room(REFLECTANCE, room.air), LengthSlopes(found.draft, moves)
    spreads = np.minimum([found.deviations[move] for move in moves], _LARGEST)
    tried: list[NextPlace] = []
    known: tuple[NextPlace, ...] = ()
    places = _spread_first(_candidates(room))
    for row, place in enumerate(places):
        tick(row / len(places))
        tried.append(_weighed(place, _slopes(place, draft_room, by_move, board) * spreads[:, None]))
        known, before = _apart(sorted(tried, key=lambda one: -one.gain), count), known
        if known != before:
            best(known)
    return known


def _candidates(room: Room) -> FloatArray:
    """Return free positions on a lattice, (n, 2) m."""
    free = find_free_space(room)
    area = len(free.middles) * free.spacing**2
    middles = find_free_space(room, math.sqrt(area / _PLACES)).middles
    return np.array([point for point in middles if free.holds(point, _CLEARANCE)]).reshape(-1, 2)


def _spread_first(positions: FloatArray) -> list[tuple[float, float]]:
    """Return positions (n, 2) in another order: each is as far as possible from those before it."""
    order: list[tuple[float, float]] = []
    away = np.full(len(positions), np.inf)
    for _ in range(len(positions)):
        x, y = positions[int(np.argmax(away))].tolist()
        order.append((x, y))
        away = np.minimum(away, np.hypot(positions[:, 0] - x, positions[:, 1] - y))
    return order


def _slopes(position: tuple[float, float], room: Room, by_move: LengthSlopes, board: Board) -> FloatArray:
    """Return the derivative of each predicted range by each move, in standard deviations of a range, (m, n)."""
    headings = np.arange(_HEADINGS, dtype=np.float64) * (math.tau / _HEADINGS)
    scan = predict_scan(room, Place("", position), board, headings, FOLLOWED)
    slopes = np.zeros((by_move.count, _HEADINGS))  # 0 where there is no echo
    for path in np.unique(scan.winners[scan.winners >= 0]).tolist():
        slopes[:, scan.winners == path] = by_move.of(scan.paths.outline(path))[:, None] / (2 * RANGE)
    return slopes


def _weighed(position: tuple[float, float], scaled: FloatArray) -> NextPlace:
    """Return a place with the gain of its scan; `scaled` (m, n): slopes times standard deviations of the moves."""
    gain = float(np.linalg.slogdet(np.eye(len(scaled)) + scaled @ scaled.T)[1]) / 2
    by_sector = np.log1p((scaled**2).sum(axis=0)).reshape(_SECTORS, -1).sum(axis=1)
    order = np.argsort(-by_sector, kind="stable")
    enough = int(np.searchsorted(np.cumsum(by_sector[order]), _MOST_OF_GAIN * by_sector.sum())) + 1
    return NextPlace(position, gain, _runs(np.sort(order[:enough])) if gain > 0 else ())


def _runs(sectors: NDArray[np.intp]) -> tuple[tuple[float, float], ...]:
    """Return begin and end, rad, of each run of neighbouring sectors; a run may pass 0."""
    runs = np.split(sectors, np.flatnonzero(np.diff(sectors) > 1) + 1)
    ends = [(int(run[0]), int(run[-1]) + 1) for run in runs]
    if len(ends) > 1 and ends[0][0] == 0 and ends[-1][1] == _SECTORS:
        ends = [*ends[1:-1], (ends[-1][0], ends[0][1] + _SECTORS)]
    return tuple((first * math.tau / _SECTORS, last * math.tau / _SECTORS) for first, last in ends)


def _apart(places: Sequence[NextPlace], count: int) -> tuple[NextPlace, ...]:
    kept: list[NextPlace] = []
    for place in places:
        if len(kept) < count and all(math.dist(place.position, other.position) > 0.3 for other in kept):
            kept.append(place)
    return tuple(kept)
