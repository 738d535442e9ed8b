"""Location of real scans without prior knowledge: `python -m benchmarks.real.real_places [FOLDER]`.

Locates each scan of the folder in the whole arena, with unknown heading, and prints the most probable of the arena's
places, its probability, and the most probable pose.
"""

import math
from collections.abc import Sequence
from statistics import median

from sonarhw_compare.locate import Located, locate_scan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from benchmarks.real.judged_scans import RealScan, load_scans, program_options
from sonarhw.errors import heading_text

OTHER_ROOMS = ("corridor", "kuc_siegel", "laboratory", "table_top")
OTHER_BOARDS = ("hc-sr04", "polaroid-56", "polaroid-6500")


def locate_real(scan: RealScan, board_name: str = "lego-nxt", room_name: str = "arena") -> Located:
    """Return the possible poses of a scan in a room, by default in the arena."""
    return locate_scan(scan.readings, load_room(f"rooms/{room_name}.toml"), load_board(board_name))


def true_place(scan: RealScan) -> str:
    """Return the name of the true place."""
    places = load_room("rooms/arena.toml").places
    return min(places, key=lambda name: math.dist(places[name].position, (scan.x, scan.y)))


def main() -> None:
    """Print a row for each scan, and the number of correct places."""
    chosen = program_options(
        __doc__,
        elsewhere="also print which share of the echoes other rooms and boards explain (some minutes)",
    )
    scans = load_scans(chosen.folder)
    print("scan  place  found   most probable pose           probability   from the place")
    correct = at_best = 0
    for scan in scans:
        located, place = locate_real(scan), true_place(scan)
        shares = located.places()
        found, best = max(shares, key=shares.__getitem__), located.poses[0]
        away = math.dist(best.position, (scan.x, scan.y))
        correct += found == place
        at_best += away < 0.1
        x, y = best.position
        print(
            f"{scan.name:5} {place:6} {found:4} {shares[found]:3.0%}  {x:.3f}, {y:.3f} m at "
            f"{heading_text(best.heading):>6} {best.probability:12.0%} {away * 100:12.0f} cm"
        )
    print(f"correct places: {correct} of {len(scans)}; best pose within 10 cm of the true position: {at_best}")
    if chosen.elsewhere:
        print_elsewhere(scans)


def print_elsewhere(scans: Sequence[RealScan]) -> None:
    """Print the share of echoes that the most probable pose explains, with the true room and board and with others."""
    print("\nroom        board          echoes within 5 cm at the best pose: least, median, most of the scans")
    others = [("arena", board) for board in OTHER_BOARDS] + [(room, "lego-nxt") for room in OTHER_ROOMS]
    for room, board in [("arena", "lego-nxt"), *others]:
        shares = [locate_real(scan, board, room).explained for scan in scans]
        print(f"{room:11} {board:14} {min(shares):5.0%} {median(shares):5.0%} {max(shares):5.0%}", flush=True)


if __name__ == "__main__":
    main()
