"""The paths beside the wave equation, arrival by arrival: `python -m benchmarks.wave_equation`.

Takes the scenes of the tests and some beyond what rays can say; prints each arrival as its path has it and as the wave
equation has it, for the paper's strength of edges and for Keller's, and the largest differences. dB of a flat wall at
that length.
"""

import math
from collections.abc import Iterable, Sequence

from sonarhw_sim.choices import EdgeStrength

from tests.oracles.wave_equation import FLAT_WALL, WAVELENGTH, Scene, arrival_near
from tests.oracles.wave_scenes import DIFFRACTED, REFLECTED, Difference, abreast_of_an_end, differences, unexplained

SHARES = (-2, -1, -0.5, 0, 0.5, 1, 2)  # wavelengths


def decibels(ratio: float) -> float:
    """An amplitude ratio in dB."""
    return 20 * math.log10(ratio)


def show_arrivals(scenes: Iterable[Scene]) -> list[tuple[Difference, Difference]]:
    """Print a row an arrival; hands on each by the paper's strength and by Keller's."""
    print(f"{'scene, path':52}{'m':>7}{'wave eq.':>9}{'paper':>8}{'Keller':>8}{'differ':>15}{'cycles':>8}")
    rows = []
    for scene in scenes:
        print(f"{scene.name:52}{'what no path explains':>24}{decibels(unexplained(scene)):8.1f}", flush=True)
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
    print(f"{len(rows)} arrivals; latest by {max(abs(paper.cycles) for paper, _ in rows):.2f} cycles at most")
    print(f"{len(reflected)} reflected: within {max(abs(arrival.decibels) for arrival in reflected):.2f} dB")
    for name, column in (("paper", 0), ("Keller", 1)):
        apart = [row[column].decibels for row in diffracted]
        print(f"{len(diffracted)} diffracted, by {name}: {min(apart):+.2f} to {max(apart):+.2f} dB")


def show_shadow() -> None:
    """Print what rays cannot say: a wall that ends abreast of the sensor fades, it does not stop."""
    print(
        "\nwall that ends so many wavelengths beyond the point abreast of the sensor: wave equation, loudest path, dB"
    )
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
