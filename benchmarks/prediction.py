"""How fast a whole scan is predicted: `python -m benchmarks.prediction`.

Takes the example rooms; prints, for each place, the time of a fast scan of 72 headings as a share of the time that the
appendix A reference takes for the same headings in the same run. Ratios travel between machines, seconds do not.
"""

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sim.board import load_board
from sim.prediction import predict_scan
from sim.reference import range_at
from sim.room import load_room

ROUNDS = 5
HEADINGS = np.radians(np.arange(0, 360, 5.0))


def seconds(work: Callable[[], object], rounds: int) -> float:
    """Median time of `rounds` runs, s."""
    taken = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def main() -> None:
    """Print a row a place."""
    board = load_board("paper")
    print(f"{'room and place':30} {'paths':>6} {'fast':>9} {'reference':>10} {'ratio':>8}")
    for file in sorted(Path("rooms").glob("*.toml")):
        room = load_room(file)
        for place in room.places.values():
            scan = predict_scan(room, place, board, HEADINGS)  # compiles, before the clock runs
            fast = seconds(lambda: predict_scan(room, place, board, HEADINGS), ROUNDS)  # noqa: B023
            slow = seconds(lambda: [range_at(room, place, board, float(h)) for h in HEADINGS], 1)  # noqa: B023
            name = f"{file.stem} {place.name}"
            print(f"{name:30} {len(scan.paths):6} {fast:8.3f}s {slow:9.2f}s {fast / slow:8.4f}")


if __name__ == "__main__":
    main()
