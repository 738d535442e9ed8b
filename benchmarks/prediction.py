"""The fast prediction compared with the appendix A reference: `python -m benchmarks.prediction`.

For each place of the example rooms, prints the time of a fast scan of 72 headings as a ratio to the time of the
reference in the same run, and every heading at which both differ by more than 5 mm. Reasons for such differences are in
docs/explanation/model.md.
"""

import math
import time
from pathlib import Path

import numpy as np
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import Place, Room, load_room

from benchmarks.traces import seconds
from tests.oracles.reference import range_at

ROUNDS = 5
HEADINGS = np.radians(np.arange(0, 360, 5.0))
QUARTER = math.radians(0.25)
FINE = math.radians(1 / 32)  # a post spreads neighbouring rays, so a quarter of a degree is too coarse


def differing(scan: PredictedScan, reference: list[float | None]) -> list[str]:
    """Return the headings at which both differ by more than 5 mm, with both ranges."""
    return [
        f"{math.degrees(heading):.0f}°: {fast:.3f} m, reference {'no echo' if slow is None else f'{slow:.3f} m'}"
        for heading, fast, slow in zip(scan.headings, scan.ranges, reference, strict=True)
        if math.isnan(fast) != (slow is None) or (slow is not None and abs(slow - fast) > 0.005)
    ]


def compare_place(room: Room, place: Place, board: Board) -> tuple[str, int]:
    """Return the lines of one place and its differing headings, and their number."""
    spacing = FINE if len(room.posts) else QUARTER
    scan = predict_scan(room, place, board, HEADINGS)  # compiles before the measurement
    fast = seconds(lambda: predict_scan(room, place, board, HEADINGS), ROUNDS)
    began = time.perf_counter()
    reference = [range_at(room, place, board, float(heading), spacing=spacing) for heading in HEADINGS]
    slow = time.perf_counter() - began
    lines = differing(scan, reference)
    numbers = f"{len(scan.paths):6} {fast:8.3f}s {slow:9.2f}s {fast / slow:8.4f} {len(lines):4} of {len(HEADINGS)}"
    return "\n    ".join([f"{room.name + ', ' + place.name:32}{numbers}", *lines]), len(lines)


def main() -> None:
    """Print a row for each place, and the number of all differences."""
    board = load_board("paper")
    print(f"{'room, place':32}{'paths':>6} {'fast':>9} {'reference':>10} {'ratio':>8} {'differ':>10}")
    counts = []
    for file in sorted(Path("rooms").glob("*.toml")):
        room = load_room(file)
        for place in room.places.values():
            line, count = compare_place(room, place, board)
            print(line, flush=True)
            counts.append(count)
    headings = len(counts) * len(HEADINGS)
    print(f"{sum(counts)} of {headings} headings differ: {sum(counts) / headings:.1%}")


if __name__ == "__main__":
    main()
