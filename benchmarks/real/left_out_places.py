"""Real scans predicted by rooms found without them: `python -m benchmarks.real.left_out_places [FOLDER]`.

For each place of the folder, the room is found from the scans of all other places, at their written positions, as by
`benchmarks.real.mapped_arena`. Then each scan of the place is located, within 3 cm and 2° of its written pose, in the
found room and in the measured one. Printed is the share of its echoes within 5 cm of the prediction of each room.
"""

from collections.abc import Sequence

import numpy as np
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import locate_scan
from sonarhw_compare.rooms.search import find_room
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Room

from benchmarks.real.judged_scans import ROOM, load_scans, program_options
from benchmarks.real.mapped_arena import MARKS, at_mark, nearest_pose

BOARD = load_board("lego-nxt")


def main() -> None:
    """Print a row for each scan, and the shares of all echoes."""
    scans = load_scans(program_options(__doc__).folder)
    marked = [at_mark(scan, nearest_pose(scan).heading) for scan in scans]
    print("scan  echoes  within 5 cm of the prediction of the found room, of the measured room")
    totals = np.zeros(3)
    for position in dict.fromkeys(scan.place.position for scan in marked):
        others = [scan for scan in marked if scan.place.position != position]
        found = find_room(others, BOARD, ROOM.air, [MARKS] * len(others)).draft.room(ROOM.air)
        for scan in marked:
            if scan.place.position == position:
                echoes = sum(reading.range is not None for reading in scan.readings)
                shares = [explained(scan, room) for room in (found, ROOM)]
                totals += [echoes, *(share * echoes for share in shares)]
                print(row(scan.title, echoes, shares), flush=True)
    print(row("all", totals[0], totals[1:] / totals[0]) + f"   ratio {totals[1] / totals[2]:.2f}")


def explained(scan: PlacedScan, room: Room) -> float:
    """Return the share of the echoes of a scan within 5 cm of the prediction in a room, at the most probable pose."""
    return locate_scan(scan.readings, room, BOARD, expected=scan.place, spread=MARKS).explained


def row(title: str, echoes: float, shares: Sequence[float]) -> str:
    """Return a line of the table."""
    return f"{title:5} {echoes:6.0f} {shares[0]:12.1%} {shares[1]:6.1%}"


if __name__ == "__main__":
    main()
