"""Paths compared with the wave equation, arrival by arrival: `python -m benchmarks.wave_equation`.

Uses the scenes of the tests, and some that rays cannot describe. Prints the level of each arrival by its path and by
the wave equation, once with the paper's strength of edges and once with Keller's, and the largest differences. Levels
are in dB relative to a flat wall at that length.
"""

import math
from collections.abc import Iterable, Sequence

from sonarhw_sim.choices import EdgeStrength

from tests.oracles.wave_equation import FLAT_WALL, WAVELENGTH, Scene, arrival_near
from tests.oracles.wave_scenes import DIFFRACTED, REFLECTED, Difference, abreast_of_an_end, differences, unexplained

SHARES = (-2, -1, -0.5, 0, 0.5, 1, 2)  # wavelengths


def decibels(ratio: float) -> float:
    """Return an amplitude ratio in dB."""
    return 20 * math.log10(ratio)


def show_arrivals(scenes: Iterable[Scene]) -> list[tuple[Difference, Difference]]:
    """Print a row for each arrival; return each with the paper's strength and with Keller's."""
    print(f"{'scene, path':52}{'m':>7}{'wave eq.':>9}{'paper':>8}{'Keller':>8}{'differ':>15}{'cycles':>8}")
    rows = []
    for scene in scenes:
        print(f"{scene.name:52}{'sound without a path':>24}{decibels(unexplained(scene)):8.1f}", flush=True)
        by_angle = {arrival.via: arrival for arrival in differences(scene, EdgeStrength.KELLER)}
        for paper in differences(scene):
            keller = by_angle[paper.via]
            print(f"    {paper.via:48}{paper.predicted.length:7.3f}{decibels(paper.found.strength):9.2f}", end="")
            print(f"{decibels(paper.predicted.strength):8.2f}{decibels(keller.predicted.strength):8.2f}", end="")
            print(f"{paper.decibels:+8.2f}{keller.decibels:+7.2f}{paper.cycles:+8.2f}")
            rows.append((paper, keller))
    return rows


def show_largest(rows: Sequence[tuple[Difference, Difference]]) -> None:
    """Print the largest differences over all arrivals."""
    reflected = [paper for paper, _ in rows if not paper.diffracted]
    diffracted = [row for row in rows if row[0].diffracted]
    print(f"{len(rows)} arrivals; time error at most {max(abs(paper.cycles) for paper, _ in rows):.2f} cycles")
    print(f"{len(reflected)} reflected: within {max(abs(arrival.decibels) for arrival in reflected):.2f} dB")
    for name, column in (("paper", 0), ("Keller", 1)):
        levels = [row[column].decibels for row in diffracted]
        print(f"{len(diffracted)} diffracted, by {name}: {min(levels):+.2f} to {max(levels):+.2f} dB")


def show_shadow() -> None:
    """Print what rays cannot describe: the level of a wall that ends opposite the sensor changes gradually."""
    print("\nwall that ends so many wavelengths beyond the foot of the perpendicular: wave equation, loudest path, dB")
    for share in SHARES:
        scene = abreast_of_an_end(share * WAVELENGTH)
        loudest = max(arrival.predicted.strength for arrival in differences(scene, EdgeStrength.KELLER))
        found = arrival_near(scene, 2 * FLAT_WALL.walls[0][0])
        print(f"{share:+6.1f}{decibels(found.strength):8.2f}{decibels(loudest):8.2f}")


def main() -> None:
    """Print the tables."""
    show_largest(show_arrivals(REFLECTED + DIFFRACTED))
    show_shadow()


if __name__ == "__main__":
    main()
