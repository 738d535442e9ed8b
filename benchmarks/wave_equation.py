"""Paths compared with the wave equation, arrival by arrival: `python -m benchmarks.wave_equation`.

Uses the scenes of the tests, and some that rays cannot describe. Prints the level of each arrival by its path and by
the wave equation, with the paper's strength of edges, with Keller's and with the uniform theory, and the largest
differences. Levels are in dB relative to a flat wall at that length.
"""

import math
from collections.abc import Callable, Iterable, Sequence

from sonarhw_sim.choices import EdgeStrength

from tests.oracles.wave_equation import Scene
from tests.oracles.wave_scenes import (
    DIFFRACTED,
    REFLECTED,
    Difference,
    abreast_of_an_end,
    differences,
    outer_corner,
    strip,
    unexplained,
)

ENDS = (-0.1, -0.06, -0.03, -0.012, -0.003, 0.003, 0.012, 0.03, 0.06, 0.1)  # m beyond the foot of the perpendicular
STRIPS = (0.01, 0.02, 0.04, 0.07, 0.1, 0.2)  # m
WEDGES = (210, 240, 270, 300, 330)  # degrees of air, seen along the line that halves them
HELD_ABOVE = -40.0  # dB of the wave; fainter arrivals are printed, not held
WITHIN, LOUDER = 1.5, 0.5  # dB
Row = tuple[Difference, Difference, Difference]  # by the paper's factor, Keller's coefficient, the uniform theory


def decibels(ratio: float) -> float:
    """Return an amplitude ratio in dB."""
    return 20 * math.log10(ratio)


def show_arrivals(scenes: Iterable[Scene]) -> list[Row]:
    """Print a row for each arrival; return each with the three strengths of edges."""
    print(f"{'scene, path':52}{'m':>7}{'wave eq.':>9}{'paper':>8}{'Keller':>8}{'uniform':>8}{'cycles':>8}")
    rows = []
    for scene in scenes:
        print(f"{scene.name:52}{'sound without a path':>24}{decibels(unexplained(scene)):8.1f}", flush=True)
        by_strength = [
            {arrival.via: arrival for arrival in differences(scene, strength)}
            for strength in (EdgeStrength.PAPER, EdgeStrength.KELLER)
        ]
        for uniform in differences(scene):
            if any(uniform.via not in arrivals for arrivals in by_strength):
                continue
            row = by_strength[0][uniform.via], by_strength[1][uniform.via], uniform
            print(f"    {uniform.via:48}{uniform.predicted.length:7.3f}{decibels(uniform.found.strength):9.2f}", end="")
            print(
                "".join(f"{decibels(arrival.predicted.strength):8.2f}" for arrival in row) + f"{uniform.cycles:+8.2f}"
            )
            rows.append(row)
    return rows


def show_largest(rows: Sequence[Row]) -> None:
    """Print the largest differences over all arrivals."""
    reflected = [uniform for *_, uniform in rows if not uniform.diffracted]
    diffracted = [row for row in rows if row[2].diffracted]
    print(f"{len(rows)} arrivals; time error at most {max(abs(row[2].cycles) for row in rows):.2f} cycles")
    print(f"{len(reflected)} reflected: within {max(abs(arrival.decibels) for arrival in reflected):.2f} dB")
    for column, name in enumerate(("paper", "Keller", "uniform")):
        levels = [row[column].decibels for row in diffracted]
        print(f"{len(diffracted)} diffracted, by {name}: {min(levels):+.2f} to {max(levels):+.2f} dB")


def show_held(name: str, scenes: Iterable[tuple[str, Scene]]) -> int:
    """Print model and wave for the first arrival of each scene; return how many held cases differ too much."""
    print(f"\n{name}, 0.24 m (corners: 0.29 m): wave equation, uniform theory, model minus wave, dB")
    wrong = 0
    for label, scene in scenes:
        arrival = differences(scene)[0]
        held, excess = decibels(arrival.found.strength) > HELD_ABOVE, -arrival.decibels
        fails = held and not -WITHIN <= excess <= LOUDER
        mark = "" if not held else "held, differs" if fails else "held"
        print(f"{label:>10}{decibels(arrival.found.strength):8.2f}", end="")
        print(f"{decibels(arrival.predicted.strength):8.2f}{excess:+8.2f}  {mark}", flush=True)
        wrong += fails
    return wrong


def main() -> None:
    """Print the tables."""
    show_largest(show_arrivals(REFLECTED + DIFFRACTED))
    wrong = show_held("wall that ends beyond the foot of the perpendicular, mm", _labelled(ENDS, abreast_of_an_end))
    wrong += show_held("strip, width in mm", _labelled(STRIPS, strip))
    corners = [(f"{air}", outer_corner(air, air / 2)) for air in WEDGES]
    wrong += show_held("outer corner, degrees of air", corners)
    print(f"\nheld cases that differ by more than +{LOUDER:g} or -{WITHIN:g} dB: {wrong}")


def _labelled(lengths: Sequence[float], scene: Callable[[float], Scene]) -> list[tuple[str, Scene]]:
    return [(f"{1000 * length:+.0f}", scene(length)) for length in lengths]


if __name__ == "__main__":
    main()
