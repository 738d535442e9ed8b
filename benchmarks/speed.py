"""Speed of predictions, as ratios in one run: `python -m benchmarks.speed`.

Prints one table with required and measured values, the machine and the versions, for floors of offices of 64 to 10
000 walls and rooms of 20. Times are processor times of all cores together, which other programs hardly change. The
whole scan is compared with single headings in wall time, too, and has its requirement there, because a user waits in
wall time: a scan uses all cores, a single heading one. That row needs at least two cores without other work. The
image-source model of pyroomacoustics takes a minute. Without that library (`pip install .[benchmarks]`), its rows are
omitted.
"""

import importlib.metadata
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.board.signal import received
from sonarhw_sim.compiled import core_count
from sonarhw_sim.predict.prediction import paths_for, predict_scan, weigh_paths
from sonarhw_sim.room.room import Room, load_room

from benchmarks.cases.hundred_echoes import LISTEN, RATE, SPEED, hundred_echoes
from benchmarks.cases.image_source_table import compare_with_image_sources
from benchmarks.cases.office import PLACE, office_floor
from benchmarks.cases.office_scan import BOARD, HEADINGS, OPTIONS, scan
from benchmarks.cases.table_rows import Row, at_least, at_most, without_limit
from tests.oracles.one_heading import range_at

VERSIONS = ("numpy", "numba", "scipy", "pyroomacoustics")


def seconds(work: Callable[[], object], least: float = 0.5, clock: Callable[[], float] = time.process_time) -> float:
    """Return the least time of `work` by a clock, s, of at least three runs and `least` s, after one run to compile.

    Other programs can only lengthen a run, so the least time is the one that repeats best.
    """
    work()
    taken: list[float] = []
    while sum(taken) < least or len(taken) < 3:
        began = clock()
        work()
        taken.append(clock() - began)
    return min(taken)


def per_single_headings(floor: Room, clock: Callable[[], float]) -> float:
    """Return the time of 360 single headings over that of a whole scan, by a clock."""
    single = statistics.mean(seconds(partial(range_at, floor, PLACE, BOARD, h), 0.02, clock) for h in HEADINGS[::6])
    return 360 * single / seconds(lambda: scan(floor), clock=clock)


def rows() -> Iterator[Row]:
    """Yield the rows as they are measured."""
    small, large = office_floor(64), office_floor(1000)
    name = "whole scan, 64 walls: times 360 headings"
    yield without_limit(f"{name}, processor time", per_single_headings(small, time.process_time), 1)
    yield at_least(f"{name}, wall time, {core_count()} cores", 15, per_single_headings(small, time.perf_counter))
    paths = paths_for(small, PLACE, BOARD, OPTIONS)
    for receiver in Receiver:
        options = replace(OPTIONS, receiver=receiver)
        readings = seconds(partial(weigh_paths, small, PLACE, BOARD, HEADINGS, paths, options))
        yield at_most(f"readings from known paths, 64 walls, {receiver}: ms", 15, readings * 1e3)
    larger = seconds(lambda: scan(large))
    yield at_most("whole scan, 1 000 walls: times that of 64 walls", 3, larger / seconds(lambda: scan(small)))
    huge = office_floor(10_000)
    yield at_most("whole scan, 10 000 walls: times that of 1 000 walls", 6, seconds(lambda: scan(huge)) / larger)
    yield from default_predictions(small)
    board, echoes = load_board("polaroid-6500"), hundred_echoes()
    trace = seconds(lambda: received(echoes, board, SPEED, LISTEN).rf(RATE))
    yield at_most("trace of 62 ms at 1 MHz with 100 echoes: ms", 1, trace * 1e3)
    yield at_most("memory of a scan in 10 000 walls, whole process: MB", 300, memory_of_huge_scan())


def default_predictions(floor: Room) -> Iterator[Row]:
    """Yield the times of predictions as commands make them by default, paths and readings, at 360 headings."""
    board = load_board("polaroid-6500")
    places = [("64 walls", floor, PLACE)]
    for name, where in (("laboratory", "bench"), ("doorstep", "robot")):
        room = load_room(name)
        places.append((f"{name}, {where}", room, room.places[where]))
    for name, room, place in places:
        time_of_scan = seconds(partial(predict_scan, room, place, board, HEADINGS))
        yield without_limit(f"default prediction, 360 headings, {name}: ms", time_of_scan * 1e3)


def memory_of_huge_scan() -> float:
    """Return the peak memory, MB, of a new process that predicts a scan in a room of 10 000 walls."""
    # the peak of the process on Linux; getrusage would include the parent's memory
    program = (
        "from benchmarks.cases.office import office_floor\n"
        "from benchmarks.cases.office_scan import scan\n"
        "scan(office_floor(10_000))\n"
        "print(next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))"
    )
    answer = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    return float(answer.stdout) * 1024 / 1e6


def versions() -> str:
    """Return the machine and the versions."""
    installed = {dist.metadata["Name"].lower(): dist.version for dist in importlib.metadata.distributions()}
    listed = ", ".join(f"{name} {installed[name]}" for name in VERSIONS if name in installed)
    return f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}, {listed}"


def main() -> None:
    """Print the table."""
    print(versions())
    print(f"{'work':64}{'required':>9}{'measured':>10}")
    for row in (*rows(), *compare_with_image_sources()):
        print(f"{row.work:64}{row.required:>9}{row.measured:>10}  {'' if row.holds else 'missed'}", flush=True)


if __name__ == "__main__":
    main()
