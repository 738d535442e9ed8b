"""Tuning of the board profile hc-sr04 on a plate: `python -m benchmarks.real.tune_hc_sr04 [FILE.csv]`.

The file has the columns axis_distance_m, off_normal_deg, ping and range_m, and a row for each ping. A cell is one
distance at one angle. Its plate is detected if most pings report it, within 10 cm. Aperture and threshold together
decide from which angle on the plate is silent, so the aperture stays, and every threshold is tried. The program writes
the profile, and prints the cells that are wrong and the errors of ranges.
"""

import csv
import hashlib
import math
import sys
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, paths_for, weigh_paths
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Place, parse_room

from sonarhw.readings import FloatArray

DEFAULT_FILE = Path("../shared/real_scans/hc_sr04_plate.csv")
PROFILE = Path("sim/sonarhw_sim/board/shipped/hc-sr04.toml")
THRESHOLDS = np.arange(-60.0, -4.9, 1.0)  # dB
NEAR = 0.1  # m, from the plate to a range that is the plate's
PLATE = parse_room(
    'name = "plate"\n[materials.plate]\nreflectance = 1.0\n'
    '[[walls]]\nname = "plate"\npoints = [[0.0, -9.0], [0.0, 9.0]]\nmaterial = "plate"\n',
    "plate",
)


class Cell(NamedTuple):
    """The pings at one distance and angle."""

    distance: float  # m, along the axis
    off_normal_deg: float
    ranges: FloatArray  # (n,), m, NaN: no echo

    @property
    def plate(self) -> float:
        """Distance from the sensor to the plate, along its perpendicular, m."""
        return self.distance * math.cos(math.radians(self.off_normal_deg))

    @property
    def heard(self) -> bool:
        """Whether most pings report the plate."""
        return bool(np.mean(np.abs(self.ranges - self.plate) <= NEAR) > 0.5)


def load_cells(file: Path) -> list[Cell]:
    """Return the cells of the file, in its order."""
    ranges: dict[tuple[float, float], list[float]] = defaultdict(list)
    with open(file, encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            key = float(row["axis_distance_m"]), float(row["off_normal_deg"])
            ranges[key].append(float(row["range_m"] or "nan"))
    return [Cell(*key, np.array(values)) for key, values in ranges.items()]


def known_paths(cells: list[Cell], board: Board) -> list[tuple[Place, Paths]]:
    """Return place and paths of each cell, before an endless plate."""
    places = [Place("sensor", (-cell.plate, 0.0)) for cell in cells]
    return [(place, paths_for(PLATE, place, board, PredictionOptions(diffraction=False))) for place in places]


def predicted(cells: list[Cell], known: list[tuple[Place, Paths]], board: Board) -> FloatArray:
    """Return the predicted range of each cell, (n,) m; NaN: no echo."""
    return np.array(
        [
            float(weigh_paths(PLATE, place, board, np.radians([cell.off_normal_deg]), paths).ranges[0])
            for cell, (place, paths) in zip(cells, known, strict=True)
        ]
    )


def right_cells(cells: list[Cell], ranges: FloatArray) -> list[bool]:
    """Return for each cell whether the prediction is right about detected or not."""
    return [cell.heard is not math.isnan(found) for cell, found in zip(cells, ranges.tolist(), strict=True)]


def best_threshold(counts: Mapping[float, int]) -> float:
    """Return the middle of the thresholds (dB) with the most right cells."""
    best = [threshold for threshold, count in counts.items() if count == max(counts.values())]
    return round(best[len(best) // 2], 1)


def silent_from(board: Board) -> float:
    """Return the angle (degrees) from which on an endless plate 1 m away is not detected."""
    place, headings = Place("sensor", (-1.0, 0.0)), np.radians(np.arange(0.0, 90.0, 0.1))
    paths = paths_for(PLATE, place, board, PredictionOptions(diffraction=False))
    silent = np.isnan(weigh_paths(PLATE, place, board, headings, paths).ranges)
    return math.degrees(float(headings[silent.argmax()]))


def profile(board: Board, threshold: float, plateau: tuple[float, float], right: int, cells: int, text: str) -> str:
    """Return the tuned profile with its origin, as TOML; `text` is the content of the file of pings."""
    fingerprint = hashlib.sha256(text.encode()).hexdigest()[:16]
    silent, (low, high) = silent_from(replace(board, threshold_db=threshold)), plateau
    return f"""\
# HC-SR04 module: 40 kHz, two transducers of 16 mm, eight cycles, 2 cm to 4 m.
# The threshold was tuned on {date.today()} by `python -m benchmarks.real.tune_hc_sr04`, with the receiver named below,
# on a plate at 16 distances and 9 angles, 100 pings each, from github.com/DerFabry/moro2020, commit e83718e5
# ({cells} cells with pings; SHA-256 of the file begins {fingerprint}).
# Detected or not is right in {right} of {cells} cells, for every threshold from {low:.0f} to {high:.0f} dB.
# This is the middle: the plate is silent from {silent:.0f} degrees on.
# Not explained: ranges up to 9 cm shorter than the way to the plate, at 10 to 20 degrees, 1.3 and 1.5 m.
name = "hc-sr04"
aperture_radius = 0.0065     # m; not tuned, because only the angle at which the plate falls silent was measured
frequency = 40000.0
transmit_cycles = 8
blanking = 0.000117          # 20 mm
max_range = 4.0
threshold_db = {threshold:.1f}         # tuned: weakest detected echo, relative to a perfect wall straight ahead
receiver = "first-echo"
sum_arrivals = false         # two transducers, centimetres apart: a path and its reverse differ in length
rise_cycles = 2.0            # with ring_cycles, as in traces of other 40 kHz transducers; not measured on this module
ring_cycles = 11.0
own_burst_db = -40.0         # a second transducer receives; an assumption, low enough not to detect its own burst
integration_cycles = 1.0     # a comparator on the amplified signal; an assumption
"""


def main() -> None:
    """Tune, write the profile, print the cells."""
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT_FILE
    text, base = file.read_text(), load_board("hc-sr04")
    cells = load_cells(file)
    known = known_paths(cells, replace(base, threshold_db=float(THRESHOLDS.min())))
    counts = {}
    for threshold in THRESHOLDS.tolist():
        right = right_cells(cells, predicted(cells, known, replace(base, threshold_db=threshold)))
        counts[threshold] = sum(right)
    print(f"{len(cells)} cells; right with each threshold, dB:")
    print(", ".join(f"{threshold:.0f}: {count}" for threshold, count in counts.items()))
    before = sum(right_cells(cells, predicted(cells, known, base)))
    print(f"right with the profile before, {base.threshold_db:g} dB: {before}")
    best = [threshold for threshold, count in counts.items() if count == max(counts.values())]
    tuned = profile(base, best_threshold(counts), (best[0], best[-1]), max(counts.values()), len(cells), text)
    PROFILE.write_text(tuned, encoding="utf-8")
    print(f"\n{PROFILE}:\n{tuned}")
    _print_cells(cells, predicted(cells, known, load_board(PROFILE)))


def _print_cells(cells: list[Cell], ranges: FloatArray) -> None:
    """Print the wrong cells, and the error of the range by angle where the plate is detected and predicted."""
    for cell, found in zip(cells, ranges.tolist(), strict=True):
        if cell.heard is math.isnan(found):
            share = np.mean(np.abs(cell.ranges - cell.plate) <= NEAR)
            where = f"{cell.distance:g} m, {cell.off_normal_deg:g}°"
            print(f"wrong: {where}: {share:.0%} of the pings report the plate at {cell.plate:.3f} m")
    print("\nrange at 1.5 m, measured median minus predicted:", end=" ")
    for cell, found in zip(cells, ranges.tolist(), strict=True):
        if cell.distance == 1.5 and cell.heard and not math.isnan(found):
            print(f"{cell.off_normal_deg:g}°: {100 * (np.nanmedian(cell.ranges) - found):+.1f} cm", end="; ")
    print()


if __name__ == "__main__":
    main()
