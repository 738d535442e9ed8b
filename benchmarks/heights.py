"""Readings and paths in rooms with heights: `python -m benchmarks.heights`.

Counts wrong readings, 180 in each of 24 random boxes and 24 L-shaped rooms with a table, against images in space
(`tests/oracles/brute/spatial.py`), and compares the work there with that in the plan: median and range. Then how many
paths over and under low walls a search misses, and its work.

Compares mirror paths up to 21.4 m with those of a search with eight times as many slopes. This one can miss paths too,
so the numbers are a lower bound. *loud* are those that `polaroid-6500` can detect at some heading, *changed* the
readings at 360 headings, of each receiver, that differ by more than 1 cm with the paths of the thorough search.

The work in space is relative to that in the plan of the same room: number of all paths, of mirror paths, which no edge
bends, and of loud ones; processor time of the search; and that of a prediction at 360 headings with `polaroid-6500`, as
commands make it. At most 6 times the time in the plan is required; each kind of room has a line that states whether
this is held, for random rooms by the median.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import loud_enough
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, weigh_paths
from sonarhw_sim.rays import passing
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.room import Place, Room, load_room, parse_room
from sonarhw_sim.space.sections import paths_from

from tests.oracles.brute.furnished import Compared
from tests.oracles.brute.spatial import compare_in_box, compare_in_l_shape, random_box, random_l_shape

ROOMS, HEADINGS = 24, 180
MOST_TIME = 6.0  # times that in the plan: required
SEARCH = PathSearch(21.4, 0.00695, diffraction=False)
EDGES_TOO = replace(SEARCH, diffraction=True, ka=16.0)
NEAR = 8.0  # m
BOARD = load_board("polaroid-6500")
ALL_ROUND = np.radians(np.arange(360.0))
DIFFERENT = 0.01  # m
FURNISHED = """
name = "furnished"
[materials.hard]
reflectance = 0.9
[floor]
height = 0.0
material = "hard"
[ceiling]
height = 2.4
material = "hard"
[[walls]]
name = "room"
points = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]]
closed = true
material = "hard"
[[walls]]
name = "fence"
points = [[0.5, 0.4], [0.9, 1.6]]
material = "hard"
height = [0.0, 0.7]
[[walls]]
name = "panel"
points = [[2.0, 0.3], [2.2, 1.2]]
material = "hard"
height = [0.9, 2.0]
[places.here]
position = [1.4, 0.8]
height = 1.1
"""


def wrong_readings(compare: Callable[[int, int], Compared]) -> str:
    """Return how many readings differ from those of images in space."""
    compared = [compare(seed, HEADINGS) for seed in range(ROOMS)]
    wrong, unsure = (
        sum(int(rows.sum()) for rows in column) for column in zip(*((c.wrong, c.unsure) for c in compared), strict=True)
    )
    silent = sum(int(np.isnan(c.predicted).sum()) for c in compared)
    return f"{wrong} wrong of {ROOMS * HEADINGS} readings ({silent} without an echo), {unsure} unsure"


def missed(room: Room, place: Place) -> str:
    """Return a row: paths found by the thorough search and missed by the usual one: all, up to 8 m, loud; readings."""
    usual = paths_from(room, place, SEARCH)
    slopes = passing.SLOPES
    passing.SLOPES = 8 * slopes
    try:
        thorough = paths_from(room, place, SEARCH)
    finally:
        passing.SLOPES = slopes
    known, found = _rows(usual), _rows(thorough)
    all_of = set(found.values())
    lost = {row for path, row in found.items() if path not in known}
    near = set(np.flatnonzero(thorough.lengths < NEAR).tolist()) & all_of
    loud = set(loud_enough(room, BOARD, thorough, 0.0).tolist()) & all_of
    counts = (len(rows) for kind in (all_of, near, loud) for rows in (kind, kind & lost))
    return " ".join(f"{count:8d}" for count in (*counts, _changed(room, place, usual, thorough)))


def _rows(paths: Paths) -> dict[tuple[object, ...], int]:
    """Return the row of each path, by its surfaces and direction."""
    columns = enumerate(zip(paths.surfaces.tolist(), paths.departures.tolist(), strict=True))
    return {(*(k for k in touched if k >= 0), round(angle, 5)): row for row, (touched, angle) in columns}


def _changed(room: Room, place: Place, usual: Paths, thorough: Paths) -> int:
    """Return how many readings of both receivers differ between these paths."""
    changed = 0
    for receiver in Receiver:
        options = PredictionOptions(receiver=receiver)
        one, other = (weigh_paths(room, place, BOARD, ALL_ROUND, paths, options).ranges for paths in (usual, thorough))
        changed += int(((np.abs(one - other) > DIFFERENT) | (np.isnan(one) != np.isnan(other))).sum())
    return changed


class Work(NamedTuple):
    """What a prediction needs: a number for one room, or for the same in space over that in the plan."""

    paths: float
    mirror: float  # paths that no edge bends
    loud: float  # paths that `polaroid-6500` can detect at some heading
    search: float  # s of processor time
    prediction: float


def work(room: Room, place: Place) -> Work:
    """Return the work for a place."""
    paths = paths_from(room, place, EDGES_TOO)
    return Work(
        len(paths),
        int((paths.edges < 0).sum()),
        len(loud_enough(room, BOARD, paths, 0.0)),
        _seconds(partial(paths_from, room, place, EDGES_TOO)),
        _seconds(partial(predict_scan, room, place, BOARD, ALL_ROUND)),
    )


def beside_plan(room: Room, place: Place) -> Work:
    """Return the work in space over that in the plan."""
    in_space, in_plan = work(room, place), work(room, replace(place, height=None))
    return Work(*(one / other for one, other in zip(in_space, in_plan, strict=True)))


def all_beside_plan(scenes: Iterable[tuple[Room, Place]]) -> tuple[str, Work]:
    """Return a text with median and range of the work in these rooms over that in the plan, and the medians."""
    each = np.array([beside_plan(room, place) for room, place in scenes])
    middles = Work(*np.median(each, axis=0).tolist())
    columns = zip(Work._fields, middles, each.min(axis=0), each.max(axis=0), strict=True)
    text = ", ".join(f"{name} {middle:.1f} ({least:.1f} to {most:.1f})" for name, middle, least, most in columns)
    return text, middles


def held(work_beside_plan: Work) -> str:
    """Return whether the required time is held by the search and by the prediction."""
    times = (("search", work_beside_plan.search), ("prediction", work_beside_plan.prediction))
    each = (f"{name} {'held' if times_plan <= MOST_TIME else 'not held'}" for name, times_plan in times)
    return f"at most {MOST_TIME:g} times the plan: {', '.join(each)}"


def _seconds(job: Callable[[], object]) -> float:
    times = []
    for _ in range(4):
        began = time.process_time()
        job()
        times.append(time.process_time() - began)
    return min(times)


def main() -> None:
    """Print the counts and the table."""
    boxes, l_shapes = map(random_box, range(ROOMS)), map(random_l_shape, range(ROOMS))
    print(f"boxes: {wrong_readings(compare_in_box)}", flush=True)
    text, middles = all_beside_plan((box.room, box.place) for box in boxes)
    print(f"boxes: over the plan: {text}", flush=True)
    print(f"boxes: {held(middles)}", flush=True)
    print(f"L-shaped rooms with a table: {wrong_readings(compare_in_l_shape)}", flush=True)
    text, middles = all_beside_plan(l_shapes)
    print(f"L-shaped rooms with a table: over the plan: {text}", flush=True)
    print(f"L-shaped rooms with a table: {held(middles)}", flush=True)
    heads = ("found", "missed", "to 8 m", "missed", "loud", "missed", "changed")
    print(f"{'':22} {' '.join(f'{head:>8}' for head in heads)}  over the plan: {', '.join(Work._fields)}")
    doorstep, furnished = load_room("doorstep"), parse_room(FURNISHED, "furnished")
    for room, name in ((furnished, "here"), (doorstep, "robot"), (doorstep, "tripod")):
        place = room.places[name]
        times = beside_plan(room, place)
        row = " ".join(f"{value:5.1f}" for value in times)
        print(f"{room.name + ', ' + name:22} {missed(room, place)} {row}  {held(times)}", flush=True)


if __name__ == "__main__":
    main()
