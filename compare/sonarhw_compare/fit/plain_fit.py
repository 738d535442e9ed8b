"""Grid search for the turntable heading, the range offset and the position at which most readings match the model."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.matching.regions import angles_and_ranges

HEADINGS = 720  # 0.5° apart
OFFSETS = np.linspace(-0.06, 0.06, 25)  # m
REACH = 0.03  # m, largest error of a measured position
STEP = 0.01  # m, between positions
PARAMETERS = ("heading", "offset", "position")
_CLOSER = 0.5  # of the mean error, below which a fit wins over one with a few more matching readings


@dataclass(frozen=True)
class Fit:
    """The result of the grid search."""

    offset: float  # m, added to every measured range
    place: Place  # fitted; its heading is the actual one of turntable step 0
    free: tuple[str, ...] = ()  # names of the fitted quantities, in the order of PARAMETERS
    moved: float = 0.0  # m from the given position

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
            "heading": f"heading in steps of {360 / HEADINGS:g}°",
            "offset": f"offset within {OFFSETS[-1] * 1000:.0f} mm in steps of {step * 1000:.0f} mm",
            "position": f"position within {REACH * 100:.0f} cm in steps of {STEP * 100:.0f} cm",
        }
        return "; ".join(grids[name] for name in self.free)

    def lines(self) -> list[str]:
        """Return lines of text: how the grid was searched, and what `sonarhw fit` adds."""
        return [
            f"fitted on a grid for the most readings within 5 cm: {self.search}",
            "`sonarhw fit` searches between these steps and farther, and adds credible intervals",
        ]

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
    return replace(best, free=tuple(name for name in PARAMETERS if name in free), moved=moved)


def all_round() -> FloatArray:
    """Return the headings in the room for the range tables of `best_agreement`, (720,) rad."""
    return np.arange(HEADINGS, dtype=np.float64) * (math.tau / HEADINGS)


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
        rows = np.round((start + board.turned(angles)) * (HEADINGS / math.tau)).astype(np.intp)
        turns = HEADINGS if "heading" in free else 1
        matching, errors = _agreement(table, rows, measured, offsets, turns, TOLERANCE)
        starts.append(start)
        places.append(place)
        counts.append(matching)
        means.append(errors)
    if not places:
        raise ValueError("no places to choose from")
    chosen, turn, offset = _chosen(np.array(counts), np.array(means), offsets, int(np.isfinite(measured).sum()))
    heading = starts[chosen] + turn * math.tau / HEADINGS
    return Fit(float(offsets[offset]), replace(places[chosen], heading=heading))


def _chosen(counts: FloatArray, means: FloatArray, offsets: FloatArray, echoes: int) -> tuple[int, int, int]:
    """Return place, turn and offset of the best fit; `counts` and `means` (m) are (places, turns, offsets).

    Most matching readings win, then the smaller mean error. A fit with less than half of that error wins instead if its
    count is the same within a standard error: a reading or two near the limit of 5 cm does not justify a wrong place.
    """
    apart = np.broadcast_to(np.abs(offsets), counts.shape).ravel()
    best = int(np.lexsort((apart, means.ravel(), -counts.ravel()))[0])
    most, mean = float(counts.flat[best]), float(means.flat[best])
    alike = max(1.0, math.sqrt(most * (1 - most / echoes)))
    closer = (counts >= most - alike) & (means < mean * _CLOSER)
    if closer.any():
        # each reading that does not match has an error of 5 cm or more
        errors = np.where(closer, counts * means + (echoes - counts) * TOLERANCE, np.inf)
        best = int(np.lexsort((apart, errors.ravel()))[0])
    place, turn, offset = np.unravel_index(best, counts.shape)
    return int(place), int(turn), int(offset)


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
