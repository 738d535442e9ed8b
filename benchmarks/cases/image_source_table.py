"""Specular paths up to seven reflections, compared with the image-source model of pyroomacoustics.

Yields rows for the table of `benchmarks.speed`, for random rooms of 20 walls: speed, share of its paths found, and
number of additional paths. There are no rows if the library is not installed.
"""

import importlib.util
import math
import time
from collections.abc import Iterator

import numpy as np
from sonarhw_sim.rays.paths import PathSearch, find_paths
from sonarhw_sim.room.room import Room, parse_room

from benchmarks.cases.table_rows import Row, at_least, at_most
from sonarhw.readings import FloatArray

WALLS = 20
REFLECTIONS = 7
ROOMS = 3
RAYS = 2880  # 1/8° apart
SOURCE, RECEIVER = (0.11, -0.07), (-0.23, 0.31)
_SAME = 1e-4  # m; pyroomacoustics calculates in single precision


def compare_with_image_sources() -> Iterator[Row]:
    """Yield the rows."""
    if importlib.util.find_spec("pyroomacoustics") is None:
        return
    theirs_time = ours_time = 0.0
    expected = found = additional = 0
    for seed in range(ROOMS):
        corners = corners_of_a_room(seed)
        began = time.process_time()
        theirs = image_source_lengths(corners)
        theirs_time += time.process_time() - began
        room = room_of(corners)
        ray_lengths(room)  # compiles before the measurement
        began = time.process_time()
        ours = ray_lengths(room)
        ours_time += time.process_time() - began
        both = matched_pairs(theirs, ours)
        expected, found, additional = expected + len(theirs), found + both, additional + len(ours) - both
    yield at_least("all paths to 7 reflections, 20 walls: times pyroomacoustics", 1000, theirs_time / ours_time)
    yield at_least(f"  share of its {expected} paths found, %", 99.5, 100 * found / expected)
    yield at_most("  additional paths found", 0, additional)


def corners_of_a_room(seed: int) -> FloatArray:
    """Return the corners of a closed room around the origin, at random distances, (20, 2) m."""
    random = np.random.default_rng(seed)
    angles = (np.arange(WALLS) + random.uniform(-0.3, 0.3, WALLS)) * math.tau / WALLS
    radii = random.uniform(1.5, 3.0, WALLS)
    return np.column_stack((radii * np.cos(angles), radii * np.sin(angles)))


def image_source_lengths(corners: FloatArray) -> FloatArray:
    """Return the lengths of the paths that pyroomacoustics finds, sorted, m."""
    import pyroomacoustics

    room = pyroomacoustics.Room.from_corners(
        corners.T, fs=16_000, max_order=REFLECTIONS, materials=pyroomacoustics.Material(0.1)
    )
    room.add_source(SOURCE)
    room.add_microphone(np.array(RECEIVER)[:, None])
    room.image_source_model()
    images = room.sources[0].images[:, room.visibility[0][0].astype(bool)]
    return np.sort(np.hypot(images[0] - RECEIVER[0], images[1] - RECEIVER[1]))


def room_of(corners: FloatArray) -> Room:
    """Return the same room for rays."""
    points = ", ".join(f"[{x!r}, {y!r}]" for x, y in corners.tolist())
    return parse_room(
        'name = "Random"\n[materials.hard]\nreflectance = 0.9\n[[walls]]\nname = "wall"\nclosed = true\n'
        f'material = "hard"\npoints = [{points}]',
        "random room",
    )


def ray_lengths(room: Room) -> FloatArray:
    """Return the lengths of the paths that rays find, sorted, m."""
    # no path of seven reflections is longer than eight times the room
    search = PathSearch(8 * 6.0, 0.007, REFLECTIONS, diffraction=False, rays=RAYS)
    return find_paths(room, SOURCE, search, RECEIVER).lengths


def matched_pairs(theirs: FloatArray, ours: FloatArray) -> int:
    """Return how many of the sorted lengths have a separate match among the others."""
    i = j = both = 0
    while i < len(theirs) and j < len(ours):
        if abs(theirs[i] - ours[j]) <= _SAME:
            i, j, both = i + 1, j + 1, both + 1
        elif theirs[i] < ours[j]:
            i += 1
        else:
            j += 1
    return both
