"""Levels of the paths compared with exact waves: `python -m benchmarks.wave_equation [OPTION]`.

Prints, for each scene, the level of all its sound at the carrier by the paths (`uniform` strength of edges) and by a
wave that is independent of rays, in dB relative to an endless perfect wall. Each table names its wave. Held are cases
with reflectance 1, and those with less that are straight ahead, wherever the wave is over -40 dB: the paths are at most
1.5 dB fainter and 0.5 dB louder. Other cases are printed only: also those with reflectance 0, which is silent by
definition. The peaks of traces are compared too, with the same limits: the wave at every frequency of the burst. Takes
about a minute and a half of processor time.

`--grid` also compares every arrival of other scenes with a wave equation solved on a grid, for `paper`, `keller` and
`uniform` (half a minute), and prints the levels of sound that is bent by two edges of different walls.

`--past` compares only the wall behind posts, strips, doors and solids with boundary elements, with the same limits
(some minutes of processor time). `--inside` compares small concave things: slots, trays, stairs, ducts, louvres.

`--rooms [COUNT [FIRST]]` compares the first echoes of whole small rooms with legs, cables, door jambs, ducts and
skirtings, 120 headings each, with boundary elements for the whole room (10 to 25 s of processor time each; solved
rooms are kept in `build/small_rooms`). Default: 40 rooms. These readings have no limit.
"""

import itertools
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import hankel2
from sonarhw_sim.air import EdgeStrength

from benchmarks.cases.small_rooms import BOARDS, HEADINGS, RoomReadings, compare, responses_of, small_room
from tests.oracles.exact.boundary_elements import RigidScene, level_of_wall, scattered
from tests.oracles.exact.exact_levels import (
    WAVELENGTH,
    WAVENUMBER,
    Point,
    by_cylinder_series,
    by_integral_equation,
    by_paths,
    by_wedge_integral,
    decibels,
    level_near,
)
from tests.oracles.exact.exact_traces import (
    Wave,
    outer_corner_at,
    peak_by_paths,
    peak_by_wave,
    post_at,
    strip_at,
    wall_end_at,
)
from tests.oracles.wave_equation import Scene
from tests.oracles.wave_scenes import DIFFRACTED, REFLECTED, TWICE_BENT, Difference, differences, unexplained

DISTANCES = (0.5, 1.0)  # m
REFLECTANCES = (1.0, 0.5, 0.1, 0.0)
ENDS = (-100, -60, -30, -12, -3, 3, 12, 30, 60, 100)  # mm beyond the foot of the perpendicular
STRIPS = (5, 10, 20, 40, 70, 100, 200)  # mm
TILTS = (5, 10, 15, 20)  # degrees
OUTER = (30, 60, 90, 120, 150)  # degrees of the solid
INNER = (30, 40, 50, 60, 75, 90, 100, 120, 135, 150)  # degrees of air
SHARES = (0.5, 0.35)  # of the air, from one face to the direction from which a corner is seen
POSTS = (1, 2, 3, 5, 8, 10, 15, 20, 40)  # mm of diameter
REACH = 0.6  # m, from the foot to the far end of a wall that ends near the foot
ENDLESS = 9.0  # m
HELD_ABOVE = -40.0  # dB of the wave
FAINTER, LOUDER = 1.5, 0.5  # dB


class Case(NamedTuple):
    """One scene."""

    label: str
    wave: float  # dB
    paths: float  # dB
    holds: bool  # if the wave is loud enough
    louder: float = LOUDER  # dB, allowed

    @property
    def held(self) -> bool:
        """Whether the difference is limited."""
        return self.holds and self.wave > HELD_ABOVE

    @property
    def wrong(self) -> bool:
        """Whether it is held and differs too much."""
        return self.held and not -FAINTER <= self.paths - self.wave <= self.louder


Tables = Iterator[tuple[str, str, list[Case]]]  # title, wave, and cases


def _at(distance: float, off_normal_deg: float = 0.0, aside: float = 0.0) -> Point:
    """Return a point seen from the middle of a plate on the x axis, moved to the side by `aside` m."""
    angle = math.radians(off_normal_deg)
    across = np.array([math.cos(angle), -math.sin(angle)])
    return distance * np.array([math.sin(angle), math.cos(angle)]) + aside * across


def _plate(
    label: str, low: float, high: float, ends: tuple[Point, Point], holds: bool, reflectance: float = 1.0
) -> Case:
    """Return the case of a thin plate on the x axis from `low` to `high` m, for source and receiver."""
    source, receiver = ends
    mirrored = math.hypot(*(source - receiver * (1, -1)))
    wave = by_integral_equation((low, high), mirrored, source, receiver, reflectance)
    paths = by_paths([(low, 0.0, high, 0.0)], mirrored, source, receiver, reflectance=reflectance)
    return Case(label, wave, paths, holds)


def plates(distance: float) -> Tables:
    """Yield wall ends, strips, tilted strips and reciprocal pairs."""
    here, wave = _at(distance), "integral equation"
    for share in REFLECTANCES:
        # short of the foot, the wall is not straight ahead
        yield (
            f"wall that ends beyond the foot of the perpendicular, mm, reflectance {share:g}",
            wave,
            [
                _plate(f"{end:+d}", -REACH, end / 1000, (here, here), share == 1 or (share > 0 and end > 0), share)
                for end in ENDS
            ],
        )
    for share in REFLECTANCES:
        cases = [_plate(f"{width}", -width / 2000, width / 2000, (here, here), share > 0, share) for width in STRIPS]
        yield f"strip, width in mm, reflectance {share:g}", wave, cases
    cases = []
    for width in STRIPS:
        for tilt in TILTS:
            at = _at(distance, tilt)
            cases.append(_plate(f"{width} at {tilt}°", -width / 2000, width / 2000, (at, at), True))
    yield "tilted strip, width in mm", wave, cases
    one, other, cases = _at(distance, 10, -0.1), _at(0.8 * distance, 10, 0.15), []
    for width in STRIPS:
        there = _plate(f"{width} there", -width / 2000, width / 2000, (one, other), True)
        back = _plate(f"{width} back", -width / 2000, width / 2000, (other, one), True)
        cases += [there, back]
    yield "strip, separate source and receiver, and the reverse, width in mm", wave, cases


def corners(distance: float) -> Tables:
    """Yield outer and inner corners; of inner ones, all sound within a wavelength of that by the vertex."""
    wave = "integral of a wedge, and image sources"
    outer = [(360 - solid, share) for solid in OUTER for share in SHARES]
    cases = [_corner(f"{360 - air} from {air * share:g}°", air, air * share, distance, 0.0) for air, share in outer]
    yield "outer corner, degrees of the solid", wave, cases
    inner = [(air, share) for air in INNER for share in SHARES]
    least = 2 * distance - WAVELENGTH
    cases = [_corner(f"{air} from {air * share:g}°", air, air * share, distance, least) for air, share in inner]
    yield "inner corner, degrees of air, sound by the vertex", wave, cases


def _corner(label: str, air_deg: float, at_deg: float, distance: float, longer_than: float) -> Case:
    walls, source = _walls_and_place(air_deg, at_deg, distance)
    paths = by_paths(walls, 2 * distance, source, longer_than=longer_than)
    return Case(label, by_wedge_integral(air_deg, at_deg, distance, longer_than), paths, True)


def _walls_and_place(air_deg: float, at_deg: float, distance: float) -> tuple[list[tuple[float, ...]], Point]:
    """Return the walls of a corner, and a place seen from its vertex in `at_deg` from the first wall."""
    air, at = math.radians(air_deg), math.radians(at_deg)
    end = ENDLESS * math.cos(air), ENDLESS * math.sin(air)
    walls: list[tuple[float, ...]] = [(0.0, 0.0, ENDLESS, 0.0), (*end, 0.0, 0.0)]
    return walls, distance * np.array([math.cos(at), math.sin(at)])


def posts(distance: float) -> Tables:
    """Yield posts straight ahead."""
    for share in REFLECTANCES:
        cases = []
        for diameter in POSTS:
            radius = diameter / 2000
            post = [(distance + radius, 0.0, radius)]
            paths = by_paths([], 2 * distance, np.zeros(2), posts=post, reflectance=share)
            cases.append(Case(f"{diameter}", by_cylinder_series(radius, distance, share), paths, share > 0))
        yield f"post, diameter in mm, reflectance {share:g}", "series of a cylinder", cases


def traces(distance: float) -> Tables:
    """Yield the peaks of the traces of wall ends, strips, outer corners and posts, straight ahead, reflectance 1."""
    here, endless = _at(distance), -ENDLESS

    def case(label: str, wave: Wave, walls: Sequence[Sequence[float]], source: Point = here) -> Case:
        return Case(label, peak_by_wave(distance, wave), peak_by_paths(walls, distance, source), True)

    yield (
        "peak of the trace, wall that ends beyond the foot of the perpendicular, mm",
        "half-plane, by the integral of a wedge",
        [case(f"{end:+d}", wall_end_at(end / 1000, distance), [(endless, 0.0, end / 1000, 0.0)]) for end in ENDS],
    )
    yield (
        "peak of the trace, strip, width in mm",
        "integral equation",
        [case(f"{w}", strip_at(w / 1000, distance), [(-w / 2000, 0.0, w / 2000, 0.0)]) for w in STRIPS],
    )
    outer = [(360 - solid, (360 - solid) * share) for solid in OUTER for share in SHARES]
    corners_seen = [
        case(f"{360 - air} from {at:g}°", outer_corner_at(air, at, distance), *_walls_and_place(air, at, distance))
        for air, at in outer
    ]
    yield (
        "peak of the trace, outer corner, degrees of the solid",
        "integral of a wedge, and image sources",
        corners_seen,
    )
    cases = []
    for diameter in POSTS:
        radius = diameter / 2000
        paths = peak_by_paths([], distance, np.zeros(2), [(distance + radius, 0.0, radius)])
        cases.append(Case(f"{diameter}", peak_by_wave(distance, post_at(radius, distance)), paths, True))
    yield "peak of the trace, post, diameter in mm", "series of a cylinder", cases


BEFORE_WALL = (1, 3, 6, 10, 20, 50)  # mm of diameter
STRIPS_BEFORE = (5, 10, 20, 40)  # mm
ASIDE = (8, 16, 20, 30, 60, 100)  # mm
DOORS = (-15, -2, 2, 15, 50)  # mm beyond the line to the wall
SOLIDS = ((20, 20, 0), (20, 20, 10), (20, 20, 45), (30, 30, 5))  # mm across and along, degrees


def past_obstacles(distance: float) -> Tables:
    """Yield the wall at a distance behind posts, strips, the edge of a door, and solids."""
    wave = "boundary elements"
    posts = [((0.25, 0.0, d / 2000), f"{d}") for d in BEFORE_WALL]
    yield "wall past a post 0.25 m ahead, diameter in mm", wave, [_past(label, distance, post=p) for p, label in posts]
    posts = [((0.25, aside / 1000, 0.005), f"{aside}") for aside in ASIDE]
    yield "wall past a post of 10 mm, mm aside", wave, [_past(label, distance, post=p) for p, label in posts]
    strips = [([(0.25, -w / 2000), (0.25, w / 2000)], f"{w}") for w in STRIPS_BEFORE]
    yield (
        "wall past a strip 0.25 m ahead, width in mm",
        wave,
        [_past(label, distance, chain) for chain, label in strips],
    )
    doors = [([(0.4, -0.3), (0.4, end / 1000)], f"{end:+d}") for end in DOORS]
    yield "wall past a door 0.4 m ahead, mm beyond the line", wave, [_past(label, distance, c) for c, label in doors]
    solids = [(_solid(0.35, *size), "{} × {} at {}°".format(*size)) for size in SOLIDS]
    yield "wall past a solid 0.35 m ahead, mm", wave, [_past(label, distance, chain) for chain, label in solids]


def _solid(ahead: float, across: float, along: float, turn_deg: float) -> list[tuple[float, float]]:
    turn = complex(math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg)))
    shares = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    corners = [ahead + turn * complex(along * x, across * y) / 2000 for x, y in shares]
    return [(corner.real, corner.imag) for corner in corners]


def _past(
    label: str,
    distance: float,
    chain: Sequence[tuple[float, float]] = (),
    post: tuple[float, float, float] | None = None,
) -> Case:
    """Return the case of an endless wall behind a chain of walls and a post."""
    posts = [] if post is None else [post]
    wave = level_of_wall(RigidScene([chain] if chain else [], posts, distance))
    walls = [(distance, -ENDLESS, distance, ENDLESS)] + [(*a, *b) for a, b in itertools.pairwise(chain)]
    return Case(label, wave, level_near(walls, posts, np.zeros(2), 2 * distance), True)


Shapes = Sequence[tuple[float, float, float, float]]

U_SHAPES: Shapes = (
    (4, 20, 0, 1.0),
    (10, 60, 0, 1.0),
    (20, 20, 0, 1.0),
    (40, 20, 0, 1.0),
    (160, 20, 100, 1.0),
    (160, 60, 100, 1.0),
)  # mm wide and deep, mm aside, distance in m
OTHER_U: Shapes = (
    (6, 35, 0, 0.6),
    (15, 45, 20, 0.8),
    (30, 30, 40, 1.3),
    (55, 15, 30, 2.0),
    (90, 40, 60, 0.7),
    (120, 30, 0, 1.6),
)
STAIRS: Sequence[tuple[int, float, float, float]] = (
    (5, 20, 0, 1.0),
    (3, 20, 0, 1.0),
    (5, 20, 45, 1.0),
    (4, 15, 20, 0.7),
    (6, 12, 30, 1.5),
    (2, 35, 10, 1.2),
)
DUCTS: Shapes = ((10, 10, 0, 1.0), (5, 5, 0, 1.0), (30, 30, 0, 1.0), (70, 1.7, 50, 1.0), (70, 1.7, 150, 1.0))
OTHER_DUCTS: Shapes = (
    (15, 8, 12, 0.6),
    (25, 40, 60, 0.8),
    (40, 12, 0, 2.0),
    (90, 3, 60, 1.4),
    (12, 25, 30, 0.5),
    (50, 20, 200, 1.0),
)
LOUVRES: Sequence[tuple[int, float, float, float, float]] = (
    (5, 30, 25, 20, 1.0),
    (5, 30, 25, 40, 1.0),
    (4, 40, 30, 30, 0.7),
    (3, 50, 35, 15, 1.5),
)
SLOTS: Shapes = ((10, 20, 0.7, 45), (20, 20, 0.95, 18), (6, 35, 0.8, 30), (40, 15, 1.2, 25))


def inside(_: float) -> Tables:
    """Yield small concave things: alone, on an endless wall, and cut into one."""
    wave = "boundary elements"
    for title, shapes in (("U", U_SHAPES), ("other U", OTHER_U)):
        cases = [
            _small(f"{w} × {d}, {a}, {z:g} m", [_u_shape(w / 1000, d / 1000, a / 1000, z)], z) for w, d, a, z in shapes
        ]
        yield f"{title}, mm wide and deep, mm aside", wave, cases
    cases = [
        _small(f"{n} × {size} at {turn}°, {z:g} m", [_stairs(n, size / 1000, turn, z)], z)
        for n, size, turn, z in STAIRS
    ]
    yield "stairs, number and mm", wave, cases
    for title, shapes in (("duct", DUCTS), ("other duct", OTHER_DUCTS)):
        cases = [
            _small(f"{w} × {h}, {a}, {z:g} m", [_duct(w / 1000, h / 1000, a / 1000, z)], z, on_wall=True)
            for w, h, a, z in shapes
        ]
        yield f"{title} on an endless wall, mm wide and high, mm aside", wave, cases
    cases = [
        _small(f"{n} × {w} at {turn}°, {z:g} m", _louvre(n, w / 1000, pitch / 1000, turn, z), z)
        for n, w, pitch, turn, z in LOUVRES
    ]
    yield "louvre, number and mm", wave, cases
    cases = [_slot(w / 1000, d / 1000, z, turn) for w, d, z, turn in SLOTS]
    yield "slot in an endless wall, mm wide and deep, its sound alone", "a long plate less the same without slot", cases


Chain = list[tuple[float, float]]


def _u_shape(width: float, depth: float, aside: float, distance: float) -> Chain:
    low, high = aside - width / 2, aside + width / 2
    return [(distance, low), (distance + depth, low), (distance + depth, high), (distance, high)]


def _stairs(count: int, size: float, turn_deg: float, distance: float) -> Chain:
    corners = [complex(0, 0)]
    for _ in range(count):
        corners += [corners[-1] + 1j * size, corners[-1] + (1 + 1j) * size]
    turn = complex(math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg)))
    middle = sum(corners) / len(corners)
    turned = [turn * (corner - middle) + distance for corner in corners]
    return [(corner.real, corner.imag) for corner in turned]


def _duct(width: float, height: float, aside: float, distance: float) -> Chain:
    low, high = aside - width / 2, aside + width / 2
    return [(distance, low), (distance - height, low), (distance - height, high), (distance, high)]


def _louvre(count: int, width: float, pitch: float, turn_deg: float, distance: float) -> list[Chain]:
    half = width / 2 * np.exp(1j * math.radians(90 - turn_deg))
    middles = [distance + 1j * pitch * (k - (count - 1) / 2) for k in range(count)]
    return [[((m - half).real, (m - half).imag), ((m + half).real, (m + half).imag)] for m in middles]


def _small(label: str, chains: Sequence[Chain], distance: float, on_wall: bool = False) -> Case:
    """Return the case of chains of walls, and of an endless wall at a distance, at the carrier."""
    scene = RigidScene(chains, mirror=distance if on_wall else None)
    wall = complex(-0.25j * hankel2(0, WAVENUMBER * 2 * distance))
    wave = decibels(scattered(scene, (0.0, 0.0), WAVENUMBER) / wall)
    walls = [(*a, *b) for chain in chains for a, b in itertools.pairwise(chain)]
    walls += [(distance, -ENDLESS, distance, ENDLESS)] * on_wall
    return Case(label, wave, by_paths(walls, 2 * distance, np.zeros(2)), True, FAINTER)


def _slot(width: float, depth: float, distance: float, turn_deg: float, plate: float = 0.3) -> Case:
    """Return the case of a slot seen from aside, from which the wall itself returns no sound."""
    place = distance * np.exp(1j * math.radians(turn_deg))
    ends = (0.0, -plate), (0.0, plate)
    mouth = [(0.0, -width / 2), (depth, -width / 2), (depth, width / 2), (0.0, width / 2)]
    source = (-float(place.real), float(place.imag))
    with_slot, without = (
        scattered(RigidScene([chain]), source, WAVENUMBER) for chain in ([ends[0], *mouth, ends[1]], [*ends])
    )
    wave = decibels((with_slot - without) / complex(-0.25j * hankel2(0, WAVENUMBER * 2 * distance)))
    chain = [(0.0, -ENDLESS), *mouth, (0.0, ENDLESS)]
    walls = [(*a, *b) for a, b in itertools.pairwise(chain)]
    # the wall itself is heard from its foot
    straight = 2 * abs(source[0]) + WAVELENGTH
    paths = by_paths(walls, 2 * distance, np.array(source), longer_than=straight)
    return Case(f"{1000 * width:g} × {1000 * depth:g} at {turn_deg}°, {distance:g} m", wave, paths, True, FAINTER)


def show(title: str, wave: str, distance: float, cases: Sequence[Case]) -> None:
    """Print a table."""
    print(f"\n{title}, at {distance:g} m; wave: {wave}\n{'':>16}{'wave':>9}{'paths':>9}{'paths - wave':>14}, dB")
    for case in cases:
        silent = case.paths < -100
        difference = "" if silent and case.wave < -100 else f"{case.paths - case.wave:+.2f}"
        levels = "".join("   silent" if level < -100 else f"{level:9.2f}" for level in (case.wave, case.paths))
        mark = "WRONG" if case.wrong else "held" if case.held else ""
        print(f"{case.label:>16}{levels}{difference:>14}  {mark}")


def show_exact(
    kinds: Sequence[Callable[[float], Tables]] = (plates, corners, posts), distances: Sequence[float] = DISTANCES
) -> list[Case]:
    """Print all tables of these kinds against exact waves at distances in m; return all cases."""
    found = []
    for distance in distances:
        for tables in kinds:
            for title, wave, cases in tables(distance):
                show(title, wave, distance, cases)
                found += cases
    return found


Row = tuple[Difference, Difference, Difference]  # by the paper's factor, Keller's coefficient, the uniform theory


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


TOLERANCES = (0.1, 0.05, 0.025)  # m
SOLVED = Path("build/small_rooms")


def show_rooms(count: int, first: int) -> None:
    """Print the readings of each room that are wrong by 5 cm or more, and the shares of all that are wrong."""
    by_board: dict[str, list[RoomReadings]] = {name: [] for name in BOARDS}
    for seed in range(first, first + count):
        small = small_room(seed)
        for name in BOARDS:
            readings = compare(small, responses_of(small, SOLVED), name)
            by_board[name].append(readings)
            print(f"room {seed}, {name}: {int(readings.wrong(TOLERANCES[1]).sum())} wrong", flush=True)
            for row in np.flatnonzero(readings.wrong(TOLERANCES[1])).tolist():
                ranges = "".join(f"{r:8.3f}" for r in (*readings.wave[:, row], readings.predicted[row]))
                print(f"  {math.degrees(HEADINGS[row]):5.0f}°{ranges}  {readings.via[row]}")
    for name, rooms in by_board.items():
        _show_shares(name, rooms)


def _show_shares(name: str, rooms: Sequence[RoomReadings]) -> None:
    for tolerance in TOLERANCES:
        wrong = np.concatenate([room.wrong(tolerance) for room in rooms])
        unsure = np.concatenate([room.unsure(tolerance) for room in rooms])
        same_rule = np.concatenate([room.wrong(tolerance, "paths") for room in rooms])
        print(
            f"{name}: {wrong.sum()} of {len(wrong)} readings wrong by more than {100 * tolerance:g} cm "
            f"({wrong.mean():.2%}), {(wrong & unsure).sum()} of them right with the threshold 1 dB lower or higher; "
            f"{same_rule.sum()} by the paths and the receiver of the oracle"
        )


def main() -> None:
    """Print the tables."""
    if "--rooms" in sys.argv[1:]:
        numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
        show_rooms(*(numbers + [40, 0][len(numbers) :])[:2])
        return
    if "--past" in sys.argv[1:]:
        _show_largest_of_all(show_exact([past_obstacles], DISTANCES[-1:]))
        return
    if "--inside" in sys.argv[1:]:
        _show_largest_of_all(show_exact([inside], DISTANCES[-1:]))
        return
    if "--grid" in sys.argv[1:]:
        show_largest(show_arrivals(REFLECTED + DIFFRACTED))
        print("\nsound bent by two edges of different walls, which has no path; relative to a flat wall, dB")
        for scene in TWICE_BENT:
            print(f"{scene.name:70}{decibels(unexplained(scene)):8.1f}", flush=True)
    _show_largest_of_all(show_exact() + show_exact([traces]))


def _show_largest_of_all(cases: Sequence[Case]) -> None:
    held = [case for case in cases if case.held]
    worst = [max(held, key=lambda case: sign * (case.paths - case.wave)) for sign in (1, -1)]
    print(f"\n{len(cases)} cases, {len(held)} held; largest differences of these:", end=" ")
    print(", ".join(f"{case.paths - case.wave:+.2f} dB" for case in worst))
    print(f"held cases that differ by more than +{LOUDER:g} or -{FAINTER:g} dB: {sum(case.wrong for case in cases)}")


if __name__ == "__main__":
    main()
