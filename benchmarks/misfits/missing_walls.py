"""Walls that a room file lacks, found from one scan: `python -m benchmarks.misfits.missing_walls [WALLS [SCANS]]`.

Adds WALLS random walls (default 3) of 0.15 to 0.5 m, one at a time, to each of four rooms, and looks for the causes of
misfits (`compare --find-missing`) in the room without it. Walls that do not change the scan are left out: the room
without it must have at least four misfits more than the room with it. Then SCANS scans (default 3) of each unchanged
room. All scans have 120 readings with up to five echoes each, with errors of 1 cm and 1 dB and 5 % false echoes.

A wall is found if a proposed wall or post has its middle within 10 cm of it. All other proposals are false, but those
that are within 10 cm as well are counted as further pieces. The time is processor time.
"""

import math
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from sonarhw_compare.match import compare_readings
from sonarhw_compare.rooms.causes import MISFITS, Change, FoundCauses, NewPost, NewWall, find_causes
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, Room, load_room

from benchmarks.cases.random_rooms import noisy_scan
from sonarhw.errors import InputError
from sonarhw.readings import Reading

PLACES = (("arena", "p3"), ("kuc_siegel", "figure6"), ("figure3_4", "table"), ("corridor", "start"))
LENGTHS = 0.15, 0.5  # m, of added walls
CLEAR = 0.3  # m, from the place to the middle of the wall
CHANGED = 4  # misfits more without the wall than with it
NEAR = 0.1  # m, of the middle of a proposal to the wall


@dataclass
class Totals:
    """Numbers over all searches."""

    walls: int = 0
    found: int = 0
    pieces: int = 0
    false: int = 0
    scans: int = 0
    false_in_scans: int = 0
    with_false: int = 0


def main() -> None:
    """Print a line for each search, and the totals."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("walls", nargs="?", type=int, default=3, help="in each room; default: %(default)s")
    parser.add_argument("scans", nargs="?", type=int, default=3, help="of each unchanged room; default: %(default)s")
    options = parser.parse_args()
    board, totals = load_board("polaroid-6500"), Totals()
    for name, place in PLACES:
        room = load_room(name)
        add_walls(name, room, room.place(place), board, options.walls, totals)
        change_nothing(name, room, room.place(place), board, options.scans, totals)
    print(
        f"added walls found: {totals.found} of {totals.walls}, with {totals.pieces} further pieces and {totals.false} "
        f"false proposals\nunchanged rooms: {totals.false_in_scans} false proposals in {totals.with_false} of "
        f"{totals.scans} scans"
    )


def add_walls(name: str, room: Room, place: Place, board: Board, count: int, totals: Totals) -> None:
    """Print what is found of random walls in a room."""
    for number, (wall, readings) in zip(range(count), _changed_scans(room, place, board), strict=False):
        began = time.process_time()
        found = find_causes(readings, room, place, board)
        proposed = [cause.change for cause in found.causes]
        near = [change for change in proposed if _distance(change, wall) <= NEAR]
        totals.walls += 1
        totals.found += bool(near)
        totals.pieces += max(0, len(near) - 1)
        totals.false += len(proposed) - len(near)
        verdict = "found" if near else "not found"
        print(f"{name} {number}: {wall.text(lambda m: f'{m:.2f} m')}: {verdict} {_end(found, began)}", flush=True)


def change_nothing(name: str, room: Room, place: Place, board: Board, count: int, totals: Totals) -> None:
    """Print what is proposed for scans of the room as it is."""
    for number in range(count):
        began = time.process_time()
        found = find_causes(noisy_scan(room, place, board, number, all_echoes=True), room, place, board)
        totals.scans += 1
        totals.false_in_scans += len(found.causes)
        totals.with_false += bool(found.causes)
        print(f"{name}, unchanged {number}: {_end(found, began)}", flush=True)


def _changed_scans(room: Room, place: Place, board: Board) -> Iterator[tuple[NewWall, Sequence[Reading]]]:
    """Yield random walls that change the scan of a room, and the scan with each."""
    random = np.random.default_rng(17)
    ends = room.walls.reshape(-1, 2)
    for number in range(1000):
        x, y = random.uniform(ends.min(axis=0), ends.max(axis=0)).tolist()
        angle, half = random.uniform(0, math.pi), random.uniform(*LENGTHS) / 2
        dx, dy = half * math.cos(angle), half * math.sin(angle)
        wall = NewWall((x - dx, y - dy), (x + dx, y + dy))
        if math.dist((x, y), place.position) < CLEAR or any(map(room.is_outside, (wall.start, wall.end))):
            continue
        try:
            true = wall.applied(room)
        except InputError:
            continue
        readings = noisy_scan(true, place, board, number, all_echoes=True)
        misfits = [
            sum(row.kind in MISFITS for row in compare_readings(readings, one, place, board).rows)
            for one in (room, true)
        ]
        if misfits[0] >= misfits[1] + CHANGED:
            yield wall, readings


def _distance(change: Change, wall: NewWall) -> float:
    """Return the distance of the middle of a new wall or post from a wall, m; infinite for other changes."""
    if isinstance(change, NewPost):
        middle = np.array(change.center)
    elif isinstance(change, NewWall):
        middle = (np.array(change.start) + change.end) / 2
    else:
        return math.inf
    along = np.subtract(wall.end, wall.start)
    share = float(np.clip((middle - wall.start) @ along / (along @ along), 0, 1))
    return float(np.hypot(*(wall.start + share * along - middle)))


def _end(found: FoundCauses, began: float) -> str:
    proposals = "; ".join(f"{cause.text()} (+{cause.gain:.0f})" for cause in found.causes) or "nothing proposed"
    return f"[{proposals}] {time.process_time() - began:.0f} s"


if __name__ == "__main__":
    main()
