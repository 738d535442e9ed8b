"""Scans of random rooms of which only the first pose is exact, and the errors of the poses found for them."""

import math
from dataclasses import replace

import numpy as np
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import UNKNOWN, PoseSpread
from sonarhw_compare.rooms.refinement import Move
from sonarhw_compare.rooms.search import FoundRoom
from sonarhw_sim.room.room import Place

from benchmarks.cases.random_rooms import RandomRoom

ROUGH = PoseSpread(0.05, math.radians(3))  # standard deviations of a place that is roughly known
_Z95 = 1.96  # standard deviations to each side of a 95 % interval
Spreads = list[PoseSpread]


def exact_poses(case: RandomRoom, _seed: int) -> tuple[list[PlacedScan], Spreads]:
    """Return the scans at their true places."""
    return list(case.scans), [PoseSpread()] * len(case.scans)


def rough_poses(case: RandomRoom, seed: int) -> tuple[list[PlacedScan], Spreads]:
    """Return the scans with random errors of all places but the first."""
    random, scans = np.random.default_rng((seed, 99)), [case.scans[0]]
    for scan in case.scans[1:]:
        x, y = (scan.place.position + random.normal(0, ROUGH.xy, 2)).tolist()
        heading = scan.place.heading + float(random.normal(0, ROUGH.heading))
        scans.append(replace(scan, place=replace(scan.place, position=(x, y), heading=heading)))
    return scans, [PoseSpread(), *[ROUGH] * (len(scans) - 1)]


def unknown_poses(case: RandomRoom, _seed: int) -> tuple[list[PlacedScan], Spreads]:
    """Return the scans with the first place only."""
    nowhere = Place("", (0.0, 0.0))
    scans = [case.scans[0], *(replace(scan, place=nowhere) for scan in case.scans[1:])]
    return scans, [PoseSpread(), *[UNKNOWN] * (len(scans) - 1)]


def positions_unknown(case: RandomRoom, seed: int) -> tuple[list[PlacedScan], Spreads]:
    """Return the scans with the first place, and random errors of the headings of all others."""
    scans, _ = rough_poses(case, seed)
    nowhere = [replace(scan, place=replace(scan.place, position=(0.0, 0.0))) for scan in scans[1:]]
    return [scans[0], *nowhere], [PoseSpread(), *[PoseSpread(math.inf, ROUGH.heading)] * len(nowhere)]


def headings_unknown(case: RandomRoom, seed: int) -> tuple[list[PlacedScan], Spreads]:
    """Return the scans with the first place, and random errors of the positions of all others."""
    scans, _ = rough_poses(case, seed)
    turned = [replace(scan, place=replace(scan.place, heading=0.0)) for scan in scans[1:]]
    return [scans[0], *turned], [PoseSpread(), *[PoseSpread(ROUGH.xy, math.inf)] * len(turned)]


POSES = {
    "--rough": rough_poses,
    "--unknown": unknown_poses,
    "--headings": positions_unknown,
    "--positions": headings_unknown,
}  # by the option of the benchmark


def pose_text(case: RandomRoom, found: FoundRoom) -> str:
    """Return how many scans were placed, the largest errors, and how many 95 % intervals hold the true values."""
    true = {scan.title: scan.place for scan in case.scans}
    away, turned, held = [], [], []
    for number, scan in enumerate(found.scans):
        place, expected = scan.place, true[scan.title]
        shifts = [at - was for at, was in zip(place.position, expected.position, strict=True)]
        errors = [*shifts, math.remainder(place.heading - expected.heading, math.tau)]
        away.append(math.hypot(*shifts))
        turned.append(abs(errors[2]))
        known = ((error, found.deviations.get(Move("place", number, part))) for part, error in enumerate(errors))
        held += [abs(error) <= _Z95 * sd for error, sd in known if sd is not None]
    return (
        f"{len(found.scans)} of {len(case.scans)} placed, within {max(away) * 100:.1f} cm and "
        f"{math.degrees(max(turned)):.1f}°; {sum(held)} of {len(held)} intervals of poses hold"
    )
