"""How fast predictions are, as ratios taken in one run: `python -m benchmarks.speed`.

Takes a floor of offices of 64 to 10 000 walls and rooms of 20; prints one table with what was asked for, what was
measured, the machine and the versions. The image-source model of pyroomacoustics takes a minute; its row is left out,
and said to be, where that library is not installed (`pip install .[benchmarks]`).
"""

import importlib.metadata
import math
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.board.traces import received
from sonarhw_sim.rays.detectable import all_rays
from sonarhw_sim.rays.kernel import follow_fan

from benchmarks.cases.image_source_table import compare_with_image_sources
from benchmarks.cases.numpy_fan import follow_with_numpy
from benchmarks.cases.office import PLACE, office_floor
from benchmarks.cases.office_scan import BOARD, BOUNCES, HEADINGS, LONGEST, scan
from benchmarks.cases.table_rows import Row, at_least, at_most
from benchmarks.traces import LISTEN, RATE, SPEED
from benchmarks.traces import arrivals as hundred_echoes
from tests.oracles.one_heading import range_at

HALF_CIRCLE = 0.3 - math.pi / 2 + np.arange(721) * math.radians(0.25)
VERSIONS = ("numpy", "numba", "scipy", "pyroomacoustics")


def seconds(work: Callable[[], object], least: float = 0.5) -> float:
    """Median processor time of `work`, run for at least `least` s and three times, once before the clock runs; s."""
    work()
    taken: list[float] = []
    while sum(taken) < least or len(taken) < 3:
        began = time.process_time()
        work()
        taken.append(time.process_time() - began)
    return statistics.median(taken)


def rows() -> Iterator[Row]:
    """Every line, as it is measured."""
    small, large = office_floor(64), office_floor(1000)
    place, targets = np.array(PLACE.position), np.array([PLACE.position])
    longest = np.array([LONGEST])

    def every_arrival() -> set[tuple[int, int]]:
        no_limits = all_rays(len(HALF_CIRCLE), len(targets))
        _, candidates = follow_fan(
            place, HALF_CIRCLE, small.surfaces, small.reflectances, targets, longest, BOUNCES, no_limits
        )
        return {(int(ray), int(bounces)) for ray, bounces, _ in candidates}

    def with_numpy() -> set[tuple[int, int]]:
        return follow_with_numpy(place, HALF_CIRCLE, small.walls, LONGEST, BOUNCES)

    # the kernel notes a sequence of walls once, NumPy every ray that follows it
    assert every_arrival() <= with_numpy()
    numpy_time = seconds(with_numpy)
    yield at_least("one heading, every arrival, 64 walls: times NumPy", 9, numpy_time / seconds(every_arrival))
    first = statistics.mean(seconds(lambda h=h: range_at(small, PLACE, BOARD, h), 0.02) for h in HEADINGS[::6])
    yield at_least("one heading, appendix A with early exit, 64 walls: times NumPy", 30, numpy_time / first)
    whole = seconds(lambda: scan(small))
    yield at_least("whole scan, 64 walls: times 360 single headings", 10, 360 * first / whole)
    larger = seconds(lambda: scan(large))
    yield at_most("whole scan, 1 000 walls: times that of 64 walls", 3, larger / whole)
    huge = office_floor(10_000)
    yield at_most("whole scan, 10 000 walls: times that of 1 000 walls", 6, seconds(lambda: scan(huge)) / larger)
    board, heard = load_board("polaroid-6500"), hundred_echoes()
    trace = seconds(lambda: received(heard, board, SPEED, LISTEN).rf(RATE))
    yield at_most("trace of 62 ms at 1 MHz with 100 echoes: ms", 1, trace * 1e3)
    yield at_most("memory of a scan in 10 000 walls, whole process: MB", 300, memory_of_huge_scan())


def memory_of_huge_scan() -> float:
    """The most memory, MB, that a fresh process takes to predict a scan in a room of 10 000 walls."""
    # Linux keeps the peak of a process here; what getrusage tells counts the parent's memory, too
    program = (
        "from benchmarks.cases.office import office_floor\n"
        "from benchmarks.cases.office_scan import scan\n"
        "scan(office_floor(10_000))\n"
        "print(next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))"
    )
    answer = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    return float(answer.stdout) * 1024 / 1e6


def versions() -> str:
    """The machine and what runs on it."""
    known = {dist.metadata["Name"].lower(): dist.version for dist in importlib.metadata.distributions()}
    installed = ", ".join(f"{name} {known[name]}" for name in VERSIONS if name in known)
    return f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}, {installed}"


def main() -> None:
    """Print the table."""
    print(versions())
    print(f"{'work':64}{'asked':>9}{'measured':>10}")
    for row in (*rows(), *compare_with_image_sources()):
        print(f"{row.work:64}{row.wanted:>9}{row.measured:>10}  {'' if row.holds else 'missed'}", flush=True)


if __name__ == "__main__":
    main()
