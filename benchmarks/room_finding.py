"""Rooms found from scans of random rooms, beside the true ones: `python -m benchmarks.room_finding [FIRST LAST]`.

Each row is a room, the last one all rooms together. Its columns:

  walls, posts  number of those of the true room, and of the found one
  seen          length of the true walls between their outermost touches by recorded echoes, m
  found         share of it that is found within 1 cm and 1°
  inv.          share of the length of the found walls that is invented: more than 5 cm from every true surface
  held          number of found walls that exist, and of those whose 95 % intervals hold the true offset, and the true
                direction
  time          wall time of the search, and processor time on all cores, s

`found` and `inv.` are those of the room search and of two baselines, a map without a room file: its walls, from regions
of constant depth (arcs), and its certainty grid, of which cells are counted in place of lengths.

All poses are exact by default. With other ones, each row ends with the errors of the poses found. With --leave-out,
each row states which share of the last scan the found and the true room predict within 5 cm.
"""

import os
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from sonarhw_compare.map import map_scans
from sonarhw_compare.match import compare_readings
from sonarhw_compare.rooms.search import FoundRoom, find_room, find_room_and_poses
from sonarhw_sim.board.profile import Board, load_board

from benchmarks.cases.random_rooms import RandomRoom, random_room
from benchmarks.cases.room_measures import Lengths, lengths_found, lengths_in_grid, seen_parts, truth_held
from benchmarks.cases.uncertain_poses import POSES, exact_poses, pose_text

ROOMS = 30
KNOWN = {
    "--rough": "poses but the first are known within 5 cm and 3° (standard deviations)",
    "--headings": "headings but the first are known within 3°, and no position but the first",
    "--positions": "positions but the first are known within 5 cm, and no heading but the first",
    "--unknown": "no pose but the first is known",
}
HEADER = """\
        true             found                room search    by arcs      by the grid        held       time
room  walls posts scans  walls posts   seen   found   inv.  found   inv.  found   inv.  of  off turn  wall  cores"""


def main() -> None:
    """Print a row for each room, and the totals."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("first", nargs="?", type=int, default=0, help="number of the first room; default: %(default)s")
    parser.add_argument(
        "last", nargs="?", type=int, default=ROOMS, help="number after that of the last room; default: %(default)s"
    )
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--leave-out", action="store_true", help="find each room without its last scan, and predict it")
    for option, known in KNOWN.items():
        kinds.add_argument(option, dest="poses", action="store_const", const=option, help=known)
    parser.add_argument(
        "--all-echoes", action="store_true", help="scans with up to five echoes a reading, in place of the first one"
    )
    options = parser.parse_args()
    board = load_board("polaroid-6500")
    cases = (random_room(seed, board, all_echoes=options.all_echoes) for seed in range(options.first, options.last))
    if options.leave_out:
        leave_out(cases, board)
    else:
        find_rooms(cases, board, options.poses)


def leave_out(cases: Iterable[RandomRoom], board: Board) -> None:
    """Print how well rooms found without their last scan predict it, and how well the true rooms do."""
    print("room  echoes  within 5 cm of the prediction of the found room, of the true room")
    totals = np.zeros(3)
    for case in cases:
        found, last = find_room(case.scans[:-1], board, case.room.air), case.scans[-1]
        rooms = found.draft.room(case.room.air), case.room
        figures = [compare_readings(last.readings, room, last.place, board).summary() for room in rooms]
        counts = [figures[0].n_echo, *(figure.matched for figure in figures)]
        totals += counts
        print(f"{case.seed:4} {counts[0]:7} {counts[1] / counts[0]:6.1%} {counts[2] / counts[0]:6.1%}", flush=True)
    print(f"all  {totals[0]:7.0f} {totals[1] / totals[0]:6.1%} {totals[2] / totals[0]:6.1%}")


@dataclass(frozen=True)
class Search:
    """A room found from the scans of a random room, and how well it agrees with that."""

    case: RandomRoom
    found: FoundRoom
    lengths: tuple[Lengths, Lengths, Lengths]  # of the room search, of walls by arcs, and of the certainty grid
    held: list[tuple[bool, bool]]  # of found walls: whether the intervals hold the true offset, and the true direction
    wall_time: float  # s
    processor_time: float  # s, on all cores


def find_rooms(cases: Iterable[RandomRoom], board: Board, option: str | None) -> None:
    """Print what is found of each room; `option` is one of POSES, without which all poses are exact."""
    print(HEADER)
    searches = []
    for case in cases:
        searches.append(searched(case, board, option))
        poses = f"; {pose_text(searches[-1].case, searches[-1].found)}" if option else ""
        print(f"{case.seed:4} {_row(searches[-1])}{poses}", flush=True)
    totals = [sum(of_rooms, Lengths(0, 0, 0, 0)) for of_rooms in zip(*(one.lengths for one in searches), strict=True)]
    held = [wall for search in searches for wall in search.held]
    print(f"all {' ' * 38} {_agreement(totals, held)}")


def searched(case: RandomRoom, board: Board, option: str | None) -> Search:
    """Return the room found from the scans of a random room."""
    scans, spreads = (POSES[option] if option else exact_poses)(case, case.seed)
    began, used = time.perf_counter(), _processor_time()
    found = find_room_and_poses(scans, board, case.room.air, spreads)
    took, used = time.perf_counter() - began, _processor_time() - used
    parts, baseline = seen_parts(case, board), map_scans(case.scans, board).direct
    by_arcs = np.array([(*wall.start, *wall.end) for wall in baseline.features.walls]).reshape(-1, 4)
    lengths = (
        lengths_found(case, parts, found.draft.segments),
        lengths_found(case, parts, by_arcs),
        lengths_in_grid(case, parts, baseline.grid),
    )
    return Search(case, found, lengths, truth_held(case, found), took, used)


def _processor_time() -> float:
    """Return the processor time of this process and of its processes that have ended, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _row(one: Search) -> str:
    room, draft = one.case.room, one.found.draft
    return (
        f"{len(room.walls):6} {len(room.posts):5} {len(one.case.scans):5} {len(draft.walls):6} {len(draft.posts):5} "
        f"{one.lengths[0].seen:6.2f} {_agreement(one.lengths, one.held)} {one.wall_time:5.0f} {one.processor_time:6.0f}"
    )


def _agreement(lengths: Sequence[Lengths], held: Sequence[tuple[bool, bool]]) -> str:
    of_offset, of_turn = (sum(wall[part] for wall in held) for part in (0, 1))
    return f"{' '.join(one.shares for one in lengths)} {len(held):3} {of_offset:4} {of_turn:4}"


if __name__ == "__main__":
    main()
