"""How much two processes gain a study over one: `python -m benchmarks.study [SCANS]`.

Predicts the same study (10 000 scans unless told otherwise, 72 headings each, at places drawn anywhere in the arena)
with one process and with two, in turns, and prints scans a second, the ratio, and whether all files are alike. The
ratio asked for is 1.8 of 100 000 scans on two cores. It needs both cores for itself; what two processes cost more than
one in processor time is told, too, which a busy machine shows as well: without waiting the ratio is 2 over that.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from sonarhw_compare.study import load_study, run_study

from benchmarks.speed import versions

SCANS = 10_000
GRID = 10  # points, each at every place drawn: thresholds

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
    """How long a study takes with so many processes, their start included: s by the clock, and of processor time."""
    began, worked = time.perf_counter(), processor_time()
    run_study(load_study(spec), out, workers=workers)
    return time.perf_counter() - began, processor_time() - worked


def processor_time() -> float:
    """Of this process and of those it has started and that have ended, s."""
    return sum(os.times()[:4])


def alike(one: Path, other: Path) -> bool:
    """Whether two folders hold the same files."""
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
        # what is compiled once is not counted
        run_study(load_study(write_small(folder, text)), folder / "warm", workers=1)
        taken = {workers: seconds(spec, folder / str(workers), workers) for workers in (1, 2)}
        same = alike(folder / "1", folder / "2")
    print(versions())
    for workers, (clock, _) in taken.items():
        print(f"{workers} process{'es' if workers > 1 else ''}: {scans / clock:8.0f} scans a second")
    print(f"two over one: {taken[1][0] / taken[2][0]:.2f} (asked for: 1.8), files {'alike' if same else 'DIFFER'}")
    print(f"processor time, two over one: {taken[2][1] / taken[1][1]:.3f}")


def write_small(folder: Path, text: str) -> Path:
    """The same study with one draw."""
    small = folder / "small.toml"
    small.write_text("\n".join("draws = 1" if line.startswith("draws") else line for line in text.splitlines()))
    return small


if __name__ == "__main__":
    main()
