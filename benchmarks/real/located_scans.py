"""Reliability of the probabilities of `locate`: `python -m benchmarks.real.located_scans [FOLDER]`.

Locates each scan of the folder, and of its subfolder `other_sensors`, in the whole arena with unknown heading. Prints
stated probability and result of the first pose, the rate of being right by bands of the probability with its 95 %
binomial interval (Clopper and Pearson), and the median processor time. Also prints how many first poses are expected to
be right, and how often all bands would agree within 0.1 if each stated probability were exactly right.
"""

import math
import time
from itertools import pairwise
from statistics import mean, median

import numpy as np
from scipy.stats import binomtest

from benchmarks.real.judged_scans import load_scans, program_options
from benchmarks.real.real_places import locate_real

BANDS = (0.0, 0.5, 0.6, 0.8, 0.9, 1.0)
POOLED = (0.0, 0.8, 1.0)  # few scans in a band cannot contradict what it states
RIGHT = 0.1  # m from the true position
AGREEING = 0.1  # between mean stated probability and rate of a band
_DRAWS = 20_000

First = tuple[float, bool]  # stated probability of a first pose, and whether it is right


def main() -> None:
    """Print a row for each scan, then the tables."""
    folder = program_options("Reliability of the probabilities of locate on real scans.").folder
    folders = [one for one in (folder, folder / "other_sensors") if (one / "scans.csv").is_file()] or [folder]
    found: list[First] = []
    times = []
    for scan in (scan for one in folders for scan in load_scans(one)):
        begin = time.process_time()
        best = locate_real(scan).poses[0]
        times.append(time.process_time() - begin)
        away = math.dist(best.position, (scan.x, scan.y))
        found.append((best.probability, away < RIGHT))
        print(f"{scan.name:5} {best.probability:6.1%} {away * 100:5.0f} cm {times[-1]:6.1f} s", flush=True)
    _print_reliability(found)
    print(f"median processor time of a scan: {median(times):.1f} s")


def _print_reliability(found: list[First]) -> None:
    """Print the bands, and what stated probabilities that are exactly right would give."""
    print("stated probability  scans  mean stated  rate of being right, 95 % interval")
    for low, high in [*pairwise(BANDS), *pairwise(POOLED), (0.0, 1.0)]:
        _print_band(low, high, _within(found, low, high))
    stated = np.array([one[0] for one in found])
    spread = math.sqrt(float((stated * (1 - stated)).sum()))
    brier = mean((probability - right) ** 2 for probability, right in found)
    right = sum(one[1] for one in found)
    print(f"right first poses: {stated.sum():.1f} ± {spread:.1f} expected, {right} found; Brier score {brier:.3f}")
    chances = [chance_of_agreement(band) for low, high in pairwise(BANDS) if (band := _within(found, low, high))]
    shown = ", ".join(f"{chance:.2f}" for chance in chances)
    print(f"chance that a band agrees within {AGREEING:g} if each stated probability is exactly right: {shown}")


def _within(found: list[First], low: float, high: float) -> list[First]:
    return [one for one in found if low <= one[0] < high or (high == one[0] == 1.0)]


def chance_of_agreement(band: list[First]) -> float:
    """Return how often the rate of a band is near its mean stated probability, if poses are right as often as stated.

    From draws with a fixed seed.
    """
    stated = np.array([one[0] for one in band])
    rates = (np.random.default_rng(0).random((_DRAWS, len(stated))) < stated).mean(axis=1)
    return float((np.abs(rates - stated.mean()) <= AGREEING).mean())


def _print_band(low: float, high: float, band: list[First]) -> None:
    """Print one band of stated probabilities, with whether each first pose is right."""
    if not band:
        return
    stated, right = mean(one[0] for one in band), sum(one[1] for one in band)
    interval = binomtest(right, len(band)).proportion_ci(method="exact")
    rate = f"{right / len(band):.2f}, {interval.low:.2f} to {interval.high:.2f}"
    print(f"{low:8.2f} to {high:4.2f} {len(band):10} {stated:12.2f}  {rate}")


if __name__ == "__main__":
    main()
