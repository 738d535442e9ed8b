"""Readings compared with an exhaustive search: `python -m benchmarks.brute_force [--thin] [ROOMS [FIRST]]`.

Each of the random rooms (default: 100, from number 0) has boxes, a plate and posts, and 500 readings at random
headings.
`tests/oracles/brute` tries all sequences of up to three reflections, bends sound at every edge, adds what arrives
together and compares it with the threshold, without code of the product. Readings that change if the threshold moves by
0.01 dB are counted as unsure; for these, the readings on both sides are accepted. Prints the count, and each wrong
reading. Takes some seconds of processor time for each room.

Posts have a radius of 20 mm or more; with `--thin` of 1 mm or more.
"""

import math
import sys

import numpy as np

from tests.oracles.brute.furnished import THINNEST, compare
from tests.oracles.brute.readings import TIE_DB

HEADINGS = 500


def main() -> None:
    """Compare all rooms."""
    numbers = [int(word) for word in sys.argv[1:] if word != "--thin"]
    rooms, first = (numbers + [100, 0][len(numbers) :])[:2]
    thinnest = 0.001 if "--thin" in sys.argv[1:] else THINNEST
    wrong = unsure = silent = 0
    for seed in range(first, first + rooms):
        found = compare(seed, HEADINGS, thinnest)
        wrong += int(found.wrong.sum())
        unsure += int(found.unsure.sum())
        silent += int(np.isnan(found.predicted).sum())
        print(f"room {seed}: {int(found.wrong.sum())} wrong, {int(found.unsure.sum())} unsure", flush=True)
        for row in np.flatnonzero(found.wrong).tolist():
            heading, expected = math.degrees(found.headings[row]), found.exhaustive[row, 1]
            print(f"    at {heading:.3f}°: predicted {found.predicted[row]:.6f} m, exhaustive {expected:.6f} m")
    count = rooms * HEADINGS
    print(f"{wrong} wrong of {count} readings ({silent} without an echo); {unsure} unsure within {TIE_DB:g} dB")


if __name__ == "__main__":
    main()
