"""Errors of fits and coverage of their credible intervals: `python -m benchmarks.fit [DRAWS [FIRST]] [--mismatch]`.

Simulates scans with ground truth and the errors of real ones: 1 mm in range, 0.5 dB in level, 2 % of pings lost, 3 % of
readings with a random range, 0.2 K in temperature. Prints the errors of fits, the coverage of their credible intervals,
reflectances fitted from several places at once, and the duration of a fit with the whole room as prior. With
`--mismatch`, prints the coverage and the warnings if room, levels or turntable differ from what the fit is given.
FIRST is the number of the first draw: draws that showed what to change are no evidence of the change.
"""

import argparse
import math
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context

import numpy as np
from sonarhw_compare.fit import FitOptions, FitResult, Parameter, PlacedScan, fit_scans, free_parameters
from sonarhw_compare.fit.free_walls import with_shifted_walls
from sonarhw_compare.fit.quantities import HEADING, PlaceQuantity, Quantity, X, Y
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, Room, inside, load_room, wall_distances

from benchmarks.cases.synthetic_scan import READINGS, THERMOMETER, synthetic_scan

ROOMS = ("simple", "arena", "laboratory")
DRAWS = 500
NEAR = 0.1  # m: half width of the prior of position around the truth
_MEASURED = 200  # draws with the board's own receiver that determined the factors `Quantity.overlap`
FREE = ("position", "heading", "offset", "threshold")


def board_of(room: Room) -> Board:
    """Return the default board with the paper's receiver.

    For the simple room, which is within its blanking, the board detects from 0.15 m.
    """
    board = replace(load_board("polaroid-6500"), receiver=Receiver.FIRST_ECHO)
    return replace(board, blanking_inhibit=0.9e-3) if room.name == "Simple room" else board


def place_in(room: Room, random: np.random.Generator, clearance: float = 0.12) -> Place:
    """Return a random place inside the room, `clearance` (m) from every wall and post, with a random heading."""
    ends = room.walls.reshape(-1, 2)
    while True:
        point = random.uniform(ends.min(axis=0), ends.max(axis=0))
        if inside(point[None], room.walls)[0] and _clear(room, point) > clearance:
            return Place("drawn", (float(point[0]), float(point[1])), float(random.uniform(0, math.tau)))


def _clear(room: Room, point: np.ndarray) -> float:
    walls = wall_distances(point[None], room.walls)[0]
    posts = np.hypot(*(room.posts[:, :2] - point).T) - room.posts[:, 2]
    return float(np.concatenate((walls, posts)).min())


@dataclass(frozen=True)
class DrawnFit:
    """A fit of a scan with ground truth."""

    room: str
    errors: dict[str, float]  # by parameter: fitted minus true
    covered: dict[str, bool]  # whether the credible interval contains the truth
    deviations: dict[str, float]
    named: bool | None  # whether a warning names what is off; None if nothing is
    warned: bool  # whether a warning names anything


def drawn_fit(
    seed: int, samples: int = 8000, receiver: Receiver = Receiver.FIRST_ECHO, mismatch: str = "none"
) -> DrawnFit:
    """Return the fit of draw number `seed`: the next room, a random place, and random free parameters.

    The scan is that of a room and board with a `mismatch`, one of `MISMATCHES`.
    """
    random = np.random.default_rng((seed, 6))
    name = ROOMS[seed % len(ROOMS)]
    room = load_room(f"rooms/{name}.toml")
    board, place = replace(board_of(room), receiver=receiver), place_in(room, random)
    truth = {
        "x": place.position[0],
        "y": place.position[1],
        "heading": place.heading,
        "offset": float(random.uniform(-0.02, 0.02)),
        "threshold": board.threshold_db + float(random.uniform(-3, 3)),
    }
    real = replace(board, range_offset=-truth["offset"], threshold_db=truth["threshold"])
    warmer = float(random.normal(0, THERMOMETER))
    true_room, real, wrong = mismatched(mismatch, room, real, np.random.default_rng((seed, 9)))
    readings = synthetic_scan(true_room, place, real, seed, warmer=warmer)
    near = [_near(parameter, truth, random) for parameter in free_parameters(FREE, ["drawn"], room, board)]
    options = FitOptions(seed=seed, samples=samples)
    result = fit_scans([PlacedScan(readings, place)], room, board, near, options=options)
    return DrawnFit(
        name,
        {key: _error(result, key, truth[key]) for key in truth},
        {key: _covers(result, key, truth[key]) for key in truth},
        {key: result.estimates[key].deviation for key in truth},
        any(set(wrong) & {one.parameter.name, *one.alternatives} for one in result.mismatches) if wrong else None,
        bool(result.mismatches),
    )


MISMATCHES = ("none", "one wall", "all walls", "aperture", "turntable", "reflectance")


def mismatched(
    mismatch: str, room: Room, board: Board, random: np.random.Generator
) -> tuple[Room, Board, tuple[str, ...]]:
    """Return the true room and board if the given ones have a mismatch, and the parameters that are off.

    One wall is 1 cm off; all walls are off with a standard deviation of 5 mm; the aperture is 1.2 times as large; the
    turntable turns 1 % too far; the reflectances are 0.75 times as large.
    """
    walls = room.names[: len(room.walls)]
    match mismatch:
        case "one wall":
            wall = walls[random.integers(len(walls))]
            return with_shifted_walls(room, {wall: 0.01 * float(random.choice([-1, 1]))}), board, (f"wall:{wall}",)
        case "all walls":
            shifts = {wall: float(random.normal(0, 0.005)) for wall in walls}
            return with_shifted_walls(room, shifts), board, tuple(f"wall:{wall}" for wall in walls)
        case "aperture":
            return room, replace(board, aperture_radius=1.2 * board.aperture_radius), ("aperture",)
        case "turntable":
            return room, replace(board, turntable_scale=1.01), ("scale",)
        case "reflectance":
            off = tuple(f"reflectance:{material}" for material in dict.fromkeys(room.materials))
            return replace(room, reflectances=0.75 * room.reflectances), board, off
    return room, board, ()


def print_mismatches(draws: range) -> None:
    """Print, for each mismatch, median deviations, coverages, and how often a warning names it."""
    print(f"{len(draws)} draws each; free: {', '.join(FREE)}; coverage of 95 % intervals and median ±")
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for mismatch in MISMATCHES:
            drawn = list(pool.map(partial(drawn_fit, samples=4000, mismatch=mismatch), draws))
            cells = []
            for key in drawn[0].errors:
                unit, scale = {"heading": ("°", math.degrees(1)), "threshold": ("dB", 1.0)}.get(key, ("mm", 1e3))
                stated = np.median([one.deviations[key] for one in drawn]) * scale
                cells.append(f"{key} {_of_all([one.covered[key] for one in drawn])} ± {stated:.2f} {unit}")
            named = [one.named for one in drawn if one.named is not None]
            shown = f"named {_of_all(named)}" if named else f"warned {_of_all([one.warned for one in drawn])}"
            print(f"{mismatch:12} {'  '.join(cells)}  {shown}", flush=True)


def _of_all(held: Sequence[bool]) -> str:
    """Return count and share with its 95 % interval (Clopper and Pearson): `16 of 17 (71 to 100 %)`."""
    from scipy.stats import binomtest  # slow to import, and tests import this module

    share = binomtest(sum(held), len(held)).proportion_ci()
    return f"{sum(held)} of {len(held)} ({share.low * 100:.0f} to {share.high:.0%})".replace("%)", " %)")


def _near(parameter: Parameter, truth: dict[str, float], random: np.random.Generator) -> Parameter:
    reach = {"x": NEAR, "y": NEAR, "heading": math.radians(10)}.get(parameter.name)
    if reach is None:
        return parameter
    middle = truth[parameter.name] + float(random.uniform(-0.8, 0.8)) * reach
    return replace(parameter, lower=middle - reach, upper=middle + reach)


def _error(result: FitResult, name: str, true: float) -> float:
    error = result.estimates[name].value - true
    return math.remainder(error, math.tau) if name == "heading" else error


def _covers(result: FitResult, name: str, true: float) -> bool:
    estimate = result.estimates[name]
    shift = estimate.value - _error(result, name, true) - true
    return estimate.lower <= true + shift <= estimate.upper


def coverage_table(drawn: Sequence[DrawnFit]) -> list[str]:
    """Return, for every parameter and room, median and worst error and the coverage of its credible interval."""
    lines = [f"{len(drawn)} draws, {READINGS} readings each, free: {', '.join(FREE)}"]
    for name in (*ROOMS, "all"):
        rows = [one for one in drawn if name in (one.room, "all")]
        for key in rows[0].errors if rows else ():
            unit, scale = {"heading": ("°", math.degrees(1)), "threshold": ("dB", 1.0)}.get(key, ("mm", 1e3))
            errors = np.abs([one.errors[key] for one in rows]) * scale
            stated = np.median([one.deviations[key] for one in rows]) * scale
            held = np.mean([row.covered[key] for row in rows])
            lines.append(
                f"{name:11} {key:10} median error {np.median(errors):7.3f} {unit:2}  95 % below "
                f"{np.percentile(errors, 95):7.3f} {unit:2}  stated ± {stated:7.3f} {unit:2}  "
                f"coverage {held:6.1%}"
            )
    return lines


def reflectance_fit(seed: int) -> list[tuple[float, float, float]]:
    """Fit the reflectances of the arena's two halves to three scans with all echoes: true, fitted, stated ± each."""
    random = np.random.default_rng((seed, 7))
    room = load_room("rooms/arena.toml")
    board, true = board_of(room), random.uniform(0.75, 0.95, 2)
    halves = tuple("board" if row < len(room.names) // 2 else "foam" for row in range(len(room.names)))
    room = replace(room, materials=halves)
    real = replace(room, reflectances=np.array([true[0] if name == "board" else true[1] for name in halves]))
    scans = []
    for k in range(3):
        place = place_in(room, random)
        scans.append(PlacedScan(synthetic_scan(real, place, board, 100 * seed + k, echoes=5), place, f"scan{k}"))
    free = free_parameters(("position", "heading", "reflectance"), [scan.name for scan in scans], room, board)
    near = [_around(one, scans) if isinstance(one.quantity, PlaceQuantity) else one for one in free]
    result = fit_scans(scans, room, board, near, options=FitOptions(seed=seed))
    found = [result.estimates[f"reflectance:{name}"] for name in ("board", "foam")]
    return [(float(one), each.value, each.deviation) for one, each in zip(true, found, strict=True)]


def _around(parameter: Parameter, scans: Sequence[PlacedScan]) -> Parameter:
    place = scans[parameter.scan or 0].place
    near: dict[Quantity, tuple[float, float]] = {
        X: (place.position[0], NEAR),
        Y: (place.position[1], NEAR),
        HEADING: (place.heading, math.radians(10)),
    }
    at, reach = near[parameter.quantity]
    return replace(parameter, lower=at - reach, upper=at + reach)


def timed_fit(seed: int, echoes: int = 1) -> float:
    """Return the seconds of a fit of position and heading with the whole arena, eight walls, as prior."""
    random = np.random.default_rng((seed, 8))
    room = load_room("rooms/arena.toml")
    board, place = board_of(room), place_in(room, random)
    scan = PlacedScan(synthetic_scan(room, place, board, seed, echoes=echoes), Place("", (1.0, 0.5)))
    free = free_parameters(("position", "heading"), [""], room, board)
    begin = time.perf_counter()
    fit_scans([scan], room, board, free)
    return time.perf_counter() - begin


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("draws", nargs="?", type=int, help=f"default {DRAWS}, or {_MEASURED} of each mismatch")
    parser.add_argument("first", nargs="?", type=int, default=0, help="number of the first draw")
    parser.add_argument("--mismatch", action="store_true")
    given = parser.parse_args()
    draws = given.draws or (_MEASURED if given.mismatch else DRAWS)
    drawn = range(given.first, given.first + draws)
    if given.mismatch:
        print_mismatches(drawn)
        return
    timed_fit(0)  # compiles
    for echoes in (1, 5):
        seconds = sorted(timed_fit(seed, echoes) for seed in range(1, 6))
        title = f"whole room as prior, {READINGS} readings of {echoes}, 8 walls"
        print(f"{title}: {seconds[2]:.1f} s per fit ({seconds[0]:.1f} to {seconds[-1]:.1f})", flush=True)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        print("\n".join(coverage_table(list(pool.map(drawn_fit, drawn, chunksize=4)))))
        own = partial(drawn_fit, receiver=Receiver.BOARD)
        print("by the board's own receiver, both in the scan and in the fit:")
        fresh = range(_MEASURED, _MEASURED + max(1, draws // 5))
        print("\n".join(coverage_table(list(pool.map(own, fresh, chunksize=4)))))
        for several in pool.map(reflectance_fit, range(max(1, draws // 50))):
            for true, found, stated in several:
                print(f"reflectance {true:.3f}: fitted {found:.3f} ± {stated:.3f}, error {found - true:+.3f}")


if __name__ == "__main__":
    main()
