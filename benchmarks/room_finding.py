"""Rooms found from scans of random rooms, beside the true ones: `python -m benchmarks.room_finding [FIRST LAST]`.

With `--leave-out` before them, each room is found without its last scan, and the found and the true room predict it.
With `--rough`, all places but the first are known within 5 cm and 3° (standard deviations); with `--headings`, only
their headings are, with `--positions`, only their positions, and with `--unknown`, nothing. Each row then ends with the
errors of the places found.

Beside them are the walls of a map without a room file, from regions of constant depth, and the certainty grid. `held`:
the number of found walls, and of those whose 95 % intervals hold the true offset, and the true direction. `s`: the
wall time of a search, and the processor time on all cores.
"""

import os
import time
from argparse import ArgumentParser

import numpy as np
from sonarhw_compare.map import map_scans
from sonarhw_compare.matching.match import compare_readings
from sonarhw_compare.room_finding.evidence import REFLECTANCE
from sonarhw_compare.room_finding.room_search import find_room
from sonarhw_compare.room_finding.unknown_poses import find_room_and_poses
from sonarhw_sim.board.profile import Board, load_board

from benchmarks.cases.random_rooms import random_room
from benchmarks.cases.room_measures import Lengths, lengths_found, lengths_in_grid, seen_parts, truth_held
from benchmarks.cases.uncertain_poses import POSES, exact_poses, pose_text

ROOMS = 30


def main() -> None:
    """Print a row for each room, and the totals."""
    parser = ArgumentParser(description="Find random rooms from scans of them, and compare them with the true ones.")
    parser.add_argument("first", nargs="?", type=int, default=0, help="number of the first room; default: %(default)s")
    parser.add_argument(
        "last", nargs="?", type=int, default=ROOMS, help="the number after the last; default: %(default)s"
    )
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--leave-out", action="store_true", help="find each room without its last scan, and predict it")
    for option, known in (
        ("--rough", "within 5 cm and 3°"),
        ("--headings", "within 3°, without positions"),
        ("--positions", "within 5 cm, without headings"),
        ("--unknown", "for the first scan only"),
    ):
        kinds.add_argument(option, dest="poses", action="store_const", const=option, help=f"places are known {known}")
    options = parser.parse_args()
    seeds, board = range(options.first, options.last), load_board("polaroid-6500")
    if options.leave_out:
        leave_out(seeds, board)
    else:
        find_rooms(seeds, board, options.poses)


def leave_out(seeds: range, board: Board) -> None:
    """Print how well rooms found without their last scan predict it, and how well the true rooms do."""
    print("room  echoes  within 5 cm of the prediction of the found room, of the true room")
    totals = np.zeros(3)
    for seed in seeds:
        case = random_room(seed, board)
        found, last = find_room(case.scans[:-1], board, case.room.air), case.scans[-1]
        rooms = found.draft.room(REFLECTANCE, case.room.air), case.room
        figures = [compare_readings(last.readings, room, last.place, board).summary() for room in rooms]
        counts = [figures[0].n_echo, *(figure.matched for figure in figures)]
        totals += counts
        print(f"{seed:4} {counts[0]:7} {counts[1] / counts[0]:6.1%} {counts[2] / counts[0]:6.1%}", flush=True)
    print(f"all  {totals[0]:7.0f} {totals[1] / totals[0]:6.1%} {totals[2] / totals[0]:6.1%}")


def find_rooms(seeds: range, board: Board, option: str | None = None) -> None:
    """Print what is found of each room; `option` is one of POSES, without which all poses are exact."""
    print("found and invented:                          room search   by arcs       grid          held        s")
    print(
        "room  walls posts scans  walls posts  seen m  found  inv.   found  inv.   found  inv.  of    off turn   cores"
    )
    totals, held_of_all = [Lengths(0, 0, 0, 0)] * 3, []
    for seed in seeds:
        case = random_room(seed, board)
        scans, spreads = (POSES[option] if option else exact_poses)(case, seed)
        began, used = time.perf_counter(), _processor_time()
        placed = find_room_and_poses(scans, board, case.room.air, spreads)
        took, used, found = time.perf_counter() - began, _processor_time() - used, placed.found
        by_arcs = map_scans(case.scans, board).direct
        arcs = np.array([(*wall.start, *wall.end) for wall in by_arcs.features.walls]).reshape(-1, 4)
        parts = seen_parts(case, board)
        lengths = [
            lengths_found(case, parts, found.draft.segments),
            lengths_found(case, parts, arcs),
            lengths_in_grid(case, parts, by_arcs.grid),
        ]
        totals = [one + other for one, other in zip(totals, lengths, strict=True)]
        held = truth_held(case, found)
        held_of_all += held
        print(
            f"{seed:4} {len(case.room.walls):6} {len(case.room.posts):5} {len(case.scans):5} "
            f"{len(found.draft.walls):6} {len(found.draft.posts):5} {lengths[0].seen:7.2f} "
            f"{' '.join(one.shares for one in lengths)} {_held(held)} {took:3.0f} {used:5.0f}"
            f"{'; ' + pose_text(case, placed) if option else ''}",
            flush=True,
        )
    print(f"all {' ' * 38} {' '.join(one.shares for one in totals)} {_held(held_of_all)}")


def _processor_time() -> float:
    """Return the processor time of this process and of its processes that have ended, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _held(held: list[tuple[bool, bool]]) -> str:
    return f"{len(held):3} {sum(offset for offset, _ in held):6} {sum(turn for _, turn in held):4}"


if __name__ == "__main__":
    main()
