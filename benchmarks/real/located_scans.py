"""Reliability of the probabilities of `locate`: `python -m benchmarks.real.located_scans [FOLDER]`.

Locates each scan of the folder, and of its subfolder `other_sensors`, in the whole arena with unknown heading. Prints
stated probability and result of the first pose, a table by bands of the probability, and the median processor time.
"""

import math
import time
from itertools import pairwise
from statistics import mean, median

from benchmarks.real.judged_scans import load_scans, program_options
from benchmarks.real.real_places import locate_real

BANDS = (0.0, 0.5, 0.6, 0.8, 0.9, 1.0)
RIGHT = 0.1  # m from the true position


def main() -> None:
    """Print a row for each scan, then the tables."""
    folder = program_options("Reliability of the probabilities of locate on real scans.").folder
    folders = [one for one in (folder, folder / "other_sensors") if (one / "scans.csv").is_file()] or [folder]
    found, times = [], []
    for scan in (scan for one in folders for scan in load_scans(one)):
        begin = time.process_time()
        best = locate_real(scan).poses[0]
        times.append(time.process_time() - begin)
        away = math.dist(best.position, (scan.x, scan.y))
        found.append((best.probability, away < RIGHT))
        print(f"{scan.name:5} {best.probability:6.1%} {away * 100:5.0f} cm {times[-1]:6.1f} s", flush=True)
    print("stated probability  scans  mean stated  rate of being right")
    for low, high in pairwise(BANDS):
        band = [one for one in found if low <= one[0] < high or (high == one[0] == 1.0)]
        if band:
            stated, right = mean(one[0] for one in band), mean(one[1] for one in band)
            print(f"{low:8.2f} to {high:4.2f} {len(band):10} {stated:12.2f} {right:20.2f}")
    print(f"median processor time of a scan: {median(times):.1f} s")


if __name__ == "__main__":
    main()
