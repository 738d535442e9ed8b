"""Gain of two processes over one in a study: `python -m benchmarks.study [SCANS]`.

Predicts the same study (default 10 000 scans of 72 headings, at random places in the arena) alternately with one and
with two processes. Prints scans per second, their ratio, and whether all files are equal. The required ratio is 1.8 for
100 000 scans on two cores, and needs both cores idle. The ratio of processor times is printed too, and is also valid on
a busy machine: without waiting, the gain is 2 divided by it.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from sonarhw_compare.study import load_study, run_study

from benchmarks.speed import versions

SCANS = 10_000
GRID = 10  # points of the grid (thresholds) at each random place

SPEC = """
name = "speed"
seed = 1
draws = {draws}
boards = ["lego-nxt"]
[[rooms]]
file = "{room}"
places = ["anywhere"]
[vary.board]
threshold_db = [{thresholds}]
[vary.materials.board]
reflectance = {{ uniform = [0.8, 1.0] }}
"""


def seconds(spec: Path, out: Path, workers: int) -> tuple[float, float]:
    """Return wall clock and processor time, s, of a study with this number of processes, including their start."""
    began, worked = time.perf_counter(), processor_time()
    run_study(load_study(spec), out, workers=workers)
    return time.perf_counter() - began, processor_time() - worked


def processor_time() -> float:
    """Return the processor time of this process and of its ended children, s."""
    return sum(os.times()[:4])


def are_equal(one: Path, other: Path) -> bool:
    """Return whether two folders contain the same files."""
    files = sorted(path.relative_to(one) for path in one.rglob("*.*"))
    same = files == sorted(path.relative_to(other) for path in other.rglob("*.*"))
    return same and all((one / name).read_bytes() == (other / name).read_bytes() for name in files)


def main() -> None:
    """Print the figures."""
    scans = int(sys.argv[1]) if len(sys.argv) > 1 else SCANS
    thresholds = ", ".join(f"{-40.0 + k}" for k in range(GRID))
    text = SPEC.format(draws=max(1, scans // GRID), room=Path("rooms/arena.toml").resolve(), thresholds=thresholds)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        spec = folder / "spec.toml"
        spec.write_text(text)
        # compiles before the measurement
        run_study(load_study(write_small(folder, text)), folder / "warm", workers=1)
        taken = {workers: seconds(spec, folder / str(workers), workers) for workers in (1, 2)}
        same = are_equal(folder / "1", folder / "2")
    print(versions())
    for workers, (clock, _) in taken.items():
        print(f"{workers} process{'es' if workers > 1 else ''}: {scans / clock:8.0f} scans per second")
    print(f"two over one: {taken[1][0] / taken[2][0]:.2f} (required: 1.8), files {'equal' if same else 'DIFFER'}")
    print(f"processor time, two over one: {taken[2][1] / taken[1][1]:.3f}")


def write_small(folder: Path, text: str) -> Path:
    """Write the same study with one draw."""
    small = folder / "small.toml"
    small.write_text("\n".join("draws = 1" if line.startswith("draws") else line for line in text.splitlines()))
    return small


if __name__ == "__main__":
    main()
