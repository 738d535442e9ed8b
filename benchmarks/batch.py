"""What `predict_ranges` and `log_likelihood` cost for each pose, beside single predictions, in alternating runs.

    python -m benchmarks.batch [--poses 100] [--rounds 3] [--many 20000]

Prints processor time for each pose of single predictions by all paths (`predict_scan`), of those that search paths only
as far as readings need them (`predict`), and of one call for all poses; the ratio of the first to the last, how many
readings differ by more than 1 mm, and how many cores worked, by the clock. Then the same readings by the paper's
algorithm (appendix A), compiled, and what a table of each room needs and gives. The last line is the memory that many
poses need. `python -m benchmarks.speed` compares paths with those of pyroomacoustics.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sonarhw_compare.free_space import find_free_space
from sonarhw_compare.track import PoseLikelihood
from sonarhw_sim import compiled
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan

import sonarhw
from benchmarks.logs import memory
from sonarhw.readings import FloatArray
from tests.oracles.one_heading import range_at

SETTINGS = (
    ("arena", "hc-sr04"),
    ("laboratory", "hc-sr04"),
    ("arena", "polaroid-6500"),
    ("laboratory", "polaroid-6500"),
)
HEADINGS = np.arange(16) * np.radians(22.5)


@dataclass(frozen=True)
class Cost:
    """Processor time and time by the clock of a call, s."""

    processor: float
    clock: float


def cost_of(call: Callable[[], object]) -> Cost:
    """Return the cost of one call."""
    processor, clock = time.process_time(), time.perf_counter()
    call()
    return Cost(time.process_time() - processor, time.perf_counter() - clock)


def one_by_one(
    room: sonarhw.Room, board: sonarhw.Board, poses: FloatArray, predict: Callable[..., PredictedScan] = predict_scan
) -> FloatArray:
    """Return the ranges of single predictions."""
    places = [sonarhw.Place("", (x, y)) for x, y, _ in poses.tolist()]
    scans = (predict(room, place, board, pose[2] + HEADINGS) for place, pose in zip(places, poses, strict=True))
    return np.array([scan.ranges for scan in scans])


def measure(name: str, board_name: str, count: int, rounds: int) -> str:
    """Return a line of the table."""
    room, board = sonarhw.load_room(name), sonarhw.load_board(board_name)
    random, space = np.random.default_rng(1), find_free_space(room)
    poses = np.array([(*space.draw(random, 0.1), random.uniform(0, 2 * np.pi)) for _ in range(count)])
    expected = one_by_one(room, board, poses)
    many = np.asarray(sonarhw.predict_ranges(room, poses, HEADINGS, board))
    other = (np.isnan(expected) != np.isnan(many)) | (np.abs(expected - many) > 0.001)
    near = poses[0] + random.normal(size=(1000, 3)) * (0.1, 0.1, 0.1)
    likelihood = PoseLikelihood(room, board)
    likelihood(near, HEADINGS, expected[0])  # searches the paths of the cells
    alone, settled, together, weighed = [], [], [], []
    for _ in range(rounds):
        alone.append(cost_of(lambda: one_by_one(room, board, poses)))
        settled.append(cost_of(lambda: one_by_one(room, board, poses, sonarhw.predict)))
        together.append(cost_of(lambda: sonarhw.predict_ranges(room, poses, HEADINGS, board)))
        weighed.append(cost_of(lambda: likelihood(near, HEADINGS, expected[0])))
    before, single, after = (
        min(cost.processor for cost in costs) / count * 1e3 for costs in (alone, settled, together)
    )
    in_cells = min(cost.processor for cost in weighed)
    threads = min(cost.processor for cost in together) / min(cost.clock for cost in together)
    return (
        f"{name:10} {board_name:13}  {before:6.2f} ms   {single:6.2f} ms  {after:6.2f} ms  {before / after:4.1f}"
        f"  {other.mean():7.2%}  {threads:5.2f}  {in_cells:.3f} ms"
    )


def by_the_paper(name: str, board_name: str) -> str:
    """Return a line about the paper's algorithm, which follows the rays of each heading by themselves."""
    room, board = sonarhw.load_room(name), sonarhw.load_board(board_name)
    random, space = np.random.default_rng(1), find_free_space(room)
    places = [sonarhw.Place("", space.draw(random, 0.1)) for _ in range(10)]
    range_at(room, places[0], board, 0.0)  # loads or compiles the kernels
    cost = cost_of(lambda: [range_at(room, place, board, heading) for place in places for heading in HEADINGS.tolist()])
    return f"{name:10} {board_name:13}  {cost.processor / len(places) * 1e3:6.2f} ms"


def table_of(name: str, board_name: str) -> str:
    """Return a line about the table of a room: its cost, and the readings that are looked up in a second of a core."""
    room, board = sonarhw.load_room(name), sonarhw.load_board(board_name)
    tables = [sonarhw.range_table(room, board, spacing=0.2)]  # loads or compiles the kernels
    made = cost_of(lambda: tables.append(sonarhw.range_table(room, board)))
    table = tables[-1]
    random, space = np.random.default_rng(3), find_free_space(room)
    poses = np.array([(*space.draw(random), random.uniform(0, 2 * np.pi)) for _ in range(1000)])
    looked_up = cost_of(lambda: table.ranges(np.tile(poses, (30, 1)), HEADINGS))
    size = (table.distances.nbytes + table.slopes.nbytes) / 1e6
    readings = 30_000 * len(HEADINGS) / looked_up.processor / 1e6
    return (
        f"{name:10} {board_name:13}  {made.processor:6.1f} s  {size:5.1f} MB  {readings:5.1f} million/s"
        f"  {table.within_5mm:6.1%}"
    )


def memory_of(count: int) -> str:
    """Return how much more memory so many poses in the arena need than 100, beside that of their ranges."""
    room, board = sonarhw.load_room("arena"), sonarhw.load_board("hc-sr04")
    random, space = np.random.default_rng(2), find_free_space(room)
    poses = np.array([(*space.draw(random, 0.1), random.uniform(0, 2 * np.pi)) for _ in range(100)])
    sonarhw.predict_ranges(room, poses, HEADINGS, board)
    before = memory()
    cost = cost_of(lambda: sonarhw.predict_ranges(room, np.resize(poses, (count, 3)), HEADINGS, board))
    more, ranges = memory() - before, count * len(HEADINGS) * 8 / 1e6
    return f"{count} poses: {cost.clock:.0f} s, {more:.0f} MB more, of which {ranges:.1f} MB are their ranges"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--many", type=int, default=20_000)
    given = parser.parse_args()
    print(f"{given.poses} poses, {len(HEADINGS)} headings, {compiled.core_count()} cores; processor time for each pose")
    print(
        "room       board          all paths   predict    predict_ranges  ratio  other  cores  log-likelihood in cells"
    )
    for setting in SETTINGS:
        print(measure(*setting, given.poses, given.rounds), flush=True)
    print("paper's algorithm")
    for setting in SETTINGS[:2]:
        print(by_the_paper(*setting), flush=True)
    print("table of the room         made in  size      looked up        within 5 mm")
    for setting in SETTINGS[:3]:
        print(table_of(*setting), flush=True)
    print(memory_of(given.many))


if __name__ == "__main__":
    main()
